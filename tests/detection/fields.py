"""Rendered fields with known stars, small enough for a test."""

import numpy as np
from scipy.spatial import cKDTree

from kochab.core.frame import Detections, Frame
from kochab.detection import DETECTORS
from kochab.simulate.star_images import RenderedStar, Sky, render

SIZE = (640, 480)


def stars(n=40, seed=1, faintest=4000.0, size=SIZE, apart=25.0):
    """Places on a shuffled grid, so that none is blended, and fluxes over 3 magnitudes."""
    rng = np.random.default_rng(seed)
    columns, rows = (int((side - 40) // apart) for side in size)
    cells = rng.permutation(columns * rows)[:n]
    xy = 20 + apart * np.stack([cells % columns, cells // columns], axis=1)
    xy = xy + rng.uniform(0.2 * apart, 0.8 * apart, (n, 2))
    return xy, faintest * 10 ** rng.uniform(0, 1.2, n)


def field(image=None, sky=None, sensor=None, seed=1, size=SIZE, **options):
    xy, flux = stars(seed=seed, size=size, **options)
    sky = sky or Sky(400.0, (80.0, 60.0))
    return render(*size, xy, flux, image or RenderedStar(3.0), sky, sensor, seed), xy, flux


def detect(frame) -> Detections:
    frame = frame if isinstance(frame, Frame) else Frame(np.ascontiguousarray(frame))
    return DETECTORS.make("auto").detect(frame)


def compare(detections, xy, radius=1.5):
    """(share of the true found, share of the found true, RMS error px along an axis)."""
    if not len(detections):
        return 0.0, float("nan"), float("nan")
    away, _ = cKDTree(xy).query(detections.xy)
    to, _ = cKDTree(detections.xy).query(xy)
    true = away <= radius
    return (to <= radius).mean(), true.mean(), float(np.sqrt((away[true] ** 2).mean() / 2))
