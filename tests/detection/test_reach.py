"""Real pictures that once were too much for the detector."""

import numpy as np
import pytest

from kochab.detection.auto import AutoDetector
from kochab.frames import read_frame
from tests.house import REPOSITORY

REACH = REPOSITORY.parent / "shared" / "frames-reach"


@pytest.mark.skipif(not REACH.is_dir(), reason="../shared/frames-reach is not beside this checkout")
def test_a_frame_behind_thin_cloud_has_detections_that_are_numbers():
    """Its few shapes agree in nothing: the root of a negative determinant made an index of -2^63."""
    found = AutoDetector().detect(read_frame(REACH / "crash_satellites.png"))
    assert len(found.xy) > 100
    assert np.isfinite(found.xy).all()
    assert np.isfinite(found.flux).all()
    assert (found.xy >= -1.0).all()
