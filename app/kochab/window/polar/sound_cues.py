"""Sound cues while adjusting the bolts: tones and spoken instructions."""

from kochab.text.translation import tr
from kochab.window.tones import Cue, Cues
from kochab.workflows.session.alignment_state import AlignmentState

CLEAR_SHARE, CLEAR_ARCSEC = 0.1, 5.0
"""A change of the total error by this share of it, and by so many arcseconds, is played."""


class SoundCues:
    """Turns changes of the alignment into cues."""

    def __init__(self, cues: Cues) -> None:
        self._cues = cues
        self._played_arcsec: float | None = None

    def play_change(self, before: AlignmentState, now: AlignmentState) -> None:
        """Play the most important cue of a change, and speak a new instruction."""
        cue = self.cue_of(before, now)
        if cue is not None:
            self._cues.play(cue)
        # Their amounts change with every frame: what is asked is said once.
        asked = now.instruction is not before.instruction or now.turn_instruction is not before.turn_instruction
        new = asked or (now.instruction is None and now.words != before.words)
        if new and (now.hand_needed or now.stop or now.stage == "done"):
            self._cues.say(speech_text(now.words))

    def cue_of(self, before: AlignmentState, now: AlignmentState) -> Cue | None:
        """The cue of a change, None for silence."""
        if before.solved and not now.solved:
            return Cue.LOST
        if (now.stop and not before.stop) or (now.stage == "done" != before.stage):
            return Cue.STOP
        new = now.turn_instruction is not before.turn_instruction or now.instruction is not before.instruction
        if now.hand_needed and new:
            self._played_arcsec = None if now.error is None else now.error.total_arcsec
            return Cue.TURN
        return self._nearer(now)

    def _nearer(self, now: AlignmentState) -> Cue | None:
        if not now.live or now.error is None:
            return None
        total, then = now.error.total_arcsec, self._played_arcsec
        if then is None:
            self._played_arcsec = total
            return None
        if abs(total - then) < max(CLEAR_SHARE * then, CLEAR_ARCSEC):
            return None
        self._played_arcsec = total
        return Cue.NEARER if total < then else Cue.FURTHER


def speech_text(words: str) -> str:
    """Words for a voice: units in full."""
    for sign, name in (("″", tr(" arc seconds")), ("′", tr(" arc minutes")), ("±", tr("plus or minus"))):
        words = words.replace(sign, name)
    return words
