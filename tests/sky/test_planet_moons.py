from datetime import UTC, datetime

import numpy as np
import pytest

from kochab.core.attitude import east_north
from kochab.core.frame import Site
from kochab.core.progress import run
from kochab.sky.planet_moons import RADIUS_KM, planet_moons
from kochab.sky.small_bodies import bodies_near
from kochab.sky.solar_system import BodyKind, major_bodies, observer_at

OFFSETS = [  # arcsec east and north of Jupiter, from the Earth's centre: PyEphem 4.2.1, whose moons are the BDL's series
    ("2001-02-03T04:00", [[117.07, 26.27], [-171.02, -39.59], [257.81, 64.21], [-211.18, -20.31]]),
    ("2006-07-09T21:30", [[0.4, 6.54], [-71.7, 34.15], [-230.68, 73.3], [468.07, -157.07]]),
    ("2010-09-21T00:10", [[131.53, 61.89], [191.12, 96.1], [-222.57, -94.38], [-510.53, -226.26]]),
    ("2014-01-05T22:00", [[-70.31, 13.19], [-146.2, 14.11], [-342.23, 45.08], [-412.55, 44.8]]),
    ("2018-05-09T01:15", [[-0.75, -7.84], [150.76, -35.9], [-308.73, 87.88], [530.06, -169.77]]),
    ("2022-09-26T23:00", [[75.4, 41.75], [99.2, 59.19], [305.74, 137.92], [-559.16, -251.48]]),
    ("2026-11-23T05:00", [[-68.64, 27.28], [162.67, -65.88], [195.89, -80.5], [313.42, -122.19]]),
    ("2030-06-13T02:20", [[121.56, -34.42], [38.3, -0.61], [293.01, -80.11], [-260.41, 49.01]]),
    ("2034-10-02T20:45", [[-79.59, -31.02], [-45.07, -10.39], [-337.63, -158.81], [-590.29, -267.96]]),
]
"""PyEphem's right ascensions of moons leave out the cosine of the declination, counted here."""


@pytest.mark.parametrize(("when", "offsets"), OFFSETS)
def test_the_moons_of_jupiter_are_where_another_theory_has_them(when, offsets):
    observer = observer_at(datetime.fromisoformat(when).replace(tzinfo=UTC), None)
    jupiter = next(body for body in major_bodies(observer) if body.name == "Jupiter")
    east, north = east_north(jupiter.vector)
    seen = {body.name: body for body in planet_moons(observer, jupiter)}
    assert len(seen) >= 3
    for name, (x, y) in zip(RADIUS_KM, offsets, strict=True):
        if name not in seen:
            assert np.hypot(x, y) < jupiter.diameter_arcsec / 2.0 + 1.0  # behind it
            continue
        ours = np.degrees([seen[name].vector @ east, seen[name].vector @ north]) * 3600
        assert np.hypot(*(ours - [x, y])) < (2.0 if name == "Callisto" else 0.7), name
        assert 4.3 < seen[name].magnitude < 6.8


def test_the_moons_of_jupiter_are_among_the_bodies_of_a_field():
    when, place = datetime(2026, 11, 23, 5, tzinfo=UTC), Site(48.0, 11.0)
    jupiter = next(body for body in major_bodies(observer_at(when, place)) if body.name == "Jupiter")
    found = {body.name: body.kind for body in run(bodies_near(when, place, jupiter.vector, 0.005, 8.0))}
    assert found == {"Jupiter": BodyKind.PLANET, **dict.fromkeys(RADIUS_KM, BodyKind.SATELLITE)}
