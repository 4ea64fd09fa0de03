"""Fields like the photographs of "Lost in space" for robotic telescopes, and what it knows of them.

The readings are told in :mod:`app.bench.papers_robotic`.
"""

from dataclasses import replace

import numpy as np

from app.bench.papers_default import knowing
from app.core.camera import Camera
from app.identify.pairs import Pairs, catalogue_pairs
from app.identify.refusals import table_deg
from app.simulate.fields import Field, FieldPlan, random_field
from app.sky import open_catalogue
from app.solve.options import SolveOptions

WIDTH_DEG, SCALE = 15.0, 15.8  # arcsec a pixel, the middle one of table 7.1
MARGIN_PX, MAG_LIMIT = 2.464, 5.9
LENS_PX = 3.0  # at the corner
FLAWED = 0.05  # share of stars that are missing, and of false ones
STARS = (4, 5, 6, 8, 10, 15, 20, 30)
LENS_SHARE = 0.01  # the scale is known no better than the lens keeps it


def fields(
    count: int, seed: int, scale: float = SCALE, brightest: int = 15, lens_px: float = LENS_PX,
    flawed: float = FLAWED,
) -> list[Field]:  # fmt: skip
    """Random fields of the plan above; the same ones for a seed, whatever is ``brightest``.

    ``lens_px`` is the lens' shift of the corners, ``flawed`` the share of stars that are missing,
    and of false ones.
    """
    rng, catalogue = np.random.default_rng(seed), open_catalogue()
    size, half = round(WIDTH_DEG * 3600.0 / scale), float(np.tan(np.radians(WIDTH_DEG / 2.0)))
    plan = FieldPlan(
        WIDTH_DEG, size, noise_px=0.32, missing=flawed, spurious=flawed, magnitude_scatter=0.2,
        brightest=max(STARS), k1=lens_px / (size / 2.0 / half) / (np.sqrt(2.0) * half) ** 3,
    )  # fmt: skip
    made = [random_field(catalogue, rng, plan) for _ in range(count)]
    return [replace(f, detections=f.detections.take(slice(0, brightest))) for f in made]


def plain(field: Field) -> Camera:
    """The camera as the thesis knows it: no distortion."""
    c = field.camera
    return Camera.centred(c.width, c.height, c.focal_px, c.mirrored)


def pairs_of(field: Field) -> Pairs:
    """The thesis' table of pairs as wide as the field."""
    angle = table_deg(field.detections, field.camera.focal_px)
    return catalogue_pairs(angle, mag_limit=MAG_LIMIT)


def options(field: Field) -> SolveOptions:
    """The default's, with the scale that voting knows."""
    return knowing(field.camera.scale_arcsec_px, LENS_SHARE)
