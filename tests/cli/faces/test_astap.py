"""Kochab called as capture programs call ASTAP."""

import math
import shutil
import subprocess
import sys
from functools import partial

import numpy as np
import pytest
from astropy.coordinates import SkyCoord
from astropy.io import fits
from astropy.wcs import WCS

from kochab.cli.faces.astap import FIELD_FACTOR, _bound, _hint, _order, within_field
from kochab.cli.main import main
from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.frame import Frame, Hint
from kochab.core.solution import Reason, Solution
from kochab.frames.fits_write import write_fits
from kochab.simulate.star_images import FWHM_PER_SIGMA
from kochab.sky.catalogue import Catalogue
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
    assert float(told["CD2_2"]) == pytest.approx(scale * math.cos(turn), rel=1e-3)
    # ``old_to_new_WCS`` as ASTAP's author gave it to CCDciel: the sign of CDELT1 turns the angle.
    side = math.copysign(1.0, float(told["CDELT1"]))
    assert float(told["CD1_2"]) == pytest.approx(scale * side * math.sin(turn), rel=1e-3)
    assert float(told["CD2_1"]) == pytest.approx(-abs(float(told["CDELT1"])) * math.sin(turn), rel=1e-3)
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
    assert main(["-o", str(base), "-f", str(path), "-fov", "0"]) == 2
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
    assert main([*arguments, "-f", str(path)]) == 16
    assert ini_of(tmp_path / "a.ini")["ERROR"] == capsys.readouterr().err.strip()[len("kochab: ") :]


def test_what_cannot_be_written_is_a_sentence(tmp_path, capsys) -> None:
    path = tmp_path / "a.fits"
    path.write_bytes(b"not a picture")
    assert main(["-f", str(path), "-o", str(tmp_path / "none" / "a")]) == 16
    assert main(["-f", "", "-r", "3"]) == 16
    assert main(["-f"]) == 16
    assert capsys.readouterr().err.count("\n") == 3


@pytest.mark.parametrize("task", ["-stack", "-focus1", "-sqm", "-extract2"])
def test_a_task_that_kochab_has_not_is_refused_in_words(tmp_path, capsys, task) -> None:
    path = picture(tmp_path / "a.fits")
    assert main([task, "30", "-f", str(path)]) == 1
    assert f"Kochab has no {task}" in ini_of(tmp_path / "a.ini")["ERROR"]
    assert f"Kochab has no {task}" in capsys.readouterr().err


def test_a_value_that_is_left_out_does_not_swallow_the_next_option(tmp_path) -> None:
    order = _order(["-sip", "y", "-analyse", "-f", "-a.fits", "-z", "0", "-speed", "slow", "-wcs", "stray", "-r", "3"])
    assert order.options == {
        "-sip": "y", "-analyse": "", "-f": "-a.fits", "-z": "0", "-speed": "slow", "-wcs": "", "-r": "3"
    }  # fmt: skip


def test_too_few_stars_and_no_catalogue_have_codes_of_their_own(tmp_path, monkeypatch) -> None:
    few = picture(tmp_path / "few.fits")
    with fits.open(few, mode="update") as file:
        file[0].data[:, 120:] = 100.0 + np.random.default_rng(5).normal(0.0, 3.0, (1000, 1480))
    assert main(["-f", str(few)]) == 2
    assert "too few stars" in ini_of(tmp_path / "few.ini")["ERROR"]
    path = picture(tmp_path / "a.fits")
    for there, code in ((None, 32), (b"no catalogue", 33)):
        place = tmp_path / "stars" / "catalogue.kst"
        place.parent.mkdir(exist_ok=True)
        if there is not None:
            place.write_bytes(there)
        monkeypatch.setattr("kochab.solver.pipeline._catalogue", partial(Catalogue, place))
        assert main(["-f", str(path)]) == code
        assert ini_of(tmp_path / "a.ini")["PLTSOLVD"] == "F"


def test_the_log_tells_what_was_done_and_spares_other_logs(tmp_path) -> None:
    path = picture(tmp_path / "a.fits")
    assert main(["-f", str(path), "-log"]) == 0
    first, *_, last = (tmp_path / "a.log").read_text().splitlines()
    assert first[8:] == f"  kochab -f {path} -log"
    assert last.endswith("  Solved.")
    assert main(["-f", str(path), "-log"]) == 0  # its own is renewed
    (tmp_path / "a.log").write_text("a person's notes\n")
    assert main(["-f", str(path), "-log"]) == 1
    assert (tmp_path / "a.log").read_text() == "a person's notes\n"


def test_without_sip_the_wcs_is_a_plane(tmp_path) -> None:
    path = picture(tmp_path / "a.fits")
    for asked, code in (([], "RA---TAN-SIP"), (["-sip", "n"], "RA---TAN"), (["-sip"], "RA---TAN-SIP")):
        assert main(["-f", str(path), *asked]) == 0
        assert fits.Header.fromtextfile(tmp_path / "a.wcs")["CTYPE1"] == code


def test_an_updated_picture_is_written_as_fits_beside_it(tmp_path, shared_frames) -> None:
    path = tmp_path / "gran__test01.jpg"
    path.write_bytes((shared_frames / path.name).read_bytes())
    before = path.read_bytes()
    assert main(["-f", str(path), "-update"]) == 0
    assert path.read_bytes() == before
    told, header = ini_of(path.with_suffix(".ini")), fits.getheader(path.with_suffix(".fits"))
    middle = [float(told["CRPIX1"]) - 1.0, float(told["CRPIX2"]) - 1.0]
    there = SkyCoord(*WCS(header).all_pix2world(*middle, 0), unit="deg")
    assert there.separation(SkyCoord(float(told["CRVAL1"]), float(told["CRVAL2"]), unit="deg")).arcsec < 0.5
    assert main(["-f", str(path), "-update"]) == 0
    assert "exists already" in ini_of(path.with_suffix(".ini"))["WARNING"]


# -- Beside the original ------------------------------------------------------------------------

ASTAP = shutil.which("astap_cli")
MEASURED = (  # noqa: SIM905
    "anet__apod1.jpg anet__apod2.jpg anet__apod4.jpg cedar__orion_trees.jpg cedar__orion2.jpg cedar__pleiades.jpg"
    " cedar__hale_bopp.jpg esa__2019-07-29T204726_Alt40_Azi45_Try1.tiff esa__2019-07-29T204726_Alt60_Azi135_Try1.tiff"
    " exo__HATP-32171220013343.FITS geo__AG_Peg-0004V.fit geo__RW_Aur-0004V.fit gran__andromeda_05seg.jpg"
    " gran__cisne_02sec.jpg gran__pleyades_05sec.jpg gran__polar_30sec.jpg gran__sagitario2_10_sec_gain_870.jpg"
    " gran__test01.jpg ores__exp1000_samples_1.bmp ost__feb16_calibration_data_8.png pan__19980-fine-final.fits"
    " pan__noheader.fits pan__solved.fits pf__orion_bad.png"
).split()
needs_astap = pytest.mark.skipif(ASTAP is None, reason="astap_cli (Debian: astap-cli) is not installed")


def measures(text: str) -> tuple[float, int]:
    found = dict(line.split("=") for line in text.splitlines() if line.startswith(("HFD_MEDIAN=", "STARS=")))
    return float(found["HFD_MEDIAN"]), int(found["STARS"])


def theirs(path, *words: str) -> tuple[int, str]:
    done = subprocess.run([ASTAP, "-f", str(path), *words], capture_output=True, text=True, timeout=120)
    return done.returncode, done.stdout


@needs_astap
@pytest.mark.parametrize("name", MEASURED[::6])
def test_half_flux_diameter_and_stars_are_astaps_to_a_tenth(tmp_path, shared_frames, capsys, name) -> None:
    path = tmp_path / name
    path.symlink_to(shared_frames / name)
    code, text = theirs(path, "-analyse", "10", "-o", str(tmp_path / "theirs"))
    hfd, stars = measures(text)
    assert main(["-f", str(path), "-analyse", "10"]) == code == 0
    ours = measures(capsys.readouterr().out)
    assert ours[0] == pytest.approx(hfd, rel=0.1)
    assert ours[1] == pytest.approx(stars, rel=0.1)
    assert not path.with_suffix(".ini").exists()


@needs_astap
@pytest.mark.parametrize("name", ["gran__test01.jpg", "geo__RW_Aur-0004V.fit"])
def test_extracted_stars_are_where_astap_has_them(tmp_path, shared_frames, name) -> None:
    path = tmp_path / name
    path.symlink_to(shared_frames / name)
    lists = []
    for extract in (lambda: theirs(path, "-extract", "10")[0], lambda: main(["-f", str(path), "-extract", "10"])):
        assert extract() == 0
        head, *rows = path.with_suffix(".csv").read_text().splitlines()
        assert head == "x,y,hfd,snr,flux"
        lists.append(np.array([[float(cell) for cell in row.split(",")] for row in rows]))
    astap, ours = lists
    pairs = [(row, ours[np.hypot(*(ours[:, :2] - row[:2]).T).argmin()]) for row in astap]
    met = np.array([[np.hypot(*(a - b)[:2]), b[2] / a[2], b[3] / a[3]] for a, b in pairs])
    met = met[met[:, 0] < 1.0]
    assert len(met) > 0.9 * len(astap)
    assert np.median(met[:, 0]) < 0.1
    assert np.median(met[:, 1:], axis=0) == pytest.approx([1.0, 1.0], abs=0.05)


@needs_astap
def test_an_ini_that_astap_left_after_a_failure_is_renewed(tmp_path) -> None:
    path = picture(tmp_path / "a.fits")
    theirs(tmp_path / "b.fits")  # which is not there
    left = (tmp_path / "b.ini").read_text()
    assert left.startswith("\nPLTSOLVD=F\n")
    (tmp_path / "a.ini").write_text(left)
    assert main(["-f", str(path)]) == 0
    assert ini_of(tmp_path / "a.ini")["PLTSOLVD"] == "T"


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
    assert done.returncode == 16
    assert "does not exist" in done.stderr
    assert ini_of(tmp_path / "absent.ini")["PLTSOLVD"] == "F"


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there; a copy of the program does it")
@pytest.mark.parametrize("name", ["astap", "astap_cli"])
def test_a_link_with_its_name_is_enough(tmp_path, name) -> None:
    program = tmp_path / name
    program.write_text(f"#!{sys.executable}\nfrom kochab.start import main\nimport sys\nsys.exit(main())\n")
    program.chmod(0o755)
    done = subprocess.run([program, "-z", "0"], capture_output=True, text=True, timeout=100)
    assert (done.returncode, done.stderr) == (1, "kochab: Name the frame: -f FILE.\n")
    done = subprocess.run([program, "-f", tmp_path / "none.fits"], capture_output=True, text=True, timeout=100)
    assert done.returncode == 16
    assert "PLTSOLVD=F" in (tmp_path / "none.ini").read_text()


def test_an_ending_of_the_base_is_taken_off_as_astap_does(tmp_path, capsys) -> None:
    """StellarSolver names the ``.ini`` itself; Debian's ``astap_cli -o foo.ini`` writes ``foo.ini`` and ``foo.log``."""
    path = picture(tmp_path / "a.fits")
    assert main(["-f", str(path), "-o", str(tmp_path / "b.ini"), "-wcs", "-log"]) == 0
    assert {name.name for name in tmp_path.glob("b.*")} == {"b.ini", "b.log", "b.wcs"}
