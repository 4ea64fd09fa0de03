"""ICRS and the mount's own epoch: 20 arcmin apart today, and there and back to nothing."""

from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.attitude import apart_deg, wrapped
from kochab.core.frame import Site
from kochab.core.mount import Epoch, PierSide, Pointing
from kochab.gear.mounts.coordinates import from_mount_epoch, to_mount_epoch
from kochab.gear.mounts.drivers.motor_mount import natural_side, to_axes, to_sky
from kochab.gear.mounts.motion_plan import by_axes, great_circle, over_the_pole, turned
from kochab.sky.horizon import altitude_deg, hour_angle_deg, sidereal_deg, sun_vector

WHEN = datetime(2025, 3, 14, 22, tzinfo=UTC)  # measured by now in every table astropy brings along


@pytest.mark.parametrize("epoch", Epoch)
@given(ra=st.floats(0.0, 359.99), dec=st.floats(-89.9, 89.9))
def test_there_and_back(epoch, ra, dec) -> None:
    there = to_mount_epoch(ra, dec, epoch, WHEN)
    back = from_mount_epoch(Pointing(*there, epoch), WHEN)
    assert apart_deg(back, (ra, dec)) < 1e-3 / 3600.0


def test_of_date_is_where_astropy_has_it() -> None:
    from astropy.coordinates import TETE, SkyCoord
    from astropy.time import Time

    expected = SkyCoord(83.82, -5.39, unit="deg").transform_to(TETE(obstime=Time(WHEN)))
    ra, dec = to_mount_epoch(83.82, -5.39, Epoch.DATE, WHEN)
    assert apart_deg((ra, dec), (expected.ra.deg, expected.dec.deg)) < 1.0 / 3600.0
    assert apart_deg((ra, dec), (83.82, -5.39)) > 0.3


def test_altitude_sidereal_time_and_the_sun_are_where_astropy_has_them() -> None:
    from astropy.coordinates import TETE, AltAz, EarthLocation, SkyCoord, get_sun
    from astropy.time import Time

    site = Site(50.0, 8.0)
    time = Time(WHEN)
    time.delta_ut1_utc = 0.0  # as we take it
    where = EarthLocation.from_geodetic(8.0, 50.0)
    star = SkyCoord(83.82, -5.39, unit="deg").transform_to(AltAz(obstime=time, location=where))
    sidereal = time.sidereal_time("apparent", longitude=8.0).deg
    sun = get_sun(time).transform_to(TETE(obstime=time))
    here = np.atleast_2d(great_circle(to_mount_epoch(83.82, -5.39, Epoch.DATE, WHEN), (0, 0))[0])
    assert altitude_deg(here, site, WHEN)[0] == pytest.approx(star.alt.deg, abs=0.01)
    assert wrapped(sidereal_deg(site, WHEN) - sidereal) == pytest.approx(0.0, abs=0.01)
    assert hour_angle_deg(sidereal - 15.0, site, WHEN) == pytest.approx(15.0, abs=0.01)
    x, y, z = sun_vector(WHEN)
    seen = (np.degrees(np.arctan2(y, x)) % 360.0, np.degrees(np.arcsin(z)))
    assert apart_deg(seen, (sun.ra.deg, sun.dec.deg)) < 0.02


@given(hour=st.floats(-179.9, 179.9), dec=st.floats(-89.9, 89.9), side=st.sampled_from(PierSide), south=st.booleans())
def test_axes_and_sky_there_and_back(hour, dec, side, south) -> None:
    back = to_sky(to_axes(hour, dec, side, south), south)
    assert wrapped(back[0] - hour) == pytest.approx(0.0, abs=1e-9)
    assert back[1] == pytest.approx(dec, abs=1e-9)
    assert back[2] is side


def test_home_is_the_pole_with_the_counterweight_down() -> None:
    assert to_sky((0.0, 0.0), south=False)[1] == 90.0
    assert to_sky((0.0, 0.0), south=True)[1] == -90.0
    assert natural_side(-30.0) is PierSide.WEST
    for hour in (-60.0, 60.0):
        for south in (False, True):
            axes = to_axes(hour, 10.0, natural_side(hour), south)
            assert abs(axes[0]) < 90.0


def test_the_motor_that_follows_the_sky_counts_up_in_the_north_and_down_in_the_south() -> None:
    for south, way in ((False, 1.0), (True, -1.0)):
        before, _, _ = to_sky((10.0, -30.0), south)
        after, _, _ = to_sky((11.0, -30.0), south)
        assert wrapped(after - before) == pytest.approx(way)


@given(a=st.tuples(st.floats(0, 359), st.floats(-80, 80)), b=st.tuples(st.floats(0, 359), st.floats(-80, 80)))
def test_every_path_begins_and_ends_where_it_should(a, b) -> None:
    ends = great_circle(a, b)[[0, -1]]
    for path in (great_circle(a, b), by_axes(a, b), over_the_pole(a, b, True), over_the_pole(a, b, False)):
        np.testing.assert_allclose(path[[0, -1]], ends, atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(path, axis=1), 1.0)
        steps = np.degrees(np.arccos(np.clip((path[1:] * path[:-1]).sum(axis=1), -1, 1)))
        assert steps.max(initial=0.0) < 1.5


def test_a_flip_passes_the_pole() -> None:
    path = over_the_pole((80.0, 40.0), (100.0, 40.0), True)
    assert path[:, 2].max() > 0.99


def test_a_move_past_the_pole_comes_down_on_the_other_side() -> None:
    end = turned((10.0, 85.0), 0.0, 10.0)[-1]
    assert apart_deg((np.degrees(np.arctan2(end[1], end[0])), np.degrees(np.arcsin(end[2]))), (190.0, 85.0)) < 1e-9
