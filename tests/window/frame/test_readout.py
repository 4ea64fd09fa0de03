"""Altitude and azimuth under the cursor, when the frame says when and somebody says where."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from kochab.core.frame import Hint, Site
from kochab.sky.horizon import horizon_of
from kochab.text.angle_text import AngleStyle
from kochab.window.frame.readout import readout
from tests.window.fakes import fake_solution, star_field

MUNICH = Site(48.14, 11.58, 520.0)
WHEN = datetime(2025, 1, 15, 21, 30, tzinfo=UTC)


def test_altitude_and_azimuth_agree_with_astropy():
    import astropy.units as u
    from astropy.coordinates import AltAz, EarthLocation, SkyCoord
    from astropy.time import Time

    frame = replace(star_field(), hint=Hint(time_utc=WHEN, site=MUNICH))
    horizon = replace(horizon_of(frame, None), refraction=replace(horizon_of(frame, None).refraction, pressure_hpa=0.0))
    ra, dec = 83.82, -5.39
    v = np.array(
        [
            np.cos(np.radians(dec)) * np.cos(np.radians(ra)),
            np.cos(np.radians(dec)) * np.sin(np.radians(ra)),
            np.sin(np.radians(dec)),
        ]
    )
    place = EarthLocation(MUNICH.longitude_deg * u.deg, MUNICH.latitude_deg * u.deg, MUNICH.height_m * u.m)
    time = Time(WHEN.replace(tzinfo=None))
    time.delta_ut1_utc = 0.0
    there = SkyCoord(ra * u.deg, dec * u.deg).transform_to(AltAz(obstime=time, location=place))
    assert horizon.altaz_deg(v) == pytest.approx((there.alt.deg, there.az.deg), abs=0.003)


def test_the_frame_s_own_site_comes_first_and_without_a_time_nothing_is_said():
    frame, solution = star_field(), fake_solution(600, 400)

    def say(hint, site):
        told = replace(frame, hint=hint)
        return readout(told, solution, 300, 200, AngleStyle.DECIMAL, site)

    assert "alt" not in say(Hint(time_utc=WHEN), None)
    assert "alt" not in say(Hint(site=MUNICH), MUNICH)
    ours = say(Hint(time_utc=WHEN), MUNICH)
    assert "alt +" in ours
    assert say(Hint(time_utc=WHEN, site=MUNICH), Site(-33.0, 20.0)) == ours


def test_a_typed_site_is_kept_and_used(qtbot, make_window, engine, a_file):
    engine.frame = replace(engine.frame, hint=Hint(time_utc=WHEN))
    window, commands = make_window(engine)
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(a_file)
    field = window.workspace.hints.site
    field.setText("east of the barn")
    field.editingFinished.emit()
    assert "is not a site" in window.workspace.hints.wrong.text()
    field.setText("48.14, 11.58, 520")
    field.editingFinished.emit()
    assert not window.workspace.hints.wrong.isVisible()
    window.workspace.view.hovered.emit((300.0, 200.0))
    assert "alt " in window.status.place.text()
    window.close()
    again, new = make_window(engine)
    assert new.settings.site == MUNICH
    assert again.workspace.hints.site.text() == "48.14, 11.58, 520"
