"""Single bright pixels as stars: a second look, for frames on which nothing else is a star.

Behind a short lens a star may light one pixel only, as simulated cameras draw it. It looks like a
hot pixel then, and the default detector drops it; only the sky can tell the two apart.
"""

import numpy as np

from app.core.detections import Detections
from app.core.frame import Frame
from app.detect.auto import MIN_SIDE, AutoDetector, quantum
from app.detect.hot import quick_look
from app.detect.mesh import measure_mesh
from app.detect.peaks import find_peaks
from app.detect.strips import halving
from app.detect.view import View

MOST = 200
"""A dark frame has thousands of hot pixels; a sky with as many stars has some that are wider."""


def single_pixels(frame: Frame, detector: AutoDetector) -> Detections:
    """The pixels of ``frame`` that ``detector`` takes for hot ones, brightest first."""
    pixels, how = frame.pixels, halving(frame.bayer)
    if pixels.ndim != 2 or min(pixels.shape) < MIN_SIDE:
        return Detections.from_list(np.empty((0, 2)), frame.width, frame.height)
    mesh = measure_mesh(pixels, how, quantum(pixels))
    xy, _ = find_peaks(pixels, how, mesh, 0.85 * detector.snr, 10 * MOST)
    if len(xy):
        _, xy = quick_look(View(pixels, how, mesh), xy, detector.snr)
    at = np.unique(xy.astype(np.intp), axis=0)
    at = at[(at >= 0).all(axis=1) & (at < pixels.shape[::-1]).all(axis=1)]
    level, _ = mesh.at(at[:, 0].astype(np.float64), at[:, 1].astype(np.float64))
    flux = pixels[at[:, 1], at[:, 0]].astype(np.float64) - level
    found = Detections.from_list(at.astype(np.float64), frame.width, frame.height, flux)
    return found.take(slice(MOST))
