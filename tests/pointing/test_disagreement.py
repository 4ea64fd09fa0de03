"""Each cause made from first principles with ERFA, and named; noise is not given a name."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import erfa
import numpy as np
import pytest

from kochab.core.attitude import radec_deg, unit_vectors
from kochab.core.frame import Site
from kochab.core.mount import Epoch, PierSide, Pointing, SiteReport
from kochab.pointing.disagreement import MountSighting, investigate
from tests.pointing.evidence import unexplained_arcsec

SITE = Site(47.0, 8.5)
SOUTH = Site(-33.9, 151.2)
TIME = datetime(2026, 7, 12, 22, 30, tzinfo=UTC)
JD = 2440587.5 + TIME.timestamp() / 86400.0


def of_date(sky):
    """Apparent place by ERFA's whole chain, equinox of date."""
    ra, dec, origins = erfa.atci13(*np.radians(sky), 0.0, 0.0, 0.0, 0.0, JD, 69.184 / 86400.0)
    return float(np.degrees(erfa.anp(ra - origins))), float(np.degrees(dec))


def sidereal(site, moment):
    day = 2440587.5 + moment.timestamp() / 86400.0
    return np.degrees(erfa.gst06a(day, 0.0, day, 69.184 / 86400.0)) + site.longitude_deg


def said_by(sky, *, clock_h=0.0, own=SITE, believes=SITE):
    """What a mount says that knows its hour angle and makes right ascension by its own clock."""
    ra, dec = of_date(sky)
    hour = sidereal(own, TIME) - ra
    mine = TIME + timedelta(hours=clock_h)
    return (sidereal(believes, mine) - hour) % 360.0, dec


def jitter(place, arcmin, seed=1):
    """The same place, as far off as a mount points that is set up by hand."""
    east, north = np.random.default_rng(seed).normal(0.0, arcmin / 60.0, 2)
    return (place[0] + east / np.cos(np.radians(place[1]))) % 360.0, place[1] + north


def sighting(sky, said, epoch=Epoch.DATE, site=SITE, **more):
    return MountSighting(sky, Pointing(*said, epoch), TIME, site, **more)


SKIES = [(10.0, 20.0), (200.0, 55.0), (300.0, -12.0)]


@pytest.mark.parametrize("sky", SKIES)
def test_a_mount_that_is_right_agrees(sky) -> None:
    found = investigate([sighting(sky, jitter(of_date(sky), 0.5))])
    assert found.agrees
    assert found.cause == ""
    assert "agree" in found.sentence


@pytest.mark.parametrize("hours", [1.0, -1.0])
@pytest.mark.parametrize("sky", SKIES)
def test_summer_time(hours, sky) -> None:
    found = investigate([sighting(sky, jitter(said_by(sky, clock_h=hours), 15.0))])
    assert found.cause == "summer time"
    assert f"1 h {'ahead' if hours > 0 else 'behind'}" in found.sentence
    assert unexplained_arcsec(found.suspects[0]) < 3600.0


@pytest.mark.parametrize("hours", [-8, 2, 9])
def test_time_zone(hours) -> None:
    found = investigate([sighting(SKIES[0], jitter(said_by(SKIES[0], clock_h=hours), 15.0))])
    assert found.cause == "time zone"
    assert f"{abs(hours)} h" in found.sentence


@pytest.mark.parametrize("sky", SKIES)
def test_epoch_both_ways(sky) -> None:
    wrong = investigate([sighting(sky, jitter(sky, 0.5))])
    assert wrong.cause == "epoch"
    assert "--epoch J2000" in wrong.sentence
    assert 700.0 < wrong.offset_arcsec < 1500.0  # 26 years of 50 arcsec, with aberration
    other = investigate([sighting(sky, jitter(of_date(sky), 0.5), Epoch.J2000)])
    assert other.cause == "epoch"
    assert "--epoch date" in other.sentence


@pytest.mark.parametrize("reversed_hour", [False, True])
def test_hemisphere(reversed_hour) -> None:
    sky = SKIES[1]
    ra, dec = of_date(sky)
    if reversed_hour:
        lst = sidereal(SITE, TIME)
        ra = lst + (lst - ra)
    found = investigate([sighting(sky, jitter((ra % 360.0, -dec), 10.0))])
    assert found.cause == "hemisphere"
    assert "mirrored" in found.sentence


@pytest.mark.parametrize(("own", "sky"), [(SITE, SKIES[0]), (SOUTH, SKIES[2])])
def test_longitude_sign(own, sky) -> None:
    west = replace(own, longitude_deg=-own.longitude_deg)
    said = said_by(sky, own=own, believes=west)
    told = SiteReport(site=west, time_utc=TIME)
    found = investigate([sighting(sky, jitter(said, 10.0), site=own, beliefs=told)])
    assert found.cause == "longitude sign"
    assert found.suspects[0].score > 0.9


def test_a_longitude_sign_that_looks_like_a_time_zone_is_told_by_the_mounts_own_site() -> None:
    own = Site(47.0, 15.0)  # twice 15 deg is 2 h
    west = replace(own, longitude_deg=-15.0)
    said = said_by(SKIES[0], own=own, believes=west)
    blind = investigate([sighting(SKIES[0], said, site=own)])
    assert {s.name for s in blind.suspects[:2]} == {"longitude sign", "time zone"}
    told = SiteReport(site=west, time_utc=TIME)
    assert investigate([sighting(SKIES[0], said, site=own, beliefs=told)]).cause == "longitude sign"
    zone = SiteReport(site=own, time_utc=TIME - timedelta(hours=2))
    assert investigate([sighting(SKIES[0], said, site=own, beliefs=zone)]).cause == "time zone"


def test_a_clock_that_is_some_minutes_off_is_named_when_the_mount_tells_it() -> None:
    said = said_by(SKIES[1], clock_h=0.3)
    told = SiteReport(site=SITE, time_utc=TIME + timedelta(hours=0.3))
    found = investigate([sighting(SKIES[1], said, beliefs=told)])
    assert found.cause == "clock"
    assert "18 min ahead" in found.sentence


def test_another_site_is_named_when_the_mount_tells_it() -> None:
    wrong = Site(47.0, 12.5)
    said = said_by(SKIES[1], believes=wrong)
    found = investigate([sighting(SKIES[1], said, beliefs=SiteReport(site=wrong, time_utc=TIME))])
    assert found.cause == "site longitude"


def test_latitude_of_a_mount_in_altitude_and_azimuth() -> None:
    """Altitude and azimuth are right; hour angle and declination are made with another latitude."""
    wrong = Site(42.0, 8.5)
    sky = SKIES[0]
    ra, dec = np.radians(of_date(sky))
    lst = np.radians(sidereal(SITE, TIME))
    azimuth, altitude = erfa.hd2ae(lst - ra, dec, np.radians(SITE.latitude_deg))
    hour, dec = erfa.ae2hd(azimuth, altitude, np.radians(wrong.latitude_deg))
    said = (float(np.degrees(lst - hour)) % 360.0, float(np.degrees(dec)))
    found = investigate([sighting(sky, said, beliefs=SiteReport(site=wrong, time_utc=TIME))])
    assert found.cause == "site latitude"
    assert unexplained_arcsec(found.suspects[0]) < 60.0


def test_pier_side() -> None:
    ra, dec = of_date(SKIES[1])
    found = investigate([sighting(SKIES[1], jitter(((ra + 180.0) % 360.0, dec), 10.0))])
    assert found.cause == "pier side"


def test_still_at_home() -> None:
    found = investigate([sighting(SKIES[0], (123.0, 90.0))])
    assert found.cause == "not aligned"
    assert "pole" in found.sentence
    found = investigate([sighting(SKIES[0], (40.0, 10.0), aligned=False)])
    assert found.cause == "not aligned"


def at_hours(*hours, dec=30.0):
    """Skies (ICRS, near enough) at these hour angles now."""
    return [((sidereal(SITE, TIME) - h) % 360.0, dec + 5.0 * i) for i, h in enumerate(hours)]


def test_one_offset_everywhere() -> None:
    seen = []
    for sky in at_hours(-50.0, -20.0, 35.0):
        ra, dec = of_date(sky)
        seen.append(sighting(sky, ((ra + 4.0) % 360.0, dec - 2.5)))
    found = investigate(seen)
    assert found.cause == "not aligned"
    assert "same angles everywhere" in found.sentence


@pytest.mark.parametrize("told", [False, True])
def test_cone_error_flips_across_the_meridian(told) -> None:
    """A tube 20 arcmin beside the square: made by rotations of the tube, not by a formula."""
    cone, seen = np.radians(20.0 / 60.0), []
    for hour, west in ((-40.0, True), (35.0, False)):
        h, d = np.radians(hour), np.radians(30.0)
        # On the west side of its pier the tube has gone through the pole: d becomes 180 - d.
        angle, turned = (np.pi - d, h + np.pi) if west else (d, h)
        tube = np.array([np.cos(cone), np.sin(cone), 0.0])
        x, y, z = tube
        x, z = x * np.cos(angle) - z * np.sin(angle), x * np.sin(angle) + z * np.cos(angle)
        v = np.array([x * np.cos(turned) + y * np.sin(turned), y * np.cos(turned) - x * np.sin(turned), z])
        true_hour, true_dec = -radec_deg(v)[0], radec_deg(v)[1]
        lst = sidereal(SITE, TIME)
        sky = back(((lst - true_hour) % 360.0, true_dec))
        side = {"pier_side": PierSide.WEST if west else PierSide.EAST} if told else {}
        seen.append(sighting(sky, ((lst - hour) % 360.0, 30.0), **side))
    found = investigate(seen)
    assert found.cause == "cone error"
    assert "20 arcmin" in found.sentence


def back(place):
    """ICRS of an apparent place, by ERFA."""
    origins = erfa.eo06a(JD, 69.184 / 86400.0)
    ra, dec, _ = erfa.atic13(np.radians(place[0]) + origins, np.radians(place[1]), JD, 69.184 / 86400.0)
    return float(np.degrees(ra)), float(np.degrees(dec))


def test_one_sighting_cannot_show_a_cone() -> None:
    found = investigate([sighting(SKIES[0], jitter(of_date(SKIES[0]), 20.0))])
    assert "cone error" not in {s.name for s in found.suspects}


def test_an_offset_that_is_noise_is_not_given_a_name() -> None:
    rng, named = np.random.default_rng(5), 0
    for _ in range(100):
        sky = radec_deg(_anywhere(rng))
        ra, dec = of_date(sky)
        away = rng.rayleigh(3.0)
        angle = rng.uniform(0.0, 2.0 * np.pi)
        north = dec + away * np.cos(angle)
        said = ((ra + away * np.sin(angle) / np.cos(np.radians(dec))) % 360.0, float(north))
        found = investigate([sighting(sky, said)])
        named += bool(found.cause)
        assert found.cause or found.agrees or "not told by one sighting" in found.sentence
    assert named <= 3


def test_three_offsets_without_a_rule_are_not_given_a_name() -> None:
    rng, named = np.random.default_rng(6), 0
    for _ in range(50):
        skies = at_hours(-50.0, -20.0, 35.0)
        seeds = rng.integers(1 << 30, size=3)
        seen = [sighting(sky, jitter(of_date(sky), 120.0, int(seed))) for sky, seed in zip(skies, seeds, strict=True)]
        named += bool(investigate(seen).cause)
    assert named <= 2


def test_suspects_are_sorted_and_share_one_probability() -> None:
    found = investigate([sighting(SKIES[0], said_by(SKIES[0], clock_h=1.0))])
    scores = [s.score for s in found.suspects]
    assert scores == sorted(scores, reverse=True)
    assert 0.0 < sum(scores) <= 1.0
    assert all(s.advice.endswith(".") and s.evidence.endswith(".") for s in found.suspects)


def test_the_offset_is_told_from_the_mount_to_the_sky() -> None:
    sky = SKIES[1]
    ra, dec = of_date(sky)
    found = investigate([sighting(sky, (ra - 1.0, dec - 0.5))])
    assert found.east_arcsec == pytest.approx(3600.0 * np.cos(np.radians(dec)), rel=1e-3)
    assert found.north_arcsec == pytest.approx(1800.0, rel=1e-3)


def _anywhere(rng):
    v = unit_vectors(rng.uniform(0.0, 360.0), np.degrees(np.arcsin(rng.uniform(-0.95, 0.95))))
    return np.asarray(v)


@pytest.mark.parametrize(("arcsec", "agrees"), [(115.0, True), (125.0, False)])
def test_two_arcminutes_are_agreement(arcsec, agrees) -> None:
    ra, dec = of_date(SKIES[0])
    found = investigate([sighting(SKIES[0], (ra, dec + arcsec / 3600.0))])
    assert found.agrees is agrees
    assert found.offset_arcsec == pytest.approx(arcsec, abs=0.5)
    assert (found.cause == "") or not agrees


@pytest.mark.parametrize(
    ("hours", "minutes"), [(0.3, "18 min ahead of"), (-0.5, "30 min behind"), (1.5, "90 min ahead of")]
)
def test_a_clock_off_by_no_whole_hour_is_told_in_minutes(hours, minutes) -> None:
    said = said_by(SKIES[1], clock_h=hours)
    told = SiteReport(site=SITE, time_utc=TIME + timedelta(hours=hours))
    found = investigate([sighting(SKIES[1], said, beliefs=told)])
    assert (found.cause, unexplained_arcsec(found.suspects[0]) < 60.0) == ("clock", True)
    assert minutes in found.sentence


@pytest.mark.parametrize("off_s", [50.0, 3600.0, -3595.0, 7230.0])
def test_whole_hours_and_less_than_a_minute_are_no_clock_that_runs_wrong(off_s) -> None:
    told = SiteReport(site=SITE, time_utc=TIME + timedelta(seconds=off_s))
    found = investigate([sighting(SKIES[1], said_by(SKIES[1], clock_h=off_s / 3600.0), beliefs=told)])
    assert "clock" not in {suspect.name for suspect in found.suspects}


def test_the_mounts_own_clock_confirms_or_denies_an_hour() -> None:
    """The same offset of one hour: likelier when the mount's clock shows it, unlikely when it is right."""
    said = jitter(said_by(SKIES[0], clock_h=1.0), 15.0)

    def score(**beliefs):
        found = investigate([sighting(SKIES[0], said, beliefs=SiteReport(**beliefs))])
        return next(s.score for s in found.suspects if s.name == "summer time")

    silent, shown, denied = score(), score(time_utc=TIME + timedelta(hours=1)), score(time_utc=TIME)
    odds = [x / (1.0 - x) for x in (denied, silent, shown)]
    assert denied < silent < shown
    assert odds[1] / odds[0] > 5.0


@pytest.mark.parametrize("own", [SITE, SOUTH])
def test_the_mounts_own_site_confirms_or_denies_the_hemisphere(own) -> None:
    sky = (200.0, 25.0)
    ra, dec = of_date(sky)
    other = replace(own, latitude_deg=-own.latitude_deg)
    scores = []
    for site in (own, None, other):
        found = investigate([sighting(sky, jitter((ra, -dec), 10.0), site=own, beliefs=SiteReport(site=site))])
        share = sum(s.score for s in found.suspects if s.name == "hemisphere")
        scores.append(share / (1.0 - share))
    denied, silent, confirmed = scores
    assert silent / denied == pytest.approx(50.0, rel=0.05)
    assert confirmed / silent == pytest.approx(20.0, rel=0.05)


@pytest.mark.parametrize(("away_deg", "named"), [(0.1, False), (0.3, True), (-0.3, True)])
def test_a_site_that_is_told_nearby_is_the_same(away_deg, named) -> None:
    for site, cause in (
        (replace(SITE, longitude_deg=SITE.longitude_deg + away_deg), "site longitude"),
        (replace(SITE, latitude_deg=SITE.latitude_deg + away_deg), "site latitude"),
    ):
        told = [sighting(SKIES[1], of_date(SKIES[1]), beliefs=SiteReport(site=site))]
        assert (cause in {s.name for s in investigate(told).suspects}) is named


def test_the_cone_is_told_in_arcminutes_on_either_side() -> None:
    """Half a degree of cone: at a declination of 60 the right ascension is off by a whole one."""
    seen = []
    for hour, sky_dec in ((2.0, 60.0), (-2.0, 60.0), (3.0, 5.0), (-3.0, 5.0)):
        sky = ((sidereal(SITE, TIME) - 15.0 * hour) % 360.0, sky_dec)
        ra, dec = of_date(sky)
        off = np.sign(hour) * 0.5 / np.cos(np.radians(dec))
        seen.append(sighting(sky, ((ra + off) % 360.0, dec)))
    found = investigate(seen)
    assert found.cause == "cone error"
    assert "30 arcmin on either side" in found.sentence
    assert unexplained_arcsec(found.suspects[0]) < 30.0


@pytest.mark.parametrize(
    ("arcsec", "words"), [(125.0, "2.1 arcmin"), (5900.0, "98.3 arcmin"), (6100.0, "1.7 deg"), (90.0, "90 arcsec")]
)
def test_an_offset_has_the_unit_that_suits_it(arcsec, words) -> None:
    ra, dec = of_date(SKIES[0])
    sentence = investigate([sighting(SKIES[0], (ra, dec + arcsec / 3600.0))]).sentence
    assert words in sentence


def test_every_hour_of_the_day_is_one_time_zone() -> None:
    """Half a day either way: thirteen hours ahead are eleven behind."""
    found = investigate([sighting(SKIES[0], said_by(SKIES[0], clock_h=5.0))])
    hours = sorted(
        float(s.evidence.split("clock is ")[1].split(" h")[0]) for s in found.suspects if "clock is" in s.evidence
    )
    assert hours == sorted([*range(1, 13), *range(1, 12)])


@pytest.mark.parametrize("aligned", [False, None])
def test_a_mount_that_says_it_is_not_aligned_is_believed_more_than_one_at_the_pole(aligned) -> None:
    said = (of_date(SKIES[0])[0], 89.9)
    found = investigate([sighting(SKIES[0], said, aligned=aligned)])
    suspect = next(s for s in found.suspects if s.name == "not aligned")
    odds = suspect.score / (1.0 - suspect.score)
    assert ("reports that it is not aligned" in suspect.evidence) is (aligned is False)
    other = investigate([sighting(SKIES[0], said, aligned=None if aligned is False else False)])
    score = next(s.score for s in other.suspects if s.name == "not aligned")
    assert (score / (1.0 - score)) / odds == pytest.approx(1 / 20.0 if aligned is False else 20.0, rel=0.01)


@pytest.mark.parametrize(("hours", "cone"), [((0.03, -0.03), True), ((0.03, 2.0), False), ((-0.03, -2.0), False)])
def test_the_meridian_parts_the_sides_where_the_mount_does_not_tell_its_pier_side(hours, cone) -> None:
    """Half a degree beside it is enough."""
    seen = []
    for hour in hours:
        sky = ((sidereal(SITE, TIME) - 15.0 * hour) % 360.0, 20.0)
        ra, dec = of_date(sky)
        assert ((sidereal(SITE, TIME) - ra + 180.0) % 360.0 - 180.0) * hour > 0.0
        seen.append(sighting(sky, (ra + 0.5 * np.sign(hour), dec)))
    assert ("cone error" in {s.name for s in investigate(seen).suspects}) is cone
