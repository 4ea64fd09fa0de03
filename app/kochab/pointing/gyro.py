"""A gyroscope on a telescope that is pushed, aligned by solved frames: where it points by the turns felt since.

The gyroscope's rates, less what it shows at rest, add up to a rotation ``P`` in its own axes. It is fixed to the camera
somehow, ``A = K P``, and its axes have scale errors and are not quite orthogonal: between two solves the camera turned
by the vector ``c`` about its axes and the gyroscope felt ``p``, and::

    c = K (1 + S) p

gives the mounting ``K`` (a rotation) and the symmetric ``S`` (6 numbers: whatever else such axes do is a rotation), as
soon as two such turns were about different axes. They are fitted by least squares, ``S`` with the chips'
tolerance as prior. The newest solve is met exactly. While it rests nothing is added up, so the error grows with the
time in motion alone (zero velocity update). The start of a push, which still looks like rest, is added up once the push
is noticed: else each would lose a minute of arc. A slow push shows in the mean over several seconds, in which the noise
averages out: from about 0.015 deg/s. A slower one, such as following a star by hand (0.004), is taken for rest.
"""

import math
from collections import deque

import numpy as np

from kochab.attitude import wahba
from kochab.core.arrays import Floats
from kochab.core.attitude import cross_matrix, cross_product, rotation_vector, separation_deg, small_rotation, unit
from kochab.core.values import frozen
from kochab.pointing.encoders import CREEP_DEG_S, POINTING_DEG, SLIP_SIGMAS

SCALE = 0.01
"""1 sigma of an axis's scale, and of how much of another axis it feels: chips are given to 1 % (BMI160, LSM6DSO)."""
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
SHAPES = np.array([np.maximum(np.outer(a, b), np.outer(b, a)) for a, b in (np.eye(3)[list(pair)] for pair in PAIRS)])
"""The six terms of ``S`` (6, 3, 3): three scale errors, three pairs of axes that are not orthogonal."""
NOISE_DEG_RT_S = 0.01
"""1 sigma of a turn after one second by the rates' noise: 0.004 to 0.007 deg/s/sqrt(Hz) in the same chips."""
REST_DEG_S = 0.002
"""1 sigma of the rate at rest after a push: half of the Earth's rotation, which its axes now share differently."""
LAG_S = 0.05
"""How late a rate is known: over the network, and until the next one."""
STEADY_S, STEADY_DEG_S, RESTING_DEG_S = 0.8, 0.15, 0.03
"""It rests when within the window rates scatter no more than that, and their mean is that near the rate at rest."""
SLOW_S, SLOW_SIGMAS = 5.0, 3.0
"""And while the mean over this many seconds lies within so many sigmas of the rate at rest."""
TRUSTED_S = 15.0
"""Only rates this old count as the rate at rest: a slow push starts even more slowly, and would be absorbed in it."""
WANDER_DEG_S, REST_SEEN_DEG_S = 0.001, 0.01
"""Of the rate at rest: how far it goes in a second (root of time), and how well one window shows it."""
BREAK_S = 0.5
"""Without rates for so long, a turn may have been missed."""
KEPT_S = 60.0
"""Seconds from mid-exposure within which a frame is solved."""
NEW_PLACE_DEG, LARGEST_TURN_DEG, MOST_TURNS = 2.0, 120.0, 20
UNMOVED_DEG = 2.0 / 60.0
SLIP_DEG = 15.0 / 60.0
UNKNOWN_RAD = 1.0
"""Prior of the mounting's errors: none, but finite."""


@frozen(eq=False)
class _Felt:
    """The gyroscope at a moment: turned by ``turned`` (3, 3) since the beginning, in motion for ``moved_s``."""

    at_s: float
    turned: Floats
    moved_s: float
    steady: bool


@frozen(eq=False)
class _Sighting:
    attitude: Floats
    felt: _Felt


@frozen(eq=False)
class _Turn:
    """What the camera did (3,), what the gyroscope felt with the scales of then taken off (3,), and 1 sigma, rad."""

    camera: Floats
    felt: Floats
    sigma: float


class _Rates:
    """Rates (3,), rad/s, and how long each held, oldest first; ``turn`` (3,) and ``seconds`` are their sums."""

    def __init__(self) -> None:
        self._kept: deque[tuple[Floats, float]] = deque()
        self.turn, self.seconds = np.zeros(3), 0.0

    def __len__(self) -> int:
        return len(self._kept)

    def append(self, rate: Floats, seconds: float) -> None:
        self._kept.append((rate, seconds))
        self.turn, self.seconds = self.turn + rate * seconds, self.seconds + seconds

    def popleft(self) -> tuple[Floats, float]:
        """The oldest rate, and how long it held."""
        rate, seconds = self._kept.popleft()
        self.turn, self.seconds = self.turn - rate * seconds, self.seconds - seconds
        return rate, seconds


class GyroModel:
    """Takes rates and solves, and tells attitudes. Attitudes take Earth-fixed directions to camera axes."""

    def __init__(self) -> None:
        self._rest = np.zeros(3)
        self._rest_variance = math.inf
        self._window: deque[tuple[float, Floats]] = deque()
        self._skipped = _Rates()  # taken for rest, not yet trusted to be it
        self._slow = _Rates()  # since the last quick movement
        self._past: deque[_Felt] = deque()
        self._anchor: _Sighting | None = None
        self._place: _Sighting | None = None
        self._missed = 0
        self.rate_deg_s = 0.0
        self._forget_mounting()

    def _forget_mounting(self) -> None:
        self._turns: deque[_Turn] = deque(maxlen=MOST_TURNS)
        self._mounting, self._axes = np.eye(3), np.eye(3)  # K, and 1 + S
        self._covariance = np.diag([UNKNOWN_RAD**2] * 3 + [SCALE**2] * 6)

    # -- What is felt ------------------------------------------------------------------------------

    def feel(self, at_s: Floats, rates: Floats) -> None:
        """Take rates (N, 3), rad/s about the gyroscope's axes, at moments (N,) s, in increasing order."""
        for moment, rate in zip(at_s.tolist(), rates, strict=True):
            before = self._past[-1] if self._past else None
            step_s = BREAK_S if before is None else moment - before.at_s
            if -BREAK_S < step_s <= 0.0:
                continue
            if abs(step_s) >= BREAK_S:
                self.lose()
                self._past.append(_Felt(moment, np.eye(3), 0.0, False))
                continue
            assert before is not None
            self._window.append((moment, rate))
            self._skipped.append(rate, step_s)
            while moment - self._window[0][0] > STEADY_S:
                self._window.popleft()
            self._slow.append(rate, step_s)
            while self._slow.seconds > SLOW_S:
                self._slow.popleft()
            steady, resting = self._look_at_window(step_s)
            turned, moved_s = before.turned, before.moved_s
            while self._skipped and not resting:  # what began before it was noticed counts, too
                felt, seconds = self._skipped.popleft()
                turned = small_rotation(-self._axes @ (felt - self._rest) * seconds) @ turned
                moved_s += seconds
            self.rate_deg_s = 0.0 if resting else math.degrees(float(np.linalg.norm(rate - self._rest)))
            self._past.append(_Felt(moment, turned, moved_s, steady))
        while self._past and self._past[-1].at_s - self._past[0].at_s > KEPT_S:
            self._past.popleft()

    def lose(self) -> None:
        """Rates are missing: where it points, only the next solve tells."""
        self._past.clear()
        self._window.clear()
        self._skipped, self._slow = _Rates(), _Rates()
        self._anchor = self._place = None

    def _look_at_window(self, step_s: float) -> tuple[bool, bool]:
        """Whether the rates are steady, and whether the gyroscope is at rest; what surely was rest gives its bias."""
        steady, quick = self._is_steady(step_s)
        if not steady or quick:
            # a quick push begins in the newest alone: what lies before it was rest
            self._trust_rest(STEADY_S)
            self._slow = _Rates()
            return steady, False
        noise = NOISE_DEG_RT_S / math.sqrt(self._slow.seconds)
        limit = SLOW_SIGMAS * math.hypot(noise, math.degrees(math.sqrt(self._rest_variance)))
        if math.degrees(float(np.abs(self._slow.turn / self._slow.seconds - self._rest).max())) > limit:
            return True, False
        self._trust_rest(TRUSTED_S)
        return True, True

    def _is_steady(self, step_s: float) -> tuple[bool, bool]:
        """Whether the rates scatter little, and whether it turns all the same so quickly that a short mean shows it."""
        if self._window[-1][0] - self._window[0][0] < 0.9 * STEADY_S:
            return False, False
        seen = np.array([rate for _, rate in self._window])
        if np.degrees(seen.std(axis=0).max()) > STEADY_DEG_S:
            return False, False
        mean = seen.mean(axis=0)
        if math.isinf(self._rest_variance):
            self._measure_rest(mean, math.radians(REST_SEEN_DEG_S) ** 2)
        else:
            self._rest_variance += math.radians(WANDER_DEG_S) ** 2 * step_s
        return True, math.degrees(float(np.abs(mean - self._rest).max())) > RESTING_DEG_S

    def _trust_rest(self, but_s: float) -> None:
        """What was skipped before the newest ``but_s`` seconds was rest, and gives the bias."""
        while self._skipped.seconds > but_s:
            rate, seconds = self._skipped.popleft()
            if not math.isinf(self._rest_variance):
                self._measure_rest(rate, math.radians(REST_SEEN_DEG_S) ** 2 * STEADY_S / seconds)

    def _measure_rest(self, mean: Floats, variance: float) -> None:
        gain = 1.0 if math.isinf(self._rest_variance) else self._rest_variance / (self._rest_variance + variance)
        self._rest = self._rest + gain * (mean - self._rest)
        self._rest_variance = variance if math.isinf(self._rest_variance) else (1.0 - gain) * self._rest_variance

    # -- What is solved ----------------------------------------------------------------------------

    def see(self, attitude: Floats, at_s: float) -> float | None:
        """Take a solve of mid-exposure ``at_s``, unless it moved then.

        Returns how far off the turns were, degrees, when that is more than they can be: the gyroscope was moved on the
        telescope. Twice in a row, its mounting is learned anew.
        """
        felt = min(self._past, key=lambda one: abs(one.at_s - at_s), default=None)
        if felt is None or not felt.steady or abs(felt.at_s - at_s) > STEADY_S:
            return None
        new, last, place = _Sighting(np.asarray(attitude, dtype=np.float64), felt), self._anchor, self._place
        if last is None or place is None:
            self._anchor = self._place = new
            return None
        camera, turned = _between(last, new)
        moved_s = felt.moved_s - last.felt.moved_s
        unmoved = math.degrees(float(np.linalg.norm(camera))) < UNMOVED_DEG
        if unmoved and moved_s > STEADY_S:  # what was felt is the rate at rest, which has wandered off
            self._rest_variance = math.inf  # all that was known of it
            self._measure_rest(self._rest - turned / moved_s, math.radians(UNMOVED_DEG / moved_s) ** 2)
            self._anchor = new
            return None
        sigma = self.sigma_deg(felt)
        away = separation_deg(self._attitude(felt)[2], new.attitude[2])
        off = away if away > max(SLIP_DEG, SLIP_SIGMAS * sigma) else None
        self._missed = 0 if off is None else self._missed + 1
        if self._missed > 1:
            self._forget_mounting()
        self._anchor = new
        camera, turned = _between(place, new)
        turn_deg = math.degrees(float(np.linalg.norm(camera)))
        if off is None and turn_deg < NEW_PLACE_DEG:
            return None  # short ways add up to one that tells something
        self._place = new
        if off is None and turn_deg < LARGEST_TURN_DEG:
            self._turns.append(
                _Turn(camera, np.asarray(np.linalg.solve(self._axes, turned)), self._turn_sigma(place.felt, felt))
            )
            self._fit()
        return off

    def _turn_sigma(self, last: _Felt, felt: _Felt) -> float:
        moved_s = felt.moved_s - last.moved_s
        rest = math.hypot(math.radians(REST_DEG_S), math.sqrt(min(self._rest_variance, 1.0)))
        noise = math.radians(NOISE_DEG_RT_S) * math.sqrt(moved_s)
        wander = math.radians(WANDER_DEG_S) * math.sqrt(moved_s**3 / 3.0)  # of the rate at rest, added up
        return math.hypot(math.radians(POINTING_DEG), rest * moved_s, noise, wander)

    def _fit(self) -> None:
        camera = np.array([turn.camera for turn in self._turns])
        felt = np.array([turn.felt for turn in self._turns])
        weight = 1.0 / np.array([turn.sigma for turn in self._turns])
        lengths = np.linalg.norm(camera, axis=1)
        mounting, axes = self._mounting, self._axes
        if len(self._turns) > 1:
            ways = unit(camera), unit(felt)
            mounting = wahba(*ways, 1.0 / (weight * lengths)).matrix
        elif len(self._turns) == 1:
            mounting = _shortest(felt[0], camera[0])
        prior = np.array([UNKNOWN_RAD**-2] * 3 + [SCALE**-2] * 6)
        for _ in range(5):
            left = (camera - felt @ axes @ mounting.T) * weight[:, None]
            slope = np.stack([_slope(mounting, axes, one) for one in felt]) * weight[:, None, None]
            slope, rest = slope.reshape(-1, 9), left.reshape(-1)
            information = slope.T @ slope + np.diag(prior)
            shape = np.array([axes[i, j] - (i == j) for i, j in PAIRS])
            known = prior * np.concatenate([np.zeros(3), shape])
            step = np.linalg.solve(information, slope.T @ rest - known)
            mounting, axes = small_rotation(step[:3]) @ mounting, axes + np.tensordot(step[3:], SHAPES, 1)
        self._mounting, self._axes, self._covariance = mounting, axes, np.linalg.inv(information)

    # -- What is asked -----------------------------------------------------------------------------

    @property
    def newest(self) -> _Felt | None:
        """The last moment that was felt; None before the first solve, or since a loss."""
        return self._past[-1] if self._past and self._anchor is not None else None

    def attitude(self) -> Floats | None:
        """The attitude (3, 3) at the last moment; None while it cannot be told."""
        return None if self.newest is None else self._attitude(self.newest)

    def _attitude(self, felt: _Felt) -> Floats:
        assert self._anchor is not None
        turned = rotation_vector(felt.turned @ self._anchor.felt.turned.T)
        return np.asarray(small_rotation(self._mounting @ turned) @ self._anchor.attitude)

    def sigma_deg(self, felt: _Felt | None = None) -> float:
        """1 sigma of the direction then, the last moment if not given; infinite before the first solve."""
        felt, last = felt or self.newest, self._anchor
        if felt is None or last is None:
            return math.inf
        creep = CREEP_DEG_S * max(0.0, felt.at_s - last.felt.at_s)
        if felt.moved_s <= last.felt.moved_s:
            return creep
        turned = rotation_vector(felt.turned @ last.felt.turned.T)
        slope = _slope(self._mounting, np.eye(3), turned)[:2]
        mounting = math.degrees(math.sqrt(max(float(np.trace(slope @ self._covariance @ slope.T)), 0.0)))
        moved = math.degrees(self._turn_sigma(last.felt, felt))
        return math.hypot(mounting, math.sqrt(2.0) * moved, LAG_S * self.rate_deg_s, creep)


def _slope(mounting: Floats, axes: Floats, felt: Floats) -> Floats:
    """Derivatives (3, 9) of a felt turn (3,), in camera axes, by small turns of the mounting and the terms of ``S``."""
    by_turn = -cross_matrix(mounting @ axes @ felt)
    return np.concatenate([by_turn, mounting @ (SHAPES @ felt).T], axis=1)


def _between(one: _Sighting, other: _Sighting) -> tuple[Floats, Floats]:
    """The turn from one solve to another, as the camera made it and as it was felt: vectors (3,), rad."""
    camera = rotation_vector(other.attitude @ one.attitude.T)
    return camera, rotation_vector(other.felt.turned @ one.felt.turned.T)


def _shortest(start: Floats, end: Floats) -> Floats:
    """The rotation (3, 3) that takes the direction of one vector to that of another by the shortest way."""
    a, b = unit(start), unit(end)
    axis = cross_product(a, b)
    sine, cosine = float(np.linalg.norm(axis)), float(a @ b)
    if sine < 1e-9:
        axis, sine = cross_product(a, np.eye(3)[np.abs(a).argmin()]), 1.0
        axis /= np.linalg.norm(axis)
        return np.asarray(small_rotation(axis * (0.0 if cosine > 0.0 else math.pi)))
    return np.asarray(small_rotation(axis / sine * math.atan2(sine, cosine)))
