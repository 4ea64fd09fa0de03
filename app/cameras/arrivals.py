"""Which files of a folder are new and finished; pure bookkeeping, the clock is given."""

from dataclasses import dataclass

SETTLE_S = 0.3
"""A file whose size and time have not changed for so long may be finished."""
PATIENCE_S = 4.0
"""A file that has not changed for so long and still cannot be read is broken."""


@dataclass(frozen=True, slots=True)
class Stamp:
    """What a directory says of a file: its size in bytes and when it was last written."""

    size: int
    mtime_ns: int


@dataclass(slots=True)
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
        waiting = [
            (f.stamp.mtime_ns, path) for path, f in self._files.items() if self._due(f, now_s)
        ]
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
        file = self._files[path]
        file.done = now_s - file.since_s >= PATIENCE_S
        file.retry_s = now_s + SETTLE_S
        return file.done

    @staticmethod
    def _due(file: _File, now_s: float) -> bool:
        return not file.done and now_s - file.since_s >= SETTLE_S and now_s >= file.retry_s
