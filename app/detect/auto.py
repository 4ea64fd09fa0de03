"""The default detector: any frame, no settings.

Background and noise on a mesh, local maxima of the smoothed frame, the frame's own star image
from the brightest of them, and a fit of that image to every one. What a single pixel explains
better than the star image is a hot pixel.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.core.detections import Detections
from app.core.frame import Frame
from app.detect.fit import Fits, fit_stars
from app.detect.mesh import Mesh, measure_mesh
from app.detect.moments import FWHM_PER_SIGMA, PIXEL_VARIANCE, adaptive_moments, principal_axes
from app.detect.peaks import find_peaks
from app.detect.stamps import cut
from app.detect.strips import Halving, Pixels, halving
from app.detect.weed import apart, close_pairs, standing_out

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
MIN_SIDE = 8  # px; smaller frames hold no star with a background around it
MAX_PEAKS = 12_000


@dataclass(frozen=True, slots=True)
class AutoDetector:
    """Finds stars above ``snr``; at most ``max_stars``; ``threads`` share the pass over pixels."""

    snr: float = 5.0
    max_stars: int = 6000
    threads: int = 2

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, brightest first."""
        pixels = frame.pixels
        if pixels.ndim != 2 or min(pixels.shape) < MIN_SIDE:
            return nothing(frame)
        how = halving(frame.bayer)
        mesh = measure_mesh(pixels, how, _step(pixels))
        xy, height = find_peaks(pixels, how, mesh, 0.9 * self.snr, MAX_PEAKS, self.threads)
        if not len(xy):
            return nothing(frame, mesh)
        clip = clip_level(pixels, how, xy, frame.saturation)
        covariance = star_image(pixels, how, mesh, xy[:200], clip)
        return self._measure(frame, how, mesh, xy, covariance, clip)

    def _measure(
        self, frame: Frame, how: Halving, mesh: Mesh, xy: Floats, covariance: Floats, clip: float
    ) -> Detections:
        pixels = frame.pixels
        level, noise = mesh.at(xy[:, 0], xy[:, 1])
        major, minor, _ = principal_axes(
            *(np.array([covariance[i]]) for i in ((0, 0), (1, 1), (0, 1)))
        )
        half = int(np.clip(np.ceil(2.5 * major[0]) + 1, 4, 16))
        parts = [slice(k, k + 1000) for k in range(0, len(xy), 1000)]
        stars = [
            _Stars.of(fit_stars(s, covariance), s.x, s.y, noise[p], clip, s.value, level[p])
            for p in parts
            for s in (cut(pixels, how, xy[p], level[p], half),)
        ]
        found = _Stars.join(stars)
        found = replace(found, moments=_unweighted(found.moments, covariance))
        near = np.hypot(*(found.xy - xy).T) < max(3.0, major[0] * 2.0)
        found = found.take(near & (found.snr > self.snr) & (found.snr > found.snr_pixel))
        found = _remeasured(found, pixels, how, mesh)
        inside = (found.xy > -0.5).all(axis=1) & (
            found.xy < [frame.width - 0.5, frame.height - 0.5]
        ).all(axis=1)
        found = found.take(inside)
        found = found.take(np.argsort(-found.flux, kind="stable"))
        fwhm = FWHM_PER_SIGMA * float(np.sqrt(major[0] * minor[0]))
        return self._weeded(frame, mesh, found, fwhm, float(major[0]))

    def _weeded(
        self, frame: Frame, mesh: Mesh, found: "_Stars", fwhm: float, sigma_major: float
    ) -> Detections:
        major, minor, angle = principal_axes(*found.moments.T)
        own = FWHM_PER_SIGMA * np.sqrt(major * minor)
        reach = np.where(
            found.saturated, np.maximum(0.7 * FWHM_PER_SIGMA * major, 0.6 * fwhm), 0.6 * fwhm
        )
        keep = apart(found.xy, np.maximum(reach, 1.2))
        found, major, minor, angle, own = (
            found.take(keep), major[keep], minor[keep], angle[keep], own[keep],
        )  # fmt: skip
        reach = np.maximum(2.5 * FWHM_PER_SIGMA * np.minimum(major, 15.0), 6.0)
        keep = standing_out(frame.pixels, found.xy, found.peak, found.noise, reach)
        found, major, minor, angle, own = (
            found.take(keep), major[keep], minor[keep], angle[keep], own[keep],
        )  # fmt: skip
        blended = np.zeros(len(found.flux), dtype=np.bool_)
        for ends in close_pairs(found.xy, 2.0 * FWHM_PER_SIGMA * sigma_major):
            blended[ends] = True
        return Detections(
            frame.width, frame.height, found.xy, found.flux, found.snr, own, major / minor, angle,
            found.saturated, blended, float(np.median(mesh.level)), float(np.median(mesh.noise)),
        ).take(slice(self.max_stars))  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Stars:
    """Measured peaks; arrays of length N."""

    xy: Floats
    flux: Floats
    snr: Floats
    snr_pixel: Floats
    moments: Floats
    peak: Floats
    noise: Floats
    saturated: Bools

    @classmethod
    def of(
        cls,
        fit: Fits,
        x: Floats,
        y: Floats,
        noise: Floats,
        clip: float,
        value: Floats,
        level: Floats,
    ) -> "_Stars":
        middle = value.shape[1] // 2
        core = value[:, middle - 2 : middle + 3, middle - 2 : middle + 3].max(axis=(1, 2))
        core = core.astype(np.float64)
        return cls(
            np.stack([x + fit.dx, y + fit.dy], axis=1), fit.flux, fit.snr / noise, core / noise,
            fit.moments, core, noise, core + level >= clip,
        )  # fmt: skip

    @classmethod
    def join(cls, parts: "list[_Stars]") -> "_Stars":
        return cls(*(np.concatenate([getattr(p, k) for p in parts]) for k in cls.__slots__))

    def take(self, index: Bools | NDArray[np.intp]) -> "_Stars":
        return _Stars(*(getattr(self, k)[index] for k in self.__slots__))


def nothing(frame: Frame, mesh: Mesh | None = None) -> Detections:
    """No stars, with the background when it could be measured."""
    empty = Detections.from_list(np.empty((0, 2)), frame.width, frame.height)
    if mesh is None:
        return empty
    return replace(
        empty, background=float(np.median(mesh.level)), noise=float(np.median(mesh.noise))
    )


def clip_level(pixels: Pixels, how: Halving, xy: Floats, told: float | None) -> float:
    """The level at which pixels count as saturated, guessed from flat tops when not ``told``."""
    if told is not None and np.isfinite(told):
        return 0.98 * float(told)
    stamps = cut(pixels, how, xy[:400], np.zeros(min(len(xy), 400)), 2)
    top = float(stamps.value.max())
    flat = (stamps.value >= 0.98 * top).sum(axis=(1, 2)) >= 5
    return 0.98 * top if flat.any() else np.inf


def star_image(pixels: Pixels, how: Halving, mesh: Mesh, xy: Floats, clip: float) -> Floats:
    """Second moments (2, 2), px^2, of the frame's stars, from its brightest peaks (N, 2) px."""
    level, noise = mesh.at(xy[:, 0], xy[:, 1])
    stamps = cut(pixels, how, xy, level, 12)
    core = stamps.value[:, 10:15, 10:15]
    lone = core.sum(axis=(1, 2)) < 1.8 * core.max(axis=(1, 2))
    shapes = adaptive_moments(stamps, 1.5)
    good = shapes.good & ~lone & (np.hypot(shapes.dx, shapes.dy) < 4)
    good &= core.max(axis=(1, 2)) + level < clip
    if good.sum() < 3:
        return np.eye(2) * 1.2**2
    area = np.sqrt(np.maximum(shapes.xx * shapes.yy - shapes.xy**2, 1e-6))
    usual = np.percentile(area[good], 40)
    near = good & (area > usual / 1.6) & (area < usual * 1.6)
    xx, yy, xyc = (float(np.median(m[near])) for m in (shapes.xx, shapes.yy, shapes.xy))
    major, minor, _ = principal_axes(np.array([xx]), np.array([yy]), np.array([xyc]))
    if major[0] / minor[0] < 1.4:
        xx = yy = float(major[0] * minor[0])
        xyc = 0.0
    floor = 0.6**2 + PIXEL_VARIANCE
    scale = max(1.0, floor / float(minor[0] ** 2))
    out = scale * np.array([[xx, xyc], [xyc, yy]]) - PIXEL_VARIANCE * np.eye(2)
    return out


def _unweighted(moments: Floats, covariance: Floats) -> Floats:
    """Second moments (N, 3) of the light itself from those weighted by the star image."""
    weight = np.linalg.inv(covariance + PIXEL_VARIANCE * np.eye(2))
    m = np.empty((len(moments), 2, 2))
    m[:, 0, 0], m[:, 1, 1] = np.maximum(moments[:, 0], 0.02), np.maximum(moments[:, 1], 0.02)
    most = 0.98 * np.sqrt(m[:, 0, 0] * m[:, 1, 1])
    m[:, 0, 1] = m[:, 1, 0] = np.clip(moments[:, 2], -most, most)
    values, vectors = np.linalg.eigh(np.linalg.inv(m) - weight)
    values = 1.0 / np.maximum(values, 1.0 / (100.0 * covariance.trace()))
    full = (vectors * values[:, None, :]) @ vectors.transpose(0, 2, 1)
    return np.stack([full[:, 0, 0], full[:, 1, 1], full[:, 0, 1]], axis=1)


def _remeasured(found: _Stars, pixels: Pixels, how: Halving, mesh: Mesh) -> _Stars:
    """Saturated stars anew, with a weight as large as their flat tops."""
    wide = np.flatnonzero(found.saturated)[:400]
    if not len(wide):
        return found
    level, noise = mesh.at(*found.xy[wide].T)
    stamps = cut(pixels, how, found.xy[wide], level, 24)
    shapes = adaptive_moments(stamps, 2.5, 16)
    good = shapes.good & (shapes.flux > found.flux[wide])
    wide, shapes_xy = wide[good], np.stack([stamps.x + shapes.dx, stamps.y + shapes.dy], axis=1)
    found.xy[wide] = shapes_xy[good]
    found.snr[wide] *= shapes.flux[good] / found.flux[wide]
    found.flux[wide] = shapes.flux[good]
    found.moments[wide] = np.stack([shapes.xx, shapes.yy, shapes.xy], axis=1)[good]
    return found


def _step(pixels: Pixels) -> float:
    """The quantum of the pixels' values; 0 when they are not whole numbers."""
    return 1.0 if pixels.dtype.kind in "iub" else 0.0
