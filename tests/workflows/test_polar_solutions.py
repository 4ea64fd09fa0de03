"""Saved solutions give the same axis as their images; what the headers leave open is reported."""

import json
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from astropy.io import fits
from astropy.wcs import WCS
from scipy.spatial.transform import Rotation

from kochab.cli.main import main
from kochab.core.attitude import Attitude
from kochab.core.camera import Camera, FisheyeCamera
from kochab.core.errors import FrameError
from kochab.core.frame import Site
from kochab.core.solution import NamedStar, Solution
from kochab.frames.hints import NO_ZONE
from kochab.frames.wcs import wcs_text, write_wcs
from kochab.polar.measure import MeasureSettings, PolarFindingKind, measure
from kochab.polar.pole import Pole
from kochab.polar.sighting import Sighting
from kochab.workflows.polar.site_and_clock import doubts_of
from kochab.workflows.polar.solutions import solved_before
from kochab.workflows.polar.sources import SolvedFile, sharpcap_time, sightings_of, unsigned_longitude
from kochab.workflows.solution_json import as_json
from tests.house import REPOSITORY, SAMPLES

ARCSEC = np.pi / 648000.0
SHARED = REPOSITORY.parent / "shared"
BEGUN = datetime(2026, 3, 14, 20, 0, tzinfo=UTC)
SITE = Site(47.0, 8.0, 450.0)
CAMERA = Camera(900, 700, 8000.0, 452.3, 347.1, k1=-0.4, mirrored=True)


def solution(turn_deg, camera=CAMERA):
    """A frame of a mount that turned about an axis half a degree from the pole, tracking left out: it is the sky's."""
    axis = Rotation.from_euler("y", 0.5, degrees=True).apply([0.0, 0.0, 1.0])
    turned = Rotation.from_rotvec(axis * np.radians(turn_deg)).as_matrix()
    matrix = Rotation.from_euler("xyz", [40.0, 15.0, 70.0], degrees=True).as_matrix() @ turned
    attitude = Attitude(matrix, np.diag(np.square([1.0, 1.5, 9.0]) * ARCSEC**2))
    sky = Solution(camera, attitude, (), 0.2, -30.0, "patterns")
    x, y = np.meshgrid(np.linspace(20, 880, 5), np.linspace(20, 680, 4))
    pixels = np.stack([x.ravel(), y.ravel()], axis=-1)
    v = sky.sky_at(pixels)
    ra, dec = np.degrees(np.arctan2(v[:, 1], v[:, 0])) % 360.0, np.degrees(np.arcsin(v[:, 2]))
    stars = (
        NamedStar(*map(float, p), f"HIP {k}", "", 5.0, float(r), float(d), 0.1)
        for k, (p, r, d) in enumerate(zip(pixels, ra, dec, strict=True))
    )
    return replace(sky, stars=tuple(stars))


def apart_px(one, other):
    """How far two solutions put the sky of the frame's corners and middle apart."""
    pixels = np.array([[0.0, 0.0], [899.0, 0.0], [450.0, 350.0], [0.0, 699.0], [899.0, 699.0]])
    return np.abs(other.pixels_of(one.sky_at(pixels)) - pixels).max()


def picture(path, moment):
    fits.PrimaryHDU(np.zeros((8, 8), np.uint16)).writeto(path)
    fits.setval(path, "DATE-OBS", value=moment.isoformat().removesuffix("+00:00"))


def test_json_comes_back_as_the_solution_it_was(tmp_path):
    given = [solution(turn) for turn in (0.0, 30.0)]
    for k in range(2):
        picture(tmp_path / f"{k}.fits", BEGUN + timedelta(minutes=k))
    lines = [json.dumps(as_json(f"{k}.fits", each)) for k, each in enumerate(given)]
    (tmp_path / "night.json").write_text("\n".join(lines) + "\n")
    files = solved_before(tmp_path / "night.json")
    assert [f.time_utc for f in files] == [BEGUN, BEGUN + timedelta(minutes=1)]
    for one, file in zip(given, files, strict=True):
        assert file.result.camera == one.camera
        assert np.abs(file.result.attitude.matrix - one.attitude.matrix).max() < 1e-12
        assert np.allclose(np.diag(file.result.attitude.covariance), np.diag(one.attitude.covariance))
        assert len(file.result.stars) == 20


@pytest.mark.parametrize("mirrored", [True, False])
def test_a_wcs_is_the_map_it_says(tmp_path, mirrored):
    one = solution(10.0, replace(CAMERA, mirrored=mirrored))
    write_wcs(one, tmp_path / "a.wcs")
    picture(tmp_path / "a.fits", BEGUN)
    (file,) = solved_before(tmp_path / "a.wcs")
    assert file.time_utc == BEGUN
    assert file.result.camera.mirrored is mirrored
    assert apart_px(one, file.result) < 0.05
    assert file.result.attitude.sigma_arcsec[0] == pytest.approx(0.2 * one.camera.scale_arcsec_px, rel=0.05)


def test_a_fisheye_comes_back_as_one(tmp_path):
    lens = FisheyeCamera(1600, 1200, 650.0, 803.0, 595.0, -0.02, 0.003)
    one = solution(10.0, lens)
    (tmp_path / "night.json").write_text(json.dumps(as_json("a.fits", one)) + "\n")
    write_wcs(one, tmp_path / "a.wcs")
    picture(tmp_path / "a.fits", BEGUN)
    (of_json,) = solved_before(tmp_path / "night.json")
    assert of_json.result.camera == lens
    (of_wcs,) = solved_before(tmp_path / "a.wcs")
    assert isinstance(of_wcs.result.camera, FisheyeCamera)
    pixels = np.array([[800.0, 600.0], [300.0, 200.0], [1200.0, 1000.0]])
    assert np.abs(of_wcs.result.pixels_of(one.sky_at(pixels)) - pixels).max() < 0.3


def test_a_header_of_another_program_needs_no_picture(tmp_path):
    """Cards without line ends, FITS as astrometry.net writes it, with the time in it."""
    wcs = WCS(naxis=2)
    wcs.wcs.ctype, wcs.wcs.crval, wcs.wcs.crpix = ["RA---TAN", "DEC--TAN"], [120.0, 35.0], [800.5, 600.5]
    wcs.wcs.cd = np.array([[-0.3, 0.5], [0.5, 0.3]]) / 1000.0
    header = wcs.to_header()
    header["IMAGEW"], header["IMAGEH"], header["DATE-OBS"], header["EXPTIME"] = 1600, 1200, "2026-03-14T19:59:50", 20.0
    fits.PrimaryHDU(header=header).writeto(tmp_path / "net.wcs")
    (file,) = solved_before(tmp_path / "net.wcs")
    assert file.time_utc == BEGUN
    assert file.result.ra_dec_deg == pytest.approx((120.0, 35.0), abs=1e-6)
    pixel = file.result.pixels_of(file.result.sky_at(np.array([[1500.0, 100.0]])))
    assert pixel[0] == pytest.approx([1500.0, 100.0], abs=0.01)
    ra, dec = wcs.all_pix2world(1500.0, 100.0, 0)
    v = file.result.sky_at(np.array([[1500.0, 100.0]]))[0]
    assert np.degrees(np.arctan2(v[1], v[0])) == pytest.approx(float(ra), abs=1e-5)
    assert np.degrees(np.arcsin(v[2])) == pytest.approx(float(dec), abs=1e-5)


@pytest.mark.parametrize("text", ["", "SIMPLE  =                    T", "nothing", "{}", "[1, 2]", '{"solved": true}'])
@pytest.mark.parametrize("suffix", ["wcs", "json"])
def test_what_holds_no_solution_is_one_sentence(tmp_path, text, suffix):
    path = tmp_path / f"a.{suffix}"
    path.write_text(text)
    with pytest.raises(FrameError) as told:
        solved_before(path)
    assert str(path) in str(told.value)
    assert "\n" not in str(told.value)


def test_the_command_takes_solutions_and_a_clock_that_is_ahead(tmp_path, capsys):
    for k in range(3):
        write_wcs(solution(25.0 * k), tmp_path / f"{k}.wcs")
        picture(tmp_path / f"{k}.fits", BEGUN + timedelta(hours=2, minutes=k))
    names = [str(tmp_path / f"{k}.wcs") for k in range(3)]
    told = {}
    for offset in ("0", "2"):
        main(["polar", *names, "--site=47,8,450", "--json", f"--utc-offset={offset}"])
        told[offset] = json.loads(capsys.readouterr().out)
    sightings = [Sighting.of(solution(25.0 * k), BEGUN + timedelta(minutes=k), f"{k}.wcs") for k in range(3)]
    truth = measure(sightings, MeasureSettings(SITE)).error
    assert told["2"]["altitude_error_arcsec"] == pytest.approx(truth.altitude_arcsec, abs=10.0)
    assert abs(told["0"]["altitude_error_arcsec"] - truth.altitude_arcsec) > 300.0
    assert "clock" not in [f["code"] for f in told["2"]["findings"]]


# -- What headers leave open ------------------------------------------------------------------------


def files_of(**changed):
    return [
        replace(SolvedFile(f"{k}.jpg", solution(25.0 * k), BEGUN + timedelta(minutes=k), SITE), **changed)
        for k in range(3)
    ]


def doubts(files, site=SITE, site_given=False, zone_given=False):
    found = measure(sightings_of(files, [0] * 3), MeasureSettings(site))
    return {d.kind: d for d in doubts_of(files, found.error, found.settings.site, site_given, zone_given)}


def test_an_hour_is_doubted_where_it_moves_the_axis_past_its_ellipse():
    plain, zoneless = (doubts(files_of()), doubts(files_of(warnings=(NO_ZONE,))))
    assert not plain[PolarFindingKind.CLOCK].spoils
    assert zoneless[PolarFindingKind.CLOCK].spoils
    total = measure(sightings_of(files_of(), [0] * 3), MeasureSettings(SITE, Pole.TRUE)).error.total_arcsec
    moved = float(re.search(r"axis by ([\d.]+)′", plain[PolarFindingKind.CLOCK].text)[1])
    assert moved == pytest.approx(2.0 * np.sin(np.radians(7.52)) * total / 60.0, abs=0.1)
    assert doubts(files_of(), zone_given=True) == {}


def test_an_hour_is_no_matter_on_the_pole():
    found = measure(sightings_of(files_of(), [0] * 3), MeasureSettings(SITE))
    aligned = replace(found, error=replace(found.error, axis=found.error.pole))
    assert doubts_of(files_of(), aligned.error, aligned.settings.site, False, False) == []


def test_a_longitude_without_a_sign_is_not_believed():
    files = files_of(unsigned="LONGITUD 8.0")
    told = doubts(files, zone_given=True)[PolarFindingKind.LONGITUDE_SIGN]
    assert told.spoils
    assert "LONGITUD 8.0" in told.text
    assert doubts(files, site_given=True, zone_given=True) == {}
    assert doubts(files_of(), zone_given=True) == {}


@pytest.mark.parametrize(
    ("header", "unsigned"),
    [
        ({"LONGITUD": 111.6}, True),
        ({"LONG-OBS": "111 35 56"}, True),
        ({"LONGITUD": -111.6}, False),
        ({"LONGITUD": "+111 36"}, False),
        ({"LONGITUD": "111 36 W"}, False),
        ({"SITELONG": 111.6}, False),
        ({"OBSGEO-L": 111.6, "LONGITUD": 111.6}, False),
        ({"LONGITUD": 0.0}, False),
        ({}, False),
    ],
)
def test_which_longitudes_may_be_west(header, unsigned):
    assert bool(unsigned_longitude(header)) is unsigned


def test_sharpcap_says_when_beside_its_pictures(tmp_path):
    (tmp_path / "a.CameraSettings.txt").write_text("[ZWO]\nExposure=3\nTimeStamp=2021-05-30T22:31:15.1148009Z\n")
    assert sharpcap_time(tmp_path / "a.png") == datetime(2021, 5, 30, 22, 31, 15, 114800, UTC)
    assert sharpcap_time(tmp_path / "b.png") is None


def test_a_last_frame_back_at_the_start_is_offered_while_creep_may_hide(tmp_path, capsys):
    """Frames in even steps of angle and time; the one at the start again shows what the tripod did."""
    names = []
    for k, turn in enumerate((0.0, 30.0, 60.0, 0.0)):
        write_wcs(solution(turn - k * 0.25), tmp_path / f"{k}.wcs")
        picture(tmp_path / f"{k}.fits", BEGUN + timedelta(minutes=k))
        names.append(str(tmp_path / f"{k}.wcs"))
    out = []
    for given in (names[:3], names):
        main(["polar", *given, "--site=47,8,450", "--utc-offset=0"])
        out.append(capsys.readouterr().out)
    assert "turn RA back to the start, one more frame: checks for slip" in out[0]
    assert "back at the start" not in out[1]


@pytest.mark.parametrize("mark", [{"PLTSOLVD": True}, {"HISTORY": "Created by the Astrometry.net suite."}, {}])
def test_a_frame_without_stars_counts_as_another_solver_left_it_and_a_mounts_guess_does_not(tmp_path, capsys, mark):
    for k in range(3):
        one = solution(25.0 * k)
        header = fits.Header.fromstring(wcs_text(one).replace("\n", " ").split("END ")[0])
        for card in [c for c in header if c in ("SIMPLE", "BITPIX", "NAXIS", "IMAGEW", "IMAGEH", "PLTSOLVD")]:
            del header[card]
        header["DATE-OBS"] = (BEGUN + timedelta(minutes=k)).isoformat().removesuffix("+00:00")
        for key, value in mark.items():
            header[key] = value
        fits.PrimaryHDU(np.full((700, 900), 500, np.uint16), header).writeto(tmp_path / f"{k}.fits")
    names = [str(tmp_path / f"{k}.fits") for k in range(3)]
    code = main(["polar", *names, "--site=47,8,450", "--json", "--utc-offset=0"])
    told = json.loads(capsys.readouterr().out)
    if not mark:
        assert code == 1
        assert "no solution" in told["error"]
        return
    sightings = [Sighting.of(solution(25.0 * k), BEGUN + timedelta(minutes=k), f"{k}.fits") for k in range(3)]
    truth = measure(sightings, MeasureSettings(SITE)).error
    assert told["altitude_error_arcsec"] == pytest.approx(truth.altitude_arcsec, abs=10.0)
    assert sum("0.2 px is assumed" in text for text in told["warnings"]) == 3


def test_a_tripod_on_the_same_marks_is_told_where_it_stood(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "config"))

    def night(days, *more):
        for k in range(3):
            write_wcs(solution(25.0 * k), tmp_path / f"{k}.wcs")
            (tmp_path / f"{k}.fits").unlink(missing_ok=True)
            picture(tmp_path / f"{k}.fits", BEGUN + timedelta(days=days, minutes=k))
        names = [str(tmp_path / f"{k}.wcs") for k in range(3)]
        code = main(["polar", *names, "--site=47,8,450", "--utc-offset=0", "--json", *more])
        return code, json.loads(capsys.readouterr().out)

    assert main(["polar", "--site=47,8"]) == 2
    assert "Nothing was measured there yet" in capsys.readouterr().err
    first = night(0)[1]
    assert first["last_night"] is None
    assert night(0)[1]["last_night"] is None  # of the same night
    second = night(2)[1]
    assert second["last_night"]["altitude_arcsec"] == pytest.approx(first["altitude_error_arcsec"])
    assert second["last_night"]["time_utc"].startswith("2026-03-14")
    assert night(4, "--site=47.2,8")[1]["last_night"] is None  # another place
    assert night(1)[1]["last_night"] is None  # an earlier night never takes a later one's place
    assert main(["polar", "--site=47,8", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["last_night"]["time_utc"].startswith("2026-03-16")
    assert main(["polar", "--site=47,8"]) == 0
    assert "if the tripod stands on the same marks" in capsys.readouterr().out
    for damaged in ("[{}]", "{", '[{"latitude_deg": "x"}]'):
        (tmp_path / "config" / "polar-nights.json").write_text(damaged)
        assert main(["polar", "--site=47,8"]) == 2


def test_a_spoilt_measurement_is_not_remembered(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "config"))
    for k in range(2):
        write_wcs(solution(1.0 * k), tmp_path / f"{k}.wcs")
        picture(tmp_path / f"{k}.fits", BEGUN + timedelta(seconds=20 * k))
    main(["polar", *(str(tmp_path / f"{k}.wcs") for k in range(2)), "--site=47,8,450", "--utc-offset=0", "--json"])
    assert json.loads(capsys.readouterr().out)["spoilt"]
    assert not (tmp_path / "config").exists()


# -- Files that somebody altered --------------------------------------------------------------------


HOSTILE = (
    "in_2_432_wcs_w.wcs",
    "in_2_438_wcs_w.wcs",
    "in_2_622_sjl_q.jsonl",
    "in_2_764_sjl_q.jsonl",
    "in_2_798_omm_e.json",
)


@pytest.mark.skipif(not (SHARED / "hostile").is_dir(), reason="../shared/hostile is not beside this checkout")
@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_made_outside_are_one_sentence(name, capsys):
    """Cards that are no ASCII or zeros, Infinity, null places, objects nested by the thousand."""
    path = SHARED / "hostile" / name
    elements = path.suffix == ".json"
    command = ["solve", str(SAMPLES / "pleiades.fits"), "--elements"] if elements else ["polar", "--site", "47,8"]
    assert main([*command, str(path), *([] if elements else [str(path)])]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == (1 if elements else 2)
    assert all(path.name in line and line.endswith(".") and "fault" not in line for line in said)


def altered_lines(**changed):
    row = json.loads(json.dumps(as_json("0.fits", solution(0.0))))
    return json.dumps(row | {"time_utc": BEGUN.isoformat()} | changed)


PINHOLE = as_json("0.fits", solution(0.0))["camera"]
STAR = as_json("0.fits", solution(0.0))["stars"][3]


@pytest.mark.parametrize(
    "changed",
    [
        {"camera": None},
        {"camera": PINHOLE | {"focal_px": 0.0}},
        {"camera": PINHOLE | {"k1": 1e300}},
        {"camera": PINHOLE | {"aspect": 0.05}, "stars": []},
        {"camera": PINHOLE | {"aspect": 20.0}, "stars": []},
        {"fov_deg": [180.0, 5.0]},
        {"fov_deg": [1e-9, 5.0]},
        {"fov_deg": [370.0, 5.0], "stars": []},
        {"fov_deg": 5.0},
        {"dcm": np.diag([1.0, 1.0, -1.0]).tolist()},
        {"dcm": (1.1 * np.eye(3)).tolist()},
        {"dcm": [[0.0] * 3] * 3},
        {"sigma_arcsec": [0.0, 1.0, 1.0]},
        {"sigma_arcsec": [None, 1.0, 1.0]},
        {"stars": [{**STAR, "ra_deg": None}]},
        {"stars": [{**STAR, "dec_deg": -STAR["dec_deg"]}]},
        {"stars": [{**STAR, "x": 1e300}]},
        {"stars": 7},
        {"rms_px": None},
        {"solved": "yes"},
    ],
)
def test_a_solution_that_no_camera_gives_is_refused(tmp_path, changed):
    (tmp_path / "a.jsonl").write_text(altered_lines() + "\n")
    assert len(solved_before(tmp_path / "a.jsonl")) == 1
    (tmp_path / "a.jsonl").write_text(altered_lines(**changed) + "\n")
    with pytest.raises(FrameError, match=r"^\S*a\.jsonl(: line 1)? is not what kochab solve --json prints"):
        solved_before(tmp_path / "a.jsonl")


@pytest.mark.parametrize("name", ["x" * 5000, "\0", [0] * 300])
def test_a_name_that_no_picture_has_costs_nothing(tmp_path, name):
    (tmp_path / "a.jsonl").write_text(altered_lines(file=name, time_utc="") + "\n")
    (file,) = solved_before(tmp_path / "a.jsonl")
    assert file.time_utc is None


def test_lines_that_powershell_wrote_are_read(tmp_path):
    (tmp_path / "a.jsonl").write_bytes((altered_lines() + "\r\n").encode("utf-16"))
    assert len(solved_before(tmp_path / "a.jsonl")) == 1


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("IMAGEW", "'wide'"),
        ("IMAGEW", "1e9"),
        ("CRVAL1", "'x'"),
        ("CRVAL1", "1e300"),
        ("CTYPE2", "'RA---TAN'"),
        ("CTYPE1", "5"),
        ("WCSAXES", "1000000"),
        ("A_ORDER", "100000"),
        ("A_ORDER", "'x'"),
        ("CD1_1", "0"),
        ("CD1_1", "٣"),
    ],
)
def test_a_header_that_no_camera_gives_is_refused(tmp_path, name, value):
    cards = wcs_text(solution(10.0)).splitlines()
    row = next(k for k, card in enumerate(cards) if card[:8].rstrip() == name)
    cards[row] = f"{name:8}= {value:>20}".ljust(79)
    if name == "CD1_1":  # with its neighbours gone the matrix has no inverse
        cards = [card for card in cards if card[:8].rstrip() not in ("CD1_2", "CD2_1")]
    (tmp_path / "a.wcs").write_text("\n".join(cards), encoding="utf-8")
    with pytest.raises(FrameError, match=r"a\.wcs has no (usable )?WCS"):
        solved_before(tmp_path / "a.wcs")


def test_a_colour_images_third_axis_is_no_obstacle(tmp_path):
    one = solution(10.0)
    cards = wcs_text(one).splitlines()
    cards[cards.index(next(c for c in cards if c.startswith("WCSAXES")))] = f"{'WCSAXES':8}= {3:>20}"
    third = {"CTYPE3": "'RGB     '", "CRVAL3": 1.0, "CRPIX3": 1.0, "CDELT3": 1.0}
    cards[5:5] = [f"{name:8}= {value:>20}" for name, value in third.items()]
    (tmp_path / "a.wcs").write_text("\n".join(card.ljust(79) for card in cards))
    (file,) = solved_before(tmp_path / "a.wcs")
    assert apart_px(one, file.result) < 0.05


def test_a_map_that_no_camera_has_is_refused(tmp_path):
    """SIP of the third order that pulls the corners out by a frame's width."""
    cards = wcs_text(solution(10.0)).splitlines()
    for name in ("A_3_0", "B_0_3"):
        row = next(k for k, card in enumerate(cards) if card[:8].rstrip() == name)
        cards[row] = f"{name:8}= {1e-5 if name[0] == 'A' else -1e-5:>20}".ljust(79)
    (tmp_path / "a.wcs").write_text("\n".join(cards))
    with pytest.raises(FrameError, match=r"a\.wcs has no usable WCS"):
        solved_before(tmp_path / "a.wcs")
