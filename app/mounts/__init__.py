"""Telescope mounts over a serial line: link, protocol, driver and guard, each apart."""

from collections.abc import Callable
from datetime import datetime
from importlib import import_module
from typing import Any

from app.core.errors import NoAnswerError, UsageError
from app.core.hint import Site
from app.core.mount import Epoch, Mount

DRIVERS: dict[str, str] = {
    "lx200": "app.mounts.drivers.lx200:Lx200",
    "onstep": "app.mounts.drivers.onstep:OnStep",
    "nexstar": "app.mounts.drivers.nexstar:NexStar",
    "synscan": "app.mounts.drivers.synscan:SynScan",
    "ioptron": "app.mounts.drivers.ioptron:Ioptron",
    "skywatcher": "app.mounts.drivers.skywatcher:SkyWatcher",
}


ANSWERED_S = 0.5  # what is said to a Stop that nobody waited for has come by then


def driver_class(name: str) -> Any:
    """The driver registered as ``name``; `UsageError` names those there are."""
    if name not in DRIVERS:
        raise UsageError(f"There is no mount driver {name!r}; there are {', '.join(DRIVERS)}.")
    module, _, cls = DRIVERS[name].partition(":")
    return getattr(import_module(module), cls)


def open_mount(
    driver: str,
    port: str,
    baud: int | None = None,
    epoch: Epoch | None = None,
    site: Site | None = None,
    clock: Callable[[], datetime] | None = None,
    stop_first: bool = False,
) -> Mount:
    """Open ``port`` and find the mount there; nothing moves.

    Parameters
    ----------
    driver
        A name of :data:`DRIVERS`.
    baud, epoch
        The driver's own when None.
    site, clock
        For a mount that knows neither (``skywatcher``); they are never sent.
    stop_first
        Send the bytes of Stop before anything else, as after a line that was lost.

    Raises
    ------
    DeviceError
        With one sentence and what to do.

    """
    from app.mounts.link import open_link

    make = driver_class(driver)
    rate = baud or make.bauds[0]
    link = open_link(port, rate)
    try:
        if stop_first:
            link.write(make.blind_stop)
            link.discard(ANSWERED_S)
        mount: Mount = make(link, epoch=epoch, site=site, clock=clock)
    except NoAnswerError as error:
        link.close()
        raise NoAnswerError(
            f"No {make.title} answers on {port} at {rate} baud: check power, cable, driver and "
            f"baud rate, or let `kochab mount probe` look. ({error})"
        ) from error
    except BaseException:
        link.close()
        raise
    return mount
