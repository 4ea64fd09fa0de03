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
from kochab.simulate.responders.skywatcher import SkyWatcherResponder as Board
from kochab.simulate.serial_line import pty_line
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
    line = pty_line(far_end)
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
    script = at_mount_code(version)[:-1]
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
        script = [*MOTORS_START[:-1], (b":f1\r", status)]
        with transcript(SkyWatcher, script, site=SITE, clock=Night()) as mount:
            assert mount.tracking is tracking
