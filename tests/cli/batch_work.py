"""Work for batches; in a file of its own, for other processes can import only that."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

from kochab.core.errors import UsageError
from kochab.core.progress import Progress


@dataclass(frozen=True)
class Item:
    file: str


def work(item):
    yield Progress("identify", None, "blind")
    match item.file:
        case "bad":
            raise UsageError("It is bad.")
        case "cut.fits":
            raise UsageError("cut.fits is cut short.")
        case "fault":
            raise ZeroDivisionError("division by zero")
        case "large":
            raise MemoryError
        case path if path.endswith("killed"):
            Path(path).touch()  # shows that it died at its work, not before
            os._exit(9)
    return {"file": item.file, "solved": True}


loaded_before = ""


def what_is_loaded(item):
    """What this process knows of what another has set here."""
    yield Progress("looking")
    return {"file": item.file, "solved": True, "loaded": loaded_before}


def long_work(item):
    """Say which process this is, then stay busy for longer than any test."""
    Path(f"{item.file}.{os.getpid()}").touch()
    while True:
        time.sleep(0.05)
        yield Progress("waiting")
