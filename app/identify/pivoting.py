"""Pivoting: candidates of one figure are kept when they share stars with those of the next.

The thesis on spherical triangles, sections 2.3, 2.6, 5.2.3-5.2.5 and 5.3.3-5.3.5. Its binary trees
are one sort and two binary searches here.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

MOST_FINALISTS = 200_000  # beyond, the search has lost its way: inconclusive


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """What pivoting led to: ``figures`` (F,) of the frame and ``entries`` (F,) of the catalogue.

    ``entries`` is None when no single solution was reached. ``pivots`` is how many were made and
    ``compared`` how many candidates of the catalogue were looked at.
    """

    figures: Ints
    entries: Ints | None
    pivots: int
    compared: int


def pivot_order(size: Floats, keys: Ints, limit: int) -> Ints:
    """The largest figure first, then always the largest unused one that shares a key with the last.

    ``size`` (F,) and ``keys`` (F, c), what two figures may share; at most ``limit`` pivots.
    """
    free = np.ones(len(size), dtype=np.bool_)
    order = [int(size.argmax())]
    free[order[0]] = False
    while len(order) <= limit:
        shares = (keys[:, :, None] == keys[order[-1]]).any(axis=(1, 2)) & free
        if not shares.any():
            break
        order.append(int(np.where(shares, size, -np.inf).argmax()))
        free[order[-1]] = False
    return np.array(order, dtype=np.int64)


def join(finalists: Ints, pivots: Ints, once: bool = True) -> tuple[Ints, Ints]:
    """Numbers of the rows of two key tables (A, c) and (B, c) that share a key.

    Each pair of rows comes once, or, unless ``once``, for every key that they share.
    """
    c = pivots.shape[1]
    flat = pivots.ravel()
    order = np.argsort(flat, kind="stable")
    ranked = flat[order]
    start = np.searchsorted(ranked, finalists.ravel(), "left")
    length = np.searchsorted(ranked, finalists.ravel(), "right") - start
    if int(length.sum()) > MOST_FINALISTS * c:
        raise OverflowError
    asked = np.repeat(np.arange(finalists.size), length)
    place = np.arange(len(asked)) - (np.cumsum(length) - length)[asked] + start[asked]
    both = asked // c * len(pivots) + order[place] // c
    both = np.unique(both) if once else both
    return both // max(1, len(pivots)), both % max(1, len(pivots))


def approach(order: Ints, candidates: list[Ints], keys: Ints, as_printed: bool = False) -> Chain:
    """Pivot through the figures ``order`` (F,) until one solution is left.

    ``candidates[f]`` are the catalogue's entries for the ``f``-th figure of the order, ``keys``
    (N, c) what entries may share. Two figures of a frame are never one entry of the catalogue.

    ``as_printed`` follows the thesis' programs (E.34, E.35) where they differ: an entry may stand
    for two figures, counts for every key it shares, and when a pivot leaves more finalists than
    there were, the search is given up.
    """
    finalists = candidates[0][:, None]
    compared = len(finalists)
    for step in range(len(order)):
        if step:
            compared += len(candidates[step])
            try:
                a, b = join(keys[finalists[:, -1]], keys[candidates[step]], not as_printed)
            except OverflowError:
                return Chain(order[: step + 1], None, step, compared)
            new = candidates[step][b]
            if as_printed and len(new) > len(finalists):
                return Chain(order[: step + 1], None, step - 1, compared)
            fresh = (finalists[a] != new[:, None]).all(axis=1) | as_printed
            finalists = np.column_stack([finalists[a], new])[fresh]
        if len(finalists) == 1:
            return Chain(order[: step + 1], finalists[0], step, compared)
        if len(finalists) == 0 or len(finalists) > MOST_FINALISTS:
            break
    return Chain(order[: step + 1], None, step, compared)
