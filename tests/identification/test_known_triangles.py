"""Triangles by their sides: the table against brute force, and what is found in it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.identification.pair_table import DENSE, SPARSE, make_pairs, table_for
from kochab.identification.triangles import (
    DetectionAngles,
    attitude_of_two,
    matching_triangles,
    shortest_side_first,
    triangles,
    triple_product,
)

FIELD_DEG = 12.0
ANGLES = st.floats(-3.0, 3.0)


@pytest.fixture(scope="module")
def table(toy_volume):
    found = table_for((toy_volume,), FIELD_DEG, 2016.0)
    assert found is not None
    return found


def apart(a, b):
    return 2.0 * np.arcsin(np.linalg.norm(a - b, axis=-1) / 2.0)


def test_every_pair_within_reach_is_there_both_ways_round(table) -> None:
    few = np.arange(60)
    gap = apart(table.vectors[few, None], table.vectors[None])
    near = {(int(i), int(j)) for i, j in np.argwhere(gap < table.reach_rad) if i != j}
    mine = np.isin(table.one, few)
    listed = list(zip(table.one[mine].tolist(), table.other[mine].tolist(), strict=True))
    assert len(listed) == len(set(listed))
    assert set(listed) == near
    assert (np.diff(table.angle) >= 0).all()
    np.testing.assert_allclose(table.angle, apart(table.vectors[table.one], table.vectors[table.other]), atol=1e-9)


@given(st.floats(0.001, 0.15), st.floats(1e-5, 2e-3))
def test_the_bins_hold_all_pairs_of_an_angle(table, angle, error) -> None:
    found = table.between(angle - error, angle + error)
    inside = np.flatnonzero(np.abs(table.angle - angle) < error)
    assert set(inside.tolist()) <= set(range(*found.indices(len(table.angle))))


RING = np.arange(40, dtype=np.int32)


@pytest.fixture(scope="module")
def gap(table):
    """Angles (40, N), rad, from the first stars of the table to each of it."""
    return apart(table.vectors[RING, None], table.vectors[None])


@given(st.floats(0.01, 0.19), st.floats(1e-4, 5e-3), st.floats(0.0, 0.02))
def test_the_rings_hold_all_neighbours_at_a_distance(table, gap, wanted, error, more) -> None:
    stars = RING
    wanted = min(wanted, table.reach_rad - more - error)
    add = np.full(len(stars), more)
    for first, last in (
        table.rings(stars, wanted + more - error, wanted + more + error),
        table.rings_each(stars, wanted - error, wanted + error, add),
    ):
        row, entry = table.neighbours(first, last, wanted + more, error)
        star = table.neighbour[entry]
        expected = {(int(i), int(j)) for i, j in np.argwhere(np.abs(gap - wanted - more) < error)}
        off = expected ^ set(zip(row.tolist(), star.tolist(), strict=True))
        # single precision may put one on the edge on either side
        assert all(abs(abs(gap[i, j] - wanted - more) - error) < 1e-7 for i, j in off)


def test_a_table_has_as_many_stars_a_frame_as_asked_for(toy_volume) -> None:
    dense = table_for((toy_volume,), 16.0, 2016.0, DENSE)
    sparse = table_for((toy_volume,), 16.0, 2016.0, SPARSE)
    assert len(dense.rows) > 1.5 * len(sparse.rows)
    assert table_for((toy_volume,), 1.0, 2016.0) is None
    assert table_for((toy_volume,), 100.0, 2016.0) is None
    assert dense is table_for((toy_volume,), 16.0, 2016.3, DENSE)


def test_no_pair_at_all_is_a_table_too() -> None:
    made = make_pairs(np.eye(3), 0.1)
    assert len(made["angle"]) == 0
    assert len(made["neighbour"]) == 0


@pytest.mark.parametrize(("n", "count"), [(2, 0), (3, 1), (5, 10), (8, 56)])
def test_all_triangles_once_the_brightest_first(n, count) -> None:
    found = triangles(n)
    assert len({frozenset(t) for t in found}) == count == len(found)
    assert [max(t) for t in found] == sorted(max(t) for t in found)


@given(st.permutations([0, 1, 2]), st.lists(st.floats(0.01, 1.0), min_size=3, max_size=3))
def test_the_shortest_side_lies_between_the_first_two(corners, sides) -> None:
    angle = [[0.0, sides[0], sides[1]], [sides[0], 0.0, sides[2]], [sides[1], sides[2], 0.0]]
    a, b, c = shortest_side_first(tuple(corners), angle)
    assert {a, b, c} == {0, 1, 2}
    assert angle[a][b] <= angle[a][c] <= angle[b][c]


@given(st.integers(0, 3900), st.integers(0, 10**6), st.floats(-0.99, 0.99), st.booleans())
def test_true_triangles_are_found_and_all_found_have_the_sides(table, star, seed, share, mirrored):
    rng = np.random.default_rng(seed)
    near = table.near(table.vectors[star], np.cos(np.radians(5.0)))
    if len(near) < 3:
        return
    chosen = rng.choice(near, 3, replace=False)
    focal, room = 4000.0, 0.03
    ra, dec = np.degrees(
        [np.arctan2(table.vectors[star, 1], table.vectors[star, 0]), np.arcsin(table.vectors[star, 2])]
    )
    camera = Camera.centred(1001, 1001, focal * (1.0 + room) ** share, mirrored)
    seen = camera.project(table.vectors[chosen] @ attitude_from(ra, dec, 33.0).matrix.T) - 500.0
    seen += rng.normal(0.0, 0.1, seen.shape)
    angles = DetectionAngles.of(seen, (focal / (1.0 + room), focal * (1.0 + room)))
    a, b, c = shortest_side_first((0, 1, 2), angles.angle)
    error = 1.0 / focal
    found = matching_triangles(table, angles, (a, b, c), error)
    assert tuple(chosen[[a, b, c]]) in found
    v = table.vectors
    for one, two, three in found:
        ratio = angles.angle[b][c] / apart(v[two], v[three])
        assert abs(np.log(ratio)) < 1.05 * room + error / angles.angle[b][c]
        for (p, q), (d, e) in (((one, two), (a, b)), ((one, three), (a, c))):
            assert abs(ratio * apart(v[p], v[q]) - angles.angle[d][e]) < 2.5 * error


@given(ANGLES, ANGLES, ANGLES, st.floats(0.001, 0.3))
def test_two_stars_fix_the_attitude(ra, dec, roll, gap) -> None:
    attitude = attitude_from(np.degrees(ra), np.degrees(dec) / 2.0, np.degrees(roll))
    seen = np.array([[0.1, -0.2, 1.0], [0.1 + gap, 0.1, 1.0]])
    sky = seen / np.linalg.norm(seen, axis=1, keepdims=True) @ attitude.matrix
    found = np.array(attitude_of_two(*map(tuple, 3.0 * seen), *sky.tolist()))
    np.testing.assert_allclose(found, attitude.matrix, atol=1e-9)
    np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-12)


def test_stars_in_one_place_are_no_crash() -> None:
    assert np.isfinite(attitude_of_two((0, 0, 1), (0, 0, 1), [1.0, 0, 0], [1.0, 0, 0])).all()


def test_the_triple_product_tells_the_sense() -> None:
    x, y, z = np.eye(3).tolist()
    assert triple_product(x, y, z) == 1.0
    assert triple_product(y, x, z) == -1.0
    for some in np.random.default_rng(4).normal(size=(20, 3, 3)):
        assert triple_product(*some.tolist()) == pytest.approx(np.linalg.det(some))
