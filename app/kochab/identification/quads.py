"""Quads of stars: their shape as four numbers, and the pointings they propose.

The shape does not change with scale, rotation, shift or mirror. The two stars farthest apart become
0 and 1 of the complex plane; the other two are then ``zc`` and ``zd``, both inside the lens of two
unit discs. Three foldings make the code unique: the base is swapped until ``Re(zc + zd) <= 1``,
mirrored until ``Im(zc + zd) >= 0``, and the stars ordered so that ``Re zc <= Re zd``. After Lang et
al. 2010 (astrometry.net), with the longest side as the base and the mirror folded in, so that both
parities share one index.
"""

from dataclasses import fields
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Bools, Floats, Ints
from kochab.core.attitude import cross_product
from kochab.core.values import frozen
from kochab.identification.index import Volume

PAIRS = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
REST = np.array([[2, 3], [1, 3], [1, 2], [0, 3], [0, 2], [0, 1]])
FOLDS = np.array(sorted(product((True, False), repeat=3), key=sum))
"""Every way to fold a code, none first: swapped, mirrored, turned."""


@frozen(eq=False)
class Codes:
    """Canonical codes of Q quads.

    ``code`` (Q, 4): Re zc, Re zd, Im zc, Im zd. ``order`` (Q, 4): which of the quad's stars is A,
    B, C, D. ``mirrored`` (Q,): whether the mirror was applied. ``quad`` (Q,): the row of the input
    the code belongs to (variants repeat rows). ``base`` (Q,): length of AB in the input's unit.
    """

    code: Floats
    order: Ints
    mirrored: NDArray[np.bool_]
    quad: Ints
    base: Floats


def planar(vectors: Floats) -> NDArray[np.complex128]:
    """Tangent-plane positions (Q, 4) of unit vectors (Q, 4, 3) about each quad's own centre.

    The plane's axes are arbitrary but right-handed looking outwards, as a camera's x and y are.
    """
    centre = vectors.sum(axis=1)
    centre /= lengths(centre)
    flat = vectors / np.einsum("qij,qj->qi", vectors, centre)[:, :, None]
    rel = flat - flat[:, :1]
    e1 = rel[:, 1]
    e1 = e1 / np.maximum(lengths(e1), 1e-30)
    out = np.empty(flat.shape[:2], dtype=np.complex128)
    out.real = np.einsum("qij,qj->qi", rel, e1)
    out.imag = np.einsum("qij,qj->qi", rel, cross_product(centre, e1))
    return out


def lengths(vectors: Floats) -> Floats:
    """Lengths (N, 1) of vectors (N, K); numpy's own costs three times as much for few rows."""
    return np.asarray(np.sqrt(np.einsum("nk,nk->n", vectors, vectors))[:, None])


def canonical(z: NDArray[np.complex128]) -> Codes:
    """Canonical codes of quads given as complex positions (Q, 4)."""
    side = np.abs(z[:, PAIRS[:, 0]] - z[:, PAIRS[:, 1]])
    return _fold(z, np.arange(len(z)), np.argmax(side, axis=1))


def with_variants(z: NDArray[np.complex128], tolerance: Floats) -> Codes:
    """Codes (Q, 4) and those an error of ``tolerance`` (Q,) might have folded otherwise."""
    side = np.abs(z[:, PAIRS[:, 0]] - z[:, PAIRS[:, 1]])
    # sides that an error could make the longest, and so the base
    tie = side > side.max(axis=1, keepdims=True) * (1.0 - 1.5 * tolerance[:, None])
    quad, base = np.nonzero(tie)
    first = _fold(z, quad, base)
    c, d, e, f = first.code.T
    # how near the code is to each fold: swapped ends, mirror, turned pair; a variant needs all of its folds to be near
    near = np.abs(np.stack([c + d - 1.0, e + f, c - d])) < 2 * tolerance[quad]
    swap, mirror, turn = near[:, None] | ~FOLDS.T[:, :, None]
    way, row = (swap & mirror & turn).nonzero()
    return _vary(first, row, *FOLDS[way].T)


def _fold(z: NDArray[np.complex128], quad: Ints, base: Ints) -> Codes:
    ab, cd = PAIRS[base], REST[base]
    order = np.concatenate([ab, cd], axis=1)
    p = z[quad[:, None], order]
    span = p[:, 1] - p[:, 0]
    length = np.abs(span)
    # stars all in one place have no base to divide by
    safe = np.where(length > 0, span, 1.0)
    w = (p[:, 2:] - p[:, :1]) / safe[:, None]
    swap = w.real.sum(axis=1) > 1.0
    w = np.where(swap[:, None], 1.0 - w, w)
    order = np.where(swap[:, None], order[:, [1, 0, 2, 3]], order)
    mirrored = w.imag.sum(axis=1) < 0.0
    w = np.where(mirrored[:, None], w.conj(), w)
    turn = w[:, 0].real > w[:, 1].real
    w = np.where(turn[:, None], w[:, ::-1], w)
    order = np.where(turn[:, None], order[:, [0, 1, 3, 2]], order)
    code = np.concatenate([w.real, w.imag], axis=1)
    return Codes(code, order, mirrored, quad, length)


def _vary(codes: Codes, row: Ints, swap: Bools, mirror: Bools, turn: Bools) -> Codes:
    """Rows (N,) of the codes, folded the other way where asked (N,)."""
    code, order = codes.code[row], codes.order[row]
    code[swap, :2] = 1.0 - code[swap, :2]
    code[mirror, 2:] *= -1.0
    order[swap] = order[swap][:, [1, 0, 2, 3]]
    again = swap != turn  # after a swap the order of the real parts is reversed as well
    code[again] = code[again][:, [1, 0, 3, 2]]
    order[again] = order[again][:, [0, 1, 3, 2]]
    return Codes(code, order, codes.mirrored[row] ^ swap ^ mirror, codes.quad[row], codes.base[row])


@frozen(eq=False)
class FieldStars:
    """A frame's stars while searching.

    ``xy`` (N, 2) px from the frame's middle, brightest first; ``half`` (2,) half its width and
    height in px; ``scale`` lowest and highest focal length allowed, px.
    """

    xy: Floats
    half: Floats
    scale: tuple[float, float]


@frozen(eq=False)
class QuadQuery:
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


@frozen(eq=False)
class QuadShapes:
    """What a :class:`QuadQuery` asks of every volume alike: V codes, the variants among them.

    ``codes`` have their detections in ``detections`` (V, 4), ``length_px`` (V,) is the base's length, ``tolerance``
    (V,) the error allowed in a code, ``focal`` the lowest and the highest (V,) that its quad allows, px, ``quads``
    the number of quads, and ``per_field`` as in the query.
    """

    quads: int
    codes: Codes
    detections: Ints
    length_px: Floats
    tolerance: Floats
    focal: tuple[Floats, Floats]
    per_field: tuple[float, float]

    @classmethod
    def of(cls, view: FieldStars, ask: QuadQuery) -> "QuadShapes":
        """The shapes of the quads that are asked for."""
        z, unit = ask.shape(view.xy)
        span = np.abs(z[:, PAIRS[:, 0]] - z[:, PAIRS[:, 1]]).max(axis=1)
        codes = with_variants(z, ask.noise_px / np.maximum(span * unit, 1e-9) + ask.slack)
        length_px = codes.base * unit[codes.quad]
        low, high = np.full(len(length_px), view.scale[0]), np.full(len(length_px), view.scale[1])
        if ask.focal is not None:
            supposed = ask.focal[codes.quad]
            low, high = np.maximum(low, supposed / SUPPOSED), np.minimum(high, supposed * SUPPOSED)
        # codes are in units of the base: the longer it is, the less a pixel matters
        tolerance = ask.noise_px / np.maximum(length_px, 1e-9) + ask.slack
        detections = ask.quads[codes.quad[:, None], codes.order]
        return cls(len(ask.quads), codes, detections, length_px, tolerance, (low, high), ask.per_field)


SUPPOSED = 1.16  # a supposed focal length stands for all within this factor


def directions(focal: Floats, xy: Floats) -> Floats:
    """Unit vectors (..., 3) of pixels (..., 2) for focal lengths that broadcast to (...)."""
    uv = xy / focal[..., None]
    out = np.ones((*uv.shape[:-1], 3))
    out[..., :2] = uv
    out /= np.sqrt(np.einsum("...k,...k->...", out, out))[..., None]
    return out


@frozen(eq=False)
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
        return Hypotheses(*(getattr(self, f.name)[index] for f in fields(self)))


def propose(volume: Volume, view: FieldStars, ask: QuadShapes) -> Hypotheses:
    """All pointings that the quads asked about suggest through one index volume."""
    low, high = ask.focal
    size = np.stack([ask.length_px / high * 0.97, ask.length_px / low * 1.03], axis=1)
    query, entry = volume.lookup(ask.codes.code, ask.tolerance, size)
    stars = volume.members(entry)
    sky = volume.directions(stars)
    w = planar(sky)
    w = (w[:, 2:] - w[:, :1]) / (w[:, 1] - w[:, 0])[:, None]
    # parity is not in the code: it is whether the sky's quad and the frame's were mirrored alike to reach it
    turned = w.imag.sum(axis=1) < 0
    tolerance = ask.tolerance[query]
    # the index keeps shapes coarsely: those that only seemed near enough would count as chances of error
    off = np.concatenate([w.real, np.where(turned[:, None], -w.imag, w.imag)], axis=1) - ask.codes.code[query]
    good = (np.abs(off) <= tolerance[:, None]).all(axis=1)
    side = sky[:, 1] - sky[:, 0]
    half2 = np.minimum(np.einsum("ij,ij->i", side, side) / 4.0, 1.0 - 1e-15)
    # AB in the quad's tangent plane is 2 tan of the half angle, whose sine is half the chord
    focal = ask.length_px[query] / (2.0 * np.sqrt(half2 / (1.0 - half2)))
    # a scale known better than a quad's places is not for the quad to contradict
    room = 1.0 + tolerance
    good &= (focal * room >= view.scale[0]) & (focal <= view.scale[1] * room)
    focal = np.minimum(np.maximum(focal, view.scale[0]), view.scale[1])
    good &= (focal >= low[query]) & (focal <= high[query])
    level = volume.level_of(stars[:, 0])
    frame_field = 2.0 * np.degrees(np.arctan(np.sqrt(view.half[0] * view.half[1]) / focal))
    ratio = volume.fields_deg[level] / frame_field
    good &= (ratio > ask.per_field[0]) & (ratio < ask.per_field[1])
    kept = good.nonzero()[0]
    query, focal, stars = query[kept], focal[kept], stars[kept]
    mirrored, detections = turned[kept] != ask.codes.mirrored[query], ask.detections[query]
    matrix = pointings(view.xy, detections, sky[kept], focal, mirrored)
    return Hypotheses(matrix, focal, mirrored, level[kept], detections, stars)


def pointings(xy: Floats, detections: Ints, sky: Floats, focal: Floats, mirrored: Bools) -> Floats:
    """Attitudes (H, 3, 3) that put the two base stars of each quad where they are seen.

    Parameters
    ----------
    xy : Floats
        Places of the detections (D, 2), px from the frame's middle.
    detections : Ints
        Numbers of each quad's detections (H, 4), the two base stars first.
    sky : Floats
        ICRS unit vectors (H, 4, 3) of the stars they would be.
    focal : Floats
        Focal length (H,) that each match means, px.
    mirrored : Bools
        Whether each match is mirrored (H,).
    """
    p = xy[detections[:, :2]]
    p[mirrored, :, 0] *= -1.0
    seen = directions(focal[:, None], p)
    camera, icrs = triad_axes(seen[:, 0], seen[:, 1]), triad_axes(sky[:, 0], sky[:, 1])
    return np.asarray(camera @ icrs.transpose(0, 2, 1))


def triad_axes(a: Floats, b: Floats) -> Floats:
    """Orthonormal axes (H, 3, 3), as columns, from the middle and the difference of two vectors."""
    # what the two separations differ by is shared equally by both stars
    m, d = a + b, b - a
    n = cross_product(m, d)
    m = m / lengths(m)
    n = n / np.maximum(lengths(n), 1e-30)
    out = np.empty((len(m), 3, 3))
    out[..., 0], out[..., 1], out[..., 2] = m, cross_product(n, m), n
    return out


def image_quads(xy: Floats, neighbours: int, smallest_px: float) -> Ints:
    """Quads (Q, 4): each detection with three of its nearest among ``xy`` (N, 2), each set once.

    Neighbours closer than ``smallest_px`` are passed over: noise would dominate their shape.
    """
    n = len(xy)
    if n < 4:
        return np.zeros((0, 4), dtype=np.int64)
    d2 = ((xy[:, None] - xy[None]) ** 2).sum(axis=2)
    d2[d2 < smallest_px**2] = np.inf
    k = min(neighbours, n - 1)
    near = np.argsort(d2, axis=1)[:, :k]
    combos = np.array(list(combinations(range(k), 3)))
    quads = np.concatenate(
        [np.broadcast_to(np.arange(n)[:, None, None], (n, len(combos), 1)), near[:, combos]], axis=2
    ).reshape(-1, 4)
    quads = np.sort(quads, axis=1)
    # a star with too few others far enough away may have itself, at an infinite distance, among its nearest
    quads = quads[(np.diff(quads, axis=1) > 0).all(axis=1)]
    return quads[np.sort(np.unique(quad_marks(quads), return_index=True)[1])]


def quad_marks(quads: Ints) -> Ints:
    """One number for each set of four detections (Q, 4), sorted, each below 4096."""
    return np.asarray((quads[:, 0] << 36) | (quads[:, 1] << 24) | (quads[:, 2] << 12) | quads[:, 3])
