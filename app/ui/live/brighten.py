"""A live frame made ready for the screen in a few ms: binned, stretched, and its levels told."""

from dataclasses import dataclass, field
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QImage

from app.core.frame import Frame
from app.core.progress import run
from app.ui.picture import BINS, storable
from app.ui.ready_picture import ReadyPicture
from app.ui.stretch import Stretch, automatic

Array = NDArray[Any]
LOOK_S = 0.5  # between two looks at the statistics
SAMPLE = 100_000
SMALLEST_PX = 200
FULL_16 = 65535.0


@dataclass(frozen=True, slots=True)
class Look:
    """How frames are to be shown: ``stretch`` is None for the automatic one.

    ``red`` is for red light alone; ``scale`` is in screen px a px of the frame.
    """

    stretch: Stretch | None = None
    red: bool = False
    scale: float = 1.0


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
        self._key: object = None
        self._table: NDArray[np.uint32] = np.zeros(0, np.uint32)

    def picture(self, frame: Frame, look: Look) -> ReadyPicture:
        """The frame as it is to be shown."""
        stored = run(storable(frame.pixels))
        now = monotonic()
        if now - self._looked_s >= LOOK_S:
            self._looked_s = now
            self._look_at(frame, stored, look)
        shown = binned(stored, look.scale, bool(frame.bayer))
        pixels = np.take(self._lut(stored.dtype, look), shown, mode="clip")
        high, wide = pixels.shape
        image = QImage(pixels.data, wide, high, 4 * wide, QImage.Format.Format_RGB32)
        return ReadyPicture(
            frame.width, frame.height, image, self._auto, self._histogram, pixels
        )  # fmt: skip

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
        low, high = self._range
        self._histogram = _counts((sample - low) / max(high - low, 1e-9))
        raw = np.asarray(frame.pixels[::step, ::step], dtype=np.float64)
        self.levels = levels_of(raw[np.isfinite(raw)], full_scale(frame))

    def _lut(self, kind: np.dtype[Any], look: Look) -> NDArray[np.uint32]:
        """Stored value -> the colour of a pixel, 0xffRRGGBB."""
        stretch = look.stretch or self._auto
        key = (stretch, self._range, look.red, kind)
        if key != self._key:
            size = 256 if kind == np.uint8 else 65536
            bright = stretch.table(size, *self._range).astype(np.uint32)
            colour = 0x010000 if look.red else 0x010101
            table = bright * np.uint32(colour) + np.uint32(0xFF000000)
            self._table, self._key = table.astype(np.uint32), key
        return self._table


def binned(stored: Array, scale: float, mosaic: bool = False) -> Array:
    """Means of 2 x 2 px, again and again until a px is about one of the screen.

    A mosaic is binned at least once, which makes it grey.
    """
    must = mosaic
    while (scale <= 0.5 and min(stored.shape) >= 2 * SMALLEST_PX) or (
        must and min(stored.shape) >= 2
    ):
        high, wide = stored.shape[0] // 2 * 2, stored.shape[1] // 2 * 2
        kind = np.uint16 if stored.dtype == np.uint8 else np.uint32
        rows = np.add(stored[0:high:2, :wide], stored[1:high:2, :wide], dtype=kind)
        total = rows[:, 0::2] + rows[:, 1::2]
        total >>= 2
        stored = total.astype(stored.dtype)
        scale, must = scale * 2.0, False
    return stored


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
