"""The mount: what it believes, where it really points, and what it refuses; both hemispheres."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kochab.core.attitude import unit_vectors
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_DEG_S, Direction, PierSide
from kochab.simulate.mechanics.axis import GearErrors
from kochab.simulate.mechanics.geometry import BoltErrors, Build, MountConfig, Wedge, camera_to_enu, mount_to_enu
from kochab.simulate.mechanics.mount import EquatorialMount, fold, unfold, wrapped
from kochab.simulate.night_sky import SimulatedClock, altitude_deg, azimuth_deg

START = 1_800_000_000.0
NORTH, SOUTH = Site(47.0, 8.0), Site(-33.0, 151.0)


def mount_at(site=NORTH, **config):
    clock = SimulatedClock(START, rate=0.0)
    return EquatorialMount(MountConfig(**config), site, clock), clock


def separation_arcsec(a, b):
    return np.degrees(np.linalg.norm(unit_vectors(*a) - unit_vectors(*b))) * 3600.0


def settle(mount, clock):
    clock.step(max(0.0, mount.busy_until() - clock.now_unix()) + 1e-3)


def visible(mount, hour, dec):
    return (mount.sidereal_deg() - hour) % 360.0, dec


@pytest.mark.parametrize(("site", "dec"), [(NORTH, 20.0), (NORTH, 75.0), (SOUTH, -20.0), (SOUTH, -75.0)])
@pytest.mark.parametrize("hour", [-60.0, -5.0, 5.0, 60.0])
def test_a_goto_arrives_tracks_and_says_so(site, dec, hour):
    mount, clock = mount_at(site)
    mount.parked = False
    target = visible(mount, hour, dec)
    assert mount.goto(*target) is None
    assert mount.slewing
    clock.step(0.5)
    assert mount.slewing
    settle(mount, clock)
    assert not mount.slewing
    assert mount.tracking
    assert separation_arcsec(mount.believed_deg(), target) < 0.1
    clock.step(600.0)
    assert separation_arcsec(mount.believed_deg(), target) < 0.5
    assert mount.pier_side is (PierSide.WEST if hour < 0 else PierSide.EAST)
    weights = mount.axes_deg()[0]
    assert -15.0 <= weights <= 195.0


def test_a_small_correction_stays_on_its_side_of_the_pier():
    mount, clock = mount_at()
    mount.goto(*visible(mount, -3.0, 30.0))
    settle(mount, clock)
    assert mount.pier_side is PierSide.WEST
    mount.goto(*visible(mount, 3.0, 30.0))
    settle(mount, clock)
    assert mount.pier_side is PierSide.WEST
    mount.goto(*visible(mount, 30.0, 30.0))
    settle(mount, clock)
    assert mount.pier_side is PierSide.EAST


@pytest.mark.parametrize("site", [NORTH, SOUTH])
def test_what_is_below_the_horizon_is_refused(site):
    mount, _ = mount_at(site)
    before = mount.axes_deg()
    assert mount.goto(*visible(mount, 180.0, 0.0)) == "below horizon"
    assert not mount.slewing
    assert mount.axes_deg() == before


def test_parked_it_moves_for_nobody_until_it_is_ready_again():
    mount, clock = mount_at()
    mount.goto(*visible(mount, 20.0, 30.0))
    settle(mount, clock)
    mount.park()
    assert not mount.parked
    settle(mount, clock)
    assert mount.parked
    assert not mount.tracking
    assert mount.axes_deg() == pytest.approx((90.0, 90.0))
    assert mount.goto(*visible(mount, 20.0, 30.0)) == "parked"
    assert mount.sync(10.0, 10.0) == "parked"
    mount.move(Direction.WEST, 1.0)
    mount.pulse(Direction.WEST, 1000)
    clock.step(10.0)
    assert mount.axes_deg() == pytest.approx((90.0, 90.0))
    mount.parked = False
    assert mount.goto(*visible(mount, 20.0, 30.0)) is None


def test_a_sync_changes_belief_and_moves_nothing():
    mount, clock = mount_at()
    mount.goto(*visible(mount, -40.0, 30.0))
    settle(mount, clock)
    before = mount.attitude_enu_to_camera(clock.now_unix())
    ra, dec = mount.believed_deg()
    assert mount.sync(ra + 2.0, dec - 1.0) is None
    assert separation_arcsec(mount.believed_deg(), (ra + 2.0, dec - 1.0)) < 0.01
    np.testing.assert_array_equal(mount.attitude_enu_to_camera(clock.now_unix()), before)
    mount.goto(ra, dec)
    settle(mount, clock)
    assert separation_arcsec(mount.believed_deg(), (ra, dec)) < 0.1
    assert mount.goto(ra + 10, dec) is None
    assert mount.sync(ra, dec) == "moving"


@pytest.mark.parametrize("site", [NORTH, SOUTH])
@pytest.mark.parametrize("hour", [-50.0, 50.0])
@pytest.mark.parametrize("direction", list(Direction))
def test_directions_are_those_of_the_sky_on_both_sides_of_the_pier(site, hour, direction):
    mount, clock = mount_at(site)
    mount.goto(*visible(mount, hour, 10.0))
    settle(mount, clock)
    ra, dec = mount.believed_deg()
    mount.move(direction, 0.5)
    clock.step(4.0)
    assert mount.slewing
    mount.halt(direction)
    settle(mount, clock)
    moved = wrapped(mount.believed_deg()[0] - ra), mount.believed_deg()[1] - dec
    expected = {
        Direction.NORTH: (0.0, 2.0),
        Direction.SOUTH: (0.0, -2.0),
        Direction.EAST: (2.0, 0.0),
        Direction.WEST: (-2.0, 0.0),
    }[direction]
    assert moved == pytest.approx(expected, abs=0.01)
    ra, dec = mount.believed_deg()
    mount.pulse(direction, 4000)
    assert not mount.slewing
    clock.step(10.0)
    moved = wrapped(mount.believed_deg()[0] - ra), mount.believed_deg()[1] - dec
    guided = 4.0 * 0.5 * SIDEREAL_DEG_S / 2.0
    assert moved == pytest.approx((expected[0] * guided, expected[1] * guided), abs=1e-4)


def test_stop_ends_a_slew_and_leaves_tracking():
    mount, clock = mount_at()
    mount.tracking = True
    mount.goto(*visible(mount, 60.0, 10.0))
    clock.step(3.0)
    mount.stop()
    clock.step(4.0 / 2.0 + 0.1)
    assert not mount.slewing
    there = mount.believed_deg()
    clock.step(60.0)
    assert separation_arcsec(mount.believed_deg(), there) < 0.1


def test_a_slew_alone_is_stopped_where_a_move_is_to_go_on():
    mount, clock = mount_at()
    mount.goto(*visible(mount, 60.0, 10.0))
    clock.step(3.0)
    mount.stop(moves=False)
    clock.step(4.0 / 2.0 + 0.1)
    assert not mount.slewing
    mount.move(Direction.NORTH, 0.5)
    mount.stop(moves=False)
    dec = mount.believed_deg()[1]
    clock.step(10.0)
    assert abs(mount.believed_deg()[1] - dec) > 4.0
    mount.stop()
    clock.step(1.0)
    assert not mount.slewing


def test_switching_tracking_during_a_slew_holds_at_its_end():
    mount, clock = mount_at()
    mount.goto(*visible(mount, 60.0, 10.0))
    clock.step(1.0)
    mount.tracking = False
    settle(mount, clock)
    hour = mount.axes_deg()[0]
    clock.step(100.0)
    assert mount.axes_deg()[0] == pytest.approx(hour, abs=1e-9)


def test_bare_motors_turn_as_told_without_tracking():
    mount, clock = mount_at()
    mount.tracking = True
    mount.turn_axis(0, -1.0)
    clock.step(10.0)
    assert not mount.tracking
    mount.turn_axis(0, 0.0)
    mount.turn_axis_to(1, 40.0)
    settle(mount, clock)
    hour, dec = mount.axes_deg()
    assert hour == pytest.approx(90.0 - 10.0, abs=0.5)
    assert dec == pytest.approx(40.0)
    clock.step(50.0)
    assert mount.axes_deg()[0] == pytest.approx(hour, abs=1e-9)


def test_a_wrong_clock_and_longitude_shift_what_it_believes():
    right, _ = mount_at()
    hour_late, _ = mount_at(computer_clock_s=3600.0)
    mirrored, _ = mount_at(computer_site=Site(47.0, -8.0))
    sidereal_hour = 3600.0 * SIDEREAL_DEG_S
    assert wrapped(hour_late.believed_deg()[0] - right.believed_deg()[0]) == pytest.approx(sidereal_hour, abs=1e-3)
    assert wrapped(mirrored.believed_deg()[0] - right.believed_deg()[0]) == pytest.approx(-16.0, abs=1e-3)
    assert hour_late.now_unix() - right.now_unix() == 3600.0


def axis_direction(hour_deg, dec_deg):
    """Unit vector (3,) in the mount frame of a perfect tube at these axis angles."""
    h, d = np.radians([hour_deg, dec_deg])
    return np.array([np.cos(d) * np.cos(h), -np.cos(d) * np.sin(h), np.sin(d)])


@given(st.floats(-180, 180), st.floats(-89.9, 89.9), st.booleans(), st.booleans())
def test_folding_through_the_pole_keeps_the_direction(hour, dec, flipped, north):
    axes = fold(hour, dec, flipped, north)
    np.testing.assert_allclose(axis_direction(*axes), axis_direction(hour, dec), atol=1e-12)
    back = unfold(*axes)
    np.testing.assert_allclose(axis_direction(*back), axis_direction(hour, dec), atol=1e-9)


@pytest.mark.parametrize(("latitude", "north"), [(47.0, True), (-33.0, False), (5.0, True)])
def test_a_perfect_mount_looks_where_its_angles_say(latitude, north):
    """Hour angle and declination to altitude and azimuth by the textbook's triangle."""
    axis = mount_to_enu(latitude, 0.0)
    rng = np.random.default_rng(2)
    for hour, dec in rng.uniform([-90, -80], [90, 80], (20, 2)):
        seen = camera_to_enu(*fold(hour, dec, hour < 0, north), axis, Build())
        h, d, p = np.radians([hour, dec, latitude])
        sine = np.sin(p) * np.sin(d) + np.cos(p) * np.cos(d) * np.cos(h)
        azimuth = np.arctan2(-np.cos(d) * np.sin(h), np.sin(d) * np.cos(p) - np.cos(d) * np.sin(p) * np.cos(h))
        assert altitude_deg(seen[:, 2]) == pytest.approx(np.degrees(np.arcsin(sine)), abs=1e-9)
        assert wrapped(float(azimuth_deg(seen[:, 2]) - np.degrees(azimuth))) == pytest.approx(0.0, abs=1e-9)
        np.testing.assert_allclose(seen.T @ seen, np.eye(3), atol=1e-12)
        assert np.linalg.det(seen) == pytest.approx(1.0)


@settings(max_examples=30)
@given(
    site=st.sampled_from([NORTH, SOUTH]),
    error=st.tuples(st.floats(-120, 120), st.floats(-120, 120)),
    dec=st.floats(-30, 30),
    turn=st.floats(15, 80),
    build=st.builds(Build, st.floats(-0.3, 0.3), st.floats(-0.2, 0.2)),
)
def test_two_attitudes_tell_the_axis_whatever_the_tube_is_like(site, error, dec, turn, build):
    """The rotation between two views is about the polar axis alone: cone and square drop out."""
    mount, clock = mount_at(site, misalignment_arcmin=error, build=build)
    mount.place(-40.0, dec)
    first = mount.attitude_enu_to_camera(clock.now_unix())
    mount.turn_by_hand(turn)
    second = mount.attitude_enu_to_camera(clock.now_unix())
    m = second.T @ first
    axis = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    axis *= np.sign(axis[1]) * (1.0 if site is NORTH else -1.0) / np.linalg.norm(axis)
    np.testing.assert_allclose(axis, mount.wedge.axis_enu(), atol=1e-9)
    north = 0.0 if site is NORTH else 180.0
    pole = abs(site.latitude_deg)
    high = (altitude_deg(axis) - pole) * 60.0
    assert high == pytest.approx(error[0], abs=2.0)  # the pole is lifted by the air
    assert wrapped(float(azimuth_deg(axis)) - north) * 60.0 == pytest.approx(error[1], abs=1e-6)


def test_cone_square_flexure_and_camera_do_what_they_say():
    level = mount_to_enu(47.0, 0.0)
    plain = camera_to_enu(0.0, 30.0, level, Build())
    cone = camera_to_enu(0.0, 30.0, level, Build(cone_deg=0.5))
    assert np.degrees(np.arccos(plain[:, 2] @ cone[:, 2])) == pytest.approx(0.5)
    assert cone[0, 2] > 0.0  # on the meridian, looking south: left is east
    beyond = camera_to_enu(*fold(0.0, 30.0, True, True), level, Build(cone_deg=0.5))
    assert beyond[0, 2] < 0.0
    lean = camera_to_enu(0.0, 60.0, level, Build(square_deg=0.2))
    assert np.degrees(np.arccos(camera_to_enu(0.0, 60.0, level, Build())[:, 2] @ lean[:, 2])) == pytest.approx(
        0.2 * np.sin(np.radians(60.0)), rel=1e-3
    )
    low = camera_to_enu(0.0, -30.0, level, Build(flexure_arcsec=60.0))
    high = camera_to_enu(0.0, -30.0, level, Build())
    drop = (altitude_deg(high[:, 2]) - altitude_deg(low[:, 2])) * 3600.0
    assert drop == pytest.approx(60.0 * np.cos(np.radians(13.0)), rel=1e-4)
    rolled = camera_to_enu(0.0, 30.0, level, Build(camera_roll_deg=90.0))
    np.testing.assert_allclose(rolled[:, 0], plain[:, 1], atol=1e-12)  # right has turned to down


@pytest.mark.parametrize("north", [True, False])
def test_bolts_move_the_axis_in_the_words_of_polar_alignment(north):
    wedge = Wedge(40.0, north, (0.0, 0.0))
    wedge.turn(6.0, 12.0)
    axis = wedge.axis_enu()
    assert altitude_deg(axis) == pytest.approx(40.1)
    assert wrapped(float(azimuth_deg(axis)) - (0.0 if north else 180.0)) == pytest.approx(0.2)


def test_bolts_have_play_and_drag_each_other():
    wedge = Wedge(40.0, True, (10.0, -20.0), BoltErrors((2.0, 0.0), (0.1, 0.0)))
    wedge.turn(0.5, 0.0)  # within the play
    assert wedge.error_arcmin == pytest.approx((10.0, -20.0))
    wedge.turn(3.0, 0.0)
    assert wedge.error_arcmin == pytest.approx((12.5, -19.75))
    wedge.turn(-3.0, 0.0)  # two are lost in the play
    assert wedge.error_arcmin == pytest.approx((11.5, -19.85))
    wedge.turn(0.0, 5.0)
    assert wedge.error_arcmin == pytest.approx((11.5, -14.85))


def test_a_fork_needs_no_flip():
    mount, clock = mount_at(german=False)
    for hour in (-80.0, 80.0):
        assert mount.goto(*visible(mount, hour, 40.0)) is None
        settle(mount, clock)
        assert mount.pier_side is PierSide.EAST
        assert mount.axes_deg()[0] == pytest.approx(hour, abs=0.3)


def test_commands_from_many_threads_leave_a_sane_mount():
    import threading

    mount, clock = mount_at(hour_gear=GearErrors(backlash_deg=0.01, slip=0.001))
    failures = []

    def hammer(seed):
        rng = np.random.default_rng(seed)
        try:
            for _ in range(60):
                mount.goto(*visible(mount, float(rng.uniform(-60, 60)), float(rng.uniform(0, 60))))
                mount.believed_deg()
                clock.step(float(rng.uniform(0, 0.5)))
                mount.pulse(Direction.NORTH, 100)
                mount.attitude_enu_to_camera(clock.now_unix() - 1.0)
                mount.stop()
        except Exception as error:
            failures.append(error)

    threads = [threading.Thread(target=hammer, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    settle(mount, clock)
    clock.step(5.0)
    assert not mount.slewing
    assert np.isfinite(mount.believed_deg()).all()
