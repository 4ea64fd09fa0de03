"""A PHD2 guide log: how the mount drifted, once what the guider's pulses moved is put back.

The format is github.com/OpenPHDGuiding/phd2/wiki/PHD2GuideLog, its ``mount.cpp`` says what the signs mean. KStars and
ASIAIR write alike. A star's distance in Dec and the pulses up to then make the mount's own drift. How far a pulse moves
is what PHD2's calibration says, to a fifth: it is never fitted to means of the star's distances, for a guider answers
their very noise. Dithers prove it frame by frame; without them what the frames say against it widens the doubt. Pulses
that are proved to move the star against the calibration leave north unknown, whatever the log says of its parity.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC
from kochab.core.errors import FrameError
from kochab.core.mount import SIDEREAL_RAD_S
from kochab.core.robust import mad_sigma
from kochab.core.values import mutable
from kochab.parsing.text_input import TextError, read_text
from kochab.polar.drift import PULSES, Stretch, upright
from kochab.polar.measure import MeasureSettings
from kochab.polar.pole import northern, pole_direction
from kochab.polar.pulses import PulseResponse, pulse_response
from kochab.polar.sighting import LocalAttitude
from kochab.sky.horizon import observed_at

BIN_S = 30.0
LEAST_ARCSEC = 0.1  # no mean over a bin is better than that
OTHER_LOCK = ("INFO: DITHER", "INFO: SET LOCK POSITION", "INFO: Guiding parameter change, MountGuidingEnabled")
SETTLING = "SETTLING STATE CHANGE, Settling "  # started, complete or failed
SIGNS = {"+": 1, "?": 0, "-": -1}
FOUND = (0, 1)  # PHD2's Star::FindResult: a star, a saturated star; others are none that can be believed
DITHERS = 3  # places that the star was given on purpose, from which on pulses prove how far they move
REVERSED_SIGMAS = 3.0  # below zero, by which pulses are proved to move the star against the calibration
JUMP_SIGMAS, JUMP_OF_PULSE = 8.0, 0.5  # a step beyond these that no pulse explains: another star, or a kick


@mutable
class GuidedRun:
    """One run of guiding; ``rows``: time, s, RA and Dec of the star, px, pulses west and south, ms, dithers so far.

    ``settling`` says of each row whether the guider waited for the star to settle, as far as it writes that.
    ``begun`` is by the clock of whoever wrote the log, which PHD2 sets to local time; ``scale`` arcsec a px.
    """

    begun: datetime
    scale: float = 0.0
    declination_deg: float = float("nan")
    hour_deg: float = float("nan")
    altaz_deg: tuple[float, float] | None = None
    y_rate: float = 0.0
    parity: tuple[int, int] = (0, 0)
    pier: str = ""
    dithers: int = 0
    rows: list[tuple[float, ...]] = field(default_factory=list)
    settling: list[bool] = field(default_factory=list)
    settles: bool = False


def is_guide_log(path: str | Path) -> bool:
    """Whether a file is a guide log of PHD2, or of a program that writes them alike (KStars, ASIAIR)."""
    try:
        with open(path, "rb") as file:
            return b"PHD2" in file.read(200).split(b"\n")[0] and Path(path).suffix.lower() in (".txt", ".log")
    except OSError:
        return False


def guide_log(path: str | Path, settings: MeasureSettings, dec_sign: int = 0) -> list[Stretch]:
    """What each run of guiding of a log shows of the mount's drift; the hour angle in it needs no clock.

    The star's distance in Dec from its place, what pulses moved added, is the mount's. Distances above 0 are corrected
    by pulses west and south; ``parity`` says whether the mount's own north is meant. Where it does not, ``dec_sign``
    1 or -1 says that north pulses move the mount north or south; with 0 north is assumed and the sign is unknown.

    Raises FrameError when it holds none that can be used.
    """
    sections = guided_runs(path)
    found = [s for s in (_stretch(section, settings, dec_sign) for section in sections) if s is not None]
    if not found:
        placed = any(np.isfinite(_hour_rad(s, settings)) for s in sections)
        if placed or not sections:
            raise FrameError("{path} has no minute of guiding.", path=path)
        raise FrameError("{path} has no hour angle: connect the mount in PHD2.", path=path)
    return found


def guided_runs(path: str | Path) -> list[GuidedRun]:
    """The runs of guiding of a log; FrameError where it cannot be read as text."""
    try:
        return list(_sections(read_text(path, errors="replace")))
    except TextError as error:
        raise FrameError("{error}", error=error) from None


def _sections(text: str) -> Iterator[GuidedRun]:
    now: GuidedRun | None = None
    columns: list[str] = []
    settles = False  # PHD2 says so before the run that a program asked for begins
    for line in text.splitlines():
        if begun := re.match(r"Guiding Begins at (\d{4}-\d\d-\d\d \d\d:\d\d:\d\d)", line):
            now, columns = GuidedRun(datetime.fromisoformat(begun[1]).replace(tzinfo=UTC), settles=settles), []
            yield now
        elif line.startswith(("Guiding Ends", "Calibration Begins")):
            now, settles = None, False
        elif SETTLING in line:
            settles = line.endswith("started")
            if now is not None:
                now.settles = settles
        elif now is None:
            continue
        elif line.startswith("Frame,Time,mount"):
            columns = line.split(",")
        elif line.startswith(OTHER_LOCK):
            now.dithers += 1
        elif columns and line[:1].isdigit():
            _row(now, dict(zip(columns, line.split(","), strict=False)))
        elif not columns:
            _header(now, line)


def _header(section: GuidedRun, line: str) -> None:
    def value(pattern: str) -> float:
        found = re.search(pattern + r" = (-?\d+(?:\.\d+)?)", line)
        return float(found[1]) if found else float("nan")

    if line.startswith("Pixel scale"):
        section.scale = value("Pixel scale")
    elif line.startswith("Mount = "):
        section.y_rate = value("yRate")
        if parity := re.search(r"parity = ([+?-])/([+?-])", line):
            section.parity = SIGNS[parity[1]], SIGNS[parity[2]]
    elif "Dec = " in line and "Hour angle" in line:
        section.declination_deg, section.hour_deg = value("Dec"), 15.0 * value("Hour angle")
        section.altaz_deg = (value("Alt"), value("Az"))
        if pier := re.search(r"Pier side = (East|West)", line):
            section.pier = pier[1]


def _row(section: GuidedRun, row: Mapping[str, str]) -> None:
    """A frame; pulses come after it, and move what the next one shows, even where its own star was bad."""
    try:
        if row["mount"].strip('"') != "Mount":  # others are of an adaptive optics unit ("AO") or a lost star ("DROP")
            return
        west = float(row.get("RADuration") or 0.0) * (1.0 if row.get("RADirection") == "W" else -1.0)
        south = float(row.get("DECDuration") or 0.0) * (1.0 if row.get("DECDirection") == "S" else -1.0)
        place = float(row["Time"]), float(row["RARawDistance"]), float(row["DECRawDistance"])
        found = int(row.get("ErrorCode") or 0) in FOUND
    except (KeyError, ValueError):
        return
    if not np.isfinite([west, south]).all():
        return
    if found and np.isfinite(place).all():
        section.rows.append((*place, west, south, float(section.dithers)))
        section.settling.append(section.settles)
    elif section.rows:  # moved before the next star that is believed, as the last one's own
        *last, was_west, was_south, dithers = section.rows[-1]
        section.rows[-1] = (*last, was_west + west, was_south + south, dithers)


def _hour_rad(section: GuidedRun, settings: MeasureSettings) -> float:
    """The hour angle at the beginning; of altitude and azimuth where the log has no other."""
    if np.isfinite(section.hour_deg) or section.altaz_deg is None:
        return float(np.radians(section.hour_deg))
    (altitude, azimuth), latitude = np.radians(section.altaz_deg), np.radians(settings.site.latitude_deg)
    across = -np.sin(azimuth) * np.cos(altitude)
    along = np.sin(altitude) * np.cos(latitude) - np.cos(altitude) * np.cos(azimuth) * np.sin(latitude)
    return float(np.arctan2(across, along))


def _stretch(section: GuidedRun, settings: MeasureSettings, dec_sign: int) -> Stretch | None:
    hour, declination = _hour_rad(section, settings), np.radians(section.declination_deg)
    sound = section.scale > 0.0 and abs(section.declination_deg) < 89.0 and np.isfinite(hour)
    path = _path(section)
    if not sound or path is None or np.ptp(path.time) < 2.0 * BIN_S:
        return None
    time, ra, dec, west, dither, pushed, level = path
    scale = section.scale * ARCSEC
    share, response = PULSES, pulse_response(time, dec, pushed, level)
    # Pulses that move the star against the calibration leave open what is turned round since: the camera or the gear.
    against = response is not None and response.scale + REVERSED_SIGMAS * response.sigma < 0.0
    east_of, north_of = section.parity[0] or 1, section.parity[1] or dec_sign or 1
    if against:  # what is said of north pulses: they take the star to the other side of its place
        north_of = -dec_sign or 1
    if response is not None and len(np.unique(dither)) >= DITHERS:
        pushed, share = response.moved * response.scale, response.sigma / abs(response.scale)
    elif response is not None:
        share = max(PULSES, abs(response.scale - 1.0))
    # No bin spans a dither or a jump.
    _, bin_of = np.unique(np.stack([level, np.floor(time / BIN_S)]), axis=1, return_inverse=True)
    bins = [bin_of.ravel() == n for n in range(int(bin_of.max()) + 1)]
    at = np.array([time[b].mean() for b in bins])
    north = declination + np.array([north_of * dec[b].mean() for b in bins]) * scale
    behind = np.array([east_of * ra[b].mean() for b in bins]) * scale
    turned = hour + SIDEREAL_RAD_S * at - behind / np.cos(declination)
    seen = observed_at(settings.site, settings.refraction, turned, north)
    if seen[:, 2].min() < 0.0:
        return None
    pole = pole_direction(settings.site, settings.pole, settings.refraction)
    scatter = float(np.median([dec[b].std() for b in bins])) * section.scale
    sigma = [max(scatter / np.sqrt(b.sum()), LEAST_ARCSEC) * ARCSEC for b in bins]
    # One star does not show roll: 1 rad of sigma. Its mean over a bin is better by the root of the frames.
    attitudes = tuple(
        LocalAttitude(m, np.diag([s**2, s**2, 1.0]), section.begun + timedelta(seconds=float(t)))
        for m, s, t in zip(upright(seen, pole), sigma, at, strict=True)
    )
    towards_pole = north_of * scale * (1.0 if northern(settings.site) else -1.0)
    moved = np.array([pushed[b].mean() for b in bins]) * towards_pole
    steps = np.array([level[b][0] for b in bins])
    held, known = bool(west.any()), bool(section.parity[1]) and not against
    return Stretch(
        attitudes,
        ra_held=held,
        sign_known=known,
        against_calibration=against,
        pier=section.pier,
        pulses_rad=moved,
        pulse_share=share,
        calibration=f"{section.y_rate:.3f}",
        ra_rad=behind,
        steps=steps,
    )


def response_of(run: GuidedRun) -> PulseResponse | None:
    """What the pulses in Dec did to the star, px; None where the log does not show it."""
    path = _path(run)
    return pulse_response(path.time, path.dec, path.pushed, path.level) if path else None


class _Path(NamedTuple):
    """Of the star in a run, each (N,): ``pushed`` by pulses in Dec, px, ``level`` counts the places it was given."""

    time: Floats
    ra: Floats
    dec: Floats
    west: Floats
    dither: Floats
    pushed: Floats
    level: Floats


def _path(run: GuidedRun) -> _Path | None:
    """None when there are too few rows, or when the rate of the pulses in Dec is unknown."""
    rows = np.array(run.rows, dtype=np.float64).reshape(-1, 6)
    time, ra, dec, west, south, dither = rows.T
    if len(rows) < 6 or (south.any() and not run.y_rate > 0.0):
        return None
    pushed = _pushed(south, run.y_rate)
    return _Path(time, ra, dec, west, dither, pushed, _levels(time, dec, pushed, dither))


def _pushed(south: Floats, y_rate: float) -> Floats:
    """How far the pulses south (N,), ms, before each frame should have moved the star, px, as Dec counts.

    ``y_rate`` is the calibration's, px/s. A frame shows the pulses before it and not its own.
    """
    return np.asarray(-np.append(0.0, np.cumsum(south)[:-1]) / 1000.0 * np.nan_to_num(y_rate))


def _levels(time: Floats, dec: Floats, pushed: Floats, dither: Floats) -> Floats:
    """By frame (N,), the number of times that the star was given another place: by a dither, or by a jump."""
    step, seconds = np.diff(dec - pushed), np.maximum(np.diff(time), 1e-3)
    step = step - np.median(step / seconds) * seconds  # a drift is no jump, however long the star was lost
    usual = max(mad_sigma(step, 0.0), 1e-3)
    jumps = np.abs(step) > JUMP_SIGMAS * usual + JUMP_OF_PULSE * np.abs(np.diff(pushed))
    return np.cumsum(np.append(False, jumps | (np.diff(dither) != 0.0))).astype(np.float64)
