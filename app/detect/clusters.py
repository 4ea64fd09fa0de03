"""Stars as clusters of bright pixels, found in one pass over the frame.

Source: the thesis on attitude from stellar images, section 2.2, equations 2.1 and 2.2; its
parameters are those of section 4.2.1.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from app.core.detections import Detections
from app.core.frame import Frame
from app.core.options import choice, integer, number
from app.detect.cluster_means import FixedMean, FloatMean
from app.detect.flat import Flat, described, nothing, without_background

Floats = NDArray[np.float64]
MOST_PIXELS = 200_000


@dataclass(frozen=True, slots=True)
class ClusterDetector:
    """Pixels within ``tau_px`` of a cluster's centre belong to it; others found a new one.

    ``tau_px`` and ``least_pixels``, below which a cluster is no star, are the paper's 8 and 10.
    ``threshold`` is in the frame's units. The paper read 51 of 255 off the dimmest pixels at the
    edges of its stars; None puts it at ``sigmas`` times the background's noise above the median.
    ``rank`` is the order of the result: the paper takes the star of the most "pixels" for the
    brightest, the alternative is "flux". At most ``max_stars`` are returned, from the 200,000
    brightest pixels. ``arithmetic`` is "float", or "fixed" for the 32-bit integers of the thesis'
    chapter 3, which need a frame of at most 512 px and raise FixedPointOverflowError when they run
    out of bits.

    Of several centres in reach the nearest counts, which the paper leaves open. The weights of
    the centroids are brightnesses above the median; the paper's frames had a black sky.
    """

    paper: ClassVar[str] = "Attitude from stellar images, section 2.2"

    tau_px: float = number(
        8.0, "px", 1.0, 100.0, "a pixel so near a cluster's centre belongs to it"
    )
    threshold: float | None = number(
        None, "grey levels", 0.0, 1e9, "brightness of a star's pixel", "by the noise"
    )
    sigmas: float = number(5.0, "sigma", 0.1, 1000.0, "threshold above the noise")
    least_pixels: int = integer(10, "px", 1, 10_000, "smaller clusters are no stars")
    rank: str = choice("pixels", ("pixels", "flux"), "what makes a star the brightest")
    max_stars: int = integer(6000, "stars", 1, 200_000, "at most so many stars, the brightest")
    arithmetic: str = choice(
        "float", ("float", "fixed"), "fixed: 32-bit integers, frames of at most 512 px"
    )

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, in falling order of ``rank``."""
        flat = without_background(frame)
        if flat is None:
            return nothing(frame)
        x, y, lights = _bright(flat, self._above(flat))
        middle = (np.array([frame.width, frame.height]) - 1.0) / 2.0
        mean = FixedMean if self.arithmetic == "fixed" else FloatMean
        clusters = _clusters(x - middle[0], y - middle[1], lights, self.tau_px, mean)
        stars = [c for c in clusters if c.pixels >= self.least_pixels]
        light, pixels = (
            np.array([getattr(c, what) for c in stars], dtype=np.float64)
            for what in ("light", "pixels")
        )
        xy = np.array([c.place for c in stars], dtype=np.float64).reshape(-1, 2) + middle
        rank = pixels if self.rank == "pixels" else light
        return described(flat, xy, light, pixels, self.max_stars, rank)

    def _above(self, flat: Flat) -> float:
        """The threshold above the median; never below the median itself."""
        if self.threshold is None:
            return flat.threshold(self.sigmas, True)
        return max(self.threshold - flat.level, 0.0)


def _bright(flat: Flat, threshold: float) -> tuple[Floats, Floats, Floats]:
    """x, y and light, each (M,), of pixels above the threshold, row by row from the top left."""
    at = np.flatnonzero(flat.image > threshold)
    light = flat.image.ravel()[at]
    if len(at) > MOST_PIXELS:
        brightest = np.sort(np.argpartition(-light, MOST_PIXELS)[:MOST_PIXELS])
        at, light = at[brightest], light[brightest]
    y, x = np.divmod(at, flat.image.shape[1])
    return x.astype(np.float64), y.astype(np.float64), light.astype(np.float64)


def _clusters(
    xs: Floats, ys: Floats, lights: Floats, tau: float, mean: type[FloatMean] | type[FixedMean]
) -> list[FloatMean | FixedMean]:
    """The clusters of pixels, oldest first.

    Centres are kept in cells of ``tau`` px, so that a pixel looks only at those around it.
    """
    cells: dict[tuple[int, int], list[FloatMean | FixedMean]] = {}
    clusters: list[FloatMean | FixedMean] = []
    reach2 = tau * tau
    for x, y, light in zip(xs.tolist(), ys.tolist(), lights.tolist(), strict=True):
        column, row = int(x // tau), int(y // tau)
        best, chosen = reach2, None
        for i in (column - 1, column, column + 1):
            for j in (row - 1, row, row + 1):
                for one in cells.get((i, j), ()):
                    at_x, at_y = one.place
                    away = (at_x - x) ** 2 + (at_y - y) ** 2
                    if away <= best:
                        best, chosen = away, one
        if chosen is None:
            clusters.append(mean(x, y, light))
            cells.setdefault((column, row), []).append(clusters[-1])
            continue
        old_x, old_y = chosen.place
        chosen.add(x, y, light)
        new_x, new_y = chosen.place
        before = (int(old_x // tau), int(old_y // tau))
        after = (int(new_x // tau), int(new_y // tau))
        if before != after:
            cells[before].remove(chosen)
            cells.setdefault(after, []).append(chosen)
    return clusters
