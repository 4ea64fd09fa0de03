"""A fixed camera against astropy's own horizon (`AltAz`) and a lens written down here."""

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import astropy.units as u
import numpy as np
import pytest
from astropy.coordinates import AltAz, EarthLocation, SkyCoord
from astropy.time import Time

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera, FisheyeCamera
from kochab.core.errors import KochabError, UsageError
from kochab.core.frame import Site
from kochab.core.solution import NamedStar, Solution
from kochab.sky import open_catalogue
from kochab.sky.horizon import Horizon
from kochab.solver.fixed_camera import (
    StarsOfFrame,
    calibrated,
    directions_of,
    fixed_camera_path,
    fixed_cameras,
    load_fixed_camera,
    save_fixed_camera,
)

SITE = Site(-24.6, -70.4, 2635.0)
WIDTH, HEIGHT, FOCAL_PX = 2000, 1600, 560.0
TILT, TURN = np.radians(4.0), 0.7
NOISE_PX = 0.2


@pytest.fixture(autouse=True)
def _own_settings(tmp_path, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))


def lens(azimuth_deg, altitude_deg, turn=TURN):
    """Pixels of an equisolid lens that looks 4 deg from the zenith, whose middle is beside that of the frame."""
    a, h = np.radians(azimuth_deg), np.radians(altitude_deg)
    east, north, up = np.cos(h) * np.sin(a), np.cos(h) * np.cos(a), np.sin(h)
    north, up = north * np.cos(TILT) - up * np.sin(TILT), north * np.sin(TILT) + up * np.cos(TILT)
    theta, way = np.arctan2(np.hypot(east, north), up), np.arctan2(east, north) + turn
    radius = 2.0 * FOCAL_PX * np.sin(theta / 2.0)
    return np.column_stack([1010.3 + radius * np.sin(way), 792.7 + radius * np.cos(way)])


def stars_at(time, count):
    """The brightest stars of the catalogue: rows, RA, Dec, and azimuth and altitude as astropy has them, degrees."""
    catalogue = open_catalogue()
    zenith = Horizon(SITE, time).catalogue(np.array([[0.0, 0.0, 1.0]]))[0]
    rows = catalogue.brightest(zenith, np.pi / 2.0, count, 2024.4)
    vectors = catalogue.vectors(rows, 2024.4)
    ra, dec = np.degrees(np.arctan2(vectors[:, 1], vectors[:, 0])), np.degrees(np.arcsin(vectors[:, 2]))
    place = EarthLocation.from_geodetic(SITE.longitude_deg * u.deg, SITE.latitude_deg * u.deg, SITE.height_m * u.m)
    air = {"temperature": 10 * u.deg_C, "relative_humidity": 0.5, "obswl": 0.55 * u.micron, "pressure": 741.0 * u.hPa}
    seen = SkyCoord(ra * u.deg, dec * u.deg).transform_to(AltAz(obstime=Time(time), location=place, **air))
    return rows, ra, dec, seen.az.deg, seen.alt.deg


def frame_at(time, turn=TURN, seed=0, site=SITE, lowest_deg=12.0):
    """Stars of a frame as the solver gives them, placed by astropy."""
    rows, ra, dec, azimuth, altitude = stars_at(time, 400)
    xy = lens(azimuth, altitude, turn) + np.random.default_rng(seed).normal(0.0, NOISE_PX, (len(rows), 2))
    kept = (altitude > lowest_deg) & (xy > 0.0).all(axis=1) & (xy < (WIDTH - 1.0, HEIGHT - 1.0)).all(axis=1)
    stars = tuple(
        NamedStar(x, y, "", "", 5.0, ra_, dec_, 0.1)
        for (x, y), ra_, dec_ in zip(xy[kept], ra[kept], dec[kept], strict=True)
    )
    camera = FisheyeCamera.centred(WIDTH, HEIGHT, FOCAL_PX)
    solution = Solution(camera, attitude_from(0.0, 0.0, 0.0), stars, 0.2, -30.0, "test")
    return StarsOfFrame.of(f"{time:%H}.fits", solution, Horizon(site, time))


MIDNIGHT = datetime(2024, 6, 5, 4, 0, tzinfo=UTC)


def test_its_pixels_have_the_azimuths_and_altitudes_of_astropy() -> None:
    frames = [frame_at(MIDNIGHT + timedelta(hours=k), seed=k) for k in range(4)]
    camera = calibrated("roof", SITE, frames)
    rng = np.random.default_rng(5)
    azimuth, altitude = rng.uniform(0.0, 360.0, 400), rng.uniform(15.0, 89.0, 400)
    xy = lens(azimuth, altitude)
    inside = (xy > 0.0).all(axis=1) & (xy < (WIDTH - 1.0, HEIGHT - 1.0)).all(axis=1)
    found_az, found_alt, sigma = camera.altaz_deg(xy[inside])
    true = directions_of(azimuth[inside], altitude[inside])
    away = np.degrees(np.arccos(np.clip((directions_of(found_az, found_alt) * true).sum(axis=1), -1.0, 1.0)))
    assert away.max() < 0.01
    assert (away < 2.45 * sigma).mean() > 0.95  # 95 % of two coordinates
    assert np.abs(camera.pixels(true) - xy[inside]).max() < 0.15
    assert sigma.max() < 0.05


@pytest.mark.parametrize(("shared_px", "least", "most"), [(0.0, 0.0, 0.1), (0.6, 0.3, 0.6)])
def test_what_neighbouring_stars_share_is_the_models_error_and_their_noise_is_not(shared_px, least, most) -> None:
    """Waves over the frame that no term of a lens has, an RMS of 0.7 of their height, and 0.2 px of noise."""
    whole = frame_at(MIDNIGHT)
    waves = shared_px * np.sin(2.0 * np.pi * whole.xy[:, ::-1] / 1000.0)
    camera = calibrated("roof", SITE, [replace(whole, xy=whole.xy + waves)])
    assert least <= camera.model_px < most
    assert camera.rms_px >= NOISE_PX


def test_the_middle_of_the_frame_is_between_its_middle_pixels() -> None:
    camera = calibrated("roof", SITE, [frame_at(MIDNIGHT)])
    assert camera.middle.tolist() == [[999.5, 799.5]]


def test_beside_the_circle_of_its_lens_there_is_no_direction() -> None:
    camera = calibrated("roof", SITE, [frame_at(MIDNIGHT)])
    assert np.isfinite(camera.directions(camera.middle)).all()
    assert np.isnan(camera.directions(np.array([[0.0, 0.0]]))).all()  # 1280 px from the middle; the horizon is at 792
    assert np.isnan(camera.pixels(directions_of(np.array([30.0]), np.array([-20.0])))).all()


def test_a_camera_that_was_moved_between_frames_is_refused() -> None:
    frames = [
        frame_at(MIDNIGHT),
        frame_at(MIDNIGHT + timedelta(hours=1)),
        frame_at(MIDNIGHT + timedelta(hours=2), TURN + 0.01),
    ]
    with pytest.raises(UsageError, match=r"06\.fits: its stars stand .* px from where one camera"):
        calibrated("roof", SITE, frames)
    with pytest.raises(UsageError, match="px from where one camera"):
        calibrated("roof", SITE, frames[1:])


def test_a_wrong_time_or_site_is_told_where_stars_stand_below_the_horizon() -> None:
    with pytest.raises(UsageError, match="below the horizon"):
        frame_at(MIDNIGHT, site=Site(52.5, 13.4))


def test_too_few_stars_and_frames_of_two_sizes_are_refused() -> None:
    whole = frame_at(MIDNIGHT)
    few = StarsOfFrame("few", whole.xy[:10], whole.directions[:10], whole.camera, 0.2)
    with pytest.raises(UsageError, match="10 stars are too few"):
        calibrated("roof", SITE, [few])
    other = StarsOfFrame("other", whole.xy, whole.directions, Camera.centred(100, 100, 50.0), 0.2)
    with pytest.raises(UsageError, match="different sizes"):
        calibrated("roof", SITE, [whole, other])


def test_it_is_kept_by_name_and_a_damaged_file_is_told() -> None:
    camera = calibrated("Dach, Süd", SITE, [frame_at(MIDNIGHT)])
    save_fixed_camera(camera)
    again = load_fixed_camera("Dach, Süd")
    assert [one.name for one in fixed_cameras()] == ["Dach, Süd"]
    for before, after in zip(camera.altaz_deg(camera.middle), again.altaz_deg(camera.middle), strict=True):
        np.testing.assert_array_equal(before, after)
    with pytest.raises(UsageError, match="there are: Dach, Süd"):
        load_fixed_camera("garden")
    path = fixed_camera_path("Dach, Süd")
    path.write_text(path.read_text(encoding="utf-8").replace('"focal_px": ', '"focal_px": -'), encoding="utf-8")
    with pytest.raises(KochabError, match="is not a calibration"):
        load_fixed_camera("Dach, Süd")
    assert fixed_cameras() == []


LENS, TURNED = "camera", "enu_to_camera"
FREE = [[0.0, 5.0], [180.0, 20.0]]


@pytest.mark.parametrize(
    ("key", "change", "sound"),
    [
        ("model_px", lambda value: -0.5, False),
        ("model_px", lambda value: 0.0, True),
        ("rms_px", lambda value: -0.1, False),
        ("rms_px", lambda value: 1e6, False),
        ("site", lambda value: [90.0, *value[1:]], True),
        ("site", lambda value: [90.5, *value[1:]], False),
        ("site", lambda value: [value[0], 360.5, value[2]], False),
        ("seen", lambda value: 1.0, True),
        ("seen", lambda value: 0.0, False),
        ("seen", lambda value: 1.01, False),
        ("limit_mag", lambda value: 6.5, True),
        ("limit_mag", lambda value: 2e6, False),
        ("horizon_deg", lambda value: FREE, True),
        ("horizon_deg", lambda value: [], False),
        ("horizon_deg", lambda value: [[0.0, 5.0, 1.0]], False),
        ("horizon_deg", lambda value: [[0.0, 400.0]], False),
        ("terms", lambda value: ["colour", *value[1:]], False),
        ("terms", lambda value: value[1:], False),
        ("covariance", lambda value: (-np.array(value)).tolist(), False),
        (TURNED, lambda value: (np.diag([1.0, 1.0, -1.0]) @ value).tolist(), False),
        (TURNED, lambda value: (1.01 * np.array(value)).tolist(), False),
        (LENS, lambda value: value | {"aspect": 0.0}, False),
        (LENS, lambda value: value | {"width": 1}, False),
        (LENS, lambda value: value | {"width": 2}, True),
        (LENS, lambda value: value | {"k2": 2e6}, False),
    ],
)
def test_a_calibration_with_a_number_that_no_camera_has_is_refused(key, change, sound) -> None:
    path = save_fixed_camera(calibrated("roof", SITE, [frame_at(MIDNIGHT)]))
    content = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(content | {key: change(content[key])}), encoding="utf-8")
    assert bool(fixed_cameras()) is sound
