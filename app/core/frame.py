"""A picture of the sky in memory."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from app.core.hint import Hint


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One exposure as read from a file or a camera.

    ``pixels`` (H, W), native dtype, native byte order, C-contiguous, row 0 at the top of the
    screen: what detection sees (luminance, or the raw mosaic when ``bayer`` names its pattern,
    e.g. ``"RGGB"``, read from pixel (0, 0)). ``colour`` (H, W, 3) is kept for display only.
    ``saturation`` is the level at which pixels clip, in the units of ``pixels``, None if unknown.
    ``warnings`` are sentences for the person; ``header`` is whatever the file said of itself.
    """

    pixels: NDArray[Any]
    colour: NDArray[Any] | None = None
    bayer: str | None = None
    saturation: float | None = None
    path: str = ""
    hint: Hint = field(default_factory=Hint)
    warnings: tuple[str, ...] = ()
    header: Mapping[str, Any] = field(default_factory=dict)

    @property
    def width(self) -> int:
        """Columns."""
        return int(self.pixels.shape[1])

    @property
    def height(self) -> int:
        """Rows."""
        return int(self.pixels.shape[0])
