"""Sites and clocks that somebody gave wrong, and two frames that nothing checks: mounts under erfa's sky."""

import re
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest

from kochab.core.attitude import radec_deg
from kochab.core.frame import Site
from kochab.frames.hints import Aim, aim_from_keywords, zone_from_keywords
from kochab.lab.bench import polar_sweeps as sky
from kochab.lab.bench.polar_faults import reported_axis, solved_files, true_axis
from kochab.polar.error import CHI2_95
from kochab.polar.measure import Measurement, NoAxis, PolarFindingKind
from kochab.sky.horizon import Horizon, sun_altitude_deg
from kochab.workflows.polar.site_and_clock import given_doubts, horizon_agrees
from kochab.workflows.polar.solutions import FilesRequest, axis_of


def sweep_of(seed, frames=5):
    rng = np.random.default_rng([41, seed])
    while True:
        sweep = sky.random_sweep(rng, frames, 60.0)
        if np.degrees(np.arccos(sweep.axis @ sky.refracted_pole(sweep.place))) > 0.5:
            return sweep, rng


def told_of(sweep, rng, **said):
    files = [replace(f, site=said.get("theirs")) for f in solved_files(sweep, rng)]
    place = sweep.stated_place
    given = Site(place.latitude_deg, place.longitude_deg, place.height_m)
    return axis_of(files, [0] * len(files), [], FilesRequest(given, utc_offset_h=said.get("utc_offset_h", 0.0))).result


def kinds(told, spoiling=False):
    return {finding.kind for finding in told.findings if finding.spoils or not spoiling}


@pytest.mark.parametrize("change", [sky.with_dec_moved, sky.with_kick, sky.with_one_time_wrong])
def test_two_frames_give_no_bolt_advice(change):
    for seed in range(3):
        sweep, rng = sweep_of(seed, 2)
        told = reported_axis(change(sweep, rng), rng).result
        assert not told.checked
        assert "Take a third before you turn a bolt" in " ".join(finding.text for finding in told.findings)


def test_three_frames_are_checked():
    sweep, rng = sweep_of(1, 3)
    assert reported_axis(sweep, rng).result.checked


@pytest.mark.parametrize("change", [sky.with_clock_wrong, sky.with_site_wrong])
def test_a_sure_clock_or_site_is_told_to_be_on_trust_with_what_it_would_cost(change):
    """The sky an hour later is the sky of another longitude: nothing in the frames shows it."""
    for seed in range(3):
        sweep, rng = sweep_of(seed)
        told = reported_axis(change(sweep, rng), rng).result
        text = next(finding.text for finding in told.findings if finding.kind is PolarFindingKind.ON_TRUST)
        assert re.search("one hour by .*: check both|A one-hour clock error would shift the axis by ", text)
        assert told.unsettled


@pytest.mark.parametrize("which", ["latitude", "longitude"])
def test_a_wrong_sign_of_the_site_is_never_silent(which):
    """Wherever it moves the axis past its ellipse: told as below the horizon or by day, or as what nothing bears out."""
    outside = 0
    for seed in range(12):
        sweep, rng = sweep_of(seed)
        wrong = sky.with_sign_wrong(sweep, which)
        told = reported_axis(wrong, rng).result
        if isinstance(told, NoAxis):
            continue
        true = true_axis(wrong, told.error.pole)
        if told.error.with_systematics.distance2(true) > CHI2_95:
            outside += 1
            assert told.spoilt or told.unsettled, seed
    assert outside > 3


def test_a_sign_that_frames_tell_is_not_doubted():
    """Where they would look at the ground, or at the Sun by day, a site of the other sign is out of the question."""
    sweep, rng = sweep_of(4)
    files = solved_files(sweep, rng)
    place, told = sweep.stated_place, reported_axis(sweep, rng).result
    site = Site(place.latitude_deg, place.longitude_deg)
    for name, sign in (("north from south", "latitude_deg"), ("east from west", "longitude_deg")):
        there = replace(site, **{sign: -getattr(site, sign)})
        ground = any(Horizon(there, f.time_utc).altaz_deg(f.result.centre_vector)[0] < 0.0 for f in files)
        day = any(sun_altitude_deg(there, f.time_utc) > -1.0 for f in files)
        text = " ".join(finding.text for finding in given_doubts(files, told.error, site, 0.0))
        assert (name in text) is not (ground or day)


RW_AUR = {
    "DATE-OBS": "2017-12-27T00:58:34",
    "OBJCTRA": "05 07 28.00",
    "OBJCTDEC": "+30 25 03.0",
    "OBJCTALT": " 58.3241",
    "OBJCTAZ": " 98.7579",
}
"""Of MaxIm DL, with SITELAT 41 43 00 and SITELONG -70 38 00 (shared/frames/geo__RW_Aur-0004V.fit)."""


@pytest.mark.parametrize(
    ("site", "hours", "agrees", "tells"),
    [
        (Site(41.717, -70.633), 0.0, True, False),
        (Site(41.717, 70.633), 0.0, False, True),
        (Site(-41.717, -70.633), 0.0, False, True),
        (Site(41.717, -70.633), 1.0, False, True),
        (Site(41.717, -69.633), 0.0, True, False),  # a degree is within what headers can mean, and stays on trust
    ],
)
def test_the_altitude_of_a_real_header_bears_out_site_and_clock_or_contradicts_them(site, hours, agrees, tells):
    sweep, rng = sweep_of(2)
    aim = aim_from_keywords(RW_AUR)
    begun = datetime.fromisoformat(RW_AUR["DATE-OBS"] + "+00:00") + timedelta(hours=hours)
    files = [replace(f, aim=aim, time_utc=begun) for f in solved_files(sweep, rng)]
    error = reported_axis(sweep, rng).result.error
    assert horizon_agrees(files, site) is agrees
    text = " ".join(finding.text for finding in given_doubts(files, error, site, 0.0) if finding.spoils)
    assert ("The header of" in text) is tells


def test_headers_that_bear_out_the_clock_leave_no_doubt_of_it():
    sweep, rng = sweep_of(2)
    place = sweep.place
    site = Site(place.latitude_deg, place.longitude_deg, place.height_m)
    plain = solved_files(sweep, rng)
    aimed = []
    for shot, file in zip(sweep.exposures, plain, strict=True):
        enu = shot.attitude[:, 2]
        altaz = float(np.degrees(np.arcsin(enu[2]))), float(np.degrees(np.arctan2(enu[0], enu[1]))) % 360.0
        ra_dec = radec_deg(sky.catalogue_places(enu[None], shot.when, place)[0])
        aimed.append(replace(file, site=site, aim=Aim(ra_dec, altaz)))
    doubted, borne_out = (
        axis_of(files, [0] * len(files), [], FilesRequest(site, utc_offset_h=0.0)).result for files in (plain, aimed)
    )
    assert doubted.unsettled
    assert not borne_out.unsettled


@pytest.mark.parametrize(
    ("header", "zone"),
    [
        ({"DATE-OBS": "2026-03-14T20:00:00.5", "DATE-LOC": "2026-03-14T22:00:00.5"}, 2.0),
        ({"DATE-OBS": "2026-03-14T02:00:00", "DATE-LOC": "2026-03-13T20:30:00"}, -5.5),
        ({"DATE-OBS": "2017-12-19T18:33:43.317-0700"}, -7.0),
        ({"DATE-OBS": "2026-03-14T20:00:00", "DATE-LOC": "2026-03-14T20:00:00"}, None),
        ({"DATE-OBS": "2026-03-14T20:00:00Z"}, None),
        ({"DATE-LOC": "2026-03-14T22:00:00"}, None),
        ({"DATE-OBS": "yesterday", "DATE-LOC": "nonsense"}, None),
        ({"DATE-OBS": "2026-03-14T20:00:00", "DATE-LOC": "2027-03-14T20:00:00"}, None),
    ],
)
def test_the_zone_that_a_header_says(header, zone):
    assert zone_from_keywords(header) == zone


def test_the_local_time_of_a_header_contradicts_a_longitude_from_the_other_side():
    drawn = (sweep_of(seed) for seed in range(40))
    sweep, rng = next(each for each in drawn if 60.0 < abs(each[0].place.longitude_deg) < 120.0)
    zone = float(round(sweep.place.longitude_deg / 15.0))
    files = [replace(f, zone_h=zone) for f in solved_files(sweep, rng)]
    error = reported_axis(sweep, rng).result.error
    for sign, spoils in ((1.0, False), (-1.0, True)):
        site = Site(sweep.place.latitude_deg, sign * sweep.place.longitude_deg)
        found = given_doubts(files, error, site, None)
        assert any(one.kind is PolarFindingKind.CLOCK and one.spoils for one in found) is spoils


def test_frames_by_day_are_a_wrong_site_or_time():
    """A longitude from the other side of the world puts the Sun up."""
    seen = 0
    for seed in range(6):
        sweep, rng = sweep_of(seed)
        there = replace(sweep.place, longitude_deg=sweep.place.longitude_deg % 360.0 - 180.0)
        told = told_of(replace(sweep, stated_place=there), rng)
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
    late = tuple(replace(s, stated=s.stated + sky.dt.timedelta(hours=zone)) for s in sweep.exposures)
    local = replace(sweep, exposures=late)
    assert not told_of(local, rng, utc_offset_h=float(zone)).spoilt
    files = solved_files(local, rng)
    given = Site(sweep.place.latitude_deg, -sweep.place.longitude_deg)
    found = given_doubts(files, told_of(local, rng, utc_offset_h=float(zone)).error, given, float(zone))
    assert PolarFindingKind.CLOCK in {finding.kind for finding in found if finding.spoils}
