"""How clear the sky was, frame by frame: how much light of the same stars arrived.

The difference of catalogue and measured magnitude of star s in frame f is ``z_f + r_s``: the frame's zero point, and
what the star has of its own (colour, a poor catalogue magnitude, a variable). Stars that return in other frames share
their ``r_s``, so that it cancels; fields without common stars are tied by the catalogue alone, to `OWN_MAG` a star.
Only differences between frames are told: filter, gain and aperture of the telescope are in every zero point.
"""

import math

import numpy as np

from kochab.core.arrays import Bools, Floats, Ints
from kochab.core.robust import mad_sigma
from kochab.core.values import frozen
from kochab.workflows.night.measure import Measure

OWN_MAG = 0.25
"""One sigma of what a star differs from its V magnitude in an unfiltered or coloured camera."""
FLOOR_MAG = 0.015
"""Noise of one star in one frame beside its photons: flat field, scintillation, pixels."""
CLEAR = 0.9
"""The share of frames less clear than the one that the others are measured from: the very clearest is a lucky one."""
ROUNDS, WORST = 4, 4.0


@frozen(eq=False)
class StarLight:
    """Stars of one frame: ``star`` (N,) their identifiers; ``excess_mag`` (N,) catalogue less measured magnitude.

    The measured magnitude is ``-2.5 log10`` of the flux a second; ``sigma_mag`` (N,) its noise.
    """

    star: tuple[str, ...]
    excess_mag: Floats
    sigma_mag: Floats


def losses(frames: "list[StarLight]") -> "list[Measure | None]":
    """Light lost against the clear frames, magnitudes; None for a frame with fewer than three stars.

    Parameters
    ----------
    frames : list of StarLight
        In any order; stars of one name are the same star.
    """
    used = [k for k, light in enumerate(frames) if len(light.star) >= 3]
    if not used:
        return [None] * len(frames)
    names = {name: k for k, name in enumerate(sorted({name for at in used for name in frames[at].star}))}
    frame = np.concatenate([np.full(len(frames[at].star), k) for k, at in enumerate(used)])
    star = np.array([names[name] for at in used for name in frames[at].star])
    excess = np.concatenate([frames[at].excess_mag for at in used])
    noise = np.hypot(np.concatenate([frames[at].sigma_mag for at in used]), FLOOR_MAG)
    zero, covariance = _zero_points(frame, star, excess, noise, len(used))
    clear = int(np.argsort(zero)[round(CLEAR * (len(zero) - 1))])
    found: list[Measure | None] = [None] * len(frames)
    for k, at in enumerate(used):
        variance = covariance[k, k] + covariance[clear, clear] - 2.0 * covariance[k, clear]
        found[at] = Measure(float(zero[clear] - zero[k]), math.sqrt(max(float(variance), 0.0)))
    return found


def _zero_points(frame: Ints, star: Ints, excess: Floats, noise: Floats, count: int) -> tuple[Floats, Floats]:
    """Zero points (F,) and their covariance (F, F), the stars' own part eliminated.

    Parameters
    ----------
    frame, star : Ints
        Of each measurement (N,), which.
    excess, noise : Floats
        Each (N,), magnitudes.
    count : int
        F, how many frames.
    """
    kept: Bools = np.ones(len(excess), dtype=np.bool_)
    wider = 1.0
    for _ in range(ROUNDS):
        weight = np.where(kept, 1.0 / (noise * wider) ** 2, 0.0)
        table = np.zeros((count, int(star.max()) + 1))
        np.add.at(table, (frame, star), weight)
        sums = np.bincount(star, weight * excess, table.shape[1])
        per_star = table.sum(axis=0) + 1.0 / OWN_MAG**2
        normal = np.diag(table.sum(axis=1)) - (table / per_star) @ table.T
        right = np.bincount(frame, weight * excess, count) - table @ (sums / per_star)
        # A frame whose stars were all clipped: no answer must come of it, so it keeps a wide one.
        covariance = np.linalg.inv(normal + 1e-9 * np.eye(count))
        zero = covariance @ right
        own = (sums - table.T @ zero) / per_star
        left = (excess - zero[frame] - own[star]) / noise
        core = mad_sigma(left, 0.0)
        wider = max(1.0, core)
        kept = np.abs(left) <= WORST * wider
    return zero, covariance
