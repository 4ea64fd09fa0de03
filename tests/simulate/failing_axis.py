"""An axis of a simulated mount that breaks on demand."""

from enum import StrEnum
from math import copysign, inf

from kochab.simulate.mechanics.axis import MotorAxis


class AxisFailure(StrEnum):
    RUNAWAY = "runaway"  # a slew does not brake: it ends when it is stopped
    SWAPPED = "swapped"  # a slew turns the wrong way round
    JUMP = "jump"  # the encoder loses its count


class FailingAxis(MotorAxis):
    failure = None
    misread_deg = 0.0

    def motor_deg(self, t):
        return super().motor_deg(t) + self.misread_deg

    def slew(self, t, target_deg, carrier_deg_s=0.0, approach_deg=0.0):
        way = target_deg - self.motor_deg(t)
        if self.failure is AxisFailure.RUNAWAY:
            self.run(t, copysign(self.top_deg_s, way))
            return inf
        if self.failure is AxisFailure.SWAPPED:
            target_deg -= 2.0 * way
        return super().slew(t, target_deg, carrier_deg_s, approach_deg)


def fail(mount, axis, failure, misread_deg=40.0):
    """Let axis 0 or 1 break now; ``misread_deg`` is the jump of its encoder."""
    with mount._lock:
        broken = mount._axes[axis]
        broken.__class__, broken.failure = FailingAxis, failure
        if failure is AxisFailure.JUMP:
            broken.misread_deg += misread_deg
