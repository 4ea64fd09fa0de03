"""Kochab called as programs call astrometry.net's solve-field; Debian's own is the referee."""

import math
import os
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from astropy.coordinates import SkyCoord
from astropy.io import fits
from astropy.wcs import WCS

import kochab
from kochab.cli.faces.solve_field import OUTPUTS, _with_wcs
from kochab.cli.main import main
from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.solution import Solution

SAMPLES = Path(__file__).resolve().parents[3] / "resources" / "samples"
CENTRE = (84.0, -1.5)
SOLVE_FIELD = shutil.which("solve-field")
INDEXES = [*Path("/usr/share/astrometry").glob("index-*.fits")]
needs_astrometry = pytest.mark.skipif(
    SOLVE_FIELD is None or not INDEXES, reason="solve-field (Debian: astrometry.net) or its indexes are not installed"
)
WIDE = (
    "gran__pleyades_05sec.jpg",
    "gran__casiopea_01seg_gain_max.jpg",
    "gran__cisne_02sec.jpg",
    "cedar__orion_belt.jpg",
)


@pytest.fixture
def orion(tmp_path):
    return shutil.copy(SAMPLES / "orion.png", tmp_path / "orion.png")


def solve_field(*arguments) -> int:
    return main(["solve-field", *map(str, arguments)])


def told(text: str) -> dict[str, tuple[float, ...]]:
    """The numbers that callers read."""
    number = r"(-?[\d.]+)"
    return {
        "centre": tuple(map(float, re.search(rf"\(RA,Dec\) = \({number}, {number}\) deg", text).groups())),
        "turn": (float(re.search(rf"up is {number} degrees E of N", text)[1]),),
        "size": tuple(map(float, re.search(rf"Field size: {number} x {number} degrees", text).groups())),
        "parity": (float(re.search(r"Field parity: (\w+)", text)[1] == "pos"),),
    }


def columns(path):
    with fits.open(path) as file:
        return [(c.name, c.format, c.unit) for c in file[1].columns]


def test_every_file_is_written_and_they_agree(orion, tmp_path, capsys) -> None:
    assert solve_field("--no-plots", "--overwrite", "-L", "10", "-H", "20", "-u", "dw", orion) == 0
    said = told(capsys.readouterr().out)
    assert said["centre"] == pytest.approx(CENTRE, abs=0.01)
    made = {path.name for path in tmp_path.iterdir()} - {"orion.png"}
    assert made == {f"orion{ending}" for ending in OUTPUTS.values()}
    assert (tmp_path / "orion.solved").read_bytes() == b"\x01"
    header = fits.Header.fromtextfile(tmp_path / "orion.wcs")
    del header["NAXIS"]
    of_file, of_copy = WCS(header), WCS(fits.getheader(tmp_path / "orion.new"))
    corr = fits.getdata(tmp_path / "orion.corr")
    stars = SkyCoord(corr["index_ra"], corr["index_dec"], unit="deg")
    for wcs in (of_file, of_copy):
        seen = SkyCoord(*wcs.all_pix2world(corr["field_x"], corr["field_y"], 1), unit="deg")
        assert np.median(stars.separation(seen).arcsec) < 0.3 * 50
        there = SkyCoord(*wcs.all_pix2world(corr["index_x"], corr["index_y"], 1), unit="deg")
        assert stars.separation(there).arcsec.max() < 1.0
    rdls, xyls, axy = (fits.getdata(tmp_path / f"orion{e}") for e in (".rdls", "-indx.xyls", ".axy"))
    assert np.array_equal(rdls["RA"][corr["index_id"]], corr["index_ra"])
    assert np.array_equal(xyls["X"], corr["index_x"])
    assert axy["X"][corr["field_id"]] == pytest.approx(corr["field_x"], abs=1e-3)
    match = fits.getdata(tmp_path / "orion.match")[0]
    assert (match["NMATCH"], match["NINDEX"], match["DIMQUADS"]) == (len(corr), len(corr), 4)
    assert match["QUADPIX"][:2] == pytest.approx(
        (corr["field_x"][match["STARS"][0]], corr["field_y"][match["STARS"][0]])
    )
    assert match["CRVAL"] == pytest.approx(said["centre"], abs=1e-5)


def test_names_of_the_caller_and_none(orion, tmp_path, capsys) -> None:
    nothing = [f"--{name}=none" for name in OUTPUTS if name not in ("wcs", "rdls")]
    assert solve_field("-O", "-D", tmp_path, "-o", "base", "-W", tmp_path / "x.wcs", *nothing, orion) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"orion.png", "x.wcs", "base.rdls"}


def test_a_list_of_stars_is_solved_as_kstars_sends_it(orion, tmp_path, capsys) -> None:
    assert solve_field(orion) == 0
    stars = fits.getdata(tmp_path / "orion.axy")
    table = fits.BinTableHDU.from_columns(
        [
            fits.Column("X_IMAGE", "1E", array=stars["X"]),
            fits.Column("Y_IMAGE", "1E", array=stars["Y"]),
            fits.Column("MAG_AUTO", "1E", array=-2.5 * np.log10(stars["FLUX"])),
        ]
    )
    table.writeto(tmp_path / "k.xyls")
    # The list of StellarSolver 2.4, externalextractorsolver.cpp.
    asked = ["-O", "--no-plots", "--no-verify", "--crpix-center", "--resort", "--depth", "1-50", "--objs", "150"]
    asked += ["--match", "none", "--corr", "none", "--new-fits", "none", "--rdls", "none", "-vv", "--uniformize", "0"]
    asked += ["--odds-to-solve", "1e+09", "--odds-to-tune-up", "1e+06", "--no-remove-lines"]
    asked += ["--x-column", "X_IMAGE", "--y-column", "Y_IMAGE", "--sort-column", "MAG_AUTO", "--sort-ascending"]
    asked += ["--width", "1080", "--height", "720", "-L", "14", "-H", "16", "-u", "degwidth"]
    asked += [
        "-3",
        "84",
        "-4",
        "-1.5",
        "-5",
        "15",
        "--backend-config",
        "/nowhere.cfg",
        "--cancel",
        str(tmp_path / "stop"),
    ]
    capsys.readouterr()
    assert solve_field(*asked, "-W", tmp_path / "k.wcs", tmp_path / "k.xyls") == 0
    assert told(capsys.readouterr().out)["centre"] == pytest.approx(CENTRE, abs=0.01)
    assert (tmp_path / "k.solved").exists()
    assert not (tmp_path / "k.new").exists()  # there is no image to copy


def test_ccdciel_finds_what_it_looks_for(orion, tmp_path, capsys) -> None:
    """Its call from cu_astrometry_engine.pas: the new FITS where it says, .solved beside the image."""
    asked = ["--overwrite", "--scale-low", "45", "--scale-high", "55", "--scale-units", "arcsecperpix"]
    asked += ["--ra", "84", "--dec", "-1.5", "--radius", "15", "--objs", "50", "--downsample", "2", "--no-plots"]
    assert solve_field(*asked, "--new-fits", tmp_path / "out.fits", orion) == 0
    assert fits.getheader(tmp_path / "out.fits")["CTYPE1"].startswith("RA---TAN")
    assert (tmp_path / "orion.solved").exists()


@pytest.mark.parametrize(
    ("bound", "why"),
    [
        (["-L", "20", "-H", "30"], "field of view differs"),
        (["-L", "1", "-H", "2", "-u", "app"], "field of view differs"),
        (["-L", "20", "-H", "30", "-u", "focalmm"], "field of view differs"),
        (["--ra", "5:36:00", "--dec", "-11", "--radius", "5"], "outside the search radius"),
    ],
)
def test_bounds_refuse_and_leave_no_mark(orion, tmp_path, capsys, bound, why) -> None:
    assert solve_field(orion) == 0
    capsys.readouterr()
    assert solve_field("--overwrite", *bound, orion) == 0
    said = capsys.readouterr().out
    assert "Did not solve" in said
    assert why in said
    # What told of the solve before is gone.
    assert {path.name for path in tmp_path.iterdir()} == {"orion.png", "orion.axy"}


def test_files_are_kept_unless_one_says_so(orion, tmp_path, capsys) -> None:
    (tmp_path / "orion.corr").write_text("mine")
    assert solve_field(orion) == 0
    assert "--overwrite" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {"orion.png", "orion.corr"}
    assert solve_field("--continue", orion) == 0
    assert (tmp_path / "orion.corr").read_text() == "mine"
    assert (tmp_path / "orion.wcs").exists()
    assert solve_field("--overwrite", "--new-fits", orion, orion) == 255
    assert "never overwritten" in capsys.readouterr().err
    assert Path(orion).read_bytes() == (SAMPLES / "orion.png").read_bytes()


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        (["--kmz", "a.kmz", "x.png"], "Kochab has no KMZ files (--kmz)."),
        (["--verify", "a.wcs", "x.png"], "Kochab has no verifying of a WCS file (--verify)."),
        (["--nonsense", "x.png"], "Option --nonsense not recognized."),
        (["--scale-units", "furlongs", "x.png"], "furlongs is none of the units"),
        (["-L", "wide", "x.png"], "--scale-low wide is not a number"),
        (["-L", "9", "-H", "2", "x.png"], "--scale-low is more than --scale-high."),
        (["--ra", "30h", "--dec", "2", "x.png"], "30h is not a right ascension"),
        (["--wcs", "one.wcs", "x.png", "y.png"], "--wcs one.wcs is one name for 2 files"),
        (["x.png"], "x.png does not exist."),
        (["x.xyls"], f"x.xyls cannot be read: {'' if os.name == 'nt' else 'No such file or directory.'}"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_sentence(tmp_path, monkeypatch, capsys, asked, sentence) -> None:
    monkeypatch.chdir(tmp_path)
    assert solve_field(*asked) == 255
    assert capsys.readouterr().err.startswith(f"kochab: {sentence}")


@pytest.mark.parametrize("spoilt", ["text", "no table", "column", "cut", "size", "outside"])
def test_a_damaged_list_costs_a_sentence(tmp_path, capsys, spoilt) -> None:
    path = tmp_path / "a.xyls"
    place = np.linspace(1, 500, 60) + 9000 * (spoilt == "outside")
    names = ("X", "Z") if spoilt == "column" else ("X", "Y")
    table = fits.BinTableHDU.from_columns([fits.Column(name, "1E", array=place) for name in names])
    (fits.PrimaryHDU() if spoilt == "no table" else table).writeto(path)
    if spoilt in ("text", "cut"):
        path.write_bytes(b"1,2\n" if spoilt == "text" else path.read_bytes()[:5000])
    size = [] if spoilt == "size" else ["--width", "500", "--height", "500"]
    assert solve_field(*size, path) == 255
    said = capsys.readouterr().err
    assert said.startswith(f"kochab: {path}")
    assert said.count("\n") == 1


def test_a_file_that_appears_cancels(orion, tmp_path, capsys) -> None:
    (tmp_path / "stop").touch()
    assert solve_field("--cancel", tmp_path / "stop", orion) == 255
    assert "Cancelled" in capsys.readouterr().err
    assert not (tmp_path / "orion.solved").exists()


@needs_astrometry
@pytest.mark.parametrize("name", ["orion.png", *WIDE])
def test_files_have_the_columns_of_debians_and_the_answer_is_the_same(tmp_path, shared_frames, capsys, name) -> None:
    source = SAMPLES / name if name == "orion.png" else shared_frames / name
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    for folder in (ours, theirs):
        folder.mkdir()
        shutil.copy(source, folder / name)
    asked = [SOLVE_FIELD, "--no-plots", "--downsample", "2", "--cpulimit", "60", name]
    done = subprocess.run(asked, cwd=theirs, capture_output=True, text=True, timeout=250)
    base = Path(name).stem
    assert (theirs / f"{base}.solved").exists(), done.stdout
    assert solve_field("--no-plots", ours / name) == 0
    said, expected = told(capsys.readouterr().out), told(done.stdout)
    scale = expected["size"][0]
    assert {path.name for path in ours.iterdir()} == {path.name for path in theirs.iterdir()}
    for ending in (".axy", ".corr", ".rdls", "-indx.xyls"):
        assert columns(ours / f"{base}{ending}") == columns(theirs / f"{base}{ending}"), ending
    both = [columns(folder / f"{base}.match") for folder in (ours, theirs)]
    # The name of the field is as long as it happens to be.
    assert [c for c in both[0] if c[0] != "FIELDNAME"] == [c for c in both[1] if c[0] != "FIELDNAME"]
    away = SkyCoord(*said["centre"], unit="deg").separation(SkyCoord(*expected["centre"], unit="deg")).deg
    assert away < 0.01 * scale
    assert said["size"] == pytest.approx(expected["size"], rel=0.03)
    assert said["parity"] == expected["parity"]
    header = fits.getheader(theirs / f"{base}.wcs")
    del header["NAXIS"]  # there is no image in it, which astropy would remark upon
    # Theirs is the turn at the reference point of their WCS, where north lies another way than at the centre.
    converged = (header["CRVAL1"] - said["centre"][0]) * math.sin(math.radians(said["centre"][1]))
    turned = math.remainder(said["turn"][0] - expected["turn"][0], 360.0)
    assert abs(turned) == pytest.approx(abs(converged), abs=0.7)
    # Their WCS puts the stars that we matched where we say that they are.
    corr = fits.getdata(ours / f"{base}.corr")
    wcs = WCS(header)
    theirs_px = np.stack(wcs.all_world2pix(corr["index_ra"], corr["index_dec"], 1, quiet=True), axis=1)
    ours_px = np.stack([corr["field_x"], corr["field_y"]], axis=1)
    assert np.median(np.hypot(*(theirs_px - ours_px).T)) < 3.0


def test_the_list_is_kept_under_the_name_given(orion, tmp_path, capsys) -> None:
    """StellarSolver asks for it, and counts its rows."""
    assert solve_field("--no-plots", "--axy", "none", "--keep-xylist", tmp_path / "k.xyls", orion) == 0
    with fits.open(tmp_path / "k.xyls") as file:
        assert {"X", "Y", "FLUX", "BACKGROUND"} <= set(file[1].columns.names)
        assert len(file[1].data) > 400
    assert not (tmp_path / "orion.axy").exists()


def test_a_list_of_stars_is_solved_as_siril_sends_it(orion, tmp_path, capsys, monkeypatch) -> None:
    """``local_asnet_platesolve`` and ``save_list_as_FITS_table`` of Siril 1.4: what it sends, and what it reads then."""
    stars = kochab.detect(orion)
    arrays = {"X": stars.xy[:, 0] + 1.0, "Y": stars.xy[:, 1] + 1.0, "FLUX": stars.flux, "BACKGROUND": 0.0 * stars.flux}
    table = fits.BinTableHDU.from_columns([fits.Column(name, "1E", array=a[::-1]) for name, a in arrays.items()])
    table.header["IMAGEW"], table.header["IMAGEH"] = stars.width, stars.height
    table.writeto(tmp_path / "orion.xyls")
    monkeypatch.chdir(tmp_path)
    assert solve_field("-h") == 0  # is it there?
    capsys.readouterr()
    nothing = ["-N", "none", "-R", "none", "-M", "none", "-B", "none", "-U", "none", "-S", "none"]
    asked = ["-C", "stop", "--temp-axy", "-p", "-O", *nothing, "--crpix-center", "-l", "30", "-u", "arcsecperpix"]
    asked += ["-L", "40.000", "-H", "60.000", "-s", "FLUX", "-t", "3"]
    asked += ["--ra", "84.500000", "--dec", "-1.000000", "--radius", "10.0"]
    assert solve_field(*asked, "orion.xyls") == 0
    out = capsys.readouterr().out
    assert any(line.startswith("Field center: (RA,Dec)") for line in out.splitlines())
    assert {path.name for path in tmp_path.iterdir()} == {"orion.png", "orion.xyls", "orion.wcs"}
    with fits.open("orion.wcs") as file:  # Siril reads it with cfitsio, as any FITS
        header = file[0].header
        del header["NAXIS"]
        assert WCS(header).pixel_to_world_values(539.5, 359.5) == pytest.approx((84.0, -1.5), abs=0.01)
    assert solve_field(*asked, "--radius", "0.5", "orion.xyls") == 0
    assert any(line.startswith("Did not solve") for line in capsys.readouterr().out.splitlines())


def test_a_file_that_is_solved_is_skipped_when_that_is_asked(orion, tmp_path, capsys) -> None:
    """Scripts send it with ``--overwrite``: the ``.solved`` of before then counts."""
    asked = ["--no-plots", "--overwrite", "--skip-solved", orion]
    assert solve_field(*asked) == 0
    (tmp_path / "orion.wcs").unlink()
    capsys.readouterr()
    assert solve_field(*asked) == 0
    assert "orion.solved" in capsys.readouterr().out
    assert not (tmp_path / "orion.wcs").exists()


@pytest.mark.parametrize(("asked", "off_px", "said"), [(True, 12.0, True), (True, 0.3, False), (False, 12.0, False)])
def test_a_reference_point_that_stays_off_the_centre_is_said_to_who_asked_for_the_centre(
    asked, off_px, said, capsys
) -> None:
    camera = replace(Camera.centred(1000, 800, 2000.0), cy=399.5 + off_px)
    solution = Solution(camera, attitude_from(10.0, 20.0, 30.0), (), 0.2, -30.0, "test")
    order = SimpleNamespace(options={"crpix-center": None} if asked else {})
    assert _with_wcs(order, {"wcs": "", "new-fits": ""}, "a.png", None, solution) == []
    assert ("12 px off the frame's centre" in "".join(capsys.readouterr())) is said
