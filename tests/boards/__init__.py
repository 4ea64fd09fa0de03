"""Mount boards that share nothing with the drivers they test, for anybody's tests.

Written from protocols and from what INDI's and OnStep's sources do; axes accelerate, the tube's true direction is known
apart from what the board believes, and the supply can be cut while the port stays open::

    with served("onstep") as board:                    # or any other name of BOARDS or BEHIND_INDI
        board.align(-20.0, 40.0)                       # hour angle, Dec: tube and belief agree, tracking
        mount = open_mount("onstep", board.port, site=board.site, clock=board.clock)
        board.cut_power(off_s=1.0)                     # wakes at its false home after board.boot_s
        assert not board.false_slews() and board.lowest_deg() > 0.0 and not board.moving

``board.radec_deg()`` is the truth, ``board.believed_deg()`` what the board takes for it, both of date;
``board.false_by_deg()`` the angle between. ``lose_stops``, ``lose_answers``, ``delay_answers``, ``clock_error_s`` (13
years: ``board.clock_error_s = -13 * 31557600``) and ``site_deg`` spoil an evening; ``orders``, ``transcript`` and
``tube.path`` tell of it. Everything runs on ``board.clock``: `Night` by the computer's time, or ``speed`` times as fast.

In a :func:`virtual_time` nobody waits for anything: ``served("onstep", time=time)``, and ``board.timing.sleep``.
"""

import os
from contextlib import contextmanager

from kochab.core.frame import Site

from .am5 import Am5
from .board import Board, Order
from .exos2 import Exos2
from .ioptron import Ioptron
from .nexstar import NexStar
from .onstep import OnStep, OnStepX
from .serving import Line
from .sky import LATITUDE_DEG, LONGITUDE_DEG, START, Frozen, Night
from .skywatcher import SkyWatcher
from .starbook import StarBook
from .stargo import StarGo
from .virtual_time import RealTime, virtual_time

BOARDS = {
    "onstep": OnStep,
    "onstepx": OnStepX,
    "am5": Am5,
    "ioptron": Ioptron,
    "nexstar": NexStar,
    "skywatcher": SkyWatcher,
}
BEHIND_INDI = {"stargo": StarGo, "starbook": StarBook, "exos2": Exos2}
"""Boards that the product drives through INDI's drivers alone; see :mod:`tests.boards.indi`."""
DRIVERS = {kind: "onstep" if kind == "onstepx" else kind for kind in BOARDS}
"""The product's driver of each board, by its name in the registry."""

SITE = Site(LATITUDE_DEG, LONGITUDE_DEG)


@contextmanager
def served(kind, tcp=os.name == "nt", time=None, start=START, **settings):
    """A board on a pseudo-terminal, or on a TCP port; ``board.port`` is what a driver opens.

    With a virtual ``time`` it is a port of its own, and its night begins at ``start``.
    """
    if time is not None:
        board = BOARDS[kind](clock=time.night(start), **settings)
        board.site, board.timing, board.driver = SITE, time, DRIVERS[kind]
        board.port = time.port_of(board)
        yield board
        return
    board = {**BOARDS, **BEHIND_INDI}[kind](**settings)
    board.site, board.timing = SITE, RealTime
    line = Line(board, tcp)
    board.port, board.line, board.driver = line.port, line, DRIVERS.get(kind, "indi")
    try:
        yield board
    finally:
        line.close()


__all__ = [
    "BEHIND_INDI",
    "BOARDS",
    "DRIVERS",
    "SITE",
    "START",
    "Am5",
    "Board",
    "Exos2",
    "Frozen",
    "Ioptron",
    "Line",
    "NexStar",
    "Night",
    "OnStep",
    "OnStepX",
    "Order",
    "SkyWatcher",
    "StarBook",
    "StarGo",
    "served",
    "virtual_time",
]
