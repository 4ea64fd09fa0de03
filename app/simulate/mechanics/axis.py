"""One motor axis through time: planned slews, and what its gears and clutch make of them.

A motion is a list of segments of constant acceleration. Any moment can be asked for, in the past
too, which is how a camera sees the whole of an exposure; nothing needs a thread or steps.
"""

from bisect import bisect_right
from dataclasses import replace
from itertools import pairwise
from math import copysign, cos, exp, inf, pi, radians, sin

from app.simulate.mechanics.segment import FAST_DEG_S, Segment, trapezoid
from app.simulate.mechanics.wear import AxisFailure, AxisWear

__all__ = ["Axis", "AxisWear"]

KEPT = 400  # segments; older motion is forgotten


class Axis:
    """A motor axis: commands change its future, :meth:`true_deg` says where it really is."""

    def __init__(self, angle_deg: float, at: float, wear: AxisWear | None = None) -> None:
        self.wear = wear or AxisWear()
        self.acceleration = 2.0  # deg/s^2
        self.top_deg_s = 4.0
        self.failure: AxisFailure | None = None
        self.misread_deg = 0.0  # what the encoder has lost
        self._segments = [Segment(at, angle_deg, 0.0, 0.0, angle_deg, 0.0)]
        self._starts = [at]

    def motor_deg(self, t: float) -> float:
        """What the encoder reads."""
        return self._at(t).angle(t) + self.misread_deg

    def motor_rate_deg_s(self, t: float) -> float:
        """How fast the motor turns."""
        return self._at(t).rate(t)

    def true_deg(self, t: float) -> float:
        """Where the telescope's side of the axis is."""
        segment = self._at(t)
        load, extra = self._carried(segment, t)
        wear, turn = self.wear, 2.0 * pi * segment.angle(t) / self.wear.worm_deg
        periodic = wear.periodic_arcsec * sin(turn + radians(wear.worm_phase_deg))
        return load + extra + (periodic + self._wobble_arcsec(t)) / 3600.0

    def busy_until(self) -> float:
        """When the last planned change of motion is over."""
        return self._starts[-1]

    def planned_fast(self, t: float) -> bool:
        """Whether what is planned from ``t`` on holds a fast part."""
        now = max(0, bisect_right(self._starts, t) - 1)
        return any(segment.fast for segment in self._segments[now:])

    def place(self, t: float, angle_deg: float) -> None:
        """Stand at an angle at once, gears in the middle of their play, the past forgotten."""
        self.misread_deg = 0.0
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

    def slew(
        self, t: float, target_deg: float, carrier_deg_s: float = 0.0, approach_deg: float = 0.0
    ) -> float:
        """Go to ``target_deg``, itself moving at ``carrier_deg_s``; returns the time of arrival.

        With ``approach_deg`` the last of the way is at least so long and towards greater angles,
        which takes up the play of the gear always on the same side.
        """
        now = self._at(t)
        way, rate = target_deg - self.motor_deg(t), now.rate(t) - carrier_deg_s
        if self.failure is AxisFailure.RUNAWAY:
            self.run(t, copysign(self.top_deg_s, way))
            return inf
        if self.failure is AxisFailure.SWAPPED:
            way = -way
        short = approach_deg > 0.0 and way < approach_deg
        pieces = self._trapezoid(way - approach_deg if short else way, rate)
        if short:
            pieces += self._trapezoid(approach_deg, 0.0)
        end = t + sum(seconds for seconds, _ in pieces)
        self._plan(t, pieces, carrier_deg_s, now.angle(t) + way + carrier_deg_s * (end - t))
        return end

    def nudge(self, t: float, rate_deg_s: float, seconds: float, carrier_deg_s: float) -> float:
        """Guide: this rate above the carrier for so long; returns when it ends."""
        self.run(t, carrier_deg_s + rate_deg_s, gently=False)
        end = t + seconds
        self._append(end, self._at(end).angle(end), carrier_deg_s, 0.0)
        return end

    def carry(self, t: float, change_deg_s: float) -> None:
        """Change what goes on below all other motion, such as tracking, by so much."""
        if t >= self.busy_until():
            self.run(t, self.motor_rate_deg_s(t) + change_deg_s, gently=False)
        else:
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
        for segment in future:
            self._append(segment.start, segment.angle_deg, segment.rate_deg_s, segment.acceleration)

    def _trapezoid(self, way: float, rate: float) -> list[tuple[float, float]]:
        return trapezoid(way, rate, self.top_deg_s, self.acceleration)

    def _plan(
        self, t: float, pieces: list[tuple[float, float]], rate: float, angle: float | None
    ) -> None:
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
        way, half = segment.way(t), self.wear.backlash_deg / 2.0
        load = segment.load_deg
        for angle in way:
            load = min(max(load, angle - half), angle + half)
        if segment.fast:
            turned = sum(abs(b - a) for a, b in pairwise(way))
            return load, segment.extra_deg + self.wear.slip * turned
        return load, segment.extra_deg + self.wear.rate_error * (way[-1] - way[0])

    def _wobble_arcsec(self, t: float) -> float:
        """The swing left from the last fast move that has ended before ``t``."""
        wear = self.wear
        if not wear.wobble_arcsec:
            return 0.0
        last = bisect_right(self._starts, t) - 1
        for k in range(last, 0, -1):
            if self._segments[k - 1].fast and not self._segments[k].fast:
                since = t - self._starts[k]
                turn = 2.0 * pi * wear.wobble_hz * since
                return wear.wobble_arcsec * exp(-since / wear.wobble_s) * cos(turn)
        return 0.0
