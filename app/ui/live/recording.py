"""Switches recording on and off while a stream runs; everything happens in the stream's thread."""

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

from app.core.errors import UsageError
from app.ui.wiring import ToRecord
from app.workflows.live_record import Recorder, session_folder
from app.workflows.live_update import LiveUpdate

LOOK_S = 2.0  # between looks at the disk


@dataclass(frozen=True, slots=True)
class Recorded:
    """How a recording does; ``free_bytes`` is what its disk has left."""

    folder: Path
    frames: int
    solved: int
    free_bytes: int
    going_on: bool


class Recording:
    """Follows :attr:`wish`, the folder to make a session in, or None to end it."""

    def __init__(self, to_record: ToRecord | None, about: Mapping[str, object]) -> None:
        self.wish: Path | None = None
        self.state: Recorded | None = None
        self._to_record, self._about = to_record, about
        self._followed: Path | None = None
        self._recorder: Recorder | None = None
        self._looked_s = 0.0
        self._free = 0

    def take(self, update: LiveUpdate) -> list[str]:
        """Record one frame if that is wished; sentences for the person."""
        said = self._follow()
        recorder = self._recorder
        if recorder is not None:
            sentence = recorder.record(update)
            if sentence is not None:
                said.append(sentence)
            self._tell(recorder)
            if not recorder.recording:
                self._recorder = None
        return said

    def close(self) -> list[str]:
        """End the session, if there is one; what is to be said of it."""
        recorder, self._recorder = self._recorder, None
        self._followed = self.wish = None
        if recorder is None:
            return []
        recorder.close()
        self._tell(recorder)
        return [f"{recorder.frames} frames were recorded into {recorder.folder}."]

    def _follow(self) -> list[str]:
        wish = self.wish
        if wish == self._followed:
            return []
        said = self.close()
        self.wish = self._followed = wish
        if wish is not None and self._to_record is not None:
            try:
                self._recorder = Recorder(session_folder(wish), self._to_record, self._about)
            except UsageError as error:
                self.state = Recorded(wish, 0, 0, 0, False)
                said.append(str(error))
        return said

    def _tell(self, recorder: Recorder) -> None:
        now = monotonic()
        if now - self._looked_s >= LOOK_S:
            self._looked_s = now
            try:
                self._free = shutil.disk_usage(recorder.folder).free
            except OSError:
                self._free = 0
        self.state = Recorded(
            recorder.folder, recorder.frames, recorder.solved, self._free, recorder.recording
        )
