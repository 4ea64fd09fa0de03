"""Frames and their solutions into a folder, while they come: a session that can be replayed.

A frame is written before the next is solved, so that nothing waits in memory: a slow disk slows
the stream, and the mailbox then drops frames as it does for a slow solver.
"""

import hashlib
import json
import shutil
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import IO

from app import __version__
from app.core.errors import UsageError
from app.core.progress import Progress
from app.core.solution import Solution
from app.frames.whole_file import write_whole
from app.workflows.live_session import FORMAT, LINES, SESSION, Json
from app.workflows.live_solve import WARNING, Live
from app.workflows.live_update import LiveUpdate

KEEP_FREE_BYTES = 500_000_000
"""Recording ends before the disk has less than this: a full one harms every other program."""


class Recorder:
    """Writes one session into ``folder``, which is made, and must not hold one already.

    ``to_json`` gives the line of an update in the form of the command line, finite numbers only.
    ``about`` is what is to be remembered of camera and solver; ``solve`` in it should be
    :func:`~app.workflows.live_session.options_json`, so that a replay solves alike.

    Raises
    ------
    UsageError
        The folder cannot be written, holds a session, or its disk is nearly full.

    """

    def __init__(
        self,
        folder: Path,
        to_json: Callable[[LiveUpdate], Json],
        about: Mapping[str, object] | None = None,
        keep_free_bytes: int = KEEP_FREE_BYTES,
    ) -> None:
        self.folder, self.frames, self.solved = folder, 0, 0
        self._to_json = to_json
        self._keep_free_bytes = keep_free_bytes
        self._about: Json = {
            "format": FORMAT,
            "kochab": __version__,
            "started_utc": datetime.now(UTC).isoformat(),
            **(about or {}),
        }
        self._lines: IO[str] | None = self._open()

    @property
    def recording(self) -> bool:
        """Whether the next update would be written."""
        return self._lines is not None

    def record(self, update: LiveUpdate) -> str | None:
        """Write one frame and its answer; the sentence that says why recording ended, if it did."""
        from app.frames.fits_write import fits_bytes

        if self._lines is None:
            return None
        data = fits_bytes(update.shot.frame)
        try:
            self._check_space(len(data))
            name = f"frame-{self.frames + 1:06d}.fits"
            write_whole(self.folder / name, data)
            line = {**self._to_json(update), "frame_file": name}
            line["sha256"] = hashlib.sha256(data).hexdigest()
            line["time_utc"] = update.track.time_utc.isoformat()
            self._lines.write(json.dumps(line, allow_nan=False) + "\n")
            self._lines.flush()
        except (OSError, UsageError) as error:
            self.close()
            why = error.strerror or str(error) if isinstance(error, OSError) else str(error)
            return f"Recording has ended after {self.frames} frames: {why.rstrip('.')}."
        self.frames += 1
        self.solved += isinstance(update.result, Solution)
        return None

    def close(self) -> None:
        """End the session; never raises."""
        lines, self._lines = self._lines, None
        if lines is None:
            return
        ended = {"ended_utc": datetime.now(UTC).isoformat(), "frames": self.frames}
        try:
            lines.close()
            self._write_about({**self._about, **ended, "solved": self.solved})
        except OSError:
            return  # every line is there; only the count at the end is not

    def _open(self) -> IO[str]:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if (self.folder / SESSION).exists():
                raise UsageError(f"{self.folder} holds a session already; name another folder.")
            self._check_space(0)
            self._write_about(self._about)
            return (self.folder / LINES).open("w", encoding="utf-8", newline="\n")
        except OSError as error:
            raise UsageError(
                f"{self.folder} cannot be recorded into: {error.strerror or error}."
            ) from None

    def _check_space(self, wanted: int) -> None:
        free = shutil.disk_usage(self.folder).free
        if free - wanted < self._keep_free_bytes:
            raise UsageError(
                f"The disk of {self.folder} has {free // 1_000_000:,} MB left and"
                f" {self._keep_free_bytes // 1_000_000:,} MB are kept free."
            )

    def _write_about(self, about: Json) -> None:
        text = json.dumps(about, indent=1) + "\n"
        write_whole(self.folder / SESSION, text)


def recorded(live: Live, recorder: Recorder) -> Live:
    """The same stream, written by ``recorder``, which is closed with it.

    When recording ends by itself the stream goes on, with the reason as a warning.
    """
    try:
        while True:
            try:
                step = next(live)
            except StopIteration as end:
                return end.value  # type: ignore[no-any-return]
            if isinstance(step, LiveUpdate):
                sentence = recorder.record(step)
                if sentence is not None:
                    yield Progress(WARNING, None, sentence)
            yield step
    finally:
        recorder.close()
        live.close()


def session_folder(parent: Path, now: datetime | None = None) -> Path:
    """A new name under ``parent`` for a session that begins now."""
    name = f"kochab-{(now or datetime.now(UTC)).strftime('%Y-%m-%dT%H-%M-%SZ')}"
    folder, count = parent / name, 1
    while folder.exists():
        count += 1
        folder = parent / f"{name}-{count}"
    return folder
