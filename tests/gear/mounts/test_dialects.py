"""The table of dialects: what each make is sent and what its answers mean, by its documents and by real exchanges."""

import time
from dataclasses import replace

import pytest

from kochab.core.errors import NoAnswerError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction, PierSide, TrackingRate
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.drivers import lx200 as drivers
from kochab.gear.mounts.drivers.lx200_dialects import DIALECTS, named
from kochab.gear.mounts.drivers.nexstar import NexStar, StarSense
from kochab.gear.mounts.protocols import ioptron, lx200
from kochab.gear.mounts.serial_line import ProtocolError, with_port
from tests.gear.mounts.scripted import transcript
from tests.simulate.dialects import open_any
from tests.simulate.lines import serve_socket

TARGET = (82.5012, -12.2503)
GTO_START = [(b":V#", b"VCP4-P02-15#"), (b":GR#", b"05:30.1#"), (b":U#", b""), (b":GR#", b"05:30:00.3#")]
RAINBOW_START = [(b":AV#", b":AV190905#"), (b":GR#", b":GR05:30:00.3#")]
GEMINI_START = [(b":GVP#", b"Losmandy Gemini#"), (b":GVN#", b"5.21#"), (b":GR#", b"05:30:00#")]
AM5_START = [(b":GVP#", b"AM5#"), (b":GR#", b"08:04:30#")]


def test_every_row_is_a_driver_with_its_own_line() -> None:
    for name, row in DIALECTS.items():
        driver = drivers.speaking(name)
        assert (driver.name, driver.title, driver.bauds, driver.only) == (name, row.title, row.bauds, row)
        assert not set(row.answered) - {*row.commands, Ability.KING}
        assert all(b":hF" not in command for command in row.commands.values())  # which resets or aligns anew


@pytest.mark.parametrize(
    ("product", "driver"),
    [
        ("On-Step", "onstep"),
        ("OnStepX", "onstep"),
        ("10micron GM1000HPS", "10micron"),
        ("AM5", "am5"),
        ("Pegasus NYX-101", "nyx"),
        ("TeenAstro", "teenastro"),
        ("Losmandy Gemini", "gemini"),
        ("VCP4-P02-15", "astrophysics"),
        (":AV200625", "rainbow"),
        ("Autostar", ""),
        ("OpenAstroMount", ""),
        ("", ""),
    ],
)
def test_a_mount_is_known_by_its_name(product, driver) -> None:
    assert named(product) == driver


def test_the_state_of_an_am5_is_the_last_digit_and_its_side_another_question() -> None:
    """L31 and L32, a real AM5; and the document's other states."""
    states = [
        (b"NGM011000211#", b"N#"),
        (b"nNHGM011000210#", b"N#"),
        (b"GM011000212#", b"E#"),
        (b"NGM011000214#", b"W#"),
    ]
    asked = [pair for flags, side in states for pair in ((b":GU#", flags), (b":Gm#", side))]
    with transcript(drivers.Am5, [*AM5_START, *asked]) as m:
        tracking, home, slewing, homing = (m.state() for _ in range(4))
    assert (tracking.tracking, tracking.slewing, tracking.pier_side, tracking.parked) == (True, False, None, None)
    assert (home.tracking, home.at_home) == (False, True)
    assert (slewing.slewing, slewing.pier_side) == (True, PierSide.EAST)
    assert homing.slewing is True, "though there is no goto"
    assert lx200.parse_zwo_status(b"NZM011000211#").alt_azimuth is True


@pytest.mark.parametrize(
    ("driver", "start", "sent"),
    [
        (drivers.Am5, AM5_START, b":Mgn3000#"),  # L35: 3 s is the longest
        (drivers.AstroPhysics, GTO_START, b":Mn999#"),  # L120; :Mn000# would move until it is stopped
        (drivers.Gemini, GEMINI_START, b":Mgn9999#"),
    ],
)
def test_a_pulse_keeps_to_its_longest_and_is_never_nought(driver, start, sent) -> None:
    least = sent.replace(b"3000", b"0001").replace(b"9999", b"0001").replace(b"999", b"001")
    with transcript(driver, [*start, (sent, b""), (least, b"")]) as m:
        m.pulse(Direction.NORTH, 20000)
        m.pulse(Direction.NORTH, 0)


def test_a_gemini_of_level_4_gets_no_pulse() -> None:
    """L126: it counts them modulo 256 steps."""
    old = [(b":GVP#", b"Losmandy Gemini#"), (b":GVN#", b"4.00#"), (b":GR#", b"05:30:00#")]
    with transcript(drivers.Gemini, old) as m, pytest.raises(RefusedError, match="no guide pulse"):
        m.pulse(Direction.NORTH, 500)


def test_an_astro_physics_keeps_its_side_and_tells_its_state() -> None:
    """L120: no product's name, no bars; the long form goes one way; :CMR# keeps the side of the pier."""
    target = [(b":Sr 05:30:00.3#", b"1"), (b":Sd -12*15:01#", b"1")]
    states = [(b":GOS#", b"029S0001000000#"), (b":pS#", b"East#"), (b":GOS#", b"P990011000000#"), (b":pS#", b"West#")]
    script = [*GTO_START, *target, (b":CMR#", b"Coordinates     matched.        #"), *states, (b":RT9#", b"")]
    script += [(b":RT0#", b""), (b":KA#", b""), (b":RC1#", b""), (b":Me#", b""), (b":Q#", b"")]
    with transcript(drivers.AstroPhysics, script) as m:
        assert m.identify() == "Astro-Physics GTO VCP4-P02-15"
        m.sync(*TARGET)
        slewing, parked = m.state(), m.state()
        assert (slewing.slewing, slewing.tracking, slewing.rate) == (True, True, TrackingRate.SIDEREAL)
        assert (slewing.pier_side, slewing.parked) == (PierSide.EAST, False)
        assert (parked.parked, parked.tracking, parked.slewing) == (True, False, False)
        m.track(TrackingRate.OFF)
        m.track(TrackingRate.LUNAR)
        m.park()
        m.move(Direction.EAST, 1.0, 20.0)
        m.stop()


def test_a_rainbow_begins_its_answers_with_the_question_and_answers_no_slew() -> None:
    target = [(b":Sr05:30:00.3#", b"1"), (b":Sd-12*15:01#", b"1")]
    place = [(b":GR#", b":MM0#"), (b":GR#", b":GR05:30:00.3#"), (b":GD#", b":GD-12*15:01.1#")]
    script = [*RAINBOW_START, *target, (b":MS#", b""), (b":CL#", b":CL1#"), (b":AT#", b":AT1#"), *place]
    script += [(b":Ck082.501-12.250#", b""), (b":Ck000.000+01.000#", b""), (b":CtL#", b"")]
    with transcript(drivers.Rainbow, script) as m:
        assert m.identify() == "RainbowAstro RST 190905"
        m.goto(*TARGET)
        state = m.state()
        assert (state.slewing, state.tracking) == (True, True)
        assert m.position().dec_deg == pytest.approx(-12.2503, abs=1e-4)
        m.sync(*TARGET)
        m.sync(359.99996, 1.0)
        m.track(TrackingRate.OFF)
        assert m.rates_deg_s == (), "they are set in the mount"
        with pytest.raises(RefusedError, match="no guide pulse"):
            m.pulse(Direction.NORTH, 100)
    with pytest.raises(NoAnswerError), transcript(drivers.Rainbow, [(b":AV#", b"")] * 4):
        pass


@pytest.mark.parametrize(
    ("driver", "start", "rate", "halt"),
    [(drivers.Rainbow, RAINBOW_START, b":RC#", b":Q#"), (drivers.Am5, AM5_START, b":R6#", b":Qe#")],
)
def test_a_move_ends_by_the_words_that_the_mount_knows(driver, start, rate, halt) -> None:
    """A Rainbow before version 200625 knows no Stop of one axis."""
    with transcript(driver, [*start, (rate, b""), (b":Me#", b""), (halt, b"")]) as m:
        m.move(Direction.EAST, 0.1, 0.6)  # one that begins late, on a busy machine, is stopped twice
        deadline = time.monotonic() + 90.0
        while m.watchdog.moving and time.monotonic() < deadline:
            time.sleep(0.01)
        assert not m.watchdog.moving


def test_a_gemini_is_parked_only_while_nothing_moves() -> None:
    """The answer to :h?# stays 1 when it has woken up."""
    asked = [(b":Gv#", b"N"), (b":h?#", b"1"), (b":Gv#", b"T"), (b":h?#", b"1"), (b":Gv#", b"!"), (b":h?#", b"0")]
    native = [(b">191:}#", b""), (b">131:w#>192:~#", b"")]  # INDI's driver sends <509:z# by the same rule
    with transcript(drivers.Gemini, [*GEMINI_START, *asked, *native]) as m:
        parked, awake, stalled = m.state(), m.state(), m.state()
        m.track(TrackingRate.OFF)
        m.track(TrackingRate.SIDEREAL)
    assert (parked.parked, parked.tracking) == (True, False)
    assert (awake.parked, awake.tracking) == (False, True)
    assert "stalled" in stalled.fault


def test_a_teenastro_tells_everything_in_one_word() -> None:
    """The places are those of TeenAstro's own client; the first is the motion, the last a fault."""
    state = lx200.parse_teenastro(b"10p 3        W07A#")
    assert (state.slewing, state.parked, state.tracking, state.at_home) == (False, False, True, False)
    assert (state.pier_side, state.fault) == (PierSide.WEST, "the meridian limit")
    assert lx200.parse_teenastro(b"00PH3        E00A#").parked is True
    assert lx200.parse_teenastro(b"20I 3        E00A#").slewing is True
    with pytest.raises(ProtocolError):
        lx200.parse_teenastro(b"nNpH4#")


@pytest.mark.parametrize(
    ("flags", "fault"),
    [(b"nNpeEW260#", ""), (b"NpeEW261#", "a fault of its motors"), (b"nNpEW262#", "the horizon limit")],
)
def test_the_last_digit_of_an_onstep_is_told_in_words(flags, fault) -> None:
    """L20 ends in 260, which means no fault. The codes are OnStep's own, as listed in INDI's driver."""
    assert lx200.parse_flags(flags).fault == fault
    assert set(lx200.FAULTS) == set(range(1, 10))


@pytest.mark.parametrize(("flags", "slewing"), [(b"NpgET080#", True), (b"NpGgET080#", False), (b"NpET080#", False)])
def test_onstepx_tells_of_a_move_that_is_no_guide_pulse(flags, slewing) -> None:
    """Status.command.cpp: g while anything guides, G beside it for a pulse."""
    assert lx200.parse_flags(flags).slewing is slewing


@pytest.mark.parametrize(("driver", "reason"), [("teenastro", "2"), ("onstep", "2")])
def test_a_digit_means_what_its_own_make_says(driver, reason) -> None:
    """L25 and the notes of the documents: 2 is no target for a TeenAstro, and too high for an OnStepX."""
    row = DIALECTS[driver]
    told = lx200.parse_slew(reason.encode(), row.refusals)
    assert told == {"teenastro": "no target", "onstep": "above the overhead limit"}[driver]


def test_an_old_onstep_is_read_and_sent_in_whole_seconds_and_a_new_one_finely() -> None:
    """L2A: an OnStepX takes SS.SSSS. L20 and L2B: its versions begin with 10, those before with 3 or 4."""
    old = [(b":GVP#", b"On-Step#"), (b":GVN#", b"4.24g#"), (b":GR#", b"05:30:00#")]
    new = [(b":GVP#", b"On-Step#"), (b":GVN#", b"10.19d#"), (b":GRH#", b"05:30:00.2880#")]
    with transcript(drivers.OnStep, [*old, (b":Sr05:30:00#", b"1"), (b":Sd-12*15:01#", b"1"), (b":MS#", b"0")]) as m:
        m.goto(*TARGET)
    script = [*new, (b":Sr05:30:00.2880#", b"1"), (b":Sd-12*15:01.080#", b"1"), (b":MS#", b"0")]
    script += [(b":GRH#", b"05:30:00.2880#"), (b":GDH#", b"-12*15:01.080#")]
    with transcript(drivers.OnStep, script) as m:
        m.goto(*TARGET)
        here = m.position()
        assert (here.ra_deg, here.dec_deg) == pytest.approx(TARGET, abs=1e-6)


def test_why_an_onstep_stopped_on_its_way_is_told() -> None:
    from kochab.core.progress import run
    from kochab.gear.mounts.guard import Guard
    from tests.gear.mounts.bench import LIMITS, SITE, simulated
    from tests.gear.mounts.bench import place as at

    with simulated("onstep", slew_deg_s=2.0) as bench:
        mount = bench.open()
        guard = Guard(mount, SITE, LIMITS, clock=bench.clock)
        slew = guard.slew(*at(-60.0, 50.0, bench.clock))
        for _ in range(3):
            next(slew)
        bench.telescope.stop()
        state = mount.state
        mount.state = lambda: replace(state(), fault=lx200.parse_flags(b"NpEW267#").fault)
        with pytest.raises(RefusedError, match=r"deg from its target: the meridian limit\."):
            run(slew)
        mount.close()


# -- StarSense, and forks -----------------------------------------------------------------------------


def test_a_starsense_is_found_by_its_variant_and_syncs_from_1_18() -> None:
    """It has version numbers of its own: 1.18 is not older than 4.10 (INDI's celestrongps.cpp, checkMinVersion)."""
    start = [(b"V", b"\x01\x12#"), (b"v", b"\x13#"), (b"m", b"\x0c#")]
    sync = [(b"J", b"\x01#"), (b"s3AAAAAAB,F749F49F", b"#")]
    asked = [(b"p", b"E#"), (b"L", b"0#"), (b"J", b"\x01#"), (b"t", b"\x01#")]
    with transcript(NexStar, [*start, *sync, *asked]) as m:
        assert Ability.SYNC not in m.lacks
        m.sync(82.5, -12.25)
        state = m.state()
        assert (state.pier_side, state.alt_azimuth) == (PierSide.WEST, True)
        assert m.identify() == "NexStar 6/8 SE, hand control 1.18"
    with transcript(StarSense, [(b"V", b"\x01\x11#"), (b"m", b"\x0c#")]) as m:
        assert "1.17, a sync needs 1.18" in m.lacks[Ability.SYNC]
    south = [*start, *asked]
    with transcript(NexStar, south, site=Site(-33.0, 151.0)) as m:
        assert m.state().pier_side is None, "which side it names in the south is not known"


def test_the_numbers_of_ioptrons_present_models() -> None:
    names = {code: ioptron.parse_model(b"%04d" % code) for code in (31, 33, 35, 52, 62, 73, 120)}
    assert list(names.values()) == ["HAE29 EQ", "HAE29 AA", "HAZ31", "HAZ46", "HAE69 EQ", "HAZ71", "CEM120"]
    told = [ioptron.is_alt_azimuth(name) for name in names.values()]
    assert told == [False, True, True, True, False, True, False]
    assert ioptron.is_alt_azimuth(ioptron.parse_model(b"0025")) is None, "HEM27 or CEM25"


# -- TCP -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("driver", "address"),
    [
        ("lx200", "tcp://skyfi:4030"),
        ("onstep", "tcp://skyfi:9999"),
        ("am5", "tcp://skyfi:4030"),
        ("ioptron", "tcp://skyfi:8899"),
        ("skywatcher", "tcp://skyfi"),
    ],
)
def test_a_tcp_address_needs_no_port_where_the_mounts_have_a_usual_one(driver, address) -> None:
    from kochab.gear.mounts import DRIVERS

    assert with_port("tcp://skyfi", DRIVERS.load(driver).tcp_port) == address
    assert with_port("tcp://skyfi:23", DRIVERS.load(driver).tcp_port) == "tcp://skyfi:23"
    assert with_port("/dev/ttyUSB0", 4030) == "/dev/ttyUSB0"


@pytest.mark.parametrize("driver", ["lx200", "onstep", "am5", "nexstar"])
def test_a_mount_answers_at_a_tcp_address(driver) -> None:
    from tests.simulate.bench_telescope import BenchTelescope

    telescope = BenchTelescope()
    with serve_socket(open_any(driver, telescope)) as port:
        mount = open_mount(driver, port.replace("socket://", "tcp://"))
        assert abs(mount.position().dec_deg - telescope.believed_deg()[1]) < 0.01
        mount.close()
