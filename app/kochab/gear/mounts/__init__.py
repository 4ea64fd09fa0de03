"""Telescope mounts: serial line, protocol, driver and guard, each apart."""

from collections.abc import Callable
from datetime import datetime

from kochab.core.errors import NoAnswerError
from kochab.core.frame import Site
from kochab.core.mount import Epoch, Home, Mount
from kochab.core.registry import Registry

DRIVERS: Registry[Mount] = Registry(
    "mount driver",
    "kochab.drivers",
    {
        "lx200": "kochab.gear.mounts.drivers.lx200:Lx200",
        "onstep": "kochab.gear.mounts.drivers.lx200:OnStep",
        "nexstar": "kochab.gear.mounts.drivers.nexstar:NexStar",
        "synscan": "kochab.gear.mounts.drivers.nexstar:SynScan",
        "ioptron": "kochab.gear.mounts.drivers.ioptron:Ioptron",
        "skywatcher": "kochab.gear.mounts.drivers.skywatcher:SkyWatcher",
    },
)


STOP_REPLY_S = 0.5  # the reply to the Stop that opens a line has come by then


def open_mount(
    driver: str,
    port: str,
    baud: int | None = None,
    epoch: Epoch | None = None,
    site: Site | None = None,
    clock: Callable[[], datetime] | None = None,
    stop_first: bool = False,
    home: Home | None = None,
    equatorial: bool = False,
) -> Mount:
    """Open ``port`` and find the mount there; nothing moves.

    Parameters
    ----------
    driver
        A name of :data:`DRIVERS`.
    baud, epoch
        The driver's default when None.
    site, clock
        For a mount that knows neither (``skywatcher``); they are never sent.
    stop_first
        Send the bytes of Stop before anything else, as after a line that was lost.
    home, equatorial
        The user's word for a mount that reports neither (``skywatcher``): where its counters
        begin, and that a board which may be alt-azimuth is on a wedge.

    Raises
    ------
    DeviceError
        One sentence that says what to do.

    """
    from kochab.gear.mounts.serial_line import Conversation, SerialLink

    make = DRIVERS.load(driver)
    rate = baud or make.bauds[0]
    link = SerialLink(port, rate)
    try:
        if stop_first:
            Conversation(link).send_now((make.blind_stop, ()))
            link.discard(STOP_REPLY_S)
        mount: Mount = make(link, epoch=epoch, site=site, clock=clock, home=home, equatorial=equatorial)
    except NoAnswerError as error:
        link.close()
        raise NoAnswerError(
            f"No {make.title} answers on {port} at {rate} baud: check power, cable, driver and "
            f"baud rate, or run `kochab mount probe`. ({error})"
        ) from error
    except BaseException:
        link.close()
        raise
    return mount
