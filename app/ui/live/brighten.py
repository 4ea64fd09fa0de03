"""A live frame made ready for the screen in a few ms: binned, stretched, and its levels told."""

from dataclasses import dataclass, field
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QImage

from app.core.frame import Frame
from app.core.progress import run
from app.ui.live.binning import binned
from app.ui.live.channels import channels, sky_level
from app.ui.live.tables import BLUE, GREEN, GREY, RED, Tables
from app.ui.picture import BINS, storable
from app.ui.ready_picture import ReadyPicture
from app.ui.stretch import Stretch, automatic

Array = NDArray[Any]
LOOK_S = 0.5  # between two looks at the statistics
SAMPLE = 100_000
FULL_16 = 65535.0


@dataclass(frozen=True, slots=True)
class Look:
    """How frames are to be shown: ``stretch`` is None for the automatic one.

    ``red`` is for red light alone; ``scale`` is in screen px a px of the frame; ``colour`` shows
    the colours of a camera that has them, by any light but red.
    """

    stretch: Stretch | None = None
    red: bool = False
    scale: float = 1.0
    colour: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """How a frame is exposed, in shares of what the camera can hold.

    ``counts`` (BINS,) over the cube root of 0..1; ``sky`` is the median, ``top`` the brightest
    pixel but the hottest, ``clipped`` the share of pixels that are full.
    """

    counts: NDArray[np.float64] = field(default_factory=lambda: np.zeros(BINS))
    sky: float = 0.0
    top: float = 0.0
    clipped: float = 0.0


class Brightener:
    """Keeps the stretch and the statistics from frame to frame; for one thread."""

    def __init__(self) -> None:
        self.levels = Levels()
        self._auto = Stretch()
        self._range = (0.0, 1.0)
        self._histogram = np.zeros(BINS)
        self._looked_s = float("-inf")
        self._shifts = (0.0, 0.0, 0.0)
        self._tables = Tables()

    def picture(self, frame: Frame, look: Look) -> ReadyPicture:
        """The frame as it is to be shown."""
        stored = run(storable(frame.pixels))
        now = monotonic()
        if now - self._looked_s >= LOOK_S:
            self._looked_s = now
            self._look_at(frame, stored, look)
        pixels = self._in_colour(frame, stored, look)
        if pixels is None:
            shown = binned(stored, look.scale, bool(frame.bayer))
            light = ((RED if look.red else GREY, 0.0),)
            pixels = self._lit((shown,), look, light)
        high, wide = pixels.shape
        image = QImage(pixels.data, wide, high, 4 * wide, QImage.Format.Format_RGB32)
        return ReadyPicture(
            frame.width, frame.height, image, self._auto, self._histogram, pixels
        )  # fmt: skip

    def _in_colour(self, frame: Frame, stored: Array, look: Look) -> NDArray[np.uint32] | None:
        """The pixels of a colour frame, None when it is to be shown grey or red."""
        if look.red or not look.colour:
            return None
        found = channels(frame, stored, look.scale)
        if found is None:
            return None
        red, green, blue = self._shifts
        return self._lit(
            found.planes, look, ((RED, red), (GREEN, green), (BLUE, blue)), found.gain
        )  # fmt: skip

    def _lit(
        self, planes: tuple[Array, ...], look: Look, parts: tuple[tuple[int, float], ...],
        gain: float = 1.0,
    ) -> NDArray[np.uint32]:  # fmt: skip
        """0xffRRGGBB (H, W) of planes (H, W) of stored values."""
        stretch = look.stretch or self._auto
        tables = self._tables.get(planes[0].dtype, stretch, self._range, parts, gain)
        first, *others = (
            np.take(table, plane, mode="clip") for table, plane in zip(tables, planes, strict=True)
        )
        for other in others:
            first |= other
        return np.asarray(first)

    def _look_at(self, frame: Frame, stored: Array, look: Look) -> None:
        """Another automatic stretch and other levels; a range that sliders stand on is held."""
        step = max(1, int(np.sqrt(stored.size / SAMPLE)))
        step += 1 - step % 2  # an odd step sees all four colours of a mosaic
        sample = stored[::step, ::step]
        if look.stretch is None or self._range == (0.0, 1.0):
            # A mosaic's sky is that of its mean colour.
            whole = binned(stored, 0.5, True)[::step, ::step] if frame.bayer else sample
            self._auto, low, high = automatic(np.ascontiguousarray(whole))
            self._range = (low, high)
            self._shifts = self._sky_shifts(frame, stored, sky_level(whole))
        low, high = self._range
        self._histogram = _counts((sample - low) / max(high - low, 1e-9))
        raw = np.asarray(frame.pixels[::step, ::step], dtype=np.float64)
        self.levels = levels_of(raw[np.isfinite(raw)], full_scale(frame))

    def _sky_shifts(self, frame: Frame, stored: Array, sky: float) -> tuple[float, float, float]:
        """What the skies of red, green and blue stand above the mean one, to be shown grey."""
        few = None if self._auto.mid >= 0.5 else channels(frame, stored, 1.0)
        if few is None:
            return 0.0, 0.0, 0.0
        red, green, blue = few.skies()
        return red - sky, green - sky, blue - sky


def full_scale(frame: Frame) -> float:
    """The level at which the camera's pixels are full, as well as it is known."""
    if frame.saturation is not None:
        return float(frame.saturation)
    if np.issubdtype(frame.pixels.dtype, np.integer):
        return float(np.iinfo(frame.pixels.dtype).max)
    return FULL_16 if float(np.nanmax(frame.pixels)) > 1.0 else 1.0


def levels_of(values: NDArray[np.float64], full: float) -> Levels:
    """How the pixels ``values`` (N,) of a frame fill a camera that holds ``full``."""
    if not values.size or full <= 0:
        return Levels()
    shares = values / full
    top = float(np.partition(shares, -2)[-2]) if shares.size > 1 else float(shares[0])
    clipped = float(np.mean(shares >= 0.98))
    return Levels(_counts(shares), float(np.median(shares)), top, clipped)


def _counts(shares: NDArray[Any]) -> NDArray[np.float64]:
    """Counts (BINS,) of shares over the cube root of 0..1."""
    across = np.cbrt(np.clip(shares, 0.0, 1.0, dtype=np.float64)).ravel() * (BINS - 1)
    return np.bincount(across.astype(np.intp), minlength=BINS).astype(np.float64)
