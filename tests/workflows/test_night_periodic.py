"""Periodic error of worms made here: amplitude, period and harmonics with uncertainties that hold; none in wander."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from kochab.workflows.night.periodic import periodic_error
from kochab.workflows.night.tracking import Place, tracking_of

EXPOSURE_S = 30.0


def worm(rng, period_s, sizes, count=60, noise=1.0, dithers=0.1, cadence_s=40.0):
    """Times, places on the axis averaged over the exposure, and groups."""
    time = np.arange(count) * cadence_s + rng.uniform(0, 5)
    group = np.cumsum(rng.random(count) < dithers)
    phases = rng.uniform(0, 2 * np.pi, len(sizes))
    fine = time[:, None] + np.linspace(-EXPOSURE_S / 2, EXPOSURE_S / 2, 61)
    waves = [
        size * np.sin(2 * np.pi * k * fine / period_s + phase)
        for k, (size, phase) in enumerate(zip(sizes, phases, strict=True), 1)
    ]
    levels = rng.normal(0, 20, group.max() + 1)
    place = np.sum(waves, axis=0).mean(axis=1) + rng.normal(0, noise, count) + 30 * time / 3600 + levels[group]
    return time, place, group


def test_amplitude_period_and_rate_are_those_of_the_worm_and_their_uncertainties_hold():
    rng = np.random.default_rng(2)
    pulls, missed = {"amplitude": [], "period": [], "rate": [], "second": []}, 0
    for _ in range(150):
        period, sizes = rng.uniform(250, 640), (rng.uniform(4, 20), rng.uniform(1.5, 4))
        found = periodic_error(*worm(rng, period, sizes), EXPOSURE_S)
        if found is None:
            missed += 1
            continue
        for name, one, true in (
            ("amplitude", found.amplitudes[0], sizes[0]),
            ("period", found.period_s, period),
            ("rate", found.rate, 30.0),
        ):
            pulls[name].append((one.value - true) / one.sigma)
        if len(found.amplitudes) > 1:
            pulls["second"].append((found.amplitudes[1].value - sizes[1]) / found.amplitudes[1].sigma)
    assert missed < 9
    for name, values in pulls.items():
        assert 0.5 < np.mean(np.abs(values) < 1) < 0.82, name
        assert np.mean(np.abs(values) < 2) > 0.89, name
    assert len(pulls["second"]) > 75


@pytest.mark.parametrize("alike", [0.0, 0.4, 0.8])
def test_noise_and_wander_have_none(alike):
    """Seeing, and a mount that wanders: each place like the one before."""
    rng = np.random.default_rng(3)
    found = 0
    for _ in range(100):
        places = np.zeros(60)
        for k, step in enumerate(rng.normal(0, 1, 59), 1):
            places[k] = alike * places[k - 1] + step
        found += periodic_error(np.arange(60) * 40.0, places, np.zeros(60, int), EXPOSURE_S) is not None
    assert found <= 1
    assert periodic_error(*(one[:10] for one in worm(rng, 400.0, (15.0,)))) is None
    assert periodic_error(*worm(rng, 1500.0, (15.0,), count=45)) is None  # 1.2 turns
    assert periodic_error(np.arange(20) * 40.0, np.zeros(20), np.zeros(20, int)) is None, "an axis that stands still"


def test_astropys_periodogram_has_the_same_period():
    from astropy.timeseries import LombScargle

    rng = np.random.default_rng(4)
    time, place, _ = worm(rng, 478.7, (8.0,), count=80, dithers=0.0)
    found = periodic_error(time, place, np.zeros(80, int), EXPOSURE_S)
    frequency, power = LombScargle(time, place - np.polyval(np.polyfit(time, place, 2), time)).autopower(
        samples_per_peak=40, minimum_frequency=1 / 1500, maximum_frequency=1 / 100
    )
    assert found.period_s.value == pytest.approx(1 / frequency[power.argmax()], abs=4 * found.period_s.sigma + 0.5)


def test_a_slip_and_dithers_smaller_than_the_worm_are_found_beneath_it():
    rng = np.random.default_rng(5)
    time, error, _ = worm(rng, 478.7, (15.0,), count=60, noise=0.7, dithers=0.0)
    error = error - 30 * time / 3600
    places, level = [], np.zeros(2)
    for k in range(60):
        if k and k % 4 == 0:
            level = level + rng.uniform(-25, 25, 2)
        if k == 37:
            level = level + np.array([200.0, 0.0])
        east, north = error[k] * np.cos(np.radians(50)) + level[0], rng.normal(0, 0.7) + level[1]
        when = datetime(2026, 1, 1, 20, tzinfo=UTC) + timedelta(seconds=float(time[k]))
        places.append(Place(when, 40 + east / 3600 / np.cos(np.radians(50)), 50 + north / 3600, 2.0, exposure_s=30.0))
    (found,) = tracking_of(places)
    assert found.periodic.amplitudes[0].value == pytest.approx(15.0, abs=4 * found.periodic.amplitudes[0].sigma)
    assert found.periodic.period_s.value == pytest.approx(478.7, abs=4 * found.periodic.period_s.sigma)
    (slip,) = found.knocks
    assert (slip.before, slip.axis) == (36, "RA")
    assert slip.ra_arcsec.value == pytest.approx(200.0, abs=4 * slip.ra_arcsec.sigma + 0.5)
    assert found.dithers >= 12
    assert found.rate_arcsec_s is None  # without a site refraction is unknown


def test_the_rate_is_that_of_a_mount_that_is_slow():
    """The axis falls behind by 36 arcsec an hour: a hundredth of an arcsec a second."""
    rng = np.random.default_rng(6)
    start = datetime(2026, 1, 1, 20, tzinfo=UTC)
    places = [
        Place(start + timedelta(minutes=3 * k), 40 + 36.0 * k / 20 / 3600 + rng.normal(0, 1) / 3600, 0.0, 2.0)
        for k in range(20)
    ]
    held = [replace(p, axis_arcsec=3600 * (p.ra_deg - 40)) for p in places]
    (found,) = tracking_of(held, polar_arcsec=0.0)
    assert found.rate_arcsec_s.value == pytest.approx(15.041067 - 0.01, abs=4 * found.rate_arcsec_s.sigma)
    assert found.rate_arcsec_s.sigma < 1e-3
    north = [replace(p, dec_deg=60.0) for p in held]
    (wide,) = tracking_of(north, polar_arcsec=600.0)
    assert wide.rate_arcsec_s.sigma == pytest.approx(15.041 * np.radians(600 / 3600) * np.tan(np.radians(60)), rel=0.01)
