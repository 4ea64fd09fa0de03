"""From the few identified stars to every star of the frame that the catalogue names."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from kochab.attitude import wahba
from kochab.attitude.fit import Fit, FocalPrior, refine
from kochab.attitude.least_squares import off_axis, undistorted
from kochab.core.arrays import Floats, Ints
from kochab.core.attitude import Attitude, cross_product, radec_deg
from kochab.core.camera import Camera, FisheyeCamera
from kochab.core.frame import Detections
from kochab.core.pairing import close_pairs, mutual_nearest
from kochab.core.robust import median
from kochab.core.solution import Identification, Matches, NamedStar, StarCatalogue

# -- Which detection is which catalogue star, by place alone -----------------------------------


def without_companions(places: Floats, resolution_px: float) -> NDArray[np.bool_]:
    """Which of the places (N, 2), brightest first, a camera sees as stars of their own.

    A star closer than ``resolution_px`` to a brighter one is part of that one's image.
    """
    i, j, _ = close_pairs(places, places, resolution_px)
    alone = np.ones(len(places), dtype=np.bool_)
    alone[j[i < j]] = False
    return alone


ROUNDS = 8  # 1.4^8 is 15: enough from stars within a fifteenth of the way to the corners
REACH_GROWTH = 1.4  # of the circle about the identified stars in which stars are matched
ENOUGH_TO_GROW = 100
SMALLEST_TOLERANCE_PX = 1.0
LARGEST_TOLERANCE_PX = 8.0
PRINCIPAL_POINT_SIGMA = 0.01
"""Of the larger side, one sigma a coordinate: most real lenses that show it have theirs 0.3 to 3 % off the middle."""


def extend(
    detections: Detections,
    found: Identification,
    catalogue: StarCatalogue,
    year: float,
    *,
    distortion: bool = True,
    focal: FocalPrior | None = None,
    worst_px: float | None = None,
) -> tuple[Matches, Fit]:
    """Match every detection it can against the catalogue, refitting as the set grows.

    The search starts where the identified stars are and works outward, so that a strong distortion is learnt ring by
    ring. Returns the matches that agree, M of them, and their fit.

    Parameters
    ----------
    detections : Detections
        All of the frame.
    found : Identification
        The stars identified, the camera and attitude that they mean.
    catalogue : StarCatalogue
        Where stars are looked up.
    year : float
        Epoch of their places, Julian year.
    distortion : bool
        Whether the lens may have any.
    focal : FocalPrior or None
        What is known of the focal length; None: nothing.
    worst_px : float or None
        Largest centroid error to accept; None: the stars show it.
    """
    matches = found.matches
    camera = found.camera if distortion else undistorted(found.camera)
    fit = refine(matches, camera, found.attitude, distortion=distortion, rounds=1)
    rows, vectors = _field_stars(detections, found, fit, catalogue, year)
    sigma = centroid_sigma(detections)
    origin = matches.xy.mean(axis=0)
    distance = np.hypot(*(detections.xy - origin).T)
    reach = float(np.hypot(*(matches.xy - origin).T).max())
    spacing = np.sqrt(detections.width * detections.height / max(len(rows), 1))
    for _ in range(ROUNDS):
        reach *= REACH_GROWTH
        tolerance = float(np.clip(4.0 * fit.rms_px, SMALLEST_TOLERANCE_PX, LARGEST_TOLERANCE_PX))
        # within a fifth of the spacing lies a wrong star one time in eight at most
        tolerance = min(tolerance, max(0.2 * spacing, SMALLEST_TOLERANCE_PX))
        grown = _matched(detections, distance <= reach, fit, rows, vectors, tolerance)
        # half of what was identified is lost: the matches before stand
        if len(grown) < max(4, len(found.matches) // 2):
            break
        settled = reach >= distance.max() and len(grown) <= 1.03 * len(matches)
        matches = grown
        if settled:
            break
        step = max(1, len(matches) // ENOUGH_TO_GROW)  # enough, bright and faint, to place the others
        few = matches.take(slice(None, None, step))
        fit = refine(few, fit.camera, fit.attitude, sigma[few.detection], distortion=distortion, rounds=1)
    errors, floor_px = match_errors(sigma, matches, fit.camera.focal_px, catalogue, year)
    last = partial(
        refine,
        matches,
        fit.camera,
        fit.attitude,
        errors if matches is not found.matches else None,  # where no search held, the identified stars count alike
        focal=focal,
        worst_px=worst_px,
        floor_px=floor_px,
        principal_point_sigma=PRINCIPAL_POINT_SIGMA,
    )
    fit = last(distortion=distortion)
    if not fit.rms_px <= LARGEST_TOLERANCE_PX:  # farther than any match was taken from: it ran away
        fit = min(last(distortion=False), fit, key=lambda f: f.rms_px)
    return _inliers(matches, fit)


WIDE, WIDER = 0.6, 0.9
"""Half the frame's larger side over the focal length: lenses of 84 deg and more may be fisheyes, poor ones of 62."""
POOR_LENS, CLOSE_LENS = 0.0004, 0.0005
"""RMS residuals as fractions of the frame's larger side: from the first on other lens models are tried, and a crop's is
accepted only below the second."""
AXIS_SHOWS, FEWEST_FOR_AXIS = 0.17, 8
"""A frame can be recognised as a crop when its larger side is this many focal lengths (10 deg), and with this many
identified stars."""
NEARLY_AS_MANY = 0.9
"""A crop's fit keeps at least this fraction of the stars: the poor fit has a few of them by chance."""
BETTER, AS_MANY = 0.7, 0.97
"""A fisheye's residuals are so much smaller, and its stars no fewer than that, where the frame is one."""


def behind_its_lens(
    grow: Callable[[Identification], tuple[Matches, Fit]], found: Identification
) -> tuple[Matches, Fit]:
    """Matches and fit as ``grow`` makes them of what was found, by the model of a lens that the stars support.

    One that is fitted poorly is tried as part of a larger frame as well, whose optical axis may lie outside, and a wide
    one as a fisheye's; that is believed where it holds clearly more stars, or holds them clearly better.
    """
    matches, fit = grow(found)
    camera, side = fit.camera, max(fit.camera.width, fit.camera.height)
    poor = fit.rms_px >= POOR_LENS * side
    if isinstance(camera, FisheyeCamera) or has_diverged(camera):
        return matches, fit
    if poor and side > AXIS_SHOWS * camera.focal_px and len(found.matches) >= FEWEST_FOR_AXIS:
        crop, matrix = off_axis(found.matches, found.camera, found.attitude.matrix)
        more, other = grow(replace(found, camera=crop, attitude=Attitude(matrix)))
        # Else it is stretched or bent, and an axis far off makes up for that.
        if other.rms_px < min(CLOSE_LENS * side, BETTER * fit.rms_px) and len(more) >= NEARLY_AS_MANY * len(matches):
            matches, fit, poor = more, other, False
    if side < 2.0 * (WIDE if poor else WIDER) * camera.focal_px:
        return matches, fit
    at = fitted_anew(
        found.matches, FisheyeCamera.centred(camera.width, camera.height, camera.focal_px, camera.mirrored)
    )
    more, other = grow(replace(found, camera=at.camera, attitude=at.attitude))
    closer = other.rms_px < BETTER * fit.rms_px and len(more) >= AS_MANY * len(matches)
    fuller = len(more) * AS_MANY > len(matches) and other.rms_px * AS_MANY < fit.rms_px
    return (more, other) if closer or fuller else (matches, fit)


def has_diverged(camera: Camera) -> bool:
    """Whether a fit has diverged: the frame's edge would lie more than 180 deg off a fisheye's axis."""
    return max(camera.width, camera.height) > 2.0 * np.pi * camera.focal_px


def fitted_anew(matches: Matches, camera: Camera) -> Fit:
    """The fit of matches behind a camera of another model, whose attitude is not known yet."""
    return refine(matches, camera, wahba(camera.unproject(matches.xy), matches.vectors))


def match_errors(
    sigma_px: Floats, matches: Matches, focal_px: float, catalogue: StarCatalogue, year: float
) -> tuple[Floats, float]:
    """Errors (M,) of matches, px a coordinate, and what their fit is no better than.

    Parameters
    ----------
    sigma_px : Floats
        Errors (N,) of the detections, px a coordinate.
    matches : Matches
        M of them.
    focal_px : float
        Turns the catalogue's errors into pixels.
    catalogue : StarCatalogue
        Its stars' errors come on top.
    year : float
        Julian year, to which those have grown.
    """
    catalogue_px = focal_px * catalogue_sigma_rad(np.asarray(catalogue.mag(matches.star)), year)
    return np.hypot(sigma_px[matches.detection], catalogue_px), median(catalogue_px)


# -- What the catalogue itself may be off by at the frame's epoch -----------------------------------
# Hipparcos (V < 8, nearly all that are so bright): 1 mas and 1 mas/yr. Tycho-2: 7 mas to V 9 and 60 mas for the
# faintest at 1991.25, motions to 2.5 mas/yr (Hoeg et al. 2000, A&A 355, L27). Neighbouring motions share an error of
# about 1 mas/yr, which no number of stars averages out.

CATALOGUE_EPOCH = 1991.25
HIPPARCOS_MAG, BRIGHT_MAG, FAINT_MAG = 8.0, 9.0, 12.0
ZONAL_ARCSEC_YR = 0.001


def catalogue_sigma_rad(mag: Floats, year: float) -> Floats:
    """One-sigma errors (N,) of catalogue places of V ``mag`` (N,) at a Julian year, a coordinate."""
    place = 0.007 * (0.06 / 0.007) ** np.clip((mag - BRIGHT_MAG) / (FAINT_MAG - BRIGHT_MAG), 0.0, 1.0)
    hipparcos = mag < HIPPARCOS_MAG
    motion = np.where(hipparcos, 0.001, 0.0025) * (year - CATALOGUE_EPOCH)
    return np.asarray(np.radians(np.hypot(np.where(hipparcos, 0.001, place), motion) / 3600.0))


def zonal_covariance(year: float) -> Floats:
    """Of a pointing (3, 3), rad^2, by what the catalogue's places of a region may share."""
    shared = np.radians(ZONAL_ARCSEC_YR * (year - CATALOGUE_EPOCH) / 3600.0) ** 2
    # a region shifted as one does not turn: nothing for the roll
    return np.diag([shared, shared, 0.0])


def with_catalogue_error(attitude: Attitude, year: float) -> Attitude:
    """The attitude with the catalogue's share in its covariance."""
    if attitude.covariance is None:
        return attitude
    return replace(attitude, covariance=attitude.covariance + zonal_covariance(year))


def with_unknown_date(attitude: Attitude, matches: Matches, later: Floats) -> Attitude:
    """The attitude of an undated frame with what its stars' motions share in its covariance.

    ``later`` (M, 3) are the matches' unit vectors one sigma of the date later.
    """
    if attitude.covariance is None:
        return attitude
    before, moved = matches.vectors @ attitude.matrix.T, (later - matches.vectors) @ attitude.matrix.T
    # the one small turn that follows the motions best: normal equations of turn x before = moved
    turn = np.linalg.solve(len(before) * np.eye(3) - before.T @ before, cross_product(before, moved).sum(axis=0))
    return replace(attitude, covariance=attitude.covariance + np.outer(turn, turn))


def centroid_sigma(detections: Detections) -> Floats:
    """Relative centroid errors (N,), px: a floor, and the star's width over its SNR."""
    photon = 0.5 * detections.fwhm_px / np.maximum(detections.snr, 1.0)
    sigma = np.hypot(0.15, np.where(np.isfinite(photon), photon, 0.0))
    return np.where(detections.saturated | detections.blended, 2.0 * sigma, sigma)


def field_centre(camera: Camera, attitude: Attitude) -> tuple[Floats, float]:
    """ICRS unit vector (3,) of the frame's middle, and the radius (rad) that holds its corners."""
    w, h = camera.width - 1.0, camera.height - 1.0
    places = np.array([[w / 2, h / 2], [0, 0], [w, 0], [0, h], [w, h]])
    seen = camera.unproject(places) @ attitude.matrix
    cosine = float(np.min(seen[1:] @ seen[0]))
    return np.asarray(seen[0]), float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def named_stars(
    xy: Floats,
    labels: Iterable[tuple[str, str]],
    mag: Floats,
    vectors: Floats,
    residuals_px: Floats,
    fitted: bool = True,
) -> tuple[NamedStar, ...]:
    """Stars of a solution.

    Parameters
    ----------
    xy : Floats
        Where they are seen (M, 2), px.
    labels : Iterable[tuple[str, str]]
        Identifier and name of each.
    mag : Floats
        V (M,).
    vectors : Floats
        ICRS unit vectors (M, 3).
    residuals_px : Floats
        Seen less expected (M, 2), px.
    fitted : bool
        Whether the fit used them.
    """
    residuals = np.hypot(*residuals_px.T).tolist()
    columns = zip(xy.tolist(), labels, mag.tolist(), map(radec_deg, vectors.tolist()), residuals, strict=True)
    return tuple(
        NamedStar(x, y, name, called, v, ra, dec, residual, fitted)
        for (x, y), (name, called), v, (ra, dec), residual in columns
    )


def _field_stars(
    detections: Detections, found: Identification, fit: Fit, catalogue: StarCatalogue, year: float
) -> tuple[Ints, Floats]:
    """The field's brightest stars, about twice as many as there are detections: their rows, unit vectors (N, 3)."""
    wanted = 2 * len(detections) + 50
    centre, radius = field_centre(fit.camera, fit.attitude)
    # 8 % wider, as the first fit may be poor
    radius = min(1.08 * radius, np.pi / 2)
    w, h = fit.camera.width, fit.camera.height
    count = int(wanted * np.pi / 4.0 * (w * w + h * h) / (w * h))  # in the circle about the frame
    # identified stars stay candidates, even fainter than all these
    rows = np.concatenate([catalogue.brightest(centre, radius, count, year), found.matches.star])
    rows = np.unique(rows, return_index=True)[0]  # without the index NumPy imports numpy.ma, 10 ms of a cold process
    rows = rows[np.argsort(catalogue.mag(rows), kind="stable")].astype(np.int64)
    vectors = catalogue.vectors(rows, year)
    seen = fit.camera.project(vectors @ fit.attitude.matrix.T)
    alone = without_companions(seen, detections.usual_fwhm_px(2.0) or 2.0)
    return rows[alone], vectors[alone]


def _matched(
    detections: Detections, inside: NDArray[np.bool_], fit: Fit, rows: Ints, vectors: Floats, tolerance_px: float
) -> Matches:
    seen = fit.camera.project(vectors @ fit.attitude.matrix.T)
    candidates = np.flatnonzero(inside)
    i, j = mutual_nearest(detections.xy[candidates], seen, tolerance_px)
    detection = candidates[i].astype(np.int64)
    return Matches(detection, rows[j], detections.xy[detection], vectors[j])


def _inliers(matches: Matches, fit: Fit) -> tuple[Matches, Fit]:
    good = fit.inliers
    inliers = matches.take(good)
    return inliers, replace(fit, residuals_px=fit.residuals_px[good], inliers=np.ones(len(inliers), np.bool_))
