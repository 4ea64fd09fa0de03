"""What was asked of a mount, and what became of it: the guard's own record."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from threading import Lock

Clock = Callable[[], datetime]


def utc_now() -> datetime:
    """The computer's time, aware."""
    return datetime.now(UTC)


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One motion or sync: ``outcome`` is "sent", "done", "refused" or "failed"."""

    time_utc: str
    action: str
    outcome: str
    detail: Mapping[str, float | str] = field(default_factory=dict)
    sentence: str = ""


class MotionLog:
    """Entries in memory and, when a path is given, one JSON object a line in a file."""

    def __init__(self, path: str | Path | None = None, clock: Clock = utc_now) -> None:
        self.entries: list[LogEntry] = []
        self._path = None if path is None else Path(path)
        self._clock = clock
        self._lock = Lock()

    def add(
        self,
        action: str,
        outcome: str,
        sentence: str = "",
        detail: Mapping[str, float | str] | None = None,
    ) -> None:
        """Write one entry; a file that cannot be written never holds up a Stop."""
        entry = LogEntry(self._clock().isoformat(), action, outcome, dict(detail or {}), sentence)
        with self._lock:
            self.entries.append(entry)
            if self._path is None:
                return
            try:
                with self._path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(entry)) + "\n")
            except OSError:
                self._path = None

    def sent(self, action: str | None = None) -> list[LogEntry]:
        """What really went to the mount, all or one kind of it."""
        return [e for e in self.entries if e.outcome == "sent" and action in (None, e.action)]
