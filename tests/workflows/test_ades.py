"""The Minor Planet Center's file, read and validated by the IAU's own ADES tools against their schema."""

import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from importlib.resources import files

import pytest

from kochab.core.errors import UsageError
from kochab.workflows.night.ades import Observatory, ades_psv
from kochab.workflows.night.frame import NightFrame
from kochab.workflows.night.measure import Measure
from kochab.workflows.night.strangers import Sight, Stranger, StrangerKind
from kochab.workflows.night.summary import night_of

START = datetime(2026, 3, 1, 22, 0, 15, 300000, tzinfo=UTC)
SITE = Observatory.parse("703", "Ä. Beob|achter", "0.2,reflector,CMOS")


def body(name, kind=StrangerKind.BODY, ra_deg=359.999):
    """A body in three frames."""
    sights = tuple(Sight(10.0, 20.0, ra_deg + 0.001 * k, -0.002 * k, 0.4, 12.31, 0.07, name) for k in range(3))
    rate = Measure(30.0, 1.0), Measure(1.0, 1.0)
    return Stranger(kind, name, (0, 1, 2), sights, 0.4, rate, Measure(12.31, 0.05), None, -9.0)


def night(*bodies):
    """A night of three frames with these."""
    frames = [NightFrame(f"{k}.fits", START + timedelta(minutes=9 * k), 30.0, (900, 600), True) for k in range(3)]
    return replace(night_of(frames), strangers=bodies)


def read_by_the_iau(text, folder):
    """Its observations as dicts; an error of the schema's fails."""
    etree = pytest.importorskip("lxml.etree")
    psv, xml = folder / "night.psv", folder / "night.xml"
    psv.write_text(text, encoding="utf-8")
    done = subprocess.run([sys.executable, "-m", "ades.psvtoxml", psv, xml], capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    schema = etree.XMLSchema(etree.parse(str(files("ades") / "data" / "xsd" / "submit.xsd")))
    tree = etree.parse(str(xml))
    schema.assertValid(tree)
    return [{part.tag: part.text for part in one} for one in tree.iter("optical")]


@pytest.mark.parametrize(
    ("name", "identity"),
    [
        ("4 Vesta", {"permID": "4"}),
        ("134340 Pluto", {"permID": "134340"}),
        ("2014 ST349", {"provID": "2014 ST349"}),
        ("C/1900 O1 (Borrelly-Brooks)", {"provID": "C/1900 O1"}),
        ("1P/Halley", {"permID": "1P"}),
        ("A/2018 W3", {"provID": "A/2018 W3"}),
    ],
)
def test_a_body_is_named_as_the_center_names_it(name, identity, tmp_path):
    rows = read_by_the_iau(ades_psv(night(body(name)), SITE), tmp_path)
    assert len(rows) == 3
    for row in rows:
        assert {key: row[key] for key in ("permID", "provID", "trkSub") if row.get(key)} == identity


def test_the_rows_hold_place_time_and_their_sigmas(tmp_path):
    unknown = body("", StrangerKind.UNKNOWN_BODY, ra_deg=20.5)
    rows = read_by_the_iau(ades_psv(night(body("4 Vesta"), unknown, body("x", StrangerKind.NEW_STAR)), SITE), tmp_path)
    assert len(rows) == 6, "a new star is no body"
    first, over = rows[0], rows[1]
    assert first["obsTime"] == "2026-03-01T22:00:15.30Z"
    assert (first["stn"], first["mode"], first["band"], first["exp"]) == ("703", "CMO", "V", "30")
    assert float(first["ra"]) == pytest.approx(359.999, abs=1e-6)
    assert float(over["ra"]) == pytest.approx(0.0, abs=1e-6), "it is below 360"
    assert float(over["dec"]) == pytest.approx(-0.002, abs=1e-6)
    assert (first["rmsRA"], first["rmsDec"], first["mag"], first["rmsMag"]) == ("0.400", "0.400", "12.31", "0.07")
    assert {row["trkSub"] for row in rows[3:]} == {"KOC002"}


def test_a_night_without_bodies_has_no_file():
    assert ades_psv(night(), SITE) == ""
    assert ades_psv(night(body("x", StrangerKind.NEW_STAR)), SITE) == ""


@pytest.mark.parametrize(
    ("code", "observer", "telescope", "words"),
    [
        ("70", "A. Name", "0.2,reflector,CCD", "not an MPC observatory code"),
        ("703\n!", "A. Name", "0.2,reflector,CCD", "not an MPC observatory code"),
        ("703", " ", "0.2,reflector,CCD", "--observer"),
        ("703", "A. Name", "", "--telescope '' is not understood"),
        ("703", "A. Name", "0.2,reflector", "--telescope 0.2,reflector is not"),
        ("703", "A. Name", "nan,reflector,CCD", "not understood"),
        ("703", "A. Name", "-1,reflector,CCD", "not understood"),
        ("703", "A. Name", "0.2,,CCD", "not understood"),
    ],
)
def test_what_is_no_observatory_is_one_sentence(code, observer, telescope, words):
    with pytest.raises(UsageError, match=words):
        Observatory.parse(code, observer, telescope)
