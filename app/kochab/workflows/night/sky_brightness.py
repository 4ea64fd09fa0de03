"""How bright the sky was, mag/arcsec², and how faint a star a frame shows: from its stars' light beside the sky's.

For a star of magnitude V whose light is F counts, beside which a pixel of A arcsec² has L counts of sky, B of it black,

    sky = V + 2.5 log10(F / (L - B)) + 2.5 log10(A).

Exposure, gain, telescope and vignetting act on both alike and cancel. Black does not: without it there is no
brightness. The air dims the stars, not the sky below it, so that what it takes is added: what a meter on the ground
sees (Patat 2003, A&A 400, 1183). Stars are brought to the colour of a night sky. The faintest star is one whose light
is five times its noise where all noise is the sky's and its profile is fitted: ``5 sigma sqrt(4 pi) s`` (King 1983,
PASP 95, 163), with ``sigma`` the noise of a pixel and ``s`` the profile's own.
"""

import math
from collections.abc import Sequence
from datetime import datetime

import numpy as np

from kochab.core.arrays import Floats, Ints
from kochab.core.attitude import cross_product, separation_deg, unit_vectors
from kochab.core.frame import Detections, Frame
from kochab.core.robust import median
from kochab.core.solution import NamedStar, Solution
from kochab.core.values import frozen
from kochab.sky.catalogue import open_catalogue
from kochab.workflows.night.measure import OF_MEDIAN, Measure, clipped

MOST, FEWEST, COLOURED = 150, 6, 12
"""Stars measured at most, and at least; from how many on their colours are fitted."""
COLOUR, COLOUR_SIGMA = 0.8, 0.3
"""B-V of a night sky: 0.9 where it is dark (Patat), less under the Moon, more under some lamps."""
MAG_PER_AIRMASS, AIR_SIGMA = 0.2, 0.08
"""What clear air takes a unit of airmass, V magnitudes, and how that differs; haze takes more, and counts as cloud."""
USUAL_AIRMASS, UNKNOWN_AIR_MAG = 1.3, 0.15
"""Airmass, and the uncertainty of its extinction, where the altitude is unknown."""
UNKNOWN_COLOUR_MAG, LIGHT_MAG = 0.15, 0.03
"""What colours that were not fitted may do; what the catalogue may be off as a whole, and light beyond the ring."""
APERTURE, INNER, OUTER = 2.5, 4.0, 6.5
"""Radii in FWHM: of a star's light, and of the ring where its sky is; up to it a bright star's light is whole."""
BRIGHT = 25
"""Stars whose light out to the ring tells what the aperture leaves out."""
LARGEST_PX = 40.0
"""Of the ring: stars wider than that leave no sky between them."""
FULL = 0.95
"""Share of the level of saturation from which a pixel is taken to be full."""
SAME_PX = 1.5
"""Between a star's place as it was fitted and as it was found."""
MEASURED_SNR, LIMIT_SNR = 10.0, 5.0
SURE = 5.0
"""Uncertainties of black by which the sky has to be above it."""
BLACK_SIGMA = 2.0
"""Counts by which a level may differ from the black that a file or a dark gives."""
SAME_EXPOSURE = 0.1
"""Share by which a dark's exposure may differ from the frame's."""
RATIO, APART_S, BESIDE_DEG, CHANGED = 2.0, 1800.0, 1.0, 0.03
"""Two exposures tell black when one is twice the other, of one place within half an hour: the sky hardly changes."""
PEDESTALS = "BLACK", "PEDESTAL"
"""What a file says of its black: a raw file's own level; what a program has added, of whatever sign it writes."""
SAMPLED = 500
"""Rows and columns of a calibration frame that are looked at."""
SENSOR = "INSTRUME", "GAIN", "OFFSET", "XBINNING"


@frozen
class DarkLevel:
    """The median of a dark or bias, counts; ``sensor`` as of :func:`sensor_of`."""

    sensor: tuple[str, ...]
    exposure_s: float | None
    level: float


@frozen(eq=False)
class StarsOnSky:
    """Stars (N,) of one frame beside their sky.

    ``ids`` and ``vectors`` (N, 3), ICRS, are the catalogue's; ``mag`` is V, ``colour`` B-V (NaN unknown); ``light`` and
    ``level`` counts, of a star and of a pixel beside it, whose area is ``area_arcsec2``. ``noise`` (counts, of a
    pixel), ``fwhm_px`` and ``centre``, an ICRS unit vector (3,), are the frame's; ``left_out_mag`` is in ``light``
    though it lay beyond the apertures. ``black`` is what the file says of it, None if nothing.
    """

    ids: tuple[str, ...]
    vectors: Floats
    mag: Floats
    colour: Floats
    light: Floats
    level: Floats
    area_arcsec2: Floats
    noise: float
    fwhm_px: float
    left_out_mag: float
    centre: Floats
    sensor: tuple[str, ...]
    filter: str
    black: float | None = None


def sensor_of(frame: Frame) -> tuple[str, ...]:
    """What black depends on beside the exposure: camera, gain, offset, binning, size and kind of numbers."""
    stated = (f"{key}={frame.header.get(key)}" for key in SENSOR)
    return *stated, f"{frame.width}x{frame.height}", frame.pixels.dtype.kind


def dark_level(frame: Frame) -> DarkLevel | None:
    """The level of a calibration frame that saw no light; None for a flat."""
    if "flat" in str(frame.header.get("IMAGETYP", "")).lower():
        return None
    thin = max(1, min(frame.width, frame.height) // SAMPLED) | 1  # odd: all colours of a mosaic
    return DarkLevel(sensor_of(frame), frame.hint.exposure_s, median(frame.pixels[::thin, ::thin].astype(np.float64)))


def stars_on_sky(frame: Frame, detections: Detections, solution: Solution) -> StarsOnSky | None:
    """Measure them, the brightest that are alone and not saturated; None for too few."""
    good = ~detections.saturated & ~detections.blended & (detections.snr > MEASURED_SNR)
    if not good.any():
        return None
    fwhm = median(detections.fwhm_px[good])
    half = math.ceil(OUTER * fwhm) + 2
    x, y = detections.xy.T
    inside = (np.minimum(x, y) > half) & (x < frame.width - half - 2) & (y < frame.height - half - 2)
    pairs = paired_stars(solution.stars, detections.xy, np.flatnonzero(good & inside), SAME_PX)
    pairs = sorted(pairs, key=lambda pair: pair[0].mag)[:MOST]
    if len(pairs) < FEWEST or not OUTER * fwhm < LARGEST_PX:
        return None
    stars, rows = [star for star, _ in pairs], np.array([row for _, row in pairs])
    light, whole, level, noise = _photometry(frame, detections.xy[rows], fwhm, half)
    bright = (light > 0.0) & (whole > 0.0) & (np.arange(len(light)) < BRIGHT)
    left_out = max(2.5 * math.log10(median(whole[bright] / light[bright])), 0.0) if bright.any() else 0.0
    light = light * 10.0 ** (0.4 * left_out)
    kept = np.isfinite(light) & (light > 0.0)
    if kept.sum() < FEWEST:
        return None
    black = next((abs(v) for v in map(frame.header.get, PEDESTALS) if isinstance(v, int | float) and v), None)
    return StarsOnSky(
        tuple(star.id for star, good in zip(stars, kept, strict=True) if good),
        unit_vectors(*np.array([(star.ra_deg, star.dec_deg) for star in stars])[kept].T),
        np.array([star.mag for star in stars])[kept],
        colours_of(stars, solution)[kept],
        light[kept],
        level[kept],
        _areas(solution, detections.xy[rows])[kept],
        median(noise[kept]),
        fwhm,
        left_out,
        solution.centre_vector,
        sensor_of(frame),
        str(frame.header.get("FILTER", "")),
        black if black is None or math.isfinite(black) else None,
    )


def paired_stars(stars: Sequence[NamedStar], xy: Floats, rows: Ints, reach_px: float) -> list[tuple[NamedStar, int]]:
    """Stars of known magnitude, each with the detection nearest to it.

    Parameters
    ----------
    stars : sequence of NamedStar
        Of the solution.
    xy : Floats
        Places of all detections (N, 2), px.
    rows : Ints
        Which detections count.
    reach_px : float
        How far apart both may be at most.
    """
    from scipy.spatial import cKDTree

    places = np.array([(star.x, star.y) for star in stars]).reshape(-1, 2)
    apart, nearest = map(np.asarray, cKDTree(xy[rows]).query(places, distance_upper_bound=reach_px))
    found = zip(stars, apart, nearest, strict=True)
    return [(star, int(rows[int(k)])) for star, off, k in found if math.isfinite(off) and math.isfinite(star.mag)]


def _photometry(frame: Frame, xy: Floats, fwhm: float, half: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Light in the aperture and out to the ring, level of the sky and noise of a pixel, each (N,) counts.

    A mosaic's cell of four pixels is taken as one.

    Parameters
    ----------
    frame : Frame
        Its pixels.
    xy : Floats
        Places (N, 2), px.
    fwhm : float
        Of the stars, px.
    half : int
        How far around a star is looked at, px.
    """
    cell = 1 if frame.bayer is None else 2
    side = (2 * half // cell + 1) * cell
    low = np.floor(xy - half).astype(np.int64) // cell * cell
    steps = np.arange(side)
    patch = frame.pixels[low[:, 1, None, None] + steps[:, None], low[:, 0, None, None] + steps].astype(np.float64)
    values = patch.reshape(len(xy), side // cell, cell, side // cell, cell).mean(axis=(2, 4))
    middle = steps[::cell] + (cell - 1) / 2.0
    dx, dy = (low[:, k, None] + middle - xy[:, k, None] for k in (0, 1))
    far = np.sqrt(dy[:, :, None] ** 2 + dx[:, None, :] ** 2) / cell
    wide = fwhm / cell
    ring = (far > INNER * wide) & (far < OUTER * wide)
    around = ring.any(axis=0)  # about half of a patch: the rest would be sorted for nothing
    level, noise = _sky(np.where(ring[:, around], values[:, around], np.nan))
    near = np.abs(middle - middle.mean()) < cell * (INNER * wide + 2.0)
    far, values = (part[:, near][:, :, near] for part in (far, values))
    above = cell**2 * (values - level[:, None, None])
    shares = (np.clip(radius * wide + 0.5 - far, 0.0, 1.0) for radius in (APERTURE, INNER))
    light, whole = ((share * above).sum(axis=(1, 2)) for share in shares)
    return light, whole, level, cell * noise


def photometry_at(frame: Frame, places: Floats, stars: StarsOnSky) -> tuple[Floats, float]:
    """Light (N,) of stars at places (N, 2) px as that of the frame's others was measured, and its noise, counts.

    The light is NaN beside the edge, and where a pixel of it is saturated; the noise is the sky's.

    Parameters
    ----------
    frame : Frame
        Its pixels.
    places : Floats
        Where the stars are to be (N, 2), px.
    stars : StarsOnSky
        The others.
    """
    half, near = math.ceil(OUTER * stars.fwhm_px) + 2, math.ceil(stars.fwhm_px)
    inside = ((places > half + 2) & (places < np.array([frame.width, frame.height]) - half - 3)).all(axis=1)
    good = np.flatnonzero(inside)
    if frame.saturation is not None:
        around, (x, y) = np.arange(-near, near + 1), np.rint(places[good]).astype(np.int64).T
        peaks = frame.pixels[y[:, None, None] + around[:, None], x[:, None, None] + around].max(axis=(1, 2))
        good = good[peaks < FULL * frame.saturation]
    light = np.full(len(places), np.nan)
    if len(good):
        light[good] = _photometry(frame, places[good], stars.fwhm_px, half)[0] * 10.0 ** (0.4 * stars.left_out_mag)
    return light, stars.noise * math.sqrt(math.pi) * APERTURE * stars.fwhm_px


def _sky(ring: Floats) -> tuple[Floats, Floats]:
    """Mean and scatter (N,) of what is left of rings (N, P), NaN outside them, when stars are clipped away.

    In order of brightness what is left is a stretch, so that sums up to its ends tell all of it.
    """
    ordered = np.sort(ring, axis=1)  # NaN last
    first, last = np.zeros(len(ring), dtype=np.int64), np.isfinite(ring).sum(axis=1)
    middle = _middles(ordered, first, last)
    off = np.nan_to_num(ordered - middle[:, None])  # small numbers, whose squares keep their digits
    sums, squares = np.zeros((2, len(off), off.shape[1] + 1))
    np.cumsum(off, axis=1, out=sums[:, 1:])
    np.cumsum(off * off, axis=1, out=squares[:, 1:])
    mean, scatter = _moments(sums, squares, first, last)
    for _ in range(4):
        reach = 3.0 * scatter[:, None]
        apart = ordered - _middles(ordered, first, last)[:, None]
        first = np.maximum(first, (apart < -reach).sum(axis=1))
        last = np.minimum(last, (apart <= reach).sum(axis=1))
        mean, scatter = _moments(sums, squares, first, last)
    return middle + mean, scatter


def _middles(ordered: Floats, first: Ints, last: Ints) -> Floats:
    """Medians (N,) of rows (N, P) in order, each from ``first`` up to ``last``."""
    rows = np.arange(len(ordered))
    low, high = np.maximum(first + last - 1, 0) // 2, np.minimum((first + last) // 2, ordered.shape[1] - 1)
    return np.asarray(0.5 * (ordered[rows, low] + ordered[rows, high]))


def _moments(sums: Floats, squares: Floats, first: Ints, last: Ints) -> tuple[Floats, Floats]:
    """Mean and scatter (N,) from ``first`` up to ``last`` of rows whose running sums (N, P + 1) are given.

    Parameters
    ----------
    sums, squares : Floats
        Of the values, and of their squares.
    first, last : Ints
        Each (N,).
    """
    rows, count = np.arange(len(sums)), np.where(last > first, last - first, np.nan)
    mean, square = ((one[rows, last] - one[rows, first]) / count for one in (sums, squares))
    return mean, np.sqrt(np.maximum(square - mean**2, 0.0))


def colours_of(stars: Sequence[NamedStar], solution: Solution) -> Floats:
    """B-V (N,) of stars, NaN where the shipped catalogue has none."""
    from scipy.spatial import cKDTree

    catalogue, colours = open_catalogue(), np.full(len(stars), np.nan)
    rows = catalogue.brightest(solution.centre_vector, solution.radius_rad, 20 * MOST)
    if len(rows):
        ra, dec = np.array([(star.ra_deg, star.dec_deg) for star in stars]).T
        apart, nearest = map(np.asarray, cKDTree(catalogue.vectors(rows)).query(unit_vectors(ra, dec)))
        near = apart < 1e-4  # 20 arcsec: proper motion
        colours[near] = catalogue.bv(rows[nearest[near]])
    return colours


def _areas(solution: Solution, xy: Floats) -> Floats:
    """Areas (N,) of pixels on the sky, arcsec², at places (N, 2) px."""
    right, down = (solution.sky_at(xy + step) - solution.sky_at(xy - step) for step in ((0.5, 0.0), (0.0, 0.5)))
    return np.asarray(np.linalg.norm(cross_product(right, down), axis=1) * math.degrees(3600.0) ** 2)


def brightness_of(
    stars: StarsOnSky, black: Measure, airmass: float | None, cloud: Measure | None = None
) -> Measure | None:
    """Magnitudes an arcsec² as seen from the ground; None where the sky is too little above black to tell.

    Parameters
    ----------
    stars : StarsOnSky
        Of the frame.
    black : Measure
        The level of a pixel without light, counts.
    airmass : float or None
        Where the frame looked.
    cloud : Measure or None
        What the stars lost to more than clear air, magnitudes.
    """
    above = stars.level - black.value
    if not median(above) > SURE * black.sigma:
        return None
    lit = above > 0.0
    one = stars.mag[lit] + 2.5 * np.log10(stars.light[lit] / above[lit] * stars.area_arcsec2[lit])
    found = _at_colour(one, stars.colour[lit], stars.left_out_mag)
    if found is None:
        return None
    dimmed = MAG_PER_AIRMASS * (USUAL_AIRMASS if airmass is None else airmass) + (cloud.value if cloud else 0.0)
    air = (UNKNOWN_AIR_MAG if airmass is None else AIR_SIGMA * airmass), (cloud.sigma if cloud else 0.0)
    return Measure(found.value + dimmed, math.hypot(found.sigma, 1.0857 * black.sigma / median(above), *air))


def stated_brightness(stars: StarsOnSky, airmass: float | None) -> Measure | None:
    """Sky brightness of a single frame, from the black level stated in its file; None where there is none."""
    return None if stars.black is None else brightness_of(stars, Measure(stars.black, BLACK_SIGMA), airmass)


def faintest_of(stars: StarsOnSky) -> Measure | None:
    """The magnitude of a star whose light is five times its noise."""
    if not stars.noise > 0.0:
        return None
    profile = stars.fwhm_px / math.sqrt(8.0 * math.log(2.0))
    least = LIMIT_SNR * stars.noise * math.sqrt(4.0 * math.pi) * profile
    return _at_colour(stars.mag + 2.5 * np.log10(stars.light / least), stars.colour, stars.left_out_mag)


def _at_colour(values: Floats, colour: Floats, left_out_mag: float) -> Measure | None:
    """The common value of stars (N,) at the colour of the sky; None for too few.

    Half of ``left_out_mag``, the light that was taken to be beyond the apertures, may be that of neighbours.
    """
    if len(values) < FEWEST:
        return None
    found = of_colour(values, colour, COLOUR)
    tint = UNKNOWN_COLOUR_MAG if math.isnan(found.slope) else COLOUR_SIGMA * found.slope
    return Measure(found.value, math.hypot(found.sigma, tint, LIGHT_MAG, 0.5 * left_out_mag))


@frozen
class OfColour:
    """The value that stars of one colour have in common, its sigma, and its change with B-V.

    ``slope`` is NaN where too few colours are known.
    """

    value: float
    sigma: float
    slope: float


def of_colour(values: Floats, colour: Floats, wanted: float) -> OfColour:
    """What values (N,) of stars are at a colour B-V, by a line through all of them, those far off it left out.

    Parameters
    ----------
    values : Floats
        Of each star, at least two.
    colour : Floats
        B-V of each star (N,), NaN unknown.
    wanted : float
        B-V; with too few colours it is of no matter.
    """
    known = np.isfinite(colour)
    if known.sum() < COLOURED:
        kept = clipped(values - median(values))
        scatter = float(np.std(values[kept], ddof=1))
        return OfColour(median(values), OF_MEDIAN * scatter / math.sqrt(kept.sum()), math.nan)
    rows, values = np.stack([np.ones(known.sum()), colour[known] - wanted], axis=1), values[known]
    kept, terms = np.ones(len(values), dtype=np.bool_), np.zeros(2)
    for _ in range(4):
        terms, *_ = np.linalg.lstsq(rows[kept], values[kept], rcond=None)
        kept = clipped(values - rows @ terms)
    left = (values - rows @ terms)[kept]
    scatter = math.sqrt(float(left @ left) / max(len(left) - 2, 1))
    sigma = scatter * math.sqrt(float(np.linalg.pinv(rows[kept].T @ rows[kept])[0, 0]))
    return OfColour(float(terms[0]), sigma, float(terms[1]))


def blacks_of(
    stars: Sequence[StarsOnSky | None],
    exposures_s: Sequence[float | None],
    times: Sequence[datetime | None],
    darks: Sequence[DarkLevel],
) -> list[Measure | None]:
    """The black level of each frame, counts: the file's, a dark's of its exposure, or of two exposures; else None.

    Parameters
    ----------
    stars : sequence of StarsOnSky or None
        Of each frame (N).
    exposures_s : sequence of float or None
        Of each frame.
    times : sequence of datetime or None
        Of each frame.
    darks : sequence of DarkLevel
        Of calibration frames.
    """
    frames = list(zip(stars, exposures_s, times, strict=True))
    return [_black(*frame, frames, darks) for frame in frames]


def _black(
    stars: StarsOnSky | None,
    exposure_s: float | None,
    time: datetime | None,
    others: Sequence[tuple[StarsOnSky | None, float | None, datetime | None]],
    darks: Sequence[DarkLevel],
) -> Measure | None:
    """The black level of one frame among others.

    Parameters
    ----------
    stars : StarsOnSky or None
        Of the frame.
    exposure_s : float or None
        Its exposure.
    time : datetime or None
        When it was taken.
    others : sequence
        Stars, exposure and time of all frames.
    darks : sequence of DarkLevel
        Of calibration frames.
    """
    if stars is None:
        return None
    if stars.black is not None:
        return Measure(stars.black, BLACK_SIGMA)
    if exposure_s is None:
        return None
    dark = [
        one.level
        for one in darks
        if one.sensor == stars.sensor and one.exposure_s and abs(one.exposure_s / exposure_s - 1.0) < SAME_EXPOSURE
    ]
    if dark:
        return Measure(median(np.array(dark)), BLACK_SIGMA)
    found = [
        _of_two((exposure_s, median(stars.level)), (seconds, median(one.level)))
        for one, seconds, then in others
        if one and seconds and max(seconds, exposure_s) >= RATIO * min(seconds, exposure_s)
        if (one.sensor, one.filter) == (stars.sensor, stars.filter) and _together(time, then)
        if separation_deg(one.centre, stars.centre) < BESIDE_DEG
    ]
    return min(found, key=lambda black: black.sigma, default=None)


def _together(one: datetime | None, other: datetime | None) -> bool:
    return one is not None and other is not None and abs((one - other).total_seconds()) < APART_S


def _of_two(one: tuple[float, float], other: tuple[float, float]) -> Measure:
    """The level at zero exposure, extrapolated from two pairs of exposure and level."""
    (short, low), (long, high) = sorted((one, other))
    black = (low * long - high * short) / (long - short)
    return Measure(
        black, math.hypot(CHANGED * abs(low - black), CHANGED * abs(high - black) * short / long, BLACK_SIGMA)
    )
