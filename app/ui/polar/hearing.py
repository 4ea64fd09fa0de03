"""Which change of an alignment is heard, and how."""

from app.ui.polar.cues import Cue, Cues
from app.ui.polar.state import State

CLEAR_SHARE, CLEAR_ARCSEC = 0.1, 5.0
"""A change of the whole error by so much of it, and by so many arcseconds, is told."""


class Hearing:
    """Turns changes of the state into cues."""

    def __init__(self, cues: Cues) -> None:
        self._cues = cues
        self._told_arcsec: float | None = None

    def hear(self, before: State, now: State) -> None:
        """Play what the change means, the most important alone."""
        cue = self.cue_of(before, now)
        if cue is not None:
            self._cues.play(cue)
        if now.words != before.words and (now.hand_needed or now.stop or now.stage == "done"):
            self._cues.say(spoken(now.words))

    def cue_of(self, before: State, now: State) -> Cue | None:
        """The cue of a change, None for silence."""
        if before.solved and not now.solved:
            return Cue.LOST
        if (now.stop and not before.stop) or (now.stage == "done" != before.stage):
            return Cue.STOP
        asked = now.asked is not before.asked or now.instruction is not before.instruction
        if now.hand_needed and asked:
            self._told_arcsec = None if now.error is None else now.error.total_arcsec
            return Cue.TURN
        return self._nearer(now)

    def _nearer(self, now: State) -> Cue | None:
        if not now.live or now.error is None:
            return None
        total, then = now.error.total_arcsec, self._told_arcsec
        if then is None:
            self._told_arcsec = total
            return None
        if abs(total - then) < max(CLEAR_SHARE * then, CLEAR_ARCSEC):
            return None
        self._told_arcsec = total
        return Cue.NEARER if total < then else Cue.FURTHER


def spoken(words: str) -> str:
    """Words for a voice: units in full."""
    for sign, name in (('"', " arc seconds"), ("'", " arc minutes"), ("±", "plus or minus")):
        words = words.replace(sign, name)
    return words
