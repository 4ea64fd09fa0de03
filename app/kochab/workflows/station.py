"""A camera that stands still, night after night: calibrated from solved frames, then how much of a frame is cloud.

Cloud is where stars are missing that a clear night shows. What a clear night shows is learnt in the frames of the
calibration: how faint stars are seen for sure, what share of the brighter ones, and from which altitude on trees and
houses leave the sky free.
"""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from kochab.core.arrays import Bools, Floats, Table
from kochab.core.errors import UsageError
from kochab.core.frame import Detections, Frame, Site
from kochab.core.progress import Progress, Task
from kochab.core.robust import median
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import frozen
from kochab.detection.auto import AutoDetector
from kochab.detection.star_fit import FWHM_PER_SIGMA
from kochab.detection.windows import look
from kochab.frames import reading
from kochab.sky import open_catalogue
from kochab.sky.horizon import Horizon, air_masses, sun_altitude_deg
from kochab.solver import SolveOptions
from kochab.solver.fixed_camera import FixedCamera, StarsOfFrame, azimuth_altitude_deg, calibrated, directions_of
from kochab.solver.matches import without_companions
from kochab.solver.pipeline import solve_detections, year_of
from kochab.text.translation import tr
from kochab.workflows.solve_frame import solve_open_frame

if TYPE_CHECKING:
    from PIL.Image import Image

EXTINCTION_MAG = 0.25
"""Approximate extinction in V per air mass of clear air at sea level."""
STARS = 5000
NEAREST_PX, FARTHEST_PX, LEAST_SNR = 2.5, 8.0, 7.0
NUDGE = 0.02
"""How far beside each star light is looked for too, over the larger side: what is found there is chance."""
OPEN_DEG = 30.0
"""Above this trees and houses hide little: there the limit is measured."""
SURE, STEP_MAG, CLEAR_MAG = 0.9, 0.25, 1.0
"""The limit is where this share of the brighter stars is seen; stars so much brighter than it tell cloud."""
BIN_DEG, FEWEST_IN_BIN = 15.0, 4
MARGIN_DEG = 2.0
FEWEST_TO_TELL = 12
DARK_DEG = -9.0
SUSPECT = 0.6
"""Where fewer of the expected stars are seen than this share, the frame is solved: the camera may have moved."""
SECTORS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")
HIGH_DEG = 60.0


@frozen(eq=False)
class Sightings(Table):
    """Stars of the catalogue in a frame: ``xy`` (N, 2) px where they should be, altitude and azimuth, degrees.

    ``mag`` is V as dimmed by clear air, ``seen`` whether there is light like a star's; ``by_chance`` is the share of
    places with such light where no star need be, as looking beside the stars' places shows it.
    """

    xy: Floats
    azimuth_deg: Floats
    altitude_deg: Floats
    mag: Floats
    seen: Bools
    by_chance: float


@frozen
class Cloud:
    """What share of a part of the sky is cloud, one sigma, and of how many stars; None where too few would show."""

    share: float | None
    sigma: float | None
    stars: int


@frozen(eq=False)
class SkyCover:
    """Cloud over a frame: in all, above 60 degrees ("zenith"), and in eight directions below."""

    file: str
    time_utc: datetime
    whole: Cloud
    parts: dict[str, Cloud]
    sightings: Sightings


def calibrate(
    name: str, files: Sequence[str], site: Site | None, options: SolveOptions, time_utc: datetime | None = None
) -> Task[tuple[FixedCamera, tuple[str, ...]]]:
    """Solve the frames and fit one fixed camera to them; also returned: sentences about frames left out.

    Parameters
    ----------
    name : str
        What the camera is called.
    files : Sequence[str]
        Frames of clear nights.
    site : Site or None
        Where it stands; None for what the first frame's header says.
    options : SolveOptions
        How they are solved.
    time_utc : datetime or None
        When a single frame was taken that does not say it.

    Raises UsageError where a frame has no time or site, or they do not belong together.
    """
    taken: list[tuple[str, Detections, Horizon]] = []  # not the pixels: a night of them would fill the memory
    stars: list[StarsOfFrame] = []
    left: list[str] = []
    for k, file in enumerate(files):
        yield Progress("solve", 0.7 * k / len(files), file)
        frame = yield from reading(file, options.timeout_s)
        site = site or frame.hint.site
        horizon = _horizon(file, frame, site, time_utc)
        solved = yield from solve_open_frame(frame, options)
        if isinstance(solved.result, NoSolution):
            left.append(tr("{file} was left out: {reason}.", file=file, reason=solved.result.reason))
            continue
        stars.append(StarsOfFrame.of(file, solved.result, horizon))
        taken.append((file, solved.detections, horizon))
    if not stars or site is None:
        raise UsageError("No frame was solved: {left}", left=" ".join(left))
    yield Progress("fit", 0.7)
    camera = calibrated(name, site, stars)
    seen = []
    for k, (file, detections, horizon) in enumerate(taken):
        yield Progress("look", 0.7 + 0.3 * k / len(taken), file)
        frame = yield from reading(file, options.timeout_s)
        seen.append(sightings(camera, frame, detections, horizon))
    return with_clear_sky(camera, seen), tuple(left)


def _horizon(file: str, frame: Frame, site: Site | None, time_utc: datetime | None) -> Horizon:
    when = time_utc or frame.hint.taken_utc
    if when is None:
        raise UsageError("{file} does not say when it was taken: give it with --time, in UTC.", file=file)
    if site is None:
        raise UsageError("{file} does not say where it was taken: give it with --site.", file=file)
    return Horizon(site, when)


def sightings(camera: FixedCamera, frame: Frame, detections: Detections, horizon: Horizon) -> Sightings:
    """Which stars of the catalogue a frame shows at their places.

    Parameters
    ----------
    camera : FixedCamera
        Where stars should be.
    frame : Frame
        Its light is looked at.
    detections : Detections
        Of the frame: they tell how wide its stars are.
    horizon : Horizon
        When it was taken, at the camera's site.
    """
    catalogue, year = open_catalogue(), year_of(horizon.time_utc)
    zenith = horizon.catalogue(np.array([[0.0, 0.0, 1.0]]))[0]
    rows = catalogue.brightest(zenith, np.pi / 2.0, STARS, year)
    directions = horizon.observed(catalogue.vectors(rows, year))
    azimuth, altitude = azimuth_altitude_deg(directions)
    xy = camera.pixels(directions)
    there = np.flatnonzero((altitude > 0.0) & np.isfinite(xy[:, 0]))
    mag = np.asarray(catalogue.mag(rows), dtype=np.float64) + EXTINCTION_MAG * (air_masses(altitude) - 1.0)
    reach = float(np.clip(4.0 * np.hypot(camera.rms_px, camera.model_px), NEAREST_PX, FARTHEST_PX))
    order = there[np.argsort(mag[there], kind="stable")]
    order = order[without_companions(xy[order], 3.0 * reach)]  # beside a brighter one a star is hard to tell
    xy = xy[order]
    turn = np.arange(len(xy)) * 2.4  # a different way for each star
    beside = xy + NUDGE * max(detections.width, detections.height) * np.column_stack([np.cos(turn), np.sin(turn)])
    width_px = detections.usual_fwhm_px(1.5) or 3.0
    return Sightings(
        xy,
        azimuth[order],
        altitude[order],
        mag[order],
        _lit(frame, xy, reach, width_px),
        float(_lit(frame, beside, reach, width_px).mean()) if len(xy) else 0.0,
    )


def _lit(frame: Frame, places: Floats, reach_px: float, width_px: float) -> Bools:
    """At which places (N, 2) px light like a star's stands out, no farther off than ``reach_px``.

    A detector passes by every fifth star that is plain to see where one looks for it: beside others, on a slope.
    """
    image = np.eye(2) * (width_px / FWHM_PER_SIGMA) ** 2
    there = look(frame, places, int(np.ceil(2.0 * reach_px)), image)
    near = np.hypot(*(there.xy - places).T) <= reach_px
    return np.asarray(there.found & (there.snr > LEAST_SNR) & near, dtype=np.bool_)


# -- What a clear night shows --------------------------------------------------------------------


def with_clear_sky(camera: FixedCamera, frames: Sequence[Sightings]) -> FixedCamera:
    """The camera with the limit, the share of stars seen and the free horizon that frames of clear nights show."""
    chance = float(np.mean([one.by_chance for one in frames]))
    every = Sightings.joined(frames)
    open_sky = every.take(every.altitude_deg > OPEN_DEG)
    limit = _limit_mag(open_sky)
    if limit is None:
        return camera
    bright = every.take(every.mag < limit)
    high = bright.take(bright.altitude_deg > OPEN_DEG)
    seen = float(high.seen.mean())
    azimuths = np.arange(0.0, 360.0, BIN_DEG) + BIN_DEG / 2.0
    lowest = np.array([_free_from(bright, azimuth, seen, chance) for azimuth in azimuths])
    camera = replace(camera, limit_mag=limit, horizon_deg=np.column_stack([azimuths, lowest]))
    free = telling(camera, every)
    return replace(camera, seen=float(free.seen.mean()) if len(free.seen) else seen)


def _limit_mag(stars: Sightings) -> float | None:
    """The faintest V, zenith, to which :data:`SURE` of the stars are seen; None when there is none."""
    steps = np.arange(0.0, 12.0, STEP_MAG)
    limits = [float(step) for step in steps if (stars.mag < step).sum() >= FEWEST_TO_TELL]
    clear = [limit for limit in limits if stars.seen[stars.mag < limit].mean() >= SURE]
    return max(clear) if clear else None


def _free_from(stars: Sightings, azimuth_deg: float, seen: float, chance: float) -> float:
    """The altitude, degrees, at that azimuth from which stars are seen: where the likelihood of one step is highest."""
    away = np.abs((stars.azimuth_deg - azimuth_deg + 180.0) % 360.0 - 180.0)
    near = stars.take(away < BIN_DEG)
    if len(near.seen) < FEWEST_IN_BIN:
        return 0.0
    order = np.argsort(near.altitude_deg)
    altitude, hit = near.altitude_deg[order], near.seen[order]
    free, hidden = np.clip([seen, chance], 0.02, 0.98)
    above = np.where(hit, np.log(free), np.log(1.0 - free))
    below = np.where(hit, np.log(hidden), np.log(1.0 - hidden))
    # the step stands just below star k: all from it on are seen, those before hidden
    likelihood = np.concatenate([[0.0], np.cumsum(below)]) + np.concatenate([np.cumsum(above[::-1])[::-1], [0.0]])
    k = int(likelihood.argmax())
    return float(altitude[k]) if k < len(altitude) else 90.0


def telling(camera: FixedCamera, stars: Sightings) -> Sightings:
    """The stars that a clear night shows for sure: bright enough, and above trees and houses."""
    assert camera.limit_mag is not None
    free = stars.altitude_deg > camera.free_from_deg(stars.azimuth_deg) + MARGIN_DEG
    return stars.take(free & (stars.mag < camera.limit_mag - CLEAR_MAG))


# -- Cloud ---------------------------------------------------------------------------------------


def sky_cover(camera: FixedCamera, file: str, time_utc: datetime | None = None) -> Task[SkyCover]:
    """How much of a frame is cloud.

    Parameters
    ----------
    camera : FixedCamera
        The camera that took it, calibrated on clear nights.
    file : str
        The frame.
    time_utc : datetime or None
        When it was taken, where it does not say it.

    Raises UsageError where it cannot be told: by day, without a time, with a camera that has moved.
    """
    yield Progress("read", 0.0, file)
    frame = yield from reading(file, None)
    horizon = _horizon(file, frame, camera.site, time_utc)
    if camera.limit_mag is None or camera.seen is None:
        raise UsageError("The frames that calibrated {name} show no clear sky to compare with.", name=camera.name)
    if (frame.pixels.shape[1], frame.pixels.shape[0]) != (camera.camera.width, camera.camera.height):
        raise UsageError("{file} is not as large as the frames that calibrated {name}.", file=file, name=camera.name)
    if (sun := sun_altitude_deg(camera.site, horizon.time_utc)) > DARK_DEG:
        raise UsageError(
            "{file}: the Sun was at {sun:.0f} deg: the sky is too bright to tell cloud by stars.", file=file, sun=sun
        )
    yield Progress("detect", 0.3, file)
    detections = AutoDetector().detect(frame)
    stars = sightings(camera, frame, detections, horizon)
    sure = telling(camera, stars)
    if len(sure.seen) < FEWEST_TO_TELL:
        raise UsageError("{file}: too few stars are expected to tell cloud by them.", file=file)
    if sure.seen.mean() < SUSPECT * camera.seen and (moved := (yield from _moved_px(camera, detections, horizon))):
        raise UsageError(
            "{file}: the camera has moved by {px:.0f} px since it was calibrated: calibrate it again.",
            file=file,
            px=moved,
        )
    high = sure.altitude_deg > HIGH_DEG
    sector = ((sure.azimuth_deg + 22.5) % 360.0 // 45.0).astype(int)
    parts = {"zenith": cloud_of(sure.take(high), camera.seen)}
    parts |= {word: cloud_of(sure.take(~high & (sector == k)), camera.seen) for k, word in enumerate(SECTORS)}
    return SkyCover(file, horizon.time_utc, cloud_of(sure, camera.seen), parts, sure)


def cloud_of(stars: Sightings, clear: float) -> Cloud:
    """The share of cloud that missing stars mean, where ``clear`` of them are seen without any.

    One sigma is the binomial's of Agresti and Coull (1998), American Statistician 52, 119: never zero.
    """
    n = len(stars.seen)
    if n < 3:
        return Cloud(None, None, n)
    share, q = float(stars.seen.mean()), min(stars.by_chance, 0.5 * clear)
    around = (n * share + 2.0) / (n + 4.0)
    cloud = 1.0 - (share - q) / (clear - q)
    sigma = np.sqrt(around * (1.0 - around) / (n + 4.0)) / (clear - q)
    return Cloud(float(np.clip(cloud, 0.0, 1.0)), float(sigma), n)


def _moved_px(camera: FixedCamera, detections: Detections, horizon: Horizon) -> Task[float]:
    """By how far stars stand from where the camera should have them, px; 0 when they do not, or cannot be solved."""
    yield Progress("solve", 0.6)
    result = yield from solve_detections(detections, SolveOptions())
    if not isinstance(result, Solution):
        return 0.0
    expected = camera.pixels(horizon.observed(result.star_vectors))
    off = result.stars_px - expected
    there = np.isfinite(off[:, 0])
    if there.sum() < len(off) / 2:
        return float(max(detections.width, detections.height))
    shift = float(np.hypot(median(off[there, 0]), median(off[there, 1])))
    spread = median(np.hypot(*off[there].T))
    return max(shift, spread) if max(shift, spread) > NEAREST_PX else 0.0


# -- Drawn ---------------------------------------------------------------------------------------

FOUND, MISSING, EDGE_OF_SKY = "#62d6ff", "#ff7a5c", "#84c9a2"


def picture_of_cover(frame: Frame, camera: FixedCamera, cover: SkyCover) -> "Image":
    """The frame with a ring around each star that should show, seen or missing, and the free horizon as a line."""
    from PIL import ImageDraw

    from kochab.workflows.annotated_image import EDGE, font_of, picture_of

    picture = picture_of(frame)
    draw, unit = ImageDraw.Draw(picture), max(picture.size) / 1200.0
    line = max(1, round(1.5 * unit))
    for (x, y), seen in zip(cover.sightings.xy, cover.sightings.seen, strict=True):
        r = (6.0 if seen else 9.0) * unit
        draw.ellipse((x - r, y - r, x + r, y + r), outline=FOUND if seen else MISSING, width=line)
    azimuth = np.arange(0.0, 361.0)
    edge = camera.pixels(directions_of(azimuth, np.maximum(camera.free_from_deg(azimuth), 0.0)))
    for a, b in pairwise(edge):
        if np.isfinite([*a, *b]).all():
            draw.line((*a, *b), fill=EDGE_OF_SKY, width=line)
    font = font_of(max(12, round(16 * unit)))
    for k, word in enumerate(SECTORS):
        (spot,) = camera.pixels(directions_of(np.array([45.0 * k]), np.array([4.0])))
        if np.isfinite(spot).all():
            draw.text(tuple(spot), word, fill=EDGE_OF_SKY, font=font, anchor="mm", stroke_width=2, stroke_fill=EDGE)
    return picture
