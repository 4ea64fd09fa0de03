"""The detective before mounts with one thing wrong, made from axes and rotations alone."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.core.frame import Site
from kochab.pointing.disagreement import Seen, causes, fit, investigate
from tests.pointing.faulty_mounts import FAULTS, FROM, FaultyMount, make, sightings, verdicts

NIGHTS = 6


def night(fault, number, count=5):
    rng = np.random.default_rng([9, FAULTS.index(fault), number])
    return sightings(make(fault, rng), count, rng, fault == "cone error")


def test_a_mount_without_fault_or_noise_agrees_with_the_sky() -> None:
    rng = np.random.default_rng(2)
    for _ in range(5):
        for alt_azimuth in (False, True):
            site = make("", rng).site
            found = investigate(sightings(FaultyMount(site, site, 0.0, alt_azimuth=alt_azimuth), 3, rng))
            assert found.agrees
            assert found.offset_arcsec < 1.0


@pytest.mark.parametrize("fault", FAULTS)
def test_more_sightings_never_make_it_worse(fault) -> None:
    """One to five sightings of a night: each one more is right as often, and a right cause never gives way to a wrong."""
    first = FROM.get(fault, 1)
    named = [[investigate(night(fault, k)[:n]).cause for n in range(first, 6)] for k in range(NIGHTS)]
    right = (np.array(named) == fault).sum(axis=0)
    assert all(more >= fewer for fewer, more in pairwise(right)), right
    assert right[-1] == NIGHTS
    for causes_named in named:
        assert all(after in ("", fault) for before, after in pairwise(causes_named) if before == fault)


@pytest.mark.parametrize(("fault", "term"), [("polar axis", "pole"), ("base tilt", "tilted")])
def test_the_fitted_tilt_is_the_true_one(fault, term) -> None:
    for number in range(NIGHTS):
        rng = np.random.default_rng([9, FAULTS.index(fault), number])
        mount = make(fault, rng)
        mount.noise = 0.3
        seen = Seen(sightings(mount, 5, rng))
        (free,) = [c for c in causes(seen) if c.name == fault and not c.reverses]
        turn = np.degrees(mount.base.as_rotvec())[:2]
        turn = -turn if mount.alt_azimuth else turn  # azimuths begin in the north, hour angles in the south
        assert fit(seen, free)[1][2:4] == pytest.approx(turn, abs=0.05)
        assert term in investigate(seen.sightings).sentence


def test_a_healthy_mount_is_not_accused() -> None:
    """Forty, with noise to two arcminutes: none, where 23 of 100 were once."""
    assert {cause for _, cause in verdicts("", 40, seed=3)} == {""}


def test_an_equatorial_mount_turned_by_less_than_a_compass_errs_needs_its_axis_aligned() -> None:
    """By a degree it is the polar axis, by four a compass; what stands in altitude and azimuth has no such axis."""
    site = Site(50.0, 10.0)
    for turn_deg, alt_azimuth, cause in (
        (1.0, False, "polar axis"),
        (4.0, False, "compass azimuth"),
        (1.0, True, "compass azimuth"),
    ):
        vertical = [0.0, 0.0, 1.0] if alt_azimuth else [np.cos(np.radians(50.0)), 0.0, np.sin(np.radians(50.0))]
        mount = FaultyMount(site, site, 0.3, alt_azimuth=alt_azimuth, tells=True)
        mount.base = Rotation.from_rotvec(np.radians(turn_deg) * np.array(vertical))
        found = investigate(sightings(mount, 4, np.random.default_rng(5)))
        assert found.cause == cause, found
        if cause == "polar axis":
            assert "38" in found.sentence  # arcmin: the turn times the cosine of the latitude
