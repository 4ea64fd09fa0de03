"""Five or six stars in a field of several degrees: every pair of the bright sky is tried.

Too few stars for patterns can still be enough when every one of them finds its place: two stars
propose a pointing, the others must all confirm it. Where the scale is known, triangles have been
looked up already (:mod:`kochab.identification.triangles`), and only five stars are left to this.
"""

import numpy as np

from kochab.attitude import wahba
from kochab.core.arrays import Floats, Ints
from kochab.core.attitude import angle_between, unit_vectors
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.pairing import mutual_nearest
from kochab.core.solution import Identification, Matches, StarCatalogue
from kochab.core.values import frozen
from kochab.identification.patterns import ROUGHLY
from kochab.identification.quads import directions, pointings
from kochab.identification.verification import ACCEPT_LOG10, with_crowding
from kochab.solver.matches import without_companions

FEWEST, MOST, MOST_HINTED = 5, 6, 5
DEPTH = 1.6
"""Catalogue stars taken a field, over the number of detections."""
MOST_STARS = 12000
TOLERANCE = 0.009
"""Largest error of a confirmed place, over the frame's width."""
SCALE_STEP = 1.21
"""Ratio of the scales that are tried together."""
BLIND_WIDTHS_DEG = (45.0, 7.0)
"""Frames tried when the scale is unknown; narrower ones have too many pairs."""

Checked = tuple[float, Matches, Camera, Floats]
"""Largest error (px), matches, camera, and where every star should be, px (S, 2)."""


@frozen(eq=False)
class _BrightSky:
    """The bright stars that may be in the frame, brightest first: rows, unit vectors (N, 3)."""

    rows: Ints
    vectors: Floats


def identify_few(
    detections: Detections, hint: Hint | None, catalogue: StarCatalogue, year: float
) -> Identification | None:
    """The one pointing at which every detection is a bright star, or None.

    Its ``log10_false_alarm`` is :func:`_alarm`.

    Parameters
    ----------
    detections : Detections
        All of them must be found again.
    hint : Hint or None
        Its scale, and where the frame points, bound the search; None: nothing is known.
    catalogue : StarCatalogue
        Where bright stars are looked up.
    year : float
        Epoch of their places, Julian year.
    """
    scale = hint.focal_px if hint else None
    triangles_tried = scale is not None and scale[1] <= ROUGHLY * scale[0]
    if not FEWEST <= len(detections) <= (MOST_HINTED if triangles_tried else MOST):
        return None
    found: list[Checked] = []
    tried = 0
    for focal_px in _focal_windows(detections, scale):
        sky = _sky(detections, focal_px, hint, catalogue, year)
        if sky is None:
            continue
        first, second, focal = _pairs(detections, focal_px, sky)
        for mirrored in (False, True):
            tried += len(first)
            for k in _supported_pairs(detections, sky, first, second, focal, mirrored):
                pair = (int(first[k]), int(second[k]))
                checked = _check(detections, sky, pair, float(focal[k]), mirrored)
                found += [checked] if checked else []
    if not found:
        return None
    # the best of all that were tried, which is why the bound counts every pair
    worst_px, matches, camera, places = min(found, key=lambda checked: checked[0])
    # stars in a square px, as `_sky` chose them
    density = DEPTH * len(detections) / (detections.width * detections.height)
    half = np.array([detections.width, detections.height]) / 2.0
    evidence = np.delete(detections.xy, _base(detections), axis=0)
    alarm, _ = with_crowding(
        lambda crowd: (_alarm(detections, worst_px, crowd * density, tried), None),
        evidence - half,
        places - half,
        half,
        density,
    )
    if alarm > ACCEPT_LOG10:
        return None
    attitude = wahba(camera.unproject(matches.xy), matches.vectors)
    return Identification(matches, camera, attitude, alarm, "few stars", tried)


def _alarm(detections: Detections, worst_px: float, density: float, tried: int) -> float:
    """The bound, log10, for stars of which ``density`` lie in a square px.

    Two of n stars propose; that the n - 2 others fall within the largest distance r of a catalogue star by chance::

        T (pi D r^2)^(n - 2),    T the pairs tried, D the density
    """
    chance = min(1.0, density * np.pi * worst_px**2)
    return float(np.log10(tried) + (len(detections) - 2) * np.log10(chance))


def _focal_windows(detections: Detections, scale: tuple[float, float] | None) -> list[tuple[float, float]]:
    """Ranges of the focal length, px, each narrow enough for one depth of the sky."""
    low, high = scale or (detections.width / 2.0 / np.tan(np.radians(BLIND_WIDTHS_DEG) / 2.0)).tolist()
    # a range of exactly one step stays one, however it is rounded
    count = max(1, int(np.ceil(np.log(high / low) / np.log(SCALE_STEP) - 1e-9)))
    edges = np.geomspace(low, high, count + 1)
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def _sky(
    detections: Detections, focal_px: tuple[float, float], hint: Hint | None, catalogue: StarCatalogue, year: float
) -> _BrightSky | None:
    pixel = 1.0 / np.sqrt(focal_px[0] * focal_px[1])
    field_sr = detections.width * detections.height * pixel**2
    density = DEPTH * len(detections) / field_sr
    centre, radius = np.array([0.0, 0.0, 1.0]), np.pi
    if hint is not None and hint.centre_deg is not None:
        ra, dec, around = hint.centre_deg
        reach = np.hypot(detections.width, detections.height) / 2 * pixel
        centre, radius = unit_vectors(ra, dec), min(np.pi, np.radians(around) + reach)
    # a cap of the sphere has 2 pi (1 - cos r) sr; the pairs grow with the square of this
    count = int(density * 2.0 * np.pi * (1.0 - np.cos(radius)))
    if count > MOST_STARS:
        return None
    rows = catalogue.brightest(centre, float(radius), count, year)
    return _BrightSky(rows, catalogue.vectors(rows, year))


def _base(detections: Detections) -> tuple[int, int]:
    """The two detections farthest apart."""
    gap = np.linalg.norm(detections.xy[:, None] - detections.xy[None], axis=2)
    i, j = divmod(int(np.argmax(gap)), len(detections))
    return i, j


def _pairs(detections: Detections, focal_px: tuple[float, float], sky: _BrightSky) -> tuple[Ints, Ints, Floats]:
    """Pairs of stars, both ways, as far apart as the base may be, and their focal lengths."""
    from scipy.spatial import cKDTree

    grid = np.geomspace(*focal_px, 12)
    base = detections.xy[list(_base(detections))]
    cameras = [Camera.centred(detections.width, detections.height, float(f)) for f in grid]
    angles = np.array([angle_between(*camera.unproject(base)) for camera in cameras])
    # the shortest focal length sees the base under the widest angle; a chord, as the tree wants it
    reach = 2.0 * np.sin(angles[0] / 2.0)
    pairs = cKDTree(sky.vectors).query_pairs(reach, output_type="ndarray").astype(np.int64)
    chord = np.linalg.norm(sky.vectors[pairs[:, 0]] - sky.vectors[pairs[:, 1]], axis=1)
    angle = 2.0 * np.arcsin(np.minimum(chord / 2.0, 1.0))
    kept = angle >= angles[-1]
    pairs, angle = pairs[kept], angle[kept]
    # `interp` wants what it looks up in to ascend
    focal = np.interp(angle, angles[::-1], grid[::-1])
    first = np.concatenate([pairs[:, 0], pairs[:, 1]])
    second = np.concatenate([pairs[:, 1], pairs[:, 0]])
    return first, second, np.concatenate([focal, focal])


def _supported_pairs(
    detections: Detections, sky: _BrightSky, first: Ints, second: Ints, focal: Floats, mirrored: bool
) -> Ints:
    """Pairs at which every other detection has a star near, tested for all pairs at once."""
    from scipy.spatial import cKDTree

    base = _base(detections)
    middle = np.array([(detections.width - 1) / 2, (detections.height - 1) / 2])
    xy = (detections.xy - middle) * ([-1.0, 1.0] if mirrored else [1.0, 1.0])
    stars = sky.vectors[np.stack([first, second], axis=1)]
    # x is flipped already, so that nothing is mirrored here
    matrix = pointings(xy, np.broadcast_to(base, (len(first), 2)), stars, focal, np.zeros(len(first), np.bool_))
    left, tree = np.arange(len(first)), cKDTree(sky.vectors)
    # twice the tolerance, at the widest field of the window: a quick look may only let too many pass
    reach = 2.0 * TOLERANCE * detections.width / float(focal.min(initial=np.inf))
    for k in set(range(len(detections))) - set(base):
        place = np.einsum("ni,nij->nj", directions(focal[left], xy[k]), matrix[left])
        distance, _ = tree.query(place, distance_upper_bound=reach)
        left = left[np.isfinite(distance)]
    return left


def _check(
    detections: Detections, sky: _BrightSky, pair: tuple[int, int], focal: float, mirrored: bool
) -> Checked | None:
    """What is found when every detection has a star of its own."""
    camera = Camera.centred(detections.width, detections.height, focal, mirrored)
    base = list(_base(detections))
    pointing = wahba(camera.unproject(detections.xy[base]), sky.vectors[list(pair)])
    seen = camera.project(sky.vectors @ pointing.matrix.T)
    # before companions go: for the crowding every star counts
    places = seen[np.isfinite(seen).all(axis=1)]
    seen[~without_companions(seen, 2.0)] = np.nan
    i, j = mutual_nearest(detections.xy, seen, TOLERANCE * detections.width)
    if len(i) < len(detections):
        return None
    worst = float(np.max(np.linalg.norm(detections.xy[i] - seen[j], axis=1)))
    return worst, Matches(i, sky.rows[j], detections.xy[i], sky.vectors[j]), camera, places
