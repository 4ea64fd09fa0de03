import re

import numpy as np
import pytest

from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.progress import run
from kochab.core.solution import Identification, NoSolution, Reason
from kochab.identification import IDENTIFIERS
from kochab.lab.methods.neighbours import PLACES, Neighbours, NeighbourTable, angle_at, make_table, sensor_magnitude
from kochab.simulate.random_fields import FieldPlan, random_field, random_points
from kochab.sky import open_catalogue

# The neighbouring constellations of the paper's example: two distances and an angle, degrees.
EXAMPLE = np.array(
    [
        [5.596, 8.191, 164.204],
        [5.596, 8.329, 30.680],
        [5.596, 10.102, 7.542],
        [5.596, 12.306, 58.521],
        [5.596, 12.754, 13.597],
        [8.191, 8.329, 165.117],
        [8.191, 10.102, 156.662],
        [8.191, 12.306, 137.275],
        [8.191, 12.754, 150.607],
        [8.329, 10.102, 38.222],
        [8.329, 12.306, 27.841],
        [8.329, 12.754, 44.276],
    ]
)
EXCHANGE_DEG = 0.2
DISTANCES = [5.596, 8.191, 8.329, 10.102, 12.306, 12.754]


def classes(options, features):
    _, key = options.entries(*np.atleast_2d(features).T)
    return {(int(k) // PLACES**2, int(k) // PLACES % PLACES, int(k) % PLACES) for k in key}


def knowing(camera: Camera) -> Hint:
    s = camera.scale_arcsec_px
    return Hint(scale_arcsec_px=(s / 1.1, s * 1.1))


def test_the_papers_star_is_entered_as_its_text_says() -> None:
    expected = {(a, b, c) for a in (54, 55, 56) for b in (80, 81, 82) for c in (32, 33)}
    assert classes(Neighbours(), EXAMPLE[0]) == expected
    assert int(Neighbours().key(*EXAMPLE[:1].T)[0]) == (55 * PLACES + 81) * PLACES + 32


def test_all_entries_of_figure_11(repository) -> None:
    paper = repository.parent / "shared" / "papers" / "star-constellations-1992.txt"
    if not paper.exists():
        pytest.skip("the paper is not beside this checkout")
    text = paper.read_text("utf-8")
    printed = text[text.index("54, 80, 32\t55, 100, 0") : text.index("with the raw SC")]
    entries = {tuple(map(int, m)) for m in re.findall(r"(\d+), (\d+), (\d+)", printed)}
    assert len(entries) == 225
    assert classes(Neighbours(angle_errors=2.0), EXAMPLE) == entries


def test_first_and_second_neighbours_end_with_the_first_and_second_certain_one() -> None:
    """The paper's example has certain stars at 8.329 and 12.754 deg: twelve constellations."""
    from kochab.lab.methods.neighbours import neighbourhoods

    turn = np.radians(np.linspace(0.0, 170.0, len(DISTANCES)))
    far = np.radians([*DISTANCES, 13.2])
    turn = np.append(turn, np.radians(200.0))
    stars = np.stack([np.sin(far) * np.cos(turn), np.sin(far) * np.sin(turn), np.cos(far)], axis=1)
    vectors = np.concatenate([[[0.0, 0.0, 1.0]], stars])
    certain = np.array([True, False, False, True, False, False, True, True])
    star, first, second, angle = neighbourhoods(vectors, certain, EXCHANGE_DEG)
    own = star == 0
    found = {(round(a, 3), round(b, 3)) for a, b in zip(first[own], second[own], strict=True)}
    assert found == {(a, b) for a, b, _ in EXAMPLE}
    assert (angle >= 0).all()
    assert (angle <= 180).all()


def test_a_neighbour_hardly_further_may_change_places() -> None:
    from kochab.lab.methods.neighbours import neighbourhoods

    far, turn = np.radians([3.0, 5.0, 5.1, 5.4, 90.0]), np.radians([0.0, 90.0, 180.0, 270.0, 0.0])
    stars = np.stack([np.sin(far) * np.cos(turn), np.sin(far) * np.sin(turn), np.cos(far)], axis=1)
    vectors = np.concatenate([[[0.0, 0.0, 1.0]], stars])
    star, first, second, _ = neighbourhoods(vectors, np.ones(6, dtype=bool), EXCHANGE_DEG)
    own = star == 0
    assert {(round(a, 2), round(b, 2)) for a, b in zip(first[own], second[own], strict=True)} == {
        (3.0, 5.0),
        (3.0, 5.1),
    }


def test_angle_between_neighbours() -> None:
    middle, first = np.array([[0.0, 0.0, 1.0]]), np.array([[0.1, 0.0, 0.995]])
    second = np.array([[0.1, 0.1, 0.99]])
    assert angle_at(middle, first, second)[0] == pytest.approx(45.0)
    assert angle_at(middle, first, -first)[0] == pytest.approx(180.0)


def test_the_table_is_as_large_as_the_papers() -> None:
    table = Neighbours().table()
    assert 1450 < len(table.rows) < 1700  # the paper: 1539
    assert 150_000 < len(table) < 330_000  # the paper: 185,000
    assert table.key.nbytes + table.star.nbytes == len(table) * 12
    assert Neighbours().table() is table
    which, star = table.find(table.key[::997])
    for number in range(0, len(table), 997 * 20):
        assert int(table.star[number]) in star[which == number // 997]


def test_stars_of_a_toy_sky_are_found_by_their_neighbours(toy_sky) -> None:
    vectors = toy_sky[:1100]
    certain = np.ones(1100, dtype=bool)
    table = NeighbourTable(**make_table(np.arange(1100), vectors, certain, Neighbours()))
    near = np.flatnonzero(vectors @ vectors[5] > np.cos(np.radians(15.0)))
    rim = 15.0 - np.degrees(np.arccos(np.clip(vectors[near] @ vectors[5], -1, 1)))
    found, compared = Neighbours().recognise(vectors[near], rim, table)
    seen, star = found[0]
    assert near[seen].tolist() == star.tolist()
    assert len(seen) >= 4
    assert compared > 0


@pytest.mark.parametrize("seed", [3, 4])
def test_real_fields_are_named_right_or_refused(seed) -> None:
    catalogue, rng, named = open_catalogue(), np.random.default_rng(seed), 0
    for _ in range(10):
        field = random_field(catalogue, rng, FieldPlan(28.0, missing=0.0, spurious=0.0, magnitude_scatter=0.1))
        found = run(Neighbours().identify(field.detections, knowing(field.camera)))
        if isinstance(found, NoSolution):
            continue
        named += 1
        assert found.attitude.boresight @ field.attitude.boresight > np.cos(np.radians(0.1))
        assert found.camera.mirrored == field.camera.mirrored
        places = field.camera.project(found.matches.vectors @ field.attitude.matrix.T)
        assert np.abs(places - found.matches.xy).max() < 6.0
    assert named >= 4


def test_points_that_are_no_stars_are_refused() -> None:
    rng = np.random.default_rng(8)
    camera = Camera.centred(1024, 1024, 1024 / 2 / np.tan(np.radians(15.0)))
    for count in (15, 25, 40):
        found = run(Neighbours().identify(random_points(rng, count), knowing(camera)))
        assert isinstance(found, NoSolution)


@pytest.mark.parametrize(
    ("stars", "hint", "reason"), [(20, None, Reason.NO_PATTERN_AGREED), (2, Hint((100.0, 110.0)), Reason.TOO_FEW_STARS)]
)
def test_what_it_cannot_work_with(stars, hint, reason) -> None:
    points = np.random.default_rng(1).uniform(0, 900, (stars, 2))
    method = IDENTIFIERS.make("neighbours")
    found = run(method.identify(Detections.from_list(points, 900, 900), hint))
    assert not isinstance(found, Identification)
    assert found.reason == reason


def test_its_table_comes_from_disk_the_second_time(tmp_path, monkeypatch) -> None:
    from kochab.identification import table_cache
    from kochab.lab.methods import neighbours as neighbours_table

    monkeypatch.setenv("KOCHAB_CACHE", str(tmp_path))
    monkeypatch.setattr(table_cache, "WORTH_S", 0.0)
    method = Neighbours(brightest=300)
    neighbours_table._tabled.cache_clear()
    made = method.table()
    neighbours_table._tabled.cache_clear()
    monkeypatch.setattr(neighbours_table, "make_table", None)
    again = method.table()
    np.testing.assert_array_equal(made.key, again.key)
    np.testing.assert_array_equal(made.rows, again.rows)
    neighbours_table._tabled.cache_clear()


def test_a_red_sensor_sees_red_stars_brighter() -> None:
    catalogue = open_catalogue()
    plain, red = (Neighbours(brightest=300, spread=0.1, colour_term=term).table() for term in (0.0, -1.0))
    colours = catalogue.bv(red.rows)
    known = np.isfinite(colours)
    assert (np.diff((catalogue.mag(red.rows) - colours)[known]) >= 0).all()
    assert np.nanmean(colours) > np.nanmean(catalogue.bv(plain.rows)) + 0.2


def test_unknown_colours_count_as_typical():
    got = sensor_magnitude(np.full(3, 5.0), np.array([0.0, 1.0, np.nan]), -0.3)
    assert got == pytest.approx([5.0, 4.7, 4.79])
