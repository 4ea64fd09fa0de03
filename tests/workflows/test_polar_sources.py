"""Frames from a camera, solved as they come; and what files must say to be of use."""

import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from kochab.core.camera import Camera
from kochab.core.capture import CameraSource
from kochab.core.errors import UsageError
from kochab.core.frame import Frame, Hint, Site
from kochab.core.progress import PREPARING, Progress, run
from kochab.core.solution import NoSolution, Reason, Solution
from kochab.frames.hints import NO_ZONE
from kochab.polar.error import PolarError
from kochab.polar.measure import PolarFindingKind
from kochab.polar.rotations import direction
from kochab.polar.sighting import Sighting
from kochab.simulate.camera import CameraConfig
from kochab.simulate.camera_source import SimulatedCamera
from kochab.simulate.mechanics.geometry import MountConfig
from kochab.simulate.rig import PracticeRig, RigConfig
from kochab.workflows.polar.site_and_clock import clock_doubts
from kochab.workflows.polar.sources import (
    CameraSightings,
    SolvedFile,
    last_night,
    remember_night,
    sightings_of,
    site_of,
)
from tests.polar.mounts import ARCSEC
from tests.polar.test_tutor import error_at

WHEN = datetime(2026, 3, 1, 22, tzinfo=UTC)


@pytest.fixture(scope="module")
def rig():
    return PracticeRig(
        RigConfig(
            seed=4,
            start_deg=(-30.0, 45.0),
            mount=MountConfig(german=False),
            camera=CameraConfig(width=800, height=600, fov_deg=5.0),
        )
    )


def test_a_cameras_frames_become_sightings_where_the_rig_points(rig):
    source = CameraSightings(SimulatedCamera(rig))
    for _ in range(2):  # the second is looked for near the first
        seen = run(source.sight())
        assert isinstance(seen, Sighting)
        truth = rig.truth(seen.time_utc.timestamp())
        off = np.linalg.norm(seen.attitude.boresight - truth.attitude.boresight) / ARCSEC
        assert off < 5.0
        assert max(seen.attitude.sigma_arcsec[:2]) < 3.0
        assert seen.field_deg == pytest.approx((5.0, 3.76), abs=0.02)


def test_a_turn_further_than_the_last_answers_hint_is_not_looked_for_there_for_ever(rig):
    """The declination turned by 40 deg: the frame after one without an answer is solved afresh."""
    source = CameraSightings(SimulatedCamera(rig))
    assert isinstance(run(source.sight()), Sighting)
    assert source._near(dark(WHEN)).hint.centre_deg is not None
    rig.mount.turn_by_hand(0.0, -40.0)
    source._options = replace(source._options, timeout_s=0.001)
    assert isinstance(run(source.sight()), NoSolution)
    source._options = replace(source._options, timeout_s=10.0)
    assert source._near(dark(WHEN)).hint.centre_deg is None
    assert source._near(dark(WHEN)).hint.scale_arcsec_px is not None
    seen = run(source.sight())
    assert isinstance(seen, Sighting)
    assert source._near(dark(WHEN)).hint.centre_deg is not None


def test_a_frame_of_a_field_that_was_solved_before_waits_for_no_index(rig, monkeypatch):
    """The first after a turn held up the first alignment of an installation for a minute, until small fields were there."""
    source, waited = CameraSightings(SimulatedCamera(rig)), []

    def waits(frame, options):
        try:
            yield Progress("detect")
            yield Progress(PREPARING)
            yield Progress(PREPARING)
            raise AssertionError
        finally:
            waited.append(True)

    assert isinstance(run(source.sight()), Sighting)
    monkeypatch.setattr("kochab.workflows.polar.sources.solve_open_frame", waits)
    told = []
    assert run(source.sight(), told.append) is None
    assert [step.stage for step in told] == ["wait for a frame", "detect"]
    assert waited == [True]
    assert isinstance(source._last, Solution)
    assert source._near(dark(WHEN)).hint.centre_deg is None, "the axis may have been turned further than that"
    monkeypatch.undo()
    assert isinstance(run(source.sight()), Sighting)


class Canned(CameraSource):
    """A camera with a few frames in store."""

    name = "canned"

    def __init__(self, *frames):
        self.frames = list(frames)

    def next_frame(self, timeout_s):
        return self.frames.pop(0) if self.frames else None


def dark(time_utc):
    return Frame(np.zeros((60, 80), np.uint16), hint=Hint(time_utc=time_utc))


def test_no_frame_and_no_answer_are_values():
    source = CameraSightings(Canned(dark(WHEN)))
    found = run(source.sight())
    assert isinstance(found, NoSolution)
    assert found.reason is Reason.CLOUDED_OR_DARK
    assert run(source.sight()) is None


def test_a_frame_without_a_time_needs_a_clock():
    with pytest.raises(UsageError, match="have no time"):
        run(CameraSightings(Canned(dark(None))).sight())
    asked = []
    source = CameraSightings(Canned(dark(None)), clock=lambda: asked.append(1) or WHEN)
    assert isinstance(run(source.sight()), NoSolution)
    assert asked


def solved(path, time_utc=WHEN, site=None):
    from kochab.core.attitude import Attitude, attitude_from

    attitude = Attitude(attitude_from(10.0, 20.0, 0.0).matrix, np.eye(3) * 1e-10)
    result = Solution(Camera.centred(800, 600, 9000.0), attitude, (), 0.2, -50.0, "patterns")
    return SolvedFile(path, result, time_utc, site)


def test_files_must_say_when():
    seen = sightings_of([solved("/a/one.fits"), solved("/a/two.fits")], [0, 1])
    assert [(s.label, s.sweep) for s in seen] == [("one.fits", 0), ("two.fits", 1)]
    with pytest.raises(UsageError, match=r"two\.fits has no time"):
        sightings_of([solved("one.fits"), solved("two.fits", None)], [0, 0])


def test_where_is_what_is_given_or_what_all_frames_say():
    here, there = Site(47.0, 8.0), Site(47.0, 9.0)
    files = [solved("a", site=here), solved("b"), solved("c", site=Site(47.01, 8.0))]
    assert site_of(files) == here
    assert site_of(files, there) == there
    with pytest.raises(UsageError, match="--site"):
        site_of([solved("a"), solved("b")])
    with pytest.raises(UsageError, match="a and d were taken at different sites"):
        site_of([*files, solved("d", site=there)])
    assert site_of([solved("a", site=Site(0, 179.99)), solved("b", site=Site(0, -179.99))])


# -- The clocks of camera, mount and computer --------------------------------------------------


def test_how_far_the_cameras_clock_is_ahead_is_known_of_its_frames():
    frames = [dark(WHEN + timedelta(hours=hours)) for hours in (0.0, 1.0, -2.0)]
    frames[1] = replace(frames[1], hint=replace(frames[1].hint, time_of_file=True))
    source, ahead = CameraSightings(Canned(*frames), clock=lambda: WHEN), []
    for frame in frames:
        source._time_of(frame)
        ahead.append(source.ahead_s / 3600.0)
    assert ahead == [0.0, 0.0, -2.0]  # when a file was written says nothing of the camera's clock


@pytest.mark.parametrize(("hours", "zone_h"), [(2.0, 2.0), (-5.05, -5.0), (5.75, 5.75), (13.98, 14.0), (0.02, 0.0)])
def test_a_camera_without_a_time_zone_takes_that_of_this_computers_clock(hours, zone_h):
    """Which leaves the minutes by which it is wrong; a frame of another night has no zone to take."""
    source = CameraSightings(Canned(), clock=lambda: WHEN)
    own = WHEN + timedelta(hours=hours)
    assert source._time_of(dark(own)) == own  # it has one
    zoneless = replace(dark(own), warnings=(NO_ZONE,))
    assert source._time_of(zoneless) == own - timedelta(hours=zone_h)
    assert source.ahead_s == pytest.approx(3600.0 * (hours - zone_h))
    assert CameraSightings(Canned())._time_of(zoneless) == own
    before = own - timedelta(days=3)
    assert source._time_of(replace(dark(before), warnings=(NO_ZONE,))) == before


@pytest.mark.parametrize(
    ("ahead_s", "words"),
    [
        (3600.0, "1.0 h ahead of this computer's"),
        (-7200.0, "2.0 h behind this computer's"),
        (600.0, "10 min ahead"),
        (60.0, None),  # as exposures and slow cables make it
        (3 * 86400.0, None),  # frames of another night, played again
    ],
)
def test_clocks_that_disagree_are_told_with_what_they_cost(ahead_s, words):
    pole, axis = direction(np.radians(47.0), 0.0), direction(np.radians(48.0), 0.0)
    off, here = (PolarError(at, pole, np.eye(2) * (5.0 * ARCSEC) ** 2) for at in (axis, pole))
    found = clock_doubts(ahead_s, "", off, Site(47.0, 8.0))
    assert [words in f.text for f in found] == ([True] if words else [])
    assert not any(f.spoils for f in found)
    assert clock_doubts(0.0 if words else ahead_s, "", here, Site(47.0, 8.0)) == []
    if words:
        cost = 3600.0 * abs(ahead_s) / 86164.0 * 2.0 * np.pi  # of an axis one degree off, arcsec
        told = float(re.search(r"off by ([\d.]+)′", found[0].text)[1])
        assert told == pytest.approx(2.0 * 60.0 * np.sin(cost / 3600.0 / 2.0), rel=0.03)


def test_what_the_mount_contradicts_comes_first():
    pole = direction(np.radians(47.0), 0.0)
    off = PolarError(direction(np.radians(48.0), 0.0), pole, np.eye(2) * (5.0 * ARCSEC) ** 2)
    found = clock_doubts(3600.0, "Its clock is 1.0 h fast.", off, Site(47.0, 8.0))
    assert [f.kind for f in found] == [PolarFindingKind.CLOCK] * 2
    assert found[0].text == "Its clock is 1.0 h fast."


# -- What is remembered of other nights ------------------------------------------------------------


def test_a_bolt_that_taught_nothing_keeps_what_was_known_of_it(tmp_path, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    site = Site(47.0, 8.0)
    for day, learned in enumerate([(10.0, 20.0), (None, None), (None, 30.0)]):
        remember_night(site, "", WHEN + timedelta(days=day), error_at(60.0, 60.0), learned)
    assert tuple(last_night(site).bolts_arcsec) == (10.0, 30.0)


@pytest.mark.parametrize(
    ("whole", "spoilt"),
    [
        ('"profile": ', '"extra": 1, "profile": '),
        ('"latitude_deg": 48.0', '"latitude_deg": null'),
        ("2026-03-01T22:00:00+00:00", "0001-01-01T00:00:00+14:00"),
    ],
)
def test_a_spoilt_night_takes_no_other_with_it(tmp_path, monkeypatch, whole, spoilt):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    sites = [Site(47.0, 8.0), Site(48.0, 8.0), Site(49.0, 8.0)]
    for site in sites[:2]:
        remember_night(site, "", WHEN, error_at(60.0, 60.0))
    kept = (tmp_path / "polar-nights.json").read_text()
    assert whole in kept
    (tmp_path / "polar-nights.json").write_text(kept.replace(whole, spoilt, 1))  # of the newest, which stands first
    remember_night(sites[2], "", WHEN, error_at(60.0, 60.0))
    assert [last_night(site) is not None for site in sites] == [True, False, True]
