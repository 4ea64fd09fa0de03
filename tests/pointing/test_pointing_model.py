"""A pointing model made from some places, tried at others, on mounts made from axes and rotations with ERFA."""

import re
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from kochab.core.attitude import apart_deg
from kochab.core.errors import RefusedError
from kochab.pointing.pointing_model import FEWEST, fit_model, reported_at
from kochab.sky.horizon import sidereal_deg
from tests.pointing.faulty_mounts import _tilt, make, sightings

NEW = 6  # places that the model has not seen


def bad_mount(seed, alt_azimuth=False):
    """An axis that leans by a degree, both axes off by half of one, and a cone of 20 arcmin; 0.5 arcmin of noise."""
    rng = np.random.default_rng(seed)
    mount = make("base tilt" if alt_azimuth else "polar axis", rng)
    mount.base, mount.offset, mount.noise = _tilt(rng, 1.0), tuple(rng.normal(0.0, 0.5, 2)), 0.5
    mount.cone = 0.0 if alt_azimuth else 20.0 / 60.0
    return mount, rng


def pointing_errors_deg(mount, model, rng):
    """How far from a place the telescope points after a goto to it, without the model and with it.

    A goto sends the mount to where it is told; what it then says is that. So the telescope stands where a sighting says
    just this: the place is wanted whose command is what the mount said, and the error is the command's from there.
    """
    plain, aimed = [], []
    for seen in sightings(mount, NEW, rng, sides=True):
        command = model.aim(seen.expected_deg, seen.time_utc)
        said = seen.reported.ra_deg, seen.reported.dec_deg
        plain.append(apart_deg(seen.expected_deg, said))
        aimed.append(apart_deg(command, said))
    return plain, aimed


@pytest.mark.parametrize("alt_azimuth", [False, True])
@pytest.mark.parametrize("count", [6, 10])
def test_a_misaligned_mount_points_much_better_with_its_model(alt_azimuth, count) -> None:
    """Over 6 mounts in both hemispheres."""
    before, after = [], []
    for seed in range(6):
        mount, rng = bad_mount(seed, alt_azimuth)
        model = fit_model(sightings(mount, count, rng, sides=True))
        plain, aimed = pointing_errors_deg(mount, model, rng)
        before, after = before + plain, after + aimed
        assert model.helps
    assert np.sqrt(np.mean(np.square(before))) * 60.0 > 30.0  # arcmin
    assert np.sqrt(np.mean(np.square(after))) * 60.0 < 3.0


def test_the_terms_are_those_of_the_mount_within_their_sigmas() -> None:
    pulls = []
    for seed in range(20):
        mount, rng = bad_mount(seed)
        model = fit_model(sightings(mount, 10, rng, sides=True))
        leans = np.degrees(mount.base.as_rotvec()[:2])
        pulls += list((np.array(model.terms_deg[2:4]) - leans) / np.array(model.sigmas_deg[2:4]))
    assert np.sqrt(np.mean(np.square(pulls))) == pytest.approx(1.0, abs=0.5)
    assert np.abs(pulls).max() < 5.0


def test_an_offset_of_the_declination_axis_is_the_other_way_on_the_other_side_of_the_pier() -> None:
    """A computer that counts steps keeps it over the flip; to a model of declination alone it was noise."""
    after = []
    for seed in range(8):
        mount, rng = bad_mount(seed)
        mount.offset = mount.offset[0], 0.0
        seen = []
        for one in sightings(mount, 10, rng, sides=True):
            hour = sidereal_deg(one.site, one.time_utc) - one.expected_deg[0]
            turned = 0.5 if hour % 360.0 < 180.0 else -0.5
            seen.append(replace(one, reported=replace(one.reported, dec_deg=one.reported.dec_deg + turned)))
        model = fit_model(seen)
        assert model.reverses
        after.append(model.foretold_arcsec)
        for one in seen:
            said = one.reported.ra_deg, one.reported.dec_deg
            assert apart_deg(model.aim(one.expected_deg, one.time_utc), said) < 6.0 / 60.0
        mount.offset = mount.offset[0], 0.5
        assert not fit_model(sightings(mount, 10, rng, sides=True)).reverses
    assert np.sqrt(np.mean(np.square(after))) < 180.0


@pytest.mark.parametrize("north", [True, False])
def test_a_polar_axis_that_is_too_high_is_called_so_in_both_hemispheres(north) -> None:
    """The axis is turned in the meridian towards the zenith by a degree."""
    from scipy.spatial.transform import Rotation

    mount, rng = bad_mount(3)
    mount.site = mount.believes = replace(mount.site, latitude_deg=45.0 if north else -45.0)
    towards_zenith = 1.0 if north else -1.0  # of the end of the axis at the north pole
    mount.base, mount.cone, mount.noise = Rotation.from_rotvec([0.0, np.radians(towards_zenith), 0.0]), 0.0, 0.01
    lines = fit_model(sightings(mount, 10, rng, sides=True)).lines()
    (high,) = (line.split()[4] for line in lines if line.startswith("polar axis too high"))
    assert float(high.rstrip("′")) == pytest.approx(60.0, abs=1.0)


def test_three_sightings_no_site_and_a_far_shift_are_refused() -> None:
    mount, rng = bad_mount(1)
    seen = sightings(mount, 8, rng, sides=True)
    with pytest.raises(RefusedError, match=f"needs {FEWEST} sightings"):
        fit_model(seen[:3])
    with pytest.raises(RefusedError, match="needs the site"):
        fit_model([replace(one, site=None) for one in seen])
    with pytest.raises(RefusedError, match="needs the site"):
        fit_model([replace(seen[0], site=None), *seen[1:]])
    model = fit_model(seen)
    far = replace(model, terms_deg=(0.0, 6.0, 0.0, 0.0, 0.0))
    with pytest.raises(RefusedError, match="shift this goto by 6"):
        far.aim(seen[0].expected_deg, seen[0].time_utc)
    assert apart_deg(model.aim(seen[0].expected_deg, seen[0].time_utc), seen[0].expected_deg) < 5.0


@pytest.mark.parametrize("alt_azimuth", [False, True])
def test_where_right_ascension_begins_means_nothing(alt_azimuth) -> None:
    """A place an hour east of the meridian, or west, is sent to the same in the mount whatever the sidereal time."""
    mount, rng = bad_mount(4, alt_azimuth)
    model = fit_model(sightings(mount, 8, rng, sides=True))
    for hour_deg in (-170.0, -40.0, -1.0, 1.0, 40.0, 170.0):
        shifts = []
        for sidereal in (0.0, 5.0, 90.0, 175.0, 185.0, 355.0):
            ra, dec = reported_at(model, ((sidereal - hour_deg) % 360.0, 25.0), sidereal)
            shifts.append(((ra - sidereal + hour_deg + 180.0) % 360.0 - 180.0, dec - 25.0))
        np.testing.assert_allclose(shifts, shifts[:1] * 6, atol=1e-9)


def test_what_a_model_is_worth_is_told_in_arcminutes_as_root_mean_squares() -> None:
    mount, rng = bad_mount(6)
    seen = sightings(mount, 8, rng, sides=True)
    model = fit_model(seen)
    off = [apart_deg(one.expected_deg, (one.reported.ra_deg, one.reported.dec_deg)) for one in seen]
    assert model.before_arcsec == pytest.approx(3600.0 * np.sqrt(np.mean(np.square(off))))
    assert 5.0 < model.after_arcsec < model.foretold_arcsec < 300.0  # 0.5 arcmin of noise
    *terms, worth = model.lines()
    south = np.array([1.0, 1.0, *[-1.0 if mount.site.latitude_deg < 0.0 else 1.0] * 2, 1.0])
    shown = np.array([[float(word) for word in re.findall(r"([+-]?[\d.]+)′", line)] for line in terms])
    expected = np.stack([60.0 * south * model.terms_deg, 60.0 * np.array(model.sigmas_deg)], axis=1)
    np.testing.assert_allclose(shown, expected, atol=0.0051)
    before, after = model.before_arcsec / 60.0, model.after_arcsec / 60.0
    assert worth.startswith(f"8 sightings are off by {before:.1f}′, with the model by {after:.1f}′;")


def test_a_healthy_mount_gains_nothing_and_loses_nothing() -> None:
    rng = np.random.default_rng(5)
    mount = make("", rng)
    mount.noise = 0.5
    model = fit_model(sightings(mount, 8, rng, sides=True))
    plain, aimed = pointing_errors_deg(mount, model, rng)
    assert max(aimed) < max(plain) + 2.0 / 60.0
    place = (100.0, 20.0)
    later = model.made_utc + timedelta(hours=1)
    assert apart_deg(model.aim(place, later), place) < 4.0 / 60.0
