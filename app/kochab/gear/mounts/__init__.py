"""Telescope mounts: serial line, protocol, driver and guard, each apart."""

from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import TypedDict, Unpack

from kochab.core.errors import NoAnswerError
from kochab.core.frame import Site
from kochab.core.mount import Epoch, Home, Mount
from kochab.core.registry import Registry
from kochab.core.values import frozen

DRIVERS: Registry[Mount] = Registry(
    "mount driver",
    "kochab.drivers",
    {
        "lx200": "kochab.gear.mounts.drivers.lx200:Lx200",
        "onstep": "kochab.gear.mounts.drivers.lx200:OnStep",
        "10micron": "kochab.gear.mounts.drivers.lx200:TenMicron",
        "am5": "kochab.gear.mounts.drivers.lx200:Am5",
        "nyx": "kochab.gear.mounts.drivers.lx200:Nyx",
        "teenastro": "kochab.gear.mounts.drivers.lx200:TeenAstro",
        "astrophysics": "kochab.gear.mounts.drivers.lx200:AstroPhysics",
        "gemini": "kochab.gear.mounts.drivers.lx200:Gemini",
        "rainbow": "kochab.gear.mounts.drivers.lx200:Rainbow",
        "nexstar": "kochab.gear.mounts.drivers.nexstar:NexStar",
        "celestronaux": "kochab.gear.mounts.drivers.celestron_aux:CelestronAux",
        "starsense": "kochab.gear.mounts.drivers.nexstar:StarSense",
        "synscan": "kochab.gear.mounts.drivers.nexstar:SynScan",
        "ioptron": "kochab.gear.mounts.drivers.ioptron:Ioptron",
        "skywatcher": "kochab.gear.mounts.drivers.skywatcher:SkyWatcher",
        "indi": "kochab.gear.mounts.drivers.indi:IndiMount",
        "alpaca": "kochab.gear.mounts.drivers.alpaca:AlpacaMount",
    },
)


COUNT_STEPS = ("skywatcher", "celestronaux")  # drivers whose mounts report neither their home position nor their type
SERVERS = ("indi", "alpaca")  # drivers of mounts behind a server, found by its address instead of a port
STOP_REPLY_S = 0.5  # by then the reply to the opening Stop has come


@frozen
class Diagnosis:
    """The mount on a port, or what to do; ``advice`` may come with a mount as well."""

    port: str = ""
    driver: str = ""
    baud: int = 0
    name: str = ""
    advice: str = ""

    @property
    def found(self) -> bool:
        """Whether a mount answered."""
        return bool(self.driver)


class MountSettings(TypedDict, total=False):
    """What a person says of a mount; nothing of it is ever sent.

    ``epoch`` is the driver's default when None. ``site`` and ``clock`` are for a mount that knows
    neither (a motor board); ``home`` and ``equatorial`` for one that reports neither: where its
    counters begin, and that a board which may be alt-azimuth is on a wedge. In the folder ``kept``
    its alignment is kept for the next program.
    """

    epoch: Epoch | None
    site: Site | None
    clock: Callable[[], datetime] | None
    home: Home | None
    equatorial: bool
    kept: Path | None


def open_mount(
    driver: str, port: str, baud: int | None = None, stop_first: bool = False, **settings: Unpack[MountSettings]
) -> Mount:
    """Open a line and find the mount there; nothing moves.

    Raises `DeviceError` with what to do.

    Parameters
    ----------
    driver : str
        A name of :data:`DRIVERS`.
    port : str
        A line, or the address of a server.
    baud : int or None
        Its speed; None for the driver's default.
    stop_first : bool
        Send Stop before anything else, as after a line that was lost.
    **settings : Unpack[MountSettings]
        What a person says of the mount: see :class:`MountSettings`.
    """
    from kochab.gear.mounts.serial_line import Conversation, SerialLink, with_port

    make = DRIVERS.load(driver)
    if not make.bauds:  # a server holds the line
        mount: Mount = make(port, **settings)
        if stop_first:
            mount.stop()
        return mount
    rate = baud or make.bauds[0]
    link = SerialLink(with_port(port, make.tcp_port), rate)
    try:
        if stop_first:
            # Ahead of the driver's questions, which may take seconds. The reply differs by make and is thrown away.
            Conversation(link).send_now((make.blind_stop, ()))
            link.discard(STOP_REPLY_S)
        mount = make(link, **settings)
    except NoAnswerError as error:
        link.close()
        raise NoAnswerError(
            "No {title} answers on {port} at {rate} baud: check power, cable, driver and baud rate, or "
            "run `kochab mount probe`. ({error})",
            title=make.title,
            port=port,
            rate=rate,
            error=error,
        ) from error
    except BaseException:  # Ctrl-C, too: a port left open is locked for the next program
        link.close()
        raise
    return mount
