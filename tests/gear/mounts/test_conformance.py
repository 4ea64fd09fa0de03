"""What every driver promises, over a simulated device on a real pseudo-terminal."""

import time
from contextlib import suppress
from types import SimpleNamespace

import pytest

from kochab.core.attitude import apart_deg
from kochab.core.errors import DeviceError, RefusedError, StoppedError
from kochab.core.mount import Ability, Direction, Epoch, TrackingRate
from kochab.core.progress import run
from kochab.gear.mounts import DRIVERS
from kochab.gear.mounts.coordinates import from_mount_epoch, to_mount_epoch
from kochab.gear.mounts.guard import Guard
from kochab.simulate.responders import RESPONDERS
from kochab.sky.horizon import sidereal_deg
from tests.gear.mounts.bench import COUNTERS, LIMITS, SITE, Night, alpaca, indi, moved, place, simulated, still, where
from tests.gear.mounts.imaginary import Imaginary
from tests.simulate.dialects import DIALECT_RESPONDERS, open_any

# what a driver can tell apart: 15 arcsec of the LX200 language, twice
CLOSE_DEG = 30.0 / 3600.0
NO_COMMAND = r"hand control|menu|slew where you want it"


class ImaginaryTelescope:
    """What the suite asks of a simulated telescope, told of the guard tests' mount in memory."""

    def __init__(self, mount, clock):
        self.log, self.believed_deg = mount.did, lambda: mount.here
        self._mount, self._clock, self._rates = mount, clock, [0.0, 0.0]

    slewing = property(lambda self: self._mount.moving)
    _slew_deg_s = property(None, lambda self, rate: setattr(self._mount, "slew_deg_s", rate))

    def axes_deg(self):
        self._mount.position()
        return sidereal_deg(SITE, self._clock()) - self._mount.here[0], self._mount.here[1]


def imaginary_bench():
    clock = Night()
    start = place(-20.0, 40.0, clock)
    mount = Imaginary(*start, slew_deg_s=20.0)
    telescope, line = ImaginaryTelescope(mount, clock), SimpleNamespace(transcript=[])
    return SimpleNamespace(driver="imaginary", mount=mount, telescope=telescope, line=line, clock=clock, start=start)


SERVERS = {"alpaca": alpaca, "indi": indi}
"""Drivers that reach the simulated device through a server written by others."""


@pytest.fixture(params=[*DRIVERS, "imaginary"])
def bench(request, tmp_path):
    if request.param == "imaginary":
        yield imaginary_bench()
        return
    at = SERVERS.get(request.param)
    with at(tmp_path) if at else simulated(request.param) as bench:
        bench.driver = request.param
        bench.mount = bench.open()
        yield bench
        bench.mount.close()


def own(bench, ra_of_date, dec_of_date):
    """Degrees of date in the mount's own epoch."""
    from kochab.core.mount import Pointing

    now = bench.clock()
    icrs = from_mount_epoch(Pointing(ra_of_date, dec_of_date, Epoch.DATE), now)
    return to_mount_epoch(*icrs, bench.mount.epoch, now)


def separate(one, other):
    return apart_deg((one.ra_deg, one.dec_deg), (other.ra_deg, other.dec_deg))


def distance(bench, target):
    here = bench.mount.position()
    return apart_deg((here.ra_deg, here.dec_deg), target)


def wait_for(condition, seconds=20.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.02)


def test_every_driver_has_a_simulated_device() -> None:
    assert set(DRIVERS) == {*RESPONDERS, *DIALECT_RESPONDERS, *SERVERS}


def test_opening_moves_nothing_and_tells_no_time_and_no_site(bench) -> None:
    bench.mount.identify()
    bench.mount.position()
    bench.mount.state()
    sent = b"".join(data for way, data in bench.line.transcript if way == "<")
    assert not moved(bench.telescope)
    for word in (b":SC", b":SL", b":SG", b":St", b":Sg", b":SUT", b":SLO", b":SLA", b"W", b"H"):
        letter = word in b"WH" and bench.driver not in ("nexstar", "starsense", "synscan")  # whose commands they are
        assert letter or word not in sent


def test_it_says_where_it_points(bench) -> None:
    assert distance(bench, own(bench, *where(bench))) < CLOSE_DEG
    assert bench.mount.position().epoch is bench.mount.epoch
    assert bench.mount.identify()


def test_a_sync_is_believed_and_moves_nothing(bench) -> None:
    target = own(bench, *place(-22.0, 41.0, bench.clock))
    bench.mount.sync(*target)
    wait_for(lambda: distance(bench, target) < CLOSE_DEG)
    assert not moved(bench.telescope)


def test_a_goto_arrives(bench) -> None:
    target = own(bench, *place(-25.0, 45.0, bench.clock))
    bench.mount.goto(*target)
    wait_for(lambda: bench.mount.state().slewing is False)
    wait_for(lambda: distance(bench, target) < CLOSE_DEG)  # a server may tell the place before


def test_a_goto_below_the_horizon_is_refused_or_not_done(bench) -> None:
    if bench.driver in (*COUNTERS, "imaginary"):
        pytest.skip("a motor board knows no horizon: the guard does")
    before = bench.telescope.believed_deg()
    target = own(bench, *place(0.0, -60.0, bench.clock))
    with suppress(RefusedError):
        bench.mount.goto(*target)
    assert apart_deg(bench.telescope.believed_deg(), before) < CLOSE_DEG


def test_a_move_goes_the_right_way_and_ends_by_itself(bench) -> None:
    for direction in Direction:
        moves_the_right_way_and_ends(bench, direction)


def moves_the_right_way_and_ends(bench, direction) -> None:
    before, start = bench.mount.position(), bench.telescope.believed_deg()

    def it_moves() -> bool:
        """Whether it has: a server on a busy machine may be given the beginning and the end of a move at once."""
        bench.mount.move(direction, 0.5, 0.3)
        wait_for(lambda: not bench.mount.watchdog.moving)
        wait_for(lambda: still(bench.telescope))
        bench.mount.state()  # a motor board takes up its tracking
        return apart_deg(bench.telescope.believed_deg(), start) > 0.01

    assert any(it_moves() for _ in range(10))
    wait_for(lambda: separate(before, bench.mount.position()) > 0.01)  # a server may tell the one before
    after = bench.mount.position()
    east = (after.ra_deg - before.ra_deg + 180.0) % 360.0 - 180.0
    north = after.dec_deg - before.dec_deg
    along = {"north": north, "south": -north, "east": east, "west": -east}[direction.value]
    across = east if direction.in_dec else north
    assert 0.01 < along < 5.0, direction  # as long as a busy machine takes
    assert abs(across) < 0.02, direction


def test_a_pulse_is_small_and_goes_the_right_way(bench) -> None:
    for direction in Direction:
        if Ability.PULSE in bench.mount.lacks:
            with pytest.raises(RefusedError):
                bench.mount.pulse(direction, 500)
        else:
            pulses_the_right_way(bench, direction)


def pulses_the_right_way(bench, direction) -> None:
    before = bench.telescope.axes_deg()
    begun = time.monotonic()
    bench.mount.pulse(direction, 1000)
    bench.mount.position()  # what was sent before has been heard
    wait_for(lambda: not bench.mount.watchdog.moving)
    after = bench.telescope.axes_deg()
    lasted = time.monotonic() - begun
    axis = 1 if direction.in_dec else 0
    way = {"north": 1.0, "south": -1.0, "east": -1.0, "west": 1.0}[direction.value]
    sky = lasted * 360.0 / 86164.0905 if axis == 0 else 0.0
    shift_arcsec = (after[axis] - before[axis] - sky) * 3600.0 * way
    assert 5.0 < shift_arcsec < 10.0, direction  # half the sidereal rate for a second


def test_stop_ends_a_goto(bench) -> None:
    bench.telescope._slew_deg_s = 0.5
    bench.mount.goto(*own(bench, *place(-60.0, 50.0, bench.clock)))
    wait_for(lambda: bench.telescope.slewing)
    bench.mount.stop()
    wait_for(lambda: still(bench.telescope))
    assert bench.mount.state().slewing is False


def test_stop_ends_a_move(bench) -> None:
    bench.mount.move(Direction.NORTH, 0.5, 30.0)
    bench.mount.stop()
    wait_for(lambda: still(bench.telescope))
    assert distance(bench, own(bench, *where(bench))) < 5.0  # of 15 degrees, however late a busy machine is


def test_closing_ends_a_move(bench) -> None:
    bench.mount.move(Direction.WEST, 0.5, 30.0)
    bench.mount.close()
    wait_for(lambda: still(bench.telescope))
    with pytest.raises(DeviceError):
        bench.mount.position()


def test_it_tracks_at_each_rate_or_says_why_not(bench) -> None:
    for rate in TrackingRate:
        tracks_or_says_why_not(bench, rate)


def tracks_or_says_why_not(bench, rate) -> None:
    if rate.ability in bench.mount.lacks:
        with pytest.raises(RefusedError):
            Guard(bench.mount, SITE, LIMITS, clock=bench.clock).track(rate)
        return
    for wanted in (TrackingRate.SIDEREAL, TrackingRate.OFF, rate):
        if wanted.ability not in bench.mount.lacks:
            bench.mount.track(wanted)
            state = bench.mount.state()
            assert state.tracking is (wanted is not TrackingRate.OFF)
            assert wanted is TrackingRate.OFF or state.rate in (None, wanted)
    if bench.driver != "imaginary":
        really = bench.telescope.tracking_deg_s or bench.telescope._rates[0]
        assert really == pytest.approx(rate.deg_s, rel=2e-3)


def test_it_parks_and_unparks_or_says_why_not(bench) -> None:
    guard = Guard(bench.mount, SITE, LIMITS, clock=bench.clock)
    if Ability.PARK in bench.mount.lacks:
        for order in (guard.park, guard.unpark):
            with pytest.raises(RefusedError, match=NO_COMMAND):
                order()
        return
    run(guard.rest("park"))
    state = bench.mount.state()
    assert (state.parked, state.slewing, state.tracking) == (True, False, False)
    if bench.driver != "imaginary":
        assert bench.telescope.parked
        assert not guard.emergency.moving
    with pytest.raises(RefusedError, match="is parked"):
        guard.goto(*own(bench, *place(-25.0, 45.0, bench.clock)))
    run(guard.rest("park"))  # once more changes nothing
    guard.unpark()
    assert bench.mount.state().parked is False
    guard.goto(*own(bench, *place(-25.0, 45.0, bench.clock)))
    guard.stop()


def test_it_goes_home_or_says_why_not(bench) -> None:
    guard = Guard(bench.mount, SITE, LIMITS, clock=bench.clock)
    if Ability.HOME in bench.mount.lacks:
        with pytest.raises(RefusedError, match=NO_COMMAND):
            guard.go_home()
        return
    run(guard.rest("home"))
    state = bench.mount.state()
    assert (state.at_home, state.slewing, bool(state.parked)) == (True, False, False)
    assert bench.mount.position().dec_deg == pytest.approx(90.0, abs=0.02)
    assert [entry.action for entry in guard.log.sent()] == ["home"]


def test_a_stop_on_the_way_to_park_ends_it_unparked(bench) -> None:
    if Ability.PARK in bench.mount.lacks:
        pytest.skip("it cannot park")
    bench.telescope._slew_deg_s = 1.0
    guard = Guard(bench.mount, SITE, LIMITS, clock=bench.clock)
    task = guard.rest("park")
    for _ in range(3):
        next(task)
    guard.stop()
    with pytest.raises(StoppedError, match="park was stopped"):
        run(task)
    wait_for(lambda: still(bench.telescope))
    assert distance(bench, own(bench, *where(bench))) < 10.0


def test_it_tells_its_place_and_time_or_says_that_it_cannot(bench) -> None:
    told = bench.mount.site_report()
    if Ability.SITE in bench.mount.lacks:
        assert told.site is None
        return
    assert told.site.latitude_deg == pytest.approx(SITE.latitude_deg, abs=0.02)
    assert told.site.longitude_deg == pytest.approx(SITE.longitude_deg, abs=0.02)
    assert abs((told.time_utc - bench.clock()).total_seconds()) < 30.0
    assert told.utc_offset_h == (None if bench.driver == "alpaca" else 0.0)  # Alpaca tells universal time


def test_what_it_lacks_is_said_in_a_sentence(bench) -> None:
    assert all(reason.endswith(".") for reason in bench.mount.lacks.values())


def test_the_same_over_tcp(bench) -> None:
    if bench.driver == "imaginary" or bench.driver in SERVERS:
        pytest.skip("it has no line")
    from tests.gear.mounts.bench import opened
    from tests.simulate.lines import serve_socket

    with serve_socket(open_any(bench.driver, bench.telescope)) as port:
        mount = opened(bench.driver, port, bench.clock)
        here = mount.position()
        assert apart_deg((here.ra_deg, here.dec_deg), own(bench, *where(bench))) < CLOSE_DEG
        mount.close()


def test_behind_the_guard_only_what_is_logged_moves(bench) -> None:
    guard = Guard(bench.mount, SITE, LIMITS, clock=bench.clock)
    run(guard.slew(*own(bench, *place(-25.0, 45.0, bench.clock))))
    with pytest.raises(RefusedError, match="the limit is 5°"):
        guard.goto(*own(bench, *place(-20.0, -44.0, bench.clock)))
    guard.move(Direction.NORTH, 0.5, 0.1)
    wait_for(lambda: not bench.mount.watchdog.moving)
    guard.stop()
    assert [e.action for e in guard.log.sent()] == ["goto", "move", "stop"]
    if bench.driver not in COUNTERS:  # whose gotos are several turns of its axes
        move = "goto" if bench.driver == "alpaca" else "move"  # a slew by as much
        wait_for(lambda: len(moved(bench.telescope)) > 1)  # some answer no order: the line may still hold it
        assert [entry[0] for entry in moved(bench.telescope)] == ["goto", move]
