"""Streaks drawn with known ends, a real satellite, and what only looks like one."""

import json
from dataclasses import replace

import numpy as np
import pytest

from kochab.core.frame import Detections, Frame
from kochab.detection.auto import AutoDetector
from kochab.detection.streaks import Streak, _is_of_a_star, _spread, find_streaks
from kochab.frames import read_frame
from kochab.simulate.star_images import RenderedStar, Sensor, Sky, add_stars, expose, render
from tests.workflows.night_sky import scattered

SIZE = 1600, 1100
NONE = np.empty((0, 2))


def sky(seed, lines=(), stars=120, level=300.0):
    """A frame of stars with lines ((x, y), (x, y), electrons a pixel of length), by the error function."""
    light = np.full(SIZE[::-1], level, dtype=np.float32)
    xy, flux = scattered(SIZE, stars, seed)
    add_stars(light, xy, flux, RenderedStar(3.0))
    for begin, end, bright in lines:
        length = float(np.hypot(*np.subtract(end, begin)))
        share = (np.arange(int(length)) + 0.5) / int(length)
        places = np.array(begin) + share[:, None] * np.subtract(end, begin)
        add_stars(light, places, np.full(len(places), bright * length / len(places)), RenderedStar(3.0))
    return expose(light, Sky(0.0), Sensor(), np.random.default_rng(seed)), xy


def streaks_of(frame, stars=NONE):
    return find_streaks(frame, AutoDetector().detect(frame), stars)


@pytest.mark.parametrize("seed", range(3))
def test_a_streak_is_found_with_its_ends_and_a_sky_of_stars_has_none(seed):
    rng = np.random.default_rng(seed)
    begin, end = rng.uniform(60, 500, 2), rng.uniform([1000, 600], [1550, 1050])
    frame, stars = sky(seed, [(begin, end, 150.0)])
    (found,) = streaks_of(frame, stars)
    ends = found.ends if found.ends[0][0] < found.ends[1][0] else found.ends[::-1]
    assert np.hypot(*(ends - [begin, end]).T).max() < 15
    along = (end - begin) / np.hypot(*(end - begin))
    beside = (found.ends - begin) @ np.array([-along[1], along[0]])
    assert np.abs(beside).max() < 4 * found.sigma_px
    assert found.inside == (True, True)
    assert found.width_px == pytest.approx(3.0, abs=0.6)
    assert found.light[5:-5].mean() == pytest.approx(150.0, rel=0.15)
    for many in (60, 400):
        assert streaks_of(*sky(seed + 50, stars=many)) == []


def test_streaks_are_found_that_are_as_bright_as_the_noise_of_a_pixel():
    found = {}
    for bright in (60.0, 8.0):  # 17 electrons of noise a pixel, three pixels wide
        seen = [streaks_of(*sky(seed, [((0, 200 + 30 * seed), (1599, 700 - 20 * seed), bright)])) for seed in range(3)]
        found[bright] = sum(len(one) == 1 for one in seen)
        assert max(map(len, seen)) <= 1
    assert found[60.0] == 3
    assert found[8.0] == 0  # an eighth of that: nothing is seen by eye either


def test_rows_of_stars_roofs_columns_and_trailed_frames_are_no_streaks():
    rng = np.random.default_rng(4)
    row = np.stack([np.linspace(100, 1500, 15), np.linspace(200, 900, 15)], axis=1)
    assert streaks_of(render(*SIZE, row, np.full(15, 3e4), RenderedStar(3.0), Sky(300.0), seed=1)) == []
    frame, stars = sky(5)
    roof = frame.pixels.astype(float)
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    roof[y > 800 - 0.3 * x] *= 0.3
    assert streaks_of(Frame(roof.astype(np.uint16)), stars) == []
    column = frame.pixels.copy()
    column[:, 700] += 400
    assert streaks_of(Frame(column), stars) == []
    xy, flux = scattered(SIZE, 60, 6)
    trailed = render(*SIZE, xy, flux * 20, RenderedStar(3.0, trail_px=(70.0, 30.0)), Sky(300.0), seed=2)
    assert streaks_of(trailed) == []
    assert streaks_of(Frame(rng.poisson(300, (400, 500)).astype(np.uint16))) == []
    assert streaks_of(Frame(np.zeros((400, 500), np.uint16))) == []


def test_the_spikes_of_a_bright_star_are_none():
    xy, flux = scattered(SIZE, 100, 8)
    light = np.full(SIZE[::-1], 300.0, dtype=np.float32)
    add_stars(light, xy, flux, RenderedStar(3.0))
    add_stars(light, np.array([[800.0, 550.0]]), np.array([3e7]), RenderedStar(4.0))
    for turn in (0.4, 0.4 + np.pi / 2):
        t = np.arange(-350.0, 350.0)
        places = np.array([800.0, 550.0]) + t[:, None] * [np.cos(turn), np.sin(turn)]
        add_stars(light, places, 9e3 * np.exp(-np.abs(t) / 90.0), RenderedStar(2.5))
    frame = expose(light, Sky(0.0), Sensor(), np.random.default_rng(8))
    assert streaks_of(frame, xy) == []


def test_the_satellite_of_a_real_series_is_found_and_nothing_else(repository):
    """SharpCap's frames of a polar alignment; by eye one of them, 15, has a line from top to bottom."""
    folder = repository.parent / "shared" / "series" / "tk"
    if not folder.is_dir():
        pytest.skip("no real series here")
    found = {path.name: streaks_of(read_frame(path)) for path in sorted(folder.glob("*.png"))[::2]}
    assert {name: len(streaks) for name, streaks in found.items() if streaks} == {"_00015.png": 1}
    (streak,) = found["_00015.png"]
    assert sorted(streak.ends[:, 0]) == pytest.approx([1669, 1681], abs=6)
    assert streak.length_px > 1080


def test_real_frames_have_none(repository):
    folder = repository.parent / "shared" / "frames"
    if not folder.is_dir():
        pytest.skip("no real frames here")
    names = [name for name in json.loads((folder / "truth.json").read_text())["frames"] if (folder / name).exists()]
    names += [f"../series/unh/{path.name}" for path in (folder.parent / "series" / "unh").glob("*.jpg")]
    photographs = [name for name in names if not name.startswith(("aalign", "real_", "syn_")) and "IMG_0" not in name]
    assert len(photographs) > 20
    bad = {}
    for name in photographs[::4]:
        streaks = streaks_of(read_frame(folder / name))
        if streaks:
            bad[name] = len(streaks)
    assert bad == {}


def test_a_saturated_flare_is_a_streak_and_no_spike(repository):
    """An Iridium flare over a roof; by eye from (400, 430) to (665, 375)."""
    path = repository.parent / "shared" / "frames-reach" / "emijrp__images_iridium8.jpg"
    if not path.exists():
        pytest.skip("no real frames here")
    ends = [one.ends[np.argsort(one.ends[:, 0])] for one in streaks_of(read_frame(path))]
    assert min(np.abs(one - [[400, 430], [665, 375]]).max() for one in ends) < 25


@pytest.mark.parametrize("shape", [(6, 8), (64, 96)])
def test_a_slope_over_blocks_is_a_slope_over_their_pixels(shape) -> None:
    """Each block's value is that of its middle; from the middles of the outermost on it stays as it is."""
    blocks = (2, 4)
    y, x = (np.arange(side) for side in shape)
    middles = [(np.arange(count) + 0.5) * side / count - 0.5 for side, count in zip(shape, blocks, strict=True)]
    grid = 3.0 * middles[0][:, None] + 5.0 * middles[1]
    held = [np.clip(place, middle[0], middle[-1]) for place, middle in zip((y, x), middles, strict=True)]
    np.testing.assert_allclose(_spread(grid, shape), 3.0 * held[0][:, None] + 5.0 * held[1], atol=1e-9)


def crossing(star_xy, ends, light):
    """A streak, and one saturated round star."""
    ends = np.array(ends, dtype=float)
    way = ends[0] + np.linspace(0.0, 1.0, len(light))[:, None] * (ends[1] - ends[0])
    streak = Streak(ends, (True, True), way, np.array(light, dtype=float), np.ones(len(light)), 3.0, 0.1)
    star = Detections.from_list(np.array([star_xy], dtype=float), 1000, 800)
    return streak, replace(star, saturated=np.array([True]), elongation=np.array([1.05]))


EVEN, SPIKE = np.full(81, 40.0), 2000.0 / (1.0 + np.abs(np.arange(81) - 40.0)) ** 1.5


@pytest.mark.parametrize(
    ("star_xy", "ends", "light", "expected"),
    [
        ((300, 300), [(300, 100), (300, 500)], EVEN, True),  # bleeding runs along a column
        ((300, 300), [(100, 300), (500, 300)], EVEN, True),  # or a row
        ((300, 300), [(150, 160), (450, 440)], EVEN, False),  # a satellite over the star is as bright all along
        ((300, 300), [(150, 160), (450, 440)], SPIKE, True),  # a spike is brightest at its star
        ((300, 330), [(100, 300), (500, 300)], EVEN, False),  # the star is beside it
        ((700, 300), [(100, 300), (500, 300)], EVEN, False),  # or beyond its end
    ],
)
def test_light_that_a_saturated_star_throws_is_no_streak(star_xy, ends, light, expected) -> None:
    assert _is_of_a_star(*crossing(star_xy, ends, light)) is expected
    streak, star = crossing(star_xy, ends, light)
    assert not _is_of_a_star(streak, replace(star, saturated=np.array([False])))
