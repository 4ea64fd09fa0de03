"""From quads that look alike to pointings they would mean, and how many quads agree on each."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.identify.codes import planar, with_variants
from app.identify.index import Volume

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """How a frame's pixels are read while searching.

    ``xy`` (N, 2) px from the frame's middle, brightest first; ``half`` (2,) half its width and
    height in px; ``scale`` (2,) lowest and highest focal length allowed, px.
    ``vectors`` (N, 3) when a focal length (and distortion) is supposed, else None: then shapes
    are taken straight from the pixels, which is right while the field is narrow.
    """

    xy: Floats
    half: Floats
    scale: tuple[float, float]
    focal_px: float | None = None
    k1: float = 0.0

    def shape(self, quads: Ints) -> NDArray[np.complex128]:
        """Positions (Q, 4) of quads of stars in their own planes, px or rad."""
        if self.focal_px is None:
            p = self.xy[quads]
            return np.asarray(p[..., 0] + 1j * p[..., 1])
        return planar(self.directions(np.full(1, self.focal_px), self.xy[quads]))

    def directions(self, focal: Floats, xy: Floats) -> Floats:
        """Unit vectors (..., 3) of pixels (..., 2) for focal lengths that broadcast to (...)."""
        uv = xy / focal[..., None]
        if self.k1:
            r2 = (uv**2).sum(axis=-1, keepdims=True)
            for _ in range(3):
                r2 = ((uv / (1.0 + self.k1 * r2)) ** 2).sum(axis=-1, keepdims=True)
            uv = uv / (1.0 + self.k1 * r2)
        out = np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1)
        return np.asarray(out / np.sqrt((out**2).sum(axis=-1, keepdims=True)))


@dataclass(frozen=True, slots=True, eq=False)
class Hypotheses:
    """H supposed pointings: ``matrix`` (H, 3, 3) ICRS to camera, ``focal`` (H,) px, ``mirrored``
    (H,), ``level`` (H,) and the ``detections`` and ``stars`` (H, 4) that propose each."""

    matrix: Floats
    focal: Floats
    mirrored: Bools
    level: Ints
    detections: Ints
    stars: Ints

    def __len__(self) -> int:
        return len(self.focal)

    def take(self, index: Ints | Bools) -> "Hypotheses":
        """A selection, in the order of ``index``."""
        return Hypotheses(
            self.matrix[index], self.focal[index], self.mirrored[index],
            self.level[index], self.detections[index], self.stars[index],
        )  # fmt: skip


def propose(
    volume: Volume, view: View, quads: Ints, noise_px: float, slack: float, per_field: tuple[float, float]
) -> Hypotheses:
    """All pointings that quads (Q, 4) of detections suggest through one index volume.

    ``noise_px`` is the error allowed in each position, ``slack`` the share of a quad's size it may
    be bent by optics; ``per_field`` the lowest and highest ratio of a level's field to the frame's.
    """
    z = view.shape(quads)
    span = np.abs(z[:, :, None] - z[:, None, :]).max(axis=(1, 2))
    unit = 1.0 if view.focal_px is None else view.focal_px
    codes = with_variants(z, noise_px / np.maximum(span * unit, 1e-9) + slack)
    tolerance = noise_px / np.maximum(codes.base * unit, 1e-9) + slack
    length_px = codes.base * unit
    size = np.stack([length_px / view.scale[1], length_px / view.scale[0]], axis=1)
    query, entry = volume.lookup(codes.code, tolerance, size * np.array([0.97, 1.03]))
    stars = volume.members(entry)
    sky = volume.stars[stars].astype(np.float64)
    w = planar(sky)
    w = (w[:, 2:] - w[:, :1]) / (w[:, 1] - w[:, 0])[:, None]
    mirrored = (w.imag.sum(axis=1) < 0) != codes.mirrored[query]
    detections = np.take_along_axis(quads[codes.quad[query]], codes.order[query], axis=1)
    return _pointings(volume, view, codes.base[query], detections, stars, sky, mirrored, per_field)


def _pointings(
    volume: Volume, view: View, base: Floats, detections: Ints, stars: Ints, sky: Floats,
    mirrored: Bools, per_field: tuple[float, float],
) -> Hypotheses:  # fmt: skip
    arc = np.linalg.norm(sky[:, 1] - sky[:, 0], axis=1)
    plane = 2.0 * np.tan(np.arcsin(np.clip(arc / 2.0, 0, 1)))  # AB in the quad's tangent plane
    focal = base / plane if view.focal_px is None else np.asarray(view.focal_px * base / plane)
    level = volume.level_of(stars[:, 0])
    frame_field = 2.0 * np.degrees(np.arctan(np.sqrt(view.half[0] * view.half[1]) / focal))
    ratio = volume.fields_deg[level] / frame_field
    good = (focal >= view.scale[0]) & (focal <= view.scale[1])
    good &= (ratio > per_field[0]) & (ratio < per_field[1])
    detections, stars, sky = detections[good], stars[good], sky[good]
    focal, mirrored, level = focal[good], mirrored[good], level[good]
    p = view.xy[detections[:, :2]] * np.where(mirrored, -1.0, 1.0)[:, None, None] ** np.array([1, 0])
    seen = view.directions(np.broadcast_to(focal[:, None], p.shape[:2]), p)
    camera, icrs = _triad(seen[:, 0], seen[:, 1]), _triad(sky[:, 0], sky[:, 1])
    matrix = np.einsum("hik,hjk->hij", camera, icrs)
    return Hypotheses(matrix, focal, mirrored, level, detections, stars)


def _triad(a: Floats, b: Floats) -> Floats:
    """Orthonormal axes (H, 3, 3), as columns, from the middle and the difference of two vectors."""
    m, d = a + b, b - a
    m = m / np.linalg.norm(m, axis=1, keepdims=True)
    d = d / np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-12)
    return np.stack([m, d, np.cross(m, d)], axis=2)


def agreement(hypotheses: Hypotheses, angle_rad: Floats, limit: int = 1500) -> Ints:
    """How many other hypotheses (H,) point the same way within ``angle_rad`` (H,) and 3 % in scale.

    Only the first ``limit`` are compared; the rest count as unsupported.
    """
    n = min(len(hypotheses), limit)
    votes = np.zeros(len(hypotheses), dtype=np.int64)
    if n == 0:
        return votes
    flat = hypotheses.matrix[:n].reshape(n, 9).astype(np.float32)
    trace = flat @ flat.T
    same = trace > (1.0 + 2.0 * np.cos(angle_rad[:n])).astype(np.float32)[:, None]
    i, j = np.nonzero(same)
    log = np.log(hypotheses.focal[:n])
    kept = (np.abs(log[i] - log[j]) < 0.03) & (i != j)
    kept &= hypotheses.mirrored[i] == hypotheses.mirrored[j]
    votes[:n] = np.bincount(i[kept], minlength=n)
    return votes
