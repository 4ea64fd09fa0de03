"""What a detector found in a frame."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """Stars of one frame, brightest first; all per-star arrays share the length N.

    ``xy`` (N, 2) float64 px, (0, 0) is the centre of the first pixel, x right, y down.
    ``flux`` (N,) in the frame's units above background; ``snr`` (N,); ``fwhm_px`` (N,);
    ``elongation`` (N,) major over minor axis, 1 is round; ``angle_rad`` (N,) of the major axis
    from +x towards +y; ``saturated`` and ``blended`` (N,) bool.
    ``background`` and ``noise`` are the frame's median level and RMS per pixel.
    """

    width: int
    height: int
    xy: Floats
    flux: Floats
    snr: Floats
    fwhm_px: Floats
    elongation: Floats
    angle_rad: Floats
    saturated: NDArray[np.bool_]
    blended: NDArray[np.bool_]
    background: float = float("nan")
    noise: float = float("nan")

    def __len__(self) -> int:
        return len(self.xy)

    def take(self, index: NDArray[np.intp] | NDArray[np.bool_] | slice) -> "Detections":
        """The same frame with only the stars ``index`` selects, in that order."""
        kept = {
            f.name: getattr(self, f.name)[index]
            for f in fields(self)
            if isinstance(getattr(self, f.name), np.ndarray)
        }
        rest = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in kept}
        return Detections(**kept, **rest)

    @classmethod
    def from_list(
        cls, xy: Floats, width: int, height: int, flux: Floats | None = None
    ) -> "Detections":
        """Detections from bare positions (N, 2) px; brightest first unless ``flux`` says."""
        xy = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        n = len(xy)
        if flux is None:
            flux = np.arange(n, 0, -1, dtype=np.float64)
        order = np.argsort(-np.asarray(flux, dtype=np.float64), kind="stable")
        nan = np.full(n, np.nan)
        no = np.zeros(n, dtype=np.bool_)
        return cls(
            width, height, xy[order], np.asarray(flux, dtype=np.float64)[order],
            nan, nan, nan, nan, no, no,
        )  # fmt: skip
