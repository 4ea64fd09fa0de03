"""Stars as connected bright pixels: clusters grown in one pass, and contours above a threshold.

Source: the thesis on attitude from stellar images, section 2.2, equations 2.1 and 2.2; its
parameters are those of section 4.2.1.
"""

from typing import ClassVar

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.frame import Detections, Frame
from kochab.core.registry import choice, integer, number, switch
from kochab.core.values import frozen
from kochab.lab.detectors.background import Flat, measured_detections, no_detections, without_background
from kochab.lab.fixed_point import Format

# -- The centre of a cluster that grows pixel by pixel, in floating and in fixed point ---------
# The thesis "Attitude from stellar images", equations 2.1 and 2.2, sections 3.2 and 4.2.4.1: fixed centres are 10.22
# numbers that count from the middle of the frame, and no two are more than 512 px apart, the size of the largest
# frame there. The thesis does not say how it keeps a centre that is needed after every pixel; here each pixel moves
# it by its share of the light so far, cut off at the last bit.

PLACE = Format(10, 22)
LIGHT = Format(32, 0)  # the sum of the brightnesses


class FloatMean:
    """Sums of light; ``place`` is the centre so far, px."""

    __slots__ = ("light", "of_x", "of_y", "pixels", "place")

    def __init__(self, x: float, y: float, light: float) -> None:
        self.of_x, self.of_y, self.light, self.pixels = x * light, y * light, light, 1
        self.place = (x, y)

    def add(self, x: float, y: float, light: float) -> None:
        """Take one more pixel."""
        self.of_x += x * light
        self.of_y += y * light
        self.light += light
        self.pixels += 1
        self.place = self.of_x / self.light, self.of_y / self.light


class FixedMean:
    """Centres ``at_x`` and ``at_y`` as 10.22 integers; ``light`` is whole."""

    __slots__ = ("at_x", "at_y", "light", "pixels")

    def __init__(self, x: float, y: float, light: float) -> None:
        self.at_x, self.at_y = _number(x), _number(y)
        self.light, self.pixels = round(light), 1

    @property
    def place(self) -> tuple[float, float]:
        """The centre so far, px from the frame's middle."""
        return self.at_x * PLACE.step, self.at_y * PLACE.step

    def add(self, x: float, y: float, light: float) -> None:
        """Take one more pixel; FixedPointOverflowError when a sum has no room."""
        part = round(light)
        self.light = LIGHT.check(self.light + part)
        self.at_x = _moved(self.at_x, _number(x), part, self.light)
        self.at_y = _moved(self.at_y, _number(y), part, self.light)
        self.pixels += 1


def _number(value: float) -> int:
    """A place as a 10.22 integer."""
    return PLACE.check(int(value * (1 << PLACE.fraction)))


def _moved(centre: int, place: int, part: int, total: int) -> int:
    step = PLACE.check(place - centre) * part
    # Divided without the sign: // rounds towards minus infinity, and the centre would creep to the upper left.
    share = abs(step) // max(total, 1)
    return PLACE.check(centre + (share if step > 0 else -share))


MOST_PIXELS = 200_000


@frozen
class ClusterDetector:
    """Pixels within ``tau_px`` of a cluster's centre belong to it; others found a new one.

    The paper read its ``threshold`` of 51 of 255 off the dimmest pixels at the edges of its stars; None puts it at
    ``sigmas`` times the background's noise above the median. It takes the star of the most pixels for the
    brightest, the alternative to ``rank`` by is the flux. Only the 200,000 brightest pixels are looked at. Fixed
    ``arithmetic`` is that of the thesis' chapter 3; it raises FixedPointOverflowError when it runs out of bits.

    Of several centres in reach the nearest counts, which the paper leaves open. The weights of
    the centroids are brightnesses above the median; the paper's frames had a black sky.
    """

    paper: ClassVar[str] = "Attitude from stellar images, section 2.2"

    tau_px: float = number(8.0, "px", 1.0, 100.0, "a pixel so near a cluster's centre belongs to it")
    threshold: float | None = number(None, "grey levels", 0.0, 1e9, "brightness of a star's pixel", "by the noise")
    sigmas: float = number(5.0, "sigma", 0.1, 1000.0, "threshold above the noise")
    least_pixels: int = integer(10, "px", 1, 10_000, "smaller clusters are no stars")
    rank: str = choice("pixels", ("pixels", "flux"), "what makes a star the brightest")
    max_stars: int = integer(6000, "stars", 1, 200_000, "at most so many stars, the brightest")
    arithmetic: str = choice("float", ("float", "fixed"), "fixed: 32-bit integers, frames of at most 512 px")

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, in falling order of ``rank``."""
        flat = without_background(frame)
        if flat is None:
            return no_detections(frame)
        above = flat.threshold(self.sigmas, True)
        if self.threshold is not None:
            above = max(self.threshold - flat.level, 0.0)  # never below the median
        x, y, lights = _bright(flat, above)
        middle = (np.array([frame.width, frame.height]) - 1.0) / 2.0
        mean = FixedMean if self.arithmetic == "fixed" else FloatMean
        clusters = _clusters(x - middle[0], y - middle[1], lights, self.tau_px, mean)
        stars = [c for c in clusters if c.pixels >= self.least_pixels]
        light, pixels = (np.array([getattr(c, what) for c in stars], dtype=np.float64) for what in ("light", "pixels"))
        xy = np.array([c.place for c in stars], dtype=np.float64).reshape(-1, 2) + middle
        rank = pixels if self.rank == "pixels" else light
        return measured_detections(flat, xy, light, pixels, self.max_stars, rank)


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
        # A centre moves as pixels join it; in the wrong cell the search around a pixel would miss it.
        if before != after:
            cells[before].remove(chosen)
            cells.setdefault(after, []).append(chosen)
    return clusters


# -- Stars as connected regions above a threshold, at their centre of gravity ------------------
# Source: "Lost in space" for robotic telescopes (thesis, 2018), section 5.1.4, equations 5.1 and
# 5.2. The thesis takes OpenCV's contours; the pixels inside a contour are those scipy labels.


@frozen
class ContourDetector:
    """Pixels above the threshold that touch, corners included, are one star.

    The threshold is the thesis'; of ``least_pixels`` it says nothing.
    """

    paper: ClassVar[str] = "Lost in space for robotic telescopes, 2018, section 5.1.4"

    sigmas: float = number(5.0, "sigma", 0.1, 1000.0, "threshold")
    clipped: bool = switch(False, "sigma is the background's noise, not that of all pixels")
    least_pixels: int = integer(1, "px", 1, 10_000, "smaller regions are no stars")
    max_stars: int = integer(6000, "stars", 1, 200_000, "at most so many stars, the brightest")

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, brightest first."""
        from scipy.ndimage import label

        flat = without_background(frame)
        if flat is None:
            return no_detections(frame)
        above = flat.image > flat.threshold(self.sigmas, self.clipped)
        regions, count = label(above, np.ones((3, 3)))
        y, x = np.nonzero(above)
        region, light = regions[y, x] - 1, flat.image[y, x].astype(np.float64)
        pixels = np.bincount(region, minlength=count).astype(np.float64)
        flux, of_x, of_y = (
            np.asarray(np.bincount(region, weights, count), dtype=np.float64)
            for weights in (light, light * x, light * y)
        )
        xy = np.stack([of_x, of_y], axis=1) / flux[:, None]
        keep = pixels >= self.least_pixels
        return measured_detections(flat, xy[keep], flux[keep], pixels[keep], self.max_stars)
