"""Fields of the shipped catalogue as a camera would record them, and an identifier that is told."""

from dataclasses import dataclass, replace

import numpy as np

from kochab.core.attitude import Attitude, attitude_from
from kochab.core.camera import Camera
from kochab.core.frame import Detections
from kochab.core.progress import Progress
from kochab.core.solution import Identification, Matches, NoSolution, Reason
from kochab.sky import open_catalogue
from kochab.solver.matches import field_centre, without_companions

YEAR = 2024.0


@dataclass(frozen=True)
class Field:
    """Detections, which catalogue row each is (-1: no star), and the truth."""

    detections: Detections
    rows: np.ndarray
    camera: Camera
    attitude: Attitude


def photograph(
    camera: Camera,
    attitude: Attitude,
    stars: int = 80,
    sigma_px: float = 0.2,
    spurious: int = 0,
    missing: float = 0.0,
    seed: int = 1,
) -> Field:
    """The field's brightest stars with noisy places, some missing, some that are no stars."""
    rng = np.random.default_rng(seed)
    catalogue = open_catalogue()
    centre, radius = field_centre(camera, attitude)
    rows = catalogue.brightest(centre, 1.2 * radius, 4 * stars, YEAR)
    xy = camera.project(catalogue.vectors(rows, YEAR) @ attitude.matrix.T)
    alone = without_companions(xy, 4.0)
    rows, xy = rows[alone], xy[alone]
    size = np.array([camera.width - 1, camera.height - 1])
    inside = np.flatnonzero(np.all((xy >= 0) & (xy <= size), axis=1))[:stars]
    inside = inside[rng.random(len(inside)) >= missing]
    rows, xy = rows[inside], xy[inside] + rng.normal(0, sigma_px, (len(inside), 2))
    flux = 10 ** (-0.4 * catalogue.mag(rows)) * 1e8
    xy = np.concatenate([xy, rng.uniform(0, 1, (spurious, 2)) * size])
    flux = np.concatenate([flux, rng.choice(flux, spurious)])
    rows = np.concatenate([rows, np.full(spurious, -1)])
    order = np.argsort(-flux, kind="stable")
    detections = Detections.from_list(xy, camera.width, camera.height, flux)
    return Field(detections, rows[order], camera, attitude)


def orion(width: int = 1600, height: int = 1000, fov_deg: float = 12.0, **terms) -> Field:
    """A well-filled field around Orion's belt."""
    focal = width / 2 / np.tan(np.radians(fov_deg / 2))
    camera = replace(Camera.centred(width, height, focal), **terms)
    return photograph(camera, attitude_from(84.0, -2.0, 25.0))


def told(field: Field, count: int = 8, within: float = 1.0) -> Identification:
    """What an identifier would say: the brightest few, within a share of the half width."""
    xy = field.detections.xy
    middle = np.array([(field.camera.width - 1) / 2, (field.camera.height - 1) / 2])
    near = np.hypot(*(xy - middle).T) <= within * field.camera.width / 2
    chosen = np.flatnonzero(near & (field.rows >= 0))[:count]
    rows = field.rows[chosen]
    matches = Matches(chosen, rows, xy[chosen], open_catalogue().vectors(rows, YEAR))
    plain = Camera.centred(field.camera.width, field.camera.height, field.camera.focal_px, field.camera.mirrored)
    return Identification(matches, plain, field.attitude, -12.0, "told", 3)


class Told:
    """An identifier whose answers a test sets: called with every (hint, year) it was asked."""

    field: Field
    asked: list  # type: ignore[type-arg]
    only_when_blind = False
    never = False
    steps = 1
    closed = False

    def identify(self, detections, hint=None, year=2016.0):
        kind = type(self)
        kind.asked.append((hint, year))
        try:
            for _ in range(kind.steps):
                yield Progress("identify")
        except GeneratorExit:
            kind.closed = True
            raise
        if kind.never or (kind.only_when_blind and hint is not None):
            return NoSolution(Reason.NO_PATTERN_AGREED, "", "told to refuse", len(detections))
        return told(kind.field)
