"""What reaches the sensor in an exposure: starlight through air and cloud, and the sky's glow."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.core.camera import Camera
from app.simulate.exposure import Look, Paths
from app.simulate.sky_glow import Glow, airmass, lamps, surface_mag
from app.simulate.stars import Image
from app.simulate.weather import Weather

Floats = NDArray[np.float64]
COARSE = (19, 25)  # rows and columns of places where the glow is worked out


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """Electrons a second of a V = 0 star above the air, and the pixel's side on the sky."""

    zero_point_e_s: float
    scale_arcsec_px: float

    def electrons(self, mag: Floats, seconds: float) -> Floats:
        """Electrons of stars of these magnitudes."""
        return np.asarray(self.zero_point_e_s * seconds * 10.0 ** (-0.4 * mag))


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """Everything the light of one exposure depends on."""

    paths: Paths
    look: Look
    optics: Camera
    sensitivity: Sensitivity
    glow: Glow
    weather: Weather | None

    @property
    def seconds(self) -> float:
        """How long light is gathered."""
        return float(self.paths.times[-1] - self.paths.times[0])

    @property
    def middle(self) -> float:
        """Unix time of mid-exposure."""
        return float(self.paths.times[-1] + self.paths.times[0]) / 2.0

    def clouds(self, directions: Floats) -> Floats:
        """Magnitudes that clouds take towards directions (..., 3)."""
        if self.weather is None:
            return np.zeros(directions.shape[:-1])
        return self.weather.cloud_mag(directions, self.middle)


def starlight(light: Light) -> Floats:
    """Electrons (N,) that each star leaves on the sensor."""
    directions = light.paths.directions
    lost = light.glow.extinction * airmass(directions) + light.clouds(directions)
    return light.sensitivity.electrons(light.paths.mag + lost, light.seconds)


def sky_electrons(light: Light) -> Floats:
    """Electrons a pixel of the sky on a coarse grid (COARSE), edge to edge."""
    rows, columns = COARSE
    y = np.linspace(0.0, light.optics.height - 1.0, rows)
    x = np.linspace(0.0, light.optics.width - 1.0, columns)
    pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    directions = light.optics.unproject(pixels) @ light.look(light.middle)
    mag = surface_mag(directions, light.glow, lamps(light.paths.sky, light.middle))
    through = 10.0 ** (-0.4 * light.clouds(directions))
    area = light.sensitivity.scale_arcsec_px**2
    dark = light.sensitivity.electrons(mag, light.seconds) * area
    # Clouds over lamps or under the Moon scatter: the sky behind them grows brighter.
    lit = dark * (1.0 + (1.0 - through))
    return np.asarray(np.where(directions[:, 2] > 0.0, lit, 0.1 * dark).reshape(rows, columns))


def background(light: Light) -> Image:
    """Electrons (H, W) of the sky alone, interpolated between the coarse places."""
    grid = sky_electrons(light)
    nodes = np.arange(grid.shape[1])
    across = np.linspace(0.0, nodes[-1], light.optics.width)
    # np.interp rather than a product of matrices: BLAS would wake all its threads for it.
    lines = np.stack([np.interp(across, nodes, line) for line in grid]).astype(np.float32)
    out = np.empty((light.optics.height, light.optics.width), dtype=np.float32)
    at = np.linspace(0.0, len(lines) - 1.0, len(out), dtype=np.float32)
    above = np.minimum(at.astype(np.intp), len(lines) - 2)
    for k in range(len(lines) - 1):
        band = slice(*np.searchsorted(above, [k, k + 1]))
        np.multiply((at[band] - k)[:, None], lines[k + 1] - lines[k], out=out[band])
        out[band] += lines[k]
    return out
