import csv
import json
from datetime import UTC, datetime
from pathlib import Path

import erfa
import numpy as np
import pytest

from catalogs.making.solar_system import write_small_bodies
from kochab.core.attitude import ARCSEC, unit, unit_vectors
from kochab.core.errors import CatalogueError
from kochab.core.frame import Site
from kochab.core.progress import run
from kochab.sky import elements
from kochab.sky.elements import bodies_of, julian_date, read_elements, short_name
from kochab.sky.ephemeris import GM, shipped_ephemeris
from kochab.sky.landmarks import constellation_at
from kochab.sky.orbits import carried, two_body
from kochab.sky.small_bodies import (
    FRAGMENT,
    KEPT_NIGHTS,
    LOST,
    SOLVED_JD,
    SmallBodies,
    bodies_near,
    body_called,
    magnitudes,
    read_small_bodies,
    shipped_small_bodies,
)
from kochab.sky.solar_system import BodyKind
from tests.sky.packages import CERES, COMET, FIELDS, ephemeris_file, small_body_file

OTHERS = json.loads(Path(__file__).with_name("asteroids.json").read_text(encoding="utf-8"))
TRUTH = OTHERS["rows"]
COMETS = json.loads(Path(__file__).with_name("comets.json").read_text(encoding="utf-8"))
TONIGHT = datetime(2026, 11, 23, 1, tzinfo=UTC)


def test_asteroids_carried_to_other_years_are_where_stellarium_had_them_then():
    """Stellarium's elements of 2014 to 2017, by others, against JPL's of 2022 carried to 2027 and back from there."""
    off = list(off_arcsec(TRUTH).values())
    assert len(off) == 21
    assert np.median(off) < 0.3
    assert max(off) < 5.0


def test_near_earth_asteroids_are_where_stellarium_had_them_years_before():
    """The Minor Planet Center's elements of 2024, shipped, against those that Stellarium 0.22.2 had for 2017 to 2020."""
    off = off_arcsec(OTHERS["near_earth"])
    assert off.keys() >= {"99942 Apophis", "3200 Phaethon", "101955 Bennu", "162173 Ryugu"}
    assert np.median(list(off.values())) < 0.6
    assert max(off.values()) < 2.0


def off_arcsec(rows):
    """How far each shipped asteroid is from other elements at their date, seen from the Earth.

    All of one date are carried together, which costs as much as one.
    """
    ephemeris, table, off = shipped_ephemeris(), shipped_small_bodies(), {}
    keys = ("q", "e", "i", "node", "peri", "tp")
    for epoch in {row[1] for row in rows}:
        mine = [row for row in rows if row[1] == epoch]
        more = {"epoch": epoch, "mag": 0.0, "slope": 0.15}
        there = bodies_of([{"name": name, **more, **dict(zip(keys, row, strict=True))} for name, _, *row in mine])
        at = [table.names.index(row[0]) for row in mine]
        ours = run(carried(table.state[at], table.epoch_jd[at], epoch, ephemeris))
        earth = (ephemeris("earth", there.epoch_jd) - ephemeris("sun", there.epoch_jd))[0]
        gap = unit(ours[:, :3] - earth) - unit(there.state[:, :3] - earth)
        arcsec = np.degrees(np.linalg.norm(gap, axis=1)) * 3600
        off |= dict(zip((row[0] for row in mine), arcsec.tolist(), strict=True))
    return off


def test_apophis_is_told_until_it_passes_the_earth_in_2029():
    everywhere = np.array([1.0, 0.0, 0.0])
    for when, told in ((datetime(2029, 4, 12, tzinfo=UTC), True), (datetime(2029, 4, 15, tzinfo=UTC), False)):
        names = [body.name for body in run(bodies_near(when, None, everywhere, np.pi, 14.0))]
        assert ("99942 Apophis" in names) == told
        assert (run(body_called("Apophis", when, None)) is not None) == told


@pytest.mark.parametrize(
    ("name", "when", "constellation", "v"),
    [  # where the papers of those weeks sent people
        ("12P", datetime(2024, 4, 10, tzinfo=UTC), "Aries", 4.5),
        ("13P", datetime(2024, 6, 30, tzinfo=UTC), "Lynx", 7.5),
        ("C/2023 A3", datetime(2024, 10, 15, 20, tzinfo=UTC), "Serpens", 1.0),
    ],
)
def test_comets_of_2024_are_told_where_people_saw_them(name, when, constellation, v):
    comet = run(body_called(name, when, None))
    assert constellation_at(comet.vector) == constellation
    assert comet.magnitude == pytest.approx(v, abs=1.5)
    assert comet.name in [body.name for body in run(bodies_near(when, None, comet.vector, 0.02, v + 2.0))]


@pytest.mark.parametrize("row", COMETS["great"], ids=lambda row: row[0])
def test_great_comets_of_the_past_are_where_stellarium_has_them_and_told(row):
    """Hale-Bopp stands at elements of 2008 and was seen ever since 1995: it is as well known then as later."""
    name, epoch, *elements = row
    ephemeris, table = shipped_ephemeris(), shipped_small_bodies()
    keys = ("q", "e", "i", "node", "peri", "tp")
    given = {"name": name, "epoch": epoch, "mag": 0.0, "slope": np.nan, **dict(zip(keys, elements, strict=True))}
    at, there = [table.names.index(name)], bodies_of([given])
    ours, since = table.state[at], table.epoch_jd[at]
    for days in (60.0, 20.0, -20.0, -60.0):
        jd = elements[-1] + days
        ours, since = run(carried(ours, since, jd, ephemeris)), np.array([jd])
        theirs = run(carried(there.state, there.epoch_jd, jd, ephemeris))
        earth = ephemeris("earth", since) - ephemeris("sun", since)
        gap = np.degrees(np.linalg.norm(unit(ours[:, :3] - earth) - unit(theirs[:, :3] - earth))) * 3600
        assert gap < table.sigma_arcsec(jd)[at[0]] < 110.0


def test_schwassmann_wachmann_is_as_bright_as_people_see_it():
    """About V 15 to 17 between its outbursts; JPL's M1 is of the nucleus, 20."""
    comet = run(body_called("29P", datetime(2024, 1, 1, tzinfo=UTC), None))
    assert 14.0 < comet.magnitude < 17.0


@pytest.mark.parametrize("speed", [0.7, 1.0, 1.3, 2**0.5, 1.9])
def test_two_bodies_agree_with_an_integration_without_planets(speed, monkeypatch):
    monkeypatch.setattr("kochab.sky.orbits.MASSES", np.zeros(8))
    state = np.array([[1.2, 0.3, -0.2, 0.0, 0.0, 0.0]])
    state[0, 3:] = np.array([-0.1, 0.9, 0.4]) * np.sqrt(GM["sun"] / 1.25) * speed
    from_jd = np.array([2455000.5])
    for days in (-700.0, 10.0, 2000.0):
        whole = run(carried(state, from_jd, from_jd[0] + days, shipped_ephemeris(), 1e-12))
        assert two_body(state, np.array([days])) == pytest.approx(whole, rel=1e-6, abs=1e-7)
        back = two_body(two_body(state, np.array([days])), np.array([-days]))
        assert back == pytest.approx(state, abs=1e-9)


def test_vesta_and_ceres_are_in_the_field_and_as_bright_as_told():
    """Vesta on 2026-11-23: V 7.1 (its opposition is on 13 October, at V 6.4)."""
    everywhere = run(bodies_near(TONIGHT, Site(48.0, 11.0), np.array([1.0, 0.0, 0.0]), np.pi, 9.5))
    found = {body.name: body for body in everywhere}
    assert found["4 Vesta"].magnitude == pytest.approx(7.1, abs=0.4)
    assert found["4 Vesta"].kind is BodyKind.ASTEROID
    assert [body.magnitude for body in everywhere] == sorted(body.magnitude for body in everywhere)
    assert all(body.magnitude <= 9.5 or body.kind not in (BodyKind.ASTEROID, BodyKind.COMET) for body in everywhere)
    near = run(bodies_near(TONIGHT, Site(48.0, 11.0), found["4 Vesta"].vector, 0.01, 9.5))
    assert "4 Vesta" in [body.name for body in near]
    assert len(near) < 4


@pytest.mark.parametrize(("epoch", "inside", "wide"), [("2459815.5", 0.8, 0.92), ("2461043.5", 0.8, 0.92)])
def test_the_sigma_of_comets_holds_beside_the_minor_planet_centers_elements(epoch, inside, wide):
    """Of 2022, when ours were fitted, and of January 2026 for comets that came back since."""
    keys, ephemeris, table = ("q", "e", "i", "node", "peri", "tp"), shipped_ephemeris(), shipped_small_bodies()
    rows = [row for row in COMETS["epochs"][epoch] if not FRAGMENT.search(row[0]) and row[0] not in LOST]
    more = {"epoch": float(epoch), "mag": 0.0, "slope": np.nan}
    there = bodies_of([{"name": name, **more, **dict(zip(keys, row, strict=True))} for name, *row in rows])
    where = np.array([table.names.index(row[0]) for row in rows])
    ours = run(carried(table.state[where], table.epoch_jd[where], float(epoch), ephemeris))
    earth = (ephemeris("earth", there.epoch_jd) - ephemeris("sun", there.epoch_jd))[0]
    gap = np.degrees(np.linalg.norm(unit(ours[:, :3] - earth) - unit(there.state[:, :3] - earth), axis=1)) * 3600.0
    share = gap / table.sigma_arcsec(float(epoch))[where]
    assert len(rows) >= 18
    assert inside <= np.mean(share < 1.0)
    assert wide <= np.mean(share < 3.0)
    assert np.median(share) > 0.03  # nor is it a cloak for everything


def test_the_lost_comets_are_those_of_the_table():
    assert set(shipped_small_bodies().names) >= LOST


def test_a_comets_sigma_grows_and_one_day_it_is_not_told():
    table = shipped_small_bodies()
    encke, new = table.names.index("2P/Encke"), table.names.index("C/2020 F3 (NEOWISE)")
    years = np.array(
        [table.sigma_arcsec(SOLVED_JD + 365.25 * year)[[encke, new]] for year in (-1.0, 0.0, 3.0, 6.0, 20.0)]
    )
    assert years[1].tolist() == [20.0, 100.0]
    assert years[0].tolist() == [20.0, 100.0]  # between their elements' date and the fit
    assert years[2] == pytest.approx([np.hypot(20.0, 30.0), np.hypot(100.0, 150.0)])
    assert years[3] == pytest.approx([np.hypot(20.0, 120.0), np.hypot(100.0, 600.0)])
    assert (years[4] > 600.0).all()
    own = bodies_of([{**dict.fromkeys(("i", "node", "peri"), 10.0), "q": 1.0, "e": 0.9, "tp": 2461000.5} | FRESH])
    assert own.sigma_arcsec(2461300.5).tolist() == [100.0]
    assert own.sigma_arcsec(2461300.5 + 730.5)[0] == pytest.approx(np.hypot(100.0, 100.0))


FRESH = {"name": "C/2026 A1 (Test)", "epoch": 2461300.5, "mag": 5.0, "slope": np.nan}


def test_comets_that_come_back_are_told_while_somebody_knows_where_and_fragments_are_not():
    """235P/LINEAR passed its perihelion on 2025-12-22; the Minor Planet Center's elements of that winter have it there."""
    date, sky = datetime(2026, 1, 3, tzinfo=UTC), np.array([1.0, 0.0, 0.0])
    found = {body.name: body for body in run(bodies_near(date, None, sky, np.pi, 14.0)) if body.kind is BodyKind.COMET}
    q, e, i, node, peri, tp = next(row[1:] for row in COMETS["epochs"]["2461043.5"] if row[0] == "235P/LINEAR")
    there = bodies_of([{"q": q, "e": e, "i": i, "node": node, "peri": peri, "tp": tp} | FRESH | {"epoch": 2461043.5}])
    ephemeris, day = shipped_ephemeris(), np.array([2461043.5])
    vector = unit(there.state[0, :3] + (ephemeris("sun", day) - ephemeris("earth", day))[0])
    linear = found["235P/LINEAR"]
    assert np.degrees(np.arccos(vector @ linear.vector)) * 3600.0 < 90.0  # with a quarter of an hour of light
    assert 30.0 < linear.sigma_arcsec < 60.0
    assert not [name for name in found if FRAGMENT.search(name) or name in LOST]
    late = run(bodies_near(date.replace(year=2045), None, sky, np.pi, 14.0))
    assert not [body.name for body in late if body.kind is BodyKind.COMET]


@pytest.mark.parametrize(
    ("name", "fragment"),
    [
        ("73P/Schwassmann-Wachmann 3-AK", True),
        ("C/2019 Y4-A (ATLAS)", True),
        ("C/2020 P4-C", True),
        ("141P/Machholz 2-A", False),
        ("141P/Machholz 2-D", True),
        ("114P/Wiseman-Skiff", False),
        ("C/2020 K8 (Catalina-ATLAS)", False),
        ("11P/Tempel-Swift-LINEAR", False),
    ],
)
def test_fragments_are_known_by_their_letter(name, fragment):
    assert bool(FRAGMENT.search(name)) == fragment


def test_neowise_was_a_bright_comet_below_the_bear_in_july_2020():
    found = run(bodies_near(datetime(2020, 7, 18, 22, tzinfo=UTC), None, unit_vectors(136.0, 47.0), 0.1, 10.0))
    comet = next(body for body in found if "NEOWISE" in body.name)
    assert comet.kind is BodyKind.COMET
    assert 60.0 <= comet.sigma_arcsec <= 250.0


def test_dates_beyond_the_ephemeris_have_no_bodies():
    assert run(bodies_near(datetime(1899, 1, 1, tzinfo=UTC), None, np.array([1.0, 0.0, 0.0]), np.pi, 9.0)) == []


def test_a_table_is_made_written_and_read(tmp_path, monkeypatch):
    more = tmp_path / "more.tsv"
    more.write_text(
        "name\tepoch\tq\te\ti\tnode\tperi\ttp\tmag\tslope\n12P/Test\t2460574.5\t0.78\t0.95\t74\t255\t198\t2460421.6\t5\t-15\n"
    )
    monkeypatch.setattr("catalogs.making.solar_system.MORE", more)
    ephemeris_file(tmp_path / "de421.bsp")
    small_body_file(tmp_path / "asteroids.dat", CERES, (None,) * len(FIELDS))
    small_body_file(tmp_path / "comets.dat", COMET, ("3D/Biela", *COMET[1:]), (*COMET[:-1], None))
    sources = (tmp_path / "asteroids.dat", tmp_path / "comets.dat", tmp_path / "de421.bsp")
    assert run(write_small_bodies(*sources, tmp_path / "table.kcat")) == {"asteroids": 1, "comets": 2}
    table = read_small_bodies(tmp_path / "table.kcat")
    assert table.names == ["1 Ceres", "67P/Churyumov-Gerasimenko", "12P/Test"]
    assert table.epoch_jd.tolist() == [2461406.5, 2459505.5, 2460574.5]
    assert table.comet.tolist() == [False, True, True]


# -- Elements that people bring ---------------------------------------------------------------

ORB = (
    "00001    3.33  0.15 K2555 188.70269   73.27343   80.25221   10.58780  0.0794013  0.21424651   2.7660512  0 E2024-V47"
    "  7330 125 1801-2024 0.80 M-v 30k MPCLINUX   4000      (1) Ceres              20241101"
)
COM = (
    "    CK20F030  2020 07  3.6789  0.294652  0.999178   37.2787   61.0104  128.9375  20200709 "
    " 12.1  4.0  C/2020 F3 (NEOWISE)                                      MPEC 2020-N18"
)


def test_the_minor_planet_centers_lines_are_read(tmp_path):
    (tmp_path / "MPCORB.DAT").write_text(f"MINOR PLANET CENTER ORBIT DATABASE\n{'-' * 90}\n{ORB}\n\n")
    ceres = read_elements(tmp_path / "MPCORB.DAT")
    assert list(ceres.names) == ["1 Ceres"]
    assert ceres.epoch_jd.tolist() == [2460800.5]  # K2555 is 2025-05-05
    assert ceres.magnitude.tolist() == [3.33]
    shipped = shipped_small_bodies()
    row = [shipped.names.index("1 Ceres")]
    ours = run(carried(shipped.state[row], shipped.epoch_jd[row], 2460800.5, shipped_ephemeris()))
    assert np.degrees(np.linalg.norm(unit(ours[0, :3]) - unit(ceres.state[0, :3]))) * 3600 < 5.0


@pytest.mark.parametrize("number", ["K07Tf8A", "~000a  ", "K14Un1N"])
def test_an_asteroid_with_a_letter_where_comets_have_theirs_is_an_asteroid(tmp_path, number):
    """2007 TA418 and 2014 UN271 as the Minor Planet Center packs them, and a number past 620,000."""
    (tmp_path / "MPCORB.DAT").write_text(number + ORB[7:] + "\n")
    table = read_elements(tmp_path / "MPCORB.DAT")
    assert table.epoch_jd.tolist() == [2460800.5]
    assert not table.comet.any()


def test_two_nights_at_once_keep_their_own_places():
    """Two threads look at two dates: the places of one passed for the other's."""
    dates, rows = (2461000.0, 2461030.0), np.array([0, 1])
    keys = ("name", "epoch", "q", "e", "i", "node", "peri", "tp")
    known = [{"mag": 0.0, "slope": 0.15, **dict(zip(keys, row, strict=True))} for row in TRUTH[:2]]
    table, alone = bodies_of(known), bodies_of(known)
    expected = [run(alone.on_night(rows, date))[0] for date in dates]
    first = table.on_night(rows, dates[0])
    next(first)  # under way
    second, _ = run(table.on_night(rows, dates[1]))
    np.testing.assert_allclose(run(first)[0], expected[0], rtol=1e-9)
    np.testing.assert_allclose(second, expected[1], rtol=1e-9)
    np.testing.assert_allclose(run(table.on_night(rows, dates[1]))[0], expected[1], rtol=1e-9)


def test_two_nights_by_turns_are_carried_once_each_and_a_long_row_of_nights_is_not_kept(monkeypatch):
    """The atlas shows tonight, the image the night of a frame: each threw the other's places away."""
    keys = ("name", "epoch", "q", "e", "i", "node", "peri", "tp")
    table = bodies_of([{"mag": 0.0, "slope": 0.15, **dict(zip(keys, TRUTH[0], strict=True))}])
    row, asked = np.array([0]), []

    def counted(states, since_jd, until_jd, *ephemeris):
        asked.extend([until_jd] * len(states))
        return carried(states, since_jd, until_jd, *ephemeris)

    monkeypatch.setattr("kochab.sky.small_bodies.carried", counted)
    places = [run(table.on_night(row, date))[0] for date in (2461000.0, 2461030.0) * 3]
    assert asked == [2461000.0, 2461030.0]
    np.testing.assert_array_equal(places[:2], places[4:])
    for date in 2461000.0 + np.arange(40.0):
        run(table.on_night(row, date))
    assert len(table._carried) == KEPT_NIGHTS


def test_the_minor_planet_centers_comets_are_read(tmp_path):
    (tmp_path / "comets.txt").write_text(COM + "\n")
    comet = read_elements(tmp_path / "comets.txt")
    assert list(comet.names) == ["C/2020 F3 (NEOWISE)"]
    assert comet.comet.tolist() == [True]
    assert comet.slope.tolist() == [-10.0]  # 2.5 times 4
    shipped = shipped_small_bodies()
    row = next(k for k, name in enumerate(shipped.names) if "2020 F3" in name)
    assert comet.epoch_jd[0] == 2459039.5
    ours = two_body(shipped.state[[row]], comet.epoch_jd - shipped.epoch_jd[row])
    assert ours[0, :3] == pytest.approx(comet.state[0, :3], abs=1e-4)


def test_the_small_body_databases_tables_are_read_as_json_and_csv(tmp_path):
    small_body_file(tmp_path / "a.json", CERES, COMET)
    with open(tmp_path / "a.csv", "w", newline="") as file:
        csv.writer(file).writerows([FIELDS, CERES, COMET])
    one, other = read_elements(tmp_path / "a.json"), read_elements(tmp_path / "a.csv")
    assert list(one.names) == list(other.names) == ["1 Ceres", "67P/Churyumov-Gerasimenko"]
    np.testing.assert_array_equal(one.state, other.state)
    assert one.slope.tolist() == other.slope.tolist() == [0.12, -11.9]


def test_bodies_of_no_magnitude_do_not_cost_the_file_and_are_never_seen(tmp_path):
    (tmp_path / "MPCORB.DAT").write_text(f"{ORB}\n{ORB[:8]}{' ' * 11}{ORB[19:]}\n")
    (tmp_path / "comets.txt").write_text(f"{COM}\n{COM.replace(' 12.1  4.0 ', ' ' * 11)}\n")
    small_body_file(tmp_path / "a.json", CERES, [None if cell == CERES[FIELDS.index("H")] else cell for cell in CERES])
    for name, first in (("MPCORB.DAT", 3.33), ("comets.txt", 12.1), ("a.json", float(CERES[FIELDS.index("H")]))):
        assert read_elements(tmp_path / name).magnitude.tolist() == [first, 99.0]


def test_a_comet_brightens_by_its_own_law_and_by_the_usual_one_where_none_is_known():
    slopes = np.array([-25.0, np.nan, 0.15])
    bodies = SmallBodies(["A", "B", "1 C"], np.zeros((3, 6)), np.zeros(3), np.full(3, 8.0), slopes)
    assert bodies.comet.tolist() == [True, True, False]
    far = np.array([[2.0, 0.0, 0.0]] * 3)
    near = magnitudes(bodies, far / 2.0, far)[0]
    assert near[:2] == pytest.approx(8.0 + np.array([25.0, 10.0]) * np.log10(2.0))
    assert near[2] == pytest.approx(8.0 + 5.0 * np.log10(2.0))


def test_a_weak_or_missing_slope_still_makes_a_comet(tmp_path):
    (tmp_path / "comets.txt").write_text(COM.replace(" 4.0 ", " 0.1 ") + "\n" + COM.replace(" 4.0 ", "     ") + "\n")
    assert read_elements(tmp_path / "comets.txt").slope.tolist() == [-2.0, -10.0]


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.dat", ORB + "\n" + ORB[:60] + "\n", "line 2"),
        ("a.dat", ORB.replace("0.0794013", "1.0794013"), "line 1"),
        ("a.txt", COM.replace("2020 07", "2020 17"), "line 1"),
        ("a.txt", "these are no elements\n", "line 1"),
        ("a.txt", "", "no orbital elements"),
        ("a.json", '{"fields": ["e"], "data": [[1, 2]]}', "no answer of JPL"),
        ("a.json", '{"fields": ["e"], "data": [["0.1"]]}', "entry 1"),
        ("a.csv", "name,e,i\nx,nan,3\n", "line 2"),
    ],
)
def test_a_bad_file_is_refused_in_one_sentence(tmp_path, name, text, said):
    (tmp_path / name).write_text(text)
    with pytest.raises(CatalogueError, match=said) as failure:
        read_elements(tmp_path / name)
    assert str(failure.value).startswith(f"Can't read {name}: ")
    assert str(failure.value).count("\n") == 0


@pytest.mark.parametrize(
    ("full", "short"),
    [
        ("     1 Ceres (A801 AA)", "1 Ceres"),
        ("308933 (2006 SQ372)", "308933 (2006 SQ372)"),
        ("       (2022 OH10)", "2022 OH10"),
        ("     C/1995 O1 (Hale-Bopp)", "C/1995 O1 (Hale-Bopp)"),
        ("    1P/Halley", "1P/Halley"),
    ],
)
def test_names_are_short(full, short):
    assert short_name(full) == short


@pytest.mark.parametrize("name", ["1P/Halley", "2P/Encke", "67P/Churyumov-Gerasimenko", "C/1995 O1 (Hale-Bopp)"])
def test_a_comet_is_where_its_own_elements_have_it_when_carried_from_a_nearer_date(name):
    table = shipped_small_bodies()
    row = np.array([table.names.index(name)])
    jd = 2461370.5  # 2026-11-26
    begun, since = table.nearest(jd)
    assert since[row[0]] == table.recent_jd
    assert table.nearest(float(table.epoch_jd[row[0]]))[1][row[0]] == table.epoch_jd[row[0]]
    near = run(carried(begun[row], since[row], jd, shipped_ephemeris()))
    far = run(carried(table.state[row], table.epoch_jd[row], jd, shipped_ephemeris()))
    arcsec = np.linalg.norm(near[0, :3] - far[0, :3]) / np.linalg.norm(far[0, :3]) / ARCSEC
    assert arcsec < 0.5


@pytest.mark.parametrize(
    ("year", "month", "day"),
    [(1600, 1, 1.0), (2200, 12, 31.9), (1858, 11, 17.0), (2024, 2, 29.75), (2000, 1, 1.5), (1900, 3, 1.0)],
)
def test_a_day_of_elements_is_the_julian_date_of_erfa(year, month, day):
    whole = int(day)
    assert julian_date(year, month, day) == pytest.approx(sum(erfa.cal2jd(year, month, whole)) + day - whole, abs=1e-9)


@pytest.mark.parametrize(
    ("year", "month", "day"),
    [(1599, 12, 31.0), (2201, 1, 1.0), (2024, 0, 1.0), (2024, 13, 1.0), (2024, 5, 0.99), (2024, 5, 32.0)],
)
def test_what_is_no_day_of_elements_is_refused(year, month, day):
    with pytest.raises(ValueError):  # noqa: PT011 - read_elements says which line it is
        julian_date(year, month, day)


@pytest.mark.parametrize(
    ("change", "orbit"),
    [
        ({}, True),
        ({"e": 0.0}, True),
        ({"e": 1.2}, True),
        ({"name": ""}, False),
        ({"q": 5e-5}, False),
        ({"q": 2001.0}, False),
        ({"e": -0.01}, False),
        ({"e": 10.0}, False),
        *[({key: float("nan")}, False) for key in ("epoch", "q", "e", "i", "node", "peri", "tp", "mag")],
    ],
)
def test_a_row_is_an_orbit_or_refused(change, orbit):
    angles = {"i": 10.6, "node": 80.3, "peri": 73.6}
    row = {"name": "Ceres", "epoch": 2460600.5, "q": 2.55, "e": 0.08, **angles, "tp": 2459920.0, "mag": 3.3} | change
    if orbit:
        assert elements._row(**row) == row
    else:
        with pytest.raises(ValueError, match=r"^$"):
            elements._row(**row)
