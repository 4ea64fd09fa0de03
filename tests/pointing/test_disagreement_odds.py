"""The odds of the causes: their weights, and their probabilities, made from exact turns by another formula."""

from datetime import timedelta
from itertools import product

import numpy as np
import pytest
import scipy
from scipy.integrate import trapezoid
from scipy.spatial.transform import Rotation
from scipy.special import logsumexp

from kochab.core.attitude import unit_vectors
from kochab.core.frame import Site
from kochab.core.mount import PierSide, SiteReport
from kochab.pointing.disagreement import Cause, Seen, causes, fit, investigate, weigh
from tests.pointing.evidence import unexplained_arcsec

from .test_disagreement import SITE, SKIES, TIME, at_hours, of_date, sidereal, sighting

# -- What is likely before anything is seen --------------------------------------------------------------

HALF, FLAT = (0.5,), (3600.0,)  # standard deviations, arcmin
SET_UP, BUILT, NOISES = (0.5, 12.0, 30.0), (0.5, 6.0), (0.4, 1.0, 2.0, 4.0, 10.0)
OFFSETS, AXES, CONES = (18.0, 120.0, 600.0, 3600.0), (18.0, 60.0, 240.0), (12.0, 36.0)
PLAIN = (SET_UP, SET_UP, BUILT, NOISES)
FREE = {
    "": (HALF, HALF, HALF, NOISES[:-1]),
    "epoch": (HALF, HALF, HALF, NOISES),
    "base tilt": ((*HALF, *OFFSETS), AXES, HALF, NOISES),
    "polar axis": ((*HALF, *OFFSETS), AXES, HALF, NOISES),
    "cone error": ((*HALF, *OFFSETS), HALF, CONES, NOISES),
    "not aligned": (OFFSETS, HALF, HALF, NOISES),
    "wrong day": (HALF, HALF, HALF, NOISES),
    "compass azimuth": (tuple(product((120.0, 600.0), BUILT)), BUILT, BUILT, NOISES),
}
"""Cause -> the sizes of both axes' offsets, or one a pair, of the tilt, of the cone and of the noise, each as likely."""


def sizes_of(offset, axis, cone):
    """Every combination (5,), arcmin."""
    return [(*(o if isinstance(o, tuple) else (o, o)), a, a, c) for o, a, c in product(offset, axis, cone)]


def weights(seen):
    """Name -> the summed weight of its causes."""
    found = {}
    for cause in causes(seen):
        found[cause.name] = found.get(cause.name, 0.0) + cause.weight
    return found


def seen_of(skies=SKIES[:1], offsets=((0.0, 0.0),), **more):
    """Sightings of a mount that is off by so many degrees of right ascension and declination."""
    pairs = zip(skies, offsets if len(offsets) > 1 else offsets * len(skies), strict=True)
    said = [(sky, np.add(of_date(sky), off)) for sky, off in pairs]
    return [sighting(sky, (ra % 360.0, dec), **more) for sky, (ra, dec) in said]


BLIND = {"summer time": 0.30, "time zone": 0.10, "epoch": 0.15, "hemisphere": 0.08, "longitude sign": 0.08}
BLIND |= {"pier side": 0.05, "": 0.5, "compass azimuth": 0.2}
# a twentieth for all days of a month before and after, each in inverse proportion; of the nearest, two on either side
BLIND["wrong day"] = 0.05 / sum(1.0 / days for days in range(1, 32)) * (1.0 + 1.0 / 2.0)
NO_DAY = {"wrong day": 0.02 * BLIND["wrong day"]}


@pytest.mark.parametrize(
    ("beliefs", "change"),
    [
        (SiteReport(), {}),
        (SiteReport(time_utc=TIME), {"summer time": 0.006, "time zone": 0.002, **NO_DAY}),
        (
            SiteReport(time_utc=TIME + timedelta(seconds=3650)),
            {"summer time": 3.0 + 0.003, "time zone": 0.002, **NO_DAY},
        ),
        (
            SiteReport(time_utc=TIME + timedelta(seconds=90)),
            {"summer time": 0.006, "time zone": 0.002, **NO_DAY, "clock": 2.0},
        ),
        (
            SiteReport(time_utc=TIME - timedelta(seconds=3510)),
            {"summer time": 0.006, "time zone": 0.002, **NO_DAY, "clock": 2.0},
        ),
        (SiteReport(site=SITE), {"hemisphere": 0.0016, "longitude sign": 0.0016}),
        (SiteReport(site=Site(47.0, -8.6)), {"hemisphere": 0.0016, "longitude sign": 1.6}),
        (SiteReport(site=Site(-47.0, 8.8)), {"hemisphere": 1.6, "longitude sign": 0.0016, "site longitude": 2.0}),
        (SiteReport(site=Site(46.7, 8.5)), {"hemisphere": 0.0016, "longitude sign": 0.0016, "site latitude": 2.0}),
    ],
)
def test_a_mounts_own_clock_and_site_count_twentyfold_or_a_fiftieth(beliefs, change) -> None:
    """Within a minute and a fifth of a degree they are right."""
    assert weights(Seen(seen_of(beliefs=beliefs))) == pytest.approx(BLIND | change)


def test_without_a_site_neither_its_longitude_nor_reversed_hour_angles_are_asked_for() -> None:
    expected = BLIND | {"hemisphere": 0.05}
    del expected["longitude sign"], expected["compass azimuth"]
    assert weights(Seen(seen_of(site=None))) == pytest.approx(expected)


SIDES = at_hours(-40.0, 35.0)


@pytest.mark.parametrize(
    ("more", "polar", "base"),
    [
        ({}, 0.8, 0.2),
        ({"alt_azimuth": True}, 0.0, 1.0),
        ({"alt_azimuth": False}, 1.0, 0.0),
        ({"pier_side": PierSide.WEST, "alt_azimuth": True}, 1.0, 0.0),  # no fork has a side
        ({"site": None, "alt_azimuth": True}, 1.0, 0.0),  # without a site its altitude is unknown
    ],
)
def test_a_mount_in_altitude_and_azimuth_tilts_with_its_base(more, polar, base) -> None:
    """When the mount does not say, one in five is taken to be alt-azimuth."""
    seen = Seen(seen_of(SIDES, **more))
    found = weights(seen)
    both = "site" not in more and "pier_side" not in more  # sides of the meridian
    expected = {
        "not aligned": 0.3,
        "polar axis": 0.2 * polar,
        "base tilt": 0.2 * base,
        "cone error": 0.1 * polar * both,
    }
    assert {name: found.get(name, 0.0) for name in expected} == pytest.approx(expected)
    assert found[""] == pytest.approx(0.5 + 0.02 * polar * both)
    by_base = sum(cause.weight for cause in causes(seen) if cause.alt_azimuth and cause.name != "compass azimuth")
    assert by_base == pytest.approx(0.5 * base)


# -- What is likely after it: normal data, by their covariance ------------------------------------------


def model(terms, there, side, reverses):
    """Longitudes and latitudes (N,), degrees, that a mount with these terms reports: exact turns."""
    seen = Rotation.from_rotvec(-np.radians([*terms[2:4], 0.0])).apply(there)
    lat = np.degrees(np.arcsin(seen[:, 2]))
    cone = terms[4] * side / np.maximum(np.cos(np.radians(lat)), 0.05)
    return np.degrees(np.arctan2(seen[:, 1], seen[:, 0])) + terms[0] + cone, lat + terms[1] * (
        side if reverses else 1.0
    )


def log_probability(seen, cause, free, terms):
    """Of the sightings: the mean over all sizes, of large noise a little, of the density whose covariance all terms and the noise make.

    Nearly linear in the terms (5,), about those given.
    """
    there, said = (seen.in_axes(p, cause.alt_azimuth) for p in (cause.would_say(seen), seen.reported))
    side = np.ones(len(said)) if cause.alt_azimuth else seen.side
    lon, lat = (np.degrees(f) for f in (np.arctan2(said[:, 1], said[:, 0]), np.arcsin(said[:, 2])))

    def off(terms):
        at, high = model(terms, there, side, cause.reverses)
        return np.stack([((lon - at + 180.0) % 360.0 - 180.0) * np.cos(np.radians(lat)), lat - high], axis=1).ravel()

    step = 1e-4
    slopes = np.stack([(off(terms - step * e) - off(terms + step * e)) / (2.0 * step) for e in np.eye(5)], axis=1)
    found = off(terms) + slopes @ terms
    logs, odds = [], []
    for sizes, n in product(np.divide(sizes_of(*free[:3]), 60.0), np.divide(free[3], 60.0)):
        covariance = slopes @ np.diag(np.square(sizes)) @ slopes.T + n**2 * np.eye(len(slopes))
        logs.append(scipy.stats.multivariate_normal(None, covariance).logpdf(found))
        odds.append(16.0 / (16.0 + (60.0 * n) ** 2))  # half at four arcminutes
    return logsumexp(logs, b=odds) - np.log(sum(odds))


def freedom(cause):
    """Its row of :data:`FREE`; a mount that is not aligned, but as it was switched on, may point anywhere."""
    if cause.name == "not aligned" and not cause.fitted:
        return (SET_UP, SET_UP, BUILT, FLAT)
    if cause.name == "" and cause.fitted:
        return (*FREE["polar axis"][:2], CONES, NOISES)
    return FREE.get(cause.name, PLAIN)


@pytest.mark.parametrize("alt_azimuth", [False, True])
@pytest.mark.parametrize("arcmin", [0.5, 3.0, 10.0])
def test_every_cause_has_the_probability_of_normal_data(arcmin, alt_azimuth) -> None:
    """Of two places on both sides of the meridian, one of them near the pole."""
    skies = [*at_hours(-40.0), *at_hours(35.0, dec=84.0)]
    off = arcmin / 60.0 * np.array([[1.0, -0.4], [-2.0, 0.7]])
    told = SiteReport(site=Site(46.7, 8.8), time_utc=TIME + timedelta(seconds=90))
    seen = Seen(seen_of(skies, off, alt_azimuth=alt_azimuth, aligned=False, beliefs=told))
    for cause in causes(seen):
        offset, axis, cone, noise = free = freedom(cause)
        by_ground = cause.name in ("site latitude", "compass azimuth")
        assert cause.alt_azimuth is (by_ground or (alt_azimuth and cause.fitted))
        assert sorted(cause.noise) == pytest.approx(np.divide(noise, 60.0))
        np.testing.assert_allclose(cause.scales(), np.divide(sizes_of(offset, axis, cone), 60.0))
        found, terms, _ = fit(seen, cause)
        if found > -200.0:
            assert found == pytest.approx(log_probability(seen, cause, free, terms), abs=5e-3), (
                cause
            )  # its last step is a linear one


def test_what_fits_no_cause_is_five_degrees_off_on_average_or_anywhere() -> None:
    """The density of such an offset, nine tenths of it near and a tenth all over the sky; within 2 arcmin it is flat."""
    cause = Cause("it", "", lambda seen: seen.reported, 1.0)

    def density(off_deg):
        seen = Seen([sighting((10.0, 0.0), np.add(of_date((10.0, 0.0)), (0.0, off_deg)))])
        ((score,), (found, _, _)) = [suspect.score for suspect in weigh(seen, [cause])], fit(seen, cause)
        return np.exp(found) * (1.0 / score - 1.0) / 0.3

    log_r = np.linspace(np.log(0.04), np.log(60.0), 40)
    r = np.exp(log_r)
    ring = 2.0 * np.pi * r**2 * (np.array([density(x) for x in r]) - 0.1 / 41253.0)  # in equal steps of log r
    assert trapezoid(ring, log_r) == pytest.approx(0.9, rel=0.01)
    assert trapezoid(ring * r, log_r) / trapezoid(ring, log_r) == pytest.approx(5.0, rel=0.01)
    flat = [density(x / 60.0) for x in (0.0, 1.0, 1.99, 2.02, 4.0)]
    assert flat[:3] == pytest.approx([flat[0]] * 3, rel=1e-6)
    assert flat[0] > 1.005 * flat[3] > 1.9 * flat[4]


# -- What the terms are ----------------------------------------------------------------------------------


def turned(skies, about_deg, alt_azimuth=False):
    """Sightings by a mount whose first axis, to the pole or to the zenith, is turned by a vector across itself."""
    upright = Rotation.from_euler("y", SITE.latitude_deg - 90.0 if alt_azimuth else 0.0, degrees=True)
    turn = upright.inv() * Rotation.from_rotvec(np.radians([*about_deg, 0.0])) * upright
    lst, (ra, dec) = sidereal(SITE, TIME), np.transpose([of_date(sky) for sky in skies])
    x, y, z = turn.apply(unit_vectors(ra - lst, dec)).T
    said = np.stack([np.degrees(np.arctan2(y, x)) + lst, np.degrees(np.arcsin(z))], axis=1)
    return [sighting(sky, place, alt_azimuth=alt_azimuth) for sky, place in zip(skies, said, strict=True)]


WIDE = at_hours(-60.0, -15.0, 20.0, 50.0, dec=10.0)


@pytest.mark.parametrize(
    ("about_deg", "tilt"), [((1.5, 2.0), "2.5 deg"), ((-0.3, 0.4), "30.0 arcmin"), ((0.0, 6.0), "6.0 deg")]
)
@pytest.mark.parametrize("alt_azimuth", [False, True])
def test_the_tilt_of_an_axis_is_told_as_it_is(about_deg, tilt, alt_azimuth) -> None:
    """By whatever turn: it is fitted in three steps, to some arcseconds."""
    found = investigate(turned(WIDE, about_deg, alt_azimuth))
    assert found.cause == ("base tilt" if alt_azimuth else "polar axis")
    assert tilt in found.sentence
    assert unexplained_arcsec(found.suspects[0]) < 3.0


def test_no_axis_is_fitted_twenty_degrees_from_its_place() -> None:
    """Beyond fifteen the slopes hold no longer, and no mount stands so: what is left speaks against it."""
    for about_deg, likely in ((12.0, True), (20.0, False)):
        suspects = investigate(turned(WIDE, (0.0, about_deg))).suspects
        score = sum(one.score for one in suspects if one.name == "polar axis")
        assert (score > 0.9) if likely else (score < 0.01)


def test_offsets_are_told_with_their_signs() -> None:
    found = investigate(seen_of(WIDE, ((4.0, -2.5),)))
    assert "everywhere, +4.00 and -2.50 deg" in found.sentence
    assert found.offset_arcsec > 3600.0 * 4.0


def test_the_worst_sighting_is_told_and_the_last_one_s_direction() -> None:
    skies = [(10.0, 0.0), (200.0, 60.0)]
    found = investigate(seen_of(skies, ((0.0, 2.0), (-1.0, -0.5))))
    assert found.offset_arcsec == pytest.approx(7200.0, rel=1e-3)
    assert found.north_arcsec == pytest.approx(1800.0, rel=1e-3)
    assert found.east_arcsec == pytest.approx(3600.0 * np.cos(np.radians(of_date(skies[1])[1])), rel=1e-3)


def test_what_a_cause_shows_is_told_in_numbers() -> None:
    told = SiteReport(site=Site(42.0, 12.5), time_utc=TIME - timedelta(minutes=18))
    words = "\n".join(cause.evidence for cause in causes(Seen(seen_of(beliefs=told))))
    for expected in (
        "The mount's clock is 1 h ahead, which is 15.0 deg",
        "The mount's clock is 11 h behind, which is 165.5 deg",
        "18 min behind the computer's",
        "twice the longitude, -17.0 deg",
        "The mount's longitude is +4.0 deg too far east",
        "The mount's latitude is 42.0 deg instead of 47.0 deg",
        "The mount reports J2000 but Kochab takes its coordinates as the equator of date",
    ):
        assert expected in words
