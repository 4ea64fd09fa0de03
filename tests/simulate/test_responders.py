"""What every simulated controller answers, byte for byte, and that nothing on the line upsets it."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kochab.core.mount import SIDEREAL_DEG_S, Direction, PierSide
from kochab.simulate.responders import RESPONDERS, open_responder
from kochab.simulate.responders.nexstar import NexStarResponder
from tests.simulate.autostar import AutostarResponder
from tests.simulate.bench_telescope import BenchTelescope

NOON = 1_767_268_800.0  # 2026-01-01 12:00 UTC
VARIANTS = [*RESPONDERS, "autostar"]


class Clock:
    """A clock that stands until it is told to go on."""

    def __init__(self):
        self.t = NOON

    def __call__(self):
        return self.t


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def telescope(clock):
    made = BenchTelescope(latitude_deg=50.5, longitude_deg=-8.25, slew_deg_s=3.0, now=clock)
    made.lowest_deg = -90.0
    made.sync(82.5, -12.25)  # 5.5 h
    made.log.clear()
    return made


def make(name, telescope):
    return AutostarResponder(telescope) if name == "autostar" else open_responder(name, telescope)


ARRIVE = b"wait until it is there"


def talk(responder, *exchanges):
    """Every command gives exactly the answer beside it."""
    for command, answer in exchanges:
        if command == ARRIVE:
            responder.telescope.now_unix.t += 100.0
            continue
        assert responder.feed(command) == answer, command


def test_the_classic_is_imprecise_until_toggled_and_its_bars_have_33_bytes(telescope):
    talk(
        make("lx200", telescope),
        (b"\x06", b"P"),
        (b":GR#", b"05:30.0#"),
        (b":GD#", b"-12\xdf15#"),
        (b":U#", b""),
        (b":GR#", b"05:30:00#"),
        (b":GD#", b"-12\xdf15:00#"),
        (b":U#", b""),
        (b":GR#", b"05:30.0#"),
        (b":Sr05:40:30#", b"1"),
        (b":Sd-10*30:15#", b"1"),
        (b":D#", b" " * 32 + b"#"),
        (b":MS#", b"0"),
        (b":D#", b"\x7f" * 32 + b"#"),
        (b":Q#", b""),
        (b":D#", b" " * 32 + b"#"),
        (b":GVP#", b""),
        (b":Mgn0500#", b""),
    )
    [goto, stop] = telescope.log
    assert goto == ("goto", pytest.approx(85.125), pytest.approx(-10.504166667))
    assert stop == ("stop",)


def test_set_commands_answer_without_hash_and_refuse_what_is_no_angle(telescope):
    talk(
        make("lx200", telescope),
        (b":Sr 05:40:30#", b"1"),
        (b":Sd +10*30:15#", b"1"),
        (b":Sr05:40.5#", b"1"),
        (b":Sd-10\xdf30#", b"1"),
        (b":Sd+10:30:15#", b"1"),
        (b":Sd+10*30'15#", b"1"),
        (b":Sr25:00:00#", b"0"),
        (b":Sr05:60:00#", b"0"),
        (b":Sd+91*00:00#", b"0"),
        (b":Sd#", b"0"),
        (b":SrM42#", b"0"),
        (b":Sr-5:00:00#", b"0"),
    )


def test_a_sync_of_the_classic_says_the_same_words_when_it_does_not(telescope):
    lx200 = make("lx200", telescope)
    words = b"Coordinates     matched.        #"
    talk(lx200, (b":U#", b""), (b":Sr06:00:00#", b"1"), (b":Sd-05*00:00#", b"1"), (b":CM#", words))
    talk(lx200, (b":GR#", b"06:00:00#"), (b":GD#", b"-05\xdf00:00#"))
    lx200.refusal = lambda: "limits"
    talk(lx200, (b":Sr07:00:00#", b"1"), (b":CM#", words), (b":GR#", b"06:00:00#"))


def test_a_meade_says_why_it_does_not_slew(telescope):
    telescope.lowest_deg = 90.0
    lx200 = make("lx200", telescope)
    talk(lx200, (b":MS#", b"1Object below horizon.#"))
    telescope.parked = True
    talk(lx200, (ARRIVE, b""), (b":MS#", b"2Parked.#"))


def test_site_and_time_in_meades_way_count_westward(telescope):
    talk(
        make("autostar", telescope),
        (b":Gt#", b"+50\xdf30#"),
        (b":Gg#", b"008\xdf15#"),
        (b":GG#", b"+00#"),
        (b":GL#", b"12:00:00#"),
        (b":GC#", b"01/01/26#"),
        (b":Gc#", b"24#"),
        (b":SG-02#", b"1"),
        (b":GG#", b"-02#"),
        (b":GL#", b"14:00:00#"),
        (b":SL15:30:20#", b"1"),
        (b":GL#", b"15:30:20#"),
        (b":SL25:00:00#", b"0"),
        (b":SC02/30/26#", b"0"),
        (b":SC02/28/26#", b"1Updating Planetary Data#" + b" " * 30 + b"#"),
        (b":GC#", b"02/28/26#"),
        (b":Sg351*30#", b"1"),
        (b":Gg#", b"351\xdf30#"),
        (b":St-33*15#", b"1"),
        (b":Gt#", b"-33\xdf15#"),
    )


def test_an_autostar_is_precise_short_and_takes_pulses(telescope):
    talk(
        make("autostar", telescope),
        (b":GVP#", b"Autostar#"),
        (b":GR#", b"05:30:00#"),
        (b":D#", b"#"),
        (b":GW#", b"PT2#"),
        (b":Mgw0250#", b""),
        (b":RC#", b""),
        (b":Mn#", b""),
        (b":Qn#", b""),
        (b":hP#", b""),
        (ARRIVE, b""),
        (b":MS#", b"2Parked.#"),
    )
    assert telescope.log[:3] == [
        ("pulse", Direction.WEST, 250.0),
        ("move", Direction.NORTH, 32 * SIDEREAL_DEG_S),
        ("halt", Direction.NORTH),
    ]


def test_onstep_answers_in_digits_and_flags(telescope):
    telescope.pier_side = PierSide.EAST
    onstep = make("onstep", telescope)
    talk(
        onstep,
        (b":GVP#", b"On-Step#"),
        (b":GU#", b"NpET120#"),
        (b":GR#", b"05:30:00#"),
        (b":GD#", b"-12*15:00#"),
        (b":GRH#", b"05:30:00.0000#"),
        (b":GDH#", b"-12*15:00.000#"),
        (b":CM#", b"N/A#"),
        (b":GR#", b"00:00:00#"),
        (b":ZZ#", b"0"),
        (b":Sr02:00:00#", b"1"),
        (b":MS#", b"0"),
        (b":GU#", b"pET120#"),
        (b":MS#", b"5"),
        (b":Q#", b""),
        (b":Td#", b"1"),
        (b":GU#", b"nNpET120#"),
        (b":TK#:Te#", b"1"),
        (b":GT#", b"60.14760#"),
        (b":hP#", b"1"),
        (b":GU#", b"nIEkT120#"),
        (ARRIVE, b""),
        (b":GU#", b"nNPEHkT120#"),
        (b":MS#", b"4"),
        (b":Te#", b"0"),
        (b":hR#", b"1"),
        (b":TQ#:Td#", b"1"),
        (b":GU#", b"nNpEHT120#"),
    )
    onstep.refusal = lambda: "limits"
    talk(onstep, (b":MS#", b"6"), (b":CM#", b"E6#"))


def test_nexstar_speaks_hex_and_binary(telescope):
    talk(
        make("nexstar", telescope),
        (b"Kx", b"x#"),
        (b"K#", b"##"),
        (b"V", b"\x04\x15#"),
        (b"m", b"\x14#"),
        (b"e", b"3AAAAB00,F749F500#"),
        (b"E", b"3AAB,F74A#"),
        (b"J", b"\x01#"),
        (b"L", b"0#"),
        (b"t", b"\x02#"),
        (b"p", b"E#"),
        (b"s3AAAAAAA,F749F49F", b"#"),
        (b"r35B00000,12CE0500", b"#"),
        (b"L", b"1#"),
        (b"M", b"#"),
        (b"L", b"0#"),
        (b"T\x00", b"#"),
        (b"t", b"\x00#"),
        (b"T\x09", b""),
        (b"w", b"\x32\x1e\x00\x00\x08\x0f\x00\x01#"),
        (b"h", b"\x0c\x00\x00\x01\x01\x1a\x00\x00#"),
        (bytes([0x50, 1, 16, 0xFE, 0, 0, 0, 2]), b"\x04\x15#"),
        (bytes([0x50, 1, 0xB0, 0xFE, 0, 0, 0, 2]), b"\x00\x00\x00#"),
        (bytes([0x50, 2, 17, 37, 9, 0, 0, 0]), b"#"),
        (bytes([0x50, 2, 17, 36, 0, 0, 0, 0]), b"#"),
        (bytes([0x50, 3, 16, 6, 0x0E, 0x10, 0, 0]), b"#"),
        (bytes([0x50, 3, 16, 0x26, 0xCE, 20, 0, 0]), b"#"),
    )
    assert telescope.log[0][:1] == ("sync",)
    assert telescope.log[0][1:] == pytest.approx((82.5, -12.25), abs=1e-6)
    assert telescope.log[3:] == [
        ("move", Direction.SOUTH, 4.0),
        ("halt", Direction.NORTH),
        ("halt", Direction.SOUTH),
        ("move", Direction.WEST, 0.25),
        ("pulse", Direction.EAST, 200.0),
    ]


def test_an_unaligned_nexstar_says_hash_and_stays_and_an_old_one_knows_no_sync(telescope):
    telescope.aligned = False
    nexstar = make("nexstar", telescope)
    talk(nexstar, (b"J", b"\x00#"), (b"r35B00000,12CE0500", b"#"), (b"L", b"0#"))
    assert telescope.log == []
    telescope.aligned = True
    nexstar.version = (4, 3)
    talk(nexstar, (b"s3AAAAAAA,F749F49F", b""), (b"V", b"\x04\x03#"))


def test_synscan_is_in_j2000_and_takes_no_sync_from_afar(telescope):
    synscan = make("synscan", telescope)
    talk(synscan, (b"V", b"042705#"), (b"m", b"\x00#"))
    there = synscan.to_date(82.5, -12.25)
    assert math.hypot(there[0] - 82.5, there[1] + 12.25) == pytest.approx(0.307, abs=0.01)
    talk(synscan, (b"s3AAAAA00,F749F500", b"#"), (b"e", b"3AAAAA00,F749F500#"))
    assert telescope.believed_deg() == pytest.approx(there, abs=2e-5)
    before = len(telescope.log)
    talk(synscan, (b"s3AAAAA00,00000000", b"#"), (b"e", b"3AAAAA00,F749F500#"))
    assert len(telescope.log) == before


def test_synscan_stops_at_the_second_m(telescope):
    synscan = make("synscan", telescope)
    talk(synscan, (b"r3AAAAA00,20000000", b"#"), (b"L", b"1#"), (b"M", b"#"), (b"L", b"1#"))
    talk(synscan, (b"M", b"#"), (b"L", b"0#"))


def test_ioptron_has_two_lengths_of_answer(telescope):
    talk(
        make("ioptron", telescope),
        (b":MountInfo#", b"0040"),
        (b":GEP#", b"-0441000002970000011#"),
        (b":GLS#", b"-0297000050580000010511#"),
        (b":SRA025920000#", b"1"),
        (b":Sds#", b""),
        (b":Sd+03600000#", b"1"),
        (b":MS1#", b"1"),
        (b":GLS#", b"-0297000050580000020511#"),
        (b":CM#", b"1"),
        (b":Q#", b"1"),
        (b":SR7#", b"1"),
        (b":mw#", b""),
        (b":qR#", b"1"),
        (b":mn#", b""),
        (b":qD#", b"1"),
        (b":ZS00300#", b""),
        (b":ST0#", b"1"),
        (b":GLS#", b"-0297000050580000000711#"),
        (b":MP1#", b"1"),
        (b":GLS#", b"-0297000050580000020711#"),
        (ARRIVE, b""),
        (b":GLS#", b"-0297000050580000060711#"),
        (b":MS1#", b"0"),
        (b":MP0#", b"1"),
        (b":RT2#", b"1"),
        (b":ST1#", b"1"),
        (b":GLS#", b"-0297000050580000012711#"),
        (b":MH#", b"1"),
        (ARRIVE, b""),
        (b":GLS#", b"-0297000050580000072711#"),
        (b":SRA129600001#", b"0"),
        (b":nonsense#", b""),
    )
    rate = 256 * SIDEREAL_DEG_S
    assert [entry for entry in telescope.log if entry[0] in ("sync", "move", "pulse")] == [
        ("move", Direction.EAST, rate),
        ("move", Direction.NORTH, rate),
        ("pulse", Direction.EAST, 300.0),
    ]


def test_a_motor_board_counts_steps_and_refuses_by_code(clock):
    telescope = BenchTelescope(latitude_deg=50.5, slew_deg_s=3.0, now=clock)
    telescope.tracking = False
    board = make("skywatcher", telescope)
    talk(
        board,
        (b":e1\r", b"=020300\r"),
        (b":a1\r", b"=00B289\r"),
        (b":b2\r", b"=A7FD00\r"),
        (b":g1\r", b"=10\r"),
        (b":j1\r", b"=000080\r"),
        (b":j2\r", b"=000080\r"),
        (b":f1\r", b"=100\r"),
        (b":J1\r", b"!4\r"),
        (b":F1\r", b"=\r"),
        (b":f1\r", b"=101\r"),
        (b":X1\r", b"!0\r"),
        (b":H1123\r", b"!1\r"),
        (b":H1ZZZZZZ\r", b"!3\r"),
        (b":j9\r", b"!3\r"),
        (b":G100\r", b"=\r"),
        (b":H100B289\r", b"=\r"),
        (b":J1\r", b"=\r"),
        (b":f1\r", b"=411\r"),
        (b":G110\r", b"!2\r"),
        (b":K1\r", b"=\r"),
        (b":f1\r", b"=401\r"),
        (b":G110\r", b"=\r"),
        (b":I16C0200\r", b"=\r"),
        (b":J1\r", b"=\r"),
        (b":f1\r", b"=111\r"),
    )
    clock.t += 100.0
    counted = int.from_bytes(bytes.fromhex(board.feed(b":j1\r")[1:7].decode()), "little") - 0x800000
    assert counted == pytest.approx(100 * 64935 / 620, abs=2)
    assert counted / 9024000 * 360.0 == pytest.approx(100 * SIDEREAL_DEG_S, rel=2e-3)
    board.feed(b":L1\r:F2\r")
    board.refusal = lambda: "limits"
    talk(board, (b":J2\r", b"!5\r"))


@pytest.mark.parametrize("latitude", [50.0, -33.0])
def test_a_motor_board_stands_at_home_when_switched_on_in_both_hemispheres(latitude, clock):
    """Forward on the first motor follows the sky in the north and runs against it in the south."""
    telescope = BenchTelescope(latitude_deg=latitude, now=clock)
    assert telescope.axes_deg() == (90.0, 90.0 if latitude > 0 else -90.0)
    board = make("skywatcher", telescope)
    board.feed(b":F3\r:G100\r:H1903E26\r:J1\r:G200\r:H2903E26\r:J2\r")  # a hundred degrees each
    hour, dec = telescope.axes_deg()
    way = 0x263E90 / 9024000 * 360.0
    assert hour == pytest.approx(90.0 + (way if latitude > 0 else -way), abs=1e-6)
    assert dec == pytest.approx((90.0 if latitude > 0 else -90.0) - way, abs=1e-6)
    talk(board, (b":f1\r", b"=401\r"), (b":j2\r", b"=903EA6\r"))


QUERIES = {
    "lx200": b":GR#:U#:GD#\x06:Gt#:Sr12:00:00#:Sd+45*00:00#:CM#:GR#:D#",
    "autostar": b":GR#:GD#:GVP#:GW#:Sr12:00:00#:Sd+45*00:00#:CM#:MS#:D#:Q#",
    "onstep": b":GU#:GR#:GD#:XX#:Sr12:00:00#:Sd+45*00:00#:CM#:MS#:GU#:Q#",
    "nexstar": b"KxVmeEJLtpwh" + b"s3AAAAAAA,F749F49F" + b"P\x01\x10\xfe\x00\x00\x00\x02" + b"eK#M",
    "synscan": b"KxVmeEJLtpwh" + b"s3AAAAAAA,F749F49F" + b"P\x01\x10\xfe\x00\x00\x00\x02" + b"eK#M",
    "ioptron": b":MountInfo#:GLS#:GEP#:SRA025920000#:Sd+03600000#:CM#:GEP#:GUT#:GAC#:Q#",
    "skywatcher": b":e1\r:F1\r:G100\r:H1000010\r:J1\r:f1\r:j1\r:K1\r:X1\r:F3\r:E2000090\r:j2\r",
}


@pytest.mark.parametrize("name", VARIANTS)
@settings(max_examples=30)
@given(data=st.data())
def test_split_anywhere_the_answers_are_those_to_the_whole(name, data):
    cuts = data.draw(st.lists(st.integers(0, len(QUERIES[name])), max_size=12).map(sorted))
    clock = Clock()
    whole = make(name, BenchTelescope(now=clock)).feed(QUERIES[name])
    parted = make(name, BenchTelescope(now=clock))
    pieces = [QUERIES[name][a:b] for a, b in zip([0, *cuts], [*cuts, None], strict=True)]
    assert b"".join(parted.feed(piece) for piece in pieces) == whole
    assert whole


@pytest.mark.parametrize("name", VARIANTS)
def test_byte_by_byte_the_answers_are_those_to_the_whole(name):
    clock = Clock()
    whole = make(name, BenchTelescope(now=clock)).feed(QUERIES[name])
    parted = make(name, BenchTelescope(now=clock))
    assert b"".join(parted.feed(bytes([c])) for c in QUERIES[name]) == whole


@pytest.mark.parametrize("name", VARIANTS)
@settings(max_examples=150)
@given(data=st.data())
def test_no_bytes_upset_it_and_it_answers_again_after_a_pause(name, data):
    words = st.sampled_from([QUERIES[name][k : k + 9] for k in range(0, len(QUERIES[name]), 3)])
    letters = st.sampled_from([b":S", b":M", b":R", b":SC99/99/99#", b"#", b"\r", b":G1FF\r", b"P"])
    garbage = data.draw(st.lists(st.binary(max_size=40) | words | letters, max_size=12))
    responder = make(name, BenchTelescope(now=Clock()))
    for piece in garbage:
        assert isinstance(responder.feed(piece), bytes)
    responder.idle()
    first = {"nexstar": b"Kx", "synscan": b"Kx", "ioptron": b":MountInfo#", "skywatcher": b":e1\r"}
    answers = {b"Kx": b"x#", b":MountInfo#": b"0040", b":e1\r": b"=020300\r"}
    query = first.get(name, b":GR#")
    reply = responder.feed(query)
    assert reply == answers.get(query, reply)
    assert reply


def test_half_a_command_is_forgotten_in_a_pause(telescope):
    nexstar = NexStarResponder(telescope)
    talk(nexstar, (b"r3AAA", b""))
    nexstar.idle()
    talk(nexstar, (b"Kx", b"x#"))
