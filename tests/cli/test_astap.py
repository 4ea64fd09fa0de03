"""Kochab called as capture programs call ASTAP."""

import math
import subprocess
import sys

import numpy as np
import pytest
from astropy.coordinates import SkyCoord
from astropy.io import fits
from astropy.wcs import WCS

from kochab.cli.astap import FIELD_FACTOR, _bound, _hint, _order, within_field
from kochab.cli.main import main
from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.frame import Frame, Hint
from kochab.core.solution import Reason, Solution
from kochab.frames.fits_write import write_fits
from kochab.simulate.star_images import FWHM_PER_SIGMA
from tests.solver.fields import photograph

CAMERA = Camera(1600, 1000, 7600.0, 830.0, 470.0, k1=-0.05)
CENTRE = (84.0, -2.0)


def picture(path, camera=CAMERA, roll_deg=25.0):
    """A frame of Orion, each star a round spot."""
    field = photograph(camera, attitude_from(*CENTRE, roll_deg), sigma_px=0.0)
    y, x = np.mgrid[: camera.height, : camera.width]
    pixels = np.full((camera.height, camera.width), 100.0, np.float32)
    for column, row in field.detections.xy:
        near = (slice(max(0, int(row) - 9), int(row) + 10), slice(max(0, int(column) - 9), int(column) + 10))
        squares = (x[near] - column) ** 2 + (y[near] - row) ** 2
        pixels[near] += 2000.0 * np.exp(-squares / (2 * (3.0 / FWHM_PER_SIGMA) ** 2))
    write_fits(Frame(pixels), path)
    return path


def ini_of(path) -> dict[str, str]:
    lines = path.read_text().splitlines()
    return dict(line.split("=", 1) for line in lines)


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_solved_frame_has_an_ini_and_a_wcs_that_agree(tmp_path, capsys, mirrored) -> None:
    camera = Camera(1600, 1000, 7600.0, 830.0, 470.0, k1=-0.05, mirrored=mirrored)
    path = picture(tmp_path / "a.fits", camera)
    asked = ["-f", str(path), "-ra", "5.6", "-spd", "88", "-r", "20", "-fov", "7.5", "-z", "0", "-s", "500"]
    assert main([*asked, "-wcs", "-update", "-annotate"]) == 0
    assert "Solved" in capsys.readouterr().out
    told = ini_of(tmp_path / "a.ini")
    assert told["PLTSOLVD"] == "T"
    assert told["DIMENSIONS"] == "1600 x 1000"
    assert "WARNING" not in told
    assert (float(told["CRPIX1"]), float(told["CRPIX2"])) == (800.5, 500.5)
    linear = WCS(naxis=2)
    linear.wcs.ctype = "RA---TAN", "DEC--TAN"
    linear.wcs.crpix = [float(told[f"CRPIX{i}"]) for i in (1, 2)]
    linear.wcs.crval = [float(told[f"CRVAL{i}"]) for i in (1, 2)]
    linear.wcs.cd = [[float(told[f"CD{i}_{j}"]) for j in (1, 2)] for i in (1, 2)]
    assert (np.linalg.det(linear.wcs.cd) > 0) is not mirrored
    beside = fits.Header.fromtextfile(tmp_path / "a.wcs")
    del beside["NAXIS"]  # there is no image in it, which astropy would remark upon
    for whole in (WCS(beside), WCS(fits.getheader(path))):
        for place, limit_arcsec in (((799.5, 499.5), 0.05), ((809.5, 509.5), 0.2)):
            theirs = SkyCoord(*whole.all_pix2world(*place, 0), unit="deg")
            ours = SkyCoord(*linear.all_pix2world(*place, 0), unit="deg")
            assert theirs.separation(ours).arcsec < limit_arcsec
    scale, turn = float(told["CDELT2"]), math.radians(float(told["CROTA2"]))
    assert float(told["CD2_2"]) == pytest.approx(scale * math.cos(turn))
    assert float(told["CD1_2"]) == pytest.approx(-scale * math.sin(turn))
    assert (tmp_path / "a_annotated.jpg").stat().st_size > 1000


def test_the_search_radius_bounds_the_answer(tmp_path, capsys) -> None:
    path = picture(tmp_path / "a.fits")
    asked = ["-f", str(path), "-ra", "6.6", "-spd", "88", "-fov", "7.5", "-wcs", "-update"]
    before = path.read_bytes()
    assert main([*asked, "-r", "5"]) == 1
    told = ini_of(tmp_path / "a.ini")
    assert told["PLTSOLVD"] == "F"
    found = "at RA 84.1145, Dec -2.2987 deg, 14.88 deg from the search position"
    assert "outside the search radius" in told["ERROR"]
    assert found in told["ERROR"]
    assert "the search radius is 5 deg" in capsys.readouterr().err
    assert "CRVAL1" not in told
    assert not (tmp_path / "a.wcs").exists()
    assert path.read_bytes() == before
    assert main([*asked, "-r", "16"]) == 0
    assert main(asked) == 0  # ASTAP's own default is the whole sky
    assert ini_of(tmp_path / "a.ini")["PLTSOLVD"] == "T"


def test_the_field_bounds_the_answer(tmp_path, capsys) -> None:
    path = picture(tmp_path / "a.fits")
    before = path.read_bytes()
    assert main(["-f", str(path), "-fov", "0.3", "-wcs", "-update"]) == 1
    told = ini_of(tmp_path / "a.ini")
    assert told["PLTSOLVD"] == "F"
    assert "field of view differs" in told["ERROR"]
    assert "at RA 84.1145, Dec -2.2987 deg and 27.14 arcsec/px; -fov means 1.08." in told["ERROR"]
    assert "CRVAL1" not in told
    assert not (tmp_path / "a.wcs").exists()
    assert path.read_bytes() == before
    capsys.readouterr()
    assert main(["-f", str(path), "-fov", "3.8"]) == 0  # half, as with binning the caller knows nothing of
    told = ini_of(tmp_path / "a.ini")
    assert told["PLTSOLVD"] == "T"
    assert "is wrong by a factor of" in told["WARNING"]


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_so_far_off_may_the_field_be(way) -> None:
    found = Solution(CAMERA, attitude_from(*CENTRE, 0.0), (), 0.1, -20.0, "patterns")

    def result(factor: float):
        given = CAMERA.scale_arcsec_px * factor**way
        return within_field(found, (given / 1.15, given * 1.15))

    assert result(0.999 * FIELD_FACTOR) is found
    refused = result(1.001 * FIELD_FACTOR)
    assert refused.reason is Reason.ANOTHER_FIELD
    assert refused.measured["scale_arcsec_px"] == CAMERA.scale_arcsec_px
    assert within_field(found, None) is found
    assert within_field(refused, (1.0, 2.0)) is refused


def test_the_search_position_is_the_headers_when_none_is_told() -> None:
    header = Hint(centre_deg=(99.0, -2.0, 12.0))

    def bound(*words: str):
        return _bound(_order(["-f", "a.fits", *words]), header)

    assert bound("-r", "5") == (99.0, -2.0, 5.0)
    assert bound("-ra", "6", "-spd", "80", "-r", "5") == (90.0, -10.0, 5.0)
    assert bound("-ra", "6", "-spd", "80") is None
    assert bound("-ra", "6", "-spd", "80", "-r", "0") is None
    assert bound() is None
    assert _bound(_order(["-f", "a.fits", "-r", "5"]), Hint()) is None


def test_no_solution_is_told_in_the_ini_and_by_the_code(tmp_path, capsys) -> None:
    path = tmp_path / "dark.fits"
    write_fits(Frame(np.zeros((60, 80), np.uint16)), path)
    base = tmp_path / "other"
    assert main(["-o", str(base), "-f", str(path), "-fov", "0"]) == 1
    told = ini_of(tmp_path / "other.ini")
    assert told["PLTSOLVD"] == "F"
    assert "clouded or dark" in told["ERROR"]
    assert capsys.readouterr().err.startswith("kochab: dark.fits: clouded or dark.")
    assert not (tmp_path / "other.wcs").exists()


@pytest.mark.parametrize(
    "arguments", [["-foo"], ["-fov", "x", "-ra", "nan", "-spd", "999", "-r", "-3"], ["-r"], ["-fov", "1e999"]]
)
def test_hints_that_are_none_are_left_alone(tmp_path, capsys, arguments) -> None:
    path = tmp_path / "a.fits"
    path.write_bytes(b"not a picture")
    assert main([*arguments, "-f", str(path)]) == 1
    assert ini_of(tmp_path / "a.ini")["ERROR"] == capsys.readouterr().err.strip()[len("kochab: ") :]


def test_what_cannot_be_written_is_a_sentence(tmp_path, capsys) -> None:
    path = tmp_path / "a.fits"
    path.write_bytes(b"not a picture")
    assert main(["-f", str(path), "-o", str(tmp_path / "none" / "a")]) == 1
    assert main(["-f", "", "-r", "3"]) == 1
    assert main(["-f"]) == 1
    assert capsys.readouterr().err.count("\n") == 3


def test_a_field_beyond_all_reason_is_left_alone() -> None:
    for fov in ("1e-300", "0", "171", "1e300"):
        assert not _hint(_order(["-f", "a.fits", "-fov", fov]), 1000).helps
    assert _hint(_order(["-f", "a.fits", "-fov", "1.5"]), 1000).helps


def test_a_fault_of_ours_is_told_in_the_ini_too(tmp_path, monkeypatch, capsys) -> None:
    def fault(path, timeout_s):
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr("kochab.frames.reading", fault)
    assert main(["-f", str(tmp_path / "a.fits")]) == 1
    assert ini_of(tmp_path / "a.ini")["PLTSOLVD"] == "F"
    assert "A fault in Kochab: ZeroDivisionError" in capsys.readouterr().err


def test_it_is_called_as_a_program_too(repository, tmp_path) -> None:
    command = [sys.executable, "-m", "app", "-f", str(tmp_path / "absent.fits"), "-r", "30"]
    done = subprocess.run(command, cwd=repository, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert "does not exist" in done.stderr
    assert ini_of(tmp_path / "absent.ini")["PLTSOLVD"] == "F"
