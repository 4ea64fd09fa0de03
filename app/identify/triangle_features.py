"""Area and polar moment of spherical triangles, with their errors, many at once.

The thesis on spherical triangles, sections 2.4 and 2.5. All take corners (..., 3, 3): three unit
vectors a triangle; areas are in steradians, moments in rad^4.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def sides(corners: Floats) -> Floats:
    """Sides (..., 3), radians: 1-2, 2-3, 3-1 (equations 2.18-2.20, by the chord)."""
    gap = np.linalg.norm(corners - np.roll(corners, -1, axis=-2), axis=-1)
    return np.asarray(2.0 * np.arcsin(np.minimum(gap / 2.0, 1.0)))


def _tangents(side: Floats) -> Floats:
    """The four tangents (..., 4) of equation 2.16: of s/2, (s-a)/2, (s-b)/2, (s-c)/2."""
    half = side.sum(axis=-1, keepdims=True) / 2.0
    return np.asarray(np.tan(np.concatenate([half, np.maximum(half - side, 0.0)], axis=-1) / 2.0))


def area(corners: Floats) -> Floats:
    """Areas (...,) by equation 2.16."""
    return np.asarray(4.0 * np.arctan(np.sqrt(_tangents(sides(corners)).prod(axis=-1))))


def area_sigma(corners: Floats, sigma_rad: float) -> Floats:
    """Errors (...,) of the areas, each coordinate of a corner being off by ``sigma_rad``.

    Equations 2.25-2.34; the variance of a side is twice that of a place (2.14), as the thesis'
    programs have it and equation 2.34 leaves out. Flat triangles give inf.
    """
    t = _tangents(sides(corners))
    product = t.prod(axis=-1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = product / t * (1.0 + t * t)  # 1 / cos^2 = 1 + tan^2
        signs = np.array([[1, -1, 1, 1], [1, 1, -1, 1], [1, 1, 1, -1]], dtype=np.float64)
        slope = 4.0 / (1.0 + product) * (u @ signs.T) / (8.0 * np.sqrt(product))
    error = np.sqrt(2.0) * sigma_rad * np.linalg.norm(slope, axis=-1)
    return np.where(np.isfinite(error), error, np.inf)


def field(corners: Floats) -> Floats:
    """Diameters (...,), radians, of the smallest circles that hold the triangles (3.5.1).

    That is the longest side of an obtuse triangle, else the circumscribed circle's diameter.
    """
    chord = np.sort(2.0 * np.sin(sides(corners) / 2.0), axis=-1)
    a, b, c = np.moveaxis(chord, -1, 0)
    heron = (a + b + c) * (b + c - a) * (a + c - b) * (a + b - c)
    with np.errstate(divide="ignore", invalid="ignore"):
        round_ = 2.0 * a * b * c / np.sqrt(np.maximum(heron, 0.0))
    width = np.where(a * a + b * b <= c * c, c, round_)
    return np.asarray(2.0 * np.arcsin(np.minimum(width / 2.0, 1.0)))


def polar_moment_recursive(corners: Floats, level: int = 3) -> Floats:
    """Polar moments (...,) by equation 2.35 over ``4 ** level`` smaller triangles.

    Each counts as a point, so this falls short of the truth by about one part in ``4 ** level``.
    """
    centre = _unit(corners.sum(axis=-2))
    parts = corners[..., None, :, :]
    for _ in range(level):
        middle = _unit(parts + np.roll(parts, -1, axis=-2))
        back = np.roll(middle, 1, axis=-2)
        outer = np.stack([parts, middle, back], axis=-2)  # (..., K, corner, 3 points, 3)
        flat = np.concatenate([outer, middle[..., None, :, :]], axis=-3)
        parts = flat.reshape(*corners.shape[:-2], -1, 3, 3)
    off = np.linalg.norm(_unit(parts.sum(axis=-2)) - centre[..., None, :], axis=-1)
    theta = 2.0 * np.arcsin(np.minimum(off / 2.0, 1.0))
    return np.asarray((theta * theta * area(parts)).sum(axis=-1))


_ROOT = np.sqrt(15.0)
_NEAR, _FAR = (6.0 - _ROOT) / 21.0, (6.0 + _ROOT) / 21.0
POINTS = np.array(
    [[1 / 3, 1 / 3, 1 / 3]]
    + [np.roll([1.0 - 2.0 * p, p, p], k).tolist() for p in (_NEAR, _FAR) for k in range(3)]
)
WEIGHTS = np.array([270.0, *[155.0 - _ROOT] * 3, *[155.0 + _ROOT] * 3]) / 1200.0


def polar_moment(corners: Floats) -> Floats:
    """Polar moments (...,) in closed form: no recursion, and closer than the thesis' level 3.

    ``theta^2`` is integrated over the flat triangle through the corners, each point weighing as
    much sky as it covers, ``h / r^3`` at distance r from the centre of the sphere and h of the
    plane; Radon's seven points (1948) are exact to the fifth degree. The leading term is the flat
    triangle's ``A (a^2 + b^2 + c^2) / 36``.
    """
    centre = _unit(corners.sum(axis=-2))
    normal = np.cross(
        corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]
    )
    volume = np.abs((normal * corners[..., 0, :]).sum(axis=-1)) / 2.0  # flat area times h
    point = POINTS @ corners
    r = np.linalg.norm(point, axis=-1)
    off = np.linalg.norm(point / r[..., None] - centre[..., None, :], axis=-1)
    theta = 2.0 * np.arcsin(np.minimum(off / 2.0, 1.0))
    return np.asarray(volume * (theta * theta / r**3 @ WEIGHTS))


def polar_moment_sigma(moment: Floats, sigma_rad: float) -> Floats:
    """The thesis' bound of the moments' errors (...,): the line above figure 2.8.

    It was drawn for places off by 87.2665 / 3 microradians and grows with the error.
    """
    return np.asarray((7.14e-4 * moment + 3e-9) * (sigma_rad / (87.2665e-6 / 3.0)))
