"""Lists of stars as a detector would give them, from random pointings of the real catalogue."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import Attitude, attitude_from, radec_deg
from app.core.camera import Camera
from app.core.detections import Detections
from app.sky.catalogue import Catalogue

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FieldPlan:
    """What one simulated field is like; ``size_px`` is the side of its square frame.

    ``missing`` is the share of catalogue stars that are not detected, ``spurious`` the number of
    false ones as a share of the detected, each as bright as one of them. ``brightest`` caps the
    list.
    """

    fov_deg: float
    size_px: int = 1024
    noise_px: float = 0.3
    missing: float = 0.2
    spurious: float = 0.2
    magnitude_scatter: float = 0.3
    brightest: int = 60
    k1: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """A list of stars and its truth; ``stars`` is how many the catalogue has in the frame."""

    detections: Detections
    camera: Camera
    attitude: Attitude
    stars: int


def random_field(catalogue: Catalogue, rng: np.random.Generator, plan: FieldPlan) -> Field:
    """One field at a random place, roll and parity."""
    z = rng.normal(size=3)
    ra, dec = radec_deg(z / np.linalg.norm(z))
    attitude = attitude_from(ra, dec, float(rng.uniform(-180.0, 180.0)))
    n = plan.size_px
    focal = n / 2.0 / np.tan(np.radians(plan.fov_deg) / 2.0)
    middle = (n - 1) / 2.0
    camera = Camera(n, n, float(focal), middle, middle, k1=plan.k1, mirrored=bool(rng.integers(2)))
    radius = float(np.arctan(np.sqrt(2.0) * n / 2.0 / focal))
    rows = catalogue.brightest(attitude.boresight, radius, 6 * plan.brightest)
    xy = camera.project(catalogue.vectors(rows) @ attitude.matrix.T)
    with np.errstate(invalid="ignore"):
        inside = ((xy > -0.5) & (xy < n - 0.5)).all(axis=1)
    xy, mag = xy[inside], catalogue.mag(rows)[inside]
    stars = len(xy)
    seen = rng.random(stars) >= plan.missing
    xy = xy[seen] + rng.normal(0.0, plan.noise_px, (int(seen.sum()), 2))
    mag = mag[seen] + rng.normal(0.0, plan.magnitude_scatter, len(xy))
    false = round(plan.spurious * len(xy))
    if false:
        xy = np.concatenate([xy, rng.uniform(0, n - 1, (false, 2))])
        mag = np.concatenate([mag, rng.choice(mag, false)])
    order = np.argsort(mag)[: plan.brightest]
    flux = 10.0 ** (-0.4 * mag[order])
    return Field(Detections.from_list(xy[order], n, n, flux), camera, attitude, stars)


def random_points(rng: np.random.Generator, count: int, size_px: int = 1024) -> Detections:
    """Points that are no stars: a list that must be refused."""
    return Detections.from_list(rng.uniform(0, size_px - 1, (count, 2)), size_px, size_px)
