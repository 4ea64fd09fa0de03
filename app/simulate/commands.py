"""What a person does with their hands on a practice night, as typed lines."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from app.core.errors import UsageError

if TYPE_CHECKING:
    from app.simulate.practice import Practice

MOST_ARCMIN = 10_800.0
"""Nothing is turned further than half around at once, by bolt or by hand."""
MOST_DEG = 180.0
MOST_FAULTS = 1000

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


def _within(word: str, most: float) -> float:
    """The number that was typed, no larger than a hand would turn anything."""
    value = float(word)
    if not abs(value) <= most:
        raise UsageError(f"{word} is not between {-most:g} and {most:g}.")
    return value


def _altitude(practice: "Practice", words: Sequence[str]) -> str:
    practice.rig.mount.turn_bolts(_within(words[0], MOST_ARCMIN), 0.0)
    return "The altitude bolt is turned."


def _azimuth(practice: "Practice", words: Sequence[str]) -> str:
    practice.rig.mount.turn_bolts(0.0, _within(words[0], MOST_ARCMIN))
    return "The azimuth bolt is turned."


def _hour(practice: "Practice", words: Sequence[str]) -> str:
    practice.rig.mount.turn_by_hand(_within(words[0], MOST_DEG))
    return "The hour axis is turned; the mount knows nothing of it."


def _declination(practice: "Practice", words: Sequence[str]) -> str:
    practice.rig.mount.turn_by_hand(0.0, _within(words[0], MOST_DEG))
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
    if not 1 <= count <= MOST_FAULTS:
        raise UsageError(f"{count} is not a count of answers from 1 to {MOST_FAULTS}.")
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
