"""What a chart shows, read in a job: the sky, and the bodies of the Solar System at a time."""

from datetime import datetime

import numpy as np

from kochab.core.frame import Site
from kochab.core.progress import Progress, Task
from kochab.sky.catalogue import Catalogue, open_catalogue
from kochab.sky.elements import kept_elements
from kochab.sky.milky_way import MilkyWay, milky_way
from kochab.sky.sky_tables import SkyTables, sky_tables
from kochab.sky.small_bodies import SmallBodies, bodies_near
from kochab.sky.solar_system import Body

BODIES_MAG = 10.0  # down to which asteroids and comets are drawn
_READ: list[tuple[SkyTables, Catalogue, MilkyWay]] = []


def read_sky() -> Task[tuple[SkyTables, Catalogue, MilkyWay]]:
    """Stars, objects and lines of the whole sky, as :meth:`StarChart.fill` takes them; charts share them."""
    yield Progress("sky")
    if not _READ:
        tables, catalogue = sky_tables(), open_catalogue()
        _READ.append((tables, catalogue, (yield from milky_way(catalogue))))
    return _READ[0]


def read_bodies(when: datetime, site: Site | None) -> Task[tuple[datetime, list[Body]]]:
    """Those of the whole sky at a time, but for satellites: they are elsewhere in a minute."""
    own = [table for table in kept_elements() if isinstance(table, SmallBodies)]
    return when, (yield from bodies_near(when, site, np.array([0.0, 0.0, 1.0]), np.pi, BODIES_MAG, own))
