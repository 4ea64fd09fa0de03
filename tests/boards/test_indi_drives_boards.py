"""INDI's own drivers drive the boards: they connect, go, stop, sync and read back, and agree with the true tube."""

from contextlib import nullcontext
from datetime import UTC, datetime

import pytest

from tests.boards import BEHIND_INDI, BOARDS, SITE, Night
from tests.boards.indi import ASK_S, PLACE, behind_indi, until
from tests.boards.sky import apart_deg, sidereal_deg

BUTTONS = (  # and the sense of RA and Dec
    ("TELESCOPE_MOTION_NS.MOTION_NORTH", 0.0, 1.0),
    ("TELESCOPE_MOTION_NS.MOTION_SOUTH", 0.0, -1.0),
    ("TELESCOPE_MOTION_WE.MOTION_WEST", -1.0, 0.0),
    ("TELESCOPE_MOTION_WE.MOTION_EAST", 1.0, 0.0),
)


@pytest.fixture(scope="module", params=[*(kind for kind in BOARDS if kind != "skywatcher"), *BEHIND_INDI])
def connected(request, tmp_path_factory):
    """One connection for all that is done with it: iOptron's driver takes ten seconds for its questions.

    None of an EXOS-2, whose driver takes no order after a Stop until it has seen anew that the mount tracks.
    """
    if request.param == "exos2":
        yield None
        return
    quick = {} if request.param in BEHIND_INDI else {"slew_deg_s": 20.0, "acceleration_deg_s2": 20.0}
    with behind_indi(request.param, tmp_path_factory.mktemp("indi"), **quick) as both:
        yield both


@pytest.fixture
def mount(connected, tmp_path):
    """A board well up in the east, which stands, and INDI's driver, which has read that."""
    with nullcontext(connected) if connected else behind_indi("exos2", tmp_path) as (board, indi):
        begin(board, indi)
        yield board, indi


def begin(board, indi):
    """Stand there."""
    with board.lock:
        board.stop()
    until(lambda: not board.moving, "it runs on")
    board.orders.clear()
    board.here = board.align(-40.0, 40.0)
    indi.says(board.here)


def test_indi_goes_where_the_tube_truly_arrives_and_reads_it_back(mount):
    board, indi = mount
    target = ((board.here[0] + 10.0) % 360.0, 45.0)
    indi.goto(*target)
    until(lambda: board.orders and not board.moving, "no slew")
    assert apart_deg(board.radec_deg(), target) < indi.rounded_deg
    indi.says(target)
    indi.is_ok(PLACE, "INDI's slew never ends")


def test_indi_stops_a_slew_where_the_tube_then_stands(mount):
    board, indi = mount
    tops = [axis.top_deg_s for axis in board.tube.axes]
    for axis in board.tube.axes:
        axis.top_deg_s = 0.5  # under way until it is stopped
    indi.goto(board.here[0], 0.0)
    until(lambda: board.moving, "no slew")
    indi.set("TELESCOPE_ABORT_MOTION.ABORT=On")
    until(lambda: not board.moving, "it runs on")
    assert board.radec_deg()[1] > 5.0
    indi.says(board.radec_deg())
    for axis, top in zip(board.tube.axes, tops, strict=True):
        axis.top_deg_s = top


def test_indi_syncs_a_board_that_was_wrong(mount):
    board, indi = mount
    axes = [axis.at_deg for axis in board.tube.axes]
    board.set_counters((axes[0], axes[1] - 3.0))  # a clutch slipped
    truth = board.radec_deg()
    assert apart_deg(board.believed_deg(), truth) == pytest.approx(3.0, abs=0.01)
    indi.set("ON_COORD_SET.SYNC=On", f"{PLACE}.RA;DEC={truth[0] / 15.0};{truth[1]}")
    until(lambda: board.false_by_deg() < indi.rounded_deg, "not synced")
    indi.says(truth)


def test_indi_and_the_boards_agree_on_north_and_west(mount):
    board, indi = mount
    for button, along_ra, along_dec in BUTTONS:
        begun = board.radec_deg()
        indi.set(f"{button}=On")
        until(lambda begun=begun: apart_deg(board.radec_deg(), begun) > 0.05, "it does not move")
        indi.set(f"{button}=Off")
        until(lambda: not board.moving, "it runs on")
        ra, dec = (now - then for now, then in zip(board.radec_deg(), begun, strict=True))
        assert ra * along_ra + dec * along_dec > 0.04, button
        assert abs(ra * along_dec) + abs(dec * along_ra) < 0.02, button
        indi.says(board.radec_deg())


def test_indis_eqmod_reads_the_home_of_a_skywatcher_and_reaches_its_target(tmp_path):
    """It reckons sidereal time by the computer's clock."""
    with behind_indi(
        "skywatcher", tmp_path, clock=Night(datetime.now(UTC)), slew_deg_s=20.0, acceleration_deg_s2=20.0
    ) as (board, indi):
        until(lambda: board.initialised == [True, True], "not initialised")
        indi.set(f"GEOGRAPHIC_COORD.LAT;LONG;ELEV={SITE.latitude_deg};{SITE.longitude_deg};100")
        until(lambda: abs(indi.says_deg()[1] - 90.0) < 0.1, "not at the pole", ASK_S)
        for hour_angle in (-30.0, 30.0):
            target = ((sidereal_deg(board.clock.unix(), SITE.longitude_deg) - hour_angle) % 360.0, 45.0)
            indi.goto(*target)
            until(lambda target=target: apart_deg(board.radec_deg(), target) < 0.1, "it goes elsewhere")
            indi.is_ok(PLACE, "INDI's slew never ends")
            until(lambda: not board.moving, "it runs on")
            assert apart_deg(board.radec_deg(), indi.says_deg()) < 0.02


@pytest.mark.parametrize("connected", ["am5"], indirect=True)
def test_indi_goes_home_with_an_am5_and_sees_it_there(mount):
    board, indi = mount
    indi.set("GO_HOME.GO=On")
    until(lambda: board.at_home, "not home")
    indi.is_ok("GO_HOME", "INDI does not report that the mount is home")
    assert board.radec_deg()[1] == pytest.approx(90.0)


@pytest.mark.parametrize("connected", ["ioptron"], indirect=True)
def test_indi_parks_and_unparks_an_ioptron(mount):
    board, indi = mount
    indi.set("TELESCOPE_PARK.PARK=On")
    until(lambda: board.parked, "not parked")
    indi.is_ok("TELESCOPE_PARK", "INDI does not report the mount as parked")
    assert board.radec_deg()[1] == pytest.approx(90.0)
    indi.set("TELESCOPE_PARK.UNPARK=On")
    until(lambda: not board.parked, "not unparked")
