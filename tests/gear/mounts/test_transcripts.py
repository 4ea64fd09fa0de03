"""Every driver, byte for byte: what it sends, what it understands, and nothing left on the line."""

from datetime import UTC, datetime

import pytest

from kochab.core.errors import DeviceError, NoAnswerError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction, Epoch, PierSide, TrackingRate
from kochab.gear.mounts import DRIVERS, open_mount, serial_line
from kochab.gear.mounts.drivers.ioptron import Ioptron
from kochab.gear.mounts.drivers.lx200 import Lx200, OnStep
from kochab.gear.mounts.drivers.nexstar import NexStar, SynScan
from kochab.gear.mounts.drivers.serial_mount import RESTING
from kochab.gear.mounts.drivers.skywatcher import SkyWatcher
from tests.gear.mounts.scripted import CLASSIC_START, ScriptedLink, transcript

TARGET = (82.5, -12.25)
READ_BACK = [(b":Gr#", b"05:30:00#"), (b":Gd#", b"-12*15:00#")]


def test_lx200_classic_toggles_precision_once_and_reads_back() -> None:
    with transcript(Lx200, [*CLASSIC_START, (b":GR#", b"05:30:00#"), (b":GD#", b"-12\xdf15:00#")]) as m:
        here = m.position()
        assert (here.ra_deg, here.dec_deg, here.epoch) == (*TARGET, Epoch.DATE)
        assert m.identify() == "Meade LX200 classic"
        assert set(m.lacks) == {Ability.PULSE, *(rate.ability for rate in TrackingRate), *RESTING}


@pytest.mark.parametrize(("letter", "altaz"), [(b"P", False), (b"G", False), (b"A", True), (b"L", None)])
def test_lx200_in_high_precision_is_not_toggled(letter, altaz) -> None:
    start = [(b":GVP#", b"Autostar#"), (b":GR#", b"05:30:00#")]
    with transcript(Lx200, [*start, (b":D#", b"\x7f#"), (b":GW#", letter + b"T2#")]) as m:
        state = m.state()
        assert state.alt_azimuth is altaz
        assert (state.slewing, state.tracking, state.aligned) == (True, True, True)
        assert Ability.PULSE not in m.lacks


def test_lx200_classic_state_reads_33_bytes_of_bars_and_the_alignment() -> None:
    bars = b"\x7f" * 10 + b" " * 22 + b"#"
    script = [*CLASSIC_START, (b":D#", bars), (b"\x06", b"P"), (b":D#", b" " * 32 + b"#"), (b"\x06", b"L")]
    with transcript(Lx200, script) as m:
        assert (m.state().slewing, m.state().aligned) == (True, False)


def test_lx200_goto_and_sync() -> None:
    target = [(b":Sr05:30:00#", b"1"), (b":Sd-12*15:00#", b"1")]
    sync = (b":CM#", b"Coordinates     matched.        #")
    with transcript(Lx200, [*CLASSIC_START, *target, *READ_BACK, (b":MS#", b"0"), *target, *READ_BACK, sync]) as m:
        m.goto(*TARGET)
        m.sync(*TARGET)


def test_lx200_that_wants_a_space_gets_it() -> None:
    script = [
        *CLASSIC_START,
        (b":Sr05:30:00#", b"0"),
        (b":Sr 05:30:00#", b"1"),
        (b":Sd-12*15:00#", b"0"),
        (b":Sd -12*15:00#", b"1"),
        *READ_BACK,
        (b":MS#", b"0"),
    ]
    with transcript(Lx200, script) as m:
        m.goto(*TARGET)


@pytest.mark.parametrize(
    ("reply", "reason"), [(b"1Object Below Horizon#", "Object Below Horizon"), (b"2", "overhead limit")]
)
def test_lx200_slew_is_refused_with_the_mounts_reason(reply, reason) -> None:
    target = [(b":Sr05:30:00#", b"1"), (b":Sd-12*15:00#", b"1")]
    script = [*CLASSIC_START, *target, *READ_BACK, (b":MS#", reply)]
    with transcript(Lx200, script) as m, pytest.raises(RefusedError, match=reason):
        m.goto(*TARGET)


def test_10micron_has_its_own_precision_and_refuses_far_syncs() -> None:
    script = [
        (b":GVP#", b"10micron GM1000HPS#"),
        (b":GR#", b"05:30.0#"),
        (b":U1#:U2#", b""),
        (b":GR#", b"05:30:00.00#"),
        (b":Sr05:30:00.00#", b"1"),
        (b":Sd-12*15:00.0#", b"1"),
        (b":CM#", b"Match fail: dist. too large#"),
        (b":AL#", b""),
        (b":TQ#:AP#", b""),
    ]
    with transcript(Lx200, script) as m:
        with pytest.raises(RefusedError, match=r"dist\. too large"):
            m.sync(*TARGET)
        m.track(TrackingRate.OFF)
        m.track(TrackingRate.SIDEREAL)


def test_lx200_move_ends_and_stop_is_one_command() -> None:
    script = [*CLASSIC_START, (b":RM#", b""), (b":Me#", b""), (b":Q#", b"")]
    with transcript(Lx200, script) as m:
        m.move(Direction.EAST, 1.5, 30.0)
        assert m.watchdog.moving
        m.stop()
        assert not m.watchdog.moving


def test_lx200_classic_has_no_pulse() -> None:
    with transcript(Lx200, CLASSIC_START) as m, pytest.raises(RefusedError, match="no guide pulse"):
        m.pulse(Direction.NORTH, 100)


ONSTEP_START = [(b":GVP#", b"On-Step#"), (b":GVN#", b"4.24g#"), (b":GR#", b"05:30:00#")]


def test_onstep_flags_tracking_pulse() -> None:
    script = [
        *ONSTEP_START,
        (b":GU#", b"NPT#"),
        (b":GU#", b"nEW#"),
        (b":TQ#:Te#", b"1"),
        (b":Td#", b"0"),
        (b":Mgn0500#", b""),
    ]
    with transcript(OnStep, script) as m:
        parked, slewing = m.state(), m.state()
        assert (parked.parked, parked.slewing, parked.pier_side) == (True, False, PierSide.EAST)
        assert (slewing.slewing, slewing.tracking, slewing.pier_side) == (True, False, PierSide.WEST)
        m.track(TrackingRate.SIDEREAL)
        with pytest.raises(RefusedError, match="tracking"):
            m.track(TrackingRate.OFF)
        m.pulse(Direction.NORTH, 500)


@pytest.mark.parametrize(("reply", "reason"), [(b"E4#", "parked"), (b"N/A#", None)])
def test_onstep_sync_codes(reply, reason) -> None:
    script = [*ONSTEP_START, (b":Sr05:30:00#", b"1"), (b":Sd-12*15:00#", b"1"), (b":CM#", reply)]
    with transcript(OnStep, script) as m:
        if reason is None:
            m.sync(*TARGET)
        else:
            with pytest.raises(RefusedError, match=reason):
                m.sync(*TARGET)


def test_onstep_is_not_taken_for_another_mount() -> None:
    with (
        pytest.raises(NoAnswerError, match=r"calls itself ETX.* is for OnStep"),
        transcript(OnStep, [(b":GVP#", b"ETX#")]),
    ):
        pass


NEXSTAR_START = [(b"V", b"\x04\x15#"), (b"m", b"\x14#")]
NEXSTAR_HALTS = [(bytes([0x50, 2, board, 36, 0, 0, 0, 0]), b"#") for board in (16, 17)]
NEXSTAR_HALT = NEXSTAR_HALTS[0][0] + NEXSTAR_HALTS[1][0]


def test_nexstar_position_with_hashes_among_the_data() -> None:
    """Version 35.35: both data bytes are the terminator."""
    script = [(b"V", b"###"), (b"v", b"##"), (b"m", b"##"), (b"e", b"3AAAAAAA,F749F49F#")]
    with transcript(NexStar, script) as m:
        assert m.version == (35, 35)
        assert m.model == 35
        here = m.position()
        assert here.ra_deg == pytest.approx(82.5, abs=1e-6)
        assert here.dec_deg == pytest.approx(-12.25, abs=1e-6)


def test_nexstar_goto_sync_state() -> None:
    script = [
        *NEXSTAR_START,
        (b"J", b"\x01#"),
        (b"r3AAAAAAB,F749F49F", b"#"),
        (b"J", b"\x01#"),
        (b"s3AAAAAAB,F749F49F", b"#"),
        (b"p", b"E#"),
        (b"L", b"1#"),
        (b"J", b"\x01#"),
        (b"t", b"\x02#"),
    ]
    with transcript(NexStar, script) as m:
        m.goto(*TARGET)
        m.sync(*TARGET)
        state = m.state()
        assert (state.slewing, state.aligned, state.tracking) == (True, True, True)
        assert (state.pier_side, state.alt_azimuth) == (PierSide.WEST, False)
        assert m.identify() == "AVX, hand control 4.21"


@pytest.mark.parametrize(("mode", "altaz"), [(0, None), (1, True), (2, False), (3, False)])
def test_nexstar_tracks_in_altitude_and_azimuth_or_about_an_axis(mode, altaz) -> None:
    script = [*NEXSTAR_START, (b"p", b"E#"), (b"L", b"0#"), (b"J", b"\x01#"), (b"t", bytes([mode]) + b"#")]
    with transcript(NexStar, script) as m:
        assert m.state().alt_azimuth is altaz


@pytest.mark.parametrize(
    ("version", "latitude", "reply", "side"),
    [
        (b"\x04\x15#", 50.0, b"E#", PierSide.WEST),
        (b"\x04\x15#", 50.0, b"W#", PierSide.EAST),
        (b"\x05\x18#", -33.0, b"E#", PierSide.EAST),
        (b"\x05\x19#", -33.0, b"E#", PierSide.WEST),
    ],
)
def test_nexstar_names_the_side_it_looks_at_and_old_ones_the_other_in_the_south(version, latitude, reply, side) -> None:
    """As INDI's celestrongps.cpp reads it. Taken for the side of the tube, tracking would be stopped where it is safe."""
    asked = [(b"p", reply), (b"L", b"0#"), (b"J", b"\x01#"), (b"t", b"\x02#")]
    with transcript(NexStar, [(b"V", version), (b"m", b"\x14#"), *asked], site=Site(latitude, 8.0)) as m:
        assert m.state().pier_side is side


def test_nexstar_before_its_alignment_is_refused_before_the_goto_is_sent() -> None:
    with transcript(NexStar, [*NEXSTAR_START, (b"J", b"\x00#")]) as m, pytest.raises(RefusedError, match="not aligned"):
        m.goto(*TARGET)


def test_nexstar_of_old_has_no_sync_and_coarse_positions() -> None:
    script = [(b"V", b"\x01\x02#"), (b"v", b""), (b"m", b"\x01#"), (b"E", b"3AAB,F74A#")]
    with transcript(NexStar, script) as m:
        assert "4.10" in m.lacks[Ability.SYNC]
        with pytest.raises(RefusedError, match=r"4\.10"):
            m.sync(*TARGET)
        assert m.position().ra_deg == pytest.approx(82.5, abs=0.01)


def test_nexstar_stop_cancels_and_halts_both_axes_each_time() -> None:
    script = [
        *NEXSTAR_START,
        (bytes([0x50, 2, 16, 37, 9, 0, 0, 0]), b"#"),
        *(stop := [(b"M", b"#"), *NEXSTAR_HALTS]),
        *stop,
    ]
    with transcript(NexStar, script) as m:
        m.move(Direction.EAST, 4.0, 20.0)
        m.stop()
        m.stop()  # the first may have failed: it knows of no move any more


def test_nexstar_pass_through_that_fails_is_said() -> None:
    script = [*NEXSTAR_START, (bytes([0x50, 3, 17, 0x26, 50, 50, 0, 0]), b"\x00#")]
    with transcript(NexStar, script) as m, pytest.raises(NoAnswerError, match="motor board"):
        m.pulse(Direction.NORTH, 500)


def test_nexstar_tracking_comes_back_in_its_own_mode() -> None:
    script = [*NEXSTAR_START, (b"t", b"\x03#"), (b"T\x00", b"#"), (b"t", b"\x00#"), (b"T\x03", b"#")]
    with transcript(NexStar, script) as m:
        m.track(TrackingRate.OFF)
        m.track(TrackingRate.SIDEREAL)


def test_synscan_is_j2000_and_cancels_twice() -> None:
    script = [(b"V", b"042507#"), (b"m", b"\x00#"), (b"e", b"3AAAAAAA,F749F49F#")]
    script += [(b"M", b"#"), (b"M", b"#"), *NEXSTAR_HALTS]
    with transcript(SynScan, script) as m:
        assert m.position().epoch is Epoch.J2000
        assert m.identify() == "SynScan EQ6, hand control 4.37.07"
        m.stop()


IOPTRON_START = [(b":MountInfo#", b"0040")]


def test_ioptron_words() -> None:
    script = [
        *IOPTRON_START,
        (b":GEP#", b"-0441000002970000011#"),
        (b":SRA029700000#", b"1"),
        (b":Sd-04410000#", b"1"),
        (b":CM#", b"1"),
        (b":SRA029700000#", b"1"),
        (b":Sd-04410000#", b"1"),
        (b":MS1#", b"0"),
        (b":GLS#", b"+0288000050400000021911#"),
        (b":GEP#", b"-0441000002970000001#"),
        (b":SR8#", b"1"),  # its "maximum" is not known
        (b":mw#", b""),
        (b":Q#", b"1"),
        (b":qR#", b"1"),
        (b":qD#", b"1"),
        (b":ZE00500#", b""),
        (b":ST0#", b"1"),
        (b":RT1#", b"1"),
        (b":ST1#", b"1"),
        (b":MP1#", b"1"),
        (b":GLS#", b"+0288000050400000062911#"),
        (b":GEP#", b"-0441000002970000001#"),
        (b":MP0#", b"1"),
        (b":MH#", b"1"),
        (b":GLS#", b"+0288000050400000073911#"),
        (b":GEP#", b"-0441000002970000001#"),
    ]
    with transcript(Ioptron, script) as m:
        here = m.position()
        assert (here.ra_deg, here.dec_deg) == TARGET
        m.sync(*TARGET)
        with pytest.raises(RefusedError, match="refuses to go"):
            m.goto(*TARGET)
        state = m.state()
        assert (state.slewing, state.parked, state.pier_side) == (True, False, PierSide.EAST)
        m.move(Direction.EAST, 9.9, 10.0)
        m.stop()
        m.pulse(Direction.NORTH, 500)
        m.track(TrackingRate.OFF)
        m.track(TrackingRate.LUNAR)
        m.park()
        state = m.state()
        assert (state.parked, state.at_home, state.rate) == (True, False, TrackingRate.SOLAR)
        m.unpark()
        m.go_home()
        state = m.state()
        assert (state.parked, state.at_home, state.rate) == (False, True, TrackingRate.KING)


MOTORS_START = [
    (b":a1\r", b"=00B289\r"),
    (b":b1\r", b"=A7FD00\r"),
    (b":a2\r", b"=00B289\r"),
    (b":b2\r", b"=A7FD00\r"),
    (b":e1\r", b"=020300\r"),
    (b":f1\r", b"=001\r"),
    (b":q1010000\r", b"!0\r"),  # an old board has no features, so no home sensors
]
FRESH_START = [*MOTORS_START[:-2], (b":f1\r", b"=000\r"), MOTORS_START[-1]]  # not initialised since it was switched on
SITE = Site(50.0, 8.0)


def noon():
    return datetime(2026, 3, 20, 12, tzinfo=UTC)


def test_skywatcher_at_home_points_at_the_pole() -> None:
    script = [*MOTORS_START, (b":j1\r", b"=000080\r"), (b":j2\r", b"=000080\r")]
    with transcript(SkyWatcher, script, site=SITE, clock=noon) as m:
        assert m.position().dec_deg == 90.0
        assert m.identify() == "Sky-Watcher motor board, version 2.03"


def test_skywatcher_refusal_is_said_and_nothing_starts() -> None:
    script = [*FRESH_START, (b":f1\r", b"=000\r"), (b":F1\r", b"!5\r")]
    with transcript(SkyWatcher, script, site=SITE, clock=noon) as m, pytest.raises(RefusedError, match="sleeps"):
        m.track(TrackingRate.SIDEREAL)


def test_skywatcher_tracks_by_its_period_and_stops_both_axes() -> None:
    script = [
        *FRESH_START,
        (b":f1\r", b"=000\r"),
        (b":F1\r", b"=\r"),
        (b":G110\r", b"=\r"),
        (b":I16C0200\r", b"=\r"),
        (b":J1\r", b"=\r"),
        (b":L1\r", b"=\r"),
        (b":L2\r", b"=\r"),
    ]
    with transcript(SkyWatcher, script, site=SITE, clock=noon) as m:
        m.track(TrackingRate.SIDEREAL)
        m.stop()


def test_skywatcher_asks_again_when_an_answer_is_lost() -> None:
    script = [(b":a1\r", b""), (b":a1\r", b"=00B2"), *MOTORS_START]
    with transcript(SkyWatcher, script, site=SITE, clock=noon) as m:
        assert m.motors[0].steps_turn == 9024000


TURN_100_STEPS = [
    (b":j2\r", b"=000080\r"),
    (b":G220\r", b""),
    (b":G220\r", b"=\r"),
    (b":H2640000\r", b"=\r"),
    (b":M20B0000\r", b"=\r"),
    (b":J2\r", b""),
]


@pytest.mark.parametrize(
    "seen",
    [
        [(b":f2\r", b"=011\r")],
        [(b":f2\r", b"=001\r"), (b":j2\r", b"=640080\r")],
        [(b":f2\r", b"=001\r"), (b":j2\r", b"=000080\r"), (b":J2\r", b"=\r")],
    ],
    ids=["it turns", "it has turned", "it has not moved"],
)
def test_skywatcher_looks_before_a_lost_start_is_said_again(seen) -> None:
    script = [*MOTORS_START, *TURN_100_STEPS, *seen]
    with transcript(SkyWatcher, script, site=SITE, clock=noon) as m:
        m.motors[1].angle_deg()
        m.motors[1].turn_by(100 / 9024000 * 360.0, m.talk.stops)


def test_skywatcher_never_repeats_a_lost_start_of_a_steady_motion() -> None:
    script = [
        *MOTORS_START,
        (b":f1\r", b"=001\r"),
        (b":G110\r", b"=\r"),
        (b":I16C0200\r", b"=\r"),
        (b":J1\r", b""),
        (b":f1\r", b"=001\r"),
    ]
    with transcript(SkyWatcher, script, site=SITE, clock=noon) as m, pytest.raises(NoAnswerError):
        m.track(TrackingRate.SIDEREAL)


def test_skywatcher_without_a_site_says_so() -> None:
    with pytest.raises(DeviceError, match="give --site"), transcript(SkyWatcher, []):
        pass


# -- Which way a motor turns: in both hemispheres, on both sides of the pier -------------------------


def count(angle_deg):
    """An encoder so far from its middle, low byte first."""
    return (0x800000 + round(angle_deg / 360.0 * 9024000)).to_bytes(3, "little").hex().upper().encode()


def period(ticks):
    return ticks.to_bytes(3, "little").hex().upper().encode()


def turning(axis, backwards, ticks):
    return [
        (b":G%d1%d\r" % (axis, backwards), b"=\r"),
        (b":I%d%s\r" % (axis, period(ticks)), b"=\r"),
        (b":J%d\r" % axis, b"=\r"),
    ]


def turning_by(axis, backwards, arcsec):
    """A slow goto of so much, which the board itself ends."""
    steps = round(arcsec / 1296000.0 * 9024000)
    return [
        (b":G%d2%d\r" % (axis, backwards), b"=\r"),
        (b":H%d%s\r" % (axis, period(steps)), b"=\r"),
        (b":M%d%s\r" % (axis, period(min(steps // 10 + 1, 3500))), b"=\r"),
        (b":J%d\r" % axis, b"=\r"),
    ]


AT_64 = 64 * 15.04106864  # arcsec in a second


@pytest.mark.parametrize(("latitude", "backwards"), [(50.0, False), (-35.0, True)])
def test_skywatcher_follows_the_sky_backwards_in_the_south(latitude, backwards) -> None:
    script = [*MOTORS_START, (b":f1\r", b"=001\r"), *turning(1, backwards, 620)]
    with transcript(SkyWatcher, script, site=Site(latitude, 8.0), clock=noon) as m:
        m.track(TrackingRate.SIDEREAL)


@pytest.mark.parametrize(
    ("latitude", "direction", "backwards"),
    [
        (50.0, Direction.WEST, False),
        (50.0, Direction.EAST, True),
        (-35.0, Direction.WEST, True),
        (-35.0, Direction.EAST, False),
    ],
)
def test_skywatcher_moves_right_ascension_as_the_sky_goes_or_against_it(latitude, direction, backwards) -> None:
    script = [*MOTORS_START, (b":f1\r", b"=001\r"), (b":j1\r", b"=000080\r"), *turning_by(1, backwards, AT_64)]
    with transcript(SkyWatcher, script, site=Site(latitude, 8.0), clock=noon) as m:
        m.move(direction, 0.2674, 1.0)


@pytest.mark.parametrize(
    ("direction", "backwards", "times"), [(Direction.WEST, False, 9.5), (Direction.EAST, True, 6.5)]
)
def test_skywatcher_moves_on_top_of_tracking(direction, backwards, times) -> None:
    """Eight times the sky's rate for a second, and what the sky turns until it tracks again, half a second later."""
    running = [(b":f1\r", b"=111\r"), (b":K1\r", b"=\r"), (b":f1\r", b"=001\r"), (b":j1\r", b"=000080\r")]
    tracking = [*MOTORS_START, (b":f1\r", b"=001\r"), *turning(1, False, 620)]
    script = [*tracking, *running, *turning_by(1, backwards, times * 15.04106864)]
    with transcript(SkyWatcher, script, site=SITE, clock=noon) as m:
        m.track(TrackingRate.SIDEREAL)
        m.move(direction, 0.0334, 1.0)


@pytest.mark.parametrize(
    ("latitude", "second_deg", "direction", "backwards"),
    [
        (50.0, -30.0, Direction.NORTH, False),
        (50.0, -30.0, Direction.SOUTH, True),
        (50.0, 30.0, Direction.NORTH, True),
        (50.0, 30.0, Direction.SOUTH, False),
        (-35.0, -30.0, Direction.NORTH, True),
        (-35.0, -30.0, Direction.SOUTH, False),
        (-35.0, 30.0, Direction.NORTH, False),
        (-35.0, 30.0, Direction.SOUTH, True),
    ],
)
def test_skywatcher_moves_declination_the_other_way_on_the_other_side_of_the_pier(
    latitude, second_deg, direction, backwards
) -> None:
    """Its axis is 0 at the pole, so that a turn towards 0 goes to the pole that is up."""
    script = [
        *MOTORS_START,
        (b":j1\r", b"=000080\r"),
        (b":j2\r", b"=%s\r" % count(second_deg)),
        (b":f2\r", b"=001\r"),
        (b":j2\r", b"=%s\r" % count(second_deg)),
        *turning_by(2, backwards, AT_64),
    ]
    with transcript(SkyWatcher, script, site=Site(latitude, 8.0), clock=noon) as m:
        m.move(direction, 0.2674, 1.0)


# -- What every make speaks ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "bauds", "blind_stop"),
    [
        ("lx200", (9600,), b"#:Q#"),
        ("onstep", (9600, 115200), b"#:Q#"),
        ("nexstar", (9600,), b"M" + NEXSTAR_HALT),
        ("synscan", (9600,), b"MM" + NEXSTAR_HALT),
        ("ioptron", (115200, 230400), b"#:Q#:qR#:qD#"),
        ("skywatcher", (9600, 115200), b":L1\r:L2\r"),
    ],
)
def test_a_make_s_line_rates_and_its_blind_stop(name, bauds, blind_stop) -> None:
    driver = DRIVERS.load(name)
    assert (driver.bauds, driver.blind_stop) == (bauds, blind_stop)
    assert list(driver.rates_deg_s) == sorted(driver.rates_deg_s)
    assert driver.name == name


def test_a_synscan_s_model_is_its_maker_s_number() -> None:
    """128 to 143 AZ GoTo mounts, 144 to 159 Dobsonians, 160 the AllView; the others in the order of their making."""
    models = DRIVERS.load("synscan").models
    assert [models[number] for number in (0, 1, 2, 3, 4, 9, 10)] == [
        *("EQ6", "HEQ5", "EQ5", "EQ3", "EQ8", "EQ6-R", "Star Adventurer")
    ]
    assert [number for number, name in models.items() if name == "AZ GoTo"] == list(range(128, 144))
    assert [number for number, name in models.items() if name == "Dobsonian"] == list(range(144, 160))
    assert models[160] == "AllView"
    assert max(models) == 160


class Silent(ScriptedLink):
    """A line that nobody answers."""

    def __init__(self, *opened):
        super().__init__([])
        self.opened, self.written, self.quiet_s = opened, [], []

    def write(self, data):
        self.written.append(data)

    def discard(self, quiet_s=0.0):
        self.quiet_s.append(quiet_s)
        return b""


@pytest.mark.parametrize(("baud", "rate"), [(None, 115200), (230400, 230400)])
def test_a_mount_that_does_not_answer_is_told_with_its_port_and_rate_and_the_line_is_closed(
    monkeypatch, baud, rate
) -> None:
    made = []
    monkeypatch.setattr(serial_line, "SerialLink", lambda *opened: made.append(Silent(*opened)) or made[-1])
    with pytest.raises(NoAnswerError, match=rf"^No iOptron .* answers on port7 at {rate} baud: check power"):
        open_mount("ioptron", "port7", baud)
    assert (made[0].opened, made[0].closed) == (("port7", rate), True)
    assert b":Q#" not in b"".join(made[0].written)


def test_after_a_lost_line_stop_is_the_first_word_and_its_answer_is_waited_for(monkeypatch) -> None:
    made = []
    monkeypatch.setattr(serial_line, "SerialLink", lambda *opened: made.append(Silent(*opened)) or made[-1])
    with pytest.raises(NoAnswerError):
        open_mount("skywatcher", "port7", stop_first=True, site=SITE)
    assert made[0].written[0] == b":L1\r:L2\r"
    assert made[0].quiet_s[0] == 0.5


def test_any_other_failure_closes_the_line_too(monkeypatch) -> None:
    made = []
    monkeypatch.setattr(serial_line, "SerialLink", lambda *opened: made.append(Silent(*opened)) or made[-1])
    with pytest.raises(DeviceError, match="give --site"):
        open_mount("skywatcher", "port7")
    assert made[0].closed
