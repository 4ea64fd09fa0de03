"""``kochab identify``: lists in, JSON lines out, exit codes."""

import json
from pathlib import Path

import pytest

from kochab.cli.main import main
from kochab.identification import IDENTIFIERS

from .stars import Knowing, orion_places


@pytest.fixture(autouse=True)
def knowing(monkeypatch):
    monkeypatch.setitem(IDENTIFIERS.own, "knowing", f"{Knowing.__module__}:Knowing")


@pytest.fixture
def good(tmp_path):
    path = tmp_path / "orion.csv"
    path.write_text("x,y\n" + "\n".join(f"{x:.4f},{y:.4f}" for x, y in orion_places()))
    return str(path)


@pytest.fixture
def bad(tmp_path):
    path = tmp_path / "noise.csv"
    path.write_text("\n".join(f"{x},{y}" for x, y in [(5, 5), (80, 9), (300, 44), (90, 900)]))
    return str(path)


def identify(*arguments: str) -> int:
    return main(["identify", "--width", "1600", "--height", "1000", "--method", "knowing", *arguments])


def lines(capsys) -> list[dict]:
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_a_list_that_begins_with_a_minus_is_no_option(good, capsys) -> None:
    assert identify(good, "--json", "--near", "-276,-2,20") == 0
    (out,) = lines(capsys)
    assert out["ra_deg"] == pytest.approx(84.0, abs=1e-4)
    assert identify(good, "--json", "--near", "444,-2,20") == 0  # right ascension begins again at 360
    assert lines(capsys)[0]["ra_deg"] == pytest.approx(84.0, abs=1e-4)
    assert identify(good, "--json", "--near", "5040,-2,20") == 2  # minutes of arc
    assert "not a place on the sky" in capsys.readouterr().err
    assert identify(good, "--json", "--near", "-276,-95,20") == 2
    assert "not a place on the sky" in capsys.readouterr().err


def test_a_solved_list(good, capsys) -> None:
    assert identify(good, "--json") == 0
    (out,) = lines(capsys)
    assert out["file"] == good
    assert out["solved"] is True
    assert (out["ra_deg"], out["dec_deg"]) == pytest.approx((84.0, -2.0), abs=1e-4)
    assert out["roll_deg"] == pytest.approx(25.0, abs=1e-3)
    assert out["mirrored"] is False
    assert out["matches"] > 30
    assert out["rms_px"] < 0.01


def test_one_without_solution_makes_it_1_and_one_unusable_2(good, bad, tmp_path, capsys) -> None:
    assert identify(good, bad, "--json") == 1
    first, second = lines(capsys)
    assert (first["solved"], second["solved"]) == (True, False)
    assert second["reason"] == "too few stars"
    missing = str(tmp_path / "missing.csv")
    assert identify(good, missing, bad, "--json") == 2
    out = lines(capsys)
    assert [o["file"] for o in out] == [good, missing, bad]
    assert out[1] == {"file": missing, "error": f"{missing} cannot be read: No such file or directory."}


def test_near_is_a_hint_and_with_strict_a_bound(good, capsys) -> None:
    near = ("--near", "99,-2,5", "--json")
    assert identify(good, *near) == 0
    (out,) = lines(capsys)
    assert any("away from the position" in text for text in out["warnings"])
    assert identify(good, *near, "--strict", "--wcs") == 1
    (out,) = lines(capsys)
    assert out["reason"] == "outside the search radius"
    assert "RA 84.0000, Dec -2.0000 deg, 14.99 deg from the search position" in out["advice"]
    assert out["measured"]["away_deg"] == pytest.approx(14.99, abs=0.01)
    assert not Path(good + ".wcs").exists()
    assert identify(good, "--near", "99,-2,16", "--strict") == 0
    capsys.readouterr()
    assert identify(good, "--strict") == 2
    assert capsys.readouterr().err == "kochab: --strict needs --near RA,DEC,RADIUS.\n"


def test_people_get_a_card(good, bad, capsys) -> None:
    assert identify(good, bad) == 1
    text = capsys.readouterr().out
    assert "Alnilam" in text
    assert "no solution: too few stars" in text


def test_an_unknown_method_is_told_before_any_work(good, capsys) -> None:
    assert main(["identify", "--width", "9", "--height", "9", "--method", "guess", good]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("kochab: There is no method 'guess'; choose one of patterns")


# A .wcs file has no image, as other solvers write it, and astropy says so.
@pytest.mark.filterwarnings("ignore:The WCS transformation has more axes")
def test_the_wcs_is_written_and_astropy_reads_it(good, capsys) -> None:
    from astropy.io import fits
    from astropy.wcs import WCS

    assert identify(good, "--json", "--wcs") == 0
    (out,) = lines(capsys)
    header = fits.Header.fromtextfile(good + ".wcs")
    ra, dec = WCS(header).all_pix2world([[799.5, 499.5]], 0)[0]
    assert (ra, dec) == pytest.approx((out["ra_deg"], out["dec_deg"]), abs=1e-5)


def test_the_wcs_has_the_name_that_astrometry_net_gives_it_and_spares_others(good, capsys) -> None:
    target = Path(good).with_suffix(".wcs")
    astap = f"SIMPLE  = {'T':>20}".ljust(80) + f"NAXIS   = {'0':>20}".ljust(80) + f"PLTSOLVD= {'T':>20}".ljust(80)
    target.write_text(astap)
    assert identify(good, "--name-wcs") == 2
    assert f"{target} exists already" in capsys.readouterr().err
    assert target.read_text() == astap
    target.unlink()
    for _ in range(2):  # Kochab's own is renewed
        assert identify(good, "--name-wcs") == 0
    assert "solved by Kochab" in target.read_text()
    assert sorted(path.suffix for path in target.parent.glob("orion*")) == [".csv", ".wcs"]
    twin = Path(good).with_suffix(".txt")
    twin.write_text(Path(good).read_text())
    before = target.read_bytes()
    capsys.readouterr()
    assert identify(good, str(twin), "--name-wcs") == 2
    assert f"would be the WCS of both {good} and {twin}" in capsys.readouterr().err
    assert target.read_bytes() == before


def test_a_wcs_that_cannot_be_written_is_2_with_the_answer_still_there(good, capsys, tmp_path) -> None:
    (tmp_path / "orion.csv.wcs").mkdir()
    assert identify(good, "--json", "--wcs") == 2
    out, err = capsys.readouterr()
    assert json.loads(out)["solved"] is True
    assert "failures" not in json.loads(out)
    assert "cannot be written" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("name", ["quest", "triad", "plate_constants"])
def test_the_attitude_may_come_from_a_named_estimator(name, good, capsys) -> None:
    assert identify(good, "--json", "--attitude", name) == 0
    (out,) = lines(capsys)
    assert (out["ra_deg"], out["dec_deg"]) == pytest.approx((84.0, -2.0), abs=1e-4)
    assert out["warnings"] == []
