"""One axis of a chart: its range, where its ticks are, and what they say."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
TICKS = 5


@dataclass(frozen=True, slots=True)
class Axis:
    """From ``low`` to ``high``; ``fixed`` keeps them whatever is shown. ``scale`` is for the text.

    A logarithmic axis runs over whole decades and leaves out what is not above 0.
    """

    title: str
    low: float = 0.0
    high: float = 1.0
    log: bool = False
    fixed: bool = False
    unit: str = ""
    scale: float = 1.0

    def holding(self, values: Sequence[float]) -> "Axis":
        """The same axis over a range that holds ``values``."""
        shown = [v for v in values if math.isfinite(v) and (v > 0 or not self.log)]
        if self.fixed or not shown:
            return self
        if self.log:
            least, most = math.floor(math.log10(min(shown))), math.ceil(math.log10(max(shown)))
            return replace(self, low=10.0**least, high=10.0 ** max(most, least + 1))
        low, high = min(0.0, *shown), max(shown)
        return replace(self, low=low, high=high if high > low else low + 1.0)

    def share(self, value: float) -> float:
        """Where ``value`` lies between the ends, 0 to 1; NaN when it cannot be shown."""
        if not self.log:
            return (value - self.low) / (self.high - self.low)
        if not value > 0:
            return 0.0 if value == 0 else math.nan
        return math.log(value / self.low) / math.log(self.high / self.low)

    def ticks(self, most: int = TICKS) -> list[tuple[float, str]]:
        """About ``most`` values and their texts."""
        if self.log:
            first, last = round(math.log10(self.low)), round(math.log10(self.high))
            step = max(1, math.ceil((last - first) / most))
            return [(10.0**k, self._number(10.0**k)) for k in range(first, last + 1, step)]
        apart = _nice((self.high - self.low) / most)
        first = math.ceil(self.low / apart - 1e-9)
        last = math.floor(self.high / apart + 1e-9)
        return [(k * apart, self._number(k * apart)) for k in range(first, last + 1)]

    def text(self, value: float) -> str:
        """A value as it is read."""
        return f"{self._number(value)}{' ' + self.unit if self.unit else ''}"

    def _number(self, value: float) -> str:
        return f"{value * self.scale:.3g}".replace("-", "−")


def _nice(step: float) -> float:
    """The next round number above."""
    power = 10.0 ** math.floor(math.log10(step))
    return next(power * s for s in STEPS if power * s >= step * (1 - 1e-9))
