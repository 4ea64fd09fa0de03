"""Frames without a star are not told to be focused: made in ways that the rules were not written from."""

import pytest

from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_frame
from tests.solver.starless import starless

CHOSEN = (
    "plain",
    "amp glow, bright",
    "dust, one size, JPEG",
    "dust, bright",
    "dust, bright, small",
    "flat of another night",
    "gradient",
    "many hot pixels",
    "clouds",
    "clouds, rough, JPEG",
    "clouds, soft",
    "dew",
)
"""Each was "out of focus"; 22 of the forty of `python -m tests.solver.starless` were, the bright dust to the last."""


@pytest.mark.parametrize("name", CHOSEN)
def test_a_starless_vignetted_frame_is_not_out_of_focus(name):
    ((_, frame),) = starless([name])
    found = run(solve_frame(frame, SolveOptions(timeout_s=60.0)))
    assert isinstance(found, NoSolution)
    assert found.reason is not Reason.OUT_OF_FOCUS
    assert "px wide" not in found.advice
