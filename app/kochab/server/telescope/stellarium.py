"""Stellarium's own telescope protocol: it is told where the telescope points, and sends where to go; all J2000.

A position is 24 bytes, sent twice a second: length, type 0, microseconds since 1970, RA and Dec as parts of a turn, and
a status. A goto is 20, the same without the status; whole numbers, little endian. Source: ``TelescopeClient.cpp`` and
"Stellarium telescope control protocol, version 1.0".
"""

import asyncio
import struct
import time

from kochab.core.attitude import Degrees
from kochab.server.telescope.listening import Line, NotTheProtocol, Ports, verdict_of

PORT = 10001
EVERY_S = 0.5
GOTO, POSITION = struct.Struct("<HHqIi"), struct.Struct("<HHqIii")
TURN = 2**32  # of a full circle


def position_message(place_deg: Degrees, microseconds: int) -> bytes:
    """What tells Stellarium a place, J2000 degrees, at a moment since 1970."""
    ra = round(place_deg[0] / 360.0 * TURN) % TURN
    dec = round(place_deg[1] / 360.0 * TURN)
    return POSITION.pack(POSITION.size, 0, microseconds, ra, dec, 0)


def goto_place(message: bytes) -> Degrees:
    """The place, J2000 degrees, of a goto; NotTheProtocol when it is none."""
    size, kind, _, ra, dec = GOTO.unpack(message)
    if (size, kind) != (GOTO.size, 0) or abs(dec) > TURN // 4:
        raise NotTheProtocol
    return ra / TURN * 360.0, dec / TURN * 360.0


def listen(ports: Ports, port: int) -> int:
    """Offer it at a port, 0 for any, and return that; PortError when it cannot be had."""
    return ports.listen("Stellarium", talk, port)


async def talk(line: Line) -> None:
    """Tell one Stellarium the position, and take its gotos, until it goes."""
    telling = asyncio.ensure_future(_tell(line))
    taking = asyncio.ensure_future(_take(line))
    try:
        done, _ = await asyncio.wait((telling, taking), return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        for task in (telling, taking):
            task.cancel()


async def _tell(line: Line) -> None:
    while True:
        # Silence is this protocol's word for not knowing.
        if (seen := line.telescope.seen) is not None and not seen.past:
            await line.send(position_message(seen.icrs_deg, time.time_ns() // 1000))
        await asyncio.sleep(EVERY_S)


async def _take(line: Line) -> None:
    held = b""
    while data := await line.read():
        held += data
        while len(held) >= GOTO.size:
            message, held = held[: GOTO.size], held[GOTO.size :]
            await verdict_of(line.telescope.goto(goto_place(message), line.who))
