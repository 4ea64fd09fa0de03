import numpy as np
import pytest

from kochab.lab.bench.papers import constellations_1992
from kochab.lab.bench.papers.constellations_1992 import (
    PIXELS,
    SITUATIONS,
    accuracy,
    averaged,
    camera,
    default_axis,
    initial_axis,
    judged,
    picture,
    predicted_axis,
    repeated,
    share,
    sky,
)


def off_arcsec(one, axis):
    return np.hypot(*(one.attitude.matrix @ axis)[:2]) * 206264.8


def truth_px(one):
    xy = one.camera.project(sky().vectors @ one.attitude.matrix.T)
    return xy[np.isfinite(xy).all(axis=1)]


def nearest_px(one):
    return np.linalg.norm(one.detections.xy[:, None] - truth_px(one), axis=2).min(axis=1)


def test_pictures_are_as_the_paper_says() -> None:
    rng = np.random.default_rng(1)
    many = [picture(rng, SITUATIONS[0]) for _ in range(200)]
    assert np.mean([len(p.detections) for p in many]) == pytest.approx(18.9, abs=1.2)
    worst_px = np.radians(3 / 60) * camera().focal_px * 1.08  # pixels are smaller at the rim
    assert max(nearest_px(p).max() for p in many) < worst_px
    middle = (PIXELS - 1) / 2
    assert max(np.hypot(*(p.detections.xy - middle).T).max() for p in many) < PIXELS / 2 + 2


def test_each_situation_has_its_errors() -> None:
    rng = np.random.default_rng(2)
    for what in SITUATIONS:
        one = picture(rng, what)
        assert len(one.detections) == one.stars + what.false
        limit = np.radians(3 / 60) * camera().focal_px * 1.08
        assert (nearest_px(one) > limit).sum() <= what.false + what.outside
    fields = list(repeated(rng, 3))
    assert all(np.array_equal(f.attitude.matrix, fields[0].attitude.matrix) for f in fields)
    assert not np.array_equal(fields[0].detections.xy[0], fields[1].detections.xy[0])


def test_all_three_find_the_axis() -> None:
    rng = np.random.default_rng(3)
    for _ in range(3):
        one = picture(rng, SITUATIONS[0])
        for axis in (initial_axis(one), predicted_axis(one, rng), default_axis(one)):
            assert axis is not None
            assert off_arcsec(one, axis) < 100.0


def test_a_tally_counts_right_and_wrong_and_averages_what_is_left() -> None:
    one = picture(np.random.default_rng(4), SITUATIONS[0])
    right = one.attitude.boresight
    answers = [judged(one, lambda _, a=axis: a) for axis in (right, one.attitude.matrix[0], None, right)]
    assert share(answers, "right") == 50.0
    assert share(answers, "wrong") == 25.0
    assert accuracy(answers) == pytest.approx(0.0, abs=1e-6)
    off = right + np.array([30.0, 40.0]) @ one.attitude.matrix[:2] / 206264.8
    answers[0] = judged(one, lambda _: off)
    assert accuracy(answers) == pytest.approx(np.sqrt(1250.0) / 2, rel=1e-3)
    assert accuracy(answers, power=2.0) == pytest.approx(np.sqrt(1250.0 / 2), rel=1e-3)


def test_averages_fall_below_two_arcsec() -> None:
    left, promised = averaged(seed=5, frames=100, trials=4)
    assert left < 3.0
    assert promised == pytest.approx(1.6, abs=0.6)


def test_rows_name_paper_ours_and_default(monkeypatch) -> None:
    monkeypatch.setattr(constellations_1992, "PAPER_RUNS", 4)
    monkeypatch.setattr(constellations_1992, "_average_rows", lambda *_: [])
    rows = constellations_1992.rows(quick=False, seed=6)
    shares = [r for r in rows if r["table"] == "table 2" and r["paper"] is not None]
    assert [r["paper"] for r in shares] == [94.6, 85.2, 85.2, 78.6, 72.0, 88.4]
    assert all(r["ours"] >= 50 and r["default"] >= 75 for r in shares)
    accuracy = [r for r in rows if r["table"] == "table 3"][:6]
    assert all(5 < r["ours"] < 60 for r in accuracy)
