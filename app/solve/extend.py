"""From the few stars that were identified to every star of the frame that has a name."""

from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.attitude.belief import FocalBelief
from app.attitude.fit import Fit, refine
from app.attitude.terms import straightened
from app.core.attitude import Attitude
from app.core.camera import Camera
from app.core.detections import Detections
from app.core.solution import Identification, Matches
from app.solve.pairing import mutual_nearest, without_companions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ROUNDS = 8
REACH_GROWTH = 1.4
ENOUGH_TO_GROW = 100
SMALLEST_TOLERANCE_PX = 1.0
LARGEST_TOLERANCE_PX = 8.0


class Stars(Protocol):
    """What is needed of a catalogue here."""

    def vectors(self, rows: Ints, year: float) -> Floats:
        """ICRS unit vectors (N, 3) at a Julian year."""
        ...

    def mag(self, rows: Ints) -> NDArray[np.floating]:
        """V magnitudes (N,)."""
        ...

    def brightest(self, vector: Floats, radius_rad: float, n: int, year: float) -> Ints:
        """The brightest rows of a cone around an ICRS unit vector."""
        ...

    def labels(self, rows: Ints) -> list[tuple[str, str]]:
        """Identifiers and names."""
        ...


def extend(
    detections: Detections,
    found: Identification,
    catalogue: Stars,
    year: float,
    *,
    distortion: bool = True,
    focal: FocalBelief | None = None,
    worst_px: float | None = None,
) -> tuple[Matches, Fit]:
    """Match every detection it can against the catalogue, refitting as the set grows.

    The search starts where the identified stars are and works outward, so that a strong
    distortion is learnt ring by ring. ``focal`` and ``worst_px`` are what the last fit may believe
    of the camera.
    Returns the matches that agree, M of them, and their fit.
    """
    matches = found.matches
    camera = found.camera if distortion else straightened(found.camera)
    fit = refine(matches, camera, found.attitude, distortion=distortion, rounds=1)
    rows = _pool(detections, found, fit, catalogue, year)
    vectors = catalogue.vectors(rows, year)
    sigma = centroid_sigma(detections)
    origin = matches.xy.mean(axis=0)
    distance = np.hypot(*(detections.xy - origin).T)
    reach = float(np.hypot(*(matches.xy - origin).T).max())
    spacing = np.sqrt(detections.width * detections.height / max(len(rows), 1))
    for _ in range(ROUNDS):
        reach *= REACH_GROWTH
        tolerance = float(np.clip(4.0 * fit.rms_px, SMALLEST_TOLERANCE_PX, LARGEST_TOLERANCE_PX))
        tolerance = min(tolerance, max(0.2 * spacing, SMALLEST_TOLERANCE_PX))
        grown = _paired(detections, distance <= reach, fit, rows, vectors, tolerance)
        if len(grown) < max(4, len(found.matches) // 2):
            break
        settled = reach >= distance.max() and len(grown) <= 1.03 * len(matches)
        matches = grown
        if settled:
            break
        few = _sample(matches)
        fit = refine(
            few, fit.camera, fit.attitude, sigma[few.detection], distortion=distortion, rounds=1
        )
    matched_sigma = sigma[matches.detection] if matches is not found.matches else None
    last = partial(
        refine, matches, fit.camera, fit.attitude, matched_sigma, focal=focal, worst_px=worst_px
    )
    fit = last(distortion=distortion)
    if not fit.rms_px <= LARGEST_TOLERANCE_PX:  # farther than any match was taken from: it ran away
        fit = min(last(distortion=False), fit, key=lambda f: f.rms_px)
    return _agreeing(matches, fit)


def _sample(matches: Matches) -> Matches:
    """Enough matches, bright and faint alike, to say where the others are."""
    step = max(1, len(matches) // ENOUGH_TO_GROW)
    return Matches(
        matches.detection[::step], matches.star[::step], matches.xy[::step], matches.vectors[::step]
    )


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


def _pool(
    detections: Detections, found: Identification, fit: Fit, catalogue: Stars, year: float
) -> Ints:
    """Rows of the field's brightest stars, about twice as many as there are detections."""
    wanted = 2 * len(detections) + 50
    centre, radius = field_centre(fit.camera, fit.attitude)
    radius = min(1.08 * radius, np.pi / 2)
    count = int(wanted / _share_of_circle(fit.camera))
    rows = np.union1d(catalogue.brightest(centre, radius, count, year), found.matches.star)
    rows = rows[np.argsort(catalogue.mag(rows), kind="stable")].astype(np.int64)
    seen = fit.camera.project(catalogue.vectors(rows, year) @ fit.attitude.matrix.T)
    return rows[without_companions(seen, _resolution_px(detections))]


def _resolution_px(detections: Detections) -> float:
    """How far apart two stars must be to leave two images."""
    widths = detections.fwhm_px[np.isfinite(detections.fwhm_px)]
    return float(np.clip(np.median(widths), 2.0, 10.0)) if len(widths) else 2.0


def _share_of_circle(camera: Camera) -> float:
    w, h = camera.width, camera.height
    return float(w * h / (np.pi / 4.0 * (w * w + h * h)))


def _paired(
    detections: Detections,
    inside: NDArray[np.bool_],
    fit: Fit,
    rows: Ints,
    vectors: Floats,
    tolerance_px: float,
) -> Matches:
    seen = fit.camera.project(vectors @ fit.attitude.matrix.T)
    candidates = np.flatnonzero(inside)
    i, j = mutual_nearest(detections.xy[candidates], seen, tolerance_px)
    detection = candidates[i].astype(np.int64)
    return Matches(detection, rows[j], detections.xy[detection], vectors[j])


def _agreeing(matches: Matches, fit: Fit) -> tuple[Matches, Fit]:
    keep = fit.inliers
    kept = Matches(
        matches.detection[keep], matches.star[keep], matches.xy[keep], matches.vectors[keep]
    )
    residuals = fit.residuals_px[keep]
    whole = np.ones(len(kept), dtype=np.bool_)
    return kept, Fit(fit.camera, fit.attitude, residuals, fit.rms_px, whole, fit.terms)
