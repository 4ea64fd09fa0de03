import csv
import json
import os
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from sgp4.io import fix_checksum

from kochab.core.attitude import apart_deg, attitude_from, unit, unit_vectors
from kochab.core.camera import Camera
from kochab.core.errors import CatalogueError
from kochab.core.frame import Detections, Frame, Hint, Site
from kochab.core.progress import run
from kochab.core.solution import NamedStar, Solution
from kochab.sky.apparent import JD_UNIX, with_aberration
from kochab.sky.elements import keep_elements, kept_elements, read_elements
from kochab.sky.frame_bodies import bodies_in_frame, body_marks
from kochab.sky.satellites import _sunlit, topocentric_km
from kochab.sky.small_bodies import body_called
from kochab.sky.solar_system import AU_KM, BodyKind, observer_at

HERE = Path(__file__).parent
TRUTH = json.loads((HERE / "satellites.json").read_text("utf-8"))
EARLY, LATE = HERE / "iridium-2025-01-05.tle", HERE / "iridium-2025-01-23.tle"
DUSK, SITE = datetime(2025, 1, 6, 16, 12, 0, 250000, tzinfo=UTC), Site(64.0, 20.0, 100.0)


@pytest.fixture(scope="module")
def iridium():
    return read_elements(EARLY)


def table_of(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    return read_elements(tmp_path / name)


# -- Places ------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", ["06251", "14128", "28350", "08195"])
def test_orbits_are_those_of_the_verification_of_sgp4(tmp_path, number):
    """Vallado's table of 2006, which comes with the package: TEME, km, minutes after the elements."""
    sgp4 = pytest.importorskip("sgp4")
    folder = Path(sgp4.__file__).parent
    lines = (folder / "SGP4-VER.TLE").read_text().splitlines()
    pair = [line[:69] for line in lines if line[2:7] == number]
    table = table_of(tmp_path, "one.tle", "\n".join(pair))
    assert list(table.names) == [f"NORAD {int(number)}"]
    rows = (folder / "tcppver.out").read_text().split(f"{int(number)} xx\n")[1].splitlines()
    told = [
        [float(cell) for cell in row.split()[:4]] for row in rows[: next(k for k, r in enumerate(rows) if "xx" in r)]
    ]
    assert len(told) > 5
    (orbit,) = table.orbits
    for minutes, *place in told:
        failed, ours, _ = orbit.sgp4(orbit.jdsatepoch, orbit.jdsatepochF + minutes / 1440.0)
        assert not failed
        np.testing.assert_allclose(ours, place, atol=2e-4)


@pytest.mark.parametrize("row", TRUTH["rows"], ids=lambda row: f"{row[0]} {row[1][:13]}")
def test_places_above_a_site_are_skyfields_to_a_metre(tmp_path, iridium, row):
    name, utc, site, vector, lit = row
    table = iridium if name in iridium.names else table_of(tmp_path, "a.tle", "\n".join([name, *TRUTH["insat"]]))
    observer = observer_at(datetime.fromisoformat(utc), Site(*site))
    places, _ = topocentric_km([table.orbits[list(table.names).index(name)]], observer, np.zeros(1))
    assert np.linalg.norm(places[0, 0] - vector) < 1e-3
    above = np.dot(places[0, 0], observer.place[0] - observer_at(observer.time_utc, None).place[0]) > 0.0
    assert bool(_sunlit(places[0], observer)[0]) == (lit and above)


def test_the_earths_shadow_begins_and_ends_when_skyfields_does(iridium):
    told, begin = TRUTH["shadow"], datetime.fromisoformat(TRUTH["shadow"]["from"])
    orbit = [iridium.orbits[list(iridium.names).index(told["name"])]]
    lit, changes = told["begins_lit"], []
    for at in range(0, 12_000, told["step_s"]):
        when = begin + timedelta(seconds=at)
        observer = observer_at(when, SITE)
        earth = observer_at(when, None)
        place = topocentric_km(orbit, observer, np.zeros(1))[0][0]
        site = (observer.place - earth.place) * AU_KM
        # Seen from right below it, so that only the shadow counts.
        below = replace(observer, place=earth.place + unit(place + site) * 6378.0 / AU_KM)
        now = bool(_sunlit(place + site - (below.place - earth.place) * AU_KM, below)[0])
        if now != lit:
            changes.append(at)
            lit = now
    assert len(changes) == len(told["changes_s"]) > 2
    assert (
        np.abs(np.array(changes) - told["changes_s"]).max() <= 40
    )  # skyfield's shadow is the Earth's, not a cylinder's


def test_the_sigma_holds_over_eighteen_days_of_real_elements(iridium):
    """30 derelict Iridium satellites, elements of 2025-01-05 against those of 2025-01-23 at their own dates."""
    later, shares = read_elements(LATE), []
    assert list(later.names) == list(iridium.names)
    for k, (before, after) in enumerate(zip(iridium.orbits, later.orbits, strict=True)):
        date = after.jdsatepoch, after.jdsatepochF
        when = datetime.fromtimestamp((sum(date) - JD_UNIX) * 86400.0, UTC)
        gap = np.subtract(before.sgp4(*date)[1], after.sgp4(*date)[1])
        shares.append(np.linalg.norm(gap) / iridium.sigma_km(when)[k])
    assert 15 <= np.count_nonzero(np.array(shares) < 1.0) <= 27
    assert max(shares) < 2.0
    assert np.median(shares) > 0.4  # nor is it too wide


# -- In a frame --------------------------------------------------------------------------------


def passing(iridium, seconds=0.0):
    """A satellite in sunlight that is up over the site, its index and its direction some seconds after dusk."""
    observer = observer_at(DUSK, SITE)
    places, _ = topocentric_km(iridium.orbits, observer, np.array([seconds]))
    k = int(np.flatnonzero(_sunlit(places[:, 0], observer))[0])
    return k, unit(places[k, 0])


@pytest.mark.parametrize("seconds", [0.0, 19.3, -29.0])
def test_a_satellite_is_found_when_it_crosses_the_field_and_not_at_another_time(iridium, seconds):
    k, way = passing(iridium, seconds)
    radius = np.radians(0.2)
    (body,) = run(iridium.near(observer_at(DUSK, SITE, 60.0), way, radius, 5.0))
    assert body.name == iridium.names[k]
    assert body.kind is BodyKind.SPACECRAFT
    trail = with_aberration(unit_vectors(*np.array(body.trail).T), DUSK)
    assert np.linalg.norm(trail - way, axis=1).min() < np.radians(0.01)
    assert np.linalg.norm(trail - way, axis=1).max() < 2.0 * radius
    assert abs(np.arcsin(way @ unit(np.cross(trail[0], trail[-1])))) < np.radians(0.01)
    here = np.linalg.norm(topocentric_km([iridium.orbits[k]], observer_at(DUSK, SITE), np.array([seconds]))[0])
    assert body.distance_au * AU_KM == pytest.approx(here, rel=0.01)
    blur_km = np.hypot(iridium.sigma_km(DUSK)[k], 0.5 * 7.5)
    assert body.sigma_arcsec == pytest.approx(np.degrees(blur_km / here) * 3600.0, rel=0.03)
    for other in (observer_at(DUSK + timedelta(minutes=3), SITE, 60.0), observer_at(DUSK, None, 60.0)):
        assert run(iridium.near(other, way, radius, 5.0)) == []


def test_an_instant_has_a_place_and_no_trail(iridium):
    k, way = passing(iridium)
    (body,) = run(iridium.near(observer_at(DUSK, SITE), way, 0.002, 5.0))
    assert body.trail == ()
    seen = with_aberration(body.vector[None], DUSK)[0]
    assert np.linalg.norm(seen - way) < 1e-8, iridium.names[k]
    assert (
        1e-5 < np.linalg.norm(body.vector - way) < 1.1e-4
    )  # aberration shifts the stars, not what goes with the Earth


def test_old_elements_are_told_and_too_old_ones_leave_no_place(iridium):
    assert iridium.warning(DUSK, SITE) == ""
    later = DUSK + timedelta(days=20)
    assert "20 days from the frame's date" in iridium.warning(later, SITE) or "21 days" in iridium.warning(later, SITE)
    assert "need your site" in iridium.warning(DUSK, None)
    north = np.array([0.0, 0.0, 1.0])
    assert len(run(iridium.near(observer_at(DUSK, SITE, 60.0), north, 3.0, 5.0))) >= 3
    late = observer_at(DUSK + timedelta(days=400), SITE, 60.0)
    up = topocentric_km(iridium.orbits, late, np.zeros(1))[0][:, 0]
    assert np.count_nonzero(_sunlit(up, late)) > 0  # they are somewhere, but nobody knows where
    assert run(iridium.near(late, north, 3.0, 5.0)) == []


def test_the_trail_through_a_frame_is_in_the_sky_layer(iridium, catalogue):
    _, way = passing(iridium)
    camera = Camera.centred(1200, 800, 1200 / np.radians(3.0))
    ra, dec = np.degrees(np.arctan2(way[1], way[0])), np.degrees(np.arcsin(way[2]))
    solution = Solution(camera, attitude_from(ra, dec, 15.0), (NamedStar(1, 1, "", "", 9.0, 0, 0, 0),), 0.1, -50.0, "")
    grid = np.stack(np.meshgrid(np.arange(0, 1200, 10), np.arange(0, 800, 10)), axis=-1).reshape(-1, 2)
    hot = Detections.from_list(grid, 1200, 800)  # something everywhere
    told = run(bodies_in_frame(solution, hot, DUSK, SITE, catalogue, [iridium], 60.0))
    (one,) = (body for body in told.bodies if body.body.kind is BodyKind.SPACECRAFT)
    assert -0.5 <= one.x <= 1199.5
    assert -0.5 <= one.y <= 799.5
    assert not one.seen  # an uncertain place takes no detection
    assert len(one.body.trail) > 5
    assert apart_deg((one.body.ra_deg, one.body.dec_deg), (ra, dec)) < 1.0
    ends = solution.pixels_of(unit_vectors(*np.array(one.body.trail).T))[[0, -1]]
    edge = np.minimum(np.minimum(ends[:, 0], 1199 - ends[:, 0]), np.minimum(ends[:, 1], 799 - ends[:, 1]))
    assert np.abs(edge).max() < 25.0  # from one edge of the frame to another
    frame = Frame(np.zeros((800, 1200), np.uint8), hint=Hint(time_utc=DUSK, exposure_s=60.0, site=SITE))
    mark = next(mark for mark in run(body_marks(frame, solution, more=[iridium])) if mark.kind == "satellite")
    assert np.abs(mark.shapes[0][[0, -1]] - ends).max() < 0.1
    assert mark.radius > 200.0


def test_a_satellite_is_found_by_its_name_wherever_it_is(iridium):
    """At dusk, against the vector from the site; the one in the Earth's shadow and one of no file are not."""
    observer = observer_at(DUSK, SITE)
    found = [run(body_called(name.lower(), DUSK, SITE, [iridium])) for name in iridium.names]
    lit = [k for k, body in enumerate(found) if body is not None]
    assert 0 < len(lit) < len(found)
    places = topocentric_km(iridium.orbits, observer, np.zeros(1))[0][:, 0]
    for k, body in enumerate(found):
        assert (body is not None) == bool(_sunlit(places[k][None], observer)[0])
    for k in lit:
        assert np.degrees(np.linalg.norm(with_aberration(found[k].vector[None], DUSK)[0] - unit(places[k]))) < 1e-3
    assert run(body_called(iridium.names[lit[0]], DUSK, None, [iridium])) is None  # its place needs a site
    assert run(body_called(iridium.names[lit[0]], DUSK, SITE)) is None


# -- Files -------------------------------------------------------------------------------------

ISS = (
    "0 ISS (ZARYA)",
    "1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9991",
    "2 25544  51.6439 211.2001 0007417  17.6667  85.6398 15.50103472202482",
)
OMM = {  # the same as CelesTrak writes it
    "OBJECT_NAME": "ISS (ZARYA)",
    "OBJECT_ID": "1998-067A",
    "EPOCH": "2019-12-09T16:38:29.363423",
    "MEAN_MOTION": 15.50103472,
    "ECCENTRICITY": 0.0007417,
    "INCLINATION": 51.6439,
    "RA_OF_ASC_NODE": 211.2001,
    "ARG_OF_PERICENTER": 17.6667,
    "MEAN_ANOMALY": 85.6398,
    "EPHEMERIS_TYPE": 0,
    "CLASSIFICATION_TYPE": "U",
    "NORAD_CAT_ID": 25544,
    "ELEMENT_SET_NO": 999,
    "REV_AT_EPOCH": 20248,
    "BSTAR": 3.8792e-05,
    "MEAN_MOTION_DOT": 1.764e-05,
    "MEAN_MOTION_DDOT": 0,
}


def test_the_same_elements_are_read_in_each_form(tmp_path):
    with open(tmp_path / "a.csv", "w", newline="") as file:
        csv.writer(file).writerows([OMM.keys(), OMM.values()])
    tables = [
        table_of(tmp_path, "a.tle", "\r\n".join(ISS) + "\r\n"),
        table_of(tmp_path, "a.json", json.dumps([OMM])),
        table_of(tmp_path, "b.json", json.dumps(OMM)),
        read_elements(tmp_path / "a.csv"),
    ]
    places = []
    for table in tables:
        assert list(table.names) == ["ISS (ZARYA)"]
        places.append(table.orbits[0].sgp4(2458827.5, 0.3)[1])
    np.testing.assert_allclose(places, [places[0]] * 4, atol=0.01)
    assert np.linalg.norm(places[0]) == pytest.approx(6790.0, abs=20.0)
    rates = [table.sigma_km(datetime(2019, 12, 20, tzinfo=UTC))[0] for table in tables]
    np.testing.assert_allclose(rates, rates[0], rtol=1e-6)


def test_satellites_of_one_name_are_all_read(tmp_path):
    """Rocket bodies share theirs."""
    first, second = EARLY.read_text().splitlines()[:6][1:3], EARLY.read_text().splitlines()[:6][4:6]
    table = table_of(tmp_path, "a.tle", "\n".join(["SL-16 R/B", *first, "SL-16 R/B", *second]))
    assert list(table.names) == 2 * ["SL-16 R/B"]
    assert len({orbit.satnum for orbit in table.orbits}) == 2


def test_kept_files_are_read_the_newest_first_and_again_when_they_change(tmp_path, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "config"))
    assert kept_elements() == []
    for at, (name, text) in enumerate((("old.TLE", EARLY.read_text()), ("iss.tle", "\n".join(ISS)))):
        (tmp_path / name).write_text(text)
        keep_elements(tmp_path / name)
        os.utime(tmp_path / "config" / "elements" / name, (at, at))
    (tmp_path / "config" / "elements" / "notes.txt").write_text("nothing")
    assert [len(table.names) for table in kept_elements()] == [1, 30]
    assert kept_elements()[0] is kept_elements()[0]
    (tmp_path / "iss.tle").write_text("\n".join([*ISS, "TWIN", *ISS[1:]]))
    keep_elements(tmp_path / "iss.tle")
    assert list(kept_elements()[0].names) == ["ISS (ZARYA)", "TWIN"]


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.tle", "\n".join([ISS[0], ISS[1][:-1] + "2", ISS[2]]), "line 2"),
        ("a.tle", "\n".join([*ISS, ISS[1]]), "line 4"),
        ("a.tle", "\n".join([ISS[1], ISS[1], ISS[2]]), "line 1"),
        ("a.tle", "\n".join([ISS[1], ISS[2][:30]]), "line 1"),
        ("a.tle", "\n".join(fix_checksum(line) for line in (ISS[1].replace("19343.69", "19343.E9"), ISS[2])), "line 1"),
        ("a.json", json.dumps([OMM, {**OMM, "ECCENTRICITY": "wide"}]), "entry 2"),
        ("a.json", json.dumps([OMM])[:-1], "line 1"),
        ("a.csv", "OBJECT_NAME,MEAN_MOTION\nISS,15.5\n", "line 2"),
    ],
)
def test_a_bad_file_is_refused_in_one_sentence(tmp_path, name, text, said):
    with pytest.raises(CatalogueError, match=f"Can't read {name}: {said} has no usable elements of a satellite."):
        table_of(tmp_path, name, text)
