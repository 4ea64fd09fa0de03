"""The stars of one exposure: which, how bright, and along what path each goes over the sensor."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from app.core.camera import Camera
from app.core.hint import Site
from app.simulate.local_sky import Air, LocalSky
from app.sky.apparent import julian_years
from app.sky.catalogue import Catalogue

Floats = NDArray[np.float64]
Look = Callable[[float], Floats]
"""Rotation (3, 3) from observed directions (E, N, U) to camera axes at a unix time."""

LOOKS_A_SECOND = 12.0
MOST_LOOKS = 96
WIDEST_RAD = np.radians(25.0)  # of sky swept in one exposure that is drawn


@dataclass(frozen=True, slots=True, eq=False)
class Paths:
    """Stars (N) over an exposure: ``xy`` (K, N, 2) px at ``times`` (K,), NaN behind the camera.

    ``mag`` (N,) is V at the top of the air, ``directions`` (N, 3) east, north, up at the middle.
    """

    times: Floats
    xy: Floats
    mag: Floats
    directions: Floats
    sky: LocalSky

    @property
    def length_px(self) -> float:
        """How far the typical star travels over the sensor."""
        if len(self.xy) < 2 or not self.xy.shape[1]:
            return 0.0
        steps = np.linalg.norm(np.diff(self.xy, axis=0), axis=2).sum(axis=0)
        finite = steps[np.isfinite(steps)]
        return float(np.median(finite)) if len(finite) else 0.0

    @property
    def spread_px(self) -> float:
        """How far apart the farthest moments of one star are."""
        if len(self.xy) < 2 or not self.xy.shape[1]:
            return 0.0
        spans = np.linalg.norm(self.xy.max(axis=0) - self.xy.min(axis=0), axis=1)
        finite = spans[np.isfinite(spans)]
        return float(finite.max()) if len(finite) else 0.0

    def cores(self, spacing_px: float, most: int = 400) -> Floats:
        """Places (M, N, 2) at equal times whose typical distance is ``spacing_px``."""
        if self.spread_px < 0.5 * spacing_px:
            return np.asarray(self.xy.mean(axis=0)[None])
        count = int(np.clip(np.ceil(self.length_px / spacing_px), 2, most))
        at = (np.arange(count) + 0.5) / count * (len(self.times) - 1)
        low = np.minimum(at.astype(np.intp), len(self.times) - 2)
        part = (at - low)[:, None, None]
        return np.asarray(self.xy[low] * (1.0 - part) + self.xy[low + 1] * part)


class StarPaths:
    """Finds the stars of exposures; remembers the neighbourhood, as consecutive frames share it."""

    def __init__(self, catalogue: Catalogue, site: Site, air: Air | None = None) -> None:
        self._catalogue = catalogue
        self._site = site
        self._air = air or Air()
        self._near: tuple[Floats, float, float, float] | None = None
        self._vectors = np.empty((0, 3))
        self._mag = np.empty(0)

    def over(
        self, camera: Camera, look: Look, start: float, exposure_s: float, faintest: float
    ) -> Paths:
        """Paths of all stars down to V ``faintest`` from unix time ``start`` on."""
        looks = int(np.clip(np.ceil(exposure_s * LOOKS_A_SECOND), 3, MOST_LOOKS))
        times = start + np.linspace(0.0, exposure_s, looks)
        views = np.stack([look(float(t)) for t in times])
        middle = start + exposure_s / 2.0
        sky = LocalSky(self._site, middle, self._air)
        self._gather(camera, sky, views, middle, faintest)
        ends = [LocalSky(self._site, t, self._air) for t in (start, start + exposure_s)]
        now = sky.to_enu(self._vectors)
        first, last = (end.to_enu(self._vectors) for end in ends)
        seen = np.stack([
            _between(first, now, last, part) @ view.T
            for part, view in zip(np.linspace(-1.0, 1.0, looks), views, strict=True)
        ])  # fmt: skip
        xy = camera.project(seen)
        keep = _crossing(camera, xy) & (now[:, 2] > 0.0)
        return Paths(times, xy[:, keep], self._mag[keep], now[keep], sky)

    def _gather(
        self, camera: Camera, sky: LocalSky, views: Floats, unix_s: float, faintest: float
    ) -> None:
        boresights = views[:, 2]
        middle = boresights[len(boresights) // 2]
        swept = float(np.arccos(np.clip(boresights @ middle, -1.0, 1.0)).max())
        radius = _half_diagonal(camera) + min(swept, float(WIDEST_RAD))
        centre = sky.from_enu(middle)
        if self._near is not None:
            old, old_radius, old_faintest, old_time = self._near
            away = float(np.linalg.norm(centre - old))
            fits = away + radius < old_radius and radius > 0.4 * old_radius
            if fits and faintest == old_faintest and abs(unix_s - old_time) < 86400.0:
                return
        wide = min(1.25 * radius + np.radians(0.1), np.pi)
        year = julian_years(datetime.fromtimestamp(unix_s, UTC))
        rows = self._catalogue.cone(centre, wide, faintest, year)
        self._vectors, self._mag = self._catalogue.vectors(rows, year), self._catalogue.mag(rows)
        self._near = (centre, wide, faintest, unix_s)


def _half_diagonal(camera: Camera) -> float:
    """The angle from the boresight to the farthest corner, with some room for distortion."""
    corners = np.array([
        [x, y] for x in (0.0, camera.width - 1.0) for y in (0.0, camera.height - 1.0)
    ])  # fmt: skip
    return float(np.arccos(camera.unproject(corners)[:, 2].min())) * 1.03


def _between(first: Floats, now: Floats, last: Floats, part: float) -> Floats:
    """The parabola through directions at -1, 0 and 1; ``part`` in [-1, 1]."""
    bent = now + 0.5 * part * (last - first) + 0.5 * part * part * (first - 2.0 * now + last)
    return np.asarray(bent / np.linalg.norm(bent, axis=1)[:, None])


def _crossing(camera: Camera, xy: Floats, margin: float = 40.0) -> NDArray[np.bool_]:
    """Which stars are ever near the sensor."""
    with np.errstate(invalid="ignore"):
        inside = (xy > -margin).all(axis=2)
        inside &= (xy[..., 0] < camera.width + margin) & (xy[..., 1] < camera.height + margin)
    return np.asarray(inside.any(axis=0))
