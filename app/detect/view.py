"""What the steps of a detection share: the pixels and what is already known of them."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.detect.mesh import Mesh
from app.detect.stamps import Stamps, cut
from app.detect.strips import Halving, Pixels
from app.detect.weed import close_pairs

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Pixels (H, W), how they are halved, their background, and hot pixels (M, 2) as x, y."""

    pixels: Pixels
    how: Halving
    mesh: Mesh
    hot: Floats = field(default_factory=lambda: np.empty((0, 2)))

    def stamps(self, xy: Floats, half: int) -> tuple[Stamps, Floats, Floats]:
        """Stamps around places (N, 2) px without background and hot pixels, level and noise."""
        level, noise = self.mesh.at(xy[:, 0], xy[:, 1])
        stamps = cut(self.pixels, self.how, xy, level, half)
        if len(self.hot) and len(xy):
            leave_out(stamps, self.hot)
        return stamps, level, noise


def leave_out(stamps: Stamps, hot: Floats) -> None:
    """Give hot pixels (M, 2) no weight in those stamps that hold them, in place."""
    half = stamps.value.shape[1] // 2
    centres = np.stack([stamps.x, stamps.y], axis=1).astype(np.float64)
    star, other = close_pairs(np.concatenate([centres, hot]), 1.5 * half)
    mixed = (star < len(centres)) & (other >= len(centres))
    star, at = star[mixed], hot[other[mixed] - len(centres)].astype(np.intp)
    column, row = at[:, 0] - stamps.x[star] + half, at[:, 1] - stamps.y[star] + half
    inside = (abs(column - half) <= half) & (abs(row - half) <= half)
    star, column, row = star[inside], column[inside], row[inside]
    stamps.weight[star, row, column] = 0.0
    stamps.value[star, row, column] = 0.0
