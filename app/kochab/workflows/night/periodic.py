"""Periodic error of the RA axis: amplitude, period and harmonics of the worm, each with its uncertainty.

Where the frames of a held field point is fitted by levels, a parabola of the time (rate, refraction, polar axis) and a
sine with its harmonics: the floating-mean periodogram (Zechmeister and Kuerster 2009, A&A 496, 577) finds the period,
least squares refine all terms together. A sine is told when chance makes one as strong less than once in a million
nights and the field was held for two of its turns; an exposure smears it, which is undone.
"""

import math

import numpy as np

from kochab.core.arrays import Floats, Ints
from kochab.core.values import frozen
from kochab.workflows.night.measure import Measure, one_sigma

FEWEST = 14
"""The fewest places in which a periodic error is looked for."""
LEAST_TURNS = 2.0
PER_CADENCE = 2.5
"""The shortest period is so many times the usual step from frame to frame."""
FINER = 8.0
"""Periods are tried so much closer than the night's length resolves."""
CHANCE, SIGMAS = 1e-6, 5.0
HARMONICS = 3
ROUNDS = 8
LEAST_ARCSEC = 0.3
"""Smaller ones are of refraction and seeing."""


@frozen(eq=False)
class Periodic:
    """``amplitudes`` (harmonics 1, 2, 3), arcsec on the axis, half of peak to peak of each; period in seconds.

    ``error`` (N,) is what the fit makes of it at each place, arcsec on the axis; ``rate`` the axis' drift beside it in
    arcsec an hour; ``rms_arcsec`` what is left.
    """

    amplitudes: tuple[Measure, ...]
    period_s: Measure
    chance: float
    error: Floats
    rate: Measure
    rms_arcsec: float

    @property
    def peak_to_peak(self) -> Measure:
        """From the most to the least that the frames show, arcsec; as sure as the first harmonic's amplitude."""
        return Measure(float(np.ptp(self.error)), 2.0 * self.amplitudes[0].sigma)


def periodic_error(
    time_s: Floats, axis_arcsec: Floats, group: Ints, exposure_s: float = 0.0, sure: bool = True
) -> Periodic | None:
    """The periodic error of one field; None where there is none to tell.

    Parameters
    ----------
    time_s : Floats
        Mid-exposures (N,), in order.
    axis_arcsec : Floats
        Where the axis stood (N,), arcsec of its own angle.
    group : Ints
        Which level (N,) each place belongs to: dithers and knocks part them.
    exposure_s : float
        How long each was exposed.
    sure : bool
        Whether it has to be one beyond chance; else the best there is.
    """
    if len(time_s) < FEWEST:
        return None
    span = float(time_s[-1] - time_s[0])
    cadence = float(np.median(np.diff(time_s)))
    if not (span > 0.0 and cadence > 0.0):
        return None
    levels = (group[:, None] == np.unique(group)).astype(np.float64)
    t = (time_s - time_s.mean()) / span
    base = np.concatenate([levels, t[:, None], (t * t)[:, None]], axis=1)
    if len(time_s) - base.shape[1] < 6:
        return None
    first, last = LEAST_TURNS / span, 1.0 / (PER_CADENCE * cadence)
    if last <= first:
        return None
    frequencies = np.arange(first, last, 1.0 / (FINER * span))
    frequency = _best(time_s, axis_arcsec, base, frequencies)
    count = sum(k * frequency < 0.5 / cadence for k in range(1, HARMONICS + 1))
    fitted = _fit(time_s, axis_arcsec, base, frequency, count)
    if fitted is None:
        return None
    terms, covariance, frequency, rms = fitted
    free = base.shape[1]
    chance = _chance(time_s, axis_arcsec, base, frequency, len(frequencies) / FINER)
    amplitudes, error = [], np.zeros(len(time_s))
    for k in range(count):
        sine, cosine = terms[free + 2 * k], terms[free + 2 * k + 1]
        size = math.hypot(sine, cosine)
        way = np.array([sine, cosine]) / max(size, 1e-12)
        part = covariance[free + 2 * k : free + 2 * k + 2, free + 2 * k : free + 2 * k + 2]
        smeared = float(np.sinc((k + 1) * frequency * exposure_s))
        amplitudes.append(Measure(size / smeared, math.sqrt(float(way @ part @ way)) / smeared))
        phase = 2.0 * math.pi * (k + 1) * frequency * time_s
        error += sine * np.sin(phase) + cosine * np.cos(phase)
    period = Measure(1.0 / frequency, math.sqrt(float(covariance[-1, -1])) / frequency**2)
    strong = amplitudes[0].sigmas > SIGMAS and amplitudes[0].value > LEAST_ARCSEC
    if (sure and (chance > CHANCE or not strong)) or not 0.0 < period.value < span / LEAST_TURNS * 1.1:
        return None
    slope = len(np.unique(group))
    rate = Measure(float(terms[slope]) / span * 3600.0, math.sqrt(float(covariance[slope, slope])) / span * 3600.0)
    kept = [one for k, one in enumerate(amplitudes) if k == 0 or one.sigmas > SIGMAS]
    return Periodic(tuple(kept), period, chance, error, rate, rms)


def _best(time_s: Floats, values: Floats, base: Floats, frequencies: Floats) -> float:
    """The frequency (1/s) whose sine reduces the residuals most, fitted together with ``base``."""
    q, _ = np.linalg.qr(base)
    left = values - q @ (q.T @ values)
    phase = 2.0 * np.pi * frequencies[:, None] * time_s
    waves = np.stack([np.sin(phase), np.cos(phase)], axis=-1)
    waves = waves - q @ (q.T @ waves)
    normal = np.einsum("fna,fnb->fab", waves, waves)
    right = waves.transpose(0, 2, 1) @ left
    power = np.einsum("fa,fa->f", right, np.linalg.solve(normal + 1e-9 * np.eye(2), right[..., None])[..., 0])
    return float(frequencies[int(np.argmax(power))])


def _rows(time_s: Floats, base: Floats, frequency: float, count: int) -> Floats:
    waves = [
        wave(2.0 * np.pi * k * frequency * time_s) for k in range(1, count + 1) for wave in (np.sin, np.cos)
    ]  # sine and cosine of each harmonic
    return np.concatenate([base, np.stack(waves, axis=1)], axis=1)


def _fit(
    time_s: Floats, values: Floats, base: Floats, frequency: float, count: int
) -> tuple[Floats, Floats, float, float] | None:
    """Terms, covariance with the frequency's last, frequency, and the RMS left; None where it does not settle.

    Parameters
    ----------
    time_s, values : Floats
        Each (N,).
    base : Floats
        Levels and parabola (N, B).
    frequency : float
        Where it begins, 1/s.
    count : int
        How many harmonics.
    """
    step = 1.0
    for _ in range(ROUNDS):
        rows = _rows(time_s, base, frequency, count)
        terms = np.asarray(np.linalg.lstsq(rows, values, rcond=None)[0], dtype=np.float64)
        bend = _by_frequency(time_s, terms[base.shape[1] :], frequency)
        whole = np.concatenate([rows, bend[:, None]], axis=1)
        change, *_ = np.linalg.lstsq(whole, values - rows @ terms, rcond=None)
        step = float(change[-1])
        limit = 0.5 / float(time_s[-1] - time_s[0])
        frequency += min(max(step, -limit), limit)
        if not frequency > 0.0:
            return None
    left = values - _rows(time_s, base, frequency, count) @ terms
    dof = len(values) - whole.shape[1]
    if dof < 4:
        return None
    rms = math.sqrt(float(left @ left) / dof)
    alike = float(left[1:] @ left[:-1]) / float(left @ left) if rms > 0.0 else 0.0
    alike = min(max(alike, 0.0), 0.9)
    wider = (1.0 + alike) / (1.0 - alike) * one_sigma(dof) ** 2
    scale = np.linalg.norm(whole, axis=0)
    scale[scale == 0.0] = 1.0  # an axis that stands still has no sine, whose frequency then changes nothing
    inverse = np.linalg.pinv((whole / scale).T @ (whole / scale)) / np.outer(scale, scale)
    return terms, wider * max(rms, 1e-6) ** 2 * inverse, frequency, rms


def _by_frequency(time_s: Floats, waves: Floats, frequency: float) -> Floats:
    """Derivative (N,) of the sines by the frequency."""
    out = np.zeros(len(time_s))
    for k, (sine, cosine) in enumerate(waves.reshape(-1, 2), 1):
        phase = 2.0 * np.pi * k * frequency * time_s
        out += 2.0 * np.pi * k * time_s * (sine * np.cos(phase) - cosine * np.sin(phase))
    return out


def _chance(time_s: Floats, values: Floats, base: Floats, frequency: float, tried: float) -> float:
    """How likely noise has a sine as strong at one of the frequencies: an F test against the wander that is left."""
    from scipy.special import fdtrc

    def left_of(rows: Floats) -> Floats:
        terms, *_ = np.linalg.lstsq(rows, values, rcond=None)
        return values - rows @ terms

    without, with_it = left_of(base), left_of(_rows(time_s, base, frequency, 1))
    dof = len(values) - base.shape[1] - 3
    ratio = (float(without @ without) - float(with_it @ with_it)) / 3.0 / max(float(with_it @ with_it) / dof, 1e-12)
    ratio /= _redness(with_it, base.shape[1] + 3, frequency * float(np.median(np.diff(time_s))))
    return float(min(1.0, max(tried, 1.0) * fdtrc(3.0, dof, max(ratio, 0.0))))


def _redness(left: Floats, terms: int, cycles: float) -> float:
    """Power of wander at a frequency over that of white noise, 1 at least: of a first-order autoregression.

    Parameters
    ----------
    left : Floats
        What the fit leaves (N,).
    terms : int
        How many were fitted: they took as much of the wander.
    cycles : float
        The frequency, a step.
    """
    alike = float(left[1:] @ left[:-1]) / max(float(left @ left), 1e-12)
    # a fit of so many terms makes neighbours look less alike than they are
    alike = min(max(alike + (1.0 + 3.0 * max(alike, 0.0)) * terms / len(left), 0.0), 0.97)
    return max((1.0 - alike**2) / (1.0 - 2.0 * alike * math.cos(2.0 * math.pi * cycles) + alike**2), 1.0)
