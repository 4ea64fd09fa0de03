"""What cannot be done now, each with the reason in one sentence; nothing of Qt."""

from collections.abc import Mapping
from dataclasses import dataclass

from app.core.mount import Ability, MountState

CONNECT = "Connect a mount first, or practise with a simulated telescope."
CONNECTING = "Wait until the mount has answered."
LEAVING = "Wait until the line is closed."
LOST = "The line to the mount is lost: check its cable and power; it is tried again by itself."
PARKED = "The mount is parked: unpark it on its hand control first."
NO_CAMERA = "No camera is chosen: choose one above, for this needs fresh frames."
NO_SOLUTION = "Open a frame that solves, or take one: the sky has not been asked yet."
NO_FRAME = "Take a frame and let it solve first: the star is found by its answer."
NO_SYNC_YET = "There is no sync to take back."
BUSY = "Wait until this is over, or stop it: {}."
BY_HAND = (
    "A polar alignment by hand (F4) is under way, in which only the RA axis may turn: end it"
    " first, or begin it anew with the mount turning the axis."
)

NEEDS: Mapping[str, tuple[Ability, ...]] = {
    "sync": (),  # what cannot be synced is slewed by the offset instead
    "undo": (Ability.SYNC,),
    "goto": (Ability.GOTO,),
    "centre": (Ability.GOTO,),
    "bring": (Ability.GOTO,),
    "track": (Ability.TRACKING,),
    "take": (),
    "why": (),
    "nudge dec": (),
}
MOVES = ("goto", "centre", "nudge", "nudge dec", "bring", "sync", "track")
TURNS_DEC = ("goto", "centre", "nudge dec", "bring", "sync")  # a sync may fall back to a slew


@dataclass(frozen=True, slots=True)
class Situation:
    """All that decides what may be done.

    ``phase`` is "off", "connecting", "on", "lost" or "leaving"; ``by_hand`` says that a polar
    alignment is under way whose axis a person turns.
    """

    phase: str = "off"
    lacks: Mapping[Ability, str] | None = None
    state: MountState | None = None
    busy: str = ""
    camera: bool = False
    solved: bool = False
    can_undo: bool = False
    by_hand: bool = False


def unable(now: Situation) -> str:
    """Why nothing can be ordered at all; empty when it can, be it on a line still being opened."""
    away = {"off": CONNECT, "leaving": LEAVING, "lost": LOST}.get(now.phase, "")
    return away or (BUSY.format(now.busy) if now.busy else "")


def reasons(now: Situation) -> dict[str, str]:
    """Action -> why not; an empty text when it may be done."""
    names = (*NEEDS, "nudge")
    return {name: _reason(name, now) for name in names} | {"stop": _stop(now)}


def _reason(name: str, now: Situation) -> str:
    away = {"off": CONNECT, "connecting": CONNECTING, "leaving": LEAVING, "lost": LOST}.get(
        now.phase
    )
    if away is not None:
        return away
    lacking = _lacking(name, now)
    if lacking:
        return lacking
    if name in MOVES and now.state is not None and now.state.parked:
        return PARKED
    if now.by_hand and name in TURNS_DEC:
        return BY_HAND
    special = _special(name, now)
    if special:
        return special
    if now.busy:
        return BUSY.format(now.busy)
    return ""


def _lacking(name: str, now: Situation) -> str:
    lacks = now.lacks or {}
    if name in ("nudge", "nudge dec"):
        both = Ability.PULSE in lacks and Ability.MOVE in lacks
        return lacks[Ability.MOVE] if both else ""
    if name == "sync" and Ability.SYNC in lacks:
        can_slew = Ability.GOTO not in lacks and now.camera
        return "" if can_slew else lacks[Ability.SYNC]
    return next((lacks[a] for a in NEEDS[name] if a in lacks), "")


def _special(name: str, now: Situation) -> str:
    if name in ("centre", "take", "why") and not now.camera:
        return NO_CAMERA
    if name == "sync" and not (now.camera or now.solved):
        return NO_SOLUTION
    if name == "bring" and not now.solved:
        return NO_FRAME
    if name == "undo" and not now.can_undo:
        return NO_SYNC_YET
    return ""


def _stop(now: Situation) -> str:
    return CONNECT if now.phase in ("off", "connecting", "leaving") else ""
