"""Renders a live frame for the screen in a few ms: binned, stretched, with its levels."""

from dataclasses import dataclass, field
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QImage

from kochab.core.arrays import Array
from kochab.core.frame import Frame
from kochab.core.progress import run
from kochab.window.image.frame_image import BINS, ScreenStretch, automatic, storable
from kochab.window.image.screen_image import BLUE, GREEN, GREY, RED, Parts, Planes, RenderedFrame, Tables

SMALLEST_PX = 200


def binned(stored: Array, scale: float, mosaic: bool = False) -> Array:
    """Bin 2 x 2 until a pixel is about one of the screen.

    A mosaic is binned at least once, which makes it grey.
    """
    must = mosaic
    while (scale <= 0.5 and min(stored.shape) >= 2 * SMALLEST_PX) or (must and min(stored.shape) >= 2):
        high, wide = stored.shape[0] // 2 * 2, stored.shape[1] // 2 * 2
        kind = np.uint16 if stored.dtype == np.uint8 else np.uint32
        rows = np.add(stored[0:high:2, :wide], stored[1:high:2, :wide], dtype=kind)
        total = rows[:, 0::2] + rows[:, 1::2]
        total >>= 2
        stored = total.astype(stored.dtype)
        scale, must = scale * 2.0, False
    return stored


@dataclass(frozen=True, slots=True, eq=False)
class Channels:
    """``planes`` are red, green and blue (H, W); ``gain`` times a value is one of ``pixels``."""

    planes: tuple[Array, Array, Array]
    gain: float = 1.0

    def skies(self) -> tuple[float, float, float]:
        """The levels of the sky, in the units of the frame's ``pixels``."""
        red, green, blue = (self.gain * sky_level(p[::3, ::3]) for p in self.planes)
        return red, green, blue


def sky_level(values: Array) -> float:
    """The mean of the middle half of ``values``: a median that is no whole number."""
    low, high = np.percentile(values, (25, 75))
    return float(np.mean(values[(values >= low) & (values <= high)]))


def channels(frame: Frame, stored: Array, scale: float) -> Channels | None:
    """The colours of a frame at ``scale`` screen px a px of the frame; None when it has none.

    ``stored`` are its pixels as they are shown. The four pixels of a Bayer cell become one.
    """
    if frame.colour is not None:
        colour = run(storable(frame.colour))
        # Luminance of 8 bits is kept whole, as R + 2 G + B.
        gain = 4.0 if colour.dtype == np.uint8 and stored.dtype == np.uint16 else 1.0
        red, green, blue = (binned(colour[..., c], scale) for c in range(3))
        return Channels((red, green, blue), gain)
    if frame.bayer is None or len(frame.bayer) != 4 or min(stored.shape) < 2:
        return None
    red, green, blue = (binned(p, 2.0 * scale) for p in _cells(stored, frame.bayer))
    return Channels((red, green, blue))


def _cells(mosaic: Array, pattern: str) -> tuple[Array, Array, Array]:
    """Red, the mean of both greens, and blue of each 2 x 2 cell."""
    high, wide = mosaic.shape[0] // 2 * 2, mosaic.shape[1] // 2 * 2
    at: dict[str, list[Array]] = {"R": [], "G": [], "B": []}
    for number, letter in enumerate(pattern):
        at[letter].append(mosaic[number // 2 : high : 2, number % 2 : wide : 2])
    first, second = at["G"]
    green = (first >> 1) + (second >> 1) + (first & second & 1)
    return at["R"][0], green, at["B"][0]


STATISTICS_EVERY_S = 0.5
SAMPLE = 100_000
FULL_16 = 65535.0


@dataclass(frozen=True, slots=True)
class DisplaySettings:
    """How to show frames: ``stretch`` is None for the automatic one.

    ``red`` shows red light only; ``scale`` is screen pixels per frame pixel; ``colour`` shows the
    colours of a colour camera, except in red.
    """

    stretch: ScreenStretch | None = None
    red: bool = False
    scale: float = 1.0
    colour: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """How a frame is exposed, as fractions of full scale.

    ``counts`` (BINS,) over the cube root of 0..1; ``sky`` is the median, ``top`` the brightest
    pixel but the hottest, ``clipped`` the share of pixels that are full.
    """

    counts: NDArray[np.float64] = field(default_factory=lambda: np.zeros(BINS))
    sky: float = 0.0
    top: float = 0.0
    clipped: float = 0.0


class LiveRenderer:
    """Keeps the stretch and the statistics from frame to frame; for one thread."""

    def __init__(self) -> None:
        self.levels = Levels()
        self._auto = ScreenStretch()
        self._range = (0.0, 1.0)
        self._histogram = np.zeros(BINS)
        self._measured_s = float("-inf")
        self._shifts = (0.0, 0.0, 0.0)
        self._tables = Tables()

    def picture(self, frame: Frame, settings: DisplaySettings) -> RenderedFrame:
        """The rendered frame."""
        stored = run(storable(frame.pixels))
        now = monotonic()
        if now - self._measured_s >= STATISTICS_EVERY_S:
            self._measured_s = now
            self._measure(frame, stored, settings)
        pixels = self._in_colour(frame, stored, settings)
        if pixels is None:
            shown = binned(stored, settings.scale, bool(frame.bayer))
            light = ((RED if settings.red else GREY, 0.0),)
            pixels = self._coloured((shown,), settings, light)
        high, wide = pixels.shape
        image = QImage(pixels.data, wide, high, 4 * wide, QImage.Format.Format_RGB32)
        return RenderedFrame(frame.width, frame.height, image, self._auto, self._histogram, pixels)

    def _in_colour(self, frame: Frame, stored: Array, settings: DisplaySettings) -> NDArray[np.uint32] | None:
        """The pixels of a colour frame, None when it is to be shown grey or red."""
        if settings.red or not settings.colour:
            return None
        found = channels(frame, stored, settings.scale)
        if found is None:
            return None
        red, green, blue = self._shifts
        return self._coloured(found.planes, settings, ((RED, red), (GREEN, green), (BLUE, blue)), found.gain)

    def _coloured(
        self, planes: Planes, settings: DisplaySettings, parts: Parts, gain: float = 1.0
    ) -> NDArray[np.uint32]:
        """0xffRRGGBB (H, W) of planes (H, W) of stored values."""
        return self._tables.coloured(planes, settings.stretch or self._auto, self._range, parts, gain)

    def _measure(self, frame: Frame, stored: Array, settings: DisplaySettings) -> None:
        """Another automatic stretch and other levels; a range that sliders stand on is held."""
        step = max(1, int(np.sqrt(stored.size / SAMPLE)))
        step += 1 - step % 2  # an odd step sees all four colours of a mosaic
        sample = stored[::step, ::step]
        if settings.stretch is None or self._range == (0.0, 1.0):
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
