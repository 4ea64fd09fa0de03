"""The shape of four stars as four numbers that scale, turn, shift and mirror leave alone.

The two stars farthest apart become 0 and 1 of the complex plane; the other two are then ``zc`` and
``zd``, both inside the lens of two unit discs. Three foldings make the code unique: the base is
swapped until ``Re(zc + zd) <= 1``, mirrored until ``Im(zc + zd) >= 0``, and the stars ordered so
that ``Re zc <= Re zd``. After Lang et al. 2010 (astrometry.net), with the longest side as the base
and the mirror folded in, so that both parities share one index.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PAIRS = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
REST = np.array([[2, 3], [1, 3], [1, 2], [0, 3], [0, 2], [0, 1]])


@dataclass(frozen=True, slots=True, eq=False)
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
    centre /= np.linalg.norm(centre, axis=1, keepdims=True)
    flat = vectors / np.einsum("qij,qj->qi", vectors, centre)[:, :, None]
    e1 = flat[:, 1] - flat[:, 0]
    e1 /= np.maximum(np.linalg.norm(e1, axis=1, keepdims=True), 1e-30)
    e2 = cross(centre, e1)
    rel = flat - flat[:, :1]
    out: NDArray[np.complex128] = np.einsum("qij,qj->qi", rel, e1) + 1j * np.einsum(
        "qij,qj->qi", rel, e2
    )
    return out


def cross(a: Floats, b: Floats) -> Floats:
    """Cross products of vectors (N, 3); numpy's own costs six times as much for few rows."""
    out = np.empty_like(a)
    out[:, 0] = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    out[:, 1] = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    out[:, 2] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return out


def canonical(z: NDArray[np.complex128]) -> Codes:
    """Canonical codes of quads given as complex positions (Q, 4)."""
    side = np.abs(z[:, PAIRS[:, 0]] - z[:, PAIRS[:, 1]])
    return _fold(z, np.arange(len(z)), np.argmax(side, axis=1))


def with_variants(z: NDArray[np.complex128], tolerance: Floats) -> Codes:
    """Codes (Q, 4) and those an error of ``tolerance`` (Q,) might have folded otherwise."""
    side = np.abs(z[:, PAIRS[:, 0]] - z[:, PAIRS[:, 1]])
    best = np.argmax(side, axis=1)
    length = np.take_along_axis(side, best[:, None], axis=1)
    tie = side > length * (1.0 - 1.5 * tolerance[:, None])
    quad, base = np.nonzero(tie)
    first = _fold(z, quad, base)
    tol = tolerance[quad]
    real, imag = first.code[:, 0] + first.code[:, 1], first.code[:, 2] + first.code[:, 3]
    near_swap = np.abs(real - 1.0) < 2 * tol
    near_mirror = np.abs(imag) < 2 * tol
    near_order = np.abs(first.code[:, 0] - first.code[:, 1]) < 2 * tol
    parts = [first]
    for swap, mirror, order in (
        (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1), (1, 1, 1),
    ):  # fmt: skip
        wanted = np.ones(len(quad), dtype=bool)
        for flag, near in ((swap, near_swap), (mirror, near_mirror), (order, near_order)):
            if flag:
                wanted &= near
        if wanted.any():
            parts.append(_vary(first, wanted, bool(swap), bool(mirror), bool(order)))
    return Codes(
        np.concatenate([p.code for p in parts]),
        np.concatenate([p.order for p in parts]),
        np.concatenate([p.mirrored for p in parts]),
        np.concatenate([p.quad for p in parts]),
        np.concatenate([p.base for p in parts]),
    )


def _fold(z: NDArray[np.complex128], quad: Ints, base: Ints) -> Codes:
    ab, cd = PAIRS[base], REST[base]
    order = np.concatenate([ab, cd], axis=1)
    p = np.take_along_axis(z[quad], order, axis=1)
    span = p[:, 1] - p[:, 0]
    length = np.abs(span)
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


def _vary(codes: Codes, which: NDArray[np.bool_], swap: bool, mirror: bool, turn: bool) -> Codes:
    """The selected codes folded the other way; a swap alone flips Im, which a mirror puts back."""
    code, order = codes.code[which].copy(), codes.order[which]
    mirrored = codes.mirrored[which]
    if swap:
        code = np.concatenate([1.0 - code[:, :2], -code[:, 2:]], axis=1)
        order = order[:, [1, 0, 2, 3]]
    if swap != mirror:
        code[:, 2:] *= -1.0
        mirrored = ~mirrored
    if swap != turn:  # after a swap the order of the real parts is reversed as well
        code = code[:, [1, 0, 3, 2]]
        order = order[:, [0, 1, 3, 2]]
    return Codes(code, order, mirrored, codes.quad[which], codes.base[which])
