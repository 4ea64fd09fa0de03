import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from kochab.core.attitude import unit_vectors


def brute(catalogue, centre, radius, limit, year, vectors=None):
    rows = np.arange(len(catalogue))
    gap = np.linalg.norm((catalogue.vectors(rows, year) if vectors is None else vectors) - centre, axis=1)
    keep = gap <= 2 * np.sin(radius / 2)
    if limit is not None:
        keep &= catalogue.mag(rows) <= limit + 1e-9
    return set(rows[keep].tolist())


places = {
    "ra": st.floats(0, 360),
    "dec": st.one_of(st.floats(-90, 90), st.sampled_from([-90.0, 90.0, 89.99, 0.0, 0.5])),
    "radius_deg": st.floats(0.01, 179.0),
    "limit": st.one_of(st.none(), st.floats(-1, 13).map(lambda m: round(m, 2))),
    "year": st.sampled_from([2000.0, 1990.0, 2026.9]),
}


@given(**places)
@example(ra=359.999, dec=0.0, radius_deg=1.0, limit=None, year=2026.9)
@example(ra=0.0, dec=90.0, radius_deg=3.0, limit=9.0, year=2026.9)
@example(ra=77.0, dec=-89.0, radius_deg=1.5, limit=None, year=1990.0)
@example(ra=10.0, dec=60.0, radius_deg=30.0, limit=None, year=2000.0)
def test_a_cone_holds_what_brute_force_finds(small, ra, dec, radius_deg, limit, year):
    centre, radius = unit_vectors(ra, dec), np.radians(radius_deg)
    rows = small.cone(centre, radius, limit, year)
    assert len(set(rows.tolist())) == len(rows)
    assert set(rows.tolist()) == brute(small, centre, radius, limit, year)
    assert np.all(np.diff(small.mag(rows)) >= 0)


@given(ra=places["ra"], dec=places["dec"], radius_deg=st.floats(1, 90), n=st.integers(1, 200))
def test_the_brightest_are_the_head_of_the_cone(small, ra, dec, radius_deg, n):
    centre, radius = unit_vectors(ra, dec), np.radians(radius_deg)
    head = small.cone(centre, radius)[:n]
    found = small.brightest(centre, radius, n)
    assert np.array_equal(small.mag(found), small.mag(head))
    assert set(found.tolist()) <= brute(small, centre, radius, None, 2000.0)


def test_the_whole_sky_is_a_cone(small):
    assert len(small.cone(np.array([0.0, 0.6, 0.8]), np.pi)) == len(small)


def test_a_cone_may_be_empty(small):
    assert small.cone(unit_vectors(10.0, 10.0), 1e-9).shape == (0,)
    assert small.brightest(unit_vectors(10.0, 10.0), 1e-9, 5).shape == (0,)


@pytest.fixture(scope="module")
def vectors(catalogue):
    """Vectors of all shipped stars at epoch 2025.5, a third of a second's work."""
    return catalogue.vectors(np.arange(len(catalogue)), 2025.5)


@pytest.mark.parametrize("ra_dec", [(0.0, 0.0), (266.4, -29.0), (123.4, 90.0), (180.0, -89.5)])
def test_the_shipped_sky_agrees_with_brute_force(catalogue, vectors, ra_dec):
    centre = unit_vectors(*ra_dec)
    rows = catalogue.cone(centre, np.radians(1.3), year=2025.5)
    assert len(rows) > 50
    assert set(rows.tolist()) == brute(catalogue, centre, np.radians(1.3), None, 2025.5, vectors)


def test_colours_and_magnitudes_survive_storage(small):
    rows = np.arange(len(small))
    colour = small.bv(rows)
    assert 0.25 < np.isnan(colour).mean() < 0.35
    assert np.nanmin(colour) >= -0.31
    assert np.nanmax(colour) <= 2.01
    assert small.mag(rows).min() == pytest.approx(-1.0, abs=0.01)
