"""How far a guider's pulses moved Dec, from the star's own path where that proves it.

A guider answers the noise of its last frame, and its pulses move the star in the frames after. Frame by frame the sum
of the pulses *before* is therefore free of the frame's own noise, and least squares of the star's path on it are the
likelihood of the whole loop, whatever the guider's rule: no bias towards nothing, as means over half a minute have it.
That holds while the noise of frames is white; where what is left over is not, nothing is claimed. Gears swallow what
turns them back: the axis follows the motor as behind backlash (a play operator, Krasnosel'skii and Pokrovskii 1989).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kochab.core.arrays import Floats

SURE, FLOOR = 0.1, 0.03  # a scale is proven when known to this share; what is left out is worth that much
LEAST_FRAMES = 60
PLAYS, STARTS, ROUNDS = 24, (0.0, 0.5, 1.0), 4  # sizes of backlash, where it stands at first, refinements
OUTLIER, BLOCKS, UNEVEN = 4.0, 12, 2.5
CORRELATED = 0.08


@dataclass(frozen=True, slots=True, eq=False)
class PulseResponse:
    """What pulses did: ``scale`` times what the calibration says, one ``sigma`` of it; ``proven`` or not.

    ``moved`` (N,) is how far they had moved Dec before each frame, were the calibration right: what gears swallowed
    is left out.
    """

    moved: Floats
    scale: float
    sigma: float
    proven: bool


class _Fit(NamedTuple):
    """Of paths (N, K) behind K backlashes: the scale of each, its variance over that of the noise, the squares left."""

    scale: Floats
    spread: Floats
    squares: Floats


def pulse_response(time_s: Floats, star: Floats, pushed: Floats, level: Floats) -> PulseResponse | None:
    """What the star's path (N,) shows of the pulses' effect; None where there is too little of it.

    ``pushed`` (N,) is what all pulses before a frame should have moved the star by, in its unit; ``level`` (N,) counts
    the places that it was given. Drift is a polynomial of the time, cubic in the first hour.
    """
    if len(star) < LEAST_FRAMES or np.ptp(pushed) == 0.0:
        return None
    kept = np.ones(len(star), dtype=bool)
    for _ in range(2):  # the second time without outliers
        smooth = _Smooth(time_s[kept], level[kept])
        moved, scale, sigma, left = _best(smooth, star, pushed, kept)
        noise = float(np.sqrt(left @ left / smooth.freedom))
        rest = np.zeros(len(star))
        rest[kept] = left
        kept &= np.abs(rest) < OUTLIER * noise
        if smooth.freedom < LEAST_FRAMES // 2:
            return None
    return PulseResponse(moved, scale, float(np.hypot(sigma, FLOOR)), sigma < SURE and _white(left))


class _Smooth:
    """Takes from columns (N, ...) what a smooth drift and the levels explain."""

    def __init__(self, time_s: Floats, level: Floats) -> None:
        hours = np.ptp(time_s) / 3600.0
        _, self._of, self._count = np.unique(level, return_inverse=True, return_counts=True)
        at = 2.0 * (time_s - time_s.min()) / np.ptp(time_s) - 1.0
        powers = np.polynomial.legendre.legvander(at, 3 + int(hours))[:, 1:]
        self._basis, _ = np.linalg.qr(self._without_means(powers))
        self.freedom = len(time_s) - len(self._count) - powers.shape[1] - 3

    def _without_means(self, columns: Floats) -> Floats:
        sums = np.zeros((len(self._count), columns.shape[1]))
        np.add.at(sums, self._of, columns)
        return np.asarray(columns - (sums / self._count[:, None])[self._of])

    def rest(self, columns: Floats) -> Floats:
        """What is left of columns (N, K)."""
        left = self._without_means(columns)
        return np.asarray(left - self._basis @ (self._basis.T @ left))


def _best(smooth: _Smooth, star: Floats, pushed: Floats, kept: Floats) -> tuple[Floats, float, float, Floats]:
    """The path behind the likeliest backlash, its scale with one sigma over all of them, and what is left of the star.

    Each round looks closer about the best of the one before.
    """
    aim = smooth.rest(star[kept, None])[:, 0]
    plays, starts = np.append(0.0, np.geomspace(0.003, 1.0, PLAYS)) * np.ptp(pushed), np.array(STARTS)
    fits: list[_Fit] = []
    for _ in range(ROUNDS):
        each, start = np.repeat(plays, len(starts)), np.tile(starts, len(plays))
        paths = behind_play(pushed, each, start)
        fit = _fit(smooth.rest(paths[kept]), aim)
        fits.append(fit)
        best = int(np.argmin(fit.squares))
        at = int(np.flatnonzero(plays == each[best])[0])
        lower, upper = plays[max(at - 1, 0)], plays[min(at + 1, len(plays) - 1)]
        gap = (starts[1] - starts[0]) / 2.0
        plays, starts = np.linspace(lower, upper, 7), np.clip(start[best] + gap * np.array([-1.0, 0.0, 1.0]), 0.0, 1.0)
        if upper == 0.0 or np.ptp(starts) == 0.0:
            break
    scales, spreads, squares = (np.concatenate(each) for each in zip(*fits, strict=True))
    variance = float(squares.min()) / smooth.freedom
    weights = np.exp(-0.5 * (squares - squares.min()) / variance)
    weights /= weights.sum()
    mean = float(weights @ scales)
    sigma = float(np.sqrt(weights @ (spreads * variance + np.square(scales - mean))))
    left = aim - smooth.rest(paths[kept][:, best : best + 1])[:, 0] * fit.scale[best]
    return paths[:, best], mean, sigma, left


def _fit(paths: Floats, aim: Floats) -> _Fit:
    size = np.maximum(np.einsum("nk,nk->k", paths, paths), 1e-12)
    along = aim @ paths
    return _Fit(along / size, 1.0 / size, aim @ aim - along**2 / size)


def behind_play(motor: Floats, play: Floats, start: Floats) -> Floats:
    """Where axes (N, K) are whose motor goes the way (N,), each behind its backlash (K,).

    ``start`` (K,) is where in it each begins: 0 pushed onwards, 1 pulled back. An axis lies between the motor and the
    play behind it.
    """
    axis = motor[0] - play * start
    path = np.empty((len(motor), len(play)))
    for row, now in enumerate(motor):
        axis = np.minimum(np.maximum(axis, now - play), now)
        path[row] = axis
    return path


def _white(left: Floats) -> bool:
    """Whether neither neighbours nor blocks of neighbours share what is left."""
    noise = float(left @ left) / len(left)
    shared = float(left[1:] @ left[:-1]) / len(left) / noise
    each = len(left) // BLOCKS
    means = left[: each * BLOCKS].reshape(BLOCKS, each).mean(axis=1)
    return abs(shared) < CORRELATED + 2.0 / np.sqrt(len(left)) and each * float(means @ means) / noise < UNEVEN * BLOCKS
