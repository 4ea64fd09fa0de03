"""A detector on parts of a frame, each by its own sharpness and light: what is no sky spoils only its own part."""

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from kochab.core.frame import Detections, Frame

if TYPE_CHECKING:
    from kochab.detection import Detector

TILES = 3  # to a side
MARGIN_PX = 24  # beyond a tile: stars at its edge are seen whole
SMALLEST_PX = 120  # a side of a tile; smaller ones do not tell stars from the rest


def detect_in_tiles(frame: Frame, detector: "Detector") -> Detections:
    """Stars of ``frame``, brightest first, as ``detector`` finds them in each of nine parts alone."""
    height, width = frame.pixels.shape
    if min(height, width) < TILES * SMALLEST_PX:
        return detector.detect(frame)
    edges_x, edges_y = (np.linspace(0, side, TILES + 1).astype(int).tolist() for side in (width, height))
    parts = []
    for left, right in pairwise(edges_x):
        for top, bottom in pairwise(edges_y):
            x, y = (max(0, edge - MARGIN_PX) // 2 * 2 for edge in (left, top))  # a mosaic begins as the frame's
            pixels = np.ascontiguousarray(frame.pixels[y : bottom + MARGIN_PX, x : right + MARGIN_PX])
            found = detector.detect(replace(frame, pixels=pixels, colour=None))
            xy = found.xy + np.array([x, y])
            own = ((xy >= [left - 0.5, top - 0.5]) & (xy < [right - 0.5, bottom - 0.5])).all(axis=1)
            parts.append(replace(found, width=width, height=height, xy=xy).take(own))
    joined = Detections.joined(parts)
    return joined.take(np.argsort(-joined.flux, kind="stable"))
