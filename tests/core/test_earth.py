"""The Earth's turn, held against ERFA."""

from math import pi

import erfa
import pytest

from kochab.core.mount import SIDEREAL_DAY_S, SIDEREAL_DEG_S, SIDEREAL_RAD_S

DAY_S = 86400.0
JD_2026 = 2461041.5


def test_sidereal_time_goes_as_fast() -> None:
    today, tomorrow = (float(erfa.gmst06(JD_2026, d, JD_2026, d)) for d in (0.0, 1.0))
    turn = 2.0 * pi + (tomorrow - today) % (2.0 * pi)
    assert turn / DAY_S == pytest.approx(SIDEREAL_RAD_S, rel=1e-9)
    assert pytest.approx(360.0) == SIDEREAL_DEG_S * SIDEREAL_DAY_S
