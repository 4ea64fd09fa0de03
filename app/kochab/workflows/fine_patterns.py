"""Builds the small-field patterns in a process of its own, so that the window stays responsive.

In a thread of the window's process the long sorts would hold Python's lock for a fifth of a
second now and then. ``python -m kochab.workflows.fine_patterns FILE`` is that process; it tells its
progress in FILE. No Qt is imported there.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import kochab
from kochab.core.errors import CatalogueError, KochabError
from kochab.core.progress import Progress, Task
from kochab.frames.atomic_file import write_atomically

LOOK_EVERY_S = 0.2
ENDING_S = 4.0


def make_elsewhere() -> Task[None]:
    """Make the patterns in another process; closing this task ends it.

    Raises CatalogueError when they cannot be made.
    """
    with tempfile.TemporaryDirectory(prefix="kochab-patterns-") as folder:
        status = Path(folder, "progress.json")
        process = subprocess.Popen(
            [sys.executable, "-m", "kochab.workflows.fine_patterns", str(status)],
            cwd=Path(kochab.__file__).parent.parent,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )
        try:
            while process.poll() is None:
                fraction = _read(status).get("fraction")
                yield Progress("patterns", fraction if isinstance(fraction, float) else None)
                time.sleep(LOOK_EVERY_S)
        finally:
            _end(process)
        if process.returncode != 0:
            why = _read(status).get("error")
            raise CatalogueError(str(why or "Can't build the small-field index."))


def _read(path: Path) -> dict[str, object]:
    try:
        status = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return status if isinstance(status, dict) else {}


def _end(process: "subprocess.Popen[bytes]") -> None:
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(ENDING_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def main(path: Path) -> int:
    """Make them, and write to ``path`` how far that is or why it went wrong."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that half-made files are removed
    if hasattr(os, "nice"):
        os.nice(10)
    from kochab.identification.index_build import make_fine

    try:
        task = make_fine()
        parent = os.getppid()
        for progress in task:
            if os.getppid() != parent:  # the window was killed
                task.close()
                return 1
            _write(path, {"fraction": progress.fraction})
    except KochabError as error:
        _write(path, {"error": str(error)})
        return 1
    return 0


def _write(path: Path, value: dict[str, object]) -> None:
    with suppress(OSError):  # the window is gone
        write_atomically(path, json.dumps(value))


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
