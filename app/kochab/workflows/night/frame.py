"""One frame of a night: solved, and everything measured of it that the night is made of."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from kochab.core.attitude import angle_between
from kochab.core.frame import Detections, Frame, Site
from kochab.core.mount import Epoch, PierSide
from kochab.core.progress import Task
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.frames import reading
from kochab.frames.samples import number_or_none
from kochab.frames.stretch import apply, debayer_preview, stretch_parameters, white_balanced
from kochab.polar.sighting import Sighting
from kochab.sky.solar_system import Moving
from kochab.solver import SolveOptions
from kochab.workflows.night.chosen_stars import ChosenStar, StarInFrame, stars_in_frame
from kochab.workflows.night.crossings import Crossing, crossings_of
from kochab.workflows.night.sharpness import Sharpness, sharpness
from kochab.workflows.night.sky_brightness import DarkLevel, StarsOnSky, dark_level, paired_stars, stars_on_sky
from kochab.workflows.night.strangers import Sights, sights_of
from kochab.workflows.night.transparency import StarLight
from kochab.workflows.polar.sources import sharpcap_time
from kochab.workflows.solve_frame import SolvedFrame, solve_open_frame

THUMBNAIL_PX = 360
SAME_PX = 0.5
"""Within this a matched star is a detection."""
SETUP = ("INSTRUME", "FILTER", "GAIN", "XBINNING")
CALIBRATION = ("dark", "darkflat", "flat", "bias", "offset", "masterdark", "masterflat", "masterbias")
"""First words of IMAGETYP, in lower case."""
BRIGHTEST = 200
"""Stars of a frame whose light is compared with other frames."""


@frozen
class Sky:
    """Geometric altitudes of field, Moon and Sun, degrees; the Moon's distance from the field and its lit share."""

    altitude_deg: float
    moon_altitude_deg: float
    moon_distance_deg: float
    moon_lit: float
    sun_altitude_deg: float

    @property
    def airmass(self) -> float:
        """Air masses in the direction of the field's middle."""
        from kochab.sky.horizon import air_masses

        return float(air_masses(np.array(self.altitude_deg)))


@frozen(eq=False)
class NightFrame:
    """What is kept of a frame. ``ra_deg``, ``dec_deg`` (ICRS) and the scale are NaN where it was not solved.

    ``error`` is why it could not be read at all, ``reason`` why there is no solution; ``light`` is None for frames
    whose numbers are not proportional to light (finished 8 bit pictures), ``on_sky`` for those too. ``thumbnail`` is a
    JPEG; ``dark`` the level of a calibration frame. ``reported_deg`` is where the header has the mount, RA and Dec, of
    ``epoch`` if it says so, and ``pier_side`` where its tube was.
    """

    file: str
    time_utc: datetime | None = None
    exposure_s: float | None = None
    size: tuple[int, int] = (0, 0)
    solved: bool = False
    reason: str = ""
    error: str = ""
    ra_deg: float = float("nan")
    dec_deg: float = float("nan")
    roll_deg: float = float("nan")
    width_deg: float = float("nan")
    scale_arcsec_px: float = float("nan")
    detections: int = 0
    sharp: Sharpness | None = None
    light: StarLight | None = None
    sky: Sky | None = None
    site: Site | None = None
    sighting: Sighting | None = None
    thumbnail: bytes = b""
    camera: str = ""
    setup: str = ""
    calibration: bool = False
    crossings: tuple[Crossing, ...] = ()
    sights: Sights | None = None
    on_sky: StarsOnSky | None = None
    dark: DarkLevel | None = None
    chosen: tuple[StarInFrame, ...] = ()
    reported_deg: tuple[float, float] | None = None
    epoch: Epoch | None = None
    pier_side: PierSide | None = None


def measure_frame(
    path: str,
    options: SolveOptions,
    site: Site | None = None,
    more: Sequence[Moving] = (),
    chosen: Sequence[ChosenStar] = (),
) -> Task[NightFrame]:
    """Read, solve and measure one frame; raises `FrameError` where it cannot be read.

    Parameters
    ----------
    path : str
        The file.
    options : SolveOptions
        How it is solved.
    site : Site or None
        Where it was taken; None takes the header's word.
    more : sequence of Moving
        Bodies and satellites whose elements people gave, beside the shipped ones.
    chosen : sequence of ChosenStar
        Stars to follow.
    """
    frame = yield from reading(path, options.timeout_s)
    if is_calibration(frame.header):
        return NightFrame(path, calibration=True, dark=dark_level(frame))
    found = yield from solve_open_frame(frame, options)
    night = yield from with_objects(measured(found, site), found, more)
    if night.on_sky is None or not isinstance(found.result, Solution):
        return night
    return replace(night, chosen=stars_in_frame(frame, found.result, night.on_sky, chosen))


def with_objects(night: NightFrame, found: SolvedFrame, more: Sequence[Moving] = ()) -> Task[NightFrame]:
    """The same with what crossed a frame and what stood among its stars; as it is without a solution."""
    solution = found.result
    if not isinstance(solution, Solution):
        return night
    crossings = yield from crossings_of(found.frame, found.detections, solution, night.time_utc, night.site, more)
    sights = yield from sights_of(solution, found.detections, night.time_utc, night.site, more)
    return replace(night, crossings=crossings, sights=sights)


def is_calibration(header: Mapping[str, Any]) -> bool:
    """Whether a header says that its frame is a dark, a flat or a bias."""
    return str(header.get("IMAGETYP", "")).lower().split(" ")[0].strip("'") in CALIBRATION


def setup_of(header: Mapping[str, Any]) -> str:
    """Camera, filter, gain and binning as a header has them."""
    return " ".join(f"{key}={header[key]}" for key in SETUP if key in header)


def measured(found: SolvedFrame, site: Site | None = None, small: bool = True) -> NightFrame:
    """What a solved frame, or one that has no solution, says of the night; with a thumbnail if ``small``."""
    frame, result, hint = found.frame, found.result, found.frame.hint
    time_utc = hint.taken_utc or sharpcap_time(Path(found.path))
    kept = NightFrame(
        found.path,
        time_utc=time_utc,
        exposure_s=hint.exposure_s,
        size=(frame.width, frame.height),
        detections=len(found.detections),
        sharp=sharpness(found.detections),
        thumbnail=thumbnail(frame) if small else b"",
        camera=hint.camera,
        setup=setup_of(frame.header),
    )
    if not isinstance(result, Solution):
        return replace(kept, reason=str(result.reason))
    ra, dec = result.ra_dec_deg
    there = site or hint.site
    sky = sky_at(result, time_utc, there) if there and time_utc else None
    return replace(
        kept,
        solved=True,
        ra_deg=ra,
        dec_deg=dec,
        roll_deg=result.roll_deg,
        width_deg=result.camera.fov_deg[0],
        scale_arcsec_px=result.camera.scale_arcsec_px,
        light=star_light(found.detections, result, hint.exposure_s) if _linear(frame) else None,
        on_sky=stars_on_sky(frame, found.detections, result) if _linear(frame) else None,
        sky=sky,
        site=there,
        reported_deg=hint.centre_deg[:2] if hint.centre_deg and "CTYPE1" not in frame.header else None,
        epoch=_epoch(frame.header),
        pier_side=_pier_side(frame.header),
        sighting=Sighting.of(result, time_utc, Path(found.path).name) if time_utc else None,
    )


def _epoch(header: Mapping[str, Any]) -> Epoch | None:
    """Of RA and DEC by the keyword EQUINOX (FITS 4.0, 8.3): J2000, or of date for a year after 2001."""
    equinox = number_or_none(header.get("EQUINOX"))
    if equinox == 2000.0:
        return Epoch.J2000
    return Epoch.DATE if equinox is not None and equinox > 2001.0 else None


def _pier_side(header: Mapping[str, Any]) -> PierSide | None:
    """As ASCOM and INDI name it: a tube east of the pier looks west."""
    return next((side for side in PierSide if side in str(header.get("PIERSIDE", "")).lower()), None)


def _linear(frame: Frame) -> bool:
    """Whether its numbers can be proportional to light: finished pictures have 8 bits and a tone curve."""
    return all(data is None or data.dtype != np.uint8 for data in (frame.pixels, frame.colour))


def star_light(detections: Detections, solution: Solution, exposure_s: float | None) -> StarLight:
    """The light of the matched stars, the brightest that are not saturated."""
    good = np.flatnonzero(~detections.saturated & ~detections.blended & (detections.flux > 0) & (detections.snr > 5))
    pairs = paired_stars(solution.stars, detections.xy, good, SAME_PX)
    pairs = sorted(pairs, key=lambda pair: -float(detections.flux[pair[1]]))[:BRIGHTEST]
    rows = np.array([row for _, row in pairs], dtype=np.int64)
    measured_mag = -2.5 * np.log10(detections.flux[rows] / (exposure_s or 1.0))
    catalogue_mag = np.array([star.mag for star, _ in pairs])
    return StarLight(tuple(star.id for star, _ in pairs), catalogue_mag - measured_mag, 1.0857 / detections.snr[rows])


def sky_at(solution: Solution, time_utc: datetime, site: Site) -> Sky | None:
    """Where field, Moon and Sun stood; None outside the years that the ephemeris covers."""
    from kochab.sky.apparent import apparent
    from kochab.sky.horizon import altitude_deg, sun_altitude_deg
    from kochab.sky.solar_system import BodyKind, covers, major_bodies, observer_at

    if not covers(time_utc):
        return None
    (moon,) = (body for body in major_bodies(observer_at(time_utc, site)) if body.kind == BodyKind.MOON)
    centre = solution.centre_vector
    field_deg, moon_deg = altitude_deg(apparent(np.stack([centre, moon.vector]), time_utc), site, time_utc)
    return Sky(
        float(field_deg),
        float(moon_deg),
        float(np.degrees(angle_between(centre, moon.vector))),
        moon.phase,
        sun_altitude_deg(site, time_utc),
    )


def thumbnail(frame: Frame) -> bytes:
    """A small JPEG of the frame, stretched as the window shows it."""
    from PIL import Image

    shown = debayer_preview(frame, max(1, frame.width // THUMBNAIL_PX))
    if not (shown.dtype == np.uint8 and shown.ndim == 3 and frame.bayer is None):
        shown = apply(shown, stretch_parameters(shown) if frame.bayer is None else white_balanced(shown))
    picture = Image.fromarray(shown).convert("RGB")
    picture.thumbnail((THUMBNAIL_PX, THUMBNAIL_PX))
    into = BytesIO()
    picture.save(into, "JPEG", quality=80)
    return into.getvalue()
