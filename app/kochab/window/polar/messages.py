"""The one message of the Polar room: the most urgent of what is known. All of it stands in the Tonight page."""

from kochab.core.values import frozen
from kochab.polar.measure import PolarFindingKind
from kochab.text.translation import tr
from kochab.window.polar.error_display import more_text
from kochab.workflows.session.alignment_state import LOCKED, AlignmentState

QUIET = (PolarFindingKind.DONE, PolarFindingKind.UNCHECKED, PolarFindingKind.FLEXURE_NOT_MEASURED)
"""Said by the number's ± and by the tutor."""


@frozen
class Message:
    """A sentence and its role in the style sheet."""

    text: str = ""
    role: str = "muted"


def most_urgent(state: AlignmentState, message: Message) -> Message:
    """The message to show now. ``message`` answers the person's last action, and is empty without one."""
    if message.text and message.role == "wrong":
        return message
    spoilt = next((finding.text for finding in state.findings if finding.spoils), "")
    if state.running and spoilt:
        return Message(spoilt, "wrong")
    if message.text:
        return message
    if state.instruction is not None and state.instruction.note:
        return Message(state.instruction.note, "wrong")
    if state.running and not state.solved:
        return Message(state.detail or tr("Wait for a new frame."), "old")
    if state.stage != "adjust":
        if state.turn_instruction is not None:
            again = tr("Measure again.") if state.trail else ""
            return Message(f"{again} {state.words}".strip(), "strong")
        return Message(f"{state.words} {state.detail}".strip())
    loud = [finding.text for finding in state.findings if finding.kind not in QUIET]
    if state.stop:
        return Message(state.words, "good")
    if loud:
        return Message(loud[0], "wrong")
    why = "" if state.instruction is None else state.instruction.why
    return Message(why or tr(LOCKED), "muted")


def all_known(state: AlignmentState) -> str:
    """Everything that is known now, a line each, for the Tonight page."""
    findings = [f"⚠ {finding.text}" for finding in state.findings]
    return "\n".join(line for line in (state.words, state.detail, *findings, more_text(state)) if line)
