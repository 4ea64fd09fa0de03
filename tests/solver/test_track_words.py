"""What the tracker asks of a blind solve, forgets and tells, without any frame being read."""

import re
from dataclasses import replace
from datetime import timedelta
from types import SimpleNamespace

import numpy as np
import pytest

import kochab.solver.tracker as track
from kochab.attitude.filter import begin
from kochab.core.attitude import Attitude, attitude_from, unit_vectors
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Frame
from kochab.core.progress import run
from kochab.core.solution import NamedStar, NoSolution, Reason, Solution
from kochab.detection.windows import WindowStars
from kochab.identification.predictional_estimate import Estimate
from kochab.solver import SolveOptions
from kochab.solver.camera_profile import Profile, TrackedCamera, new_profile
from kochab.solver.pipeline import Examined
from kochab.solver.track_prediction import Expected
from kochab.solver.track_windows import Tracked, WindowSearchResult
from kochab.solver.tracker import Tracker, filter_after_blind_solve, tracked_solution

from .stream import START, prediction

CAMERA = Camera.centred(640, 480, 3000.0)
FIRST = attitude_from(84.0, -2.0, 25.0)
SURE = Attitude(FIRST.matrix, np.diag([1e-10, 1e-10, 1e-9]))
EMPTY = Frame(np.zeros((480, 640), np.uint16))


def refused() -> NoSolution:
    return NoSolution(Reason.NO_PATTERN_AGREED, "", "all", 0)


def solved(count=20, attitude=SURE, rms_px=0.2, camera=CAMERA) -> Solution:
    """Exact places of stars of magnitudes 1, 2, 3..."""
    xy = np.random.default_rng(7).uniform(20.0, [620.0, 460.0], (count, 2))
    vectors = camera.unproject(xy) @ attitude.matrix
    ra = np.degrees(np.arctan2(vectors[:, 1], vectors[:, 0])) % 360.0
    dec = np.degrees(np.arcsin(vectors[:, 2]))
    stars = tuple(
        NamedStar(x, y, f"star {k}", "", 1.0 + k, a, d, 0.1)
        for k, ((x, y), a, d) in enumerate(zip(xy.tolist(), ra.tolist(), dec.tolist(), strict=True))
    )
    return Solution(camera, attitude, stars, rms_px, -20.0, "known", count, {})


class Blind:
    """In place of the blind solve: answers in turn, and the options of every call."""

    def __init__(self, *answers):
        self.answers, self.options = list(answers), []

    def __call__(self, frame, options):
        self.options.append(options)
        return Examined(Detections.from_list(np.zeros((0, 2)), 640, 480), self.answers.pop(0))
        yield


@pytest.fixture
def blind(monkeypatch):
    def answer(*answers):
        made = Blind(*answers)
        monkeypatch.setattr(track, "examine_frame", made)
        return made

    return answer


def at(tracker, seconds, frame=EMPTY):
    return run(tracker.update(frame, START + timedelta(seconds=seconds)))


def unseen(tracker):
    """A tracker that finds nothing in its windows."""
    tracker._find_stars = lambda *_: None
    return tracker


def test_the_scale_of_the_frames_before_is_good_to_three_hundredths_and_is_doubted_after_two_failures(blind) -> None:
    tracker, wanted = unseen(Tracker()), SolveOptions(fov_deg=12.0)
    tracker = unseen(Tracker(options=wanted))
    solve = blind(solved(), *[refused()] * 5, solved(), refused())
    for k in range(8):
        at(tracker, 0.1 * k)
    first, *others = solve.options
    assert first == wanted
    scale = tracker.camera.scale_arcsec_px
    for options in others:
        assert options.hint.scale_arcsec_px == pytest.approx((scale / 1.03, scale * 1.03), rel=1e-3)
        assert options.fov_deg is None
    assert [options.blind_after_hint for options in others] == [False] * 2 + [True] * 4 + [False]


def test_a_person_who_wants_no_blind_search_gets_none_after_failures_either(blind) -> None:
    tracker = unseen(Tracker(options=SolveOptions(blind_after_hint=False)))
    solve = blind(solved(), *[refused()] * 12)
    for k in range(13):
        at(tracker, 0.1 * k)
    assert not any(options.blind_after_hint for options in solve.options)


@pytest.mark.parametrize(("seconds", "kept"), [(899.0, True), (901.0, False), (-0.9, True), (-1.1, False), (0.0, True)])
def test_a_pointing_holds_for_a_quarter_of_an_hour_and_a_second_back(blind, seconds, kept) -> None:
    tracker = unseen(Tracker())
    blind(solved(), refused())
    at(tracker, 0.0)
    at(tracker, seconds)
    assert (prediction(tracker, START) is not None) is kept
    assert (tracker.camera is not None) is kept


@pytest.mark.parametrize("shape", [(480, 641), (481, 640), (640, 480)])
def test_a_frame_of_another_size_begins_anew(blind, shape) -> None:
    tracker = unseen(Tracker())
    blind(solved(), refused())
    at(tracker, 0.0)
    at(tracker, 0.1, Frame(np.zeros(shape, np.uint16)))
    assert tracker.camera is None


@pytest.mark.parametrize(("frames", "size", "hinted"), [(1, 640, True), (0, 640, False), (1, 641, False)])
def test_a_profile_of_this_size_that_has_seen_frames_gives_the_scale(blind, frames, size, hinted) -> None:
    profile = replace(new_profile("lens", Camera.centred(size, 480, 3000.0)), frames=frames)
    tracker = Tracker(profile=profile)
    solve = blind(refused())
    at(tracker, 0.0)
    (options,) = solve.options
    assert (options.hint is not None) is hinted
    assert options.blind_after_hint
    if hinted:
        assert options.hint.scale_arcsec_px == profile.hint.scale_arcsec_px


def test_a_frame_without_an_answer_tells_nothing_and_one_that_was_solved_all(blind) -> None:
    tracker = unseen(Tracker())
    blind(refused(), solved(20))
    nothing, found = at(tracker, 0.0), at(tracker, 0.1)
    assert nothing.reason is not None
    assert (nothing.mode, nothing.solution, nothing.filtered, nothing.filtered_centre) == ("lost", None, None, None)
    assert (nothing.expected, nothing.matched, nothing.doubt) == (0, 0, "")
    assert (nothing.rates_deg_s, nothing.rates_sigma_deg_s, nothing.sigma_arcsec) == (None, None, None)
    assert (found.mode, found.reason) == ("lost", None)
    assert (found.expected, found.matched, found.doubt) == (0, 20, "")
    assert found.time_utc == START + timedelta(seconds=0.1)
    assert found.sigma_arcsec == pytest.approx(np.degrees(np.sqrt([1e-10, 1e-10, 1e-9])) * 3600.0, rel=0.05)
    np.testing.assert_allclose(found.filtered_centre.boresight, FIRST.boresight, atol=1e-4)


def test_stars_are_expected_down_to_the_ninth_tenth_of_those_that_were_solved(blind) -> None:
    tracker = unseen(Tracker())
    blind(solved(21))  # magnitudes 1 to 21
    at(tracker, 0.0)
    assert tracker._faintest == pytest.approx(19.0)


@pytest.mark.parametrize(("every", "learned"), [(10, 2), (4, 5), (1, 20), (0, 0)])
def test_the_camera_is_improved_every_so_many_tracked_frames(monkeypatch, blind, every, learned) -> None:
    tracker = Tracker()
    tracker.calibrate_every = every
    blind(solved())
    at(tracker, 0.0)
    calls = []
    monkeypatch.setattr(TrackedCamera, "learn", lambda *given: calls.append(given) or "off")
    seen = solved()
    xy = np.array([(s.x, s.y) for s in seen.stars])
    vectors = unit_vectors(np.array([s.ra_deg for s in seen.stars]), np.array([s.dec_deg for s in seen.stars]))
    estimate = Estimate(SURE, np.array([2, 0]), np.array([2, 0]), np.zeros((2, 2)), 0.3)
    windows = WindowStars(xy, np.ones(20), np.ones(20), np.ones(20, bool), np.full(3, np.nan))
    sky = SimpleNamespace(vectors=vectors)
    result = WindowSearchResult(None, sky, Expected(np.arange(20), xy), windows, Tracked(estimate, -9.0))
    doubts = []
    for _ in range(20):
        tracker._calibrate(result)
        doubts.append(tracker._doubt)
    assert len(calls) == learned
    assert [bool(d) for d in doubts] == [every > 0 and k % every == 0 for k in range(1, 21)]
    for _, places, sky, attitude, sigma_px in calls:
        np.testing.assert_array_equal(places, xy[[2, 0]])
        np.testing.assert_array_equal(sky, vectors[[2, 0]])
        assert (attitude, sigma_px) == (SURE, 0.3)


class Sky:
    """A neighbourhood of four stars, one at each quarter of the equator and one high up."""

    vectors = unit_vectors(np.array([10.0, 190.0, 350.0, 100.0]), np.array([0.0, -30.0, 5.0, 80.0]))
    mag = np.array([1.5, 2.5, 3.5, 4.5])

    def label(self, number):
        return f"id {number}", f"name {number}"


def test_a_tracked_frame_names_its_stars_with_place_and_residual() -> None:
    """Windows 2, 0 and 3 hold stars 1, 3 and 0 of the neighbourhood; the fifth find is none of them."""
    number = np.array([3, 2, 1, 0, 2])
    xy = np.arange(10.0).reshape(5, 2)
    estimate = Estimate(
        SURE, np.array([2, 0, 3]), np.array([2, 0, 3]), np.array([[3.0, 4.0], [0.0, 1.0], [2.0, 0.0]]), 0.3
    )
    seen = WindowStars(xy, np.ones(5), np.ones(5), np.array([True, False, True, True, True]), np.full(3, np.nan))
    result = WindowSearchResult(None, Sky(), Expected(number, xy), seen, Tracked(estimate, -9.5))
    told = tracked_solution(result, CAMERA, {"total": 3.0}, ("warm",))
    assert [(s.x, s.y, s.id, s.name, s.mag) for s in told.stars] == [
        (4.0, 5.0, "id 1", "name 1", 2.5),
        (0.0, 1.0, "id 3", "name 3", 4.5),
        (6.0, 7.0, "id 0", "name 0", 1.5),
    ]
    assert [s.ra_deg for s in told.stars] == pytest.approx([190.0, 100.0, 10.0])
    assert [s.dec_deg for s in told.stars] == pytest.approx([-30.0, 80.0, 0.0])
    assert [s.residual_px for s in told.stars] == pytest.approx([5.0, 1.0, 2.0])
    assert told.rms_px == pytest.approx(np.sqrt((25.0 + 1.0 + 4.0) / 3.0))
    assert (told.log10_false_alarm, told.method, told.detections) == (-9.5, "predict", 4)
    assert (told.elapsed_ms, told.warnings, told.attitude, told.camera) == ({"total": 3.0}, ("warm",), SURE, CAMERA)


# -- What a blind solve does to the filter ----------------------------------------------------------


@pytest.mark.parametrize(
    ("gap_s", "was_lost", "away_deg", "goes_on"),
    [(2.9, True, 5.0, True), (2.9, False, 5.0, False), (2.9, False, 0.0, True), (3.1, True, 0.0, False)],
)
def test_the_filter_goes_on_over_three_seconds_unless_a_tracked_camera_jumped(
    gap_s, was_lost, away_deg, goes_on
) -> None:
    before = begin(SURE, 0.0)
    before = replace(before, covariance=before.covariance * 1e-6)
    seen = replace(SURE, matrix=attitude_from(84.0, -2.0 + away_deg, 25.0).matrix)
    after = filter_after_blind_solve(before, seen, gap_s, was_lost)
    fresh = begin(seen, gap_s)
    assert np.array_equal(after.covariance, fresh.covariance) is not goes_on


# -- The tracker's camera ----------------------------------------------------------------------------


def stars_of(camera, count, attitude=SURE, seed=5):
    xy = np.random.default_rng(seed).uniform(5.0, [635.0, 475.0], (count, 2))
    return xy, camera.unproject(xy) @ attitude.matrix


def learned(frames=30, camera=CAMERA) -> Profile:
    held = TrackedCamera(new_profile("lens", camera))
    for k in range(frames):
        assert held.learn(*stars_of(camera, 60, seed=k), SURE, 0.1) == ""
    return held.profile


@pytest.mark.parametrize(("count", "frames"), [(7, 0), (8, 1)])
def test_a_frame_has_something_to_say_of_the_camera_from_eight_stars_on(count, frames) -> None:
    held = TrackedCamera(new_profile("lens", CAMERA))
    assert held.learn(*stars_of(CAMERA, count), SURE, 0.1) == ""
    assert held.profile.frames == frames


def test_a_profile_that_three_frames_in_a_row_contradict_starts_anew() -> None:
    """One that agrees in between takes the doubts back."""
    other = replace(CAMERA, focal_px=3030.0)
    held = TrackedCamera(learned())
    right, wrong = stars_of(CAMERA, 60), stars_of(other, 60)
    assert "off" in held.learn(*wrong, SURE, 0.1)
    assert "off" in held.learn(*wrong, SURE, 0.1)
    assert held.learn(*right, SURE, 0.1) == ""
    frames = held.profile.frames
    assert frames == 31
    said = [held.learn(*wrong, SURE, 0.1) for _ in range(4)]
    assert [bool(sentence) for sentence in said] == [True, True, True, False]
    assert held.profile.frames == 2
    assert held.profile.name == "lens"
    assert held.camera.focal_px == pytest.approx(3030.0, rel=1e-4)


def test_a_profile_that_has_started_anew_takes_three_contradictions_again() -> None:
    held = TrackedCamera(learned())
    wrong, third = (stars_of(replace(CAMERA, focal_px=focal), 60) for focal in (3030.0, 3060.0))
    for stars, frames in ((wrong, 30), (wrong, 30), (wrong, 1), (third, 1), (third, 1)):
        assert "off" in held.learn(*stars, SURE, 0.1)
        assert held.profile.frames == frames
    assert held.camera.focal_px == pytest.approx(3030.0, rel=1e-4)
    held.learn(*third, SURE, 0.1)
    assert held.camera.focal_px == pytest.approx(3060.0, rel=1e-4)


def test_a_frame_that_contradicts_keeps_its_own_camera_and_one_that_agrees_takes_the_profiles() -> None:
    other = replace(CAMERA, focal_px=3030.0)
    held = TrackedCamera(learned())
    said = held.begin(solved(60, camera=other, rms_px=0.05), "lens")
    found, kept = re.search(r"focal length ([\d.]+) px in this frame, ([\d.]+) ± ", said).groups()
    assert (float(found), float(kept)) == (pytest.approx(3030.0, abs=0.5), pytest.approx(3000.0, abs=0.1))
    assert held.camera == other
    assert held.begin(solved(60), "lens") == ""
    assert held.camera == held.profile.camera
    mirrored = replace(CAMERA, mirrored=True)
    assert held.begin(solved(60, camera=mirrored), "") == ""
    assert (held.profile.name, held.profile.frames, held.profile.camera.mirrored) == ("camera", 1, True)


def test_a_frame_weighs_by_the_rms_of_one_coordinate() -> None:
    """The residuals' length is the square root of two larger, and stars at their places are not better than a floor."""
    halves = []
    for rms_px in (0.4, 0.8):
        held = TrackedCamera()
        held.begin(solved(60, rms_px=rms_px), "lens")
        start = new_profile("lens", CAMERA)
        halves.append(np.trace((held.profile.information - start.information)[1:3, 1:3]))
        direct = TrackedCamera(start)
        found = solved(60)
        xy = np.array([(s.x, s.y) for s in found.stars])
        direct.learn(xy, CAMERA.unproject(xy) @ FIRST.matrix, SURE, rms_px / np.sqrt(2.0))
        np.testing.assert_allclose(held.profile.information, direct.profile.information, rtol=1e-5)
    assert halves[0] == pytest.approx(4.0 * halves[1], rel=1e-6)
