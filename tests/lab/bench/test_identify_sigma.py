"""What the bench of uncertainties renders, and what it holds against it."""

import numpy as np
import pytest

from kochab.lab.bench import identify_sigma


def test_rendered_fields_are_off_by_what_their_solutions_say() -> None:
    """Solved for another date than they are drawn for, narrow fields' stars are off together: by 1.65 sigma."""
    errors = identify_sigma._rendered(12, (3.0, 3.0))
    assert len(errors) >= 21
    assert np.sqrt(np.mean(np.square(errors[:, :2]))) == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize(("within_68", "met"), [(0.660, True), (0.648, False), (0.710, True), (0.718, False)])
def test_uncertainties_are_as_stated_when_they_hold_68_percent_within_three_points(within_68, met) -> None:
    """Of a million errors, the sampling is 0.1 points."""
    row = {"fields": "rendered", "mode": "centre", "n": 10**6, "within_68": within_68, "within_95": 0.95}
    found, beside, crops = identify_sigma.sigma_goals([row])
    assert found.met is met
    assert beside.met is crops.met is None, "they were not measured"
