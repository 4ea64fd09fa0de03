"""A recorded session, solved again: the same frames, the same options, the answers compared."""

import hashlib
from collections.abc import Generator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from time import monotonic

from app.core.attitude import separation_deg, unit_vectors
from app.core.errors import FrameError
from app.core.frame import Frame
from app.core.progress import Progress
from app.core.solution import Solution
from app.solve.options import SolveOptions
from app.solve.track import TrackUpdate
from app.workflows.live_capture import Shot
from app.workflows.live_session import Json, options_from, read_session
from app.workflows.live_solve import Engine
from app.workflows.live_update import GoodPointing, LiveUpdate

SAME_PX = 1.0
"""Answers of the same frame that differ by less are the same: solving has no chance in it."""


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """A frame solved again beside what its line says.

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


def replay(folder: Path, engine: Engine) -> Generator[Progress | Replayed, None, None]:
    """Solve every frame of the session in ``folder`` again, in order.

    Raises
    ------
    app.core.errors.KochabError
        The folder holds no session, or one of its frames is missing or unreadable.

    """
    _, lines = read_session(folder)
    for number, line in enumerate(lines, 1):
        yield Progress("replay", (number - 1) / len(lines), line["frame_file"])
        frame, intact = _frame(folder / Path(line["frame_file"]).name, line)
        received = monotonic()
        moment = _moment(line, frame)
        track = yield from engine.update(frame, moment)
        shot = Shot(number, frame, received - _seconds_since(moment), received)
        yield Replayed(_update(shot, track), line, intact, _apart(track.solution, line))


def _frame(path: Path, line: Json) -> tuple[Frame, bool]:
    from app.frames import read_frame

    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        raise FrameError(f"{path} of the session is missing or cannot be read.") from None
    return read_frame(path), digest == line.get("sha256")


def _moment(line: Json, frame: Frame) -> datetime:
    try:
        return datetime.fromisoformat(str(line.get("time_utc"))).astimezone(UTC)
    except ValueError:
        return frame.hint.time_utc or datetime.now(UTC)


def _seconds_since(moment: datetime) -> float:
    return max(0.0, (datetime.now(UTC) - moment).total_seconds())


def _update(shot: Shot, track: TrackUpdate) -> LiveUpdate:
    good = None
    if track.solution is not None:
        good = GoodPointing(track.solution, shot.number, shot.shutter_s)
    return LiveUpdate(shot, track, monotonic(), good, warnings=shot.frame.warnings)


def _apart(found: Solution | None, line: Json) -> float | None:
    if found is None or not line.get("solved"):
        return None
    try:
        then = unit_vectors(float(line["ra_deg"]), float(line["dec_deg"]))
    except (KeyError, TypeError, ValueError):
        return None
    return separation_deg(found.centre_vector, then) * 3600.0
