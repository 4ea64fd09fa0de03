"""What every reader of a foreign catalogue gives."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class ForeignStars:
    """Stars (N,) at ``epoch``: ICRS degrees, V or nearly, and NaN for what is not known.

    ``pm_mas`` (N, 2) is pmRA*, pmDE in mas/yr. ``epoch`` None when the files do not say.
    """

    ra_deg: Floats
    dec_deg: Floats
    mag: Floats
    bv: Floats
    pm_mas: Floats
    epoch: float | None
    source: str

    def __len__(self) -> int:
        return len(self.mag)

    @classmethod
    def bare(
        cls, ra_deg: Floats, dec_deg: Floats, mag: Floats, epoch: float | None, source: str
    ) -> "ForeignStars":
        """Stars of which only place and magnitude are known."""
        nan = np.full(len(mag), np.nan)
        return cls(ra_deg, dec_deg, mag, nan, np.stack([nan, nan], axis=1), epoch, source)


def v_of_gaia(g: Floats, bp_rp: Floats) -> tuple[Floats, Floats]:
    """V and B-V of Gaia's G and BP-RP; where the colour is unknown V = G + 0.2 and B-V is NaN.

    Polynomials of the Gaia EDR3 documentation, table 5.7, for -0.5 < BP-RP < 4 (the colour is
    held to where they were fitted); 0.2 is the mean of V - G over stars of the field.
    """
    x = np.clip(bp_rp, -0.5, 4.0)
    v = g + 0.02704 - 0.01424 * x + 0.2156 * x**2 - 0.01426 * x**3
    b = g - 0.01448 + 0.6874 * x + 0.3604 * x**2 - 0.06718 * x**3 + 0.006061 * x**4
    return np.where(np.isnan(x), g + 0.2, v), np.where(np.isnan(x), np.nan, b - v)
