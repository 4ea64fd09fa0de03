"""Pictures as the camera of the 1992 paper takes them, right or with one of its errors.

Liebe (1992, IEEE Aerosp. Electron. Syst. Mag. 7(6), 34): an opening angle of 30 deg, the 1,107
brightest stars, brightnesses uncertain by 25 %, places by 3 arcmin at worst. What the paper leaves
open is an argument here: how errors are distributed up to the worst, how far out a star "outside
the tolerance" is.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from app.core.attitude import Attitude, attitude_from, radec_deg
from app.core.camera import Camera
from app.core.detections import Detections
from app.sky import open_catalogue

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
ErrorLaw = Literal["normal", "disc"]

HALF_DEG = 15.0
BRIGHTEST = 1107
SPREAD = 0.25
WORST_ARCMIN = 3.0
PIXELS = 576
BLEND_DEG = 0.1  # twice 3 arcmin: two such stars leave one image of 3 arcmin pixels


@dataclass(frozen=True, slots=True)
class Situation:
    """One row of the paper's tables 2 and 3, with the paper's own figures for it."""

    name: str
    false: int
    outside: int
    missing: int
    paper_percent: float
    paper_arcsec: float


SITUATIONS = (
    Situation("all stars included, inside the limits", 0, 0, 0, 94.6, 14.6),
    Situation("1 false star", 1, 0, 0, 85.2, 15.4),
    Situation("1 star outside the limits", 0, 1, 0, 85.2, 14.7),
    Situation("2 stars outside the limits", 0, 2, 0, 78.6, 16.7),
    Situation("1 outside and 1 false star", 1, 1, 0, 72.0, 19.4),
    Situation("1 star missing", 0, 0, 1, 88.4, 14.6),
)


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """Detections of one picture and the truth about it."""

    detections: Detections
    camera: Camera
    attitude: Attitude
    stars: int


@dataclass(frozen=True, slots=True, eq=False)
class _Sky:
    vectors: Floats
    mag: Floats
    faintest: float


@lru_cache(maxsize=1)
def sky() -> _Sky:
    """Stars a camera with this limit may show, without the fainter ones of blended pairs."""
    catalogue, pole = open_catalogue(), np.array([0.0, 0.0, 1.0])
    faintest = float(catalogue.mag(catalogue.brightest(pole, np.pi, BRIGHTEST))[-1])
    rows = catalogue.cone(pole, np.pi, faintest - 2.5 * float(np.log10(1.0 - SPREAD)))
    vectors = catalogue.vectors(rows)
    close = cKDTree(vectors).query_pairs(2.0 * np.sin(np.radians(BLEND_DEG) / 2.0))
    alone = np.setdiff1d(np.arange(len(rows)), [max(pair) for pair in close])
    return _Sky(vectors[alone], catalogue.mag(rows[alone]), faintest)


def camera() -> Camera:
    """The paper's camera: 576 pixels across its 30 deg circle, 3.1 arcmin each."""
    return Camera.centred(PIXELS, PIXELS, float(PIXELS / 2.0 / np.tan(np.radians(HALF_DEG))))


def picture(
    rng: np.random.Generator, situation: Situation, law: ErrorLaw = "normal",
    outside: tuple[float, float] = (1.0, 2.0), attitude: Attitude | None = None,
) -> Picture:  # fmt: skip
    """One picture, in a random direction unless ``attitude`` is given.

    ``law`` "normal" has the worst error at three sigma a coordinate, "disc" spreads it evenly over
    a circle. A star outside the limits is off by between ``outside`` times the worst error.
    """
    lens, bright = camera(), sky()
    attitude = attitude or _anywhere(rng)
    body = bright.vectors @ attitude.matrix.T
    seen_mag = bright.mag - 2.5 * np.log10(1.0 + rng.uniform(-SPREAD, SPREAD, len(bright.mag)))
    inside = np.flatnonzero(
        (body[:, 2] > np.cos(np.radians(HALF_DEG))) & (seen_mag <= bright.faintest)
    )
    inside = rng.permutation(inside)[situation.missing :]
    worst = np.radians(WORST_ARCMIN / 60.0)
    off = _errors(rng, len(inside), worst, law)
    for k in range(min(situation.outside, len(inside))):
        turn, far = rng.uniform(0, 2 * np.pi), worst * rng.uniform(*outside)
        off[k] = far * np.array([np.cos(turn), np.sin(turn)])
    xy = lens.project(_shifted(body[inside], off))
    false = _disc(rng, situation.false) * PIXELS / 2.0 + (PIXELS - 1) / 2.0
    xy = np.concatenate([xy, false])
    mag = np.concatenate([seen_mag[inside], rng.choice(bright.mag, len(false))])
    detections = Detections.from_list(xy, PIXELS, PIXELS, 10.0 ** (-0.4 * mag))
    return Picture(detections, lens, attitude, len(inside))


def repeated(rng: np.random.Generator, count: int) -> Iterator[Picture]:
    """Pictures of one field, each with errors of its own."""
    attitude = _anywhere(rng)
    for _ in range(count):
        yield picture(rng, SITUATIONS[0], attitude=attitude)


def _anywhere(rng: np.random.Generator) -> Attitude:
    axis = rng.normal(size=3)
    return attitude_from(*radec_deg(axis / np.linalg.norm(axis)), float(rng.uniform(-180, 180)))


def _errors(rng: np.random.Generator, count: int, worst: float, law: ErrorLaw) -> Floats:
    """Errors (N, 2), radians, of at most ``worst``."""
    if law == "disc":
        return _disc(rng, count) * worst
    off = rng.normal(0.0, worst / 3.0, (count, 2))
    length = np.hypot(*off.T)
    return np.asarray(off * np.minimum(1.0, worst / np.maximum(length, 1e-12))[:, None])


def _disc(rng: np.random.Generator, count: int) -> Floats:
    """Points (N, 2) spread evenly over the unit circle."""
    turn, radius = rng.uniform(0, 2 * np.pi, count), np.sqrt(rng.uniform(0, 1, count))
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)


def _shifted(body: Floats, off: Floats) -> Floats:
    """Directions (N, 3) moved across themselves by small angles (N, 2)."""
    east = np.cross([0.0, 1.0, 0.0], body)
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    moved = body + off[:, :1] * east + off[:, 1:] * np.cross(body, east)
    return np.asarray(moved / np.linalg.norm(moved, axis=1, keepdims=True))
