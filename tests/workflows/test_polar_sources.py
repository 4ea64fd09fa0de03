"""Frames from a camera, solved as they come; and what files must say to be of use."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from kochab.core.camera import Camera
from kochab.core.capture import CameraSource
from kochab.core.errors import UsageError
from kochab.core.frame import Frame, Hint, Site
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason, Solution
from kochab.polar.sighting import Sighting
from kochab.simulate.camera import CameraConfig
from kochab.simulate.camera_source import SimulatedCamera
from kochab.simulate.mechanics.geometry import MountConfig
from kochab.simulate.rig import PracticeRig, RigConfig
from kochab.workflows.polar.sources import CameraSightings, SolvedFile, sightings_of, site_of
from tests.polar.mounts import ARCSEC

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
