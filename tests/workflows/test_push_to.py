"""Push-to: a person who follows the words reaches the target, on a Dobsonian and on the practice mount."""

import random
import time
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import astropy.units as u
import pytest
from astropy.coordinates import AltAz, EarthLocation, SkyCoord
from astropy.time import Time

from kochab.core.attitude import apart_deg
from kochab.core.capture import CaptureSettings
from kochab.core.frame import Site
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.gear.cameras import open_camera
from kochab.simulate.practice import practise
from kochab.solver import SolveOptions
from kochab.workflows.goto_target import target_at
from kochab.workflows.solve_frame import solve_open_frame
from kochab.workflows.telescope.offered import OfferedTelescope
from kochab.workflows.telescope.push_to import OLD_S, THERE_DEG, phone_json, push_to

SITE = Site(48.14, 11.58, 520.0)
PLACE = EarthLocation(lat=SITE.latitude_deg * u.deg, lon=SITE.longitude_deg * u.deg, height=SITE.height_m * u.m)
EVENING = datetime(2026, 11, 26, 20, 0, tzinfo=UTC)


class Dobsonian:
    """Stands on the ground at an altitude and azimuth, in airless astropy; hands are a tenth off and slip."""

    def __init__(self, altitude, azimuth, seed):
        self.altitude, self.azimuth, self.now, self._hands = altitude, azimuth, EVENING, random.Random(seed)

    def icrs_deg(self):
        frame = AltAz(obstime=Time(self.now), location=PLACE)
        there = SkyCoord(self.azimuth * u.deg, self.altitude * u.deg, frame=frame).icrs
        return there.ra.deg, there.dec.deg

    def push(self, right, up):
        self.azimuth += right * self._hands.uniform(0.9, 1.1) + self._hands.gauss(0.0, 0.01)
        self.altitude += up * self._hands.uniform(0.9, 1.1) + self._hands.gauss(0.0, 0.01)
        self.now += timedelta(seconds=20)


@pytest.mark.filterwarnings(  # 0.3 arcsec; the oldest tables end before this evening
    "ignore:Tried to get polar motions", "ignore:.some. times are outside of range covered by IERS"
)
@pytest.mark.parametrize("seed", range(6))
def test_hands_that_follow_the_words_bring_a_dobsonian_within_five_minutes_of_arc(seed) -> None:
    chance = random.Random(seed)
    tube = Dobsonian(chance.uniform(20.0, 75.0), chance.uniform(0.0, 360.0), seed)
    telescope = OfferedTelescope(print, now=lambda: tube.now, site=SITE)
    aim = Dobsonian(chance.uniform(25.0, 70.0), chance.uniform(0.0, 360.0), seed)
    telescope.target = target_at(*aim.icrs_deg())
    for _ in range(8):
        telescope.see_mount(tube.icrs_deg())
        way = push_to(telescope, time.monotonic())
        if way.there:
            break
        assert way.words.startswith("Push ")
        tube.push(way.right_deg, way.up_deg)
    true = apart_deg(tube.icrs_deg(), (telescope.target.ra_deg, telescope.target.dec_deg))
    assert true <= THERE_DEG
    assert way.distance_deg == pytest.approx(true, abs=1e-6)


def test_a_practice_mount_is_pushed_to_a_target_by_its_camera_alone() -> None:
    """Frames of the simulated camera, solved, and hands on the axes of a mount that has not noticed."""
    night = practise(site=Site(48.0, 11.0), misalign_arcmin=20.0, lost_deg=3.0, rate=1.0, fov_deg=4.0)
    try:
        camera = open_camera("simulated", night.camera, CaptureSettings(exposure_s=0.5))
        telescope = OfferedTelescope(print, now=night.rig.clock.now_utc)

        def look():
            # Not the frame that was being exposed while the telescope was pushed, however slow the machine is.
            until, after = time.monotonic() + 150.0, night.rig.clock.now_utc() + timedelta(seconds=0.3)
            while time.monotonic() < until:
                frame = camera.next_frame(1.0)
                if frame is None or frame.hint.time_utc < after:
                    continue
                result = run(solve_open_frame(frame, SolveOptions())).result
                if isinstance(result, Solution):
                    telescope.see_solution(result)
                    return
            raise AssertionError("no frame was solved")

        look()
        ra, dec = telescope.seen.icrs_deg
        telescope.target = target_at((ra + 14.0) % 360.0, dec - 9.0 if dec > 20.0 else dec + 9.0)
        signs = {"ra": 1.0, "dec": 1.0}  # the side of the pier decides, and a person sees it
        for _ in range(8):
            way = push_to(telescope, time.monotonic())
            if way.there:
                break
            for axis, wanted in (("ra", way.right_deg), ("dec", way.up_deg)):
                night.do(f"{axis} {signs[axis] * wanted:.4f}")
                look()
                now = push_to(telescope, time.monotonic())
                if abs(now.right_deg if axis == "ra" else now.up_deg) > abs(wanted):
                    signs[axis] = -signs[axis]
        camera.close()
        assert push_to(telescope, time.monotonic()).distance_deg <= THERE_DEG
    finally:
        night.stop()


def test_the_way_without_a_site_is_along_the_axes_of_an_equatorial_mount() -> None:
    telescope = OfferedTelescope(print)
    assert push_to(telescope, 0.0) is None
    telescope.target = target_at(10.0, 40.0)
    assert push_to(telescope, 0.0) is None
    telescope.see_mount((20.0, 30.0))
    way = push_to(telescope, time.monotonic())
    assert way.words == "Push 10.00° west, 10.00° north."
    assert 0.0 < way.arrow_deg < 45.0
    telescope.see_mount((10.0, 40.01))
    assert push_to(telescope, time.monotonic()).there
    assert "in the eyepiece" in push_to(telescope, time.monotonic()).words


def test_an_old_solve_is_told_and_is_never_there() -> None:
    telescope = OfferedTelescope(print)
    telescope.target = target_at(10.0, 40.0)
    telescope.see_mount((10.0, 40.0))
    way = push_to(telescope, time.monotonic() + OLD_S + 5.0)
    assert not way.there
    assert way.age_words.startswith("Last solved 1")


def test_what_is_felt_since_the_last_solve_is_told_with_its_sigma() -> None:
    telescope, now_s = OfferedTelescope(print), time.monotonic()
    telescope.target = target_at(10.0, 40.0)
    felt = SimpleNamespace(icrs_deg=(10.0, 41.0), at_s=now_s, sigma_deg=4.0 / 60.0)
    telescope.aid = SimpleNamespace(see=lambda solution, at_s: None, pointing=lambda eyepiece: felt)
    telescope.see_solution(SimpleNamespace(), now_s - 5.0)
    assert push_to(telescope, now_s).age_words == ""
    telescope.see_solution(SimpleNamespace(), now_s - 45.0)
    way = push_to(telescope, now_s)
    assert way.age_words == "Last solved 45 s ago; position since then from encoders or gyroscope (± 4.0′)."
    assert "50 s ago" in str(phone_json(way, now_s + 5.0)["age"])


def test_a_target_below_the_horizon_is_told() -> None:
    telescope = OfferedTelescope(print, now=lambda: EVENING, site=SITE)
    telescope.target = target_at(10.0, -80.0)
    telescope.see_mount((10.0, 40.0))
    assert "below the horizon" in push_to(telescope, time.monotonic()).words
