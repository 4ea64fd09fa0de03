"""Star lists of fisheye lenses of four projections, 90 to 200 deg wide, made without the solver's cameras."""

from collections.abc import Callable

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import cross_product
from kochab.core.frame import Detections
from kochab.sky import open_catalogue

RADII: dict[str, Callable[[Floats], Floats]] = {
    "equidistant": lambda theta: theta,
    "equisolid": lambda theta: 2.0 * np.sin(theta / 2.0),
    "stereographic": lambda theta: 2.0 * np.tan(theta / 2.0),
    "orthographic": lambda theta: np.sin(np.minimum(theta, np.pi / 2.0)),
}
"""r over f at an angle (N,) from the axis, radians (Ray 2002, Applied Photographic Optics, section 30)."""
SIDE_PX = 1600
STARS = 450
YEAR = 2024.0
SIGMA_PX, MISSING, SPURIOUS = 0.3, 0.1, 40
MAG_PER_AIRMASS = 0.2


def whole_sky(projection: str, field_deg: float, rng: np.random.Generator) -> tuple[Detections, Floats]:
    """Detections, and the ICRS direction (3,) of the frame's middle.

    A tenth of the stars is missing, forty detections are false; the frame is square.

    Parameters
    ----------
    projection : str
        One of :data:`RADII`.
    field_deg : float
        Across the frame's side, degrees; stars stand to 90 deg off the axis at most.
    rng : np.random.Generator
        Where the lens points, and what is missing, noisy and false.
    """
    axis, up = rng.normal(size=(2, 3))
    z = axis / np.linalg.norm(axis)
    x = cross_product(up, z)
    x /= np.linalg.norm(x)
    catalogue = open_catalogue()
    half = np.radians(field_deg) / 2.0
    rows = catalogue.brightest(z, min(half * 1.5, np.pi / 2.0), STARS, YEAR)
    seen = catalogue.vectors(rows, YEAR) @ np.stack([x, cross_product(z, x), z]).T
    theta, way = np.arccos(np.clip(seen[:, 2], -1.0, 1.0)), np.arctan2(seen[:, 1], seen[:, 0])
    radius = SIDE_PX / 2.0 * RADII[projection](theta) / RADII[projection](half)
    xy = (SIDE_PX - 1) / 2.0 + radius[:, None] * np.stack([np.cos(way), np.sin(way)], axis=-1)
    kept = (
        (theta < np.pi / 2.0)
        & (rng.random(len(xy)) >= MISSING)
        & (np.abs(xy - SIDE_PX / 2.0) < SIDE_PX / 2.0).all(axis=1)
    )
    # Stars near the horizon are dimmed by the air.
    flux = 10.0 ** (-0.4 * (catalogue.mag(rows) + MAG_PER_AIRMASS / np.maximum(np.cos(theta), 0.1)))
    xy, flux = xy[kept] + rng.normal(0.0, SIGMA_PX, (int(kept.sum()), 2)), flux[kept]
    false = rng.uniform(0.0, SIDE_PX, (SPURIOUS, 2))
    flux = np.concatenate([flux, rng.choice(flux, SPURIOUS)])
    return Detections.from_list(np.concatenate([xy, false]), SIDE_PX, SIDE_PX, flux), z
