"""Replies at the edge of what can be: the last possible value is read, the next one is no answer."""

from types import SimpleNamespace

import pytest
from serial.tools import list_ports as serial_ports

from kochab.core.errors import NoAnswerError, NotStoppedError, PortError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Direction, PierSide, TrackingRate
from kochab.core.progress import run
from kochab.gear.mounts.coordinates import from_mount_epoch
from kochab.gear.mounts.drivers.motor_mount import natural_side, to_axes
from kochab.gear.mounts.drivers.nexstar import NexStar
from kochab.gear.mounts.drivers.skywatcher import SkyWatcher, altaz_objection
from kochab.gear.mounts.probe import list_ports, port_info, probe_port
from kochab.gear.mounts.protocols import ioptron, lx200, nexstar, skywatcher
from kochab.gear.mounts.serial_line import ProtocolError
from tests.gear.mounts.bench import simulated
from tests.gear.mounts.imaginary import guarded
from tests.gear.mounts.scripted import transcript
from tests.gear.mounts.test_transcripts import MOTORS_START, SITE, noon


def nex_site(*numbers):
    return bytes(numbers) + b"#"


@pytest.mark.parametrize(
    ("parse", "reply", "value"),
    [
        (lx200.parse_ra, b"23:59:59#", 359.99583333),
        (lx200.parse_ra, b"24:00:00#", None),
        (lx200.parse_ra, b"12:59.9#", 194.975),
        (lx200.parse_ra, b"12:60:00#", None),
        (lx200.parse_ra, b"12:00:60#", None),
        (lx200.parse_dec, b"+90*00:00#", 90.0),
        (lx200.parse_dec, b"-90*00:00#", -90.0),
        (lx200.parse_dec, b"+90*00:01#", None),
        (lx200.parse_dec, b"+45*59:59#", 45.99972222),
        (lx200.parse_dec, b"+45*60:00#", None),
        (lx200.parse_dec, b"+45*00:60#", None),
        (lx200.parse_longitude, b"360*00#", 0.0),
        (lx200.parse_longitude, b"360*01#", None),
        (lx200.parse_longitude, b"180*00#", -180.0),
        (lx200.parse_longitude, b"179*30#", -179.5),
        (lx200.parse_longitude, b"-170*00#", 170.0),
        (lx200.parse_azimuth, b"360*00#", 360.0),
        (lx200.parse_azimuth, b"360*01#", None),
        (lx200.parse_azimuth, b"-000*01#", None),
        (lx200.parse_zone, b"+14#", -14.0),
        (lx200.parse_zone, b"+15#", None),
        (lx200.parse_zone, b"-03.5#", 3.5),
        (lx200.parse_zone, b"+09:45#", -9.75),
        (lx200.parse_time, b"23:59:59#", (23, 59, 59)),
        (lx200.parse_time, b"24:00:00#", None),
        (lx200.parse_time, b"00:60:00#", None),
        (lx200.parse_time, b"00:00:60#", None),
        (lx200.parse_date, b"12/31/26#", (2026, 12, 31)),
        (lx200.parse_date, b"01/01/99#", (2099, 1, 1)),
        (lx200.parse_date, b"13/01/26#", None),
        (lx200.parse_date, b"00/01/26#", None),
        (lx200.parse_date, b"01/32/26#", None),
        (lx200.parse_date, b"01/00/26#", None),
        (lx200.parse_coarse, b"05:30.5#", True),
        (lx200.parse_coarse, b"05:30:30#", False),
        (ioptron.parse_altaz, b"+32400000129600000#", (90.0, 360.0)),
        (ioptron.parse_park_altitude, b"00144000064800000#", 0.4),
        (ioptron.parse_park_altitude, b"32400001000000000#", None),
        (ioptron.parse_park_altitude, b"-0144000064800000#", None),
        (ioptron.parse_altaz, b"+32400001000000000#", None),
        (ioptron.parse_altaz, b"+00000000129600001#", None),
        (ioptron.parse_site, b"-02880000" + b"01800000" + b"010000#", Site(-85.0, -8.0)),
        (ioptron.parse_site, b"+64800000" + b"64800000" + b"010000#", Site(90.0, -180.0)),
        (ioptron.parse_site, b"+64800000" + b"64800001" + b"010000#", None),
        (nexstar.parse_site, nex_site(90, 0, 0, 0, 180, 0, 0, 0), Site(90.0, 180.0)),
        (nexstar.parse_site, nex_site(90, 0, 1, 0, 180, 0, 0, 0), None),
        (nexstar.parse_site, nex_site(50, 0, 0, 0, 180, 0, 1, 0), None),
        (nexstar.parse_site, nex_site(50, 59, 59, 0, 8, 59, 59, 1), Site(50.999722222, -8.999722222)),
        (nexstar.parse_site, nex_site(50, 60, 0, 0, 8, 0, 0, 0), None),
        (nexstar.parse_site, nex_site(50, 0, 0, 0, 8, 0, 60, 0), None),
        (nexstar.parse_site, nex_site(50, 0, 0, 2, 8, 0, 0, 0), None),
        (nexstar.parse_position, b"8000,4000#", (180.0, 90.0)),
        (nexstar.parse_position, b"0000,C000#", (0.0, -90.0)),
        (nexstar.parse_position, b"0000,B000#", (180.0, -67.5)),
        (nexstar.parse_position, b"8000,40000000#", None),
        (nexstar.parse_version, b"\x04\x15#", (4, 21)),
        (nexstar.parse_version, b"042507#", (4, 37, 7)),
        (nexstar.parse_passed, b"\x00#", None),
        (nexstar.parse_passed, b"#", b""),
    ],
)
def test_the_last_value_is_read_and_the_next_is_none(parse, reply, value) -> None:
    if value is None:
        with pytest.raises(ProtocolError):
            parse(reply)
    elif isinstance(value, Site):
        found = parse(reply)
        assert (found.latitude_deg, found.longitude_deg) == pytest.approx((value.latitude_deg, value.longitude_deg))
    elif isinstance(value, bytes | bool):
        assert parse(reply) == value
    else:
        assert parse(reply) == pytest.approx(value)


@pytest.mark.parametrize(("zone", "summer", "offset"), [(250, 0, -6.0), (14, 1, 15.0), (241, 0, -15.0), (15, 1, None)])
def test_the_zone_of_a_nexstar_is_signed_and_at_most_fifteen_hours(zone, summer, offset) -> None:
    reply = bytes([12, 0, 0, 6, 15, 26, zone, summer]) + b"#"
    if offset is None:
        with pytest.raises(ProtocolError):
            nexstar.parse_time(reply)
    else:
        assert nexstar.parse_time(reply)[1] == offset
    with pytest.raises(ProtocolError, match="no time"):
        nexstar.parse_time(bytes([12, 0, 0, 13, 15, 26, 0, 0]) + b"#")


@pytest.mark.parametrize(("minutes", "hours"), [(b"+840", 14.0), (b"-840", -14.0), (b"+841", None), (b"+330", 5.5)])
def test_the_zone_of_an_ioptron_is_at_most_fourteen_hours(minutes, hours) -> None:
    reply = minutes + b"0" + b"0827280000000#"
    if hours is None:
        with pytest.raises(ProtocolError):
            ioptron.parse_time(reply)
    else:
        assert ioptron.parse_time(reply)[1] == hours
    assert ioptron.parse_time(b"+0000" + b"9999999999999#")[0].year == 2316


@pytest.mark.parametrize(
    ("digits", "running", "goto", "backwards", "fast", "blocked", "ready"),
    [
        ("000", False, True, False, False, False, False),
        ("111", True, False, False, False, False, True),
        ("611", True, True, True, True, False, True),
        ("321", False, False, True, False, True, True),
    ],
)
def test_the_status_of_a_motor(digits, running, goto, backwards, fast, blocked, ready) -> None:
    status = skywatcher.parse_status(f"={digits}\r".encode())
    assert (status.running, status.goto, status.backwards) == (running, goto, backwards)
    assert (status.fast, status.blocked, status.initialised) == (fast, blocked, ready)


@pytest.mark.parametrize(
    ("goto", "fast", "backwards", "digits"),
    [(True, True, False, "00"), (True, False, True, "21"), (False, True, True, "31"), (False, False, False, "10")],
)
def test_the_mode_of_a_motion(goto, fast, backwards, digits) -> None:
    assert skywatcher.motion_mode(goto, fast, backwards) == digits


@pytest.mark.parametrize(
    ("direction", "plain", "pulse", "ioptron_move"),
    [
        (Direction.NORTH, b":Mn#", b":ZE00500#", b":mn#"),
        (Direction.SOUTH, b":Ms#", b":ZC00500#", b":ms#"),
        (Direction.EAST, b":Me#", b":ZS00500#", b":mw#"),
        (Direction.WEST, b":Mw#", b":ZQ00500#", b":me#"),
    ],
)
def test_each_direction_has_its_bytes(direction, plain, pulse, ioptron_move) -> None:
    assert lx200.move(direction) == plain
    assert lx200.halt(direction) == plain.replace(b"M", b"Q")
    assert ioptron.pulse(direction, 500) == pulse
    assert ioptron.move(direction) == ioptron_move


@pytest.mark.parametrize(("step", "told"), [(0, b":SR1#"), (5, b":SR5#"), (12, b":SR9#")])
def test_the_rate_of_an_ioptron_is_one_to_nine(step, told) -> None:
    assert ioptron.move_rate(step) == told


@pytest.mark.parametrize(("code", "objection"), [(0x00, ""), (0x45, ""), (0x80, "alt-azimuth"), (0x90, "alt-azimuth")])
def test_the_boards_that_are_driven(code, objection) -> None:
    assert objection in altaz_objection(code, equatorial=False)
    assert bool(altaz_objection(code, equatorial=True)) is bool(objection)
    assert "AZ-GTi" in altaz_objection(0xA5, equatorial=False)
    assert "Unknown" in altaz_objection(0x91, equatorial=False)
    assert altaz_objection(0x91, equatorial=True) == altaz_objection(0xA5, equatorial=True) == ""


# -- What a driver does with them ------------------------------------------------------------------


def motors(*script):
    return transcript(SkyWatcher, [*MOTORS_START, *script], site=SITE, clock=noon)


def test_a_turn_above_a_degree_is_fast_and_brakes_in_its_last_tenth() -> None:
    """9024000 steps are a turn: 250667 are ten degrees, 12533 half a degree backwards."""
    done = b"=\r"
    fast = [(b":G200\r", done), (b":H2%s\r" % low(250667), done), (b":M2%s\r" % low(3500), done), (b":J2\r", done)]
    slow = [(b":G221\r", done), (b":H2%s\r" % low(12533), done), (b":M2%s\r" % low(1254), done), (b":J2\r", done)]
    with motors(*fast, *slow) as m:
        m.motors[1].turn_by(10.0, m.talk.stops)
        m.motors[1].turn_by(-0.5, m.talk.stops)
        m.motors[1].turn_by(1e-6, m.talk.stops)  # less than a step: nothing is sent


def low(steps):
    """Six digits of a number, its low byte first."""
    return steps.to_bytes(3, "little").hex().upper().encode()


def test_the_ra_axis_points_where_the_target_will_be_with_the_counterweight_below() -> None:
    with motors() as m:
        for hour in (-170.0, -89.0, -1.0, 1.0, 89.0, 170.0):
            m.target_side = natural_side(hour)
            assert abs(m.aim((m.sidereal() - hour) % 360.0, 20.0, 0.0)[0]) <= 90.0
        east, m.target_side = (m.sidereal() + 45.0) % 360.0, PierSide.WEST
        later = m.aim(east, 20.0, 240.0)[0] - m.aim(east, 20.0, 0.0)[0]
        assert later == pytest.approx(1.00274, abs=1e-4)  # four minutes of the sky
    assert to_axes(-45.0, 20.0, PierSide.WEST, south=False) == pytest.approx((45.0, -70.0))


@pytest.mark.parametrize("driver", ["lx200", "ioptron", "nexstar", "skywatcher"])
def test_an_axis_that_could_not_be_halted_is_told_with_the_next_position(driver) -> None:
    with simulated(driver) as bench:
        mount = bench.open()
        mount.watchdog.failure = NoAnswerError("The axis may still turn.")
        with pytest.raises(NotStoppedError, match="may still turn"):
            mount.position()
        mount.position()  # told once
        mount.close()


def test_a_guard_knows_where_its_mount_points_in_icrs() -> None:
    guard, mount = guarded()
    assert guard.position_icrs() == from_mount_epoch(mount.position(), guard.clock())


def test_ports_with_a_device_are_listed_those_on_usb_first(monkeypatch) -> None:
    def port(device, vid=None, hwid="n/a"):
        usual = {"description": "n/a", "manufacturer": None, "product": None, "pid": 0x23 if vid else None}
        return SimpleNamespace(device=device, vid=vid, hwid=hwid, **usual)

    ports = [
        port("/dev/ttyS0", hwid="PNP0501"),
        port("/dev/ttyS1"),
        port("/dev/ttyS2", hwid=""),
        port("/dev/ttyUSB1", 0x67B),
    ]
    monkeypatch.setattr(serial_ports, "comports", lambda: [*ports, port("/dev/ttyUSB0", 0x403, "")])
    assert [p.port for p in list_ports()] == ["/dev/ttyUSB0", "/dev/ttyUSB1", "/dev/ttyS0"]


@pytest.mark.parametrize(
    ("vendor", "word"),
    [  # as the USB Implementers Forum has given them out
        (0x0403, "FTDI"),
        (0x067B, "Prolific"),
        (0x1A86, "CH340"),
        (0x10C4, "Silicon Labs"),
        (0x2341, "Arduino"),
        (0x16C0, "Teensy"),
        (0x0483, "STMicroelectronics"),
        (0x04D8, "Microchip"),
        (0x1234, ""),
    ],
)
def test_an_adapter_is_known_by_its_vendor(vendor, word) -> None:
    usual = {"device": "COM3", "description": "serial", "manufacturer": None, "product": None, "hwid": "x"}
    info = port_info(SimpleNamespace(vid=vendor, pid=0x1, **usual))
    assert info.usb == f"{vendor:04x}:0001"
    assert info.hint.startswith(word)
    assert bool(info.hint) is bool(word)


def test_an_unconfirmed_home_allows_a_nudge_of_two_degrees() -> None:
    with motors() as m:
        for rate, seconds in ((1.0, 2.1), (3.0, 0.7)):
            with pytest.raises(RefusedError, match="home is not confirmed"):
                m.move(Direction.NORTH, rate, seconds)


@pytest.mark.parametrize(
    ("model", "site", "mode"),
    [(20, nex_site(50, 0, 0, 0, 8, 0, 0, 0), 2), (20, nex_site(33, 0, 0, 1, 151, 0, 0, 0), 3), (11, None, 1)],
    ids=["AVX in the north", "AVX in the south", "a fork"],
)
def test_a_nexstar_that_never_tracked_gets_the_mode_of_its_kind_and_hemisphere(model, site, mode) -> None:
    start = [(b"V", b"\x04\x15#"), (b"m", bytes([model]) + b"#"), (b"t", b"\x00#")]
    asked = [] if site is None else [(b"w", site)]
    with transcript(NexStar, [*start, *asked, (b"T" + bytes([mode]), b"#")]) as m:
        m.track(TrackingRate.SIDEREAL)


def test_a_motor_board_that_counts_nothing_is_no_mount() -> None:
    with (
        pytest.raises(ProtocolError, match="answers 0 to a"),
        transcript(SkyWatcher, [(b":a1\r", b"=000000\r")], site=SITE),
    ):
        pass


def test_a_mount_in_the_network_is_asked_everything_once() -> None:
    opened = []

    def refuses(port, baud):
        opened.append((port, baud))
        raise PortError("Nobody is there.")

    assert run(probe_port("socket://10.0.0.1:9999", refuses)).advice == "Nobody is there."
    assert opened == [("socket://10.0.0.1:9999", 9600)]


@pytest.mark.parametrize(
    ("reply", "answer", "passed"), [(b"#", 0, b""), (b"\x05#", 1, b"\x05"), (b"\x00#", 1, b"\x00"), (b"ab#", 2, b"ab")]
)
def test_what_a_motor_board_answers_comes_through_the_hand_control(reply, answer, passed) -> None:
    assert nexstar.parse_passed(reply, answer) == passed


@pytest.mark.parametrize(
    ("reply", "answer", "sentence"),
    [
        (b"\x00#", 0, "could not reach"),
        (b"\x05\x00#", 1, "could not reach"),
        (b"\x05#", 0, "motor board"),
        (b"\x05\x01#", 1, "motor board"),
        (b"\x05", 1, "motor board"),
        (b"#", 1, "motor board"),
    ],
)
def test_a_motor_board_that_is_not_reached_is_told_from_nonsense(reply, answer, sentence) -> None:
    with pytest.raises(ProtocolError, match=sentence) as caught:
        nexstar.parse_passed(reply, answer)
    assert ("could not reach" in str(caught.value)) is (sentence == "could not reach")
