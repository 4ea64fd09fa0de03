"""Sleep under libfaketime: it takes the end of a Python sleep for a moment of the other clock.

Its ``clock_nanosleep`` (0.9.10) subtracts the feigned offset even from a clock it leaves alone, and
``time.sleep`` fails with EINVAL. Python imports this by itself where it is on PYTHONPATH, so that
the programs that tests start sleep as well.
"""

import select
import time


def _sleep(seconds: float) -> None:
    select.select([], [], [], seconds)


time.sleep = _sleep
