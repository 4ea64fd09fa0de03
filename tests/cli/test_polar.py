"""``kochab polar`` on rendered frames of the practice rig, through detection and the solver."""

import json
import re
from types import SimpleNamespace

import erfa
import numpy as np
import pytest

from kochab.cli.main import main
from kochab.cli.polar import _measure
from kochab.core.attitude import Attitude
from kochab.core.camera import Camera
from kochab.core.frame import Site
from kochab.core.solution import Solution
from kochab.frames.fits_write import write_fits
from kochab.simulate.camera import CameraConfig
from kochab.simulate.mechanics.geometry import Build, MountConfig
from kochab.simulate.rig import PracticeRig, RigConfig
from kochab.workflows.polar.sources import last_night
from kochab.workflows.solution_json import as_json
from tests.polar.mounts import ARCSEC, Mount
from tests.polar.test_drift import falling, log_text

SITE, SITE_40 = Site(47.0, 8.0, 450.0), Site(40.0, 10.0, 300.0)


@pytest.fixture(scope="module")
def night(tmp_path_factory):
    """Three frames 30 degrees of turn apart, with tracking, and the truth; and a blank one."""
    folder = tmp_path_factory.mktemp("polar")
    rig = PracticeRig(
        RigConfig(
            seed=3,
            site=SITE,
            start_deg=(-65.0, 40.0),
            mount=MountConfig(misalignment_arcmin=(22.0, -35.0), german=False),
            camera=CameraConfig(width=900, height=700, fov_deg=6.0),
        )
    )
    files = []
    for k in range(3):
        if k:
            ra, dec = rig.mount.believed_deg()
            rig.mount.goto((ra - 30.0) % 360.0, dec)
            rig.wait_until_still(2.0)
        path = folder / f"sweep-{k}.fits"
        write_fits(rig.frame(2.0), path)
        files.append(str(path))
    blank = folder / "blank.fits"
    from kochab.core.frame import Frame

    write_fits(Frame(np.full((200, 300), 500, np.uint16)), blank)
    return rig, files, str(blank)


def polar(capsys, *arguments):
    code = main(["polar", *arguments])
    out, err = capsys.readouterr()
    return code, out, err


def test_the_axis_is_found_from_files_alone(night, capsys, tmp_path):
    rig, files, _ = night
    page = tmp_path / "night.html"
    code, out, err = polar(capsys, *files, "--json", "--pressure", "1010", "--report", str(page))
    assert code == 0, err
    told = json.loads(out)
    truth = rig.truth().axis_error()
    sigma_alt, sigma_az = told["sigma_arcsec"]
    assert told["altitude_error_arcsec"] == pytest.approx(truth.altitude_arcsec, abs=4 * sigma_alt)
    knob = sigma_az / np.cos(np.radians(47.0))
    assert told["azimuth_error_arcsec"] == pytest.approx(truth.azimuth_arcsec, abs=4 * knob)
    assert told["total_arcsec"] == pytest.approx(truth.total_arcsec, abs=4 * max(sigma_alt, sigma_az))
    assert max(sigma_alt, sigma_az) < 15.0
    assert told["pole"] == "refracted"
    assert told["turn_deg"] == pytest.approx(60.0, abs=0.5)
    assert told["frames"] == 3
    assert told["degrees_of_freedom"] == 2
    assert any("Flexure not measured" in text for text in told["warnings"])
    assert page.read_text("utf-8").startswith("<!doctype html>")
    assert json.loads(page.with_suffix(".json").read_text())["entries"][0]["kind"] == "measured"


def test_a_report_that_cannot_be_written_costs_no_number(night, capsys, tmp_path):
    _, files, _ = night
    page = tmp_path / "none" / "night.html"
    code, out, err = polar(capsys, *files[:2], "--json", "--report", str(page))
    assert code == 2
    assert json.loads(out)["frames"] == 2
    assert "Can't write" in err


def test_people_get_words_and_the_true_pole_is_lower(night, capsys):
    _, files, _ = night
    code, out, _ = polar(capsys, *files[:2], "--pole", "true", "--site", "47,8,450")
    assert code == 3
    assert "true north pole at altitude 47.00°" in out
    assert not re.search("lower the axis|rotate the mount", out), "two frames give no bolt advice"
    assert "bolts     not yet: a third frame first" in out
    assert re.search(r"2 frames over (29.9|30.[0-2]) deg of turn", out)
    assert "Two frames can't show whether only RA moved" in out
    _, out, _ = polar(capsys, *files, "--pole", "true", "--site", "47,8,450")
    assert "too high: lower the axis" in out
    assert "too far west: rotate the mount clockwise, seen from above" in out


def test_the_pole_changes_altitude_by_refraction(night, capsys):
    _, files, _ = night
    high = {}
    for pole in ("true", "half-way", "refracted"):
        _, out, _ = polar(capsys, *files, "--json", "--pole", pole)
        high[pole] = json.loads(out)["altitude_error_arcsec"]
    assert high["true"] - high["refracted"] == pytest.approx(52.0, abs=3.0)
    assert high["true"] - high["half-way"] == pytest.approx(26.0, abs=1.5)


def test_a_frame_without_an_answer_is_exit_1(night, capsys):
    _, files, blank = night
    code, out, err = polar(capsys, files[0], blank)
    assert (code, out) == (1, "")
    assert "blank.fits: no solution" in err
    code, out, _ = polar(capsys, files[0], blank, "--json")
    assert code == 1
    assert "no solution" in json.loads(out)["error"]


def test_every_file_that_cannot_be_used_is_told_at_once_in_one_document(night, capsys, tmp_path):
    _, files, blank = night
    text = tmp_path / "notes.fits"
    text.write_text("no picture")
    nowhere = str(tmp_path / "nowhere.fits")
    code, out, err = polar(capsys, files[0], str(text), blank, nowhere, "--json")
    assert (code, err) == (2, "")
    told = json.loads(out)
    assert [one["file"] for one in told["files"]] == [str(text), blank, nowhere]
    assert "no solution" in told["files"][1]["error"]
    assert all(one["error"] in told["error"] for one in told["files"])
    code, out, err = polar(capsys, files[0], str(text), blank, nowhere)
    assert (code, out) == (2, "")
    assert [
        name in line for name, line in zip(("notes.fits", "blank.fits", "nowhere.fits"), err.splitlines(), strict=True)
    ] == [True] * 3


def test_a_frame_that_does_not_say_when_is_told_in_json_too(night, capsys, tmp_path):
    from astropy.io import fits

    _, files, _ = night
    with fits.open(files[0]) as hdus:
        for key in [key for key in hdus[0].header if key.startswith("DATE")]:
            del hdus[0].header[key]
        path = tmp_path / "timeless.fits"
        hdus.writeto(path)
    code, out, err = polar(capsys, str(path), files[1], "--json")
    assert (code, err) == (2, "")
    assert "has no time" in json.loads(out)["error"]


def test_the_same_frame_twice_has_no_axis(night, capsys):
    _, files, _ = night
    code, _, err = polar(capsys, files[0], files[0])
    assert code == 1
    assert "rotated by only" in err


def test_what_is_missing_is_said_in_one_sentence(night, capsys, tmp_path):
    _, files, _ = night
    code, _, err = polar(capsys, files[0])
    assert code == 2
    assert "two frames" in err
    code, _, err = polar(capsys, *files, "--check", files[0])
    assert (code, "--check" in err) == (2, True)
    from astropy.io import fits

    for gone, words in (("DATE", "has no time"), ("SITE", "--site LAT,LON")):
        stripped = []
        for k, file in enumerate(files[:2]):
            with fits.open(file) as hdus:
                for key in [key for key in hdus[0].header if key.startswith((gone, "OBSGEO"))]:
                    del hdus[0].header[key]
                path = tmp_path / f"{gone}-{k}.fits"
                hdus.writeto(path)
                stripped.append(str(path))
        code, _, err = polar(capsys, *stripped)
        assert (code, words in err) == (2, True), err
        assert "Traceback" not in err
    assert polar(capsys, *stripped, "--site", "47,8,450")[0] == 3, "two frames"
    for site in ("47", "north", "91,0", "0,400", "47,8,99999", "nan,8"):
        code, _, err = polar(capsys, *files, "--site", site)
        assert code == 2
        assert "is not LAT,LON" in err


def test_a_second_sweep_is_weighed_with_the_first(night, capsys):
    _, files, _ = night
    _, out, _ = polar(capsys, *files, "--json")
    one = json.loads(out)
    code, out, _ = polar(capsys, *files, "--json", "--check", files[0], files[2])
    both = json.loads(out)
    assert code == 0
    assert both["frames"] == 5
    assert both["sigma_arcsec"][0] < one["sigma_arcsec"][0]
    # The same frames agree, and yet at one declination they tell nothing of flexure.
    assert any("too close in declination" in text for text in both["warnings"])


@pytest.fixture(scope="module")
def bent(tmp_path_factory):
    """Two sweeps of three frames at declinations 70 and 20, by hand, of a tube that sinks by 60"."""
    folder = tmp_path_factory.mktemp("bent")
    mount = MountConfig(misalignment_arcmin=(22.0, -35.0), build=Build(flexure_arcsec=60.0), german=False)
    camera = CameraConfig(width=900, height=700, fov_deg=6.0)
    rig = PracticeRig(RigConfig(seed=5, site=SITE, start_deg=(-50.0, 70.0), mount=mount, camera=camera))
    sweeps = []
    for sweep in range(2):
        sweeps.append([])
        for k in range(3):
            path = folder / f"sweep-{sweep}-{k}.fits"
            write_fits(rig.frame(2.0), path)
            sweeps[-1].append(str(path))
            rig.mount.turn_by_hand(30.0 if k < 2 else -60.0, -50.0 if k == 2 else 0.0)
            rig.clock.sleep(5.0)
    return rig, *sweeps


def test_a_second_sweep_takes_the_tubes_bending_out(bent, capsys):
    rig, first, second = bent
    truth = rig.truth().axis_error().altitude_arcsec
    _, out, _ = polar(capsys, *first, "--json", "--pressure", "1010")
    one = json.loads(out)
    _, out, _ = polar(capsys, *first, "--check", *second, "--json", "--pressure", "1010")
    both = json.loads(out)
    low = 60.0 * np.cos(np.radians(47.0)) * np.cos(np.radians(20.0))
    assert one["altitude_error_arcsec"] == pytest.approx(truth - low, abs=8.0)
    assert one["droop_arcsec"] is None
    assert one["flexure_arcsec"][0] > 15.0
    assert (one["unseen_arcsec"], one["unseen_total_arcsec"]) == (one["flexure_arcsec"], one["flexure_total_arcsec"])
    assert one["sigma_arcsec"][0] < 5.0
    assert one["sigma_total_arcsec"] > one["flexure_total_arcsec"] > 4.0 * one["noise_total_arcsec"]
    assert both["altitude_error_arcsec"] == pytest.approx(truth, abs=8.0)
    assert both["droop_arcsec"] == pytest.approx(60.0, abs=4.0 * both["sigma_droop_arcsec"])
    assert both["flexure_arcsec"][0] < 0.6 * one["flexure_arcsec"][0]
    assert [w for w in both["warnings"] if w.startswith("The tube sags by")]
    shuffled = [second[1], first[2], first[0], second[0], second[2], first[1]]
    _, out, _ = polar(capsys, *shuffled, "--json", "--pressure", "1010")
    assert json.loads(out)["droop_arcsec"] == pytest.approx(both["droop_arcsec"], abs=1.0)
    code, out, _ = polar(capsys, *first, "--pressure", "1010")
    assert code == 0
    (told,) = re.findall(r"^[^±]+ ± (\d+)″ from", out)
    assert float(told) == pytest.approx(one["sigma_total_arcsec"], abs=0.5), "one ± everywhere"
    assert f"{one['flexure_total_arcsec']:.0f}″ possible flexure" in out
    assert re.search(r"sweep again at declination [+-][0-9]+° \(--check\)", out)


def test_one_frame_elsewhere_is_no_second_sweep_and_nothing_is_promised(bent, capsys):
    _, first, second = bent
    code, out, _ = polar(capsys, *first, second[1])
    assert code == 1
    assert out.startswith("Unusable: don't adjust. ")
    assert "raise the axis" not in out
    assert "lower the axis" not in out
    assert "of 2 sweeps" not in out
    assert "better" not in out


@pytest.mark.parametrize(
    ("option", "words"),
    [
        (("--pressure", "-5"), "between 0 and 1100 hPa"),
        (("--temperature", "99"), "between -90 and 60 deg C"),
        (("--fov", "-3"), "not between 0.001 and 170 deg"),
        (("--timeout", "0"), "not more than zero"),
    ],
)
def test_numbers_that_make_no_sense_are_one_sentence(option, words, capsys):
    code, out, err = polar(capsys, "a.fits", "b.fits", *option)
    assert (code, out) == (2, "")
    assert words in err
    assert err.count("\n") == 1


def test_a_cropped_frame_among_whole_ones_spoils_the_measurement(night, capsys, tmp_path):
    rig, files, _ = night
    from dataclasses import replace

    from kochab.frames import read_frame

    whole = read_frame(files[1])
    part = replace(whole, pixels=whole.pixels[100:600, 50:800])
    cut = tmp_path / "cut.fits"
    write_fits(part, cut)
    code, out, err = polar(capsys, files[0], str(cut), files[2], "--json", "--pressure", "1010")
    told = json.loads(out)
    assert (code, err) == (1, "")
    assert [f["code"] for f in told["findings"] if f["spoils"]][:1] == ["cropped"]
    assert told["findings"][0]["text"].startswith("cut.fits is cropped")
    # its middle is another place of the sky: what the axis is said to be is not far off all the same
    assert told["total_arcsec"] == pytest.approx(rig.truth().axis_error().total_arcsec, abs=120.0)


def test_a_folder_is_one_sentence(night, capsys, tmp_path):
    _, files, _ = night
    code, _, err = polar(capsys, files[0], str(tmp_path))
    assert code == 2
    assert "is a folder" in err
    assert err.count("\n") == 1


def test_what_somebody_said_and_no_header_bears_out_ends_in_doubt(night, capsys, tmp_path):
    """The frames' own site and UTC: 0. A site by hand that they say too: 0. One that they don't say, or a clock: 3."""
    from astropy.io import fits

    _, files, _ = night
    bare = []
    for k, file in enumerate(files):
        with fits.open(file) as hdus:
            for key in [key for key in hdus[0].header if key.startswith(("SITE", "OBSGEO"))]:
                del hdus[0].header[key]
            bare.append(str(tmp_path / f"{k}.fits"))
            hdus.writeto(bare[-1])
    given = ("--site", "47,8,450")
    for paths, options, code in (
        (files, (), 0),
        (files, given, 0),
        (bare, given, 3),
        (files, ("--utc-offset", "0"), 3),
        (files[:2], (), 3),
    ):
        ended, out, err = polar(capsys, *paths, *options, "--json")
        told = json.loads(out)
        assert (ended, told["unsettled"], told["spoilt"]) == (code, code == 3, False), (options, err)


def test_a_wrong_site_is_doubted(night, capsys):
    _, files, _ = night
    code, out, _ = polar(capsys, *files, "--site", "-30,8")
    assert code == 1
    assert re.match("Unusable: don't adjust. .*(below the horizon|from the pole)", out)
    code, out, _ = polar(capsys, *files, "--site", "-30,8", "--json")
    told = json.loads(out)
    assert (code, told["spoilt"]) == (1, True)
    assert next(f["code"] for f in told["findings"] if f["spoils"]) in ("site_or_time", "far")
    code, out, _ = polar(capsys, *files, "--json")
    assert (code, json.loads(out)["spoilt"]) == (0, False)


def test_a_file_that_is_not_there(capsys):
    code, _, err = polar(capsys, "/nowhere/a.fits", "/nowhere/b.fits")
    assert code == 2
    assert "Traceback" not in err


def test_good_enough_is_said_for_the_frames_to_be_taken(night, capsys):
    _, files, _ = night
    code, out, _ = polar(capsys, *files, "--imaging", "600,3.76,300", "--utc-offset=0")
    assert code == 3, "nothing in the frames bears the clock out"
    assert re.search(r"good enough: Guided: 2\d′ is enough\. Unguided: 59″\.", out), out
    _, out, _ = polar(capsys, *files, "--imaging", "50,9,10", "--json")
    assert json.loads(out)["good_enough"] == "Good enough: stop."
    code, _, err = polar(capsys, *files, "--imaging", "600")
    assert code == 2
    assert "is not focal length, pixel and exposure" in err


# -- Drift: nobody turned the mount ---------------------------------------------------------------


def stream(folder, turned_deg=0.0, minutes=30, rate_deg_min=-15.041 / 60.0):
    """A recorded live session's lines: a mount 10 arcmin too high that tracked, a frame a minute; one was cloudy."""
    mount = Mount(d_alt=600.0, d_az=0.0, hour_deg=-75.0)
    site, lines = SITE_40, []
    for k, seen in enumerate(
        mount.see([rate_deg_min * k + turned_deg * (k > 5) for k in range(minutes)], seconds=60.0)
    ):
        icrs = erfa_icrs(seen.matrix, site, seen.time_utc)
        solution = Solution(
            Camera(900, 700, 8000.0, 449.5, 349.5),
            Attitude(icrs, np.diag([1.0, 1.0, 64.0]) * ARCSEC**2),
            (),
            0.2,
            -30.0,
            "x",
        )
        lines.append(json.dumps(as_json(f"frame {k}", solution) | {"time_utc": seen.time_utc.isoformat()}))
    lines[3:3] = [json.dumps({"file": "frame x", "solved": False, "reason": "clouded or dark", "advice": ""})]
    path = folder / "solutions.jsonl"
    path.write_text("\n".join(lines))
    return str(path)


def erfa_icrs(matrix, site, when):
    """ICRS to camera of camera axes in E, N, U, without air."""
    azimuth, zenith = np.arctan2(matrix[0], matrix[1]), np.arccos(matrix[2])
    utc = 2440587.5, when.timestamp() / 86400.0
    place = np.radians(site.longitude_deg), np.radians(site.latitude_deg), site.height_m
    ra, dec = erfa.atoc13("A", azimuth, zenith, *utc, 0.0, *place, 0.0, 0.0, 0.0, 10.0, 0.5, 0.55)
    axes = np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)], axis=-1)
    u, _, vt = np.linalg.svd(axes)
    return u @ vt


def test_a_recorded_stream_that_nobody_turned_gives_the_axis_by_drift(capsys, tmp_path):
    given = ["--site", "40,10,300", "--json", "--pressure", "0", "--pole", "true", "--utc-offset", "0"]
    code, out, err = polar(capsys, stream(tmp_path), *given, "--guided", "no", "--imaging", "400 mm, 3.76 um, 60 s")
    assert code == 3, err
    told = json.loads(out)
    assert told["altitude_error_arcsec"] == pytest.approx(600.0, abs=10.0)
    assert told["azimuth_error_arcsec"] == pytest.approx(0.0, abs=3 * told["sigma_arcsec"][1] + 10.0)
    assert told["frames"] == 30
    assert told["drift_minutes"] == pytest.approx(29.0)
    assert told["guided"] is False
    code, out, _ = polar(capsys, stream(tmp_path), *given)  # no guider lets go by 2.5 arcmin an hour
    assert json.loads(out)["guided"] is False
    code, out, _ = polar(capsys, stream(tmp_path), *given, "--guided", "yes")
    assert json.loads(out)["findings"][0]["code"] == "guided"
    code, out, _ = polar(capsys, stream(tmp_path, turned_deg=-40.0), *given)
    assert "drift_minutes" not in json.loads(out)  # turned: that is the ordinary way


def test_a_guide_log_is_told_with_what_it_knows(capsys, tmp_path):
    path = tmp_path / "PHD2_GuideLog_2026-03-14.txt"
    path.write_text(log_text(falling(2.0), hour=-0.1, dec=10.0))
    code, out, _ = polar(capsys, str(path), "--site", "47,8", "--pressure", "0")
    assert code == 0
    lines = out.splitlines()
    assert lines[0].startswith("Note: The drift can't tell altitude yet")
    assert next(line for line in lines if "Note: " not in line).startswith("  At least 7.")
    assert "altitude  not known yet" in out
    assert "too far east: rotate the mount anticlockwise" in out
    assert re.search(r"drift +10 min, 2\d points", out)
    assert "min more on this place" in out
    assert "6 h from the meridian tells it sooner" in out
    code, out, err = polar(capsys, str(path))
    assert (code, out) == (2, "")
    assert "give --site" in err
    path.write_text(log_text(falling(2.0), hour=-0.1, parity="?/?"))
    code, out, _ = polar(capsys, str(path), "--site", "47,8", "--json")
    assert code == 1
    assert json.loads(out)["findings"][0] == {
        "code": "dec_sign",
        "spoils": True,
        "text": json.loads(out)["warnings"][0],
    }
    code, out, err = polar(capsys, str(path), "--site", "47,8", "--report", str(tmp_path / "x.html"))
    assert (code, out) == (2, "")
    assert "no report of a drift" in err


def test_both_answers_are_told_where_a_log_has_no_parity_and_one_where_somebody_says_it(capsys, tmp_path):
    path = tmp_path / "PHD2_GuideLog_2026-03-14.txt"
    given = [str(path), "--site", "47,8", "--pressure", "0", "--pole", "true"]

    def told(parity, *more):
        path.write_text(log_text(falling(2.0), hour=-0.1, dec=10.0, parity=parity))
        code, out, err = polar(capsys, *given, "--json", *more)
        assert err == ""
        return code, json.loads(out)

    _, plain = told("+/+")
    _, turned = told("+/-")
    code, unknown = told("?/?")
    assert (code, unknown["spoilt"], plain["either"]) == (1, True, None)
    assert [one["dec_sign"] for one in unknown["either"]] == ["+", "-"]
    for one, known in zip(unknown["either"], (plain, turned), strict=True):
        assert one["azimuth_error_arcsec"] == pytest.approx(known["azimuth_error_arcsec"])
    for sign, known in (("+", plain), ("-", turned)):
        code, said = told("?/?", "--dec-sign", sign)
        assert (code, said["spoilt"], said["either"]) == (0, False, None)
        assert said["azimuth_error_arcsec"] == pytest.approx(known["azimuth_error_arcsec"])
    assert told("+/+", "--dec-sign", "-")[1]["azimuth_error_arcsec"] == plain["azimuth_error_arcsec"]
    told("?/?")
    code, out, _ = polar(capsys, *given)
    assert code == 1
    assert re.search(r"north: \S+ ± \S+ too far east\. .* south: \S+ ± \S+ too far west\. .*\(--dec-sign\)", out)
    assert "rotate the mount" not in out


def test_only_one_side_of_the_pier_counts_where_nothing_tells_north_from_south(capsys, tmp_path):
    """After a flip the same pulses may move the other way: two sides, and the sign of one says nothing of the other."""
    path = tmp_path / "PHD2_GuideLog_2026-03-14.txt"
    place = "RA = 5.00 hr, Dec = 10.0 deg, Hour angle = {} hr, Pier side = {}, Rotator pos = N/A"

    def log(*sides, parity="?/?"):
        runs = [log_text(falling(rate), parity=parity, place=place.format(hour, side)) for rate, hour, side in sides]
        path.write_text("\n".join(runs))
        code, out, _ = polar(capsys, str(path), "--site", "47,8", "--dec-sign", "+", "--json")
        return code, json.loads(out)

    west, east = (-2.0, -0.5, "West"), (2.0, 0.5, "East")
    _, both = log(west, east)
    _, one = log(east)
    assert both["azimuth_error_arcsec"] == one["azimuth_error_arcsec"]
    assert "Only the runs with pier side east count" in both["warnings"][-1]
    assert len(one["warnings"]) == len(both["warnings"]) - 1
    code, known = log(west, east, parity="+/+")
    assert (code, known["spoilt"]) == (1, True)  # the log tells the sign: then the two do show two axes


def test_a_guide_log_is_followed_until_somebody_ends_it(capsys, tmp_path, monkeypatch):
    path, grown = tmp_path / "PHD2_GuideLog_2026-03-14.txt", iter([3.0, 10.0])
    path.write_text(log_text(falling(2.0, minutes=0.5), hour=-0.1, dec=10.0))

    def sleep(seconds):
        minutes = next(grown, None)
        if minutes is None:
            raise KeyboardInterrupt
        path.write_text(log_text(falling(2.0, minutes=minutes), hour=-0.1, dec=10.0))

    monkeypatch.setattr("kochab.cli.polar.time", SimpleNamespace(sleep=sleep))
    code, out, err = polar(capsys, str(path), "--site", "47,8", "--pressure", "0", "--follow", "--json")
    assert code == 130, err
    told = [json.loads(line) for line in out.splitlines()]
    assert "no minute of guiding" in told[0]["error"]
    assert [round(row["drift_minutes"]) for row in told[1:]] == [3, 10]
    assert told[1]["minutes_more"] > told[2]["minutes_more"]


def test_what_a_log_gains_while_it_is_measured_is_measured_next(capsys, tmp_path, monkeypatch):
    path, rounds = tmp_path / "PHD2_GuideLog_2026-03-14.txt", []
    path.write_text(log_text(falling(2.0, minutes=3.0), hour=-0.1, dec=10.0))

    def measured(args):
        found = _measure(args)
        if not rounds:
            path.write_text(log_text(falling(2.0, minutes=10.0), hour=-0.1, dec=10.0))
        rounds.append(found)
        return found

    def sleep(seconds):
        raise KeyboardInterrupt

    monkeypatch.setattr("kochab.cli.polar._measure", measured)
    monkeypatch.setattr("kochab.cli.polar.time", SimpleNamespace(sleep=sleep))
    assert polar(capsys, str(path), "--site", "47,8", "--follow")[0] == 130
    assert len(rounds) == 2


def test_a_night_is_remembered_by_its_profile_not_by_the_cameras(capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    assert main(["profile", "save", "garden", "--camera-profile", "mono", "--site", "40,10,300"]) == 0
    options = ["--profile", "garden", "--utc-offset=0", "--guided=no", "--pole=true"]
    code, _, err = polar(capsys, stream(tmp_path, minutes=60), *options)
    assert code == 3, err
    assert last_night(Site(40.0, 10.0, 300.0), "garden") is not None
    assert polar(capsys, "--profile", "garden")[0] == 0


def test_following_ends_when_the_axis_is_known(capsys, tmp_path):
    """Thirty minutes of a recorded session leave 33 arcsec open, an hour 18."""
    options = ["--site=40,10,300", "--utc-offset=0", "--guided=no", "--pole=true", "--json", "--follow"]
    code, out, err = polar(capsys, stream(tmp_path, minutes=60), *options)
    assert code == 3, err
    assert json.loads(out)["minutes_more"] == 0.0


@pytest.mark.parametrize(
    ("solved", "clouded", "code"), [(2, 1, 0), (3, 1, 0), (3, 2, 0), (1, 1, 1), (2, 2, 1), (1, 2, 1)]
)
def test_a_clouded_frame_of_three_or_more_is_left_out_and_told(capsys, tmp_path, solved, clouded, code):
    """One of a few is a cloud; where as many have no solution as have one, something else is wrong."""
    rows = stream_rows(tmp_path)
    missed = [row for row in rows if not json.loads(row)["solved"]][:1] * clouded
    found = [row for row in rows if json.loads(row)["solved"]]
    kept = [found[len(found) // max(solved - 1, 1) * k - (k > 0)] for k in range(solved)]
    (tmp_path / "night.json").write_text("\n".join([*missed, *kept]))
    done, out, err = polar(capsys, str(tmp_path / "night.json"), "--site", "40,10,300", "--utc-offset", "0")
    assert done == code, err
    assert ("frame x: No solution, left out." in out) is (code == 0)
    assert ("frame x: no solution: clouded or dark" in err) is (code == 1)


def stream_rows(folder):
    with open(stream(folder)) as lines:
        return lines.read().splitlines()
