"""Kochab called as N.I.N.A. and CCDciel call PlateSolve2 and PlateSolve3, its files read as they read them."""

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from astropy.io import fits
from astropy.wcs import WCS

from kochab.cli.faces import named_face
from kochab.cli.main import main

SAMPLES = Path(__file__).resolve().parents[3] / "resources" / "samples"
HERE = "1.466,-0.026,0.262,0.175"


@pytest.fixture
def orion(tmp_path):
    return shutil.copy(SAMPLES / "orion.png", tmp_path / "or ion.png")


@pytest.fixture(params=["as it is", "turned", "mirrored"])
def pleiades(tmp_path, request):
    """A frame, its pixels turned by a quarter or mirrored; and the plane that its own header would then have."""
    pixels, header = fits.getdata(SAMPLES / "pleiades.fits"), fits.getheader(SAMPLES / "pleiades.fits")
    assert "CD1_1" not in header  # nothing to copy from
    change = {"as it is": lambda a: a, "turned": np.rot90, "mirrored": np.fliplr}[request.param]
    fits.writeto(tmp_path / "p.fits", np.ascontiguousarray(change(pixels)))
    return tmp_path / "p.fits"


def by_nina_2(path) -> dict:
    """``ReadResult`` of Platesolve2Solver.cs."""
    first, second, *_ = (line.split(",") for line in path.read_text().splitlines())
    if int(first[2]) != 1:
        return {"success": False}
    assert len(first) == 3
    assert len(second) == 5  # more would be read as decimal commas
    flipped = float(second[2]) >= 0
    angle = 360 - float(second[1]) + (180 if flipped else 0)
    place = math.degrees(float(first[0])), math.degrees(float(first[1]))
    return {"success": True, "place": place, "scale": float(second[0]), "angle": angle % 360, "flipped": flipped}


def by_nina_3(path) -> dict:
    """``ReadResult`` of Platesolve3Solver.cs."""
    lines = path.read_text().splitlines()
    if lines[0].lower() != "true":
        return {"success": False}
    numbers = [[float(word) for word in lines[row].split(",")] for row in (1, 2)]
    place = math.degrees(numbers[0][0]), math.degrees(numbers[0][1])
    return {"success": True, "place": place, "scale": 206264.8 / numbers[1][0], "angle": numbers[1][1]}


def plane_by_ccdciel_2(path, width, height) -> WCS:
    """``Apm2Wcs`` of cu_astrometry_engine.pas."""
    line1, line2, line3 = path.read_text().splitlines()
    assert len(line3) == 20
    ra, dec = (math.degrees(float(word)) for word in line1.split(",")[:2])
    scale, turn, ratio = line2.split(",")[:3]
    scale, turn = float(scale) / 3600, float(turn)
    side, turn = (-1, turn) if "-" not in ratio else (1, 180 - turn)
    cos, sin = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    return _plane(ra, dec, scale * np.array([[side * cos, side * sin], [-sin, cos]]), width, height)


def plane_by_ccdciel_3(path, width, height) -> WCS:
    """The same for PlateSolve3: the signs of A, B, C, D are those of the plane, changed."""
    lines = path.read_text().splitlines()
    ra, dec = (math.degrees(float(word)) for word in lines[1].split(","))
    px_a_radian, turn = (float(word) for word in lines[2].split(","))
    turn, scale = math.radians(180 - turn), math.degrees(1 / px_a_radian)
    size = scale * np.abs([[math.cos(turn), math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    signs = np.sign([float(word) for word in lines[4].split(",")[:4]]).reshape(2, 2)
    return _plane(ra, dec, -signs * size, width, height)


def _plane(ra, dec, cd, width, height) -> WCS:
    plane = WCS(naxis=2)
    plane.wcs.ctype = "RA---TAN", "DEC--TAN"
    plane.wcs.crval, plane.wcs.crpix, plane.wcs.cd = (ra, dec), (0.5 + width / 2, 0.5 + height / 2), cd
    return plane


@pytest.mark.parametrize(("face", "ending", "reader"), [(2, ".apm", by_nina_2), (3, "_PS3.txt", by_nina_3)])
def test_nina_reads_what_it_asked_for(orion, tmp_path, face, ending, reader) -> None:
    # N.I.N.A. sends PlateSolve2 a name with blanks without quotes: it comes in parts.
    asked = [f"{HERE},100,{orion},0".split(" ")] if face == 2 else [[orion, *HERE.split(",")]]
    assert main([f"platesolve{face}", *map(str, asked[0])]) == 0
    found = reader(tmp_path / f"or ion{ending}")
    assert found["place"] == pytest.approx((84.0, -1.5), abs=0.01)
    assert found["scale"] == pytest.approx(50.13, rel=0.01)  # Debian's solve-field
    assert found["angle"] == pytest.approx(12.0, abs=0.1)
    assert found.get("flipped", False) is False


@pytest.mark.parametrize(
    ("face", "name", "plane"), [(2, "p.apm", plane_by_ccdciel_2), (3, "p_PS3.txt", plane_by_ccdciel_3)]
)
def test_ccdciel_finds_each_star_where_it_is(pleiades, capsys, face, name, plane) -> None:
    height, width = fits.getdata(pleiades).shape
    asked = [f"0.99,0.42,0.035,0.023,9,{pleiades},1"] if face == 2 else [pleiades]
    assert main([f"platesolve{face}", *map(str, asked)]) == 0
    capsys.readouterr()
    main(["solve", "--json", str(pleiades)])
    stars = json.loads(capsys.readouterr().out)["stars"]
    found = plane(pleiades.with_name(name), width, height)
    xy = found.all_world2pix([(star["ra_deg"], star["dec_deg"]) for star in stars], 0)
    off = np.hypot(*(xy - [(star["x"], star["y"]) for star in stars]).T)
    assert len(off) > 50
    assert np.median(off) < 1.0  # a plane without distortion


@pytest.mark.parametrize(
    ("asked", "name", "sentence"),
    [
        (["platesolve2", "1,2,3"], None, "Give RA,DEC,WIDTH,HEIGHT,REGIONS,FILE,WAIT"),
        (["platesolve2", "1,x,1,1,9,{},0"], "or ion.apm", "is not a number"),
        (["platesolve2", "1,9,1,1,9,{},0"], "or ion.apm", "is no place on the sky"),
        (["platesolve2", "1,0.2,nan,1,9,{},0"], "or ion.apm", "is no place on the sky"),
        (["platesolve2", HERE.replace("0.262", "0.01") + ",9,{},0"], "or ion.apm", "the width given means"),
        (["platesolve3", "{}", "1"], None, "Give FILE, or FILE RA DEC WIDTH HEIGHT"),
        (["platesolve3", "{}x"], "or ion_PS3.txt", "does not exist"),
    ],
)
def test_what_cannot_be_done_is_told_and_no_solution(orion, tmp_path, capsys, asked, name, sentence) -> None:
    code = main([word.format(orion) for word in asked])
    err = capsys.readouterr().err
    assert sentence in err
    assert err.count("\n") == 1
    assert code == (1 if name is None else 0)
    if name:
        reader = by_nina_2 if name.endswith(".apm") else by_nina_3
        assert reader(tmp_path / name) == {"success": False}


def test_a_file_that_is_no_result_is_spared(orion, tmp_path, capsys) -> None:
    (tmp_path / "or ion_PS3.txt").write_text("my notes\n")
    assert main(["platesolve3", str(orion)]) == 1
    assert "no solver wrote it" in capsys.readouterr().err
    assert (tmp_path / "or ion_PS3.txt").read_text() == "my notes\n"
    for _ in range(2):  # its own is renewed
        assert main(["platesolve2", f"{HERE},9,{orion},0"]) == 0


def test_their_names_have_a_version() -> None:
    assert named_face("C/PlateSolve2.28.exe".replace("/", "\\").rpartition("\\")[2]) == "platesolve2"
    assert named_face("/opt/PlateSolve3.80") == "platesolve3"
