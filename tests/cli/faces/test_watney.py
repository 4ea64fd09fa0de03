"""Kochab called as StellarSolver calls watney-solve."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from astropy.io import fits

from kochab.cli.main import main

SAMPLES = Path(__file__).resolve().parents[3] / "resources" / "samples"


def watney(*arguments) -> int:
    return main(["watney-solve", *map(str, arguments)])


@pytest.fixture
def orion(tmp_path):
    return shutil.copy(SAMPLES / "orion.png", tmp_path / "orion.png")


def test_an_image_is_solved_as_stellarsolver_asks(orion, tmp_path, capsys) -> None:
    out, wcs = tmp_path / "a.ini", tmp_path / "a.wcs"
    asked = ["nearby", "-r", "84", "-d", "-1.5", "-s", "15", "-m", "-f", "10", "-i", orion, "-o", out, "-w", wcs]
    assert watney(*asked, "--log-file", tmp_path / "a.log") == 0
    told = json.loads(out.read_text())
    assert told["success"] is True
    assert (told["ra"], told["dec"]) == pytest.approx((84.0, -1.5), abs=0.01)
    # Debian's solve-field on this image: up is -168.08 degrees E of N at its reference point, parity neg, 50.13.
    assert told["orientation"] == pytest.approx(-168.08, abs=0.5)
    assert told["parity"] == "flipped"
    assert told["pixScale"] == pytest.approx(50.13, rel=0.01)
    assert fits.Header.fromtextfile(wcs)["CTYPE1"].startswith("RA---TAN")


def test_a_list_of_stars_is_solved(orion, tmp_path, capsys) -> None:
    assert main(["solve-field", str(orion)]) == 0
    stars = fits.getdata(tmp_path / "orion.axy")
    columns = {"X_IMAGE": stars["X"], "Y_IMAGE": stars["Y"], "MAG_AUTO": -2.5 * np.log10(stars["FLUX"])}
    table = fits.BinTableHDU.from_columns([fits.Column(name, "1E", array=a) for name, a in columns.items()])
    table.writeto(tmp_path / "k.xyls")
    capsys.readouterr()
    asked = ["blind", "--min-radius", "0.5", "--max-radius", "15", "--xyls", tmp_path / "k.xyls"]
    assert watney(*asked, "--xyls-imagesize", "1080x720") == 0
    assert json.loads(capsys.readouterr().out)["ra"] == pytest.approx(84.0, abs=0.01)


def test_the_radius_bounds_and_tsv_is_lines(orion, capsys) -> None:
    assert watney("nearby", "-r", "84", "-d", "30", "-s", "5", "-m", "-i", orion, "--out-format", "tsv") == 0
    out, err = capsys.readouterr()
    assert out == "success\tFalse\n"
    assert "outside the search radius" in err


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ([], "Say how to solve"),
        (["nearby"], "Name the image"),
        (["blind", "-i", "none.png"], "none.png does not exist."),
        (["blind", "--nonsense", "-i", "none.png"], "Option --nonsense not recognized."),
        (["nearby", "-r", "30h", "-d", "1", "-i", "none.png"], "30h is not a right ascension"),
        (["blind", "-i", "none.png", "--out-format", "xml"], "--out-format xml is none of"),
        (["blind", "none.png"], "none.png belongs to no option."),
        (["blind", "--xyls", "none.xyls"], "none.xyls cannot be read"),
        (["blind", "-i", "a.png", "-o", "a.png"], "a.png is an input file"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_sentence(tmp_path, monkeypatch, capsys, asked, sentence) -> None:
    monkeypatch.chdir(tmp_path)
    assert watney(*asked) == 1
    assert capsys.readouterr().err.startswith(f"kochab: {sentence}")
