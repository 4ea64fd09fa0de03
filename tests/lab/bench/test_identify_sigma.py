"""What the bench of uncertainties renders, and what it holds against it."""

import numpy as np
import pytest

from kochab.lab.bench import identify_sigma


def test_rendered_fields_are_off_by_what_their_solutions_say() -> None:
    """Solved for another date than they are drawn for, narrow fields' stars are off together: by 1.65 sigma."""
    errors = identify_sigma._rendered(12, (3.0, 3.0))
    assert len(errors) >= 21
    assert np.sqrt(np.mean(np.square(errors[:, :2]))) == pytest.approx(1.0, abs=0.25)
