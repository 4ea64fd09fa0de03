"""Encoders on the axes of a telescope that is pushed, aligned by solved frames: where it points by their counts alone.

Each solve gives the camera's whole attitude, so two of them with both axes turned in between show how many counts an
axis has in a turn, which way it counts, and how the camera sits; further ones show how the base leans. The model::

    A(c1, c2) = M Ry(b c2) Rz(a c1 + z) L

takes directions fixed to the Earth to camera axes: the base's lean L, the first axis by ``a`` radians a count from its
zero z, the second at right angles by ``b``, and the camera's mounting M, which holds the second zero and cone error.
It is fitted by least squares with priors on lean and cone. The newest solve is always met exactly, so that what the
model leaves out (flexure, axes not square) counts only for the way since then.
"""

import math
from typing import Literal

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import cross_product, rotation_vectors, separation_deg, small_rotations, unit, wrapped
from kochab.core.values import frozen

Counts = tuple[float, float]
"""Of both axes, as the box counts them, over whole turns without a jump."""

LEAN_DEG, CONE_DEG = 2.0, 3.0
"""1 sigma of a base's lean in either direction, and of the camera's angle from a right one to the second axis."""
POINTING_DEG, ROLL_DEG = 1.0 / 60.0, 5.0 / 60.0
"""What a solve and the counts of its moment agree to: half a step, flexure and solving."""
FEWEST_IN_A_TURN = 200.0
KILO = 1000.0
METHOD: Literal["lm"] = "lm"
"""MINPACK's Levenberg and Marquardt; SciPy's own method needs its LAPACK, which the .deb leaves out."""
STEP = math.sqrt(np.finfo(np.float64).eps)
"""The step of a numerical derivative, for a parameter of size 1."""
NEW_PLACE_DEG, MOST_SIGHTINGS = 1.0, 20
SLIP_DEG, SLIP_SIGMAS = 10.0 / 60.0, 4.0
CREEP_DEG_S = 1.0 / 3600.0
"""A rocker box settles and a clutch creeps: 1' a minute."""
DECIDED = 12.0
"""A base whose fit costs (chi squared / 2) so much more than another's is not this mount's."""


@frozen(eq=False)
class _Sighting:
    attitude: Floats
    counts: Counts


@frozen(eq=False)
class _Fit:
    """``values`` (8,): a and b in radians a thousand counts, lean (2), z, and a small turn (3) of ``mounting`` (3, 3).

    ``base`` (3, 3) takes the Earth-fixed frame to one whose z is the first axis of a base without lean.
    """

    base: Floats
    mounting: Floats
    values: Floats
    covariance: Floats
    cost: float = math.inf

    def attitudes(self, counts: Floats, values: Floats | None = None) -> Floats:
        """Modelled attitudes (..., N, 3, 3) at counts (N, 2), for each set of parameters (..., 8)."""
        v = self.values if values is None else values
        first = v[..., :1] * counts[:, 0] / KILO + v[..., 4:5]
        second = v[..., 1:2] * counts[:, 1] / KILO
        c, s, cc, ss, nil = np.cos(first), np.sin(first), np.cos(second), np.sin(second), np.zeros_like(first)
        axes = np.stack([cc * c, cc * s, ss, -s, c, nil, -ss * c, -ss * s, cc], axis=-1).reshape(*first.shape, 3, 3)
        leans = np.concatenate([v[..., 2:4], np.zeros_like(v[..., :1])], axis=-1)
        lean, turn = (small_rotations(angles)[..., None, :, :] for angles in (leans, v[..., 5:]))
        return np.asarray(turn @ self.mounting @ axes @ lean @ self.base)

    def anchored(self, last: _Sighting, counts: Counts, values: Floats | None = None) -> Floats:
        """Attitudes (..., 3, 3) at ``counts`` that fit the last sighting, for each set of parameters (..., 8)."""
        there, here = np.moveaxis(self.attitudes(np.array([last.counts, counts]), values), -3, 0)
        return np.asarray(last.attitude @ there.swapaxes(-1, -2) @ here)

    def variance(self, last: _Sighting, counts: Counts) -> float:
        """Variance of the direction, rad^2, from the covariance of the fit."""
        here, h = self.anchored(last, counts)[2], 1e-6
        slope = ((self.anchored(last, counts, self.values + h * np.eye(8))[:, 2] - here) / h).T
        return float(np.trace(slope @ self.covariance @ slope.T))


class EncoderModel:
    """Takes solves, and tells attitudes from counts in between. Attitudes take Earth-fixed directions to camera axes.

    Parameters
    ----------
    latitude_deg : float or None
        The Earth-fixed frame is east, north, up at this latitude, and the base may be level or polar aligned; None:
        its z axis is the Earth's, and the base is polar aligned.
    """

    def __init__(self, latitude_deg: float | None = None) -> None:
        self._bases = [np.eye(3)]
        if latitude_deg is not None:
            c, s = math.cos(math.radians(latitude_deg)), math.sin(math.radians(latitude_deg))
            self._bases.append(np.array([[1.0, 0.0, 0.0], [0.0, s, -c], [0.0, c, s]]))
        self.forget()

    def forget(self) -> None:
        """Begin anew: other encoders, or none that fit."""
        self._sightings: list[_Sighting] = []
        self._fits: list[_Fit] = []
        self._slipped = (0.0, 0.0)
        self._missed = 0

    @property
    def counts_in_a_turn(self) -> tuple[float | None, float | None]:
        """Counts in a full turn of each axis as learned; negative if they fall as it grows, None while unknown."""
        if len(self._sightings) < 2:
            return None, None
        fit = self._fits[0]
        sigma = np.sqrt(np.diag(fit.covariance)[:2])
        found = [
            2.0 * math.pi * KILO / rate if abs(rate) > 5.0 * s else None
            for rate, s in zip(fit.values[:2].tolist(), sigma.tolist(), strict=True)
        ]
        return found[0], found[1]

    def see(self, attitude: Floats, counts: Counts, age_s: float = 0.0) -> float | None:
        """Take a solve; returns how far the counts disagreed, degrees, when that is more than they can be off.

        Then they slipped, or were reset: what was learned of the axes stays. Disagreeing twice, everything is learned
        anew.

        Parameters
        ----------
        attitude : Floats
            (3, 3) from Earth-fixed directions to camera axes.
        counts : Counts
            At mid-exposure.
        age_s : float
            Seconds since the solve before.
        """
        new = _Sighting(np.asarray(attitude, dtype=np.float64), self._corrected(counts))
        off = None
        if self._sightings:
            away = separation_deg(self._fits[0].anchored(self._sightings[-1], new.counts)[2], new.attitude[2])
            if away > max(SLIP_DEG, SLIP_SIGMAS * self.sigma_deg(counts, age_s)):
                off = away
        self._missed = 0 if off is None else self._missed + 1
        if off is not None and (self._missed > 1 or not self._take_up_slip(new)):
            self.forget()
        new = _Sighting(new.attitude, self._corrected(counts))
        *_, before, last = [None, None, *self._sightings]
        if before is not None and last is not None and _apart_deg(before, last) < NEW_PLACE_DEG:
            self._sightings.pop()
        self._sightings = [*self._sightings, new][-MOST_SIGHTINGS:]
        fits = sorted((self._fitted(base) for base in self._bases), key=lambda fit: fit.cost)
        self._fits = [fit for fit in fits if fit.cost - fits[0].cost < DECIDED]
        return off

    def attitude(self, counts: Counts) -> Floats | None:
        """The attitude (3, 3) at these counts; None before the first solve."""
        if not self._sightings:
            return None
        return self._fits[0].anchored(self._sightings[-1], self._corrected(counts))

    def sigma_deg(self, counts: Counts, age_s: float = 0.0) -> float:
        """1 sigma of the direction at these counts, ``age_s`` after the last solve; infinite before the first."""
        if not self._sightings:
            return math.inf
        here, last = self._corrected(counts), self._sightings[-1]
        best, *others = self._fits
        there = best.anchored(last, here)[2]
        apart = [separation_deg(there, other.anchored(last, here)[2]) for other in others]
        step = 0.3 * math.degrees(float(np.hypot(*best.values[:2]))) / KILO if here != last.counts else 0.0
        parts = (math.degrees(math.sqrt(best.variance(last, here))), step, CREEP_DEG_S * age_s, *apart)
        return math.hypot(*parts) + (POINTING_DEG / 2.0 if here != last.counts else 0.0)

    def _corrected(self, counts: Counts) -> Counts:
        return counts[0] + self._slipped[0], counts[1] + self._slipped[1]

    def _take_up_slip(self, new: _Sighting) -> bool:
        """Find the counts that the solve asks for; whether there are such."""
        from scipy.optimize import least_squares

        if any(n is None for n in self.counts_in_a_turn):
            return False
        fit, last = self._fits[0], self._sightings[-1]
        rates = fit.values[:2] / KILO

        def left(turned: Floats) -> Floats:
            counts = tuple((np.array(new.counts) + turned / rates).tolist())
            return np.asarray(rotation_vectors((new.attitude @ fit.anchored(last, counts).T)[None])[0])

        starts = [(x, y) for x in (0.0, 2.0, -2.0) for y in (0.0, 1.0, -1.0)]
        found = min((least_squares(left, start, method=METHOD) for start in starts), key=lambda one: float(one.cost))
        if math.degrees(float(np.linalg.norm(left(found.x)[:2]))) > SLIP_DEG:
            return False
        first, second = (found.x / rates).tolist()
        self._slipped = self._slipped[0] + first, self._slipped[1] + second
        return True

    def _fitted(self, base: Floats) -> _Fit:
        from scipy.optimize import least_squares

        seen = np.stack([one.attitude for one in self._sightings])
        counts = np.array([one.counts for one in self._sightings])
        weight = 1.0 / np.radians([POINTING_DEG, POINTING_DEG, ROLL_DEG])
        widest = 2.0 * math.pi * KILO / FEWEST_IN_A_TURN
        before = [fit for fit in self._fits if fit.base is base]

        def solved(start: _Fit) -> _Fit:
            def left(values: Floats) -> Floats:
                """Residuals (..., M) for each set of parameters (..., 8)."""
                off = seen @ start.attitudes(counts, values).swapaxes(-1, -2)
                off = rotation_vectors(off.reshape(-1, 3, 3)).reshape(*off.shape[:-1]) * weight
                cone = (small_rotations(values[..., 5:]) @ start.mounting)[..., 2, 1:2]
                priors = [
                    values[..., :2] / widest,
                    np.degrees(values[..., 2:4]) / LEAN_DEG,
                    np.degrees(cone) / CONE_DEG,
                ]
                return np.concatenate([off.reshape(*off.shape[:-2], -1), *priors, values[..., 4:] * 1e-3], axis=-1)

            def slopes(values: Floats) -> Floats:
                """The Jacobian (M, 8), all columns at once: SciPy would compute them one by one."""
                steps = STEP * np.maximum(np.abs(values), 1.0)
                return np.asarray(((left(values + np.diag(steps)) - left(values)) / steps[:, None]).T)

            found = least_squares(left, start.values, slopes, method=METHOD, x_scale="jac")
            slope = np.asarray(found.jac)
            return _Fit(base, start.mounting, found.x, np.linalg.pinv(slope.T @ slope), float(found.cost))

        starts = [_begun(base, seen, counts), *before]
        return min((solved(start) for start in starts), key=lambda fit: fit.cost)


def _begun(base: Floats, seen: Floats, counts: Floats) -> _Fit:
    """From the directions alone, as if the camera looked along a tube on a base without lean."""
    looks = seen[:, 2] @ base.T
    first, second = np.arctan2(looks[:, 1], looks[:, 0]), np.arcsin(np.clip(looks[:, 2], -1.0, 1.0))
    stepped = np.diff(counts, axis=0) / KILO
    turned = np.radians(wrapped(np.degrees(np.diff(np.stack([first, second], axis=1), axis=0))))
    weight = (stepped**2).sum(axis=0)
    rates = np.where(weight > 0.0, (stepped * turned).sum(axis=0) / np.maximum(weight, 1e-12), 0.0)
    values = np.array([*rates, 0.0, 0.0, first[-1] - rates[0] * counts[-1, 0] / KILO, 0.0, 0.0, 0.0])
    bare = _Fit(base, np.eye(3), values, np.zeros((8, 8)))
    return _Fit(base, seen[-1] @ bare.attitudes(counts[-1:])[0].T, values, np.zeros((8, 8)))


def _apart_deg(one: _Sighting, other: _Sighting) -> float:
    return separation_deg(one.attitude[2], other.attitude[2])


def earth_fixed(observed: Floats) -> Floats:
    """The attitude (3, 3) whose camera axis and x axis look where ``observed`` (2, 3) says, refraction and all.

    The first direction is the camera axis, the second a little beside it along the camera's x.
    """
    toward_x = observed[1] - observed[0]
    x = unit(toward_x - (toward_x @ observed[0]) * observed[0])
    return np.stack([x, cross_product(observed[0], x), observed[0]])
