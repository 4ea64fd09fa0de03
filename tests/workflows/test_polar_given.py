"""Sites and clocks that somebody gave wrong, and two frames that nothing checks: mounts under erfa's sky."""

from dataclasses import replace

import numpy as np
import pytest

from kochab.core.frame import Site
from kochab.lab.bench import polar_sweeps as sky
from kochab.lab.bench.polar_faults import axis_told, solved_files
from kochab.polar.horizon import sun_altitude_deg
from kochab.polar.measure import Measurement, PolarFindingKind
from kochab.workflows.polar.solutions import FilesTold, axis_of
from kochab.workflows.polar.sources import given_doubts


def sweep_of(seed, frames=5):
    rng = np.random.default_rng([41, seed])
    while True:
        sweep = sky.random_sweep(rng, frames, 60.0)
        if np.degrees(np.arccos(sweep.axis @ sky.refracted_pole(sweep.place))) > 0.5:
            return sweep, rng


def told_of(sweep, rng, **said):
    files = [replace(f, site=said.get("theirs")) for f in solved_files(sweep, rng)]
    place = sweep.said_place
    given = Site(place.latitude_deg, place.longitude_deg, place.height_m)
    return axis_of(files, [0] * len(files), [], FilesTold(given, utc_offset_h=said.get("utc_offset_h", 0.0))).result


def kinds(told, spoiling=False):
    return {finding.kind for finding in told.findings if finding.spoils or not spoiling}


@pytest.mark.parametrize("change", [sky.with_dec_moved, sky.with_kick, sky.with_one_time_wrong])
def test_two_frames_give_no_bolt_advice(change):
    for seed in range(3):
        sweep, rng = sweep_of(seed, 2)
        told = axis_told(change(sweep, rng), rng).result
        assert not told.checked
        assert "Take a third before you turn a bolt" in " ".join(finding.text for finding in told.findings)


def test_three_frames_are_checked():
    sweep, rng = sweep_of(1, 3)
    assert axis_told(sweep, rng).result.checked


@pytest.mark.parametrize("change", [sky.with_clock_wrong, sky.with_site_wrong])
def test_a_sure_clock_or_site_is_told_to_be_on_trust_with_what_it_would_cost(change):
    """The sky an hour later is the sky of another longitude: nothing in the frames shows it."""
    for seed in range(3):
        sweep, rng = sweep_of(seed)
        told = axis_told(change(sweep, rng), rng).result
        text = next(finding.text for finding in told.findings if finding.kind is PolarFindingKind.ON_TRUST)
        assert "an hour by " in text


def test_frames_by_day_are_a_wrong_site_or_time():
    """A longitude from the other side of the world puts the Sun up."""
    seen = 0
    for seed in range(6):
        sweep, rng = sweep_of(seed)
        there = replace(sweep.place, longitude_deg=sweep.place.longitude_deg % 360.0 - 180.0)
        told = told_of(replace(sweep, said_place=there), rng)
        if sky.sun_altitude_deg(there, sweep.exposures[0].when) > 1.0 and isinstance(told, Measurement):
            assert PolarFindingKind.SITE_OR_TIME in kinds(told, spoiling=True)
            seen += 1
        assert not told_of(sweep, rng).spoilt
    assert seen > 1


def test_the_suns_altitude_is_that_of_ephemerides():
    """Overhead at noon of an equinox on the equator; elsewhere as erfa.atco13 has it."""
    from datetime import UTC, datetime

    assert sun_altitude_deg(Site(0.0, 0.0), datetime(2026, 3, 20, 12, 7, tzinfo=UTC)) == pytest.approx(90.0, abs=0.3)
    when = datetime(2026, 6, 21, 3, 0, tzinfo=UTC)
    place = sky.Place(52.5, 13.4)
    assert sun_altitude_deg(Site(52.5, 13.4), when) == pytest.approx(sky.sun_altitude_deg(place, when), abs=0.05)


@pytest.mark.parametrize(("east_deg", "spoilt"), [(0.05, False), (2.0, True), (-10.0, True)])
def test_headers_that_say_another_site_spoil_what_it_would_move(east_deg, spoilt):
    sweep, rng = sweep_of(2)
    place = sweep.place
    theirs = Site(place.latitude_deg, (place.longitude_deg + east_deg + 180.0) % 360.0 - 180.0)
    told = told_of(sweep, rng, theirs=theirs)
    assert told.spoilt is spoilt
    assert (PolarFindingKind.SITE_OR_TIME in kinds(told)) is spoilt


def test_a_zone_from_the_other_side_of_greenwich_spoils():
    drawn = (sweep_of(seed) for seed in range(40))
    sweep, rng = next(each for each in drawn if 60.0 < abs(each[0].place.longitude_deg) < 120.0)
    zone = round(sweep.place.longitude_deg / 15.0)
    late = tuple(replace(s, said=s.said + sky.dt.timedelta(hours=zone)) for s in sweep.exposures)
    local = replace(sweep, exposures=late)
    assert not told_of(local, rng, utc_offset_h=float(zone)).spoilt
    files = solved_files(local, rng)
    given = Site(sweep.place.latitude_deg, -sweep.place.longitude_deg)
    found = given_doubts(files, told_of(local, rng, utc_offset_h=float(zone)).error, given, float(zone))
    assert PolarFindingKind.CLOCK in {finding.kind for finding in found if finding.spoils}
