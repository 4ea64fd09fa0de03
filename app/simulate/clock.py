"""Simulated UTC: it may start at any date, run faster than the wall's clock, or be stepped."""

import threading
import time
from datetime import UTC, datetime


class SimulatedClock:
    """Seconds since 1970 UTC that pass ``rate`` times as fast as real ones.

    With a rate of 0 time stands still but for :meth:`step` and :meth:`sleep`, so that a test
    is as fast as it can compute and comes out the same every time. Safe from any thread.
    """

    def __init__(self, start_unix_s: float, rate: float = 1.0) -> None:
        if rate < 0.0:
            raise ValueError("a clock cannot run backwards")
        self._lock = threading.Lock()
        self._rate = rate
        self._base_unix_s = start_unix_s
        self._base_real_s = time.monotonic()

    @property
    def rate(self) -> float:
        """Simulated seconds in a real one."""
        return self._rate

    def now_unix(self) -> float:
        """Simulated seconds since 1970 UTC."""
        with self._lock:
            return self._now()

    def now_utc(self) -> datetime:
        """The same as an aware time."""
        return datetime.fromtimestamp(self.now_unix(), UTC)

    def step(self, seconds: float) -> float:
        """Jump ahead by so much and return the new time."""
        if seconds < 0.0:
            raise ValueError("a clock cannot run backwards")
        with self._lock:
            self._base_unix_s += seconds
            return self._now()

    def set_rate(self, rate: float) -> None:
        """Run faster or slower from now on; the time does not jump."""
        if rate < 0.0:
            raise ValueError("a clock cannot run backwards")
        with self._lock:
            self._base_unix_s, self._base_real_s = self._now(), time.monotonic()
            self._rate = rate

    def sleep(self, seconds: float) -> None:
        """Let so many simulated seconds pass: by waiting, or by stepping when time stands still."""
        if self._rate == 0.0:
            self.step(max(0.0, seconds))
        else:
            time.sleep(max(0.0, seconds) / self._rate)

    def _now(self) -> float:
        return self._base_unix_s + (time.monotonic() - self._base_real_s) * self._rate
