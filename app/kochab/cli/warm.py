"""Which command lines are short, and which a worker (``kochab serve``) does; asked before anything is loaded."""

from kochab.cli.faces import face_of

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence

NO_WORKER = "--no-worker"
SHORT = ("solve", "identify", "detect", "find", "chart")
"""The others talk to devices, draw windows or keep running."""


def is_short(arguments: "Sequence[str]") -> bool:
    """Whether the command reads its files, prints the answer and ends."""
    return bool(arguments) and (arguments[0] in SHORT or face_of(arguments) is not None)


def is_for_worker(arguments: "Sequence[str]") -> bool:
    """Whether the work may be handed over."""
    return NO_WORKER not in arguments and is_short(arguments)
