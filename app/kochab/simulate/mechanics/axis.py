"""One motor axis through time: planned slews, and what its gears and clutch make of them.

A motion is a list of segments of constant acceleration. Any moment can be asked for, in the past
too, which is how a camera sees the whole of an exposure; nothing needs a thread or steps.
"""

from bisect import bisect_right
from dataclasses import replace
from itertools import pairwise
from math import copysign, cos, exp, pi, radians, sin, sqrt

from kochab.core.values import frozen

FAST_DEG_S = 0.05  # above: a slew, which may slip; below: tracking and guiding


@frozen
class Segment:
    """Motion from ``start`` (unix s) on: motor angle, rate and acceleration in degrees.

    ``load_deg`` is where the driven side of the gear is then, ``extra_deg`` what slips and wrong
    rates have added to it so far.
    """

    start: float
    angle_deg: float
    rate_deg_s: float
    acceleration: float
    load_deg: float
    extra_deg: float

    def angle(self, t: float) -> float:
        """Motor angle at ``t``."""
        s = t - self.start
        return self.angle_deg + s * (self.rate_deg_s + 0.5 * self.acceleration * s)

    def rate(self, t: float) -> float:
        """Motor rate at ``t``."""
        return self.rate_deg_s + self.acceleration * (t - self.start)

    def way(self, t: float) -> list[float]:
        """Angles passed up to ``t``, between which the motion is in one direction."""
        if self.acceleration:
            turned = self.start - self.rate_deg_s / self.acceleration
            if self.start < turned < t:
                return [self.angle_deg, self.angle(turned), self.angle(t)]
        return [self.angle_deg, self.angle(t)]

    @property
    def fast(self) -> bool:
        """Whether this is part of a slew."""
        return bool(self.acceleration) or abs(self.rate_deg_s) > FAST_DEG_S


def trapezoid(way: float, rate: float, top: float, brake: float) -> list[tuple[float, float]]:
    """Pieces (s, deg/s^2) of a motion that ends at rest.

    Parameters
    ----------
    way : float
        How far, degrees, signed.
    rate : float
        Rate at its beginning, deg/s.
    top : float
        Highest rate, deg/s.
    brake : float
        Acceleration either way, deg/s^2.
    """
    pieces: list[tuple[float, float]] = []
    stopping = rate * abs(rate) / (2.0 * brake)
    # moving away, too fast to stop in time, or above the top rate: brake to rest first, then start anew
    if rate and (rate * way < 0.0 or abs(stopping) > abs(way) or abs(rate) > top):
        pieces.append((abs(rate) / brake, copysign(brake, -rate)))
        way, rate = way - stopping, 0.0
    forward = copysign(1.0, way)
    way, rate = abs(way), abs(rate)
    # the triangle's peak, (rate^2 + 2 a way) / 2 = peak^2; capped at top it becomes a trapezoid
    peak = min(top, sqrt(brake * way + rate * rate / 2.0))
    up, down = (peak - rate) / brake, peak / brake
    cruise = way - (peak * peak - rate * rate / 2.0) / brake
    pieces.append((up, forward * brake))
    if cruise > 0.0 and peak >= top:
        pieces.append((cruise / top, 0.0))
    pieces.append((down, -forward * brake))
    return [piece for piece in pieces if piece[0] > 1e-9]


@frozen
class GearErrors:
    """What keeps an axis from being where its motor has turned it.

    ``backlash_deg`` is that of its gear; ``periodic_arcsec`` the amplitude of a sine over ``worm_deg`` of axis.
    ``slip`` is the part of every fast turn by which the clutch gives way, always towards greater angles, the heavy
    side. ``rate_error`` is the part by which slow motion is too fast. ``wobble_arcsec`` swings at ``wobble_hz``
    after a fast move and dies away within ``wobble_s`` (to 1/e).
    """

    backlash_deg: float = 0.0
    periodic_arcsec: float = 0.0
    worm_deg: float = 2.0
    worm_phase_deg: float = 0.0
    slip: float = 0.0
    rate_error: float = 0.0
    wobble_arcsec: float = 0.0
    wobble_hz: float = 2.0
    wobble_s: float = 1.0


KEPT = 400  # segments; older motion is forgotten


class MotorAxis:
    """A motor axis: commands change its future, :meth:`true_deg` says where it really is."""

    def __init__(self, angle_deg: float, at: float, gear: GearErrors | None = None) -> None:
        self.gear = gear or GearErrors()
        self.acceleration = 2.0  # deg/s^2
        self.top_deg_s = 4.0
        self.place(at, angle_deg)

    def motor_deg(self, t: float) -> float:
        """What the encoder reads."""
        return self._at(t).angle(t)

    def motor_rate_deg_s(self, t: float) -> float:
        """How fast the motor turns."""
        return self._at(t).rate(t)

    def true_deg(self, t: float) -> float:
        """Where the telescope's side of the axis is."""
        segment = self._at(t)
        load, extra = self._carried(segment, t)
        gear, turn = self.gear, 2.0 * pi * segment.angle(t) / self.gear.worm_deg
        periodic = gear.periodic_arcsec * sin(turn + radians(gear.worm_phase_deg))
        return load + extra + (periodic + self._wobble_arcsec(t)) / 3600.0

    def busy_until(self) -> float:
        """When the last planned change of motion is over."""
        return self._starts[-1]

    @property
    def last_rate_deg_s(self) -> float:
        """The rate that it keeps when all that is planned is over."""
        return self._segments[-1].rate_deg_s

    def planned_fast(self, t: float) -> bool:
        """Whether what is planned from ``t`` on holds a fast part."""
        now = max(0, bisect_right(self._starts, t) - 1)
        return any(segment.fast for segment in self._segments[now:])

    def place(self, t: float, angle_deg: float) -> None:
        """Stand at an angle at once, gears in the middle of their backlash, the past forgotten."""
        self._segments = [Segment(t, angle_deg, 0.0, 0.0, angle_deg, 0.0)]
        self._starts = [t]

    def run(self, t: float, rate_deg_s: float, gently: bool = True) -> None:
        """Go on at a rate; ``gently``, with the motor's own acceleration."""
        now = self._at(t)
        pieces: list[tuple[float, float]] = []
        change = rate_deg_s - now.rate(t)
        if gently and abs(change) > FAST_DEG_S:
            pieces = [(abs(change) / self.acceleration, copysign(self.acceleration, change))]
        self._plan(t, pieces, rate_deg_s, None)

    def slew(self, t: float, target_deg: float, carrier_deg_s: float = 0.0, approach_deg: float = 0.0) -> float:
        """Go to an angle; returns the time of arrival.

        Parameters
        ----------
        t : float
            When it begins, seconds on the axis's clock.
        target_deg : float
            The motor's angle then.
        carrier_deg_s : float
            Rate at which the target itself moves.
        approach_deg : float
            The last of the way is at least so long and towards greater angles, which takes up the backlash always
            on the same side.
        """
        now = self._at(t)
        way, rate = target_deg - self.motor_deg(t), now.rate(t) - carrier_deg_s
        short = approach_deg > 0.0 and way < approach_deg
        top, brake = self.top_deg_s, self.acceleration
        pieces = trapezoid(way - approach_deg if short else way, rate, top, brake)
        if short:
            pieces += trapezoid(approach_deg, 0.0, top, brake)
        end = t + sum(seconds for seconds, _ in pieces)
        self._plan(t, pieces, carrier_deg_s, now.angle(t) + way + carrier_deg_s * (end - t))
        return end

    def nudge(self, t: float, rate_deg_s: float, seconds: float, carrier_deg_s: float) -> float:
        """Guide: add a rate for a while; returns when it ends.

        Parameters
        ----------
        t : float
            When it begins, seconds on the axis's clock.
        rate_deg_s : float
            Added to the carrier.
        seconds : float
            For how long.
        carrier_deg_s : float
            The tracking rate.
        """
        self.run(t, carrier_deg_s + rate_deg_s, gently=False)
        end = t + seconds
        self._append(end, self._at(end).angle(end), carrier_deg_s, 0.0)
        return end

    def carry(self, t: float, change_deg_s: float) -> None:
        """Change what goes on below all other motion, such as tracking, by so much."""
        if t >= self.busy_until():
            self.run(t, self.motor_rate_deg_s(t) + change_deg_s, gently=False)
        else:
            # the last segment is what goes on after all planned motion
            last = self._segments[-1]
            self._segments[-1] = replace(last, rate_deg_s=last.rate_deg_s + change_deg_s)

    def displace(self, t: float, degrees: float) -> None:
        """Turn the telescope by hand with the clutch open: the motor knows nothing of it."""
        future = [s for s in self._segments if s.start > t]
        self._cut(t)
        held = self._segments[-1]
        load, extra = self._carried(held, t)
        here = Segment(t, held.angle(t), held.rate(t), held.acceleration, load, extra + degrees)
        self._push(here)
        # what was planned goes on, with the load and slips worked out anew from here
        for segment in future:
            self._append(segment.start, segment.angle_deg, segment.rate_deg_s, segment.acceleration)

    def _plan(self, t: float, pieces: list[tuple[float, float]], rate: float, angle: float | None) -> None:
        """Drop the future, accelerate in ``pieces`` of (s, deg/s^2), then keep ``rate``."""
        here, speed = self._at(t).angle(t), self.motor_rate_deg_s(t)
        self._cut(t)
        for seconds, acceleration in pieces:
            self._append(t, here, speed, acceleration)
            here += seconds * (speed + 0.5 * acceleration * seconds)
            speed += acceleration * seconds
            t += seconds
        self._append(t, here if angle is None else angle, rate, 0.0)

    def _cut(self, t: float) -> None:
        keep = max(1, bisect_right(self._starts, t))
        first = max(0, keep - KEPT)
        self._segments, self._starts = self._segments[first:keep], self._starts[first:keep]

    def _append(self, t: float, angle: float, rate: float, acceleration: float) -> None:
        load, extra = self._carried(self._segments[-1], t)
        self._push(Segment(t, angle, rate, acceleration, load, extra))

    def _push(self, segment: Segment) -> None:
        self._segments.append(segment)
        self._starts.append(segment.start)

    def _at(self, t: float) -> Segment:
        return self._segments[max(0, bisect_right(self._starts, t) - 1)]

    def _carried(self, segment: Segment, t: float) -> tuple[float, float]:
        """Where the driven side is at ``t``, and what slips and wrong rates add to it."""
        way, half = segment.way(t), self.gear.backlash_deg / 2.0
        load = segment.load_deg
        for angle in way:
            # the driven side stays until the motor has crossed the backlash and pushes it
            load = min(max(load, angle - half), angle + half)
        if segment.fast:
            turned = sum(abs(b - a) for a, b in pairwise(way))
            return load, segment.extra_deg + self.gear.slip * turned
        return load, segment.extra_deg + self.gear.rate_error * (way[-1] - way[0])

    def _wobble_arcsec(self, t: float) -> float:
        """The swing left from the last fast move that has ended before ``t``."""
        gear = self.gear
        if not gear.wobble_arcsec:
            return 0.0
        last = bisect_right(self._starts, t) - 1
        for k in range(last, 0, -1):
            if self._segments[k - 1].fast and not self._segments[k].fast:
                since = t - self._starts[k]
                turn = 2.0 * pi * gear.wobble_hz * since
                return gear.wobble_arcsec * exp(-since / gear.wobble_s) * cos(turn)
        return 0.0
