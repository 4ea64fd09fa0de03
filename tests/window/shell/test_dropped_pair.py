"""Two dropped frames: a turn about the pole opens the Polar view with the answer, other pairs do not."""

import numpy as np
import pytest

from kochab.core.attitude import Attitude, attitude_from
from kochab.polar.pair import turned_about_a_pole
from kochab.polar.rotations import about
from kochab.window.frame.batch import FileState
from kochab.window.polar.view import PolarView
from kochab.window.shell.dropped_pair import DroppedPair
from tests.workflows.live_sources import solution

POLE = np.array([0.0, 0.0, 1.0])


def turned(attitude, axis, deg):
    return Attitude(attitude.matrix @ about(axis / np.linalg.norm(axis), np.radians(deg)).T)


@pytest.mark.parametrize("pole", [POLE, -POLE])
@pytest.mark.parametrize("off_deg", [0.0, 1.0, 9.0])
@pytest.mark.parametrize("deg", [6.0, 40.0, -70.0, 120.0])
def test_a_turn_of_an_aligned_mount_is_one(pole, off_deg, deg) -> None:
    first = attitude_from(50.0, 70.0, 20.0)
    axis = pole + np.tan(np.radians(off_deg)) * np.array([0.6, 0.8, 0.0])
    assert turned_about_a_pole(first, turned(first, axis, deg))


@pytest.mark.parametrize(
    ("axis", "deg"),
    [
        (POLE, 0.0),
        (POLE, 2.0),  # a dither
        (np.array([0.0, 0.3, 1.0]), 40.0),  # 17 degrees from the pole
        (np.array([1.0, 0.0, 0.0]), 40.0),
        (POLE, 180.0),  # a meridian flip near it
    ],
)
def test_other_pairs_are_none(axis, deg) -> None:
    first = attitude_from(50.0, 70.0, 20.0)
    assert not turned_about_a_pole(first, turned(first, axis, deg))


def test_unrelated_frames_seldom_look_so() -> None:
    chance = np.random.default_rng(3)

    def any_frame():
        return attitude_from(
            chance.uniform(0, 360), np.degrees(np.arcsin(chance.uniform(-1, 1))), chance.uniform(0, 360)
        )

    # Two caps of 10 degrees cover 1.5 % of the sphere of axes.
    assert sum(turned_about_a_pole(any_frame(), any_frame()) for _ in range(2000)) < 60


@pytest.fixture
def drop(make_window, engine, monkeypatch, tmp_path):
    """Drops two frames with these solutions; what the Polar view is given to measure."""
    _, commands = make_window(engine)
    given = []
    monkeypatch.setattr(PolarView, "measure", lambda self, paths: given.append(paths))

    def dropped(one, other):
        paths = [tmp_path / "first.fits", tmp_path / "second.fits"]
        for path in paths:
            path.touch()
        batch = commands.files.batch
        batch.files = {path: FileState(path, result=result) for path, result in zip(paths, (one, other), strict=True)}
        for pair in batch.findChildren(DroppedPair):
            pair.take(paths)
        return given, paths, commands

    return dropped


def test_the_polar_view_opens_with_a_pair_that_shows_an_axis(drop) -> None:
    given, paths, commands = drop(solution(10.0, 70.0, 0.0), solution(60.0, 70.0, 0.0))
    assert given == [paths]
    assert "polar" in commands.views.docked


def test_two_frames_of_one_field_stay_in_the_image_view(drop) -> None:
    given, _, commands = drop(solution(10.0, 70.0, 0.0), solution(10.2, 70.1, 0.0))
    assert not given
    assert "polar" not in commands.views.docked
