"""After a solve: the catalogue's stars that no detection was matched to, looked for at their places.

A bright star may be missing among the matches: saturated, its middle is pixels off; beside a nebula or another star it
is no detection of its own; far from a wide lens's axis the camera model is a little off. Each is looked for among the
detections without a star, no farther off than chance allows for so bright a one, and then in the frame's light. What is
found is named and takes no part in the fit.
"""

from dataclasses import replace

import numpy as np

from kochab.attitude.fit import Fit
from kochab.core.arrays import Bools, Floats, Ints, Table
from kochab.core.frame import Detections, Frame
from kochab.core.pairing import close_pairs
from kochab.core.robust import mad_sigma, median
from kochab.core.solution import Matches, NamedStar, StarCatalogue
from kochab.core.values import frozen
from kochab.detection.star_fit import FWHM_PER_SIGMA
from kochab.detection.windows import look
from kochab.solver.matches import field_centre, named_stars, without_companions

DEPTH = 0.75
"""Stars as bright as this share of the matched ones are looked for."""
MOST_STARS = 200
FEWEST_MATCHES = 8
"""Fewer matches do not calibrate flux against magnitude."""
NEAREST_PX, FARTHEST = 2.5, 0.005
"""How far off light is looked for: at least, and at most, over the frame's larger side."""
OUTSIDE = 0.01
"""And so far more for each px to the nearest matched star: there the camera model is less sure."""
BRIGHT_REACH = 2.0
"""A detection as bright as the star may be so many times as far off, where chance allows it."""
FAINTER_MAG = 2.0
"""A star may be so much fainter than the matched ones say: low in the sky, in a lens's corner, behind thin cloud."""
COMPRESSED = 0.1
"""Stars brighter than this share of the matched ones are told no brighter: there light is clipped or compressed."""
BY_CHANCE = 0.015
"""Detections as bright as the star that would stand so near it by chance, at most."""
LOCAL = 0.12
"""Over the frame's larger side: as far around a star others are counted for that."""
COMPANION_MAG = 1.0
"""A detection matched to a star so much fainter may be both in one."""
NUDGE, DOUBTFUL = 0.04, 0.25
"""Where this share as many are found at places that far off, over the larger side, the frame is no sky there."""
LEAST_SNR, TWICE = 7.0, 2.0
BESIDE = ((3.0, 0.0), (0.0, 3.0), (-3.0, 0.0), (0.0, -3.0), (3.0, 3.0), (-3.0, 3.0), (3.0, -3.0), (-3.0, -3.0))
"""Windows from the star's in which light would be no star, but for detections: the star is twice as bright as any."""


@frozen(eq=False)
class _Expected(Table):
    """W stars of the catalogue without a match: rows, ICRS vectors (W, 3), places (W, 2) px, V, and reach (W,) px."""

    rows: Ints
    vectors: Floats
    places: Floats
    mag: Floats
    reach_px: Floats


def stars_at_their_places(
    frame: Frame, detections: Detections, matches: Matches, fit: Fit, catalogue: StarCatalogue, year: float
) -> tuple[NamedStar, ...]:
    """Stars of the catalogue that the frame shows and the fit did not use, brightest first.

    Parameters
    ----------
    frame : Frame
        Its light is looked at where no detection is.
    detections : Detections
        All of the frame.
    matches : Matches
        Those that the fit used.
    fit : Fit
        The camera and the attitude that say where stars are.
    catalogue : StarCatalogue
        Where stars are looked up.
    year : float
        Epoch of their places, Julian year.
    """
    if len(matches) < FEWEST_MATCHES:
        return ()
    expected = _expected(detections, matches, fit, catalogue, year)
    if not len(expected.rows):
        return ()
    mag = _magnitudes(detections, matches, catalogue)
    matched = np.full(len(detections), np.inf)  # V of the stars that detections are matched to
    matched[matches.detection] = catalogue.mag(matches.star)
    xy = _found(frame, detections, mag, matched, expected)
    seen = np.flatnonzero(np.isfinite(xy[:, 0]))
    if not len(seen):
        return ()
    # letters, leaves and roofs are as bright beside the places as at them
    off = NUDGE * max(detections.width, detections.height) * _CIRCLE[np.arange(len(xy)) % len(_CIRCLE)]
    beside = _found(frame, detections, mag, matched, replace(expected, places=expected.places + off))
    if np.isfinite(beside[:, 0]).sum() > DOUBTFUL * len(seen):
        return ()
    return named_stars(
        xy[seen],
        catalogue.labels(expected.rows[seen]),
        expected.mag[seen],
        expected.vectors[seen],
        xy[seen] - expected.places[seen],
        fitted=False,
    )


def _expected(detections: Detections, matches: Matches, fit: Fit, catalogue: StarCatalogue, year: float) -> _Expected:
    camera, matched = fit.camera, np.asarray(catalogue.mag(matches.star), dtype=np.float64)
    centre, radius = field_centre(camera, fit.attitude)
    rows = catalogue.brightest(centre, min(radius, np.pi / 2), 4 * len(matches) + MOST_STARS, year)
    mag = np.asarray(catalogue.mag(rows), dtype=np.float64)
    bright = mag <= _ranked(matched, DEPTH)
    rows, mag = rows[bright], mag[bright]
    vectors = catalogue.vectors(rows, year)
    rays = vectors @ fit.attitude.matrix.T
    places = camera.project(rays)
    off_axis_rad = np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2])
    inside = (places > 0.0).all(axis=1) & (places < (camera.width - 1.0, camera.height - 1.0)).all(axis=1)
    inside &= off_axis_rad <= camera.reach_rad
    width_px = detections.usual_fwhm_px(2.0) or 2.0
    order = np.flatnonzero(inside)[np.argsort(mag[inside], kind="stable")]
    # what stands beside a brighter star is part of its image, matched or not
    order = order[without_companions(places[order], 1.5 * width_px)]
    known = set(matches.star.tolist())  # np.isin imports numpy.ma, as does np.quantile: 10 ms of a cold process
    order = order[[row not in known for row in rows[order].tolist()]][:MOST_STARS]
    away = np.hypot(*(places[order, None] - matches.xy[None]).transpose(2, 0, 1)).min(axis=1, initial=np.inf)
    side = float(max(camera.width, camera.height))
    reach = np.clip(max(4.0 * fit.rms_px, width_px, NEAREST_PX) + OUTSIDE * away, NEAREST_PX, max(FARTHEST * side, 4.0))
    return _Expected(rows[order], vectors[order], places[order], mag[order], reach)


def _ranked(values: Floats, share: float) -> float:
    """The value that so large a share is below."""
    return float(np.sort(values)[int(share * (len(values) - 1))])


def _magnitudes(detections: Detections, matches: Matches, catalogue: StarCatalogue) -> Floats:
    """V of the detections (N,) as their light says; saturated ones may be brighter than that, -inf."""
    light = -2.5 * np.log10(np.maximum(detections.flux, 1e-12))
    own = light[matches.detection]
    excess = np.asarray(catalogue.mag(matches.star), dtype=np.float64) - own
    zero = median(excess)
    near = np.abs(excess - zero) < 3.0 * max(mad_sigma(excess, zero), 0.3)
    # a stretched picture's light is no longer in proportion: a line, never falling, of the stars that agree
    slope = float(np.polyfit(own[near], (excess + own)[near], 1)[0]) if near.sum() >= FEWEST_MATCHES else 1.0
    value = median((excess + own)[near]) + np.clip(slope, 0.5, 3.0) * (light - median(own[near]))
    return np.where(detections.saturated, -np.inf, value)


_CIRCLE = np.stack([np.cos(np.arange(5) * 0.4 * np.pi), np.sin(np.arange(5) * 0.4 * np.pi)], axis=1)


def _found(frame: Frame, detections: Detections, mag: Floats, matched: Floats, expected: _Expected) -> Floats:
    """Places (W, 2) px where the stars are seen, NaN where they are not."""
    xy = _among_detections(detections, mag, matched, expected)
    dark = np.flatnonzero(~np.isfinite(xy[:, 0]))
    others = np.concatenate([detections.xy[np.isfinite(matched)], np.delete(xy, dark, axis=0)])
    xy[dark] = _in_the_light(frame, detections, others, expected.take(dark))
    return xy


def _among_detections(detections: Detections, mag: Floats, matched: Floats, expected: _Expected) -> Floats:
    """Places (W, 2) px of the detections that are the stars, NaN where there is none; each is one star's at most.

    Parameters
    ----------
    detections : Detections
        All N of the frame.
    mag : Floats
        V (N,) as their light says.
    matched : Floats
        V (N,) of the stars that they are matched to, infinite where to none.
    expected : _Expected
        The stars.
    """
    xy = np.full((len(expected.rows), 2), np.nan)
    side = float(max(detections.width, detections.height))
    area, around_px = float(detections.width * detections.height), LOCAL * side
    brightest = _ranked(matched[np.isfinite(matched)], COMPRESSED)
    matched, free = matched.copy(), np.isinf(matched)
    stars, _, distance2 = close_pairs(expected.places, detections.xy, BRIGHT_REACH * float(expected.reach_px.max()))
    in_reach = np.zeros(len(xy), dtype=np.bool_)
    in_reach[stars[distance2 <= np.square(BRIGHT_REACH * expected.reach_px[stars])]] = True
    looked_at = np.flatnonzero(in_reach)
    distances = np.hypot(*(detections.xy[None] - expected.places[looked_at, None]).transpose(2, 0, 1))
    for k, away in zip(looked_at.tolist(), distances, strict=True):
        v, reach = float(expected.mag[k]), float(expected.reach_px[k])
        bright = mag <= max(v, brightest) + FAINTER_MAG
        alone, far = bright & free, BRIGHT_REACH * reach
        around = np.count_nonzero(alone & (away < around_px) & (away > far))
        density = max(np.count_nonzero(alone) / area, around / (np.pi * around_px**2))
        by_chance = float(np.sqrt(BY_CHANCE / (np.pi * max(density, 1e-12))))
        near = np.flatnonzero(alone & (away <= min(far, by_chance)))
        if not len(near):
            near = np.flatnonzero(bright & (matched > v + COMPANION_MAG) & (away <= reach))
        if len(near):
            best = near[away[near].argmin()]
            xy[k], matched[best], free[best] = detections.xy[best], v, False
    return xy


def _in_the_light(frame: Frame, detections: Detections, others: Floats, expected: _Expected) -> Floats:
    """Places (W, 2) px of the light at the stars' places, NaN where there is none that stands out.

    Parameters
    ----------
    frame : Frame
        Its light.
    detections : Detections
        All of it: what they are is no light beside a star.
    others : Floats
        Places (M, 2) px of other stars, whose light it may not be.
    expected : _Expected
        The stars.
    """
    xy = np.full((len(expected.rows), 2), np.nan)
    width_px = detections.usual_fwhm_px(1.5)
    if not len(xy) or width_px is None:
        return xy
    image = np.eye(2) * (width_px / FWHM_PER_SIGMA) ** 2
    half = int(np.ceil(np.clip(median(expected.reach_px), 4.0, 10.0)))
    seen = look(frame, expected.places, half, image)
    there = seen.found & (seen.snr > LEAST_SNR)
    there &= np.hypot(*(seen.xy - expected.places).T) <= expected.reach_px
    there &= _away_from(others, seen.xy, 1.5)
    some = np.flatnonzero(there)
    if not len(some):
        return xy
    places = (expected.places[some][:, None] + half * np.array(BESIDE)).reshape(-1, 2)
    beside = look(frame, places, half, image)
    most = np.where(beside.found & _away_from(detections.xy, beside.xy, 3.0), beside.snr, 0.0)
    some = some[seen.snr[some] > TWICE * most.reshape(len(some), len(BESIDE)).max(axis=1)]
    xy[some] = seen.xy[some]
    return xy


def _away_from(places: Floats, xy: Floats, least_px: float) -> Bools:
    """Which of ``xy`` (K, 2) lie so far from each of ``places`` (M, 2)."""
    away = np.ones(len(xy), dtype=np.bool_)
    away[close_pairs(xy, places, least_px)[0]] = False
    return away
