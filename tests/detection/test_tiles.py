"""A detector on parts of a frame: nothing lost at their edges, and each by its own sharpness."""

import numpy as np
import pytest

from kochab.core.frame import Frame
from kochab.core.pairing import mutual_nearest
from kochab.detection.auto import AutoDetector
from kochab.detection.tiles import SMALLEST_PX, TILES, detect_in_tiles
from kochab.frames import read_frame
from kochab.simulate.star_images import RenderedStar, Sky, render


def frame_of(count=250, side=900, seed=3):
    rng = np.random.default_rng(seed)
    xy = rng.uniform(6.0, side - 7.0, (count, 2))
    return render(side, side, xy, rng.uniform(3e3, 4e4, count), RenderedStar(2.6), Sky(), seed=seed), xy


def test_stars_on_the_edges_of_parts_are_found_once_where_they_are():
    frame, xy = frame_of()
    edges = xy.copy()
    edges[:, 0] = np.repeat([300.0, 600.0], len(xy) // 2)  # every star on an edge between two parts
    edges[:, 1] = np.linspace(8.0, 890.0, len(xy) // 2).tolist() * 2
    frame = render(900, 900, edges, np.full(len(edges), 2e4), RenderedStar(2.6), Sky(), seed=4)
    found = detect_in_tiles(frame, AutoDetector())
    i, j = mutual_nearest(found.xy, edges, 0.5)
    whole = AutoDetector().detect(frame)
    assert len(j) >= 0.97 * len(mutual_nearest(whole.xy, edges, 0.5)[0])
    assert len(found) <= 1.03 * len(whole)
    assert (found.width, found.height) == (900, 900)
    assert (np.diff(found.flux) <= 0.0).all()
    assert len(i) == len(set(i.tolist()))


def test_trees_before_a_milky_way_leave_the_sky_its_sharp_stars(frames_reach):
    """The whole frame's star image was made of branches: 86 of the upper right's stars were found, of some 850."""
    frame = read_frame(str(frames_reach / "stic6021__es_EN_HD_images_landscape_ForestCanyonOverlook_2020Jul19.jpg"))
    parts, whole = detect_in_tiles(frame, AutoDetector()), AutoDetector().detect(frame)
    assert len(parts) > 3 * len(whole)
    assert np.median(parts.elongation) < np.median(whole.elongation)


def test_a_small_frame_is_looked_at_as_a_whole():
    side = TILES * SMALLEST_PX - 1
    frame, _ = frame_of(40, side)
    np.testing.assert_array_equal(detect_in_tiles(frame, AutoDetector()).xy, AutoDetector().detect(frame).xy)


@pytest.mark.parametrize("pattern", ["RGGB", "GBRG"])
def test_a_part_of_a_mosaic_begins_with_its_own_colour(pattern):
    """Greens four times as bright: a part that began a pixel off would see a chequerboard of false stars."""
    frame, _ = frame_of(60, 901)
    y, x = np.indices(frame.pixels.shape)
    green = (x + y) % 2 == (1 if pattern == "RGGB" else 0)
    mosaic = Frame((frame.pixels.astype(np.float32) * np.where(green, 1.0, 0.25)).astype(np.float32), bayer=pattern)
    parts, whole = detect_in_tiles(mosaic, AutoDetector()), AutoDetector().detect(mosaic)
    assert abs(len(parts) - len(whole)) <= 0.1 * len(whole) + 2
