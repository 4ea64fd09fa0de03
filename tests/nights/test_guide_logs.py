"""The guide logs' maker against what it had no part in: textbook drift, astropy's frames, rows that PHD2 itself wrote."""

import csv
import math
from dataclasses import replace
from datetime import datetime

import astropy.units as u
import numpy as np
import pytest
from astropy.coordinates import AltAz, EarthLocation, SkyCoord
from astropy.time import Time

from tests.nights import guide_logs
from tests.nights.guide_logs import (
    ARCSEC,
    KINDS,
    TEMPERATURE_C,
    Guider,
    Hysteresis,
    Play,
    ResistSwitch,
    Section,
    compare,
    evening,
    evenings,
    observed_enu,
    place_in_mount,
    pressure_hpa,
    refracted_pole,
    score,
    write_log,
)

# Rows 26 to 66 of a log that PHD2 wrote on 18 March 2022 (metalglove/astro-guiding-performance,
# data/PHD2_GuideLog_2022-03-18_210258.txt): dx, dy, RA raw, Dec raw, RA guide, Dec guide, RA ms, Dec ms.
# Hysteresis 0.1, aggression 0.7, minimum 0.1; resist switch, minimum 0.1, aggression 100 %, fast switch;
# xAngle 59.7, xRate 0.420, yAngle 148.2, yRate 1.190; Max RA duration 1500.
WRITTEN_BY_PHD2 = """\
0.076,0.058,0.088,-0.038,0.000,0.000,0,0
0.144,0.025,0.094,-0.114,0.000,-0.114,0,95
0.015,0.082,0.078,0.027,0.000,0.000,0,0
0.091,0.049,0.088,-0.057,0.000,0.000,0,0
0.042,0.075,0.086,-0.001,0.000,0.000,0,0
0.057,0.170,0.176,0.032,0.111,0.000,264,0
0.110,0.126,0.164,-0.036,0.111,0.000,265,0
0.314,0.020,0.176,-0.265,0.118,-0.265,282,223
0.070,0.138,0.155,0.005,0.106,0.000,252,0
0.534,0.752,0.919,-0.106,0.586,-0.106,1397,89
0.442,0.898,0.999,0.046,0.670,0.000,1500,0
0.153,0.318,0.352,0.019,0.269,0.000,640,0
-0.427,-0.438,-0.594,0.163,-0.355,0.000,846,0
-1.019,-1.064,-1.433,0.380,-0.927,0.380,1500,319
-0.827,-0.412,-0.772,0.526,-0.552,0.526,1314,442
-0.369,-0.023,-0.206,0.312,-0.168,0.312,401,262
-0.436,0.140,-0.099,0.450,0.000,0.450,0,378
-0.441,0.068,-0.164,0.419,-0.103,0.419,246,352
-0.454,0.005,-0.225,0.401,-0.149,0.401,354,337
-0.363,0.135,-0.067,0.383,0.000,0.383,0,322
-0.400,-0.014,-0.213,0.344,-0.134,0.344,320,289
-0.409,0.239,0.000,0.473,0.000,0.473,0,398
-0.271,0.181,0.020,0.325,0.000,0.325,0,273
-0.300,0.238,0.055,0.378,0.000,0.378,0,317
-0.128,0.197,0.106,0.207,0.067,0.207,159,174
-0.088,0.091,0.034,0.121,0.000,0.121,0,102
-0.014,0.185,0.153,0.102,0.096,0.102,230,85
"""
ROWS = np.array([[float(value) for value in line.split(",")] for line in WRITTEN_BY_PHD2.splitlines()])


def section(hour_angle_deg=0.0, dec_deg=0.0, **other):
    return Section(0.0, 10.0, hour_angle_deg, dec_deg, 1, "West", **other)


def still(**other):
    """An evening with nothing but a misaligned axis."""
    usual = {"seeing_px": 0.0, "backlash_arcsec": 0.0, "periodic_arcsec": 0.0, "skew_deg": 0.0, "latitude_deg": 45.0}
    return replace(evening("plain", 3), **{**usual, "calibrated_over_true": (1.0, 1.0), **other})


def north_drift_arcsec_min(night, where):
    guider = Guider(night, where, np.random.default_rng(1))
    return float(np.polyfit(guider._times[:13], guider._north[:13], 1)[0] * 60)


@pytest.fixture
def no_air(monkeypatch):
    monkeypatch.setattr(guide_logs, "pressure_hpa", lambda height_m: 0.0)


# Textbook drift alignment (and PHD2's manual): a star near the meridian that drifts south has the axis too far east,
# one in the east that drifts south has it too low; the error in arcmin is 3.82 times the drift in arcsec a minute.
@pytest.mark.parametrize(
    ("azimuth", "altitude", "hour_angle", "drift"),
    [(1, 0, 0, -1), (-1, 0, 0, 1), (0, -1, -90, -1), (0, 1, -90, 1), (0, -1, 90, 1)],
)
def test_the_drift_is_the_textbooks_in_size_and_sense(no_air, azimuth, altitude, hour_angle, drift):
    on_sky = 10 / 60  # degrees
    night = still(azimuth_error_deg=azimuth * on_sky / math.cos(math.radians(45)), altitude_error_deg=altitude * on_sky)
    assert north_drift_arcsec_min(night, section(hour_angle)) * 3.82 == pytest.approx(10 * drift, abs=0.25)


def test_in_the_south_a_star_at_the_meridian_drifts_the_other_way(no_air):
    """A southern axis that is too far east: the same star drifts north."""
    night = still(latitude_deg=-45.0, azimuth_error_deg=-10 / 60 / math.cos(math.radians(45)), altitude_error_deg=0.0)
    assert north_drift_arcsec_min(night, section()) * 3.82 == pytest.approx(10, abs=0.25)


@pytest.mark.parametrize("latitude", [45.0, -35.0])
def test_a_mount_on_the_pole_sees_no_drift(no_air, latitude):
    night = still(latitude_deg=latitude, azimuth_error_deg=0.0, altitude_error_deg=0.0)
    guider = Guider(night, section(30, 0.2 * latitude), np.random.default_rng(1))
    assert np.abs([guider._west, guider._north]).max() < 0.1


def test_the_sky_is_astropys():
    night = replace(still(), height_m=700.0)
    start = Time(datetime.fromisoformat(night.utc))
    place = EarthLocation(lat=night.latitude_deg * u.deg, lon=night.longitude_deg * u.deg, height=700 * u.m)
    pressure = pressure_hpa(700.0)
    assert pressure == pytest.approx(931.9, abs=0.5)  # the standard atmosphere's tables
    for hour_angle, dec in [(-60, 10), (20, 70), (50, -10)]:
        star = guide_logs._star(night, section(hour_angle, dec))
        times = np.array([0.0, 3600.0])
        seen = SkyCoord(star[0] * u.rad, star[1] * u.rad).transform_to(
            AltAz(obstime=start + times * u.s, location=place, pressure=pressure * u.hPa, temperature=TEMPERATURE_C * u.deg_C, relative_humidity=0.5, obswl=0.55 * u.um)
        )  # fmt: skip
        theirs = seen.cartesian.xyz.value.T[:, [1, 0, 2]]
        ours = observed_enu(night, star, times)
        assert np.abs(theirs - ours).max() < 15 * ARCSEC  # dUT1 of up to 0.9 s
        assert np.abs((theirs[1] - theirs[0]) - (ours[1] - ours[0])).max() < 10 * ARCSEC


def test_the_pole_is_lifted_as_saemundsson_says(no_air, monkeypatch):
    night = still(latitude_deg=40.0)
    assert math.degrees(refracted_pole(night)[1]) == pytest.approx(40.0, abs=1e-9)
    monkeypatch.setattr(guide_logs, "pressure_hpa", lambda height_m: 1010.0)
    lift = (math.degrees(refracted_pole(night)[1]) - 40.0) * 60
    assert lift == pytest.approx(1.02 / math.tan(math.radians(40 + 10.3 / 45.11)), abs=0.07)


def test_the_guider_asks_for_what_phd2_asked():
    ra, dec = Hysteresis(0.1), ResistSwitch(0.1)
    dec.history, dec.side = [-0.02] * 10, -1.0  # it had answered to the north before these rows
    for _, _, ra_raw, dec_raw, ra_guide, dec_guide, ra_ms, dec_ms in ROWS:
        asked = ra.result(ra_raw), dec.result(dec_raw)
        assert asked == pytest.approx((ra_guide, dec_guide), abs=0.0015)
        assert min(abs(asked[0]) / 0.420 * 1000, 1500) == pytest.approx(ra_ms, abs=4)
        assert abs(asked[1]) / 1.190 * 1000 == pytest.approx(dec_ms, abs=2)


def test_camera_offsets_turn_into_mount_offsets_as_phd2_turned_them():
    guider = Guider(still(), section(), np.random.default_rng(1))
    guider.x_angle, guider.y_angle = math.radians(59.7), math.radians(148.2)
    for dx, dy, *raw in ROWS:
        assert guider.to_mount(np.array([dx, dy])) == pytest.approx(raw[:2], abs=0.003)


def test_play_swallows_what_a_reversal_first_turns():
    gear = Play(5.0)
    reached = []
    for amount in (-2, 7, 3, -4, -4):
        gear.turn(amount)
        reached.append(gear.telescope)
    assert reached == [-2, 0, 3, 3, 0]


@pytest.mark.parametrize("parity", [1, -1])
def test_pulses_and_offsets_of_a_quiet_log_add_up_to_the_drift(tmp_path, parity):
    night = still(
        altitude_error_deg=0.8,
        camera_angle_deg=110.0,
        sections=(replace(section(-50, 20), dec_parity=parity, minutes=30.0),),
    )
    write_log(night, tmp_path / "log.txt")
    guider = Guider(night, night.sections[0], np.random.default_rng(1))
    rows = [
        row
        for row in csv.reader((tmp_path / "log.txt").read_text().splitlines())
        if len(row) == 18 and row[0].isdigit()
    ]
    pulsed = 0.0
    for row in rows:
        measured = float(row[6]) + pulsed
        pulsed += int(row[11] or 0) / 1000 * guider.y_rate * {"S": 1, "N": -1, "": 0}[row[12]]
    drift = -parity * np.interp(float(rows[-1][1]), guider._times, guider._north) / night.scale_arcsec_px
    assert abs(drift) > 3
    assert measured == pytest.approx(drift, abs=0.1)


def test_a_seed_is_an_evening(tmp_path):
    for kind in KINDS:
        for name in ("a", "b"):
            night = evening(kind, 5)
            short = tuple(replace(part, minutes=5.0) for part in night.sections)
            write_log(replace(night, sections=short), tmp_path / name)
        assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_two_hundred_evenings_hold_every_kind_at_every_seeing():
    drawn = {(night.kind, night.seeing_px) for night in evenings(200, 1)}
    assert len(drawn) == len(KINDS) * 5


def test_a_direction_is_where_the_mount_sees_it():
    """The axis itself is at declination 90 degrees, and what is west of the meridian has turned on."""
    night = still(azimuth_error_deg=1.0)
    axis = guide_logs.axis_enu(night)
    assert math.degrees(place_in_mount(night, axis[None], [0.0])[1][0]) == pytest.approx(90, abs=1e-5)
    west = np.array([[-math.sin(0.1), -math.cos(0.1), 0.0]])
    assert place_in_mount(night, west, [0.0])[0][0] > 0


def test_an_answer_is_compared_along_its_own_ellipse():
    night = still(azimuth_error_deg=0.0, altitude_error_deg=0.1)
    answer = {
        "azimuth_error_on_sky_arcsec": 0.0, "altitude_error_arcsec": 396.0, "sigma_total_arcsec": 20.0,
        "ellipse_arcsec": [15.15 * 2, 15.15], "ellipse_from_azimuth_deg": 0.0,
    }  # fmt: skip
    distance, along, total = compare(night, answer)
    assert distance == pytest.approx(3.6, abs=0.01)
    assert (along, total) == pytest.approx((1.1, 1.1))


def test_kochab_finds_the_axes_of_a_handful_of_evenings(tmp_path):
    """Of six logs one may be outside its 95 % ellipse; none is refused, and no median is drawn to nothing."""
    scores = []
    for kind in ("plain", "dither", "parity reversed", "two sections", "clouds", "ASIAIR"):
        night = evening(kind, 1001)
        write_log(night, tmp_path / "log.txt")
        scores.append(score(night, tmp_path / "log.txt"))
    assert [one.verdict for one in scores].count("inside") >= 5, scores
    assert np.nanmedian([one.total for one in scores]) == pytest.approx(1, abs=0.05)


def test_an_axis_a_degree_off_is_found_at_declination_60(tmp_path):
    """Without faults. Pulses added up as in a plane miss by the square of the error and tan(Dec): 102 arcsec here."""
    night = replace(
        evening("plain", 1015), latitude_deg=46.5, azimuth_error_deg=0.87, altitude_error_deg=0.73, seeing_px=0.02
    )
    where = Section(0.0, 124.0, 40.0, 60.0, 1, "West")
    night = replace(
        night,
        calibrated_over_true=(1.0, 1.0),
        periodic_arcsec=0.0,
        skew_deg=0.0,
        backlash_arcsec=0.0,
        sections=(where,),
    )
    write_log(night, tmp_path / "log.txt")
    assert score(night, tmp_path / "log.txt").distance < 2.45


def test_nine_minutes_of_a_worm_of_eleven_say_nothing_of_the_drift_in_ra(tmp_path):
    """Unguided, 10 arcsec of periodic error, axes 2 deg from square: once on the other side of the pole, 6.7 sigma away."""
    night = evening("assistant", 1016)
    write_log(night, tmp_path / "log.txt")
    assert score(night, tmp_path / "log.txt").verdict != "outside"
