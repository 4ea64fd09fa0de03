"""A motor board does not know where its tube points: nothing slews until somebody does.

The board is simulated from INDI's skywatcher.cpp and from the exchanges of real boards (Lnn).
"""

from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from kochab.core.attitude import apart_deg
from kochab.core.errors import RefusedError
from kochab.core.mount import Direction, Epoch, Home, Pointing, TrackingRate
from kochab.core.progress import run
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.coordinates import from_mount_epoch
from kochab.gear.mounts.drivers.skywatcher import SkyWatcher
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import SyncEvidence
from kochab.simulate.responders.skywatcher import NOT_STOPPED
from kochab.simulate.responders.skywatcher import SkyWatcherResponder as Board
from kochab.simulate.serial_line import own_line
from tests.gear.mounts.bench import LIMITS, SITE, Night, moved, place, still
from tests.gear.mounts.scripted import transcript
from tests.gear.mounts.test_conformance import wait_for
from tests.gear.mounts.test_transcripts import MOTORS_START
from tests.simulate.bench_telescope import BenchTelescope


@contextmanager
def board(eqmod=False, slew_deg_s=60.0):
    """A board whose telescope stands at home, fresh or as EQMod has left it."""
    clock = Night()
    telescope = BenchTelescope(SITE.latitude_deg, SITE.longitude_deg, slew_deg_s, clock.unix)
    telescope.tracking = False
    far_end = Board(telescope)
    if eqmod:  # what its Init sends at home: both motors initialised, Dec a quarter turn above the middle
        far_end.feed(b":F1\r:F2\r:E2806CA2\r")
    line = own_line(far_end)
    opened = []

    def connect(**told):
        opened.append(open_mount("skywatcher", line.port, site=SITE, clock=clock, **told))
        return opened[-1]

    try:
        yield SimpleNamespace(telescope=telescope, far_end=far_end, clock=clock, connect=connect, port=line.port)
    finally:
        for mount in opened:
            mount.close()
        line.stop()


def at_mount_code(version):
    script = list(MOTORS_START)
    script[script.index((b":e1\r", b"=020300\r"))] = (b":e1\r", b"=%s\r" % version)
    return script


# -- which mounts ------------------------------------------------------------------------------


@pytest.mark.parametrize("version", [b"033A45", b"03300C", b"020905", b"020300", b"030723"])
def test_an_equatorial_board_is_taken(version) -> None:
    """L87 Wave 150i, L90 Star Adventurer GTi, L86 AZ-EQ6, EQ6, EQ6-R."""
    with transcript(SkyWatcher, at_mount_code(version), site=SITE, clock=Night()):
        pass


@pytest.mark.parametrize(
    ("version", "sentence"),
    [
        (b"020C83", "alt-azimuth mount .code 0x83"),  # L85, Orion StarSeeker III
        (b"020480", "alt-azimuth"),
        (b"020490", "alt-azimuth"),
        (b"0328A5", "slews an AZ-GTi only in equatorial mode"),  # L94
        (b"020399", "Unknown Sky-Watcher mount .code 0x99"),
    ],
)
def test_an_alt_azimuth_or_unknown_board_is_refused_before_anything_else(version, sentence) -> None:
    script = at_mount_code(version)[:-2]
    with pytest.raises(RefusedError, match=sentence), transcript(SkyWatcher, script, site=SITE, clock=Night()):
        pass


def test_only_a_board_whose_code_does_not_tell_is_taken_at_a_person_s_word() -> None:
    for version in (b"0328A5", b"020399"):
        script = at_mount_code(version)
        with transcript(SkyWatcher, script, site=SITE, clock=Night(), equatorial=True):
            pass
    with board() as b:
        b.far_end.mount_code = 0x82
        with pytest.raises(RefusedError, match="hand control"):
            b.connect(equatorial=True)


# -- where home is -----------------------------------------------------------------------------


def test_the_simulated_board_counts_as_an_eq8_of_indi_does_at_home() -> None:
    """L80: RA 0x800000, Dec 0x800000 and a quarter of the steps a turn."""
    with board(eqmod=True) as b:
        assert b.far_end.feed(b":j1\r:j2\r:f2\r") == b"=000080\r=806CA2\r=101\r"
        assert 0xA26C80 - 0x800000 == 9024000 // 4


@pytest.mark.parametrize("eqmod", [False, True])
def test_without_a_home_nothing_slews(eqmod) -> None:
    with board(eqmod) as b:
        mount = b.connect()
        assert mount.state().home_confirmed is False
        assert mount.state().alt_azimuth is False, "such a board was refused"
        with pytest.raises(RefusedError, match="home is not confirmed"):
            mount.goto(*place(-25.0, 45.0, b.clock))
        for direction in (Direction.NORTH, Direction.WEST):
            with pytest.raises(RefusedError, match="home is not confirmed"):
                mount.move(direction, 1.0, 30.0)
        for _ in range(3):
            mount.state()
            mount.position()
        assert not moved(b.telescope)
        mount.move(Direction.NORTH, 0.5, 0.2)  # a nudge
        wait_for(lambda: not mount.watchdog.moving)


@pytest.mark.parametrize("eqmod", [False, True])
def test_the_guard_says_so_in_its_preview(eqmod) -> None:
    with board(eqmod) as b, Guard(b.connect(), SITE, LIMITS, clock=b.clock) as guard:
        target = place(-25.0, 45.0, b.clock)
        assert "home is not confirmed" in guard.preview_goto(*target).refusals[0]
        with pytest.raises(RefusedError, match="home is not confirmed"):
            run(guard.slew(*target))
        with pytest.raises(RefusedError, match="only a solved frame"):
            guard.sync(*place(-25.0, 88.0, b.clock), by_hand=True, confirmed=True)
        assert not moved(b.telescope)


@pytest.mark.parametrize(
    ("eqmod", "home"), [(False, Home.NOW), (True, Home.NOW), (False, Home.POWER_ON), (True, Home.EQMOD)]
)
def test_with_home_confirmed_a_slew_ends_where_it_was_sent(eqmod, home) -> None:
    """Where the tube of the simulated telescope really is, whatever its counters read."""
    with board(eqmod) as b:
        mount = b.connect(home=home)
        target = place(-25.0, 45.0, b.clock)
        mount.goto(*target)
        wait_for(lambda: mount.state().slewing is False)
        assert apart_deg(b.telescope.believed_deg(), target) < 0.01


@pytest.mark.parametrize("refused", [b"G", b"J"])
def test_a_goto_that_the_second_motor_refuses_leaves_the_first_standing(refused) -> None:
    """To the guard a refused goto never began: nobody would watch it."""
    with board(slew_deg_s=2.0) as b, Guard(b.connect(home=Home.NOW), SITE, LIMITS, clock=b.clock) as guard:
        real = b.far_end.obey
        b.far_end.obey = lambda order, motor, data: (
            NOT_STOPPED if order == refused and motor is b.far_end.motors[1] else real(order, motor, data)
        )
        with pytest.raises(RefusedError, match="motor board refuses"):
            guard.goto(*place(-25.0, 45.0, b.clock))
        assert [entry[:2] for entry in moved(b.telescope)] == [("turn to", 0)]
        assert still(b.telescope)
        assert not guard.state().slewing


@pytest.mark.parametrize(("eqmod", "home"), [(True, Home.POWER_ON), (False, Home.EQMOD)])
def test_a_word_that_the_counters_speak_against_is_refused(eqmod, home) -> None:
    with board(eqmod) as b:
        with pytest.raises(RefusedError, match="connect with --home now"):
            b.connect(home=home)
        assert not moved(b.telescope)


@pytest.mark.parametrize("eqmod", [False, True])
def test_a_sync_on_solved_frames_confirms_home(eqmod) -> None:
    """Another program has turned the telescope; counters and sky together tell whose home it was."""
    with board(eqmod) as b:
        b.telescope.turn_axis_to(0, 75.0)
        b.telescope.turn_axis_to(1, 140.0)  # beyond the pole
        wait_for(lambda: not b.telescope.slewing)
        guard = Guard(b.connect(), SITE, LIMITS, clock=b.clock)
        sky = b.telescope.believed_deg()
        solved = from_mount_epoch(Pointing(*sky, Epoch.DATE), b.clock())
        seen = SyncEvidence((solved, solved), (0.3, 0.3), (-20.0, -20.0))
        guard.sync(*sky, seen, confirmed=True)
        assert guard.state().home_confirmed is True
        assert not guard.can_undo, "there is nothing to go back to"
        target = place(-50.0, 45.0, b.clock)
        guard.mount.goto(*target)
        wait_for(lambda: guard.state().slewing is False)
        assert apart_deg(b.telescope.believed_deg(), target) < 0.01


def test_a_sync_that_fits_no_home_is_refused_and_leaves_home_open() -> None:
    """Switched on anywhere: the sky does not tell the side of the pier."""
    with board() as b:
        mount = b.connect()
        with pytest.raises(RefusedError, match="pier side is unknown"):
            mount.sync(*place(-20.0, 40.0, b.clock))
        assert mount.state().home_confirmed is False
        with pytest.raises(RefusedError, match="home is not confirmed"):
            mount.goto(*place(-25.0, 45.0, b.clock))


# -- Stop --------------------------------------------------------------------------------------


@pytest.mark.parametrize("doing", ["track", "goto"])
def test_after_a_stop_nothing_turns_until_it_is_asked_for(doing) -> None:
    with board(slew_deg_s=2.0) as b:
        mount = b.connect(home=Home.NOW)
        if doing == "track":
            mount.track(TrackingRate.SIDEREAL)
        else:
            mount.goto(*place(-25.0, 45.0, b.clock))
        mount.stop()
        wait_for(lambda: not any(b.telescope._rates) and not b.telescope.slewing)
        stood = b.telescope.axes_deg()
        for _ in range(5):
            assert mount.state().tracking is False
            mount.position()
        assert b.telescope.axes_deg() == stood
        mount.track(TrackingRate.SIDEREAL)
        assert b.telescope._rates[0] > 0.004
        assert still(b.telescope)


def test_a_board_found_in_a_slew_is_not_taken_to_track() -> None:
    """L82: ``=711`` is a fast steady motion; L96: ``=411`` is a goto; only ``=111`` tracks."""
    for status, tracking in ((b"=711\r", False), (b"=411\r", False), (b"=111\r", True)):
        script = [*MOTORS_START[:-2], (b":f1\r", status), MOTORS_START[-1]]
        with transcript(SkyWatcher, script, site=SITE, clock=Night()) as mount:
            assert mount.tracking is tracking


# -- home sensors, as INDI's EQMod driver reads them (eqmodbase.cpp, AutoHome) -------------------


def sensing(b, first_deg, second_deg):
    """A board with home sensors, switched on with its axes so far from home."""
    b.far_end.features = 0x000004
    b.telescope.turn_axis_to(0, 90.0 + first_deg)
    b.telescope.turn_axis_to(1, 90.0 + second_deg)
    wait_for(lambda: not b.telescope.slewing)
    for motor in b.far_end.motors:
        motor.set_steps(0x800000)
    return b.connect()


def nudge(mount, direction, angle_deg):
    mount.move(direction, 0.5, angle_deg / 0.5)
    wait_for(lambda: not mount.watchdog.moving)


@pytest.mark.parametrize(("first", "second"), [(-1.5, 1.0), (1.5, -1.0)])
def test_axes_nudged_over_their_home_sensors_confirm_home(first, second) -> None:
    with board() as b:
        mount = sensing(b, first, second)
        assert mount.state().home_confirmed is False
        with pytest.raises(RefusedError, match="nudge both axes over it"):
            mount.goto(*place(-25.0, 45.0, b.clock))
        way = Direction.WEST if first < 0.0 else Direction.EAST
        nudge(mount, way, 1.9)
        assert mount.state().home_confirmed is False, "one axis is not enough"
        for way in (Direction.NORTH, Direction.NORTH, Direction.SOUTH):  # at the pole north and south change places
            if not mount.state().home_confirmed:
                nudge(mount, way, 1.9)
        assert mount.state().home_confirmed is True
        target = place(-25.0, 45.0, b.clock)
        mount.goto(*target)
        wait_for(lambda: mount.state().slewing is False)
        assert apart_deg(b.telescope.believed_deg(), target) < 0.01


def test_what_a_sensor_kept_before_is_forgotten_first() -> None:
    """Another program may have set the counters since: the tube would miss by as much."""
    with board() as b:
        b.far_end.features = 0x000004
        b.telescope.turn_axis_to(0, 88.0)
        wait_for(lambda: not b.telescope.slewing)
        b.far_end.feed(b":W1080000\r:W2080000\r")
        b.telescope.turn_axis_to(0, 92.0)
        wait_for(lambda: not b.telescope.slewing)
        kept = b.far_end.feed(b":q1000000\r")
        assert kept not in (b"=000000\r", b"=FFFFFF\r")
        mount = b.connect()
        assert b.far_end.feed(b":q1000000\r") in (b"=000000\r", b"=FFFFFF\r")
        assert mount.state().home_confirmed is False


def test_a_board_without_home_sensors_is_asked_once_and_nothing_is_set() -> None:
    """L86 and L95: features 083000 and 080000 of boards that may be alt-azimuth, without a sensor."""
    for features in (b"=083000\r", b"=080000\r"):
        script = [*MOTORS_START[:-1], (b":q1010000\r", features)]
        with transcript(SkyWatcher, script, site=SITE, clock=Night()) as mount:
            assert mount.has_index is False
