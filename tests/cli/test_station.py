"""``kochab station`` on frames rendered with astropy's horizon: stars, a house, and a bank of cloud."""

import json
import shutil
from datetime import UTC, datetime, timedelta

import astropy.units as u
import numpy as np
import pytest
from astropy.coordinates import AltAz, EarthLocation, SkyCoord
from astropy.io import fits
from astropy.time import Time
from PIL import Image

from kochab.cli.main import main
from kochab.simulate.star_images import RenderedStar, Sky, render
from kochab.sky import open_catalogue
from tests.solver.test_fixed_camera import HEIGHT, MIDNIGHT, SITE, WIDTH, lens, stars_at

HOUSE = 60.0, 120.0, 35.0  # azimuths, and how high
CLOUD = 250.0, 45.0, 25.0  # azimuth, altitude and radius, degrees
AT = f"{SITE.latitude_deg},{SITE.longitude_deg},{SITE.height_m}"


def dimmed(time):
    """Azimuth, altitude, V through the air of the catalogue's stars to V 6.5."""
    rows, _, _, azimuth, altitude = stars_at(time, 3500)
    return azimuth, altitude, open_catalogue().mag(rows) + 0.25 / np.sin(np.radians(np.maximum(altitude, 3.0)))


def away_deg(azimuth, altitude, place):
    a, h = np.radians([azimuth, altitude])
    a0, h0 = np.radians(place)
    return np.degrees(np.arccos(np.clip(np.sin(h) * np.sin(h0) + np.cos(h) * np.cos(h0) * np.cos(a - a0), -1.0, 1.0)))


def picture(path, time, cloud=False, clear=True, turn=0.7):
    """Write a frame; without ``clear`` there are only the six brightest stars in it."""
    azimuth, altitude, mag = dimmed(time)
    xy = lens(azimuth, altitude, turn)
    shown = (altitude > 3.0) & ~((azimuth > HOUSE[0]) & (azimuth < HOUSE[1]) & (altitude < HOUSE[2]))
    if cloud:
        shown &= away_deg(azimuth, altitude, CLOUD[:2]) > CLOUD[2]
    if not clear:
        shown &= mag <= np.sort(mag[shown])[5]
    flux = 10.0 ** (-0.4 * (mag[shown] - 13.0))
    frame = render(WIDTH, HEIGHT, xy[shown], flux, RenderedStar(2.6), Sky(60.0), seed=int(time.timestamp()) % 1000)
    fits.writeto(path, frame.pixels, fits.Header({"DATE-OBS": f"{time:%Y-%m-%dT%H:%M:%S}", "EXPTIME": 0.0}))


@pytest.fixture(scope="module")
def night(tmp_path_factory):
    """Three clear frames, and settings that have the camera which took them."""
    into = tmp_path_factory.mktemp("station")
    files = [str(into / f"clear{k}.fits") for k in range(3)]
    for k, file in enumerate(files):
        picture(file, MIDNIGHT + timedelta(hours=2 * k))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("KOCHAB_CONFIG", str(into / "settings"))
        assert main(["station", "calibrate", "roof", *files, "--site", AT]) == 0
    return into


@pytest.fixture
def roof(night, tmp_path, monkeypatch):
    shutil.copytree(night / "settings", tmp_path / "settings")
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "settings"))
    return night


def printed(capsys):
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_pixels_azimuths_and_places_on_the_sky(roof, capsys) -> None:
    ((x, y),) = lens(np.array([200.0]), np.array([50.0]))
    capsys.readouterr()
    assert main(["station", "altaz", "roof", f"{x},{y}", "--time", "2024-06-05T04:00", "--json"]) == 0
    assert main(["station", "pixel", "roof", "200,50", "--json"]) == 0
    assert main(["station", "altaz", "roof", "0,0", "--json"]) == 1
    there, back, none = printed(capsys)
    assert (there["azimuth_deg"], there["altitude_deg"]) == pytest.approx((200.0, 50.0), abs=0.01)
    assert there["sigma_deg"] < 0.01
    place = EarthLocation.from_geodetic(SITE.longitude_deg * u.deg, SITE.latitude_deg * u.deg, SITE.height_m * u.m)
    horizon = AltAz(obstime=Time(MIDNIGHT), location=place)
    truth = SkyCoord(az=200.0 * u.deg, alt=50.0 * u.deg, frame=horizon).icrs
    assert (there["ra_deg"], there["dec_deg"]) == pytest.approx((truth.ra.deg, truth.dec.deg), abs=0.03)
    assert (back["x"], back["y"]) == pytest.approx((x, y), abs=0.2)
    assert none["altitude_deg"] is None


def test_a_house_is_found_by_the_stars_that_it_hides(roof, tmp_path, capsys) -> None:
    assert main(["station", "horizon", "roof", str(tmp_path / "horizon.txt")]) == 0
    rows = np.loadtxt(tmp_path / "horizon.txt")
    behind = (rows[:, 0] > HOUSE[0] + 15.0) & (rows[:, 0] < HOUSE[1] - 15.0)
    assert rows[behind, 1] == pytest.approx(np.full(behind.sum(), HOUSE[2]), abs=4.0)
    free = (rows[:, 0] < HOUSE[0] - 15.0) | (rows[:, 0] > HOUSE[1] + 15.0)
    assert rows[free, 1].max() < 15.0
    assert main(["profile", "save", "garden", "--horizon", str(tmp_path / "horizon.txt")]) == 0
    assert main(["station", "mask", "roof", str(tmp_path / "mask.png")]) == 0
    with Image.open(tmp_path / "mask.png") as written:
        mask = np.asarray(written)
    for azimuth, altitude, sky in ((90.0, 20.0, 0), (90.0, 50.0, 255), (270.0, 30.0, 255)):
        ((x, y),) = lens(np.array([azimuth]), np.array([altitude]))
        assert mask[round(y), round(x)] == sky
    assert mask[2, 2] == 0


def test_cloud_is_told_where_it_is(roof, tmp_path, capsys) -> None:
    time = MIDNIGHT + timedelta(hours=1)
    picture(tmp_path / "clear.fits", time)
    picture(tmp_path / "cloud.fits", time, cloud=True)
    picture(tmp_path / "overcast.fits", time, clear=False)
    capsys.readouterr()
    shown = str(tmp_path / "shown.png")
    assert main(["station", "cloud", "roof", str(tmp_path / "cloud.fits"), "--annotate", shown, "--json"]) == 0
    assert (
        main(["station", "cloud", "roof", str(tmp_path / "clear.fits"), str(tmp_path / "overcast.fits"), "--json"]) == 0
    )
    cloud, clear, overcast = printed(capsys)
    assert clear["cloud"] < 3.0 * clear["sigma"]
    assert overcast["cloud"] > 0.95
    # The truth by stars, as the renderer dropped them, among those of V 4.5 and brighter that the house leaves.
    azimuth, altitude, mag = dimmed(time)
    usual = (mag < 5.0) & (altitude > 15.0) & ~((azimuth > 50.0) & (azimuth < 130.0) & (altitude < 40.0))
    behind = away_deg(azimuth, altitude, CLOUD[:2]) < CLOUD[2]
    assert cloud["cloud"] == pytest.approx(behind[usual].mean(), abs=3.0 * cloud["sigma"])
    west = usual & (azimuth > 247.5) & (azimuth < 292.5) & (altitude < 60.0)
    assert cloud["parts"]["W"]["cloud"] == pytest.approx(behind[west].mean(), abs=3.0 * cloud["parts"]["W"]["sigma"])
    assert cloud["parts"]["E"]["cloud"] < 0.1
    with Image.open(shown) as annotated:
        assert annotated.size == (WIDTH, HEIGHT)


def test_a_camera_that_moved_is_not_taken_for_cloud(roof, tmp_path, capsys) -> None:
    picture(tmp_path / "moved.fits", MIDNIGHT, turn=0.72)
    assert main(["station", "cloud", "roof", str(tmp_path / "moved.fits")]) == 1
    assert "the camera has moved by" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["altaz", "garden", "1,1"], "There is no calibration “garden”; there are: roof."),
        (["altaz", "roof", "1"], "1 is not X,Y in pixels."),
        (["pixel", "roof", "a,b"], "a,b is not AZ,ALT in degrees."),
        (["altaz", "roof", "1,1", "--time", "noon"], "noon is not a time; give it as 2026-11-24T21:30."),
        (["mask", "roof", "mask.tif"], "mask.tif: the picture is a .png."),
        (["remove", "garden"], "There is no calibration “garden”."),
        (["cloud", "roof", "nowhere.fits"], "nowhere.fits does not exist."),
    ],
)
def test_what_cannot_be_done_is_one_sentence(roof, arguments, sentence, capsys) -> None:
    assert main(["station", *arguments]) == 2
    assert sentence in capsys.readouterr().err


def test_by_day_no_cloud_is_told_and_names_are_kept(roof, tmp_path, capsys) -> None:
    picture(tmp_path / "day.fits", datetime(2024, 6, 5, 16, 0, tzinfo=UTC))
    assert main(["station", "cloud", "roof", str(tmp_path / "day.fits")]) == 1
    assert "the Sun was at" in capsys.readouterr().out
    assert main(["station", "calibrate", "roof", str(roof / "clear0.fits"), "--site", AT]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main(["station", "calibrate", "two", str(tmp_path / "day.fits")]) == 2
    assert "give it with --site" in capsys.readouterr().err
    assert main(["station", "list"]) == 0
    assert main(["station", "remove", "roof"]) == 0
    assert main(["station", "list"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[0].startswith("roof")
    assert told[-1].startswith("No camera is calibrated yet")
