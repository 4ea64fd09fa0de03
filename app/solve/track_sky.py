"""The stars expected in the next frame: a neighbourhood of the sky kept from frame to frame."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from app.core.camera import Camera
from app.identify.predict_match import expected_px
from app.solve.extend import field_centre

if TYPE_CHECKING:
    from app.core.attitude import Attitude
    from app.sky import Catalogue

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MARGIN = 1.5  # the neighbourhood's radius over the field's
DEEPER = 1.5  # magnitudes below the limit that still disturb a neighbour
MOST = 4000


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """E stars that should be in a frame, brightest first: numbers in the pool and places (E, 2)."""

    number: Ints
    xy: Floats


class Neighbourhood:
    """Stars around a pointing, brightest first, of which a frame shows some.

    ``rows`` (N,), ``vectors`` (N, 3) at ``year`` and ``mag`` (N,); ``alone`` (N,) are those whose
    image no neighbour disturbs.
    """

    def __init__(
        self, catalogue: "Catalogue", camera: Camera, attitude: "Attitude", year: float,
        faintest: float, blend_px: float,
    ) -> None:  # fmt: skip
        centre, radius = field_centre(camera, attitude)
        self.centre, self.field_rad, self.camera = centre, radius, camera
        self.radius = min(MARGIN * radius, 1.5)
        self.catalogue, self.faintest = catalogue, faintest
        rows = catalogue.cone(centre, self.radius, faintest + DEEPER, year)[:MOST]
        self.rows = rows.astype(np.int64)
        self.vectors = catalogue.vectors(rows, year)
        self.mag = catalogue.mag(rows)
        self.alone = _alone(self.vectors, self.mag, blend_px / camera.focal_px)
        self._labels: dict[int, tuple[str, str]] = {}

    def covers(self, camera: Camera, attitude: "Attitude") -> bool:
        """Whether it holds all stars of a frame taken so."""
        if abs(np.log(camera.focal_px / self.camera.focal_px)) > 0.05:
            return False
        centre, _ = field_centre(camera, attitude)
        off = 2.0 * np.arcsin(min(1.0, float(np.linalg.norm(centre - self.centre)) / 2.0))
        return bool(off + self.field_rad <= self.radius)

    def expected(self, camera: Camera, matrix: Floats, count: int, inset_px: float) -> Expected:
        """The ``count`` brightest undisturbed stars at least ``inset_px`` inside the frame."""
        usable = np.flatnonzero(self.alone & (self.mag <= self.faintest))
        xy = expected_px(camera, matrix, self.vectors[usable])
        size = np.array([camera.width - 1.0, camera.height - 1.0])
        inside = np.all((xy >= inset_px) & (xy <= size - inset_px), axis=1)
        chosen = np.flatnonzero(inside)[:count]
        return Expected(usable[chosen].astype(np.int64), xy[chosen])

    def label(self, number: int) -> tuple[str, str]:
        """Identifier and name of a star, looked up once."""
        if number not in self._labels:
            self._labels[number] = self.catalogue.label(int(self.rows[number]))
        return self._labels[number]


def _alone(vectors: Floats, mag: Floats, blend_rad: float) -> NDArray[np.bool_]:
    """Which stars have no neighbour within the blend that is brighter or hardly fainter."""
    alone = np.ones(len(vectors), dtype=np.bool_)
    if len(vectors) < 2:
        return alone
    pairs = cKDTree(vectors).query_pairs(2.0 * np.sin(blend_rad / 2.0), output_type="ndarray")
    for mine, other in (pairs.T, pairs.T[::-1]):
        alone[mine[mag[other] < mag[mine] + 2.5]] = False
    return alone
