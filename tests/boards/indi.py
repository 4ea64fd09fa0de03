"""INDI's own drivers on the boards: a server in a network of its own, and what INDI's command line reads there."""

import shutil
import time
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from tests.gear.mounts.indi_server import indi_server

from . import BEHIND_INDI, Night, served
from .sky import apart_deg

PROGRAMS = {
    "onstep": ("indi_lx200_OnStep", "LX200 OnStep"),
    "onstepx": ("indi_lx200_OnStep", "LX200 OnStep"),
    "am5": ("indi_lx200am5", "ZWO AM5"),
    "ioptron": ("indi_ioptronv3_telescope", "iOptronV3"),
    "nexstar": ("indi_celestron_gps", "Celestron GPS"),
    "skywatcher": ("indi_eqmod_telescope", "EQMod Mount"),
    "stargo": ("indi_lx200stargo", "Avalon StarGo"),
    "starbook": ("indi_starbook_telescope", "Starbook"),
    "exos2": ("indi_bresserexos2", "BRESSER Messier EXOS-2 EQ GoTo"),
}
ROUNDED_DEG = {"starbook": 3.0 / 60.0}
"""How near a kind's places are read back, where not to a second of RA: its driver and it both cut off tenths of a
minute of RA, 3 arcmin in all, and minutes of declination."""
SECOND_OF_RA_DEG = 25.0 / 3600.0
PLACE = "EQUATORIAL_EOD_COORD"


EXOS2_SIGNED, EXOS2_UNSIGNED = (bytes.fromhex(f"85c0751c660f{way}442403") for way in ("be", "b6"))


def program_of(kind, home):
    """The program that drives a kind; None of what it does is changed but one slip of a compiler's default.

    On an Intel computer indi-bresserexos2 0.901 takes every byte from 0x80 on for the end of what there is to read, its
    own header's 0xAA first, and hears nothing of the mount: a ``char`` has a sign there, and has none on the author's
    Raspberry Pi. Its author mended that with a cast; here a copy of Debian's program gets it (`movsbw` to `movzbw`).
    """
    program = PROGRAMS[kind][0]
    found = shutil.which(program)
    if kind != "exos2" or found is None:
        return program
    code = Path(found).read_bytes()
    if code.count(EXOS2_SIGNED) != 1:
        return program
    copy = Path(home, program)
    copy.write_bytes(code.replace(EXOS2_SIGNED, EXOS2_UNSIGNED))
    copy.chmod(0o755)
    return str(copy)


ASK_S = 0.25  # each look at what INDI tells is a process, and its drivers look at a board four times a second


def until(holds, why, pause_s=0.05):
    """Wait, at most two minutes of a busy computer, until something holds."""
    deadline = time.monotonic() + 120.0
    while not holds():
        assert time.monotonic() < deadline, why
        time.sleep(pause_s)


class Indi:
    """INDI's driver of one board."""

    def __init__(self, server, kind):
        self.server, self.device = server, PROGRAMS[kind][1]
        self.rounded_deg = ROUNDED_DEG.get(kind, SECOND_OF_RA_DEG)

    def set(self, *wishes):
        self.server.set(*(f"{self.device}.{wish}" for wish in wishes))

    def get(self, name):
        return self.server.get(f"{self.device}.{name}")

    def goto(self, ra_deg, dec_deg):
        self.set("ON_COORD_SET.TRACK=On", f"{PLACE}.RA;DEC={ra_deg / 15.0};{dec_deg}")

    def says_deg(self):
        ra, dec = self.server.get_all(*(f"{self.device}.{PLACE}.{member}" for member in ("RA", "DEC")))
        return 15.0 * float(ra), float(dec)

    def says(self, place_deg):
        """Whether it reads back this place soon."""
        until(lambda: apart_deg(self.says_deg(), place_deg) < self.rounded_deg, f"INDI does not say {place_deg}", ASK_S)

    def is_ok(self, vector, why):
        """Whether INDI soon shows this vector's state as Ok."""
        until(lambda: self.get(f"{vector}._STATE") == "Ok", why, ASK_S)

    def tell(self, board):
        """Tell the driver where the board is."""
        if board.kind == "starbook":
            host, port = board.port.removeprefix("socket://").split(":")
            self.set(f"DEVICE_ADDRESS.ADDRESS;PORT={host};{port}")
        else:
            self.set("CONNECTION_MODE.CONNECTION_SERIAL=On", "DEVICE_AUTO_SEARCH.INDI_DISABLED=On")
            self.set(f"DEVICE_PORT.PORT={board.port}")

    def connect(self, board):
        """The same, and have it connect."""
        self.tell(board)
        self.set("CONNECTION.CONNECT=On")
        if board.kind not in BEHIND_INDI:  # whose drivers are asked by the second
            self.set("POLLING_PERIOD.PERIOD_MS=250")
        if board.kind == "exos2":  # until it has seen that the mount tracks, an order breaks its table of states
            self.is_ok(PLACE, "INDI does not see that the mount tracks")


@contextmanager
def behind_indi(kind, home, connects=True, speed=1.0, **settings):
    """A board, and INDI's driver of it; with ``connects`` connected to the board, at an hour angle of -40 deg.

    The families that have no driver of ours keep the computer's date, ``speed`` times as fast as it.
    """
    if kind in BEHIND_INDI:
        settings.setdefault("clock", Night(datetime.now(UTC), speed))
    # The network of the server is one of its own, with a loopback of its own: the board comes into it.
    program = program_of(kind, home)
    with indi_server(home, program) as server, served(kind, tcp=kind == "starbook", **settings) as board:
        board.kind = kind
        board.here = board.align(-40.0, 40.0) if kind != "skywatcher" else board.radec_deg()
        indi = Indi(server, kind)
        if connects:
            indi.connect(board)
        yield board, indi
