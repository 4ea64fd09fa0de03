"""How bright the Milky Way is, from the stars of the catalogue itself: no picture of it is shipped.

Stars of V 7.5 to 10.2, in which the catalogue is whole everywhere, stand three to ten times as close in the plane as at
its poles. Their density by galactic longitude and latitude, smoothed, has the star clouds and the dark lane in Cygnus.
"""

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import cross_product, unit_vectors
from kochab.core.progress import Progress, Task
from kochab.core.values import frozen
from kochab.sky.catalogue import Catalogue
from kochab.sky.sky_tables import GALACTIC_POLE_DEG

CENTRE_DEG = (266.4050042, -28.9361739)
"""ICRS of the origin of galactic longitude (Hipparcos and Tycho catalogues, 1997, vol. 1, 1.5.3)."""
BRIGHTEST_V, FAINTEST_V = 7.5, 10.2  # brighter stars are seen one by one; fainter ones the catalogue thins in the plane
SMOOTH_DEG = 1.8  # one sigma: as the eye sees it
DARKEST, BRIGHTEST = 2.4, 6.5  # times the density around the poles: nothing, and all that is shown
CHUNK = 400_000  # stars at once


@frozen(eq=False)
class MilkyWay:
    """``light`` (180, 360), 0 to 1, by galactic latitude from -90 and longitude from 0, a degree each."""

    light: Floats

    def brightness(self, vectors: Floats) -> Floats:
        """How bright it is (N,), 0 to 1, in ICRS directions (N, 3); 0 for NaN. Between cells it is interpolated."""
        turned = np.nan_to_num(vectors) @ to_galactic().T
        longitude = np.degrees(np.arctan2(turned[:, 1], turned[:, 0])) % 360.0
        latitude = np.degrees(np.arcsin(np.clip(turned[:, 2], -1.0, 1.0)))
        x, y = longitude - 0.5, np.clip(latitude + 89.5, 0.0, 178.999)
        left, low = np.floor(x).astype(int), np.floor(y).astype(int)
        across, up = x - left, y - low
        left, right = left % 360, (left + 1) % 360
        lower = self.light[low, left] * (1.0 - across) + self.light[low, right] * across
        upper = self.light[low + 1, left] * (1.0 - across) + self.light[low + 1, right] * across
        return np.asarray(np.where(np.isfinite(vectors).all(axis=1), lower * (1.0 - up) + upper * up, 0.0))


def to_galactic() -> Floats:
    """Rotation (3, 3) from ICRS to galactic axes: x to the origin of longitude, z to the north pole."""
    z = unit_vectors(*GALACTIC_POLE_DEG)
    centre = unit_vectors(*CENTRE_DEG)
    x = centre - (centre @ z) * z
    x /= np.linalg.norm(x)
    return np.stack([x, cross_product(z, x), z])


def milky_way(catalogue: Catalogue) -> Task[MilkyWay]:
    """Count the faint stars of a catalogue: half a second, once."""
    counts, turn = np.zeros(180 * 360), to_galactic().T
    for start in range(0, len(catalogue), CHUNK):
        yield Progress("milky way", start / len(catalogue))
        rows = np.arange(start, min(start + CHUNK, len(catalogue)))
        mag = catalogue.mag(rows)
        rows = rows[(mag > BRIGHTEST_V) & (mag < FAINTEST_V)]
        place = catalogue.vectors(rows) @ turn
        x = (np.degrees(np.arctan2(place[:, 1], place[:, 0])) % 360.0).astype(int) % 360
        y = np.clip((np.degrees(np.arcsin(np.clip(place[:, 2], -1.0, 1.0))) + 90.0).astype(int), 0, 179)
        counts += np.bincount(y * 360 + x, minlength=counts.size)
    area = np.cos(np.radians(np.arange(180) - 89.5))[:, None]
    stars, sky = _smoothed(counts.reshape(180, 360), area), _smoothed(np.broadcast_to(area, (180, 360)), area)
    density = stars / sky
    around_poles = np.median(density[[*range(30), *range(150, 180)]])
    return MilkyWay(np.clip((density / around_poles - DARKEST) / (BRIGHTEST - DARKEST), 0.0, 1.0))


def _smoothed(cells: Floats, area: Floats) -> Floats:
    """Cells (180, 360) smoothed by as much on the sky everywhere: at high latitude a degree of longitude is short."""
    up = np.exp(-0.5 * (np.arange(-30, 31) / SMOOTH_DEG) ** 2)
    down = np.stack([np.convolve(column, up, mode="same") for column in cells.T], axis=1)
    wave = np.fft.rfftfreq(360)  # cycles a degree of longitude
    sigma = np.minimum(SMOOTH_DEG / np.maximum(area, 1e-3), 90.0)
    return np.asarray(
        np.fft.irfft(np.fft.rfft(down, axis=1) * np.exp(-2.0 * (np.pi * sigma * wave) ** 2), n=360, axis=1)
    )
