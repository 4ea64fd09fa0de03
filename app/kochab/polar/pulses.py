"""How far a guider's pulses moved Dec, from the star's own path where dithers prove it.

A guider answers the noise of its last frame, and its pulses move the star in the frames after. Frame by frame the sum
of the pulses *before* is therefore free of the frame's own news, and least squares of the star's path on it are the
likelihood of the whole loop, whatever the guider's rule: no bias towards nothing, as means over half a minute have it.
That needs the noise to be what it is taken for, white or shared by neighbours (an autoregression of first order).
Where nothing but noise moved the guider, noise of another kind passes for an answer (noise of which a frame shares 0.3
with the next, taken for white, told 0.7 of the scale), so only dithers, whose pulses no noise asked for, prove one.
Gears swallow what turns them back: the axis follows the motor as behind backlash (a play operator, Krasnosel'skii and
Pokrovskii 1989).
"""

from typing import NamedTuple

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.values import frozen

SURE, FLOOR = 0.1, 0.05  # a scale is told when known to this share; what is left out is worth that much
LEAST_FRAMES = 60
SHARES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8)  # of a frame's noise that the next has as well
PLAYS, STARTS, ROUNDS = 24, (0.0, 0.5, 1.0), 3  # sizes of backlash, where it stands at first, closer looks
FINE, LEAST_SPAN = (
    61,
    0.1,
)  # sizes among which the backlash is told, and of the pulses' way how much they cover at least
OUTLIER, BLOCKS, UNEVEN, CORRELATED = 4.0, 12, 2.5, 0.08


@frozen(eq=False)
class PulseResponse:
    """What pulses did: ``scale`` times what the calibration says, one ``sigma`` of it.

    ``moved`` (N,) is how far they had moved Dec before each frame, were the calibration right: what gears swallowed
    is left out. ``backlash`` is how much of a turn back they swallow, of the star's own way and in its unit, with one
    sigma; NaN where as much as they were turned may be.
    """

    moved: Floats
    scale: float
    sigma: float
    backlash: float = float("nan")
    backlash_sigma: float = float("nan")


class _Fit(NamedTuple):
    """Of paths (N, K) behind K backlashes: the scale of each, its variance over that of the noise, the squares left."""

    scale: Floats
    spread: Floats
    squares: Floats


class _Paths(NamedTuple):
    """Where the axis would be (N, K) behind K sizes of backlash that begin at K places in it."""

    play: Floats
    start: Floats
    path: Floats


def pulse_response(time_s: Floats, star: Floats, pushed: Floats, level: Floats) -> PulseResponse | None:
    """What the star's path shows of the pulses' effect; None where it shows too little, or noise of another kind.

    Drift is a polynomial of the time, cubic in the first hour.

    Parameters
    ----------
    time_s : Floats
        When each frame was taken (N,), seconds.
    star : Floats
        The star's place (N,) along one axis, in any unit.
    pushed : Floats
        What all pulses before a frame should have moved the star by (N,), in its unit.
    level : Floats
        Counts (N,) the places that the star was given.
    """
    if np.ptp(pushed) == 0.0:
        return None
    kept = np.ones(len(star), dtype=bool)
    for _ in range(2):  # the second time without outliers
        if kept.sum() - len(np.unique(level)) < LEAST_FRAMES:
            return None
        response, left = _response(time_s, star, pushed, level, kept)
        sound = kept & (np.abs(left) < OUTLIER * np.sqrt(left @ left / kept.sum()))
        if (sound == kept).all():
            break
        kept = sound
    return response if response.sigma < SURE and _white(left[left != 0.0]) else None


def _response(
    time_s: Floats, star: Floats, pushed: Floats, level: Floats, kept: Floats
) -> tuple[PulseResponse, Floats]:
    """The likeliest backlash and share of noise, the scale with one sigma over all, and what is left (N,)."""
    plays = np.append(0.0, np.geomspace(0.003, 1.0, PLAYS)) * np.ptp(pushed)
    tried = _paths(pushed, plays, np.array(STARTS))
    smooths = [_Smooth(time_s[kept], level[kept], share) for share in SHARES]
    fits = [smooth.fit(star[kept], tried.path[kept]) for smooth in smooths]
    chosen = int(np.argmin([fit.squares.min() for fit in fits]))
    smooth, found = smooths[chosen], [fits[chosen]]
    gap = STARTS[1] - STARTS[0]
    for _ in range(ROUNDS):  # each looks closer about the best of the one before
        best = int(np.argmin(found[-1].squares))
        beside = np.unique(tried.play)
        at = int(np.searchsorted(beside, tried.play[best]))
        plays = np.linspace(beside[max(at - 1, 0)], beside[min(at + 1, len(beside) - 1)], 7)
        gap /= 2.0
        tried = _paths(pushed, plays, np.clip(tried.start[best] + gap * np.array([-1.0, 0.0, 1.0]), 0.0, 1.0))
        found.append(smooth.fit(star[kept], tried.path[kept]))
    fits[chosen] = _Fit(*(np.concatenate(each) for each in zip(*found, strict=True)))
    variance = float(fits[chosen].squares.min()) / smooth.freedom
    # A share of the noise and the scale can stand for one another: what all shares say counts, as likely as each is.
    scales, variances = (np.array(each) for each in zip(*(_mean(fit, variance) for fit in fits), strict=True))
    weights = _weights(np.array([fit.squares.min() for fit in fits]), variance)
    mean = float(weights @ scales)
    sigma = float(np.sqrt(weights @ (variances + np.square(scales - mean))))
    best = int(np.argmin(found[-1].squares))
    left = np.zeros(len(star))
    news = smooth.rest(np.stack([star[kept], tried.path[kept, best]], axis=-1))
    left[np.flatnonzero(kept)[smooth.follows]] = news[:, 0] - news[:, 1] * found[-1].scale[best]
    sigma = float(np.hypot(sigma, FLOOR))
    size, off = _backlash(smooth, star[kept], pushed, kept, float(tried.play[best]))
    off = float(np.hypot(off, size * sigma / max(abs(mean), sigma)))  # a scale and a backlash stand for one another
    return PulseResponse(tried.path[:, best], mean, sigma, size, off), left


def _backlash(smooth: "_Smooth", star: Floats, pushed: Floats, kept: Floats, likeliest: float) -> tuple[float, float]:
    """The backlash and one sigma, over all sizes as likely as each is; NaN twice where none is too large.

    Parameters
    ----------
    smooth : _Smooth
        Of the frames that are kept, and their noise.
    star : Floats
        Its places in them (M,).
    pushed : Floats
        By the pulses before every frame (N,).
    kept : Floats
        Which of them (N,).
    likeliest : float
        The size that fits best, as the calibration counts.
    """
    plays = np.linspace(0.0, min(max(3.0 * likeliest, LEAST_SPAN * float(np.ptp(pushed))), float(np.ptp(pushed))), FINE)
    tried = _paths(pushed, plays, np.linspace(0.0, 1.0, 5))
    fit = smooth.fit(star, tried.path[kept])
    by_start = fit.squares.reshape(FINE, -1)
    at = np.arange(FINE) * by_start.shape[1] + by_start.argmin(axis=1)
    squares, sizes = fit.squares[at], plays * np.abs(fit.scale[at])
    weights = _weights(squares, float(squares.min()) / smooth.freedom)
    if weights[-1] > 0.01 * weights.max():
        return float("nan"), float("nan")
    mean = float(weights @ sizes)
    step = float(plays[1] * abs(fit.scale[at[int(squares.argmin())]]))
    return mean, float(np.sqrt(weights @ np.square(sizes - mean) + step**2 / 12.0))


def _mean(fit: _Fit, variance: float) -> tuple[float, float]:
    """The scale over all backlashes, and its variance."""
    weights = _weights(fit.squares, variance)
    mean = float(weights @ fit.scale)
    return mean, float(weights @ (fit.spread * variance + np.square(fit.scale - mean)))


def _weights(squares: Floats, variance: float) -> Floats:
    weights = np.exp(-0.5 * (squares - squares.min()) / variance)
    return np.asarray(weights / weights.sum())


class _Smooth:
    """Takes from columns (N, ...) what a smooth drift, the levels and the frame before foretell."""

    def __init__(self, time_s: Floats, level: Floats, share: float) -> None:
        self._share, self.follows = share, np.append(False, np.diff(level) == 0.0)
        _, self._of, self._count = np.unique(level[self.follows], return_inverse=True, return_counts=True)
        at = 2.0 * (time_s - time_s.min()) / np.ptp(time_s) - 1.0
        every = np.polynomial.legendre.legvander(at, 3 + int(np.ptp(time_s) / 3600.0))
        powers = np.asarray(every[:, 1:], dtype=np.float64)
        self._basis, _ = np.linalg.qr(self._news(powers))
        self.freedom = max(len(self._basis) - len(self._count) - powers.shape[1] - 3, 1)

    def _news(self, columns: Floats) -> Floats:
        """Without what rows (N, K) share with the row before, and without the mean of each level."""
        news = (columns[1:] - self._share * columns[:-1])[self.follows[1:]]
        sums = np.zeros((len(self._count), columns.shape[1]))
        np.add.at(sums, self._of, news)
        return np.asarray(news - (sums / self._count[:, None])[self._of])

    def rest(self, columns: Floats) -> Floats:
        """What is left of columns (N, K), of the rows that follow another."""
        left = self._news(columns)
        return np.asarray(left - self._basis @ (self._basis.T @ left))

    def fit(self, star: Floats, paths: Floats) -> _Fit:
        """The star's path (N,) as each of K paths (N, K) explains it."""
        aim, rest = self.rest(star[:, None])[:, 0], self.rest(paths)
        size = np.maximum(np.einsum("nk,nk->k", rest, rest), 1e-12)
        along = aim @ rest
        return _Fit(along / size, 1.0 / size, aim @ aim - along**2 / size)


def _paths(motor: Floats, plays: Floats, starts: Floats) -> _Paths:
    play, start = np.repeat(plays, len(starts)), np.tile(starts, len(plays))
    return _Paths(play, start, behind_play(motor, play, start))


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
    uneven = each * float(means @ means) / noise / BLOCKS
    return abs(shared) < CORRELATED + 2.0 / np.sqrt(len(left)) and uneven < UNEVEN
