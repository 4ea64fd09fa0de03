"""Which command lines a worker (``kochab serve``) does for us; light, as it is asked before anything is loaded."""

from collections.abc import Sequence

from kochab.cli.faces import face_of

NO_WORKER = "--no-worker"
WARM = ("solve", "identify", "detect", "find", "chart")
"""The others talk to devices, draw windows or keep running."""


def is_for_worker(arguments: Sequence[str]) -> bool:
    """Whether the work may be handed over."""
    return bool(arguments) and NO_WORKER not in arguments and (arguments[0] in WARM or face_of(arguments) is not None)
