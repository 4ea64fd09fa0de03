"""A folder that another program writes pictures into, watched as if it were a camera.

It is looked through a few times a second: that also works on a network share, where a system's
own notices do not arrive.
"""

import os
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from time import monotonic, sleep

from kochab.core.capture import CameraDevice, CameraSource, CaptureLimits, CaptureSettings
from kochab.core.errors import FrameError, LineLostError, PortError
from kochab.core.frame import Frame
from kochab.core.progress import Task
from kochab.core.values import frozen, mutable
from kochab.text.translation import tr

# -- Which files of a folder are new and finished; pure bookkeeping, the clock is given --------

SETTLE_S = 0.3  # a file whose size and time have not changed for so long may be finished
PATIENCE_S = 4.0  # a file that has not changed for so long and still cannot be read is broken


@frozen
class Stamp:
    """What a directory says of a file: its size in bytes and when it was last written."""

    size: int
    mtime_ns: int


@mutable
class _File:
    stamp: Stamp
    since_s: float
    done: bool = False
    retry_s: float = 0.0
    watched: bool = True


class Arrivals:
    """Tells finished new files from those being written, newest first.

    A file that is written again is new again, so that a program may overwrite one ``latest.jpg``.
    """

    def __init__(self) -> None:
        self._files: dict[str, _File] = {}
        self._listed = False

    def update(self, listing: dict[str, Stamp], now_s: float) -> None:
        """Take in what the folder holds at ``now_s`` (any steady clock, seconds)."""
        for path in self._files.keys() - listing.keys():
            del self._files[path]
        for path, stamp in listing.items():
            known = self._files.get(path)
            if known is None:
                self._files[path] = _File(stamp, now_s, watched=self._listed)
            elif known.stamp != stamp:
                self._files[path] = _File(stamp, now_s)
        self._listed = True

    def ready(self, now_s: float) -> list[str]:
        """Files not yet given out that look finished, newest first."""
        waiting = [(f.stamp.mtime_ns, path) for path, f in self._files.items() if self._due(f, now_s)]
        return [path for _, path in sorted(waiting, reverse=True)]

    def stamp(self, path: str) -> Stamp:
        """Of a known file, as it was at the last look."""
        return self._files[path].stamp

    def written_while_watched(self, path: str) -> bool:
        """Whether the file came or changed after the first look at the folder."""
        return self._files[path].watched

    def give(self, path: str, now_s: float) -> int:
        """``path`` was read: older finished files will not be given any more; how many they are."""
        given = self._files[path]
        given.done = True
        dropped = 0
        for file in self._files.values():
            if self._due(file, now_s) and file.stamp.mtime_ns <= given.stamp.mtime_ns:
                file.done = True
                dropped += 1
        return dropped

    def unreadable(self, path: str, now_s: float) -> bool:
        """``path`` could not be read: whether it is broken, else it is tried again soon."""
        if (file := self._files.get(path)) is None:
            return False  # deleted while it was read
        file.done = now_s - file.since_s >= PATIENCE_S
        file.retry_s = now_s + SETTLE_S
        return file.done

    @staticmethod
    def _due(file: _File, now_s: float) -> bool:
        return not file.done and now_s - file.since_s >= SETTLE_S and now_s >= file.retry_s


POLL_S = 0.1
MOST_COMPLAINTS = 20
READ_LIMIT_S = 20.0  # a file that is not read in so long costs its one complaint, and the folder goes on
READ_AT_ONCE_S = 2.0  # so long a file is read within one call; what takes longer goes on in the next
DEEPEST = 4  # folders in folders (target, night, filter) are looked into so far down


class FolderCamera(CameraSource):
    """A watched folder: the newest finished picture in it is the newest frame."""

    name = "folder"

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._identity = self._who()
        self._arrivals = Arrivals()
        self._complaints: deque[str] = deque(maxlen=MOST_COMPLAINTS)
        self._next_look_s = 0.0
        self._reading: tuple[str, Stamp, Task[Frame]] | None = None

    @classmethod
    def devices(cls, address: str = "") -> list[CameraDevice]:
        """The folder itself, when it is one."""
        if not address or not Path(address).is_dir():
            return []
        return [CameraDevice(cls.name, address, tr("images saved to {folder}", folder=address))]

    @classmethod
    def open(cls, address: str, settings: CaptureSettings) -> "FolderCamera":
        """Watch the folder ``address``; a picture that is already there comes first."""
        if not address:
            raise PortError("Choose the folder your capture program saves to.")
        folder = Path(address).expanduser()
        if not folder.exists():
            raise PortError("The folder {folder} does not exist.", folder=folder)
        if not folder.is_dir():
            raise PortError("{folder} is a file. Choose its folder.", folder=folder)
        try:
            with os.scandir(folder) as entries:
                next(entries, None)
        except OSError as error:
            raise PortError(
                "The folder {folder} cannot be read: {strerror}.", folder=folder, strerror=error.strerror
            ) from None
        return cls(folder)

    @property
    def limits(self) -> CaptureLimits:
        """Nothing can be set: another program holds the camera."""
        return CaptureLimits()

    def configure(self, settings: CaptureSettings) -> CaptureSettings:
        """Nothing is applied; the program that writes the pictures decides."""
        return CaptureSettings()

    def complaints(self) -> tuple[str, ...]:
        """Sentences about files that were left out since the last call."""
        complaints = tuple(self._complaints)
        self._complaints.clear()
        return complaints

    def next_frame(self, timeout_s: float) -> Frame | None:
        """The newest finished picture not yet given out."""
        deadline = monotonic() + timeout_s
        while True:
            if monotonic() >= self._next_look_s:
                self._look()
            for path in [self._reading[0]] if self._reading else self._arrivals.ready(monotonic()):
                frame = self._read(path)
                if frame is not None or self._reading:
                    return frame
                if monotonic() > deadline:
                    break  # many broken files: the rest at the next call
            left = deadline - monotonic()
            if left <= 0:
                return None
            sleep(min(POLL_S, left))

    def close(self) -> None:
        """Stop the decoder, should one be at work."""
        if self._reading:
            self._reading[2].close()
            self._reading = None

    def _look(self) -> None:
        """List the folder; a large one is listed less often, at a tenth of a processor at most."""
        begun = monotonic()
        self._arrivals.update(self._listing(), begun)
        now = monotonic()
        # Nine times as long as the look took: a tenth of the time, however many files there are.
        self._next_look_s = now + max(POLL_S, 9.0 * (now - begun)) - POLL_S / 2

    def _read(self, path: str) -> Frame | None:
        """The frame in ``path``; None, with ``_reading`` set, while its decoder is still at work."""
        from kochab.frames import reading

        if self._reading is None:
            stamp = _stamp(path)
            # Asked anew: the last look may be seconds old on a large folder.
            if stamp is None or stamp != self._arrivals.stamp(path):
                return None  # written to since the last look: the next one sees it as new
            self._reading = path, stamp, reading(path, READ_LIMIT_S)
        _, before, task = self._reading
        end = monotonic() + READ_AT_ONCE_S
        try:
            while True:
                next(task)
                if monotonic() > end:
                    return None
        except StopIteration as read:
            frame: Frame = read.value
        except FrameError as error:
            self._reading = None
            if self._arrivals.unreadable(path, monotonic()):
                self._complaints.append(f"File skipped: {error}")
            return None
        self._reading = None
        if _stamp(path) != before:
            return None  # written to while it was read
        watched = self._arrivals.written_while_watched(path)
        self._arrivals.give(path, monotonic())
        return _timed(frame, before) if watched else frame

    def _listing(self) -> dict[str, Stamp]:
        if self._who() != self._identity:
            raise LineLostError("The folder {folder} was replaced. Open it again.", folder=self._folder)
        try:
            return dict(_pictures(self._folder, DEEPEST))
        except OSError as error:
            raise self._gone(error) from None

    def _who(self) -> tuple[int, int]:
        """What stays the same as long as it is the same folder of the same drive."""
        try:
            # Device and inode: an unmounted drive leaves an empty folder of the same name.
            status = self._folder.stat()
        except OSError as error:
            raise self._gone(error) from None
        return status.st_dev, status.st_ino

    def _gone(self, error: OSError) -> LineLostError:
        return LineLostError(
            "Lost the folder {folder} ({strerror}). Check the drive or network share.",
            folder=self._folder,
            strerror=error.strerror,
        )


def _pictures(folder: Path, depth: int) -> Iterator[tuple[str, Stamp]]:
    """Pictures in a folder and those below it; what vanishes meanwhile is left out."""
    from kochab.frames import named_as_frame

    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.startswith("."):
                continue
            with suppress(OSError):
                if entry.is_dir():
                    if depth > 1:
                        yield from _pictures(Path(entry.path), depth - 1)
                elif named_as_frame(entry.name):
                    status = entry.stat()
                    yield entry.path, Stamp(status.st_size, status.st_mtime_ns)


def _stamp(path: str) -> Stamp | None:
    try:
        status = os.stat(path)
    except OSError:
        return None
    return Stamp(status.st_size, status.st_mtime_ns)


def _timed(frame: Frame, stamp: Stamp) -> Frame:
    """A file that does not say when it was taken was taken just before it was written."""
    if frame.hint.time_utc is not None:
        return frame
    half = timedelta(seconds=(frame.hint.exposure_s or 0.0) / 2.0)
    written = datetime.fromtimestamp(stamp.mtime_ns / 1e9, UTC)
    hint = replace(frame.hint, time_utc=written - half, time_of_file=True)
    return replace(frame, hint=hint)
