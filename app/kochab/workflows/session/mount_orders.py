"""The orders for a mount, as tasks for the thread of its line.

Each function gives a maker: a function of the guarded mount that returns the task.
"""

import re
from collections.abc import Callable
from datetime import datetime
from typing import Any

from kochab.core.angle_text import parse_dec_deg, parse_ra_deg
from kochab.core.errors import UsageError
from kochab.core.frame import Site
from kochab.core.progress import Progress, Task
from kochab.core.solution import Solution, SolveNow
from kochab.gear.mount_line import MakeTask
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.workflows.centre_target import Centring, centre_target
from kochab.workflows.goto_target import Target, goto_target, named_target, target_at
from kochab.workflows.session.mount_camera import MountCamera
from kochab.workflows.sync_mount import SyncDone, SyncOffer, accept_sync, offer_of, offer_sync, sync_done

# -- Where to go: a name the catalogue knows, or coordinates as people type them ---------------

NOTHING = "Enter a target: a name such as M 42, Vega or HIP 32349, or “5h35m17s -5d23m”."


def parse_target(text: str, time_utc: datetime) -> Target:
    """A target from ``M 42``, ``Vega``, ``83.82 -5.39``, ``5h35m17s, -5d23m28s``.

    A name is looked up in the catalogue, which takes a moment the first time: not for the
    window's thread. UsageError says what is wrong.
    """
    clean = " ".join(text.split())
    if not clean:
        raise UsageError(NOTHING)
    if re.match(r"[+-]?[\d.]+\s*([hd°:,\s]|$)", clean) and not re.match(r"\d+ [A-Za-z]{3}", clean):
        return target_at(*_coordinates(clean))
    return named_target(clean, time_utc)


def _coordinates(text: str) -> tuple[float, float]:
    """Split at the comma or semicolon, before the sign, or in the middle of an even count."""
    for pattern in (r"\s*[,;]\s*(?=[+\-−\d])", r"\s+(?=[+\-−])"):
        parts = re.split(pattern, text)
        if len(parts) == 2:
            return parse_ra_deg(parts[0]), parse_dec_deg(parts[1])
    words = text.split()
    if len(words) % 2 == 0:
        half = len(words) // 2
        return parse_ra_deg(" ".join(words[:half])), parse_dec_deg(" ".join(words[half:]))
    raise UsageError(f"“{text}” is not a known name or position. {NOTHING}")


def names_to_offer() -> Task[list[str]]:
    """What the field completes: Messier objects and the stars that bear a name of their own."""
    yield Progress("names")
    from kochab.sky import open_catalogue

    stars = sorted({name for name, _, _ in open_catalogue().names.table.values() if name})
    return [f"M {n}" for n in range(1, 111)] + stars


Look = Callable[[Guard], SolveNow]


def offer(look: Look | None, solution: Solution | None) -> MakeTask | None:
    """Look twice, or take the open frame's word; None when there is neither."""
    if look is not None:
        return lambda guard: offer_sync(guard, look(guard))
    return None if solution is None else _at_once("sync", lambda guard: offer_of(guard, solution))


def accept(offered: SyncOffer) -> MakeTask:
    """The person said yes."""

    def by_hand(guard: Guard) -> SyncDone:
        guard.sync(*guard.to_mount(*offered.sky_deg), by_hand=True, confirmed=True)
        return sync_done(offered)

    if len(offered.evidence.centres_deg) < 2:
        return _at_once("sync", by_hand, offered.in_words)
    return lambda guard: accept_sync(guard, offered, confirmed=True, fall_back=True)


def goto(text: str) -> MakeTask:
    """Slew to a name or coordinates."""

    def task(guard: Guard) -> Task[str]:
        yield Progress("goto", None, text)
        target = parse_target(text, guard.clock())
        yield from goto_target(guard, target)
        return f"The mount reports that it reached {target.name}."

    return task


def centre(text: str, tolerance_arcsec: float, look: Look) -> MakeTask:
    """Slew there, look and correct until it is in the middle.

    A sync so large that the guard wants a yes is not done on the way: it belongs into the preview.
    """

    def task(guard: Guard) -> Task[Centring]:
        yield Progress("centre", None, text)
        target = parse_target(text, guard.clock())
        return (yield from centre_target(guard, look(guard), target, tolerance_arcsec))

    return task


def track(on: bool) -> MakeTask:
    """Sidereal tracking."""

    def do(guard: Guard) -> str:
        guard.track(on)
        return f"Tracking is {'on' if on else 'off'}."

    return _at_once("tracking", do)


def use_site(site: Site | None) -> MakeTask:
    """Let the guard judge by this place; it is never sent to the mount."""

    def do(guard: Guard) -> None:
        guard.site = site

    return _at_once("site", do)


def use_limits(limits: Limits) -> MakeTask:
    """Let the guard judge by these from the next motion on."""

    def do(guard: Guard) -> None:
        guard.limits = limits

    return _at_once("meridian", do)


def close_camera(camera: MountCamera) -> MakeTask:
    """Close a camera in the thread that opened it."""
    return _at_once("camera", lambda _: camera.close())


def _at_once(stage: str, do: Callable[[Guard], Any], detail: str = "") -> MakeTask:
    def task(guard: Guard) -> Task[Any]:
        yield Progress(stage, None, detail)
        return do(guard)

    return task
