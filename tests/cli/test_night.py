"""``kochab night`` on a rendered night whose cloud, drift, tilt and focus are planted here, and on what is no night.

The sky is drawn by astropy's WCS and the error function; nothing of the product but its star catalogue takes part.
"""

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from html.parser import HTMLParser

import numpy as np
import pytest
from astropy.io import fits
from astropy.wcs import WCS

from kochab.cli.main import main
from kochab.core.attitude import unit_vectors
from kochab.sky import open_catalogue
from tests.workflows.night_sky import drawn

SIZE, SCALE = (900, 600), 14.0
CENTRE = 84.0, 22.0
FRAMES, MINUTES = 14, 12
START = datetime(2026, 1, 12, 19, 0, tzinfo=UTC)
LOST = {5: 0.5, 6: 1.0, 7: 0.8}
DRIFT = 90.0, -40.0  # arcsec an hour, east and north
TILT = 0.9  # px across the half diagonal, to the right
STEADY, STEADY_PLACE, STEADY_MAG = "HD 36879", "5h35m40.5s +21d24m12s", 7.56


def planted(folder, tilt=TILT, lost=None, drift=DRIFT, frames=FRAMES, growing=0.0, filters=("L",), axis=None):
    """Write the night's frames."""
    catalogue = open_catalogue()
    rows = catalogue.cone(unit_vectors(*CENTRE), np.radians(3.2), 9.3)
    vectors = catalogue.vectors(rows, 2026.03)
    ra, dec = np.degrees(np.arctan2(vectors[:, 1], vectors[:, 0])) % 360, np.degrees(np.arcsin(vectors[:, 2]))
    rng = np.random.default_rng(11)
    own = rng.normal(0, 0.1, len(rows))  # what each star's colour makes of its magnitude
    for k in range(frames):
        hours = k * MINUTES / 60
        wcs = WCS(naxis=2)
        wcs.wcs.ctype = ["RA---TAN", "DEC--TAN"]
        wander = rng.normal(0, 0.8, 2)
        east, north = drift[0] * hours + wander[0], drift[1] * hours + wander[1]
        wcs.wcs.crval = [CENTRE[0] + east / 3600 / np.cos(np.radians(CENTRE[1])), CENTRE[1] + north / 3600]
        roll = 0.0
        if axis:
            *wcs.wcs.crval, roll = axis(hours)
        wcs.wcs.crpix = [(SIZE[0] + 1) / 2, (SIZE[1] + 1) / 2]
        cos, sin = np.cos(roll), np.sin(roll)
        wcs.wcs.cd = np.array([[-cos, -sin], [sin, -cos]]) * SCALE / 3600
        xy = np.stack(wcs.all_world2pix(ra, dec, 0), axis=1)
        inside = ((xy > 8) & (xy < np.array(SIZE) - 9)).all(axis=1)
        place = xy[inside]
        u = (place[:, 0] - (SIZE[0] - 1) / 2) / (np.hypot(*SIZE) / 2)
        mag = catalogue.mag(rows[inside]) + own[inside] + (lost or {}).get(k, 0.0)
        flux = 10 ** (-0.4 * (mag - 21.2))
        fwhm = 3.2 + growing * hours + tilt * u
        pixels = drawn(SIZE, place, np.minimum(flux, 4e5), fwhm, seed=k)
        header = fits.Header(
            {
                "DATE-OBS": (START + timedelta(hours=hours)).strftime("%Y-%m-%dT%H:%M:%S"),
                "EXPTIME": 60.0,
                "SITELAT": 48.0,
                "SITELONG": 11.0,
                "FILTER": filters[k % len(filters)],
            }
        )
        fits.writeto(folder / f"light_{k:02d}.fits", pixels, header)


@pytest.fixture(scope="module")
def night(tmp_path_factory):
    """The planted night, measured once: its folder and what was written."""
    folder = tmp_path_factory.mktemp("night") / "crab"
    folder.mkdir()
    planted(folder, lost=LOST)
    (folder / "notes.txt").write_text("not a frame")
    (folder / "spoilt.fits").write_bytes((folder / "light_00.fits").read_bytes()[:4000])
    out = folder.parent / "out"
    out.mkdir()
    assert main(["night", str(folder), "--out", str(out), "--json", "--scale", "14"]) == 0
    return folder, out, json.loads((out / "crab-night.json").read_text())


def test_every_planted_fault_is_found_with_its_size(night):
    _, _, found = night
    assert (found["asked"], found["solved"]) == (FRAMES + 1, FRAMES)
    assert [name[-7:-5] for name in found["clouded"]] == ["05", "06", "07"]
    rows = {row["file"][-7:-5]: row for row in found["frames"] if row["solved"]}
    for k, taken in LOST.items():
        row = rows[f"{k:02d}"]
        assert row["lost_mag"] == pytest.approx(taken, abs=4 * row["lost_mag_sigma"] + 0.02)
        assert row["lost_mag_sigma"] < 0.05
    clear = [rows[f"{k:02d}"]["lost_mag"] for k in range(FRAMES) if k not in LOST]
    assert np.abs(clear).max() < 0.05
    (tracking,) = found["tracking"]
    assert tracking["frames"] == FRAMES
    for name, true in zip(("ra", "dec"), DRIFT, strict=True):
        sigma = tracking[f"{name}_arcsec_h_sigma"]
        assert tracking[f"{name}_arcsec_h"] == pytest.approx(true, abs=4 * sigma)
        assert sigma < 2.0
    field = found["field"]
    assert field["tilt_px"] == pytest.approx(2 * TILT, abs=0.15)
    assert field["softest"] == "right"
    assert field["tilt_chance"] < 1e-9
    assert "softer towards the" in found["advice"] or "cloud" in found["advice"]
    assert {name[-7:-5] for name in found["worst"]} >= {"06", "07"}
    assert not {name[-7:-5] for name in found["best"]} & {"05", "06", "07"}


def test_nothing_is_found_in_a_night_without_faults(tmp_path):
    folder = tmp_path / "calm"
    folder.mkdir()
    planted(folder, tilt=0.0, drift=(0.0, 0.0), frames=8)
    assert main(["night", str(folder), "--out", str(tmp_path), "--scale", "14"]) == 0
    found = json.loads((tmp_path / "calm-night.json").read_text())
    assert found["clouded"] == []
    assert found["field"]["tilt_chance"] > 1e-4
    assert found["advice"].startswith("Nothing stands out")
    for name in ("ra", "dec"):
        assert abs(found["tracking"][0][f"{name}_arcsec_h"]) < 4 * found["tracking"][0][f"{name}_arcsec_h_sigma"]


def test_another_filter_is_no_cloud_and_calibration_frames_are_no_frames_of_the_night(tmp_path):
    folder = tmp_path / "lrgb"
    folder.mkdir()
    planted(folder, tilt=0.0, drift=(0.0, 0.0), frames=8, filters=("L", "Ha"), lost=dict.fromkeys((1, 3, 5, 7), 1.4))
    for kind in ("Dark Frame", "FLAT", "bias"):
        header = fits.Header({"IMAGETYP": kind})
        fits.writeto(folder / f"{kind.split()[0]}.fits", np.full((600, 900), 500, np.uint16), header)
    assert main(["night", str(folder), "--out", str(tmp_path), "--scale", "14"]) == 0
    found = json.loads((tmp_path / "lrgb-night.json").read_text())
    assert (found["asked"], found["solved"], found["clouded"]) == (8, 8, [])
    assert found["advice"].startswith("Nothing stands out")


def on_axis(alt_arcmin, az_arcmin):
    """Where a camera points by hour of turning about an axis that stands so far off the refracted pole, by astropy.

    RA and Dec of the middle, degrees, and the position angle of the frame's up, radians.
    """
    from astropy import units as u
    from astropy.coordinates import AltAz, EarthLocation, SkyCoord
    from astropy.time import Time
    from scipy.spatial.transform import Rotation

    place = EarthLocation.from_geodetic(11 * u.deg, 48 * u.deg, 0 * u.m)
    air = {"pressure": 1010 * u.hPa, "temperature": 10 * u.deg_C, "relative_humidity": 0.5, "obswl": 0.55 * u.micron}

    def level(hours):
        return AltAz(obstime=Time(START + timedelta(hours=hours, seconds=30)), location=place, **air)

    def vectors(sky):
        return np.array([np.cos(sky.alt) * np.sin(sky.az), np.cos(sky.alt) * np.cos(sky.az), np.sin(sky.alt)])

    middle = SkyCoord(*CENTRE, unit="deg")
    up = SkyCoord(CENTRE[0], CENTRE[1] + 0.5, unit="deg")
    began = np.array([vectors(one.transform_to(level(0.0))) for one in (middle, up)])
    altitude = 48 + (58.3 / np.tan(np.radians(48)) / 60 + alt_arcmin) / 60
    pole = [np.cos(np.radians(altitude)) * np.sin(np.radians(az_arcmin / 60)),
            np.cos(np.radians(altitude)) * np.cos(np.radians(az_arcmin / 60)), np.sin(np.radians(altitude))]  # fmt: skip

    def pointing(hours):
        turned = Rotation.from_rotvec(-np.radians(15.0410686 * hours) * np.array(pole)).apply(began)
        alt, az = np.degrees(np.arcsin(turned[:, 2])), np.degrees(np.arctan2(turned[:, 0], turned[:, 1]))
        there = SkyCoord(
            AltAz(alt=alt * u.deg, az=az * u.deg, obstime=level(hours).obstime, location=place, **air)
        ).icrs
        return there[0].ra.deg, there[0].dec.deg, there[0].position_angle(there[1]).rad

    return pointing


@pytest.mark.parametrize(("alt", "az"), [(9.0, -6.0), (-12.0, 20.0)])
def test_the_polar_axis_is_that_of_the_mount_that_was_turned(tmp_path, alt, az):
    from astropy.utils import iers

    folder = tmp_path / "pole"
    folder.mkdir()
    with iers.conf.set_temp("auto_download", False), iers.conf.set_temp("iers_degraded_accuracy", "ignore"):
        planted(folder, tilt=0.0, axis=on_axis(alt, az))
    assert main(["night", str(folder), "--out", str(tmp_path), "--scale", "14"]) == 0
    found = json.loads((tmp_path / "pole-night.json").read_text())
    for name, true in (("altitude", alt), ("azimuth", az)):
        sigma = found["polar"][f"{name}_arcsec_sigma"]
        assert found["polar"][f"{name}_arcsec"] == pytest.approx(60 * true, abs=3 * sigma)
        assert sigma < 90
    assert "polar axis is off by" in found["advice"]
    assert "Polar axis off by" in (tmp_path / "pole-night.html").read_text()


def test_growing_stars_are_a_focus_that_drifts(tmp_path):
    folder = tmp_path / "soft"
    folder.mkdir()
    planted(folder, tilt=0.0, frames=8, growing=0.8)
    assert main(["night", str(folder), "--out", str(tmp_path), "--scale", "14"]) == 0
    found = json.loads((tmp_path / "soft-night.json").read_text())
    assert found["focus_px_h"] == pytest.approx(0.8, abs=4 * found["focus_px_h_sigma"] + 0.02)
    assert "Refocus every" in found["advice"]


def test_the_sky_is_where_astropy_has_it(night):
    from astropy import units
    from astropy.coordinates import AltAz, EarthLocation, SkyCoord, get_body, get_sun
    from astropy.time import Time
    from astropy.utils import iers

    row = next(row for row in night[2]["frames"] if row["file"].endswith("light_03.fits"))
    place = EarthLocation.from_geodetic(11 * units.deg, 48 * units.deg, 0 * units.m)
    with iers.conf.set_temp("auto_download", False), iers.conf.set_temp("iers_degraded_accuracy", "ignore"):
        when = Time(datetime.fromisoformat(row["time_utc"]))
        level = AltAz(obstime=when, location=place)
        field = SkyCoord(row["ra_deg"], row["dec_deg"], unit="deg")
        moon = get_body("moon", when, place)
        assert row["altitude_deg"] == pytest.approx(field.transform_to(level).alt.deg, abs=0.05)
        assert row["moon_altitude_deg"] == pytest.approx(moon.transform_to(level).alt.deg, abs=0.1)
        assert row["sun_altitude_deg"] == pytest.approx(get_sun(when).transform_to(level).alt.deg, abs=0.05)


def test_the_table_has_a_row_a_frame_and_each_number_its_uncertainty(night):
    _, out, found = night
    rows = list(csv.DictReader((out / "crab-night.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == FRAMES + 1
    for name in ("fwhm_px", "elongation", "tilt_px", "lost_mag", "cloud_mag"):
        assert all(float(row[f"{name}_sigma"]) >= 0 for row in rows if row["solved"] == "True"), name
    (spoilt,) = [row for row in rows if row["file"].endswith("spoilt.fits")]
    assert spoilt["reason"]
    assert found["frames"][0]["file"].endswith("light_00.fits")


class Links(HTMLParser):
    """Every address and every tag of a page."""

    def __init__(self):
        super().__init__()
        self.addresses, self.tags, self.open = [], set(), []

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.addresses += [value for name, value in attrs if name in ("src", "href", "srcset")]
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.add(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_page_is_whole_needs_no_network_and_says_what_is_not_measured(night):
    _, out, found = night
    text = (out / "crab-night.html").read_text(encoding="utf-8")
    page = Links()
    page.feed(text)
    assert page.open == []
    assert not page.tags & {"script", "link", "iframe"}
    assert page.addresses
    assert all(address.startswith("data:image/jpeg;base64,") for address in page.addresses)
    assert "url(" not in text
    assert found["advice"].replace(" ± ", "\u00a0±\u00a0") in text
    assert "Sky brightness is not measured: the black level is unknown." in text
    assert text.count("<svg") == 2
    assert not re.search(r"\bnan\b|\binf\b|None", text)


def test_a_page_is_not_written_over_and_no_night_is_one_sentence(night, tmp_path, capsys):
    folder, out, _ = night
    before = (out / "crab-night.html").read_bytes()
    assert main(["night", str(folder), "--out", str(out)]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert (out / "crab-night.html").read_bytes() == before
    (tmp_path / "empty").mkdir()
    for given in (tmp_path / "empty", tmp_path / "nowhere"):
        assert main(["night", str(given), "--out", str(tmp_path)]) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert main(["night", str(folder), "--out", str(tmp_path / "nowhere")]) == 2


def test_a_folder_without_stars_ends_with_1_and_a_page(tmp_path):
    folder = tmp_path / "dark"
    folder.mkdir()
    for k in range(2):
        fits.writeto(folder / f"d{k}.fits", np.full((300, 400), 500 + k, np.uint16))
    assert main(["night", str(folder), "--out", str(tmp_path)]) == 1
    assert "have no solution" in (tmp_path / "dark-night.html").read_text()


COPIES = 12  # of the night's frames: a busy machine must not be done with them before it is interrupted


@pytest.mark.skipif(os.name == "nt", reason="SIGINT is sent to a process of POSIX")
@pytest.mark.parametrize("workers", ["1", "2"])
def test_ctrl_c_leaves_a_page_of_what_was_measured(night, tmp_path, workers):
    many = tmp_path / "many"
    many.mkdir()
    for copy in range(COPIES):
        for path in night[0].glob("light_*.fits"):
            shutil.copy(path, many / f"{copy}{path.name}")
    command = [sys.executable, "-m", "kochab", "night", str(many), "--out", str(tmp_path), "--workers", workers]
    running = subprocess.Popen(
        [*command, "--json", "--scale", "14"], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    for line in running.stderr:
        if "frames" in line:  # it is told once, when frames have been measured for a while
            break
    running.send_signal(signal.SIGINT)
    told, errors = running.communicate(timeout=250)
    assert running.returncode == 130, errors
    assert "Traceback" not in errors
    if told:
        found = json.loads((tmp_path / "many-night.json").read_text())
        assert 0 < len(found["frames"]) < found["asked"] == COPIES * FRAMES
        assert "Stopped early" in (tmp_path / "many-night.html").read_text()


def test_a_night_is_compared_with_those_measured_before(night, tmp_path, monkeypatch, capsys):
    from kochab.workflows.night.earlier import NightRecord, keep_night, kept_nights

    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "config"))
    few = tmp_path / "few"
    few.mkdir()
    for path in sorted(night[0].glob("light_0[0-4].fits")):
        shutil.copy(path, few)
    assert main(["night", str(few), "--out", str(tmp_path), "--scale", "14"]) == 0
    (kept,) = kept_nights()
    assert kept.site == (48.0, 11.0)
    capsys.readouterr()
    for day in range(1, 6):
        values = {"fwhm_arcsec": (20.0 + day / 10, 0.1)}
        keep_night(
            NightRecord(f"2026-01-0{day}T19:00:00+00:00", kept.equipment, kept.scale_arcsec_px, kept.site, values)
        )
    assert main(["night", str(few), "--out", str(tmp_path), "--scale", "14", "--overwrite"]) == 0
    assert "unusual  FWHM" in capsys.readouterr().out
    found = json.loads((tmp_path / "few-night.json").read_text())
    (fwhm,) = [one for one in found["earlier"] if one["quantity"] == "fwhm_arcsec"]
    assert (fwhm["nights"], fwhm["unusual"], fwhm["usual"]) == (5, True, pytest.approx(20.3))
    assert fwhm["tonight"] == pytest.approx(kept.values["fwhm_arcsec"][0])
    assert "Against earlier nights" in (tmp_path / "few-night.html").read_text()
    assert len(kept_nights()) == 6


def test_a_chosen_star_has_a_light_curve_and_the_aavso_a_file(night, tmp_path, capsys):
    """Its light is that of the catalogue and of ``LOST``, which the others share; it does not change."""
    folder, _, _ = night
    given = ["night", str(folder), "--out", str(tmp_path), "--json", "--scale", "14"]
    given += ["--ades", "703", "--observer", "A. Name", "--telescope", "0.1,lens,CMOS"]
    assert main([*given, "--star", STEADY, "--star", STEADY_PLACE, "--aavso", "abc"]) == 0
    assert "No asteroid or comet was found, so no ADES file was written." in capsys.readouterr().err
    assert not list(tmp_path.glob("*.psv"))
    curves = json.loads((tmp_path / "crab-night.json").read_text())["stars"]
    assert len(curves) == 2
    for curve in curves:
        assert len(curve["points"]) == FRAMES, "cloud takes from all alike"
        mags = np.array([point["mag"] for point in curve["points"]])
        sigma = np.array([point["mag_sigma"] for point in curve["points"]])
        assert np.abs(mags - np.median(mags)).max() < 5.0 * sigma.max()
        assert abs(np.median(mags) - STEADY_MAG) < 0.4, "its own part is 0.1 mag, one sigma"
        assert curve["check"]
    rows = [line for line in (tmp_path / "crab-night-aavso.txt").read_text().splitlines() if line[0] != "#"]
    assert len(rows) == 2 * FRAMES
    assert "(V)" in (tmp_path / "crab-night.html").read_text()


def test_a_star_that_no_frame_shows_is_told(night, tmp_path, capsys):
    folder, _, _ = night
    few = [str(folder / f"light_{k:02d}.fits") for k in range(2)]
    assert main(["night", *few, "--out", str(tmp_path), "--scale", "14", "--star", "Vega"]) == 0
    assert "Vega was not measured in any frame" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--star", "Jupiter"], "Jupiter is not a known star"),
        (["--aavso", "ABC"], "--aavso needs --star"),
        (["--star", "Vega", "--aavso", "no code"], "no code is not an AAVSO observer code"),
        (["--ades", "703"], "--ades needs --observer NAME."),
    ],
)
def test_a_star_or_code_that_is_none_is_told_before_anything_is_measured(night, tmp_path, capsys, more, words):
    folder, _, _ = night
    assert main(["night", str(folder), "--out", str(tmp_path), *more]) == 2
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_elements_that_cannot_be_read_are_told_before_anything_is_measured(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for k in range(2):
        fits.PrimaryHDU(np.full((64, 64), 1000, np.uint16)).writeto(tmp_path / f"{k}.fits")
    (tmp_path / "bad.txt").write_text("no elements")
    assert main(["night", str(tmp_path), "--elements", str(tmp_path / "bad.txt")]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.count("\n") == 1
    assert "bad.txt" in told.err
