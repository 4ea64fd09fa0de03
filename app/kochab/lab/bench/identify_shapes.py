"""Lists of points shaped like clusters, galaxies, nebulae and rings, with no star field in them.

The lists come from formulas and never use the catalogue, so every solution is wrong. The points crowd together as
stars do in an open cluster: a solver that assumes evenly spread stars finds M 44 or the Pleiades in them.
"""

from collections.abc import Callable

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.spatial import cKDTree

from kochab.core.arrays import Floats
from kochab.core.frame import Detections

Shape = Callable[[np.random.Generator, int], Floats]
"""Makes offsets (N, 2) from the shape's centre, in units of about a quarter of the side."""

SIZE_PX = 1024
COUNTS = (5, 3000)
LEAST_PX = 5.0
SEED = 20260301


def plummer(rng: np.random.Generator, count: int) -> Floats:
    """A globular cluster in projection: density (1 + r^2 / a^2)^-2 (Plummer 1911)."""
    share = rng.uniform(0.0, 0.97, count)
    radius = rng.uniform(0.1, 0.6) * np.sqrt(share / (1.0 - share))
    return _turned(rng, radius)


def king(rng: np.random.Generator, count: int) -> Floats:
    """A tidally truncated cluster: King's (1962) empirical profile, concentration 0.5 to 2."""
    core = rng.uniform(0.05, 0.5)
    edge = core * 10.0 ** rng.uniform(0.5, 2.0)
    r = np.linspace(0.0, min(edge, 2.5), 2000)
    density = (1.0 / np.hypot(1.0, r / core) - 1.0 / np.hypot(1.0, edge / core)) ** 2
    summed = cumulative_trapezoid(density * r, r, initial=0)
    return _turned(rng, np.interp(rng.uniform(0.0, summed[-1], count), summed, r))


def galaxy(rng: np.random.Generator, count: int) -> Floats:
    """An inclined exponential disc with a bulge and two logarithmic arms."""
    radius = rng.gamma(2.0, rng.uniform(0.15, 0.45), count)
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    pitch = np.tan(np.radians(rng.uniform(8.0, 25.0)))
    arm = np.log(np.maximum(radius, 0.02)) / pitch + np.pi * rng.integers(0, 2, count)
    on_arm = rng.random(count) < rng.uniform(0.0, 0.8)
    angle = np.where(on_arm, arm + rng.normal(0.0, 0.25, count), angle)
    bulge = rng.random(count) < 0.15
    radius = np.where(bulge, np.abs(rng.normal(0.0, 0.12, count)), radius)
    disc = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    disc[:, 1] *= np.cos(np.radians(rng.uniform(0.0, 80.0)))
    return np.asarray(disc)


def nebula(rng: np.random.Generator, count: int) -> Floats:
    """A few clumps, each made of smaller ones."""
    centres = rng.normal(0.0, rng.uniform(0.2, 0.9), (int(rng.integers(2, 9)), 2))
    knots = centres[rng.integers(0, len(centres), 6 * len(centres))]
    knots = knots + rng.normal(0.0, rng.uniform(0.05, 0.3), knots.shape)
    return knots[rng.integers(0, len(knots), count)] + rng.normal(0.0, rng.uniform(0.01, 0.15), (count, 2))


def ring(rng: np.random.Generator, count: int) -> Floats:
    """One to four rings, as fragments of defocused stars or of a planetary nebula."""
    rings = int(rng.integers(1, 5))
    which = rng.integers(0, rings, count)
    radius = rng.uniform(0.3, 1.4, rings)[which]
    centre = rng.normal(0.0, 0.5 if rings > 1 else 0.1, (rings, 2))[which]
    wide = rng.uniform(0.01, 0.15)
    return centre + _turned(rng, radius * (1.0 + rng.normal(0.0, wide, count)))


def band(rng: np.random.Generator, count: int) -> Floats:
    """A long strip, as lights on the horizon or an edge-on galaxy."""
    along = rng.uniform(-2.0, 2.0, count) if rng.random() < 0.5 else rng.normal(0.0, 0.8, count)
    return np.stack([along, rng.normal(0.0, rng.uniform(0.02, 0.4), count)], axis=1)


def arc(rng: np.random.Generator, count: int) -> Floats:
    """Pieces of concentric circles, as star trails around the pole."""
    arcs = int(rng.integers(1, 8))
    which = rng.integers(0, arcs, count)
    angle = rng.uniform(0.0, 6.0, arcs)[which] + rng.uniform(0.0, rng.uniform(0.2, 1.5), count)
    radius = rng.uniform(0.2, 1.8, arcs)[which] + rng.normal(0.0, 0.02, count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def cluster(rng: np.random.Generator, count: int) -> Floats:
    """A loose cluster and field points all over the frame."""
    inside = rng.random(count) < rng.uniform(0.3, 0.9)
    blob = rng.normal(0.0, rng.uniform(0.1, 0.5), (count, 2))
    return np.where(inside[:, None], blob, rng.uniform(-2.0, 2.0, (count, 2)))


SHAPES: dict[str, Shape] = {
    "Plummer cluster": plummer,
    "King cluster": king,
    "open cluster": cluster,
    "galaxy": galaxy,
    "knotty nebula": nebula,
    "rings": ring,
    "band": band,
    "arcs": arc,
}


def shape_list(shape: Shape, seed: int, number: int) -> Detections:
    """The list of that number, at most 3,000 points; odd numbers keep them 5 px apart.

    Fluxes follow a power law. In half of the lists the points are brighter towards the centre.
    """
    rng = np.random.default_rng([seed, number])
    count = round(log_uniform(rng, *COUNTS))
    out = shape(rng, count)
    scale = SIZE_PX / 4.0 * log_uniform(rng, 0.3, 1.2)
    turn = rng.uniform(0.0, 2.0 * np.pi)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    xy = scale * out @ rotation + SIZE_PX * rng.uniform(0.35, 0.65, 2)
    flux = rng.pareto(1.5, len(xy)) + 1.0
    if rng.random() < 0.5:
        flux = flux / (0.1 + np.hypot(*out.T))
    inside = ((xy > 0.0) & (xy < SIZE_PX - 1.0)).all(axis=1)
    xy, flux = xy[inside], flux[inside]
    order = np.argsort(-flux, kind="stable")
    if number % 2:
        apart = np.ones(len(order), dtype=bool)  # no brighter one is nearer
        for i, j in sorted(cKDTree(xy[order]).query_pairs(LEAST_PX)):
            apart[j] &= not apart[i]
        order = order[apart]
    return Detections.from_list(xy[order], SIZE_PX, SIZE_PX, flux[order])


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between the two, evenly in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _turned(rng: np.random.Generator, radius: Floats) -> Floats:
    angle = rng.uniform(0.0, 2.0 * np.pi, len(radius))
    return np.asarray(radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))
