"""``kochab solve``: files and folders in, an outcome each, in order."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from astropy.io import fits
from PIL import Image

from kochab.cli.main import main
from kochab.frames import suffixes
from kochab.workflows.annotated_image import INKS


@pytest.fixture
def dark(tmp_path):
    path = tmp_path / "dark.png"
    Image.fromarray(np.zeros((60, 80), np.uint8)).save(path)
    return str(path)


@pytest.fixture
def broken(tmp_path):
    path = tmp_path / "broken.fits"
    path.write_bytes(b"this is no picture")
    return str(path)


def lines(capsys) -> list[dict]:
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_a_dark_frame_has_a_reason(dark, capsys) -> None:
    assert main(["solve", "--json", dark]) == 1
    (out,) = lines(capsys)
    assert out["file"] == dark
    assert (out["solved"], out["reason"]) == (False, "clouded or dark")
    assert out["advice"]
    assert out["elapsed_ms"]["total"] > 0


def test_an_unreadable_file_is_one_line_and_the_rest_goes_on(dark, broken, capsys) -> None:
    assert main(["solve", "--json", broken, dark, "nowhere.fits"]) == 2
    first, second, third = lines(capsys)
    assert set(first) == {"file", "error"}
    assert "\n" not in first["error"]
    assert second["solved"] is False
    assert third["file"] == "nowhere.fits"


def test_several_processes_print_the_same_in_the_same_order(dark, broken, capsys) -> None:
    arguments = ["solve", "--json", dark, broken, dark]
    assert main(arguments) == 2
    alone = lines(capsys)
    assert main([*arguments, "--workers", "2"]) == 2
    together = lines(capsys)
    for outcome in alone + together:
        outcome.pop("elapsed_ms", None)
    assert alone == together


def test_a_folder_stands_for_its_pictures(dark, broken, tmp_path, capsys) -> None:
    (tmp_path / "truth.json").write_text("{}")
    assert main(["solve", "--json", str(tmp_path)]) == 2
    assert [o["file"] for o in lines(capsys)] == [broken, dark]
    assert ".json" not in suffixes()


def test_an_empty_folder_is_one_sentence(tmp_path, capsys) -> None:
    assert main(["solve", str(tmp_path)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == f"kochab: {tmp_path} is a folder without frames.\n"


def test_an_empty_folder_costs_no_other_file(dark, tmp_path, capsys) -> None:
    (tmp_path / "empty").mkdir()
    assert main(["solve", "--json", str(tmp_path / "empty"), dark]) == 2
    first, second = lines(capsys)
    assert "folder without frames" in first["error"]
    assert second["reason"] == "clouded or dark"


def test_a_folder_that_may_not_be_read_costs_no_other_file(dark, tmp_path, capsys, monkeypatch) -> None:
    closed = tmp_path / "closed"
    closed.mkdir()

    def refuse(path="."):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(os, "listdir", refuse)
    monkeypatch.setattr(Path, "iterdir", refuse)
    assert main(["solve", "--json", str(closed), dark]) == 2
    first, second = lines(capsys)
    assert first["error"] == f"{closed} cannot be read: Permission denied."
    assert second["reason"] == "clouded or dark"


def test_what_could_not_be_written_is_in_the_json_too(repository, tmp_path, capsys) -> None:
    sample = sorted((repository / "resources" / "samples").glob("*.*"))[0]
    target = tmp_path / "nowhere" / "out.png"
    assert main(["solve", "--json", str(sample), "--annotate", str(target)]) == 2
    out, err = capsys.readouterr()
    told = json.loads(out)
    assert told["solved"] is True
    assert f"kochab: {told['warnings'][-1]}\n" == err
    assert str(target) in err


@pytest.mark.parametrize(
    ("option", "value"), [("--fov", "1e-300"), ("--fov", "200"), ("--scale", "1e300"), ("--scale", "0")]
)
def test_a_belief_out_of_range_is_refused_with_the_range(option, value, dark, capsys) -> None:
    assert main(["solve", dark, option, value]) == 2
    assert f"{value} is not between 0.001 and" in capsys.readouterr().err


def test_one_picture_for_two_frames_is_refused(dark, capsys) -> None:
    assert main(["solve", dark, dark, "--annotate", "out.png"]) == 2
    assert "one image for 2 frames" in capsys.readouterr().err


@pytest.mark.parametrize(("name", "kind"), [("out.png", "PNG"), ("out.JPG", "JPEG")])
def test_the_annotated_picture_is_what_its_name_says(name, kind, repository, tmp_path) -> None:
    sample = sorted((repository / "resources" / "samples").glob("*.*"))[0]
    assert main(["solve", str(sample), "--annotate", str(tmp_path / name)]) == 0
    with Image.open(tmp_path / name) as picture:
        assert picture.format == kind


@pytest.fixture
def shot(repository, tmp_path):
    """The faint sample as a dated FITS from Munich, in a folder of its own."""
    home = tmp_path / "night"
    home.mkdir()
    with fits.open(repository / "resources" / "samples" / "pleiades.fits") as found:
        header = fits.Header({"DATE-OBS": "2026-01-15T19:00:00", "SITELAT": 48.1, "SITELONG": 11.6})
        fits.PrimaryHDU(found[0].data, header).writeto(home / "m45.fits")
    return home / "m45.fits"


def test_the_layers_of_an_annotated_picture_are_chosen(shot) -> None:
    def drawn(*more):
        target = shot.with_name("a.svg")
        assert main(["solve", str(shot), "--annotate", str(target), "--overwrite", *more]) == 0
        return target.read_text("utf-8")

    usual, chosen = drawn(), drawn("--layers", "altaz,no-grid, detected,no-names")
    assert INKS["grid"] in usual
    assert INKS["grid"] not in chosen
    assert ">alt +" in chosen
    assert ">alt +" not in usual
    assert chosen.count(INKS["detected"]) > 10
    assert ">Alcyone<" in usual
    assert ">Alcyone<" not in chosen


@pytest.mark.parametrize("named", ["stars", "altaz,", "no-", "Grid"])
def test_a_layer_that_is_none_is_refused_before_any_work(named, dark, capsys) -> None:
    assert main(["solve", dark, "--annotate", "out.png", "--layers", named]) == 2
    err = capsys.readouterr().err
    assert "there is no layer" in err
    assert "altaz" in err


def test_another_kind_of_annotated_picture_is_refused(dark, capsys) -> None:
    assert main(["solve", dark, "--annotate", "out.gif"]) == 2
    assert "a .png, .jpg, .tif, .pdf or .svg" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--method", "--detector", "--attitude"])
def test_an_unknown_name_is_told_before_any_work(option, dark, capsys) -> None:
    assert main(["solve", dark, option, "guess", "--json"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "'guess'; choose one of" in err


def test_people_read_of_a_bad_file_on_stderr(broken, capsys) -> None:
    assert main(["solve", broken]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert "broken.fits" in err
