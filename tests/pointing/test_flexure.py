"""The droop of a tube on mounts made from axes and rotations with ERFA: the rig's is in `tests/workflows`."""

from dataclasses import replace

import erfa
import numpy as np
import pytest

from kochab.pointing.flexure import tube_droop
from kochab.pointing.pointing_model import fit_model
from kochab.sky.horizon import sidereal_deg
from tests.pointing.faulty_mounts import sightings
from tests.pointing.test_pointing_model import bad_mount


@pytest.mark.parametrize(("noise_arcmin", "least", "most"), [(0.03, 0.0, 30.0), (2.0, 30.0, 100.0)])
def test_a_mount_that_takes_refraction_out_has_no_droop(noise_arcmin, least, most) -> None:
    """Refraction is a hundred arcsec of droop; both answers are tried. What scatters tells neither."""
    pulls, sigmas = [], []
    for seed in range(8):
        mount, rng = bad_mount(seed)
        mount.noise = noise_arcmin
        seen = sightings(mount, 12, rng, sides=True)
        value, sigma = tube_droop(seen, fit_model(seen))
        pulls.append(value / sigma)
        sigmas.append(sigma)
    assert np.abs(pulls).max() < 3.0
    assert np.sqrt(np.mean(np.square(pulls))) < 1.5
    assert least < np.median(sigmas) < most


def raised(one, arcsec):
    """The same sighting of a tube that hangs below its axes by so much times the cosine of the altitude."""
    sidereal, latitude = np.radians([sidereal_deg(one.site, one.time_utc), one.site.latitude_deg])
    azimuth, altitude = erfa.hd2ae(
        sidereal - np.radians(one.reported.ra_deg), np.radians(one.reported.dec_deg), latitude
    )
    hour, dec = erfa.ae2hd(azimuth, altitude + np.radians(arcsec / 3600.0) * np.cos(altitude), latitude)
    ra_deg, dec_deg = np.degrees([erfa.anp(sidereal - hour), dec])
    return replace(one, reported=replace(one.reported, ra_deg=float(ra_deg), dec_deg=float(dec_deg)))


def test_a_tube_that_droops_below_its_axes_is_found() -> None:
    pulls = []
    for seed in range(12):
        mount, rng = bad_mount(seed)
        mount.noise = 0.03
        seen = [raised(one, 50.0) for one in sightings(mount, 12, rng, sides=True)]
        value, sigma = tube_droop(seen, fit_model(seen))
        pulls.append((value - 50.0) / sigma)
    assert np.sqrt(np.mean(np.square(pulls))) < 1.3
    assert np.abs(pulls).max() < 3.0


def test_without_noise_the_droop_is_right_to_two_arcsec() -> None:
    """The direction of the droop at each hour angle, and cone error's part in it, which noise would hide."""
    for seed in range(4):
        mount, rng = bad_mount(seed)
        mount.noise = 0.0
        seen = [raised(one, 50.0) for one in sightings(mount, 24, rng, sides=True)]
        value, sigma = tube_droop(seen, fit_model(seen))
        assert value == pytest.approx(50.0, abs=2.0)
        assert sigma < 2.0


def test_four_places_have_no_droop() -> None:
    mount, rng = bad_mount(1)
    seen = sightings(mount, 5, rng, sides=True)
    model = fit_model(seen)
    assert tube_droop(seen[:4], model) is None
    assert tube_droop(seen, model) is not None
