import json
import struct
from datetime import UTC, datetime, timedelta
from pathlib import Path

import erfa
import numpy as np
import pytest

from catalogs.making.solar_system import read_spk, write_ephemeris
from kochab.core.attitude import apart_deg, east_north, unit, unit_vectors
from kochab.core.errors import CatalogueError
from kochab.core.frame import Site
from kochab.sky import solar_system
from kochab.sky.apparent import julian_date_tt
from kochab.sky.ephemeris import read_ephemeris, shipped_ephemeris
from kochab.sky.solar_system import BodyKind, covers, major_bodies, observer_at, phase_angle_deg
from tests.sky.packages import ephemeris_file

TRUTH = json.loads(Path(__file__).with_name("solar_system.json").read_text(encoding="utf-8"))["rows"]


def seen(utc, site):
    place = None if site is None else Site(*site)
    return {body.name: body for body in major_bodies(observer_at(datetime.fromisoformat(utc), place))}


@pytest.mark.parametrize("row", TRUTH, ids=lambda row: row["utc"][:10])
def test_bodies_stand_where_skyfield_has_them(row):
    """Half an arcsecond of the Moon is UT1, which skyfield takes from its own table."""
    found = seen(row["utc"], row["site"])
    assert list(found) == list(row["places"])
    for name, (ra, dec, distance, magnitude) in row["places"].items():
        body = found[name]
        assert apart_deg((ra, dec), (body.ra_deg, body.dec_deg)) * 3600 < (0.6 if name == "Moon" else 0.05), name
        assert body.distance_au == pytest.approx(distance, rel=3e-6 if name == "Moon" else 1e-8)
        if magnitude is not None:
            assert body.magnitude == pytest.approx(magnitude, abs=0.2), name


@pytest.mark.parametrize("year", [1992, 2003, 2017, 2026, 2040, 2050])
def test_directions_are_those_of_erfas_own_theories(year):
    """Simon's mean-element planets and Meeus' Moon: other theories, to their accuracies."""
    jd = np.array([julian_date_tt(datetime(year, 5, 7, 3, tzinfo=UTC))])
    ephemeris = shipped_ephemeris()
    for number, name in enumerate(("mercury", "venus", "earth", "mars", "jupiter", "saturn", "uranus", "neptune"), 1):
        ours = (ephemeris(name, jd) - ephemeris("sun", jd))[0]
        theirs = erfa.plan94(jd[0], 0.0, number)["p"]
        worst = 150.0 if name in ("jupiter", "saturn", "uranus") else 40.0
        assert np.degrees(np.linalg.norm(unit(ours) - unit(theirs))) * 3600 < worst, name
    moon = (ephemeris("moon", jd) - ephemeris("earth", jd))[0]
    assert np.degrees(np.linalg.norm(unit(moon) - unit(erfa.moon98(jd[0], 0.0)["p"]))) * 3600 < 20.0


def test_leap_seconds_are_those_of_iers():
    for days in range(0, 19_000, 53):
        moment = datetime(1972, 1, 2, tzinfo=UTC) + timedelta(days=days)
        if moment.year > 2022:
            break
        tt = (
            2440587.5
            + moment.timestamp() / 86400.0
            + (erfa.dat(moment.year, moment.month, moment.day, 0) + 32.184) / 86400.0
        )
        assert julian_date_tt(moment) == pytest.approx(tt, abs=1e-9), moment


def test_a_site_that_is_not_known_counts_in_the_moons_sigma():
    moment = datetime(2026, 11, 23, 1, tzinfo=UTC)
    centre = {body.name: body for body in major_bodies(observer_at(moment, None))}
    for place in (Site(48.0, 11.0), Site(-60.0, -120.0)):
        for body in major_bodies(observer_at(moment, place)):
            off = apart_deg((body.ra_deg, body.dec_deg), (centre[body.name].ra_deg, centre[body.name].dec_deg)) * 3600
            assert off < 1.05 * centre[body.name].sigma_arcsec
            assert body.sigma_arcsec < 1.0
    assert 3000 < centre["Moon"].sigma_arcsec < 3800


def test_moon_and_sun_look_as_they_did_at_the_eclipse_of_2017():
    """Carbondale, 21 August 2017, 18:21 UTC: totality, and the Moon's disc 2.4 % wider than the Sun's (NASA)."""
    moment = datetime(2017, 8, 21, 18, 21, 30, tzinfo=UTC)
    found = {b.kind: b for b in major_bodies(observer_at(moment, Site(37.7, -89.2, 120.0)))}
    sun, moon = found[BodyKind.SUN], found[BodyKind.MOON]
    assert apart_deg((sun.ra_deg, sun.dec_deg), (moon.ra_deg, moon.dec_deg)) * 3600 < 60
    assert 1.02 < moon.diameter_arcsec / sun.diameter_arcsec < 1.04
    assert moon.phase < 0.001
    assert sun.magnitude == pytest.approx(-26.73, abs=0.03)


def test_the_full_moon_is_full():
    """2023-08-31 01:36 UTC was full (USNO), near perigee."""
    moon = next(
        b for b in major_bodies(observer_at(datetime(2023, 8, 31, 1, 36, tzinfo=UTC), None)) if b.name == "Moon"
    )
    assert moon.phase > 0.998
    assert -13.1 < moon.magnitude < -12.5


@pytest.mark.parametrize(
    ("name", "from_sun_au", "from_earth_au", "phase_deg", "v"),
    [
        ("mercury", 0.310295423552, 1.32182643625754, 1.1677, -2.477),
        ("mercury", 0.413629222334, 0.92644808718613, 90.1662, 0.181),
        ("mercury", 0.448947624811, 0.56004973217883, 178.7284, 7.167),
        ("venus", 0.722722540169, 1.71607489554051, 1.3232, -3.917),
        ("venus", 0.721480714554, 0.37762511206278, 124.1348, -4.916),
        ("venus", 0.726166592736, 0.28889582420642, 179.1845, -3.090),
        ("jupiter", 5.446231815414, 6.44985867459088, 0.2446, -1.667),
        ("jupiter", 4.957681473205, 3.95393078136013, 0.3431, -2.934),
    ],
)
def test_planets_are_as_bright_as_in_the_examples_of_mallama_and_hilton(name, from_sun_au, from_earth_au, phase_deg, v):
    """The examples of the Ap_Mag program that was published with their paper."""
    found = solar_system.magnitude(
        name, np.array([from_earth_au, 0.0, 0.0]), np.array([from_sun_au, 0.0, 0.0]), phase_deg
    )
    assert found == pytest.approx(v, abs=6e-4)


def test_saturn_with_its_ring_edge_on_fades_by_0_026_mag_a_degree_of_phase_angle():
    """Mallama and Hilton 2018, equation 10, whose other terms are those of the ring."""
    edge_on = 10.0 * east_north(solar_system.SATURN_POLE)[0]
    full, partly = (solar_system.magnitude("saturn", edge_on, edge_on, phase_deg) for phase_deg in (0.0, 6.0))
    assert partly - full == pytest.approx(0.156, abs=1e-6)


def test_dates_that_the_ephemeris_does_not_reach_are_known():
    assert covers(datetime(1900, 1, 1, tzinfo=UTC))
    assert covers(datetime(2052, 1, 1, tzinfo=UTC))
    assert not covers(datetime(1899, 9, 1, tzinfo=UTC))
    assert not covers(datetime(2052, 7, 10, tzinfo=UTC))


def test_phase_angle_is_at_the_body():
    to_body, from_sun = unit_vectors(0.0, 0.0), unit_vectors(90.0, 0.0)
    assert phase_angle_deg(to_body, from_sun) == pytest.approx(90.0)
    assert phase_angle_deg(to_body, to_body) == pytest.approx(0.0)


@pytest.fixture
def resting(tmp_path):
    """An ephemeris file in which nothing moves."""
    ephemeris_file(tmp_path / "de421.bsp")
    return tmp_path / "de421.bsp"


def test_an_excerpt_has_the_places_of_its_source(resting, tmp_path):
    write_ephemeris(resting, tmp_path / "ephemeris.kcat")
    excerpt, jd = read_ephemeris(tmp_path / "ephemeris.kcat"), np.array([2448000.5, 2460000.5, 2470000.5])
    np.testing.assert_allclose(excerpt("venus", jd), [[0.02, 0.0, 0.0]] * 3, atol=1e-9)
    np.testing.assert_allclose(excerpt("sun", jd), [[0.1, 0.0, 0.0]] * 3, atol=1e-9)
    np.testing.assert_allclose(excerpt("moon", jd) - excerpt("earth", jd), [[0.0, 0.0026, 0.0]] * 3, atol=1e-9)
    np.testing.assert_allclose(excerpt("earth", jd)[:, 1], -0.0026 / (1 + 81.3005690699153), atol=1e-9)


def test_the_shipped_excerpt_is_the_whole_de421_to_a_milliarcsecond():
    """Against jplephem, which reads DE421 by itself."""
    kernel = pytest.importorskip("jplephem.spk")
    data = pytest.importorskip("skyfield_data")
    with kernel.SPK.open(str(Path(data.__file__).with_name("data") / "de421.bsp")) as spk:
        jd = np.sort(np.random.default_rng(5).uniform(2414913.0, 2470720.0, 2000))
        ours, au = shipped_ephemeris(), 149597870.7
        for name, number in (("sun", 10), ("mercury", 1), ("venus", 2), ("mars", 4), ("jupiter", 5), ("saturn", 6)):
            gap = ours(name, jd) - spk[0, number].compute(jd).T / au
            assert np.abs(gap).max() < (4e-9 if name not in ("jupiter", "saturn") else 2e-8), name
        earth = (spk[0, 3].compute(jd) + spk[3, 399].compute(jd)).T / au
        assert np.abs(ours("earth", jd) - earth).max() < 2e-9
        moon = (spk[3, 301].compute(jd) - spk[3, 399].compute(jd)).T / au
        assert np.abs(ours("moon", jd) - ours("earth", jd) - moon).max() < 3e-11


def test_what_is_no_ephemeris_is_refused_in_a_sentence(resting, tmp_path):
    (tmp_path / "text").write_text("no ephemeris")
    with pytest.raises(CatalogueError, match="no ephemeris in SPK form"):
        read_spk(tmp_path / "text")
    raw = bytearray(resting.read_bytes())
    raw[1024 + 16 : 1024 + 24] = struct.pack("<d", 5)  # summaries of five bodies
    resting.write_bytes(raw)
    with pytest.raises(CatalogueError, match="lacks the Sun, the Moon or a planet"):
        read_spk(resting)
