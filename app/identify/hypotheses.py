"""From quads that look alike to pointings they would mean, and how many quads agree on each."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.identify.codes import cross, planar, with_variants
from app.identify.index import Volume

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A frame's stars while searching.

    ``xy`` (N, 2) px from the frame's middle, brightest first; ``half`` (2,) half its width and
    height in px; ``scale`` lowest and highest focal length allowed, px.
    """

    xy: Floats
    half: Floats
    scale: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """Quads of detections to look up.

    ``quads`` (Q, 4) detections. ``focal`` (Q,) is the focal length (px) supposed for each, within
    16 % of which the answer must lie, or None: then shapes are taken straight from the pixels,
    which is right while the field is narrow. ``noise_px`` is the error allowed in a position and
    ``slack`` the share of a quad's size that optics may bend it by; ``per_field`` the lowest and
    highest ratio of the size of field that a quad is typical of to the frame's.
    """

    quads: Ints
    focal: Floats | None
    noise_px: float
    slack: float
    per_field: tuple[float, float]

    def shape(self, xy: Floats) -> tuple[NDArray[np.complex128], Floats]:
        """Positions (Q, 4) of the quads in their own planes, and px in one unit of that (Q,)."""
        p = xy[self.quads]
        if self.focal is None:
            return np.asarray(p[..., 0] + 1j * p[..., 1]), np.ones(len(p))
        return planar(directions(self.focal[:, None], p)), self.focal


SUPPOSED = 1.16  # a supposed focal length stands for all within this factor


def directions(focal: Floats, xy: Floats) -> Floats:
    """Unit vectors (..., 3) of pixels (..., 2) for focal lengths that broadcast to (...)."""
    uv = xy / focal[..., None]
    out = np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1)
    return np.asarray(out / np.sqrt((out**2).sum(axis=-1, keepdims=True)))


@dataclass(frozen=True, slots=True, eq=False)
class Hypotheses:
    """Supposed pointings, H of them.

    ``matrix`` (H, 3, 3) ICRS to camera, ``focal`` (H,) px, ``mirrored`` (H,), ``level`` (H,) and
    the ``detections`` and ``stars`` (H, 4) that propose each.
    """

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


def propose(volume: Volume, view: View, ask: Question) -> Hypotheses:
    """All pointings that the quads asked about suggest through one index volume."""
    z, unit = ask.shape(view.xy)
    span = np.abs(z[:, [0, 0, 0, 1, 1, 2]] - z[:, [1, 2, 3, 2, 3, 3]]).max(axis=1)
    codes = with_variants(z, ask.noise_px / np.maximum(span * unit, 1e-9) + ask.slack)
    length_px = codes.base * unit[codes.quad]
    low, high = np.full(len(length_px), view.scale[0]), np.full(len(length_px), view.scale[1])
    if ask.focal is not None:
        low = np.maximum(low, ask.focal[codes.quad] / SUPPOSED)
        high = np.minimum(high, ask.focal[codes.quad] * SUPPOSED)
    size = np.stack([length_px / high * 0.97, length_px / low * 1.03], axis=1)
    tolerance = ask.noise_px / np.maximum(length_px, 1e-9) + ask.slack
    query, entry = volume.lookup(codes.code, tolerance, size)
    stars = volume.members(entry)
    sky = volume.directions(stars)
    w = planar(sky)
    w = (w[:, 2:] - w[:, :1]) / (w[:, 1] - w[:, 0])[:, None]
    mirrored = (w.imag.sum(axis=1) < 0) != codes.mirrored[query]
    detections = np.take_along_axis(ask.quads[codes.quad[query]], codes.order[query], axis=1)
    arc = np.linalg.norm(sky[:, 1] - sky[:, 0], axis=1)
    plane = 2.0 * np.tan(np.arcsin(np.clip(arc / 2.0, 0, 1)))  # AB in the quad's tangent plane
    focal = length_px[query] / plane
    level = volume.level_of(stars[:, 0])
    frame_field = 2.0 * np.degrees(np.arctan(np.sqrt(view.half[0] * view.half[1]) / focal))
    ratio = volume.fields_deg[level] / frame_field
    # a scale known better than a quad's places is not for the quad to contradict
    room = 1.0 + tolerance[query]
    good = (focal * room >= view.scale[0]) & (focal <= view.scale[1] * room)
    np.clip(focal, *view.scale, out=focal)
    if ask.focal is not None:
        good &= (focal >= low[query]) & (focal <= high[query])
    good &= (ratio > ask.per_field[0]) & (ratio < ask.per_field[1])
    matrix = pointings(view.xy, detections[good], sky[good], focal[good], mirrored[good])
    return Hypotheses(
        matrix, focal[good], mirrored[good], level[good], detections[good], stars[good]
    )


def pointings(xy: Floats, detections: Ints, sky: Floats, focal: Floats, mirrored: Bools) -> Floats:
    """Attitudes (H, 3, 3) that put the two base stars of each quad where they are seen."""
    p = xy[detections[:, :2]]
    p[mirrored, :, 0] *= -1.0
    seen = directions(np.broadcast_to(focal[:, None], p.shape[:2]), p)
    camera, icrs = _triad(seen[:, 0], seen[:, 1]), _triad(sky[:, 0], sky[:, 1])
    return np.asarray(camera @ icrs.transpose(0, 2, 1))


def _triad(a: Floats, b: Floats) -> Floats:
    """Orthonormal axes (H, 3, 3), as columns, from the middle and the difference of two vectors."""
    m, d = a + b, b - a
    n = cross(m, d)
    m = m / np.linalg.norm(m, axis=1, keepdims=True)
    n = n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-30)
    return np.stack([m, cross(n, m), n], axis=2)
