"""The actions of the Mount view, and the sentences that tell their results."""

from typing import Any

import numpy as np
from PySide6.QtCore import QObject, Qt, Signal

from kochab.core.attitude import apart_deg
from kochab.core.mount import Direction, TrackingRate
from kochab.core.progress import Progress, Task
from kochab.core.solution import NoSolution, Solution
from kochab.gear.actions import action
from kochab.gear.mount_events import OrderDone, OrderFailed, SolvedPosition
from kochab.gear.mounts.guard import Guard
from kochab.pointing.disagreement import Disagreement
from kochab.pointing.pointing_model import fit_model
from kochab.text.angle_text import angle_text
from kochab.text.translation import tr, tr_noop
from kochab.window.devices.mount_control import MountControl
from kochab.window.services import Services
from kochab.workflows.centre_target import Centring, CentringEnd, centre_typed
from kochab.workflows.goto_target import FlipQuestion, flip_mount, goto_typed
from kochab.workflows.nudge import Nudged, Turn, bring_here, nudge
from kochab.workflows.pointing_model import use_model
from kochab.workflows.recover_mount import why_they_disagree
from kochab.workflows.solution_text import reason_text
from kochab.workflows.spiral_search import spiral_search
from kochab.workflows.sync_mount import SyncDone, SyncOffer, accept_sync, offer_of, offer_sync, sync_by_hand

MOST_SIGHTINGS = 12
SPIRAL_TURNS, SPIRAL_PAUSE_S, FIELD_DEG = 2, 4.0, 0.5
NUDGED = {
    Direction.NORTH: tr_noop("Nudged north by {by}."),
    Direction.SOUTH: tr_noop("Nudged south by {by}."),
    Direction.EAST: tr_noop("Nudged east by {by}."),
    Direction.WEST: tr_noop("Nudged west by {by}."),
}
SYNC_FIRST = tr_noop("Use Sync… first to review it.")


def outcome_text(result: Any, sight: SolvedPosition | None) -> tuple[str, str]:
    """The sentence for a result, empty when it needs none, and its style sheet role."""
    match result:
        case str():
            return result, ""
        case SyncOffer():
            return result.in_words, ""
        case FlipQuestion():
            return result.sentence, "wrong"
        case SyncDone():
            return result.sentence, "good" if result.synced else ""
        case NoSolution():
            return tr("No solution: {reason}. {advice}", reason=reason_text(result), advice=result.advice), "wrong"
        case Solution() if sight is not None:
            off = angle_text(apart_deg(sight.mount_deg, result.ra_dec_deg))
            return tr("Solved. Mount is off by {off}.", off=off), ""
        case Centring():
            more = f" {tr(SYNC_FIRST)}" if result.to_confirm else ""
            return result.sentence + more, "good" if result.centred else "wrong"
        case Nudged():
            return tr(NUDGED[result.direction], by=result.by), ""
        case Turn():
            return tr("Star moved."), ""
        case (Disagreement() as finding, _):
            return finding.sentence, "good" if finding.agrees else ""
    return "", ""


TRACKS = {
    TrackingRate.OFF: tr_noop("Tracking is off."),
    TrackingRate.SIDEREAL: tr_noop("Tracking at the sidereal rate."),
    TrackingRate.LUNAR: tr_noop("Tracking at the lunar rate."),
    TrackingRate.SOLAR: tr_noop("Tracking at the solar rate."),
    TrackingRate.KING: tr_noop("Tracking at the King rate."),
}


class MountActions(QObject):
    """Gives orders to the :class:`MountControl`; with ``auto_frame`` a frame follows each motion."""

    offered = Signal(object)  # SyncOffer
    flip_asked = Signal(object)  # FlipQuestion

    def __init__(self, control: MountControl) -> None:
        super().__init__(control)
        self.auto_frame = True
        self.held = False  # nudges follow one another while a controller's direction is held: no frame between them
        self._frameless = False  # the nudge that runs was held when it began: its end may come after it was let go
        self._control = control
        control.ended.connect(self._ended)

    def take_frame(self) -> None:
        """Take a frame, show and solve it."""
        solver = self._control.telescope.solver
        self._control.ask("take_frame", lambda guard: solver(guard)())

    def offer_sync(self) -> None:
        """Show what a sync would do; without a camera it uses the open frame."""
        # Read in the window's thread; the functions below run in the line's.
        solver, solution = self._control.telescope.solver, self._control.solution

        def offer_of_frame(guard: Guard) -> Task[SyncOffer]:
            assert solution is not None
            yield Progress(tr_noop("sync"))
            return offer_of(guard, solution)

        if self._control.telescope.camera is not None:
            self._control.ask("sync", lambda guard: offer_sync(guard, solver(guard)))
        elif solution is not None:
            self._control.ask("sync", offer_of_frame)

    def diagnose(self) -> None:
        """Find the cause of the mount's offset."""
        solver, before = self._control.telescope.solver, self._control.sightings
        self._control.ask("diagnose", lambda guard: why_they_disagree(guard, solver(guard), before))

    def use_model(self) -> None:
        """Aim gotos by a pointing model of the offsets seen since the last sync."""
        sightings = self._control.sightings

        def do(guard: Guard) -> Task[str]:
            yield Progress(tr_noop("fitting"))
            model = fit_model(sightings)
            use_model(guard, model)
            return tr("Gotos are aimed by a pointing model until the next sync. {model}", model=model.worth())

        self._control.ask("model", do)

    def spiral(self) -> None:
        """Search around where the mount points, two thirds of the frame's smaller side at a time."""
        solution = self._control.solution
        field = FIELD_DEG if solution is None else min(solution.camera.fov_deg)
        # Neighbouring fields share a third of a side, so that nothing falls between them.
        step = min(field * 2.0 / 3.0, 2.0)

        def do(guard: Guard) -> Task[str]:
            yield from spiral_search(guard, step, SPIRAL_TURNS, SPIRAL_PAUSE_S)
            return tr("Searched {angle:.1f}° around.", angle=SPIRAL_TURNS * step)

        self._control.ask("spiral", do)

    def accept_sync(self, offer: SyncOffer) -> None:
        """Do a sync that was shown and accepted."""
        # One frame has no other to agree with: the person vouches that nothing has moved since.
        if len(offer.evidence.centres_deg) < 2:
            self._control.ask("accept_sync", lambda guard: sync_by_hand(guard, offer))
        else:
            self._control.ask("accept_sync", lambda guard: accept_sync(guard, offer, confirmed=True, fall_back=True))

    def goto(self, text: str, flip: bool = False) -> None:
        """Slew to a name or coordinates; a person is asked before a ``flip``."""
        self._control.ask("goto", lambda guard: goto_typed(guard, text, flip))

    def centre(self, text: str, tolerance_arcsec: float) -> None:
        """Slew there, plate solve and correct until it is centred."""
        solver = self._control.telescope.solver
        self._control.ask("centre", lambda guard: centre_typed(guard, solver(guard), text, tolerance_arcsec))

    def nudge(self, direction: Direction, arcsec: float, rate_deg_s: float = 0.0) -> None:
        """Move a little, at a rate of the mount or, for 0, at the slowest suitable one."""
        name = "nudge dec" if direction.in_dec else "nudge"
        self._frameless = self.held
        self._control.ask(name, lambda guard: nudge(guard, direction, arcsec, rate_deg_s=rate_deg_s))

    def move_star(self, star: tuple[float, float], here: tuple[float, float]) -> None:
        """Move the mount so that pixel ``star`` of the open frame comes to pixel ``here``."""
        solution = self._control.solution
        if solution is not None:
            self._control.ask("move_star", lambda guard: bring_here(guard, solution, star, here))

    def track(self, rate: TrackingRate) -> None:
        """Track at this rate, or stop tracking."""

        def switch(guard: Guard) -> Task[str]:
            yield Progress(tr_noop("tracking"))
            guard.track(rate)
            return tr(TRACKS[rate])

        self._control.ask(f"track {rate}", switch)

    def rest(self, name: str) -> None:
        """Park, unpark, flip or go home."""

        def do(guard: Guard) -> Task[str]:
            if name == "flip":
                return (yield from flip_mount(guard))
            if name == "unpark":
                yield Progress(tr_noop("unparking"))
                guard.unpark()
            else:
                yield from guard.rest(name)
            return {"park": tr("Parked."), "unpark": tr("Unparked."), "home": tr("At home.")}[name]

        self._control.ask(name, do)

    def settle(self, name: str) -> None:
        """Set the mount's clock or site, or trust the mount as it is."""

        def do(guard: Guard) -> Task[str]:
            yield Progress(tr_noop("asking the mount"))
            if name == "trust":
                guard.clock_and_site.trust()
                return tr("Using the mount as it is.")
            (guard.set_clock if name == "set clock" else guard.set_site)()
            return tr("The mount has this computer’s clock.") if name == "set clock" else tr("The mount has your site.")

        self._control.ask(name, do)

    def _ended(self, word: OrderDone | OrderFailed) -> None:
        if isinstance(word, OrderFailed):
            return
        self._answered(word.name, word.result)
        moved = action(word.name).frame_after and not isinstance(word.result, FlipQuestion)
        frameless = self.held or (self._frameless and word.name.startswith("nudge"))
        if moved and self.auto_frame and not frameless and self._control.telescope.camera is not None:
            self.take_frame()

    def _answered(self, name: str, result: Any) -> None:
        known = self._control.known
        sentence, role = outcome_text(result, known.sight)
        if sentence:
            self._control.message.emit(sentence, role)
        match result:
            case SyncOffer():
                self.offered.emit(result)
            case FlipQuestion():
                self.flip_asked.emit(result)
            case SyncDone(synced=True):
                self._resynced()
            case SyncDone(slewed=True):
                known.has_moved()
            # A centring's last frame was solved after its last motion: what is shown is not old.
            case Centring() if known.sight is not None:
                seen_last = known.sight.solution is result.solution
                known.moved_since = not seen_last or result.end is CentringEnd.REFUSED
            case (Disagreement(), sightings):
                self._control.sightings = sightings[-MOST_SIGHTINGS:]
            case str() if name == "undo":
                self._resynced()

    def _resynced(self) -> None:
        self._control.known.has_synced()
        self._control.sightings = ()  # the sync has changed every offset


FIRST = tr_noop("Click the star in the frame (Esc cancels). Click it twice to centre it.")
SECOND = tr_noop("Click where to put it, or click it again to centre it.")
NEAR_PX = 12.0  # of the image: a second click so near the first means the centre


class MoveStarMode(QObject):
    """Two clicks in the frame, a star and its new place; the first snaps to an identified star."""

    message = Signal(str, str)  # a sentence and its role
    frame_wanted = Signal(bool)  # the open frame is to be seen, for its stars are clicked; or no longer

    def __init__(self, services: Services, control: MountControl, orders: MountActions) -> None:
        super().__init__(control)
        self._view, self._control, self._orders = services.panes.view, control, orders
        control.stopping.connect(self.end)
        self._on = False
        self._star: tuple[float, float] | None = None
        # Both clicks are pixels of one frame.
        services.session.opened.connect(lambda _: self.end())

    def begin(self) -> None:
        """Wait for the first click."""
        self.end()
        self._on, self._star = True, None
        self._view.clicked.connect(self._clicked)
        self._view.setCursor(Qt.CursorShape.CrossCursor)
        self.frame_wanted.emit(True)
        self.message.emit(tr(FIRST), "")

    def end(self) -> None:
        """Ignore clicks from now on."""
        if self._on:
            self._view.clicked.disconnect(self._clicked)
            self._view.unsetCursor()
            self.frame_wanted.emit(False)
        self._on = False

    def _clicked(self, x: float, y: float, reach_px: float) -> None:
        if self._star is None:
            self._star = self._snapped(x, y, reach_px)
            self.message.emit(tr(SECOND), "")
            return
        star, here = self._star, (x, y)
        self.end()
        solution = self._control.solution
        if solution is None:
            return
        if np.hypot(x - star[0], y - star[1]) <= max(reach_px, NEAR_PX):
            here = ((solution.camera.width - 1) / 2.0, (solution.camera.height - 1) / 2.0)
        self._orders.move_star(star, here)

    def _snapped(self, x: float, y: float, reach_px: float) -> tuple[float, float]:
        solution = self._control.solution
        if solution is None or not solution.named:
            return x, y
        nearest = min(solution.named, key=lambda s: np.hypot(s.x - x, s.y - y))
        near = np.hypot(nearest.x - x, nearest.y - y) <= reach_px
        return (nearest.x, nearest.y) if near else (x, y)
