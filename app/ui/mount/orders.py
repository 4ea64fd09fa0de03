"""What can be asked of a mount, as tasks for the thread of its line; nothing of Qt.

Each function gives a maker: a function of the guarded mount that returns the task.
"""

from collections.abc import Callable
from typing import Any

from app.core.hint import Site
from app.core.mount import Direction
from app.core.progress import Progress, Task
from app.core.solution import Solution
from app.mounts.guard import Guard
from app.mounts.limits import Limits
from app.solve.disagreement import Sighting
from app.ui.mount.eye import Eye
from app.ui.mount.line_order import Make
from app.ui.mount.targets import parse_target
from app.workflows.centre_target import Centring
from app.workflows.fresh_frame import SolveNow
from app.workflows.sync_mount import SyncOffer

Look = Callable[[Guard], SolveNow]


def take(look: Look) -> Make:
    """A fresh frame, shown and solved."""
    return lambda guard: look(guard)()


def offer(look: Look | None, solution: Solution | None) -> Make | None:
    """Look twice, or take the open frame's word; None when there is neither."""
    from app.ui.mount.by_hand import offer_by_hand
    from app.workflows.sync_mount import offer_sync

    if look is not None:
        return lambda guard: offer_sync(guard, look(guard))
    return None if solution is None else lambda guard: offer_by_hand(guard, solution)


def accept(offered: SyncOffer) -> Make:
    """The person said yes."""
    from app.ui.mount.by_hand import accept_by_hand
    from app.workflows.sync_mount import accept_sync

    if len(offered.evidence.centres_deg) < 2:
        return lambda guard: accept_by_hand(guard, offered)
    return lambda guard: accept_sync(guard, offered, confirmed=True, fall_back=True)


def undo() -> Make:
    """Take back the last sync."""
    from app.workflows.undo_sync import undo_sync

    return undo_sync


def why(look: Look, before: tuple[Sighting, ...]) -> Make:
    """Look at the sky and name the cause of the disagreement."""
    from app.workflows.disagree import why_they_disagree

    return lambda guard: why_they_disagree(guard, look(guard), before)


def goto(text: str) -> Make:
    """Slew to a name or coordinates."""

    def task(guard: Guard) -> Task[str]:
        from app.workflows.goto_target import goto_target

        yield Progress("goto", None, text)
        target = parse_target(text, guard.clock())
        yield from goto_target(guard, target)
        return f"The mount says that it has reached {target.name}."

    return task


def centre(text: str, tolerance_arcsec: float, look: Look) -> Make:
    """Slew there, look and correct until it is in the middle.

    A sync so large that the guard wants a yes is not done on the way: it belongs into the preview.
    """

    def task(guard: Guard) -> Task[Centring]:
        from app.workflows.centre_target import centre_target

        yield Progress("centre", None, text)
        target = parse_target(text, guard.clock())
        return (yield from centre_target(guard, look(guard), target, tolerance_arcsec))

    return task


def nudged(direction: Direction, arcsec: float, rate_deg_s: float) -> Make:
    """A small motion, at a rate of the mount or, for 0, at whatever suits it."""
    from app.ui.mount.paced import paced
    from app.workflows.nudge import nudge

    if rate_deg_s:
        return lambda guard: paced(guard, direction, arcsec, rate_deg_s)
    return lambda guard: nudge(guard, direction, arcsec)


def bring(solution: Solution, star: tuple[float, float], here: tuple[float, float]) -> Make:
    """Move what is seen at pixel ``star`` to pixel ``here``."""
    from app.workflows.nudge_bring import bring_here

    return lambda guard: bring_here(guard, solution, star, here)


def track(on: bool) -> Make:
    """Sidereal tracking."""

    def do(guard: Guard) -> str:
        guard.track(on)
        return f"Tracking is {'on' if on else 'off'}."

    return _at_once("tracking", do)


def use_site(site: Site | None) -> Make:
    """Let the guard judge by this place; it is never sent to the mount."""

    def do(guard: Guard) -> None:
        guard.site = site

    return _at_once("site", do)


def use_limits(limits: Limits) -> Make:
    """Let the guard judge by these from the next motion on."""

    def do(guard: Guard) -> None:
        guard.limits = limits

    return _at_once("meridian", do)


def close_camera(eye: Eye) -> Make:
    """Close a camera in the thread that opened it."""
    return _at_once("camera", lambda _: eye.close())


def _at_once(stage: str, do: Callable[[Guard], Any]) -> Make:
    def task(guard: Guard) -> Task[Any]:
        yield Progress(stage)
        return do(guard)

    return task
