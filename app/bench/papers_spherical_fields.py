"""Random fields of the thesis on spherical triangles, and how its methods are scored on them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.bench.papers_row import timed

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PROGRAMS = 87.2665e-6 / 3.0
FIELD_DEG, LIMIT_DEG, STARS = 8.0, 6.94, 8118
ATTITUDES = 1000
PAPER: dict[str, dict[str, float]] = {
    "angles": {
        "correct": 55, "inconclusive": 45, "incorrect": 1, "pivots": 4.86, "seconds": 6.89,
        "free_pivots": 5.48, "free_seconds": 7.67,
    },
    "spherical_triangles": {
        "correct": 92, "inconclusive": 6, "incorrect": 1, "pivots": 1.29, "seconds": 1.65,
        "of_four": 92, "of_five": 95,
        "free_pivots": 1.73, "free_seconds": 10.43,
    },
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Tally:
    """Per cent of fields correct, inconclusive, incorrect; mean pivots and processor seconds.

    ``pivots`` is the mean over the fields that were solved, ``all_pivots`` over all, which scatter
    by ``pivots_sd``; ``of_four``
    and ``of_five`` are the per cent correct of the fields with at least so many stars.
    """

    correct: float
    inconclusive: float
    incorrect: float
    pivots: float
    all_pivots: float
    pivots_sd: float
    seconds: float
    of_four: float
    of_five: float


def tallied(
    method: Any, table: Any, bound: float, noise: float, number: int, seed: int,
    poles: bool = False,
) -> Tally:  # fmt: skip
    """What ``method`` makes of ``number`` random fields; counted as in section 4.1.

    ``bound`` and ``noise`` are errors of a place, radians, believed and made; see `towards`.
    """
    sky = table.pairs.vectors
    rng = np.random.default_rng(seed)
    log = []
    for _ in range(number):
        near, body, _ = field_of(sky, rng, noise, poles)
        (_, chain), seconds = timed(lambda: method.recognise(body, table, bound))  # noqa: B023
        known = chain.entries is not None
        good = known and bool(np.isin(table.stars[chain.entries], near).all())
        log.append((len(near), known, good, chain.pivots, seconds))
    return summed(log)


def summed(log: list[tuple[int, bool, bool, int, float]]) -> Tally:
    """The tally of fields given as (stars, solved, correct, pivots, seconds)."""
    stars, known, good, pivots, seconds = (np.array(column) for column in zip(*log, strict=True))

    def share(what: NDArray[np.bool_], among: NDArray[np.bool_] | None = None) -> float:
        chosen = what if among is None else what[among]
        return 100.0 * float(chosen.mean()) if len(chosen) else float("nan")

    return Tally(
        share(good), share(~known), share(known & ~good),
        float(pivots[known].mean()) if known.any() else float("nan"), float(pivots.mean()),
        float(pivots.std()), float(seconds.mean()),
        share(good, stars >= 4), share(good, stars >= 5),
    )  # fmt: skip


def field_of(
    sky: Floats, rng: np.random.Generator, noise: float, poles: bool = False
) -> tuple[Ints, Floats, Floats]:
    """Stars of a random field, their measured directions (n, 3) in ICRS axes, and its middle."""
    z = towards(rng, poles)
    near = np.flatnonzero(sky @ z > np.cos(np.radians(FIELD_DEG / 2.0)))
    body = sky[near] + rng.normal(0.0, noise, (len(near), 3))
    return near, body / np.linalg.norm(body, axis=1, keepdims=True), z


def towards(rng: np.random.Generator, poles: bool) -> Floats:
    """A random direction (3,); with ``poles`` the altitude is even, as the program E.30 has it."""
    if not poles:
        z = rng.normal(size=3)
        return np.asarray(z / np.linalg.norm(z))
    turn, height = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-np.pi / 2.0, np.pi / 2.0)
    return np.array([np.cos(height) * np.cos(turn), np.cos(height) * np.sin(turn), np.sin(height)])
