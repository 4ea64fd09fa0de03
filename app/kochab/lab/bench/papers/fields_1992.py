"""Pictures as the camera of the 1992 paper takes them, right or with one of its errors.

Liebe (1992, IEEE Aerosp. Electron. Syst. Mag. 7(6), 34): an opening angle of 30 deg, the 1,107 brightest stars,
brightnesses uncertain by 25 %, places by 3 arcmin at worst. What the paper leaves open is an argument here: how
errors are distributed up to the worst, how far out a star "outside the tolerance" is.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from kochab.core.arrays import Floats
from kochab.core.attitude import Attitude, unit
from kochab.core.camera import Camera
from kochab.core.frame import Detections
from kochab.lab.bench.papers import Published
from kochab.simulate.random_fields import RandomField, random_attitude
from kochab.sky import open_catalogue

ErrorLaw = Literal["normal", "disc"]

TABLES = Published.of("constellations_1992")
HALF_DEG = 15.0
BRIGHTEST = 1107
SPREAD = 0.25
WORST_ARCMIN = 3.0
PIXELS = 576
BLEND_DEG = 0.1  # twice 3 arcmin: two such stars leave one image of 3 arcmin pixels


@dataclass(frozen=True, slots=True)
class CameraError:
    """One row of the paper's tables 2 and 3, with the paper's own figures for it."""

    name: str
    paper_percent: float
    paper_arcsec: float
    false: int = 0
    outside: int = 0
    missing: int = 0


SITUATIONS = tuple(CameraError(**printed) for printed in TABLES.printed["situations"])


@dataclass(frozen=True, slots=True, eq=False)
class _CatalogueSky:
    vectors: Floats
    mag: Floats
    faintest: float


@lru_cache(maxsize=1)
def sky() -> _CatalogueSky:
    """Stars a camera with this limit may show, without the fainter ones of blended pairs."""
    catalogue, pole = open_catalogue(), np.array([0.0, 0.0, 1.0])
    faintest = float(catalogue.mag(catalogue.brightest(pole, np.pi, BRIGHTEST))[-1])
    rows = catalogue.cone(pole, np.pi, faintest - 2.5 * float(np.log10(1.0 - SPREAD)))
    vectors = catalogue.vectors(rows)
    close = cKDTree(vectors).query_pairs(2.0 * np.sin(np.radians(BLEND_DEG) / 2.0))
    alone = np.setdiff1d(np.arange(len(rows)), [max(pair) for pair in close])
    return _CatalogueSky(vectors[alone], catalogue.mag(rows[alone]), faintest)


def camera() -> Camera:
    """The paper's camera: 576 pixels across its 30 deg circle, 3.1 arcmin each."""
    return Camera.centred(PIXELS, PIXELS, float(PIXELS / 2.0 / np.tan(np.radians(HALF_DEG))))


def picture(
    rng: np.random.Generator, situation: CameraError, law: ErrorLaw = "normal", attitude: Attitude | None = None
) -> RandomField:
    """One picture, in a random direction unless ``attitude`` is given.

    ``law`` "normal" has the worst error at three sigma a coordinate, "disc" spreads it evenly over
    a circle. A star outside the limits is off by one to two times the worst error.
    """
    lens, bright = camera(), sky()
    attitude = attitude or random_attitude(rng)
    body = bright.vectors @ attitude.matrix.T
    seen_mag = bright.mag - 2.5 * np.log10(1.0 + rng.uniform(-SPREAD, SPREAD, len(bright.mag)))
    inside = np.flatnonzero((body[:, 2] > np.cos(np.radians(HALF_DEG))) & (seen_mag <= bright.faintest))
    inside = rng.permutation(inside)[situation.missing :]
    worst = np.radians(WORST_ARCMIN / 60.0)
    if law == "disc":
        off = _disc(rng, len(inside)) * worst
    else:
        off = rng.normal(0.0, worst / 3.0, (len(inside), 2))
        off *= np.minimum(1.0, worst / np.maximum(np.hypot(*off.T), 1e-12))[:, None]
    for k in range(min(situation.outside, len(inside))):
        turn, far = rng.uniform(0, 2 * np.pi), worst * rng.uniform(1.0, 2.0)
        off[k] = far * np.array([np.cos(turn), np.sin(turn)])
    # moved across themselves by small angles
    east = unit(np.cross([0.0, 1.0, 0.0], body[inside]))
    xy = lens.project(body[inside] + off[:, :1] * east + off[:, 1:] * np.cross(body[inside], east))
    false = _disc(rng, situation.false) * PIXELS / 2.0 + (PIXELS - 1) / 2.0
    xy = np.concatenate([xy, false])
    mag = np.concatenate([seen_mag[inside], rng.choice(bright.mag, len(false))])
    detections = Detections.from_list(xy, PIXELS, PIXELS, 10.0 ** (-0.4 * mag))
    return RandomField(detections, lens, attitude, len(inside))


def repeated(rng: np.random.Generator, count: int) -> Iterator[RandomField]:
    """Pictures of one field, each with errors of its own."""
    attitude = random_attitude(rng)
    for _ in range(count):
        yield picture(rng, SITUATIONS[0], attitude=attitude)


def _disc(rng: np.random.Generator, count: int) -> Floats:
    """Points (N, 2) spread evenly over the unit circle."""
    turn, radius = rng.uniform(0, 2 * np.pi, count), np.sqrt(rng.uniform(0, 1, count))
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
