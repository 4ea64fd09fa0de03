"""The bench of all detectors counts as the thesis does."""

import numpy as np
import pytest

from kochab.detection import DETECTORS
from kochab.lab.bench import detectors as bench
from kochab.lab.bench import load_bench

STARS = np.array([[20.0, 20.0], [80.0, 20.0], [20.0, 80.0], [80.0, 80.0]])


def test_stars_missed_and_found_twice_are_counted() -> None:
    found = np.array([[20.5, 19.0], [21.0, 23.0], [80.0, 20.0], [50.0, 50.0]])
    rates, errors = bench.compare(found, STARS)
    assert rates == (0.5, 0.5)  # the second of a star and the one of none are false
    np.testing.assert_allclose(errors, [[0.5, 1.0], [0, 0], [np.nan] * 2, [np.nan] * 2])
    assert bench.compare(STARS[::-1], STARS)[0] == (1.0, 1.0)
    assert bench.compare(np.empty((0, 2)), STARS)[0] == (0.0, 1.0)


@pytest.mark.parametrize("kind", bench.KINDS, ids=lambda kind: kind.name)
def test_a_frame_holds_its_stars_and_the_same_for_a_seed(kind) -> None:
    frame, xy = bench.make_frame(kind, 3)
    again, _ = bench.make_frame(kind, 3)
    assert (frame.width, frame.height) == bench.SIZE
    assert xy.shape == (bench.STARS, 2)
    np.testing.assert_array_equal(frame.pixels, again.pixels)


def test_every_detector_has_a_row_and_the_default_goals(monkeypatch) -> None:
    monkeypatch.setattr(bench, "KINDS", bench.KINDS[:1])
    result = load_bench("detectors")(True, lambda line: None)
    assert [row["detector"] for row in result.rows][: len(DETECTORS)] == list(DETECTORS)
    assert all(0 <= row["tpr"] <= 1 and 0 <= row["ppv"] <= 1 for row in result.rows)
    assert {row["detector"]: row["frames"] for row in result.rows}["auto"] == 2
    assert result.goals[0].met is True
    assert len(result.goals) == 3
