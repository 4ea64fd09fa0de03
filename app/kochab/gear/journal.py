"""The journal: commands and bytes, motions, solves and faults, in the user's state folder.

Every room logs under its module's name with the standard library; :func:`open_journal` keeps it.
"""

import json
import logging
import os
import re
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import field
from datetime import UTC, datetime
from pathlib import Path
from threading import Lock
from time import gmtime
from types import TracebackType
from typing import Any

from kochab.core import __version__
from kochab.core.errors import printable
from kochab.core.values import frozen

Clock = Callable[[], datetime]
FILE, FILE_BYTES, FILES = "journal.log", 4_000_000, 5  # a night of polls at 0.5 s is about 10 MB
PACKAGES = ("numpy", "scipy", "astropy", "PySide6-Essentials", "pyserial")
logger = logging.getLogger(__name__)


def utc_now() -> datetime:
    """The computer's time, aware."""
    return datetime.now(UTC)


# -- The file ----------------------------------------------------------------------------------


def journal_folder() -> Path:
    """Where the journal is kept."""
    from platformdirs import user_state_path

    return user_state_path("kochab", appauthor=False)


def open_journal(folder: Path | None = None, terminal: bool = False) -> Path | None:
    """Write everything under the logger ``kochab`` to a rotating file; None when that cannot be.

    Each record is handed to the system at once: it survives a ``kill -9`` of this program. Faults
    that are not caught, in any thread, are written with their traceback. With ``terminal``, of a command,
    warnings go to standard error as well, as they do without a journal, and the packages' versions are left out:
    asking for them delays the start.
    """
    path = (folder or journal_folder()) / FILE
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = JournalFile(path, encoding="utf-8")
    except OSError:
        return None
    layout = "%(asctime)s.%(msecs)03dZ %(levelname)s %(name)s %(message)s"
    file.setFormatter(formatter := JournalFormatter(layout, "%Y-%m-%dT%H:%M:%S"))
    formatter.converter = gmtime
    root = logging.getLogger("kochab")
    root.addHandler(file)
    if terminal and logging.lastResort is not None:
        logging.lastResort.setFormatter(JournalFormatter())
        logging.lastResort.addFilter(lambda record: record.name != __name__)  # the excepthook prints faults
        root.addHandler(logging.lastResort)
    root.setLevel(logging.DEBUG)
    _log_uncaught_faults()
    logger.info("started: %s", ", ".join(f"{name} {version}" for name, version in versions(not terminal).items()))
    return path


class JournalFile(logging.FileHandler):
    """A file that makes way for a new one when it is full.

    :class:`logging.handlers.RotatingFileHandler`, which then moves the files, brings sockets and queues along: it is
    loaded when it is needed, for that is a fiftieth of a short command.
    """

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record; then let the files move on by one if this one is full."""
        super().emit(record)
        with suppress(OSError):  # Windows: another Kochab has it open; it grows until that ends
            if self.stream is not None and os.fstat(self.stream.fileno()).st_size >= FILE_BYTES:
                self.stream.close()
                self._roll_over()

    def _roll_over(self) -> None:
        from logging.handlers import RotatingFileHandler

        try:
            RotatingFileHandler(self.baseFilename, backupCount=FILES - 1, delay=True).doRollover()
        finally:
            self.stream = self._open()

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - logging's own name
        """A full disk must not stop a mount from being stopped, nor fill the terminal."""


class JournalFormatter(logging.Formatter):
    """Lines that do nothing to the terminal they are read in, whatever a file or a device is called."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: D102, N802 - logging's own name
        return "\n".join(map(printable, super().formatMessage(record).split("\n")))


def versions(packages: bool = True) -> dict[str, str]:
    """Versions of Kochab, Python and the system; with ``packages`` of the system in full and of the main packages."""
    found = {"Kochab": __version__, "Python": sys.version.split()[0], "system": sys.platform}
    if not packages:
        return found
    import platform
    from importlib import metadata

    found["system"] = platform.platform()
    for name in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            found[name] = metadata.version(name)
    return found


def _log_uncaught_faults() -> None:
    """Log faults first, then call the hooks that were set before."""
    before, before_in_thread, before_unraisable = sys.excepthook, threading.excepthook, sys.unraisablehook

    def fault(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        if issubclass(kind, Exception):
            logger.critical("fault", exc_info=(kind, error, trace))
        before(kind, error, trace)

    def fault_in_thread(args: threading.ExceptHookArgs) -> None:
        if isinstance(args.exc_value, Exception):
            name = args.thread.name if args.thread else "?"
            logger.critical("fault in the thread %s", name, exc_info=args.exc_value)
        before_in_thread(args)

    def unraisable(args: "sys.UnraisableHookArgs") -> None:
        if args.exc_value is not None:
            logger.error("fault in %r", args.object, exc_info=args.exc_value)
        before_unraisable(args)

    sys.excepthook, threading.excepthook, sys.unraisablehook = fault, fault_in_thread, unraisable


# -- The motions of one mount ------------------------------------------------------------------


@frozen
class LogEntry:
    """One motion or sync: ``outcome`` is "sent", "done", "refused" or "failed"."""

    time_utc: str
    action: str
    outcome: str
    detail: Mapping[str, float | str] = field(default_factory=dict)
    sentence: str = ""


class MotionLog:
    """The motions sent to a mount and their outcomes, in memory and in the journal."""

    def __init__(self, clock: Clock = utc_now) -> None:
        self.entries: list[LogEntry] = []
        self._clock = clock
        self._lock = Lock()

    def add(
        self,
        action: str,
        outcome: str,
        sentence: str = "",
        detail: Mapping[str, float | str] | None = None,
        journal: bool = True,
    ) -> None:
        """Add an entry.

        Parameters
        ----------
        action : str
            What was asked of the mount.
        outcome : str
            How it ended; "failed" adds the traceback to the journal.
        sentence : str
            What the person was told.
        detail : Mapping[str, float or str] or None
            Numbers and words of the motion by name.
        journal : bool
            Whether it goes to the journal too; without it no disk can delay what comes next.
        """
        entry = LogEntry(self._clock().isoformat(), action, outcome, dict(detail or {}), sentence)
        with self._lock:
            self.entries.append(entry)
        if journal:
            values = " ".join(f"{name}={value}" for name, value in entry.detail.items())
            text = " ".join(word for word in (action, outcome, values, sentence) if word)
            fault = sys.exc_info() if outcome == "failed" else None
            logger.info("%s", text, exc_info=fault if fault and fault[0] else None)

    def sent(self, action: str | None = None) -> list[LogEntry]:
        """The entries that were sent to the mount, of all actions or of one."""
        return [e for e in self.entries if e.outcome == "sent" and action in (None, e.action)]


# -- A report for an issue tracker, without secrets --------------------------------------------

# LX200, NexStar, iOptron: the site, and the altitude and azimuth that give it beside RA, Dec and the time.
SITE_QUESTIONS = {f"b'{q}'" for q in (":Gt#", ":Gg#", "w", ":GLS#", ":GA#", ":GZ#", "z", "Z", ":GAC#")}
SITE_ORDERS = re.compile(r"(serial_line \S+(?: >|:) )b['\"](?::S[tg]|:SL[AO]|W.).*")  # and with what was not sent
SECRET = re.compile(r"pass|secret|token|key$", re.IGNORECASE)
PLACE = re.compile(r"site|latitude|longitude", re.IGNORECASE)
FOLDERS = re.compile(r"(?<![\w/:.])~?(?:[A-Za-z]:)?(?:[/\\](?!dev[/\\])[^\s/\\:'\"]+)+[/\\](?=[^\s/\\'\"])")


def save_report(path: Path, settings: Mapping[str, Any] | None = None, folder: Path | None = None) -> None:
    """Pack journal, versions and ``settings`` into a zip file that may be shown to anybody.

    User and computer names, folders and passwords are left out, the site is given to a degree.
    `OSError` when it cannot be written.
    """
    import zipfile

    from kochab.frames.atomic_file import atomic_file  # a sync needs no reader of frames

    with atomic_file(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as report:
        report.writestr("versions.json", json.dumps(versions(), indent=1))
        kept = {k: _setting(k, v) for k, v in (settings or {}).items() if not SECRET.search(k)}
        report.writestr("settings.json", redacted(json.dumps(kept, indent=1, default=str)))
        questions: dict[str, tuple[str, bool]] = {}
        for file in sorted((folder or journal_folder()).glob(f"{FILE}*"), reverse=True):  # oldest first
            lines = file.read_text("utf-8", errors="replace").splitlines(keepends=True)
            report.writestr(file.name, "".join(_without_site(map(redacted, lines), questions)))


def redacted(text: str) -> str:
    """``text`` without passwords in addresses, folders, and the names of user and computer."""
    import getpass
    import platform

    text = re.sub(r"(?<=://)[^\s/@'\"]+@", "…@", text)
    text = text.replace(str(Path.home()), "~")
    text = FOLDERS.sub(lambda found: _known_folder(found.group()), text)
    with suppress(KeyError, OSError):  # no name in the environment, none in the system
        user = os.environ.get("USERNAME") or getpass.getuser()
        text = re.sub(rf"\b{re.escape(user)}\b", "user", text, flags=re.IGNORECASE)
    return re.sub(rf"\b{re.escape(platform.node())}\b", "computer", text) if platform.node() else text


def _known_folder(folders: str) -> str:
    """Keep only the part of a path below the program or its packages."""
    for own in ("site-packages", "kochab"):
        _, found, after = folders.replace("\\", "/").rpartition(f"/{own}/")
        if found:
            return f"…{found}{after}"
    return "…/"


def _setting(name: str, value: Any) -> Any:
    if PLACE.search(name) and isinstance(value, str | float):
        return re.sub(r"(-?\d+)\.\d+", r"\1", str(value))
    return value


def _without_site(lines: Iterator[str], questions: dict[str, tuple[str, bool]]) -> Iterator[str]:
    """Leave out the orders that set the site and the replies to questions for it, which give it to the arcsecond.

    ``questions`` holds the last question at each port and whether it was answered: its reply may
    follow in the next file, or after a Stop that did not wait for it.
    """
    for line in lines:
        line = SITE_ORDERS.sub(r"\1(site left out)", line)
        found = re.search(r"serial_line (\S+) ([<>]) (.*)", line)
        if found is None:
            yield re.sub(r"(site|lat|lon)(\S*?[=: ]-?\d+)\.\d+", r"\1\2", line)
            continue
        port, direction, data = found.groups()
        question, answered = questions.get(port, ("", True))
        if direction == "<":
            questions[port] = question, True
            if question in SITE_QUESTIONS:
                line = line.replace(data, "(site left out)")
        elif answered or question not in SITE_QUESTIONS:
            questions[port] = data, False
        yield line
