"""Where a polar alignment gets its solved frames from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Protocol

from app.core.capture import CameraSource
from app.core.errors import UsageError
from app.core.frame import Frame
from app.core.hint import Site
from app.core.progress import Progress, Task
from app.core.solution import NoSolution, Solution
from app.polar.sighting import Sighting
from app.solve.options import SolveOptions
from app.workflows.solve_frame import solve_file, solve_open_frame

NEAR_DEG = 20.0
SAME_SITE_DEG = 0.1
FRAME_TIMEOUT_S = 2.0

APART_DEG = 12.0
"""One sweep of an axis up to 5 deg from its pole spreads by no more than 10 in declination."""


class SightingSource(Protocol):
    """Gives one solved frame after the other, the newest each time."""

    def sight(self) -> Task[Sighting | NoSolution | None]:
        """The next frame, why it has no answer, or None when none came yet."""


@dataclass(frozen=True, slots=True, eq=False)
class SolvedFile:
    """A frame's file, what it says of time and place, and its answer."""

    path: str
    result: Solution | NoSolution
    time_utc: datetime | None
    site: Site | None
    warnings: tuple[str, ...] = ()


def solve_polar_file(path: str | Path, options: SolveOptions) -> Task[SolvedFile]:
    """Solve one file and keep what polar alignment needs of it."""
    solved = yield from solve_file(path, options)
    hint = solved.frame.hint
    return SolvedFile(str(path), solved.result, hint.time_utc, hint.site, solved.frame.warnings)


def sightings_of(files: Sequence[SolvedFile], sweeps: Sequence[int]) -> list[Sighting]:
    """The sightings of files that are all solved.

    Frames that are all said to be of one sweep, and stand at two declinations far apart, are two.

    Raises
    ------
    UsageError
        A frame does not say when it was taken, or two say the same: then nothing can be told
        from the sky's own turning.

    """
    sightings = []
    for file, sweep in zip(files, sweeps, strict=True):
        if file.time_utc is None:
            raise UsageError(
                f"{file.path} does not say when it was taken (DATE-OBS or EXIF), and polar"
                " alignment needs the time."
            )
        if isinstance(file.result, Solution):
            label = Path(file.path).name
            sightings.append(Sighting.of(file.result, file.time_utc, label, sweep))
    return sightings if len(set(sweeps)) > 1 else _by_declination(sightings)


def _by_declination(sightings: list[Sighting]) -> list[Sighting]:
    """The same as two sweeps, when two groups of two or more stand far apart in declination."""
    ordered = sorted(sightings, key=_declination_deg)
    gaps = [_declination_deg(b) - _declination_deg(a) for a, b in pairwise(ordered)]
    if not gaps or max(gaps) < APART_DEG:
        return sightings
    cut = gaps.index(max(gaps)) + 1
    groups = ordered[:cut], ordered[cut:]
    within = (_declination_deg(g[-1]) - _declination_deg(g[0]) for g in groups)
    if min(map(len, groups)) < 2 or max(within) > APART_DEG:
        return sightings
    second = groups[sightings[0] in groups[0]]
    return [replace(s, sweep=1) if s in second else s for s in sightings]


def _declination_deg(sighting: Sighting) -> float:
    return sighting.attitude.ra_dec_deg[1]


def site_of(files: Sequence[SolvedFile], given: Site | None = None) -> Site:
    """Where the frames were taken: as ``given``, or as they all say themselves.

    Raises
    ------
    UsageError
        Nobody says it, or two frames disagree.

    """
    if given is not None:
        return given
    told = [(file.path, file.site) for file in files if file.site is not None]
    if not told:
        raise UsageError(
            "The frames do not say where they were taken: give --site LAT,LON in degrees, east"
            " positive."
        )
    first_path, first = told[0]
    for path, site in told[1:]:
        apart = abs(site.latitude_deg - first.latitude_deg)
        around = (site.longitude_deg - first.longitude_deg + 180.0) % 360.0 - 180.0
        if max(apart, abs(around)) > SAME_SITE_DEG:
            raise UsageError(f"{first_path} and {path} come from different places: give --site.")
    return first


class CameraSightings:
    """Frames of an opened camera, solved as they come, near the last answer first.

    ``clock`` gives the time of frames that carry none.
    """

    def __init__(
        self,
        camera: CameraSource,
        options: SolveOptions | None = None,
        clock: Callable[[], datetime] | None = None,
    ) -> None:
        self._camera = camera
        self._options = options or SolveOptions(timeout_s=10.0)
        self._clock = clock
        self._last: Solution | None = None
        self._near_last = False

    def sight(self) -> Task[Sighting | NoSolution | None]:
        """Wait a little for the newest frame and solve it."""
        yield Progress("wait for a frame")
        frame = self._camera.next_frame(FRAME_TIMEOUT_S)
        if frame is None:
            return None
        moment = self._time_of(frame)
        solved = yield from solve_open_frame(frame, self._near(frame))
        if isinstance(solved.result, NoSolution):
            self._near_last = False  # an axis may have been turned further than that
            return solved.result
        self._last, self._near_last = solved.result, True
        return Sighting.of(solved.result, moment)

    def _time_of(self, frame: Frame) -> datetime:
        if frame.hint.time_utc is not None:
            return frame.hint.time_utc
        if self._clock is None:
            raise UsageError("The camera's frames do not say when they were taken.")
        return self._clock()

    def _near(self, frame: Frame) -> SolveOptions:
        """The options with the last answer as a hint: a bolt or a turn moves it only so far.

        After a frame without an answer only its scale is kept.
        """
        if self._last is None:
            return self._options
        scale = self._last.camera.scale_arcsec_px
        hint = replace(
            self._options.hint or frame.hint, scale_arcsec_px=(scale * 0.97, scale * 1.03)
        )
        if self._near_last:
            hint = replace(hint, centre_deg=(*self._last.ra_dec_deg, NEAR_DEG))
        return replace(self._options, hint=hint)
