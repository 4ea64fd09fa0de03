"""The name of a field: constellations against Astropy's own, objects where every atlas has them."""

import numpy as np
import pytest
from astropy.coordinates import CartesianRepresentation, SkyCoord, get_constellation

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.solution import NamedStar, Solution
from kochab.sky.landmarks import constellation_at, name_of_field


def field(ra_deg, dec_deg, wide_deg, stars=()):
    focal = 450 / np.tan(np.radians(wide_deg) / 2)
    camera = Camera.centred(900, 600, float(focal))
    return Solution(camera, attitude_from(ra_deg, dec_deg, 30.0), tuple(stars), 0.2, -30.0, "")


def test_constellations_are_astropys_but_for_places_on_a_boundary():
    """Astropy goes to 1875 by way of FK5 and FK4, an arcsecond or so beside ERFA's long-term precession."""
    places = np.random.default_rng(5).normal(size=(4000, 3))
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    # Of the names of the IAU, Astropy misspells two, and Astropy 7 and before a third.
    misspelt = {"Ophiucus": "Ophiuchus", "Chamaleon": "Chamaeleon", "Pisces Austrinus": "Piscis Austrinus"}
    theirs = get_constellation(SkyCoord(CartesianRepresentation(*places.T), frame="icrs"))
    ours = [constellation_at(place) for place in places]
    theirs = [misspelt.get(str(name).strip(), str(name).strip()) for name in theirs]
    assert sum(one != other for one, other in zip(ours, theirs, strict=True)) <= 4
    assert len(set(ours)) == 88
    assert not {"Chamaleon", "Pisces Austrinus"} & set(ours)


@pytest.mark.parametrize(
    ("ra_deg", "dec_deg", "wide_deg", "name"),
    [
        (83.8, -5.4, 1.0, "M 42 in Orion"),
        (84.0, -4.0, 12.0, "M 42 in Orion"),
        (85.3, -2.2, 2.0, "Horsehead Nebula in Orion"),
        (84.05, -1.2, 12.0, "Orion's Belt in Orion"),
        (84.0, -0.8, 10.1, "Orion's Belt in Orion"),
        (85.2, -4.2, 10.2, "M 42 in Orion"),
        (128.5, -45.8, 6.0, "Vela Remnant in Vela"),  # NGC 2645, 3 arcmin, stands in its middle
        (187.2, 56.7, 33.0, "Big Dipper in Ursa Major"),
        (276.0, -29.0, 24.0, "Teapot in Sagittarius"),
        (130.0, 20.0, 67.0, "Cancer"),  # M 44, a degree and a half of it
        (56.3, 30.7, 10.2, "Taurus"),  # IC 348, ten arcmin
        (308.1, 39.8, 13.0, "Sadr Region in Cygnus"),  # M 29, seven arcmin
        (193.0, -62.8, 12.0, "Coalsack Nebula in Crux"),
        (83.0, -2.0, 1.0, "Orion"),  # within Barnard's Loop, which is twenty degrees wide
        (315.0, 44.4, 4.0, "North America Nebula in Cygnus"),
        (10.7, 41.3, 3.0, "M 31 in Andromeda"),
        (56.7, 24.1, 3.0, "M 45 in Taurus"),
        (187.7, 12.4, 4.0, "M 87 in Virgo"),
        (98.0, 4.9, 3.0, "Rosette Nebula in Monoceros"),
        (60.2, 36.4, 5.0, "California Nebula in Perseus"),
        (161.3, -59.9, 3.0, "Carina Nebula in Carina"),
        (83.8, -5.4, 80.0, "Orion"),
        (56.7, 24.1, 0.3, "M 45 in Taurus"),  # a frame within the cluster
        (250.4, 36.4, 1.0, "M 13 in Hercules"),
        (250.4, 36.4, 30.0, "Hercules"),  # too small to be seen there
        (10.7, 41.3, 40.0, "M 31 in Andromeda"),
        (37.0, 89.3, 2.0, "Ursa Minor"),
        (206.0, 54.0, 30.0, "Ursa Major"),
        (130.0, 20.0, 40.0, "Cancer"),  # M 44, a twentieth of the frame
        (130.0, 20.0, 20.0, "M 44 in Cancer"),
        (12.0, 61.0, 20.0, "Cassiopeia"),  # the Pacman Nebula, half a degree
        (305.0, 40.0, 45.0, "Cygnus"),  # the North America Nebula, three degrees
        (99.0, 7.5, 9.0, "Monoceros"),  # IC 447, which has a number alone, between the Rosette and the Cone
        (54.6, -35.4, 2.0, "NGC 1399 in Fornax"),
        (271.0, -23.7, 4.0, "M 8 in Sagittarius"),  # beside M 20, half as large
        (21.0, 63.0, 23.0, "Cassiopeia"),  # the Heart Nebula, two degrees and a half at its edge
        (81.5, -9.3, 27.0, "Orion"),  # all of it, the Belt a tenth
        (38.2, 61.4, 12.0, "Heart Nebula in Cassiopeia"),
        (94.2, 22.5, 1.5, "Jellyfish Nebula in Gemini"),
        (246.4, -23.4, 1.5, "Rho Ophiuchi Nebula in Ophiuchus"),
        (130.1, -53.0, 2.5, "Omicron Velorum Cluster in Vela"),
    ],
)
def test_what_a_field_is_called(ra_deg, dec_deg, wide_deg, name):
    assert name_of_field(field(ra_deg, dec_deg, wide_deg)) == name


def test_a_field_without_objects_is_called_by_its_bright_star():
    star = NamedStar(10.0, 10.0, "HIP 11767", "Polaris", 2.0, 37.95, 89.26, 0.1)
    assert name_of_field(field(37.0, 89.3, 2.0, [star])) == "Polaris in Ursa Minor"
    assert name_of_field(field(37.0, 89.3, 30.0, [star])) == "Ursa Minor"
