"""The detective before mounts made from TPOINT's terms: what it names, and what it leaves untold."""

from datetime import timedelta

import numpy as np
import pytest

from kochab.core.frame import Site
from kochab.pointing.disagreement import investigate
from tests.pointing.tpoint_mounts import FAULTS, NEEDS, TpointMount, make, sightings, verdicts

CASES = 10


@pytest.mark.parametrize("fault", FAULTS)
def test_the_one_fault_is_named_and_no_other(fault) -> None:
    found = list(verdicts(fault, CASES, seed=5))
    assert not [one for one in found if one.wrong]
    assert sum(one.right for one in found) >= CASES - 1


@pytest.mark.parametrize("fault", NEEDS)
def test_what_one_sighting_cannot_tell_is_said_to_be_untold(fault) -> None:
    for case in range(CASES):
        rng = np.random.default_rng([3, FAULTS.index(fault), case])
        found = investigate(sightings(make(fault, rng), 1, rng))
        assert found.cause == ""
        assert found.agrees or "not told by one sighting" in found.sentence


SITE = Site(48.0, 11.0)


@pytest.mark.parametrize("alt_azimuth", [False, True])
@pytest.mark.parametrize("compass_deg", [-13.0, 4.0])
def test_a_compass_s_north_is_told_with_its_angle_whatever_the_mount(compass_deg, alt_azimuth) -> None:
    rng = np.random.default_rng(8)
    mount = TpointMount(SITE, SITE, alt_azimuth=alt_azimuth, terms={"compass": compass_deg}, noise_arcmin=0.5)
    found = investigate(sightings(mount, 3, rng))
    assert found.cause == "compass azimuth"
    assert f"off by {compass_deg:+.1f} deg" in found.sentence


@pytest.mark.parametrize(("days", "told"), [(3, "3.0 days ahead"), (-400, "400.0 days behind"), (1, "1.0 days ahead")])
def test_a_date_that_the_mount_tells_is_named_by_one_sighting(days, told) -> None:
    rng = np.random.default_rng(9)
    mount = TpointMount(SITE, SITE, clock=timedelta(days=days), tells=True)
    found = investigate(sightings(mount, 1, rng))
    assert found.cause == "wrong day"
    assert told in found.sentence


def test_a_date_that_nobody_tells_is_named_by_two_sightings_and_not_by_one() -> None:
    """Four minutes of sidereal time a day: by one sighting a longitude, a slow clock and a sync look alike."""
    rng = np.random.default_rng(10)
    seen = sightings(TpointMount(SITE, SITE, clock=timedelta(days=3), noise_arcmin=0.5), 2, rng)
    found = [investigate(seen[:count]) for count in (1, 2)]
    assert [one.cause for one in found] == ["", "wrong day"]
    assert "a date 3 days ahead, which is 3.0 deg" in found[1].sentence
