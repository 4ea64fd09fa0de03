"""What a person does with their hands on a practice night, as typed lines."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from app.core.errors import UsageError

if TYPE_CHECKING:
    from app.simulate.practice import Practice

HELP = (
    "alt ARCMIN    turn the altitude bolt: + raises the axis",
    "az ARCMIN     turn the azimuth bolt: + is clockwise from above",
    "ra DEG        open the clutch and turn the hour axis, + to the west",
    "dec DEG       open the clutch and turn the declination axis",
    "track on|off  the mount's motor",
    "pull, plug    the cable",
    "fault NAME N  the next N answers: silence, garbage, late, split, wrong, refusal, unplug",
    "score         how far everything is off",
    "help, quit",
)


def obey(practice: "Practice", line: str) -> str:
    """Do one typed line and say what was done, "" when there is nothing to say.

    Raises
    ------
    app.core.errors.UsageError
        The line is not understood.

    """
    words = line.split()
    if not words:
        return ""
    action = ACTIONS.get(words[0].lower())
    if action is None:
        raise UsageError(f"'{words[0]}' is not known here; type help.")
    try:
        return action(practice, words[1:])
    except (ValueError, IndexError):
        raise UsageError(f"'{line.strip()}' is not complete or not a number; type help.") from None


def _altitude(practice: "Practice", words: Sequence[str]) -> str:
    practice.rig.mount.turn_bolts(float(words[0]), 0.0)
    return "The altitude bolt is turned."


def _azimuth(practice: "Practice", words: Sequence[str]) -> str:
    practice.rig.mount.turn_bolts(0.0, float(words[0]))
    return "The azimuth bolt is turned."


def _hour(practice: "Practice", words: Sequence[str]) -> str:
    practice.rig.mount.turn_by_hand(float(words[0]))
    return "The hour axis is turned; the mount knows nothing of it."


def _declination(practice: "Practice", words: Sequence[str]) -> str:
    practice.rig.mount.turn_by_hand(0.0, float(words[0]))
    return "The declination axis is turned; the mount knows nothing of it."


def _track(practice: "Practice", words: Sequence[str]) -> str:
    if words[0] not in ("on", "off"):
        raise ValueError(words[0])
    practice.rig.mount.tracking = words[0] == "on"
    return f"Tracking is {words[0]}."


def _pull(practice: "Practice", words: Sequence[str]) -> str:
    practice.line.unplug()
    return "The cable is pulled."


def _plug(practice: "Practice", words: Sequence[str]) -> str:
    practice.line.plug()
    return f"The cable is plugged in, at {practice.port}."


def _fault(practice: "Practice", words: Sequence[str]) -> str:
    count = int(words[1]) if len(words) > 1 else 1
    practice.faults.next(words[0], count)
    return f"{words[0].capitalize()} for the next {count}."


def _score(practice: "Practice", words: Sequence[str]) -> str:
    return practice.score().as_text()


def _help(practice: "Practice", words: Sequence[str]) -> str:
    return "\n".join(HELP)


ACTIONS: dict[str, Callable[["Practice", Sequence[str]], str]] = {
    "alt": _altitude,
    "az": _azimuth,
    "ra": _hour,
    "dec": _declination,
    "track": _track,
    "pull": _pull,
    "plug": _plug,
    "fault": _fault,
    "score": _score,
    "help": _help,
}
