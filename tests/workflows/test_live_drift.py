"""The drift of a pointing against one that is made to drift."""

import numpy as np
import pytest

from kochab.core.attitude import unit_vectors
from kochab.workflows.live.update import WINDOW_S, DriftMeter

ARCMIN = 1 / 60
ARCSEC_DEG = 1 / 3600


def drifting(ra_deg, dec_deg, ra_rate, dec_rate, times, noise=0.0, seed=1):
    """Centres that drift by arcsec a minute on the sky."""
    rng = np.random.default_rng(seed)
    for t in times:
        east = (ra_rate * t / 60 + rng.normal(0, noise)) * ARCSEC_DEG / np.cos(np.radians(dec_deg))
        north = (dec_rate * t / 60 + rng.normal(0, noise)) * ARCSEC_DEG
        yield float(t), unit_vectors(ra_deg + east, dec_deg + north)


@pytest.mark.parametrize(("ra", "dec"), [(10.0, 0.0), (359.999, 60.0), (200.0, -85.0)])
def test_both_axes_are_measured(ra, dec) -> None:
    meter = DriftMeter()
    for t, centre in drifting(ra, dec, 12.0, -5.0, range(30)):
        drift = meter.add(t, centre)
    assert drift.ra_arcsec_min == pytest.approx(12.0, abs=0.05)
    assert drift.dec_arcsec_min == pytest.approx(-5.0, abs=0.05)
    assert (drift.span_s, drift.frames) == (29.0, 30)


def test_its_sigma_covers_its_error() -> None:
    pulls = []
    for seed in range(200):
        meter = DriftMeter()
        for t, centre in drifting(50.0, 30.0, 3.0, 1.0, range(20), noise=1.0, seed=seed):
            drift = meter.add(t, centre)
        pulls.append((drift.ra_arcsec_min - 3.0) / drift.ra_sigma)
        pulls.append((drift.dec_arcsec_min - 1.0) / drift.dec_sigma)
    assert 0.85 < np.std(pulls) < 1.25
    assert abs(np.mean(pulls)) < 0.2


def test_an_untracked_sky_is_a_drift_and_a_slew_is_not() -> None:
    meter = DriftMeter()
    for t, centre in drifting(50.0, 0.0, 902.5, 0.0, range(0, 50, 5)):
        drift = meter.add(t, centre)
    assert drift.ra_arcsec_min == pytest.approx(902.5, rel=0.01)
    assert meter.add(50.0, unit_vectors(52.0, 3.0)) is None
    assert meter.add(51.0, unit_vectors(52.0, 3.0)) is None
    still = meter.add(52.0, unit_vectors(52.0, 3.0))
    assert still.ra_arcsec_min == pytest.approx(0.0, abs=1e-6)
    assert still.frames == 3


def test_only_the_last_minute_counts_and_time_never_goes_back() -> None:
    meter = DriftMeter()
    for t, centre in drifting(50.0, 0.0, 10.0, 0.0, range(0, 300, 2)):
        drift = meter.add(t, centre)
    assert drift.span_s <= WINDOW_S
    assert meter.add(5.0, unit_vectors(50.0, 0.0)) is None


def test_frames_that_share_a_whole_second_still_show_the_drift() -> None:
    meter = DriftMeter()
    told = [meter.add(float(int(t)), c) for t, c in drifting(50.0, 0.0, 10.0, 0.0, np.arange(0.0, 5.0, 0.5))]
    assert [drift is None for drift in told] == [True] * 4 + [False] * 6
    assert told[-1].ra_arcsec_min == pytest.approx(10.0, abs=0.01)
    assert meter.add(4.0, unit_vectors(52.0, 3.0)) is None, "a slew within the second"
