"""The guide logs of the bench: their geometry by the rules of drift alignment, and what is scored of them."""

from dataclasses import replace

import erfa
import numpy as np
import pytest

from kochab.lab.bench import polar_guided as bench

EVENING = bench.Evening(
    latitude_deg=45.0,
    altitude_off_arcsec=0.0,
    azimuth_off_arcsec=0.0,
    hour_deg=0.0,
    declination_deg=10.0,
    seeing_px=0.02,
    minutes=20.0,
    scale_arcsec_px=2.0,
    step_s=2.0,
    aggression=0.8,
    calibration=1.0,
)


def test_the_star_is_where_erfa_has_it_and_an_aligned_mount_keeps_it():
    for latitude in (45.0, -30.0):
        evening = replace(EVENING, latitude_deg=latitude, hour_deg=50.0)
        azimuth, altitude = erfa.hd2ae(np.radians(50.0), np.radians(10.0), np.radians(latitude))
        assert evening.star == pytest.approx(
            [np.cos(altitude) * np.sin(azimuth), np.cos(altitude) * np.cos(azimuth), np.sin(altitude)]
        )
        assert np.hypot(*bench.off_arcsec(evening, 3600.0)) < 1e-6


def test_a_star_near_the_meridian_drifts_south_at_the_published_rate_where_the_axis_is_too_far_east():
    """3.82 arcmin an arcsec a minute of Dec drift, as PHD2's own number has it."""
    level = 60.0 * 3.82 / np.cos(np.radians(45.0))
    east = replace(EVENING, azimuth_off_arcsec=level, hour_deg=-0.125)
    assert bench.off_arcsec(east, 60.0)[1] == pytest.approx(1.0, rel=0.01)
    assert bench.off_arcsec(replace(east, azimuth_off_arcsec=-level), 60.0)[1] == pytest.approx(-1.0, rel=0.01)


def test_gears_swallow_what_turns_back_up_to_their_play():
    gear = bench.Gear(5.0)
    gear.push(10.0)
    assert gear.axis == pytest.approx(5.0)
    gear.push(-4.0)
    assert gear.axis == pytest.approx(5.0)
    gear.push(-4.0)
    assert gear.axis == pytest.approx(2.0)


@pytest.mark.parametrize("kind", bench.KINDS)
def test_every_kind_of_log_is_read_and_scored(kind, tmp_path):
    row = bench.measure_guided(kind, 0, tmp_path)
    assert row["in_95"]
    assert not row["spoilt"]


def test_the_size_of_the_error_does_not_shrink_with_the_seeing(monkeypatch):
    """A scale fitted to pulses that answer the noise told 0.48 of the drift at 0.25 px."""
    monkeypatch.setattr(bench, "QUICK", 2)
    rows, goals = bench.guided_rows(True, lambda line: None)
    assert len(rows) == len(bench.KINDS)
    assert [goal.met for goal in goals] == [True, True]
