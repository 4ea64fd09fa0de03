"""Solved frames for polar alignment, and waiting until they show a mount at rest."""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from kochab.core.attitude import ARCSEC, rotation_vector, wrapped
from kochab.core.capture import CameraSource
from kochab.core.errors import KochabError, UsageError
from kochab.core.frame import Frame, Site
from kochab.core.mount import SIDEREAL_DEG_S
from kochab.core.progress import Progress, Task, without_preparing
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import frozen
from kochab.folders import config_folder
from kochab.frames.atomic_file import write_atomically
from kochab.frames.hints import NO_ZONE, Aim, aim_from_keywords, aware_utc, zone_from_keywords
from kochab.parsing.text_input import TextError, read_json, read_text
from kochab.polar.bolts import Pitches
from kochab.polar.error import PolarError, angle_in_words
from kochab.polar.measure import NIGHT_HOURS, MeasureSettings
from kochab.polar.sighting import LocalAttitude, Sighting, to_local
from kochab.solver import SolveOptions
from kochab.text.translation import tr, tr_noop
from kochab.workflows.polar.update import PolarButton, PolarControls, PolarUpdate
from kochab.workflows.solve_frame import solve_file, solve_open_frame

NEAR_DEG = 20.0
SAME_SITE_DEG = 0.1
FRAME_TIMEOUT_S = 2.0
ZONES_S, FARTHEST_ZONE_S = 900.0, 15.0 * 3600.0
GIVE_SITE = tr_noop("give --site LAT,LON in degrees, east positive")
UNSIGNED = ("LONG-OBS", "OBSLONG", "LONGITUD", "OBS-LONG", "LONG", "GEOLON")

APART_DEG = 12.0  # one sweep of an axis up to 5 deg from its pole spreads by no more than 10 in declination


class SightingSource(Protocol):
    """Gives one solved frame after the other, the newest each time."""

    def sight(self) -> Task[Sighting | NoSolution | None]:
        """The next frame, why it has no solution, or None when none came yet."""


@frozen(eq=False)
class SolvedFile:
    """A frame's file, its time and site, and its solution.

    ``unsigned`` is a longitude that may be west, ``aim`` what the header says of the horizon,
    ``zone_h`` how far its local time is ahead of UTC.
    """

    path: str
    result: Solution | NoSolution
    time_utc: datetime | None
    site: Site | None
    warnings: tuple[str, ...] = ()
    unsigned: str = ""
    aim: Aim | None = None
    zone_h: float | None = None


def solve_polar_file(path: str | Path, options: SolveOptions) -> Task[SolvedFile]:
    """Solve one file and keep what polar alignment needs of it."""
    solved = yield from solve_file(path, options)
    hint = solved.frame.hint
    time_utc = hint.time_utc or sharpcap_time(Path(path))
    header = solved.frame.header
    from_header = unsigned_longitude(header), aim_from_keywords(header), zone_from_keywords(header)
    return SolvedFile(str(path), solved.result, time_utc, hint.site, solved.frame.warnings, *from_header)


def sharpcap_time(path: Path) -> datetime | None:
    """When a picture was taken, of what SharpCap 3 wrote beside it: ``NAME.CameraSettings.txt`` with ``TimeStamp=``."""
    try:
        text = read_text(path.with_name(f"{path.stem}.CameraSettings.txt"))
    except TextError:
        return None
    stamp = re.search(r"^TimeStamp=(\S+)", text, re.MULTILINE)
    return aware_utc(stamp[1]) if stamp else None


def unsigned_longitude(header: Mapping[str, Any]) -> str:
    """The keyword of a positive longitude that may as well be meant west; FITS' own OBSGEO-L is east."""
    if "SITELONG" in header or "OBSGEO-L" in header:
        return ""
    header_times = ((name, str(header[name]).strip()) for name in UNSIGNED if name in header)
    return next(
        (f"{name} {text}" for name, text in header_times if re.fullmatch(r"\d[\d\s:.]*", text) and text.strip("0:. ")),
        "",
    )


def sightings_of(files: Sequence[SolvedFile], sweeps: Sequence[int]) -> list[Sighting]:
    """The sightings of files that are all solved.

    Frames given as one sweep, but at two declinations far apart, are taken as two.

    Raises UsageError when a frame has no time.
    """
    sightings = []
    for file, sweep in zip(files, sweeps, strict=True):
        if file.time_utc is None:
            raise UsageError("{path} has no time (DATE-OBS or EXIF). Polar alignment needs it.", path=file.path)
        if isinstance(file.result, Solution):
            sightings.append(Sighting.of(file.result, file.time_utc, Path(file.path).name, sweep))
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
    second = groups[sightings[0] in groups[0]]  # the one that does not hold the first frame
    return [replace(s, sweep=1) if s in second else s for s in sightings]


def _declination_deg(sighting: Sighting) -> float:
    return sighting.attitude.ra_dec_deg[1]


def site_of(files: Sequence[SolvedFile], given: Site | None = None, how: str = GIVE_SITE) -> Site:
    """Where the frames were taken: as ``given``, or as all their headers say.

    Raises UsageError when no frame has a site, or two disagree; ``how`` says what to do then.
    """
    if given is not None:
        return given
    site_files = [(file.path, file.site) for file in files if file.site is not None]
    if not site_files:
        raise UsageError("The frames have no site: {how}.", how=tr(how))
    first_path, first = site_files[0]
    for path, site in site_files[1:]:
        apart = abs(site.latitude_deg - first.latitude_deg)
        around = wrapped(site.longitude_deg - first.longitude_deg)  # 180° east is 180° west
        if max(apart, abs(around)) > SAME_SITE_DEG:
            raise UsageError(
                "{one} and {other} were taken at different sites: {how}.", one=first_path, other=path, how=tr(how)
            )
    return first


class CameraSightings:
    """Frames of an opened camera, solved as they come, near the last solution first.

    ``clock`` gives the time of frames that carry none, and the zone of times that have none; ``ahead_s`` is how far the
    newest frame's own time is ahead of it then. ``seen`` hears of every frame, with its solution or None.
    """

    def __init__(
        self,
        camera: CameraSource,
        options: SolveOptions | None = None,
        clock: Callable[[], datetime] | None = None,
        seen: Callable[[Frame, Solution | None], None] = lambda frame, solution: None,
    ) -> None:
        self._camera, self._seen = camera, seen
        self._options = options or SolveOptions(timeout_s=10.0)
        self._clock = clock
        self._last: Solution | None = None
        self._near_last = False
        self.ahead_s = 0.0

    def sight(self) -> Task[Sighting | NoSolution | None]:
        """Wait a little for the newest frame and solve it."""
        yield Progress("wait for a frame")
        frame = self._camera.next_frame(FRAME_TIMEOUT_S)
        if frame is None:
            return None
        moment = self._time_of(frame)
        task = solve_open_frame(frame, self._near(frame))
        # Once its field was solved, a frame that is trailed or elsewhere has no use for the index of small fields.
        solved = yield from (task if self._last is None else without_preparing(task))
        if solved is None:
            self._near_last = False  # an axis may have been turned further than that
            self._seen(frame, None)
            return None
        self._seen(frame, None if isinstance(solved.result, NoSolution) else solved.result)
        if isinstance(solved.result, NoSolution):
            self._near_last = False  # an axis may have been turned further than that
            return solved.result
        self._last, self._near_last = solved.result, True
        return Sighting.of(solved.result, moment)

    def _time_of(self, frame: Frame) -> datetime:
        if (own := frame.hint.time_utc) is not None:
            if self._clock is not None and not frame.hint.time_of_file:
                # a frame comes when its exposure ends, half of it after its own time
                ahead_s = (own - self._clock()).total_seconds() + (frame.hint.exposure_s or 0.0) / 2.0
                in_zones = NO_ZONE in frame.warnings and abs(ahead_s) < FARTHEST_ZONE_S
                # time zones are multiples of a quarter of an hour: what is left over is the clock
                zone_s = ZONES_S * round(ahead_s / ZONES_S) if in_zones else 0.0
                own, self.ahead_s = own - timedelta(seconds=zone_s), ahead_s - zone_s
            return own
        if self._clock is None:
            raise UsageError("The camera's frames have no time.")
        return self._clock()

    def _near(self, frame: Frame) -> SolveOptions:
        """The options with the last solution as a hint: a bolt or a turn moves it only so far.

        After a frame without a solution only its scale is kept.
        """
        if self._last is None:
            return self._options
        scale = self._last.camera.scale_arcsec_px
        hint = replace(self._options.hint or frame.hint, scale_arcsec_px=(scale * 0.97, scale * 1.03))
        if self._near_last:
            hint = replace(hint, centre_deg=(*self._last.ra_dec_deg, NEAR_DEG))
        return replace(self._options, hint=hint)


# -- A tripod on the same marks: where its axis stood when it was last measured there ------------

NIGHTS_FILE, MOST_NIGHTS = "polar-nights.json", 50
SAME_PLACE_DEG = 0.01


@frozen
class PolarNight:
    """What was last measured at a place with an equipment profile ("" for none); arcsec, as a measurement says them."""

    latitude_deg: float
    longitude_deg: float
    profile: str
    time_utc: str
    altitude_arcsec: float
    azimuth_arcsec: float
    bolts_arcsec: Pitches = (None, None)

    def __str__(self) -> str:
        text = tr("{angle} too high") if self.altitude_arcsec > 0 else tr("{angle} too low")
        up = text.format(angle=angle_in_words(self.altitude_arcsec))
        clockwise = self.azimuth_arcsec > 0
        text = tr("{angle} too far clockwise") if clockwise else tr("{angle} too far anticlockwise")
        side = tr("{angle}, seen from above", angle=text.format(angle=angle_in_words(self.azimuth_arcsec)))
        return f"{self.time_utc[:10]}: {up}, {side}"

    @property
    def guess(self) -> str:
        """Where the axis stands tonight, more or less."""
        text = tr("Last measured here, {night}. Tonight about the same, if the tripod stands on the same marks.")
        return text.format(night=self)


def last_night(site: Site, profile: str = "", before: datetime | None = None) -> PolarNight | None:
    """The night remembered for a place, or None; only one that ended hours ``before``, when given."""
    hours = timedelta(hours=NIGHT_HOURS)
    for night in _nights():
        there = abs(night.latitude_deg - site.latitude_deg) < SAME_PLACE_DEG
        around = abs(wrapped(night.longitude_deg - site.longitude_deg)) < SAME_PLACE_DEG
        if there and around and night.profile == profile:
            earlier = before is None or before - datetime.fromisoformat(night.time_utc) > hours
            return night if earlier else None
    return None


def remember_night(
    site: Site, profile: str, time_utc: datetime, error: PolarError, bolts: Pitches = (None, None)
) -> None:
    """Keep a measurement for another night, instead of an earlier one there; raises OSError when that can't be.

    Parameters
    ----------
    site : Site
        Where it was made.
    profile : str
        Name of the equipment.
    time_utc : datetime
        When it was made.
    error : PolarError
        The polar error.
    bolts : Pitches
        Arcseconds a turn of azimuth and altitude; None: what was known of that bolt stays.
    """
    last, place = last_night(site, profile), (site.latitude_deg, site.longitude_deg)
    if last is not None:
        bolts = (bolts[0] or last.bolts_arcsec[0], bolts[1] or last.bolts_arcsec[1])
    now = PolarNight(*place, profile, time_utc.isoformat(), error.altitude_arcsec, error.azimuth_arcsec, bolts)
    if last is None or last.time_utc <= now.time_utc:
        kept = [now, *(night for night in _nights() if night != last)][:MOST_NIGHTS]
        config_folder().mkdir(parents=True, exist_ok=True)
        write_atomically(config_folder() / NIGHTS_FILE, json.dumps([asdict(night) for night in kept]))


def _nights() -> list[PolarNight]:
    nights = []
    with suppress(ValueError, TypeError):
        for fields in read_json(config_folder() / NIGHTS_FILE):
            with suppress(ValueError, TypeError, OverflowError):  # spoilt, or another version's: the others still hold
                night = PolarNight(**fields)
                datetime.fromisoformat(night.time_utc).astimezone(UTC)
                altitude, azimuth = (bolt or 0.0 for bolt in night.bolts_arcsec)
                error = (night.altitude_arcsec, night.azimuth_arcsec, altitude, azimuth)
                if np.isfinite([night.latitude_deg, night.longitude_deg, *error]).all():
                    nights.append(night)
    return nights


# -- Waiting for frames that show a mount at rest ----------------------------------------------

STILL_ARCSEC, SIGMAS, SEEN_DEG = 30.0, 5.0, 0.3  # of rest; of a turn, below which no axis can be measured
MOST_EMPTY = 40  # frames without a solution, or waits without a frame, before a measurement is given up


class NotMeasuredError(KochabError):
    """A measurement that failed; one sentence with what to do."""


class RestWatch:
    """Attitudes of a source's frames in E, N, U, and waiting until the mount is at rest."""

    def __init__(self, source: SightingSource, settings: MeasureSettings, controls: PolarControls) -> None:
        self.settings = settings
        self.controls = controls
        self._source = source

    def next(self, patient: bool = False) -> Task[LocalAttitude]:
        """The attitude of the next solved frame, as :meth:`sighting` gives it."""
        return to_local((yield from self.sighting(patient)), self.settings.site, self.settings.refraction)

    def sighting(self, patient: bool = False) -> Task[Sighting]:
        """The next solved frame; ``patient`` waits for ever, as for a hand.

        Raises NotMeasuredError when too many frames in a row have no solution, or none come.
        """
        empty = 0
        while True:
            found = yield from self._source.sight()
            if found is not None and not isinstance(found, NoSolution):
                return found
            empty += 1
            why = tr("The camera sends no frames.")
            if isinstance(found, NoSolution):
                why = tr("No solution ({reason}): {advice}", reason=tr(found.reason), advice=found.advice)
            if empty > MOST_EMPTY and not patient:
                raise NotMeasuredError(why)
            yield PolarUpdate("measure", None, why, solved=False)

    def still(self, before: LocalAttitude | None = None, turn_deg: float = 0.0) -> Task[LocalAttitude]:
        """The first attitude like the one before it, but for tracking.

        With ``turn_deg`` only one that has turned by half of that, at least, since ``before``: so
        a person need not confirm the turn. Who does is heard even while the axis still moves, and confirms
        a shorter turn, but not frames that show none: they were exposed before it.
        """
        last: LocalAttitude | None = None
        pressed = False
        while True:
            now = yield from self.next(patient=turn_deg > 0.0)
            turned = turned_deg(before, now) if before is not None else 0.0
            pressed = self.controls.take(PolarButton.TURNED) or pressed  # taken even where the frames show the turn
            least_deg = min(0.5 * turn_deg, SEEN_DEG if pressed else turn_deg)
            if turned >= least_deg and last is not None and at_rest(last, now):
                return now
            if turn_deg:
                how_far = tr("{turned:.0f}° of {whole:.0f}°", turned=turned, whole=turn_deg)
                yield PolarUpdate("turn", min(1.0, turned / turn_deg), how_far)
            last = now

    def rest(self, first: LocalAttitude, place: int, frames: int) -> Task[list[LocalAttitude]]:
        """``first`` and more frames of the same place, ``frames`` in all, as long as nothing moves."""
        seen = [replace(first, place=place)]
        while len(seen) < frames and not self.controls.pressed(PolarButton.ENOUGH):
            yield PolarUpdate("measure", None, tr("Frame {n} of {frames} here.", n=len(seen) + 1, frames=frames))
            now = yield from self.next()
            if not at_rest(seen[-1], now):
                break
            seen.append(replace(now, place=place))
        return seen


def turned_deg(first: LocalAttitude, second: LocalAttitude) -> float:
    """The angle of the rotation between two attitudes."""
    return float(np.degrees(np.linalg.norm(rotation_vector(second.matrix @ first.matrix.T))))


def at_rest(first: LocalAttitude, second: LocalAttitude) -> bool:
    """Whether two frames differ by no more than tracking, or standing still, and their errors."""
    seconds = abs((second.time_utc - first.time_utc).total_seconds())
    sigma = np.sqrt(np.trace(first.covariance + second.covariance)) / ARCSEC
    allowed = STILL_ARCSEC + 3600.0 * SIDEREAL_DEG_S * seconds + SIGMAS * float(sigma)
    return turned_deg(first, second) * 3600.0 <= allowed
