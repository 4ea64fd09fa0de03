"""The actions of a mount: one table of what each needs, moves and excludes.

The window disables its buttons by it, the mount's session knows from it what may be moving, and the
command line takes its help from it.
"""

from collections.abc import Mapping
from enum import Enum

from kochab.core.mount import Ability, MountState, TrackingRate
from kochab.core.values import frozen
from kochab.text.translation import tr, tr_noop

CONNECT = tr_noop("Connect a mount first, or practise with a simulated telescope.")
CONNECTING = tr_noop("Wait until the mount has answered.")
LEAVING = tr_noop("Wait until the mount is disconnected.")
LOST = tr_noop("Connection to the mount lost. Check its cable and power; Kochab reconnects automatically.")
BUSY = tr_noop("The mount is busy: {}. Wait, or stop it.")
PARKED = tr_noop("The mount is parked: unpark it first.")
BY_HAND = tr_noop("Polar alignment by hand (F4) is running. End it first, or let the mount turn the axis.")
PHASES = {"off": CONNECT, "connecting": CONNECTING, "leaving": LEAVING, "lost": LOST}


class Need(Enum):
    """What an action needs beside the mount's abilities; the value is the reason against it."""

    UNPARKED = PARKED
    IS_PARKED = tr_noop("The mount is not parked.")
    HOME_CONFIRMED = tr_noop(
        "Home position not confirmed. Use Sync…, or point the tube at the pole, counterweight down,"
        " and reconnect with “At home” ticked."
    )
    NOT_BY_HAND = BY_HAND
    CAMERA = tr_noop("Choose a camera above first.")
    CAMERA_OR_SOLUTION = tr_noop("Choose a camera above, or open a frame that solves.")
    SOLVED_FRAME = tr_noop("Solve a frame first: its solution shows where the star is.")
    SYNC_TO_UNDO = tr_noop("No sync to undo.")
    AGREEMENT = tr_noop("The mount’s clock or site contradicts this computer’s: see above.")
    SYNCED = tr_noop("The mount’s position shifted with its new clock or site: sync first, see above.")


@frozen
class Action:
    """One row.

    ``needs`` are checked in their order; ``instead`` replaces an ability that the mount lacks.
    ``moves``: the telescope moves; ``may_slew``: perhaps; ``quick``: it ends at once and excludes
    nothing; ``frame_after``: a frame may follow it.
    """

    name: str
    doing: str = ""
    help: str = ""
    needs: tuple[Ability | Need, ...] = ()
    instead: tuple[Ability | Need, ...] = ()
    moves: bool = False
    may_slew: bool = False
    quick: bool = False
    frame_after: bool = False

    @property
    def may_move(self) -> bool:
        """Whether the telescope may be moving while this is under way."""
        return self.moves or self.may_slew


_SLEW = (Ability.GOTO, Need.UNPARKED, Need.HOME_CONFIRMED, Need.AGREEMENT, Need.SYNCED, Need.NOT_BY_HAND)
POLAR = "polar"
_REST = (Need.UNPARKED, Need.HOME_CONFIRMED, Need.NOT_BY_HAND)
TRACK = "track the stars, the Moon or the Sun, or stop tracking"
_NUDGE = (Ability.MOVE, Need.UNPARKED)
_ROWS = (
    Action(
        "goto",
        tr_noop("slewing to the target"),
        "slew to coordinates or to a name",
        _SLEW,
        moves=True,
        frame_after=True,
    ),
    Action(
        "centre",
        tr_noop("centring"),
        "slew to a target, solve and correct until it is centred",
        (*_SLEW, Need.CAMERA),
        moves=True,
    ),
    Action("spiral", tr_noop("searching"), "search around here in a square spiral", _SLEW, moves=True),
    Action("move_star", tr_noop("moving the star"), "", (*_SLEW, Need.SOLVED_FRAME), moves=True, frame_after=True),
    Action("nudge", tr_noop("nudging"), "", _NUDGE, (Ability.PULSE,), moves=True, frame_after=True),
    Action(
        "nudge dec", tr_noop("nudging"), "", (*_NUDGE, Need.NOT_BY_HAND), (Ability.PULSE,), moves=True, frame_after=True
    ),
    Action(
        "sync",
        tr_noop("solving twice"),
        "sync the mount on a solved frame",
        (Ability.SYNC, Need.UNPARKED, Need.AGREEMENT, Need.NOT_BY_HAND, Need.CAMERA_OR_SOLUTION),
        instead=(Ability.GOTO, Need.CAMERA),  # a mount that cannot be synced slews by the offset
    ),
    Action("accept_sync", tr_noop("syncing"), needs=(Need.NOT_BY_HAND,), may_slew=True),  # refused, it becomes a slew
    Action("undo", tr_noop("undoing the sync"), "", (Ability.SYNC, Need.SYNC_TO_UNDO)),
    Action("recover", tr_noop("recovering"), "solve blind and sync a lost mount, unattended", (Ability.SYNC,)),
    Action("park", tr_noop("parking"), "slew to the mount's park position", (Ability.PARK, *_REST), moves=True),
    Action("unpark", tr_noop("unparking"), "let a parked mount move again", (Ability.UNPARK, Need.IS_PARKED)),
    Action("flip", tr_noop("flipping"), "flip a German mount where it points", _SLEW, moves=True, frame_after=True),
    Action("home", tr_noop("going home"), "slew to the mount's home", (Ability.HOME, *_REST), moves=True),
    *(
        Action(f"track {rate}", tr_noop("switching tracking"), TRACK, (rate.ability, Need.UNPARKED))
        for rate in TrackingRate
    ),
    Action("set clock", tr_noop("setting the clock"), "set the mount's clock to this computer's", (Ability.SET_CLOCK,)),
    Action("set site", tr_noop("setting the site"), "set the mount's site to yours", (Ability.SET_SITE,)),
    Action("take_frame", tr_noop("taking a frame"), "", (Need.CAMERA,)),
    Action("model", tr_noop("fitting a pointing model"), "make a pointing model from frames in several places", _SLEW),
    Action("diagnose", tr_noop("diagnosing"), "find the cause of a pointing offset", (Need.CAMERA,)),
    Action(POLAR, tr_noop("polar alignment (F4), which turns the RA axis"), "", (Need.NOT_BY_HAND,), moves=True),
    Action("stop", tr_noop("stopping"), "stop every motion, now"),
    Action("camera", quick=True),
    Action("limits", quick=True),
)
ACTIONS: Mapping[str, Action] = {row.name: row for row in _ROWS}


def action(name: str) -> Action:
    """The row of an action; one that is not in the table needs and moves nothing."""
    return ACTIONS.get(name, Action(name))


@frozen
class MountSituation:
    """Everything that decides which actions are possible.

    ``phase`` is "off", "connecting", "on", "lost" or "leaving"; ``by_hand``: a polar alignment is
    under way whose RA axis the user turns.
    """

    phase: str = "off"
    lacks: Mapping[Ability, str] | None = None
    state: MountState | None = None
    busy: str = ""
    camera: bool = False
    solved: bool = False
    can_undo: bool = False
    by_hand: bool = False
    clock_conflict: str = ""
    slew_block_reason: str = ""

    def missing(self, need: Ability | Need) -> str:
        """Why ``need`` is not met; empty when it is."""
        if isinstance(need, Ability):
            return tr((self.lacks or {}).get(need, ""))
        met = {
            Need.UNPARKED: self.state is None or not self.state.parked,
            Need.IS_PARKED: self.state is None or self.state.parked is not False,
            Need.HOME_CONFIRMED: self.state is None or self.state.home_confirmed is not False,
            Need.NOT_BY_HAND: not self.by_hand,
            Need.CAMERA: self.camera,
            Need.CAMERA_OR_SOLUTION: self.camera or self.solved,
            Need.SOLVED_FRAME: self.solved,
            Need.SYNC_TO_UNDO: self.can_undo,
            Need.AGREEMENT: not self.clock_conflict,
            Need.SYNCED: not self.slew_block_reason,
        }[need]
        return "" if met else tr(need.value)


def reason_against_order(name: str, now: MountSituation) -> str:
    """Why this cannot be ordered now; empty when it can, also while the line is being opened."""
    away = "" if now.phase == "connecting" else tr(PHASES.get(now.phase, ""))
    by_hand = now.missing(Need.NOT_BY_HAND) if Need.NOT_BY_HAND in action(name).needs else ""
    return away or (tr(BUSY).format(now.busy) if now.busy else "") or by_hand


def reasons_against(now: MountSituation) -> dict[str, str]:
    """Action -> the reason against it, empty when there is none."""
    return {name: _reason(row, now) for name, row in ACTIONS.items()}


def _reason(row: Action, now: MountSituation) -> str:
    if row.name == "stop":  # over a line that is lost, too
        return tr(CONNECT) if now.phase in ("off", "connecting", "leaving") else ""
    if now.phase in PHASES:
        return tr(PHASES[now.phase])
    for need in row.needs:
        missing = now.missing(need)
        replaced = isinstance(need, Ability) and row.instead and not any(map(now.missing, row.instead))
        if missing and not replaced:
            return missing
    return tr(BUSY).format(now.busy) if now.busy and not row.quick else ""
