"""What the Live view says: never an old answer as a new one, never a number without its error."""

from dataclasses import replace
from time import monotonic

import numpy as np
import pytest

from kochab.core.attitude import ARCSEC, Attitude
from kochab.core.capture import CaptureLimits
from kochab.core.frame import Frame, Hint
from kochab.solver.camera_profile import new_profile
from kochab.solver.tracker import TrackUpdate
from kochab.text.angle_text import AngleStyle, age_text
from kochab.window.live import status_text
from kochab.window.live.rendering import levels_of
from kochab.workflows.live.capture import Shot
from kochab.workflows.live.update import Drift, GoodPointing, LiveUpdate
from kochab.workflows.session.live_stream import Lens
from tests.workflows.live_sources import CAMERA, refusal, solution


def shot(number=7, ago_s=0.1, exposure_s=0.2):
    now = monotonic()
    frame = Frame(np.zeros((4, 6), np.uint16), hint=Hint(exposure_s=exposure_s))
    return Shot(number, frame, now - ago_s, now - ago_s / 2)


def track(found, mode="tracking", **more):
    from datetime import UTC, datetime

    answer = (found, None) if not hasattr(found, "reason") else (None, found)
    return TrackUpdate(datetime(2026, 3, 1, tzinfo=UTC), mode, *answer, **more)


def tracked(ago_s=0.1, **more):
    taken, found = shot(ago_s=ago_s), solution()
    sure = Attitude(found.attitude.matrix, np.diag([1e-12, 4e-12, 1e-8]))
    told = track(
        found,
        filtered=sure,
        rates_deg_s=(0.001, -0.002, 0.01),
        rates_sigma_deg_s=(1e-4, 1e-4, 1e-3),
        expected=40,
        matched=38,
        **more,
    )
    good = GoodPointing(found, taken.number, taken.shutter_s)
    return LiveUpdate(taken, told, monotonic(), good, frames_hz=5.0, solved_hz=4.96, dropped=1200)


def lost(good_ago_s=5.0):
    taken = shot(9)
    good = GoodPointing(solution(), 7, monotonic() - good_ago_s)
    return LiveUpdate(taken, track(refusal(), "lost"), monotonic(), good)


def test_a_new_answer_is_new_and_tells_its_error():
    update = tracked()
    assert not status_text.is_old(update, monotonic())
    state = status_text.stream_status(update, monotonic())
    assert (state.title, state.role) == ("Tracking", "heading")
    assert "38 of 40" in state.text
    assert status_text.position_texts(update, AngleStyle.DECIMAL) == ("80.00000°", "+20.00000°")
    assert status_text.sigma_text(update) == "± 0.413″ in x, 0.206″ in y, 20.6″ in rotation"
    assert status_text.rates_text(update).startswith("x +3.60 ± 0.36,  y −7.20 ± 0.36")
    assert status_text.frame_rate_text(update) == "5.0 fps, 1,200 dropped"
    assert status_text.frame_rate_tip(update, 29.96) == "Solved: 5.0 fps, drawn: 30 fps"


def test_a_frame_without_an_answer_leaves_the_last_one_old_and_says_why():
    update = lost()
    assert status_text.is_old(update, monotonic())
    state = status_text.stream_status(update, monotonic())
    assert state.role == "bad"
    assert state.title == "No solution: no stars visible"
    assert state.text == "Wait for the clouds to pass."
    assert status_text.position_texts(update, AngleStyle.DECIMAL)[0] == "80.00000°"
    assert status_text.sigma_text(update) == status_text.rates_text(update) == status_text.NOTHING


def test_an_answer_ages_though_no_frame_comes():
    update = tracked()
    later = monotonic() + 10.0
    assert status_text.is_old(update, later)
    assert status_text.stream_status(update, later).title == "No new frames"
    assert "10 s" in status_text.stream_status(update, later).text
    searching = status_text.stream_status(update, later, seen_s=later - 0.1)
    assert (searching.title, searching.role) == ("Searching", "bad")


def test_a_long_exposure_is_not_old_while_the_next_one_is_taken():
    taken = shot(exposure_s=60.0, ago_s=31.0)
    good = GoodPointing(solution(), taken.number, taken.shutter_s)
    update = LiveUpdate(taken, track(solution()), monotonic(), good)
    assert not status_text.is_old(update, monotonic() + 60.0)


def test_a_frame_of_another_night_is_not_old_while_it_is_new_here():
    """A file of 2023, dropped into a watched folder: "No new frames" stood over one that was solved 0.4 s before."""
    now, years_s = monotonic(), 3.7 * 365.25 * 86400
    update = tracked()
    file = replace(update, shot=replace(update.shot, shutter_s=now - years_s, received_s=now - 0.4))
    file = replace(file, last_good=GoodPointing(solution(), file.shot.number, file.shot.shutter_s))
    assert file.recorded
    assert not update.recorded
    assert not status_text.is_old(file, now)
    assert status_text.stream_status(file, now).title == "Tracking"
    assert file.shown_age_s(now) == pytest.approx(0.4)
    assert file.age_s(now) == pytest.approx(years_s), "what programs read stays the age of the exposure"
    later = now + 60.0
    assert status_text.is_old(file, later)
    assert "Last frame 60 s ago" in status_text.stream_status(file, later).text
    assert status_text.old_text(file.last_good.age_s(now)).startswith("Taken ")


def test_there_may_be_nothing_to_say():
    update = LiveUpdate(shot(), track(refusal(), "lost"), monotonic())
    assert not status_text.is_old(update, monotonic())
    assert status_text.position_texts(update, AngleStyle.DECIMAL) == (status_text.NOTHING, status_text.NOTHING)
    assert status_text.drift_texts(None) == (status_text.NOTHING, status_text.NOTHING)


def test_rates_of_a_slew_are_in_degrees():
    update = tracked()
    fast = replace(update, track=replace(update.track, rates_deg_s=(2.0, -0.1, 0.0)))
    assert status_text.rates_text(fast).endswith("°/s")
    assert "x +2.00" in status_text.rates_text(fast)


def test_a_rate_is_shown_once_it_is_measured():
    """On the first frame the filter knows no more than before it: 120″/s about each axis."""
    sigmas = np.degrees(np.array([120.0, 11.0, 13.0]) * ARCSEC)
    first = replace(
        tracked(), track=replace(tracked().track, rates_deg_s=(0.0,) * 3, rates_sigma_deg_s=(sigmas[0],) * 3)
    )
    assert status_text.rates_text(first) == status_text.NOTHING
    later = replace(first, track=replace(first.track, rates_sigma_deg_s=tuple(sigmas)))
    assert status_text.rates_text(later) == "y +0.00 ± 11.0 ″/s"
    slewing = replace(later, track=replace(later.track, rates_deg_s=(0.0, 0.05, 0.0)))
    assert "z +0.00 ± 13.0 ″/s" in status_text.rates_text(slewing)


def test_drift_has_a_sign_a_sigma_and_a_span():
    east, north = status_text.drift_texts(Drift(12.34, -3.21, 0.4, 0.5, 58.6, 200))
    assert east == "+12.3 ± 0.40 ″/min  (over 59 s)"
    assert north == "−3.21 ± 0.50 ″/min  (over 59 s)"


@pytest.mark.parametrize(
    ("age", "text"), [(0.04, "0.0 s"), (4.25, "4.2 s"), (61.0, "61 s"), (600, "10 min"), (9000, "2.5 h")]
)
def test_ages_are_short(age, text):
    assert age_text(age) == text


def test_what_is_known_of_the_lens():
    assert status_text.lens_text(Lens()) == "Not measured yet"
    known = replace(new_profile("guide scope", CAMERA), frames=1234)
    assert "3000.0" in status_text.lens_text(Lens(known))
    assert "1,234 frames" in status_text.lens_text(Lens(known))


@pytest.mark.parametrize(
    ("values", "advice"),
    [([0.3, 0.3, 0.4, 0.5], ""), ([0.001] * 50, "Increase"), ([0.7] * 50, "Reduce"), ([0.1, 0.1, 1.0, 1.0], "clipped")],
)
def test_the_exposure_is_judged(values, advice):
    text = status_text.levels_text(levels_of(np.array(values) * 4095, 4095.0))
    assert advice in text
    assert ("the exposure" in text) == bool(advice)


def test_what_a_camera_does_not_allow_has_a_reason():
    assert set(status_text.fixed_settings(CaptureLimits(exposure_s=(0.1, 2.0), binning=(1, 1)))) == {"gain", "binning"}
