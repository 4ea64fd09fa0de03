"""The cells in which an astrometry.net index keeps only so many stars: HEALPix of any size.

Which cell a star falls in tells whether a star that the index lacks may have been left out for
room: only if the cell is full, and of stars that are all about as bright or brighter. (That no
cell of the Tycho-2 index holds more than ten, and 89,088 hold ten as its header says, is the
proof that the cells are the right ones.)
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SIDE = 156  # cells along each of the 12 base squares: 22.55 arcmin
KEPT = 10  # stars kept in each cell
VT_MARGIN = 0.35  # VT is fainter than V by 0.1 on average, of red stars by 0.3


def cell_of(vector: Floats, side: int = SIDE) -> NDArray[np.int64]:
    """The HEALPix cell (N,), 0 to 12 side^2 - 1, of unit vectors (N, 3).

    Gorski et al. 2005, ApJ 622, 759, section 4; the numbering is our own, only cells matter.
    """
    z = vector[:, 2]
    turn = (np.arctan2(vector[:, 1], vector[:, 0]) / (np.pi / 2)) % 4.0
    sector = np.minimum(turn.astype(np.int64), 3)
    along = turn - sector
    # Caps: cell borders are where sqrt(3 (1 - |z|)) times the angle from a side is constant.
    reach = np.sqrt(3.0 * (1.0 - np.abs(z)))
    kx, ky = reach * (1.0 - along), reach * along
    north = z > 2.0 / 3.0
    cap = np.abs(z) > 2.0 / 3.0
    # The belt: straight lines in (longitude, z), in diamonds above, below and between sectors.
    height = (z + 2.0 / 3.0) * 0.75
    p, q = height + along, height - along + 1.0
    right, left = p >= 1.0, q >= 1.0
    one_side = np.where(right, 4 + (sector + 1) % 4, np.where(left, 4 + sector, 8 + sector))
    square = np.where(right & left, sector, one_side)
    x = np.where(cap, np.where(north, 1.0 - kx, ky), p - right)
    y = np.where(cap, np.where(north, 1.0 - ky, kx), q - left)
    square = np.where(cap, np.where(north, sector, 8 + sector), square)
    column = np.clip((x * side).astype(np.int64), 0, side - 1)
    row = np.clip((y * side).astype(np.int64), 0, side - 1)
    return np.asarray((square * side + column) * side + row)


def crowded_out(vector: Floats, mag: Floats, kept: Floats, kept_vt: Floats) -> NDArray[np.bool_]:
    """Whether stars (N,) of V ``mag`` may lack in an index with stars ``kept`` (K, 3) for room."""
    cells = 12 * SIDE * SIDE
    home = cell_of(kept)
    count = np.bincount(home, minlength=cells)
    faintest = np.full(cells, -np.inf)
    np.maximum.at(faintest, home, kept_vt)
    cell = cell_of(vector)
    return np.asarray((count[cell] >= KEPT) & (faintest[cell] < mag + VT_MARGIN))
