"""Parsers take any bytes: a value or `ProtocolError`, and nothing else; what is written is read."""

from contextlib import suppress
from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kochab.core.mount import Direction, PierSide
from kochab.gear.mounts.protocols import ioptron, lx200, nexstar, parse_accepted, skywatcher
from kochab.gear.mounts.serial_line import ProtocolError

PARSERS = {
    "lx200.ra": lx200.parse_ra,
    "lx200.coarse": lx200.parse_coarse,
    "lx200.dec": lx200.parse_dec,
    "accepted": parse_accepted,
    "lx200.alignment": lx200.parse_aligned,
    "lx200.text": lx200.parse_text,
    "lx200.slewing": lx200.parse_slewing,
    "lx200.slew": lx200.parse_slew,
    "lx200.sync": lx200.parse_sync,
    "lx200.flags": lx200.parse_flags,
    "lx200.scope status": lx200.parse_scope_status,
    "nexstar.position": nexstar.parse_position,
    "nexstar.done": nexstar.parse_done,
    "nexstar.echo": partial(nexstar.parse_echo, sent=b"x"),
    "nexstar.byte": nexstar.parse_byte,
    "nexstar.flag": nexstar.parse_flag,
    "nexstar.digit": nexstar.parse_digit,
    "nexstar.version": nexstar.parse_version,
    "nexstar.pier": nexstar.parse_pier,
    "nexstar.passed": nexstar.parse_passed,
    "nexstar.passed with data": partial(nexstar.parse_passed, answer=2),
    "nexstar.site": nexstar.parse_site,
    "nexstar.time": nexstar.parse_time,
    "ioptron.site": ioptron.parse_site,
    "ioptron.time": ioptron.parse_time,
    "lx200.angle": lx200.parse_angle,
    "ioptron.altaz": ioptron.parse_altaz,
    "ioptron.park": ioptron.parse_park_altitude,
    "lx200.longitude": lx200.parse_longitude,
    "lx200.zone": lx200.parse_zone,
    "lx200.time": lx200.parse_time,
    "lx200.date": lx200.parse_date,
    "ioptron.model": ioptron.parse_model,
    "ioptron.position": ioptron.parse_position,
    "ioptron.status": ioptron.parse_status,
    "skywatcher.number": skywatcher.parse_number,
    "skywatcher.data": skywatcher.parse_data,
    "skywatcher.position": skywatcher.parse_position,
    "skywatcher.status": skywatcher.parse_status,
}
# bytes that look like answers get further into a parser than blind ones
likely = st.text("0123456789ABCDEFabcdef:.,*'#+-=!\r \xdf\x7f", max_size=30).map(lambda text: text.encode("latin-1"))
any_bytes = st.binary(max_size=60) | likely | likely.map(lambda b: b + b"#")
ra = st.floats(0.0, 359.9999)
dec = st.floats(-90.0, 90.0)


@pytest.mark.parametrize("name", PARSERS)
@settings(max_examples=50)
@given(reply=any_bytes)
def test_any_bytes_are_a_value_or_a_protocol_error(name, reply) -> None:
    with suppress(ProtocolError):
        PARSERS[name](reply)


@given(ra=ra, dec=dec)
def test_lx200_writes_what_it_reads(ra, dec) -> None:
    back = lx200.parse_ra(lx200.set_ra(ra)[3:])
    assert abs((back - ra + 180.0) % 360.0 - 180.0) <= 0.5 / 240.0 + 1e-9
    assert abs(lx200.parse_dec(lx200.set_dec(dec)[3:]) - dec) <= 0.5 / 3600.0 + 1e-9


@given(ra=ra, dec=dec)
def test_nexstar_writes_what_it_reads(ra, dec) -> None:
    back_ra, back_dec = nexstar.parse_position(nexstar.goto(ra, dec)[1:] + b"#")
    assert abs((back_ra - ra + 180.0) % 360.0 - 180.0) < 1e-7
    assert abs(back_dec - dec) < 1e-7


@given(ra=ra, dec=dec, side=st.sampled_from([0, 1, 2]))
def test_ioptron_writes_what_it_reads(ra, dec, side) -> None:
    word = ioptron.set_dec(dec)[3:-1] + ioptron.set_ra(ra)[4:-1] + b"%d1#" % side
    place = ioptron.parse_position(word)
    assert abs((place.ra_deg - ra + 180.0) % 360.0 - 180.0) < 2e-6
    assert abs(place.dec_deg - dec) < 2e-6
    assert place.pier_side is (PierSide.EAST, PierSide.WEST, None)[side]


@given(st.integers(0, 0xFFFFFF))
def test_skywatcher_writes_what_it_reads(number) -> None:
    assert skywatcher.parse_number(f"={skywatcher.low_first(number)}\r".encode()) == number


@pytest.mark.parametrize(
    ("reply", "degrees"),
    [(b"05:30.5#", 82.625), (b"05:30:30#", 82.625), (b"05:30:30.50#", 82.6270833), (b"23:59:59#", 359.9958333)],
)
def test_every_form_of_a_right_ascension(reply, degrees) -> None:
    assert lx200.parse_ra(reply) == pytest.approx(degrees, abs=1e-6)


@pytest.mark.parametrize(
    "reply", [b"-12\xdf15#", b"-12*15#", b"-12*15:00#", b"-12\xdf15'00#", b"-12:15:00.0#", b"-12*15'00#"]
)
def test_every_form_of_a_declination(reply) -> None:
    assert lx200.parse_dec(reply) == -12.25


def test_just_south_of_the_equator_keeps_its_sign() -> None:
    assert lx200.parse_dec(b"-00*30:00#") == -0.5
    assert lx200.set_dec(-0.5) == b":Sd-00*30:00#"


def test_the_makers_own_example_of_a_position() -> None:
    ra, dec = nexstar.parse_position(b"34AB0500,12CE0500#")
    assert ra == pytest.approx(74.06, abs=0.01)
    assert dec == pytest.approx(26.45, abs=0.01)


def test_a_tube_past_the_pole_is_on_the_sky() -> None:
    ra, dec = nexstar.parse_position(b"00000000,47AE147B#")  # 100.8 deg up
    assert dec == pytest.approx(79.2, abs=0.01)
    assert ra == 180.0


def test_pulses_keep_to_their_digits() -> None:
    assert ioptron.pulse(Direction.WEST, -5) == b":ZQ00000#"
    assert nexstar.guide(16, -50, 100) == bytes([0x50, 3, 16, 0x26, 206, 100, 0, 0])


def test_the_period_of_an_eq6_at_the_sidereal_rate() -> None:
    assert skywatcher.step_period(360.0 / 86164.0905, 9024000, 64935) == 620
    assert skywatcher.step_period(0.0, 9024000, 64935) == 0xFFFFFF


def test_longitudes_and_zones_of_the_lx200_grow_westward() -> None:
    assert lx200.parse_longitude(b"352*00#") == pytest.approx(8.0)
    assert lx200.parse_longitude(b"100*30#") == pytest.approx(-100.5)
    assert lx200.parse_dec(b"-33*30#") == -33.5
    assert lx200.parse_zone(b"-01#") == 1.0
    assert lx200.parse_zone(b"+05.5#") == -5.5
    assert lx200.parse_zone(b"-05:30#") == 5.5


def test_a_nexstar_in_the_south_with_summer_time() -> None:
    site = nexstar.parse_site(bytes([33, 30, 0, 1, 70, 45, 0, 1]) + b"#")
    assert (site.latitude_deg, site.longitude_deg) == (-33.5, -70.75)
    time, offset = nexstar.parse_time(bytes([21, 5, 9, 12, 31, 26, 252, 1]) + b"#")
    assert offset == -3.0
    assert time.isoformat() == "2027-01-01T00:05:09+00:00"


@pytest.mark.parametrize(
    ("digit", "slewing", "parked", "tracking"),
    [
        (0, False, False, False),  # stopped
        (1, False, False, True),
        (2, True, False, False),
        (3, False, False, True),  # guided
        (4, True, False, False),  # it flips
        (5, False, False, True),  # with its periodic error corrected
        (6, False, True, False),
        (7, False, False, False),  # at home
    ],
)
def test_the_states_of_an_ioptron(digit, slewing, parked, tracking) -> None:
    state = ioptron.parse_status(b"+0288000050400000" + b"0%d1011#" % digit)
    assert (state.slewing, state.parked, state.tracking) == (slewing, parked, tracking)


def test_an_ioptron_in_summer_time() -> None:
    time, offset = ioptron.parse_time(b"+0601" + b"0827280000000#")
    assert offset == 2.0
    assert time.isoformat() == "2026-03-20T12:00:00+00:00"
    assert ioptron.parse_time(b"-3000" + b"0827280000000#")[1] == -5.0
