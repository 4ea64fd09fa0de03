import numpy as np
import pytest

from kochab.lab.methods.pairs import between, catalogue_pairs, make_pairs, spread
from kochab.sky import open_catalogue


@pytest.fixture(scope="module")
def toy(toy_sky):
    stars = toy_sky[:300]
    return make_pairs(np.arange(300) + 7, stars, np.radians(20.0))


def test_every_pair_once_and_no_other(toy) -> None:
    cosines = np.clip(toy.vectors @ toy.vectors.T, -1, 1)
    i, j = np.triu_indices(300, 1)
    near = np.arccos(cosines[i, j]) <= np.radians(20.0)
    assert {*zip(toy.first.tolist(), toy.second.tolist(), strict=True)} == {
        *zip(i[near].tolist(), j[near].tolist(), strict=True)
    }
    np.testing.assert_allclose(toy.angle, np.arccos(cosines[toy.first, toy.second]), atol=1e-9)
    assert (np.diff(toy.angle) >= 0).all()


def test_ranges_are_looked_up_many_at_once(toy) -> None:
    low = np.radians([5.0, 10.0, 19.9, 30.0])
    start, stop = between(toy.angle, low, low + np.radians(0.5))
    for a, b, at in zip(start, stop, low, strict=True):
        inside = (toy.angle >= at) & (toy.angle <= at + np.radians(0.5))
        assert np.flatnonzero(inside).tolist() == list(range(a, b))
    which, pair = spread(start, stop)
    expected = [(k, n) for k in range(4) for n in range(start[k], stop[k])]
    assert list(zip(which.tolist(), pair.tolist(), strict=True)) == expected


def test_an_empty_or_reversed_range_has_no_pairs(toy) -> None:
    start, stop = between(toy.angle, np.array([0.2]), np.array([0.1]))
    assert start == stop
    assert len(spread(start, stop)[1]) == 0


def test_the_catalogues_bright_stars() -> None:
    pairs = catalogue_pairs(8.0, mag_limit=6.0)
    assert 4900 < pairs.stars < 5200
    assert (np.diff(open_catalogue().mag(pairs.rows)) >= 0).all()
    assert 65_000 < len(pairs) < 80_000
    assert pairs is catalogue_pairs(8.0, mag_limit=6.0)
    assert catalogue_pairs(2.0, brightest=500).stars == 500
    with pytest.raises(ValueError, match="either"):
        catalogue_pairs(8.0)


def test_only_a_belt_of_declination(toy) -> None:
    belt = toy.within_declinations(-10.0, 30.0)
    dec = np.degrees(np.arcsin(toy.vectors[:, 2]))
    inside = (dec >= -10) & (dec <= 30)
    assert len(belt) == int((inside[toy.first] & inside[toy.second]).sum())
    assert toy.within_declinations(-90.0, 90.0) is toy
