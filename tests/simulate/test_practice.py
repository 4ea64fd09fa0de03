"""A practice night: it starts, answers on a line, writes frames, obeys hands, scores and ends."""

import re
import socket
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from kochab.core.attitude import apart_deg, unit_vectors
from kochab.core.capture import CaptureSettings
from kochab.core.errors import LineLostError, PortError, UsageError
from kochab.core.frame import Site
from kochab.core.mount import Epoch, Home
from kochab.gear.cameras import list_devices, open_camera
from kochab.simulate.camera import CameraConfig
from kochab.simulate.camera_source import RUNNING, SimulatedCamera
from kochab.simulate.night_sky import sun_altitude_deg
from kochab.simulate.practice import HELP, PracticeNight
from kochab.simulate.responders import RESPONDERS
from kochab.simulate.rig import PracticeRig, RigConfig, misaligned, practice_night, through, tonight

SMALL = CameraConfig(width=320, height=240, fov_deg=1.5)


@pytest.fixture
def practice():
    rig = replace(misaligned(tonight(3), 40.0, 3.0), camera=SMALL, rate=50.0)
    running = PracticeNight(rig, socket=True)
    yield running
    running.stop()


def ask(port, question):
    """Ask over TCP and read until ``#``; ConnectionError when nobody answers."""
    host, number = port.removeprefix("socket://").split(":")
    with socket.create_connection((host, int(number)), timeout=60) as line:
        line.sendall(question)
        told = b""
        while not told.endswith(b"#"):
            part = line.recv(64)
            if not part:
                raise ConnectionResetError(port)
            told += part
        return told


@pytest.mark.parametrize("now", [1_800_000_000.0, 1_787_000_000.0, 1_750_000_000.0 + 40_000.0])
def test_it_is_night_wherever_one_practises(now):
    anywhere = tonight(0, None, now)
    assert anywhere.start_unix == now
    assert sun_altitude_deg(now, anywhere.site) < -16.0
    for site in (Site(47.0, 8.0), Site(-33.0, 151.0)):
        there = tonight(0, site, now)
        assert sun_altitude_deg(there.start_unix, site) < -16.0
        assert abs(there.start_unix - now) <= 43200.0


def test_the_misalignment_is_as_large_as_asked_and_hidden_by_the_seed():
    for seed in range(5):
        rig = PracticeRig(replace(misaligned(tonight(seed), 30.0), rate=0.0))
        assert rig.truth().axis_error().total_arcsec == pytest.approx(1800.0, rel=0.02)
    azimuths = {misaligned(tonight(s), 30.0).mount.misalignment_arcmin for s in range(5)}
    assert len(azimuths) == 5
    own = misaligned(tonight(1), None).mount.misalignment_arcmin
    assert own == misaligned(tonight(1), None).mount.misalignment_arcmin


def test_bad_luck_is_only_with_those_who_ask_for_it():
    fair, foul = (practice_night(tonight(2), faults) for faults in (False, True))
    assert not fair.events
    assert fair.weather.cloud_cover == fair.weather.wind_arcsec == fair.mount.hour_gear.slip == 0.0
    assert {event.kind for event in foul.events} == {"kick", "slip"}
    assert foul.weather.cloud_cover > 0.0
    assert foul.mount.hour_gear.slip > 0.0


def test_the_mount_answers_where_it_says(practice):
    answer = ask(practice.port, b":GD#")
    degrees, minutes = re.match(rb"([+-]\d\d).(\d\d)", answer).groups()
    told = float(degrees) + float(minutes) / 60.0 * (-1.0 if degrees[:1] == b"-" else 1.0)
    assert told == pytest.approx(practice.rig.mount.believed_deg()[1], abs=0.1)


@pytest.mark.parametrize("driver", sorted(RESPONDERS))
def test_our_own_drivers_drive_it(driver):
    """Read, sync and slew over the line: the rig's belief follows, whatever the protocol."""
    from kochab.gear.mounts import open_mount

    night = replace(tonight(3), camera=SMALL, rate=50.0)
    running = PracticeNight(night, driver=driver, socket=True)
    mount = running.rig.mount
    try:
        client = open_mount(driver, running.port, site=night.site, clock=running.rig.clock.now_utc, home=Home.POWER_ON)
        told, before = client.position(), mount.believed_deg()
        if driver != "skywatcher":  # a motor board counts from where it was switched on
            away = unit_vectors(told.ra_deg, told.dec_deg) - unit_vectors(*before)
            near = 0.5 if client.epoch is Epoch.J2000 else 0.05
            assert np.degrees(np.linalg.norm(away)) < near
        client.goto(told.ra_deg, told.dec_deg - 3.0)
        until = time.monotonic() + 90.0
        while time.monotonic() < until and (mount.slewing or client.state().slewing):
            time.sleep(0.02)
        assert mount.believed_deg()[1] == pytest.approx(before[1] - 3.0, abs=0.1)
        client.close()
    finally:
        running.stop()


@pytest.mark.parametrize("fov_deg", [1.2, 10.0, 40.0])
def test_any_field_gives_stars_and_no_flood_of_them(fov_deg):
    night = tonight(3, None, 1_800_000_000.0)  # a fixed one: other nights show other fields
    rig = PracticeRig(replace(through(night, fov_deg), rate=0.0))
    rig.frame(1.0)
    listed, _ = rig.star_list(2.0)
    assert 5 < len(listed) <= 300


def test_it_scores_what_hands_have_done(practice):
    first = practice.score()
    error = practice.rig.mount.wedge.error_arcmin
    assert practice.do(f"alt {-error[0]}") == "Altitude bolt turned."
    practice.do(f"AZ {-error[1]}")
    assert practice.score().axis_arcsec < 2.0
    assert practice.score().points >= first.points + 45
    assert "Score" in practice.do("score")
    before = practice.rig.truth().of_date_deg
    practice.do("ra 5")
    practice.do("dec -2")
    assert abs(practice.rig.truth().of_date_deg[1] - before[1]) > 1.0
    practice.do("track off")
    assert not practice.rig.mount.tracking
    assert practice.do("  ") == ""
    assert "alt ARCMIN" in practice.do("help")


@pytest.mark.parametrize("line", ["ra 25", "dec -12"])
def test_a_turn_that_was_asked_for_costs_no_points_until_a_sync(practice, line):
    """Unlike turns that nobody asked for: the tutor has hands turn the RA axis by tens of degrees."""
    mount = practice.rig.mount
    mount.turn_bolts(*(-mount.wedge.error_arcmin))
    mount.sync(*practice.rig.truth().of_date_deg)
    practice.do(f"{line} asked")
    assert practice.score().pointing_arcsec < 60.0
    assert apart_deg(mount.believed_deg(), practice.rig.truth().of_date_deg) > 5.0
    mount.sync(*practice.rig.truth().of_date_deg)
    assert practice.score().pointing_arcsec < 60.0
    practice.do(line)
    assert practice.score().pointing_arcsec > 3600.0


def test_the_bolts_that_the_tutor_has_turned_cost_no_points_and_a_kick_does(practice):
    """They move the tube as far as the axis: whoever had aligned to 8 arcsec was told to be 48 arcmin off."""
    mount = practice.rig.mount
    mount.sync(*practice.rig.truth().of_date_deg)
    assert practice.score().pointing_arcsec < 60.0
    error = mount.wedge.error_arcmin
    practice.do(f"alt {-error[0] + 40.0}")
    practice.do(f"az {-error[1]}")
    told = practice.score()
    assert told.off_arcsec > 600.0
    assert told.off_arcsec == pytest.approx(
        apart_deg(mount.believed_deg(), practice.rig.truth().of_date_deg) * 3600.0, abs=2.0
    )
    assert told.pointing_arcsec < 60.0
    mount.sync(*practice.rig.truth().of_date_deg)
    assert practice.score().off_arcsec < 60.0
    mount.turn_bolts(40.0, 30.0)
    assert practice.score().pointing_arcsec > 600.0, "nobody asked for that"


@pytest.mark.parametrize("line", ["dance", "alt", "alt much", "track maybe", "fault nonsense", "ra 1e"])
def test_what_is_not_understood_is_said_in_one_sentence(practice, line):
    with pytest.raises(UsageError) as told:
        practice.do(line)
    assert "\n" not in str(told.value)
    assert "help" in str(told.value)


@pytest.mark.parametrize("line", ["alt nan", "az 1e400", "ra -1e9", "dec inf", "fault silence 0", "fault garbage 9999"])
def test_what_no_hand_can_do_is_refused_and_nothing_moves(practice, line):
    before = practice.score()
    with pytest.raises(UsageError):
        practice.do(line)
    assert practice.score().axis_arcsec == pytest.approx(before.axis_arcsec)


def test_every_command_of_the_help_is_known(practice):
    typed = {"alt": "1", "az": "1", "ra": "1", "dec": "1", "track": "on", "fault": "late", "score": ""}
    assert {line.split()[0].strip(",") for line in HELP} == {*typed, "pull", "help"}
    for name, words in typed.items():
        assert practice.do(f"{name} {words}")


def test_the_cable_can_be_pulled_and_put_back(practice):
    practice.do("fault silence 1")
    practice.do("pull")
    with pytest.raises(ConnectionError):
        ask(practice.port, b":GD#")
    practice.do("plug")
    practice.faults.none()
    assert ask(practice.port, b":GD#").endswith(b"#")


def test_frames_are_written_whole_and_read_back_as_seen(tmp_path):
    from kochab.frames import read_frame

    rig = replace(tonight(3), camera=SMALL, rate=50.0)
    (tmp_path / "new").mkdir()
    mine = tmp_path / "new" / "practice-00001.fits"
    mine.write_bytes(b"of another night")
    began = time.time()
    running = PracticeNight(rig, socket=True, folder=tmp_path / "new", exposure_s=5.0)
    try:
        until = time.monotonic() + 90.0
        while len(list((tmp_path / "new").glob("*.fits"))) < 3 and time.monotonic() < until:
            time.sleep(0.02)
    finally:
        running.stop()
    assert mine.read_bytes() == b"of another night"
    paths = sorted((tmp_path / "new").iterdir())[1:]
    assert [p.name for p in paths[:2]] == ["practice-00002.fits", "practice-00003.fits"]
    frame = read_frame(paths[0])
    assert frame.pixels.shape == (240, 320)
    assert frame.hint.exposure_s == 5.0
    assert frame.hint.site.latitude_deg == pytest.approx(rig.site.latitude_deg)
    written_s = rig.rate * (paths[0].stat().st_mtime - began)  # a busy machine begins later
    assert rig.start_unix + 2.4 < frame.hint.time_utc.timestamp() < rig.start_unix + written_s
    assert not running.trouble


def test_a_folder_that_cannot_be_is_said(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="cannot be used as a folder"):
        PracticeNight(tonight(), folder=tmp_path / "file")
    with pytest.raises(UsageError, match="no simulated mount 'tractor'"):
        PracticeNight(tonight(), driver="tractor")


def test_stopping_leaves_no_thread_and_no_port():
    before = threading.active_count()
    running = PracticeNight(replace(tonight(1), camera=SMALL), socket=True)
    port = running.port
    running.stop()
    running.stop()
    assert threading.active_count() == before
    with pytest.raises(ConnectionError):
        ask(port, b":GD#")


def test_the_rigs_camera_is_one_of_the_sources(practice):
    names = [device.address for device in list_devices("simulated")]
    assert practice.camera in names
    assert names[-1] == "new"
    camera = open_camera("simulated", practice.camera, CaptureSettings(exposure_s=2.0))
    frame = camera.next_frame(20.0)
    assert frame is not None
    assert frame.pixels.shape == (240, 320)
    camera.close()
    with pytest.raises(PortError, match="No practice telescope is called 'moon'"):
        open_camera("simulated", "moon")


def test_the_source_gives_the_newest_frame_and_none_before_it_is_over():
    rig = PracticeRig(RigConfig(rate=1.0, camera=SMALL))
    camera = SimulatedCamera(rig, CaptureSettings(exposure_s=30.0))
    assert camera.next_frame(0.05) is None
    rig.clock.step(95.0)
    newest = camera.next_frame(0.05)
    assert newest.hint.time_utc.timestamp() == pytest.approx(rig.start_unix + 75.0, abs=1.0)
    assert camera.next_frame(0.05) is None
    assert camera.configure(CaptureSettings(exposure_s=1000.0, gain=5.0)) == CaptureSettings(60.0, 5.0, 1)


def test_on_a_standing_clock_the_source_lets_time_pass():
    rig = PracticeRig(RigConfig(rate=0.0, camera=SMALL))
    camera = SimulatedCamera(rig, CaptureSettings(exposure_s=3.0))
    moments = [camera.next_frame(1.0).hint.time_utc.timestamp() - rig.start_unix for _ in range(3)]
    np.testing.assert_allclose(moments, [1.5, 4.5, 7.5], atol=1e-3)


def test_an_unplugged_camera_says_so_at_once():
    rig = PracticeRig(RigConfig(rate=1.0, camera=SMALL))
    camera = SimulatedCamera(rig, CaptureSettings(exposure_s=60.0))
    threading.Timer(0.1, camera.close).start()
    with pytest.raises(LineLostError):
        camera.next_frame(20.0)


def test_a_practice_that_has_ended_lends_its_camera_no_more():
    rig = replace(misaligned(tonight(3), 40.0, 3.0), camera=SMALL, rate=50.0)
    running = PracticeNight(rig, socket=True)
    camera = open_camera("simulated", running.camera)
    running.stop()
    assert running.camera not in [device.address for device in list_devices("simulated")]
    with pytest.raises(PortError, match="No practice telescope"):
        open_camera("simulated", running.camera)
    camera.close()


def test_a_rig_that_is_gone_is_listed_no_more():
    rig = PracticeRig(RigConfig(rate=0.0, camera=SMALL))
    from kochab.simulate.camera_source import announce

    name = announce(rig)
    assert name in RUNNING
    del rig
    assert name not in RUNNING
