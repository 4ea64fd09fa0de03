"""The Milky Way from star counts: astropy's galactic axes, and the clouds and dark lanes that every atlas prints."""

import numpy as np
import pytest
from astropy.coordinates import SkyCoord

from kochab.core.attitude import unit_vectors
from kochab.core.progress import run
from kochab.sky.catalogue import open_catalogue
from kochab.sky.milky_way import MilkyWay, milky_way, to_galactic


@pytest.fixture(scope="module")
def glow():
    return run(milky_way(open_catalogue()))


def at(glow, longitude, latitude):
    place = SkyCoord(l=longitude, b=latitude, unit="deg", frame="galactic").icrs
    return glow.brightness(unit_vectors(place.ra.deg, place.dec.deg)[None])[0]


def test_the_axes_are_astropys():
    for ra, dec in ((0.0, 0.0), (83.6, 22.0), (266.4, -28.9), (10.0, -89.0)):
        theirs = SkyCoord(ra, dec, unit="deg").galactic
        assert to_galactic() @ unit_vectors(ra, dec) == pytest.approx(
            theirs.cartesian.xyz.value, abs=5e-7
        )  # a tenth of an arcsecond


@pytest.mark.parametrize(
    ("cloud", "dark"),
    [
        ((78.0, 1.0), (30.0, 6.0)),  # the cloud in Cygnus, the lane in Serpens
        ((287.0, -1.0), (287.0, 30.0)),  # Carina
        ((2.0, -3.5), (2.0, 12.0)),  # Sagittarius, and the clouds of dust in Ophiuchus
        ((240.0, -4.0), (240.0, 40.0)),  # Puppis
    ],
)
def test_clouds_are_bright_and_lanes_dark(glow, cloud, dark):
    assert at(glow, *cloud) > 0.3
    assert at(glow, *dark) < 0.05


def test_at_the_poles_there_is_none(glow):
    assert not glow.light[:35].any()
    assert not glow.light[-35:].any()
    assert 0.9 < glow.light.max() <= 1.0


def test_between_cells_it_is_interpolated_all_the_way_round():
    light = np.zeros((180, 360))
    light[90, 359], light[90, 0] = 1.0, 0.5  # latitude 0.5, longitudes -0.5 and 0.5
    glow = MilkyWay(light)
    assert [at(glow, x, 0.5) for x in (359.5, 359.75, 0.0, 0.5, 1.0)] == pytest.approx(
        [1.0, 0.875, 0.75, 0.5, 0.25], abs=1e-4
    )
    assert at(glow, 359.5, 1.0) == pytest.approx(0.5, abs=1e-4)
    assert glow.brightness(np.full((1, 3), np.nan)) == [0.0]


class Band:
    """Faint stars, at random on the sphere, and in the galactic plane so many times as close."""

    def __init__(self, times, rng):
        z = rng.uniform(-1.0, 1.0, 600_000)
        turn = rng.uniform(0.0, 2.0 * np.pi, len(z))
        kept = (np.abs(z) < 0.25) | (rng.random(len(z)) < 1.0 / times)
        z, turn = z[kept], turn[kept]
        across = np.sqrt(1.0 - z**2)
        self.stars = np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1) @ to_galactic()

    def __len__(self):
        return len(self.stars)

    def mag(self, rows):
        return np.full(len(rows), 9.0)

    def vectors(self, rows):
        return self.stars[rows]


@pytest.mark.parametrize(("times", "light"), [(2.0, 0.0), (4.45, 0.5), (8.0, 1.0)])
def test_it_is_dark_at_2_4_times_the_density_of_the_poles_and_brightest_at_6_5_times(times, light):
    shown = run(milky_way(Band(times, np.random.default_rng(3)))).light
    assert np.mean(shown[85:95]) == pytest.approx(light, abs=0.05)
    assert not shown[[*range(60), *range(120, 180)]].any()
