"""A Celestron on its AUX bus: what the motor boards do by themselves, and what others do to them."""

import time
from types import SimpleNamespace

import pytest

from kochab.core.attitude import apart_deg, wrapped
from kochab.core.errors import DeviceError, RefusedError, StoppedError, StrayedError
from kochab.core.frame import Site
from kochab.core.mount import Direction, Home, PierSide, TrackingRate
from kochab.core.progress import run
from kochab.gear.mounts import open_mount, slew_supervisor
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.mounts.protocols import nexstar
from kochab.simulate.serial_line import own_line
from tests.gear.mounts.bench import LIMITS, SITE, Night, moved, place, still
from tests.gear.mounts.test_conformance import wait_for
from tests.simulate.bench_telescope import BenchTelescope
from tests.simulate.celestron_aux import EVOLUTION, CelestronAuxResponder, frame

FLIPS = Limits(allow_flip=True, longest_slew_deg=180.0)


def noted(gotos, board, do):
    def go(count):
        gotos.append((board, (count / (1 << 24) * 360.0 + 180.0) % 360.0 - 180.0))
        do(count)

    return go


@pytest.fixture
def bench():
    """A mount that was switched on at home a moment ago, and how to open it."""
    clock, opened = Night(), []
    telescope = BenchTelescope(SITE.latitude_deg, SITE.longitude_deg, 60.0, clock.unix)
    far_end = CelestronAuxResponder(telescope)
    line = own_line(far_end)

    def connect(**told):
        opened.append(open_mount("celestronaux", line.port, site=SITE, clock=clock, **told))
        return opened[-1]

    gotos = []
    for board, motor in enumerate(far_end.motors):
        motor.go = noted(gotos, board, motor.go)
    yield SimpleNamespace(
        gotos=gotos, telescope=telescope, far_end=far_end, line=line, clock=clock, port=line.port, open=connect
    )
    for mount in opened:
        mount.close()
    line.stop()


@pytest.fixture
def mount(bench):
    """It points at a star in the south-east."""
    mount = bench.open(home=Home.NOW)
    go(bench, mount, -20.0, 40.0)
    bench.gotos.clear()
    bench.telescope.log.clear()
    return mount


def go(bench, mount, hour, dec):
    target = place(hour, dec, bench.clock)
    mount.goto(*target)
    wait_for(lambda: mount.state().slewing is False, 60.0)
    return target


def here(mount):
    at = mount.position()
    return at.ra_deg, at.dec_deg


@pytest.mark.parametrize("hour", [-50.0, 50.0])
def test_it_points_where_it_says_on_both_sides_of_the_pier(bench, mount, hour) -> None:
    """The far end's axes count as INDI's driver has them, and its sky is its own."""
    bench.telescope._slew_deg_s = 15.0
    guard = Guard(mount, SITE, FLIPS, clock=bench.clock)
    target = place(hour, 35.0, bench.clock)
    run(guard.slew(*target))
    assert apart_deg(bench.telescope.believed_deg(), target) < 0.03
    assert mount.state().pier_side is (PierSide.WEST if hour < 0.0 else PierSide.EAST)


def test_a_flip_goes_in_parts_of_a_third_of_a_turn_at_most(bench, mount) -> None:
    go(bench, mount, -80.0, 20.0)
    bench.gotos.clear()
    target = go(bench, mount, 88.0, -5.0)
    assert apart_deg(bench.telescope.believed_deg(), target) < 0.03
    at = [-70.0, *(angle for board, angle in bench.gotos if board == 1)]
    assert at[1:3] == pytest.approx([50.0, 95.0], abs=0.1)
    assert at[3:] == pytest.approx([95.0] * len(at[3:]), abs=0.1)


def under_way(bench, mount):
    """A long slew that has begun, under the guard."""
    bench.telescope._slew_deg_s = 10.0
    slew = Guard(mount, SITE, LIMITS, clock=bench.clock).slew(*place(-60.0, 70.0, bench.clock))
    for _ in range(3):
        next(slew)
    return slew


def test_a_motor_that_gave_up_on_its_way_is_told_and_is_not_sent_on(bench, mount) -> None:
    """INDIGO met a mount that stopped 30 deg short, and said that its goto was done."""
    slew = under_way(bench, mount)
    bench.far_end.motors[1].run(0.0)
    bench.telescope._slew_deg_s = 40.0
    with pytest.raises(RefusedError, match=r"The mount stopped .* deg from its target: a motor stopped by itself"):
        run(slew)
    assert len(bench.gotos) == 2, "one a motor, and none again"


def test_a_power_cycle_in_a_slew_is_recognised_and_nothing_moves_after_it(bench, mount) -> None:
    slew = under_way(bench, mount)
    bench.far_end.power_on()
    orders = len(moved(bench.telescope))
    with pytest.raises(DeviceError):
        run(slew)
    with pytest.raises(RefusedError, match="home is not confirmed"):
        mount.goto(*place(-60.0, 70.0, bench.clock))
    assert mount.state().home_confirmed is False
    assert len(moved(bench.telescope)) == orders


def test_a_power_cycle_while_it_stands_is_recognised(bench, mount) -> None:
    here(mount)
    bench.far_end.power_on()
    with pytest.raises(RefusedError, match="switched off and on"):
        here(mount)
    assert mount.state().home_confirmed is False


def test_tracking_is_seen_when_it_connects(bench, mount) -> None:
    assert mount.state().tracking is True, "after its slew"
    mount.talk.link.close()
    again = bench.open()
    assert again.state().tracking is True
    again.track(TrackingRate.OFF)
    again.talk.link.close()
    assert bench.open().state().tracking is False


def test_what_a_hand_control_left_turning_in_declination_is_stopped_before_tracking(bench, mount) -> None:
    bench.far_end.reply(frame(0x0D, 0x11, 0x06, (1024 * 15).to_bytes(3, "big")))
    assert bench.telescope._rates[1] != 0.0
    mount.track(TrackingRate.SIDEREAL)
    assert bench.telescope._rates[1] == 0.0


def test_stop_is_rate_0_on_both_axes_and_is_seen_to_work(bench, mount) -> None:
    bench.telescope._slew_deg_s = 5.0
    guard = Guard(mount, SITE, LIMITS, clock=bench.clock)
    guard.goto(*place(-60.0, 60.0, bench.clock))
    wait_for(lambda: bench.telescope.slewing)
    guard.stop()
    guard.emergency.confirm()
    assert still(bench.telescope)
    sent = b"".join(data for way, data in bench.line.transcript if way == "<")
    assert sent.count(mount.blind_stop[:7]) >= 1
    assert mount.state().tracking is False


def test_a_goto_decided_before_a_stop_is_not_begun_after_it(bench, mount, monkeypatch) -> None:
    aim = mount.aim

    def stopped_meanwhile(*target):
        mount.stop()
        return aim(*target)

    monkeypatch.setattr(mount, "aim", stopped_meanwhile)
    with pytest.raises(StoppedError):
        mount.goto(*place(-60.0, 60.0, bench.clock))
    assert not bench.gotos


def test_tracking_decided_before_a_stop_is_not_begun_after_it(bench, mount, monkeypatch) -> None:
    monkeypatch.setattr(mount.motors[1], "ensure_stopped", mount.stop)
    with pytest.raises(StoppedError):
        mount.track(TrackingRate.SIDEREAL)
    monkeypatch.undo()
    assert mount.state().tracking is False
    assert not any(bench.telescope._rates)


@pytest.mark.parametrize(("order", "with_the_sky"), [(0x07, True), (0x06, False)])
def test_tracking_is_seen_in_the_south(bench, order, with_the_sky) -> None:
    bench.far_end.reply(frame(0x0D, 0x10, order, b"\xff\xff"))
    mount = open_mount("celestronaux", bench.port, site=Site(-33.0, 8.0), clock=bench.clock)
    assert mount.state().tracking is with_the_sky
    mount.talk.link.close()


def test_the_first_bytes_of_a_stop_end_both_motors(bench, mount) -> None:
    bench.telescope._slew_deg_s = 5.0
    mount.goto(*place(-60.0, 60.0, bench.clock))
    wait_for(lambda: None not in bench.telescope._targets)
    at = mount.blind_stop.index(b";", 1)
    for order in (mount.blind_stop[:at], mount.blind_stop[at:]):
        bench.far_end.reply(order)
    assert still(bench.telescope)


def test_a_motor_that_goes_the_long_way_round_is_stopped(bench, mount, monkeypatch) -> None:
    monkeypatch.setattr(slew_supervisor, "LOOK_S", 0.1)
    bench.telescope._slew_deg_s = 10.0
    motor = bench.far_end.motors[1]

    def long_way(count):
        away = (count - motor.count()) % (1 << 24) - (1 << 24) * (count > motor.count())
        motor._slewing_to = motor._angle() + away / motor.steps_deg
        bench.telescope.turn_axis_to(1, motor._slewing_to)

    motor.go = long_way
    guard = Guard(mount, SITE, LIMITS, clock=bench.clock)
    with pytest.raises(StrayedError):
        run(guard.slew(*place(-30.0, 60.0, bench.clock)))
    wait_for(lambda: still(bench.telescope))


def test_the_next_program_knows_where_it_points(bench, tmp_path) -> None:
    def opened(**more):
        return open_mount("celestronaux", bench.port, site=SITE, clock=bench.clock, kept=tmp_path, **more)

    first = opened(home=Home.NOW)
    go(bench, first, -20.0, 40.0)
    first.stop()
    pointed = here(first)
    first.close()
    second = opened()
    assert second.state().home_confirmed
    assert apart_deg(here(second), pointed) < 0.1
    second.close()
    bench.far_end.power_on()
    third = opened()
    assert third.state().home_confirmed is False
    third.close()


@pytest.mark.parametrize("home", [Home.NOW, Home.EQMOD])
def test_the_home_of_a_fork_or_of_another_program_is_refused(bench, home) -> None:
    bench.far_end.model = EVOLUTION if home is Home.NOW else bench.far_end.model
    with pytest.raises(RefusedError, match=r"solved frame|no home of eqmod"):
        bench.open(home=home, equatorial=True)


def test_a_model_that_is_not_known_is_refused(bench) -> None:
    bench.far_end.model = b"\x00\x01"
    with pytest.raises(RefusedError, match="does not know this Celestron"):
        bench.open(equatorial=True)


@pytest.mark.parametrize(
    ("equatorial", "latitude", "why"),
    [(False, 50.0, "in altitude and azimuth directly"), (True, -33.0, "South of the equator")],
)
def test_a_fork_that_does_not_count_as_a_wedge_in_the_north_is_refused(bench, equatorial, latitude, why) -> None:
    bench.far_end.model = EVOLUTION
    with pytest.raises(RefusedError, match=why):
        open_mount("celestronaux", bench.port, site=Site(latitude, 8.0), clock=bench.clock, equatorial=equatorial)


class Fork:
    """Two bare motors: hour angle and declination, as INDI's wedge has them."""

    def __init__(self, bench):
        self.motors = bench.far_end.motors
        bench.far_end.model = EVOLUTION
        self.motors[1].steps_deg = -self.motors[1].steps_deg

    def at(self):
        return [(motor.count() / (1 << 24) * 360.0 + 180.0) % 360.0 - 180.0 for motor in self.motors]


def test_a_fork_on_a_wedge_learns_its_place_from_the_sky_and_goes_on_from_it(bench) -> None:
    fork = Fork(bench)
    mount = bench.open(equatorial=True)
    with pytest.raises(RefusedError, match="home is not confirmed"):
        mount.goto(*place(-20.0, 30.0, bench.clock))
    mount.sync(*place(-20.0, 40.0, bench.clock))
    state, before = mount.state(), fork.at()
    assert (state.home_confirmed, state.pier_side) == (True, None)
    for hour, dec in ((30.0, -5.0), (-70.0, 60.0)):
        mount.goto(*place(hour, dec, bench.clock))
        wait_for(lambda: mount.state().slewing is False, 60.0)
        assert apart_deg(here(mount), place(hour, dec, bench.clock)) < 0.2
        turned = [b - a for a, b in zip(before, fork.at(), strict=True)]
        assert turned == pytest.approx([hour + 20.0, dec - 40.0], abs=0.3)
    mount.move(Direction.NORTH, 0.5, 1.0)
    time.sleep(1.5)
    assert fork.at()[1] - before[1] == pytest.approx(20.5, abs=0.05)


def test_a_fork_goes_the_shorter_way_round_and_is_read_beyond_the_pole(bench) -> None:
    fork = Fork(bench)
    mount = bench.open(equatorial=True)
    mount.sync(*place(-170.0, 60.0, bench.clock))
    before = fork.at()
    mount.goto(*place(170.0, 70.0, bench.clock))
    wait_for(lambda: mount.state().slewing is False, 60.0)
    turned = [wrapped(b - a) for a, b in zip(before, fork.at(), strict=True)]
    assert turned == pytest.approx([-20.0, 10.0], abs=0.3)
    assert all(-21.0 < angle < 1.0 for board, angle in bench.gotos if board == 0)
    mount.track(TrackingRate.OFF)
    bench.far_end.reply(frame(0x0D, 0x11, 0x02, nexstar.aux_angle(before[1] + 40.0)))
    wait_for(lambda: not bench.telescope.slewing)
    assert here(mount) == pytest.approx(place(-10.0, 80.0, bench.clock), abs=0.3)


@pytest.mark.parametrize("angle", [0.0, 179.99, -180.0, -0.001, 361.0])
def test_an_angle_is_read_as_it_was_written(angle) -> None:
    reply = frame(0x10, 0x20, 0x01, nexstar.aux_angle(angle))
    assert (nexstar.parse_aux_angle(reply) - angle + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=2.2e-5)


def test_a_motor_board_asks_for_the_site(bench) -> None:
    with pytest.raises(RefusedError, match="give --site"):
        open_mount("celestronaux", bench.port)
