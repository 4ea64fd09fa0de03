"""A recorded session: frames and solutions written to a folder, and replayed from it.

A frame is written before the next is solved, so that nothing waits in memory: a slow disk slows
the stream, and the mailbox then drops frames as it does for a slow solver.
"""

import hashlib
import json
import shutil
from collections.abc import Callable, Generator, Mapping
from contextlib import closing
from dataclasses import asdict, fields
from datetime import UTC, datetime
from pathlib import Path
from time import monotonic
from types import UnionType
from typing import IO, Any, get_args, get_origin, get_type_hints

from kochab.core import __version__
from kochab.core.attitude import separation_deg, unit_vectors
from kochab.core.errors import FrameError, UsageError
from kochab.core.frame import Frame, Hint, Site
from kochab.core.progress import Progress, Task
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.frames.atomic_file import write_atomically
from kochab.parsing.text_input import TextError, parse_json, read_json, read_text
from kochab.solver import SolveOptions
from kochab.solver.tracker import TrackUpdate
from kochab.text.angle_text import short_name
from kochab.text.translation import tr
from kochab.workflows.live.capture import Shot
from kochab.workflows.live.solve import WARNING, Live, ProfiledTracker
from kochab.workflows.live.update import GoodPointing, LiveUpdate

SESSION = "session.json"  # written at the start, and again with the counts at the end
"""Versions, the camera and its settings, how frames were solved, how many there are."""
LINES = "solutions.jsonl"
"""One JSON object a frame: the result, the frame's file and the SHA-256 of that file."""
FORMAT = 1

Json = dict[str, Any]


def options_json(options: SolveOptions) -> Json:
    """``options`` in plain JSON values."""
    stored = asdict(options)
    hint = stored["hint"]
    if hint is not None and hint["time_utc"] is not None:
        hint["time_utc"] = hint["time_utc"].isoformat()
    return stored


def options_from(stored: Any) -> SolveOptions:
    """The options of :func:`options_json`; what this version does not know is left out.

    Raises UsageError when they are of kinds that options cannot be.
    """
    try:
        kinds = get_type_hints(SolveOptions)
        values = {k: v for k, v in stored.items() if k in kinds}
        if values.get("hint") is not None:
            values["hint"] = _hint(values["hint"])
        for name, value in values.items():
            if name != "hint" and not _may_be(value, kinds[name]):
                raise TypeError(name)
        return SolveOptions(**values)
    except (TypeError, ValueError, AttributeError):
        raise UsageError("The session's settings are damaged, so its frames can't be solved again.") from None


def _may_be(value: Any, kind: Any) -> bool:
    """Whether ``value`` is of a ``kind`` or of one of several; a whole number may be a number."""
    if isinstance(kind, UnionType):
        return any(_may_be(value, one) for one in get_args(kind))
    plain = get_origin(kind) or kind
    if isinstance(value, bool):  # isinstance takes True for an int
        return plain is bool
    return isinstance(value, int | float if plain is float else plain)


def _hint(stored: Any) -> Hint:
    if not isinstance(stored, Mapping):
        raise TypeError("hint")
    values = {f.name: stored[f.name] for f in fields(Hint) if f.name in stored}
    for name in ("scale_arcsec_px", "centre_deg"):
        if values.get(name) is not None:
            values[name] = tuple(values[name])
    if values.get("time_utc") is not None:
        values["time_utc"] = datetime.fromisoformat(values["time_utc"])
    if values.get("site") is not None:
        values["site"] = Site(**values["site"])
    return Hint(**values)


LARGEST_LINES_BYTES = 1_000_000_000  # a long night at five frames a second has a third of it


def read_session(folder: Path) -> tuple[Json, list[Json]]:
    """The description of the session in ``folder``, and its lines in order.

    A last line that was cut off, as when the computer went down, is left out.

    Raises UsageError when the folder holds no session that can be read.
    """
    try:
        facts = read_json(folder / SESSION)
        text = read_text(folder / LINES, largest_bytes=LARGEST_LINES_BYTES)
    except TextError:
        raise UsageError(
            "{folder} is not a recorded session: it has no readable {session} and {lines}.",
            folder=folder,
            session=SESSION,
            lines=LINES,
        ) from None
    if not isinstance(facts, dict) or facts.get("format") != FORMAT:
        raise UsageError("The session in {folder} was recorded by another version of Kochab.", folder=folder)
    return facts, _lines(text, folder)


def _lines(text: str, folder: Path) -> list[Json]:
    rows: list[Json] = []
    given = text.splitlines()
    for number, line in enumerate(given, 1):
        try:
            row = parse_json(line)
        except TextError:
            row = None
        if isinstance(row, dict) and isinstance(row.get("frame_file"), str):
            rows.append(row)
        elif number < len(given):
            raise UsageError("Line {number} of {folder} is damaged.", number=number, folder=folder / LINES)
    return rows


KEEP_FREE_BYTES = 500_000_000
"""Recording ends before the disk has less than this: a full one harms every other program."""


class Recorder:
    """Writes one session into ``folder``, which is made when it is not there, and must be empty.

    ``to_json`` gives the line of an update in the form of the command line, finite numbers only.
    ``facts`` is what is to be remembered of camera and solver; ``solve`` in it should be
    :func:`~kochab.workflows.live.session.options_json`, so that a replay solves alike.

    Raises UsageError when the folder cannot be written, holds files already, or its disk is nearly full.
    """

    def __init__(
        self,
        folder: Path,
        to_json: Callable[[LiveUpdate], Json],
        facts: Mapping[str, object] | None = None,
        keep_free_bytes: int = KEEP_FREE_BYTES,
    ) -> None:
        self.folder, self.frames, self.solved, self.free_bytes = folder, 0, 0, 0
        self._to_json = to_json
        self._keep_free_bytes = keep_free_bytes
        self._about: Json = {
            "format": FORMAT,
            "kochab": __version__,
            "started_utc": datetime.now(UTC).isoformat(),
            **(facts or {}),
        }
        self._lines: IO[str] | None = self._open()

    @property
    def recording(self) -> bool:
        """Whether the next update would be written."""
        return self._lines is not None

    def record(self, update: LiveUpdate) -> str | None:
        """Write one frame and its result; the sentence on why recording stopped, if it did."""
        from kochab.frames.fits_write import fits_bytes

        if self._lines is None:
            return None
        data = fits_bytes(update.shot.frame)
        try:
            self._check_space(len(data))
            name = f"frame-{self.frames + 1:06d}.fits"
            if (self.folder / name).exists():
                raise UsageError("{folder} was written by another program.", folder=self.folder / name)
            write_atomically(self.folder / name, data)  # before its line: no line names a frame that is not there
            line = {**self._to_json(update), "frame_file": name}
            line["sha256"] = hashlib.sha256(data).hexdigest()
            line["time_utc"] = update.track.time_utc.isoformat()
            self._lines.write(json.dumps(line, allow_nan=False) + "\n")
            self._lines.flush()  # a crash then costs one line at most
        except (OSError, UsageError) as error:
            self.close()
            why = error.strerror or str(error) if isinstance(error, OSError) else str(error)
            return tr("Recording stopped after {frames} frames: {why}.", frames=self.frames, why=why.rstrip("."))
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
                raise UsageError("{folder} already has a session. Choose another folder.", folder=self.folder)
            if any(not path.name.startswith(".") for path in self.folder.iterdir()):
                raise UsageError("{folder} is not empty. Choose an empty or new folder.", folder=self.folder)
            self._check_space(0)
            self._write_about(self._about)
            return (self.folder / LINES).open("x", encoding="utf-8", newline="\n")
        except OSError as error:
            raise UsageError(
                "Can't record to {folder}: {strerror}.", folder=self.folder, strerror=error.strerror or error
            ) from None

    def _check_space(self, wanted: int) -> None:
        self.free_bytes = shutil.disk_usage(self.folder).free
        if self.free_bytes - wanted < self._keep_free_bytes:
            raise UsageError(
                "The disk of {folder} has only {free:,} MB free ({keep:,} MB is kept free). Free some space.",
                folder=self.folder,
                free=self.free_bytes // 1_000_000,
                keep=self._keep_free_bytes // 1_000_000,
            )

    def _write_about(self, facts: Json) -> None:
        write_atomically(self.folder / SESSION, json.dumps(facts, indent=1) + "\n")


def recorded(live: Live, recorder: Recorder) -> Live:
    """The same stream, written by ``recorder``, which is closed with it.

    When recording ends by itself the stream goes on, with the reason as a warning.
    """
    with closing(live), closing(recorder):
        for step in live:
            sentence = recorder.record(step) if isinstance(step, LiveUpdate) else None
            if sentence is not None:
                yield Progress(WARNING, None, sentence)
            yield step


def session_folder(parent: Path, now: datetime | None = None) -> Path:
    """A new name under ``parent`` for a session that begins now."""
    name = f"kochab-{(now or datetime.now(UTC)).strftime('%Y-%m-%dT%H-%M-%SZ')}"
    folder, count = parent / name, 1
    while folder.exists():
        count += 1
        folder = parent / f"{name}-{count}"
    return folder


# -- A recorded session, solved again: the same frames and options, the results compared --------

SAME_PX = 1.0  # solutions of the same frame that differ by less are the same: nothing in solving is random


@frozen(eq=False)
class Replayed:
    """A frame solved again beside its recorded line.

    ``intact`` tells whether the file is byte for byte the one recorded. ``apart_arcsec`` is None
    when one of the two has no pointing.
    """

    update: LiveUpdate
    line: Json
    intact: bool
    apart_arcsec: float | None

    @property
    def agrees(self) -> bool:
        """Both solved and at the same place, or neither."""
        found = self.update.track.solution
        if found is None or self.apart_arcsec is None:
            return found is None and not self.line.get("solved")
        return self.apart_arcsec < SAME_PX * found.camera.scale_arcsec_px


def recorded_options(folder: Path) -> SolveOptions:
    """How the frames of the session in ``folder`` were solved; UsageError when there is none."""
    return options_from(read_session(folder)[0].get("solve") or {})


def replay(folder: Path, engine: ProfiledTracker) -> Generator[Progress | Replayed, None, None]:
    """Solve every frame of the session in ``folder`` again, in order.

    Raises KochabError when the folder holds no session, or one of its frames is missing or unreadable.
    """
    _, lines = read_session(folder)
    for number, line in enumerate(lines, 1):
        yield Progress("replay", (number - 1) / len(lines), line["frame_file"])
        # The name alone: a session from elsewhere must not read files outside its folder.
        frame, intact = yield from _frame(folder / Path(line["frame_file"]).name, line)
        received = monotonic()
        moment = _moment(line, frame)
        track = yield from engine.update(frame, moment)
        ago_s = max(0.0, (datetime.now(UTC) - moment).total_seconds())
        shot = Shot(number, frame, received - ago_s, received)
        yield Replayed(_update(shot, track), line, intact, _difference_arcsec(track.solution, line))


def _frame(path: Path, line: Json) -> Task[tuple[Frame, bool]]:
    from kochab.frames import reading

    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except (OSError, ValueError):  # or no name that a file can have
        raise FrameError("Can't read {name} of the session: missing or damaged.", name=short_name(path.name)) from None
    return (yield from reading(path)), digest == line.get("sha256")


def _moment(line: Json, frame: Frame) -> datetime:
    try:
        return datetime.fromisoformat(str(line.get("time_utc"))).astimezone(UTC)
    except ValueError:
        return frame.hint.time_utc or datetime.now(UTC)


def _update(shot: Shot, track: TrackUpdate) -> LiveUpdate:
    good = None if track.solution is None else GoodPointing(track.solution, shot.number, shot.shutter_s)
    return LiveUpdate(shot, track, monotonic(), good, warnings=shot.frame.warnings)


def _difference_arcsec(found: Solution | None, line: Json) -> float | None:
    if found is None or not line.get("solved"):
        return None
    try:
        then = unit_vectors(float(line["ra_deg"]), float(line["dec_deg"]))
    except (KeyError, TypeError, ValueError):
        return None
    return separation_deg(found.centre_vector, then) * 3600.0
