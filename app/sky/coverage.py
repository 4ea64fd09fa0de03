"""How many stars a square field holds, everywhere on the sky: what a solver has to work with."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import radec_deg
from app.core.errors import UsageError
from app.core.progress import Progress, Task
from app.sky.catalogue import Catalogue

Floats = NDArray[np.float64]
GOLDEN = np.pi * (3.0 - np.sqrt(5.0))
WIDE = 0.6  # chord beyond which looking at every star is faster
PAIRS = 200_000  # of field and star, held in memory at a time


@dataclass(frozen=True, slots=True)
class Coverage:
    """Stars in a square field, over ``fields`` places spread evenly over the sky."""

    fov_deg: float
    mag_limit: float | None
    fields: int
    fewest: int
    percent_1: int
    percent_5: int
    median: int
    most: int
    share_with_10: float
    poorest_ra_deg: float
    poorest_dec_deg: float


def even_points(n: int) -> Floats:
    """Unit vectors (n, 3) on a Fibonacci spiral: each stands for the same area."""
    z = 1.0 - (2.0 * np.arange(n) + 1.0) / n
    angle = GOLDEN * np.arange(n)
    flat = np.sqrt(1.0 - z * z)
    return np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=1)


def coverage(
    catalogue: Catalogue, fov_deg: float, mag_limit: float | None = None, fields: int | None = None
) -> Task[Coverage]:
    """Count the stars of square fields ``fov_deg`` wide, sides along RA and Dec.

    ``fields`` is how many places are tried; by default one each half field, 200,000 at most.
    """
    if not 0.05 <= fov_deg <= 90.0:
        raise UsageError("The field must be between 0.05 and 90 degrees wide.")
    if fields is None:
        fields = int(np.clip(41253.0 / (fov_deg / 2.0) ** 2, 200, 200_000))
    yield Progress("Reading the catalogue", 0.0)
    rows = np.arange(len(catalogue))
    if mag_limit is not None:
        rows = rows[catalogue.mag(rows) <= mag_limit]
    stars = catalogue.vectors(rows)
    yield Progress("Sorting the stars", 0.05)
    from scipy.spatial import cKDTree

    centres = even_points(fields)
    counts = np.zeros(fields, dtype=np.int64)
    half = np.tan(np.radians(fov_deg) / 2.0)
    reach = np.sqrt(2.0) * half
    chord = 2.0 * np.sin(np.arctan(reach) / 2.0)
    tree = cKDTree(stars, balanced_tree=False, compact_nodes=False)
    step = max(1, int(PAIRS / max(1.0, len(stars) * chord * chord / 4.0)))
    for first in range(0, fields, step):
        some = centres[first : first + step]
        counts[first : first + step] = _counted(some, stars, tree, chord, half)
        done = min(1.0, (first + step) / fields)
        yield Progress("Counting stars in fields", 0.1 + 0.9 * done)
    return _summary(fov_deg, mag_limit, counts, centres)


def _counted(
    centres: Floats, stars: Floats, tree: Any, chord: float, half: float
) -> NDArray[np.int64]:
    """Stars in each square: through the tree while fields are small, else star by star."""
    from scipy.spatial import cKDTree

    if chord > WIDE:
        return np.array([_in_square(c[None], stars, half).sum() for c in centres])
    near = cKDTree(centres).sparse_distance_matrix(tree, chord, output_type="coo_matrix")
    inside = _in_square(centres[near.row], stars[near.col], half)
    return np.bincount(near.row[inside], minlength=len(centres))


def _in_square(centre: Floats, star: Floats, half: float) -> NDArray[np.bool_]:
    """Whether each star (P, 3) projects within ``half`` (tangent) of its centre on both axes."""
    flat = np.hypot(centre[:, 0], centre[:, 1])
    depth = star @ centre[0] if len(centre) == 1 else np.einsum("ij,ij->i", centre, star)
    x = (centre[:, 0] * star[:, 1] - centre[:, 1] * star[:, 0]) / flat
    y = (star[:, 2] - depth * centre[:, 2]) / flat
    return np.asarray((np.abs(x) <= half * depth) & (np.abs(y) <= half * depth))


def _summary(
    fov_deg: float, mag_limit: float | None, counts: NDArray[np.int64], centres: Floats
) -> Coverage:
    low, five, middle = np.percentile(counts, [1, 5, 50], method="lower")
    poorest = int(np.argmin(counts))
    ra, dec = radec_deg(centres[poorest])
    return Coverage(
        fov_deg, mag_limit, len(counts), int(counts[poorest]), int(low), int(five), int(middle),
        int(counts.max()), float(np.mean(counts >= 10)), round(ra, 4), round(dec, 4),
    )  # fmt: skip
