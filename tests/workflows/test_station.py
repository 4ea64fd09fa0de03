"""Where trees and houses end, from which stars are seen."""

import numpy as np
import pytest

from kochab.workflows.station import Sightings, _free_from


def stars(altitude_deg, azimuth_deg, seen):
    n = len(altitude_deg)
    return Sightings(np.zeros((n, 2)), np.full(n, azimuth_deg), np.array(altitude_deg), np.zeros(n), seen, 0.05)


@pytest.mark.parametrize(("azimuth_deg", "asked_deg"), [(100.0, 90.0), (5.0, 355.0), (358.0, 2.0)])
@pytest.mark.parametrize("roof_deg", [12.0, 35.0, 70.0])
def test_a_roof_ends_between_the_last_hidden_star_and_the_first_that_is_seen(azimuth_deg, asked_deg, roof_deg) -> None:
    """One in fifteen is missed above it, and one in twenty is light by chance below."""
    altitude = np.arange(3.0, 88.0, 1.5)
    seen = altitude > roof_deg
    seen[[1, 50]] = True, False
    found = _free_from(stars(altitude, azimuth_deg, seen), asked_deg, 0.95, 0.05)
    assert altitude[altitude <= roof_deg].max() < found <= altitude[altitude > roof_deg].min()


def test_where_no_star_is_seen_nothing_is_free_and_where_there_are_too_few_all_is() -> None:
    altitude = np.linspace(5.0, 85.0, 20)
    assert _free_from(stars(altitude, 50.0, np.zeros(20, bool)), 50.0, 0.95, 0.05) == 90.0
    assert _free_from(stars(altitude, 50.0, np.ones(20, bool)), 50.0, 0.95, 0.05) == 5.0
    few = stars(altitude[:3], 50.0, np.zeros(3, bool))
    assert _free_from(few, 50.0, 0.95, 0.05) == 0.0
    assert _free_from(stars(altitude, 50.0, np.zeros(20, bool)), 70.0, 0.95, 0.05) == 0.0, "another side of the house"
