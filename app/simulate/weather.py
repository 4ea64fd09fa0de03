"""Clouds that drift, wind that shakes; all from a seed, and any moment can be asked for."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class WeatherConfig:
    """The weather of a night.

    ``cloud_cover`` 0 to 1 is how much of the sky is under patchy cloud of up to ``cloud_mag``
    magnitudes. ``banks`` are (start, end, mag): solid cloud between these seconds after the
    beginning. ``wind_arcsec`` is how far gusts swing the telescope (RMS, each way).
    """

    cloud_cover: float = 0.0
    cloud_mag: float = 3.0
    banks: tuple[tuple[float, float, float], ...] = ()
    wind_arcsec: float = 0.0


class Weather:
    """What one seed makes of a :class:`WeatherConfig`, beginning at ``start`` unix seconds."""

    def __init__(self, config: WeatherConfig, start: float, seed: int = 0) -> None:
        self.config = config
        self._start = start
        rng = np.random.default_rng([seed, 71])
        turn, size = rng.uniform(0, 2 * np.pi, 9), np.geomspace(1.5, 25.0, 9)
        self._waves = np.stack([size * np.cos(turn), size * np.sin(turn)], axis=1)
        self._heights = size**-0.6 / np.sqrt(0.5 * (size**-1.2).sum())
        self._phases = rng.uniform(0, 2 * np.pi, 9)
        self._drift = rng.normal(0.0, 0.004, 2)  # cloud heights a second
        self._gusts_hz = rng.uniform(0.4, 4.0, (2, 6))
        self._gust_phases = rng.uniform(0, 2 * np.pi, (2, 6))

    def cloud_mag(self, directions: Floats, unix_s: float) -> Floats:
        """Magnitudes (N,) lost in cloud towards directions (N, 3), east, north, up."""
        config, t = self.config, unix_s - self._start
        lost = np.zeros(np.asarray(directions).shape[:-1])
        if config.cloud_cover > 0.0:
            from scipy.special import ndtri

            overhead = directions[..., :2] / np.maximum(directions[..., 2:], 0.08)
            phase = (overhead - self._drift * t) @ self._waves.T + self._phases
            height = np.sin(phase) @ self._heights  # about normal, variance 1
            edge = float(ndtri(1.0 - min(config.cloud_cover, 1.0 - 1e-6)))
            lost += config.cloud_mag * np.clip(height - edge, 0.0, 1.0)
        for begin, end, mag in config.banks:
            lost += mag * float(np.clip(min(t - begin, end - t) / 5.0, 0.0, 1.0))
        return np.asarray(lost)

    def shake_rad(self, unix_s: float) -> tuple[float, float]:
        """How far gusts turn the telescope about its camera's x and y axes, now."""
        if not self.config.wind_arcsec:
            return 0.0, 0.0
        t = unix_s - self._start
        swing = np.sin(2 * np.pi * self._gusts_hz * t + self._gust_phases).sum(axis=1) / np.sqrt(3)
        gust = 0.5 + 0.5 * np.sin(t / 7.0 + self._gust_phases[0, 0])
        x, y = np.radians(self.config.wind_arcsec / 3600.0) * gust * swing
        return float(x), float(y)
