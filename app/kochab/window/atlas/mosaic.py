"""Frames that a camera would take, one or a mosaic of them, and their borders on the sky."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import attitude_from, radec_deg, unit
from kochab.core.camera import Camera
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.text.angle_text import AngleStyle, radec_plain

SIDE_POINTS = 17  # of a side of a frame: straight in the frame, it bends on the chart


@frozen
class Mosaic:
    """Frames of ``width_deg`` x ``height_deg`` side by side, each turned to the position angle ``rotation_deg``.

    ``overlap`` is the share of a side that neighbours have in common. A camera keeps its position angle from panel
    to panel on an equatorial mount, so near a pole their edges are not parallel.
    """

    width_deg: float
    height_deg: float
    rotation_deg: float = 0.0
    columns: int = 1
    rows: int = 1
    overlap: float = 0.15

    def centres(self, middle: Floats) -> Iterator[Floats]:
        """ICRS unit vectors (3,) of the panels around the middle (3,), row by row from the upper left."""
        x, y, z = attitude_from(*radec_deg(middle), self.rotation_deg).matrix
        across, down = (2.0 * np.tan(np.radians(side) / 2.0) for side in (self.width_deg, self.height_deg))
        for j in range(self.rows):
            for i in range(self.columns):
                u = (i - (self.columns - 1) / 2.0) * across * (1.0 - self.overlap)
                v = (j - (self.rows - 1) / 2.0) * down * (1.0 - self.overlap)
                yield unit(z + u * x + v * y)

    def panels(self, middle: Floats) -> list[Solution]:
        """The same as frames."""
        half = np.tan(np.radians(np.array([self.width_deg, self.height_deg])) / 2.0)
        width, height = np.maximum(1, np.rint(1000.0 * half / half.max())).astype(int).tolist()
        camera = Camera.centred(width, height, max(width, height) / (2.0 * float(half.max())))
        return [frame_at(camera, centre, self.rotation_deg) for centre in self.centres(middle)]

    def text(self, middle: Floats, style: AngleStyle) -> str:
        """A line of coordinates and position angle for each panel."""
        places = (radec_plain(*radec_deg(centre), style) for centre in self.centres(middle))
        return "".join(f"{n}\t{place}\t{self.rotation_deg:g}\n" for n, place in enumerate(places, 1))


def frame_at(camera: Camera, centre: Floats, roll_deg: float = 0.0) -> Solution:
    """A frame of a camera that looks at an ICRS unit vector (3,); no stars were found in it."""
    return Solution(camera, attitude_from(*radec_deg(centre), roll_deg), (), 0.0, 0.0, "")


def border(frame: Solution) -> Floats:
    """ICRS unit vectors (N, 3) along the edge of a frame, closed."""
    share = np.linspace(0.0, 1.0, SIDE_POINTS)[:, None]
    width, height = frame.camera.width - 0.5, frame.camera.height - 0.5
    corners = np.array([[-0.5, -0.5], [width, -0.5], [width, height], [-0.5, height], [-0.5, -0.5]])
    return frame.sky_at(np.concatenate([a + share * (b - a) for a, b in pairwise(corners)]))
