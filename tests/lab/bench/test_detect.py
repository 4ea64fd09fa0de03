"""The bench of detection judges rightly; the measuring itself is left to the bench."""

import argparse
import json

import numpy as np
import pytest

from kochab.lab.bench import command
from kochab.lab.bench import detect as bench
from kochab.lab.bench.detect import FINDERS, DetectionTruth, expected, finders, score
from kochab.simulate.star_images import FWHM_PER_SIGMA, Sensor, Sky


def _truth(n=6):
    xy = np.stack([np.arange(n) * 50.0 + 20, np.full(n, 30.0)], axis=1)
    return DetectionTruth(xy, np.full(n, 20.0), np.full(n, 0.1), 3.0, np.zeros(n, dtype=bool))


def test_a_perfect_list_is_perfect():
    truth = _truth()
    assert score(truth.xy, truth) == {"completeness": 1.0, "purity": 1.0, "rms_over_bound": 0.0}


def test_missed_false_and_misplaced_stars_are_counted():
    truth = _truth()
    found = np.vstack([truth.xy[:3] + np.array([0.2, 0.0]), [[5.0, 5.0]]])
    marks = score(found, truth)
    assert marks["completeness"] == 0.5
    assert marks["purity"] == 0.75
    assert marks["rms_over_bound"] == pytest.approx(2.0 / np.sqrt(2))
    assert score(np.empty((0, 2)), truth)["completeness"] == 0.0


def test_faint_stars_are_not_missed_but_are_true():
    truth = _truth()
    truth.snr[3:] = 5.0
    assert score(truth.xy[:3], truth)["completeness"] == 1.0
    assert score(truth.xy, truth)["purity"] == 1.0


def test_the_bound_is_the_known_one_in_its_two_limits():
    sigma, xy = 3.0 / FWHM_PER_SIGMA, np.array([[50.0, 50.0]])
    bright = expected(xy, np.array([1e6]), 3.0, Sky(0.01), Sensor(read_noise_e=0.1), (100, 100))
    wide = np.hypot(sigma, 1 / np.sqrt(12))  # a pixel widens the image
    assert bright.bound_px[0] == pytest.approx(wide / 1e3, rel=0.02)  # sigma / sqrt(N)
    assert bright.snr[0] == pytest.approx(1e3, rel=0.01)
    faint = expected(xy, np.array([1000.0]), 3.0, Sky(1e4), Sensor(), (100, 100))
    noise = np.sqrt(1e4 + 25)
    # background alone: sqrt(8 pi) sigma^2 noise / F (King 1983, PASP 95, 163)
    assert faint.bound_px[0] == pytest.approx(np.sqrt(8 * np.pi) * wide**2 * noise / 1e3, rel=0.03)


def test_our_detector_does_not_beat_the_bound_and_comes_near():
    frame, truth = bench.make_field(bench.RenderedField(1, 500, 3.0))
    marks = score(FINDERS["kochab"](frame, 3.0), truth)
    assert 0.9 < marks["rms_over_bound"] < 1.15
    assert marks["completeness"] > 0.97


def test_every_rival_that_is_here_is_measured_beside_ours(monkeypatch):
    monkeypatch.setattr(bench, "SIZES", {1: (400, 300)})
    field = bench.RenderedField(1, 20, 3.0, turns=1)
    found = finders()
    assert "kochab" in found
    rows = bench.measure_field(field, *bench.make_field(field), found)
    assert [row["detector"] for row in rows] == ["np.max", *found]
    for row in rows[1:]:
        assert row["wall_ms"] > 0
        assert row["memory"] > 0


def test_the_command_prints_goals_measured_in_this_run(monkeypatch, capsys):
    small = bench.RenderedField(24, 500, 3.0, turns=1)
    monkeypatch.setattr(bench, "SIZES", {24: (900, 700)})
    monkeypatch.setattr(bench, "QUICK", (small,))
    monkeypatch.setattr(bench, "JUDGED", small)
    parser = argparse.ArgumentParser()
    command.add_parser(parser.add_subparsers())
    assert command.run(parser.parse_args(["bench", "detect", "--quick", "--json"])) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["bench"] == "detect"
    assert len(data["goals"]) == 7
    assert all(isinstance(goal["value"], float) for goal in data["goals"] if goal["met"] is not None)
