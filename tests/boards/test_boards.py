"""The boards themselves: their sky against ERFA and astropy, their motion, and what a cut of their power leaves."""

from datetime import UTC, datetime

import pytest
from astropy import units
from astropy.coordinates import TETE, AltAz, EarthLocation, SkyCoord
from astropy.time import Time
from astropy.utils import iers

from tests.boards import BOARDS, SITE, START, Frozen
from tests.boards.mechanics import axes_deg, looks_at_deg
from tests.boards.sky import altaz_deg, apart_deg, sidereal_deg, sun_deg

KNOW_THE_SKY = [kind for kind in BOARDS if kind != "skywatcher"]
STOPS = {kind: "M" if kind == "nexstar" else ":Q#" for kind in KNOW_THE_SKY}
QUESTIONS = {"ioptron": ":GLS#", "nexstar": "e"}  # of the others ":GR#"
NORTH_FAST = {"ioptron": ":SR9#:mn#", "nexstar": "P\2\x11\x24\x09\0\0\0"}
NORTH_END = {"ioptron": ":qD#", "nexstar": "P\2\x11\x24\0\0\0\0"}


def board_of(kind, **settings):
    """A board on a clock that a test turns; nothing is opened."""
    return BOARDS[kind](clock=Frozen(), **settings)


def later(board, seconds):
    """Let time pass in steps, as the line's thread does."""
    for _ in range(round(seconds * 10)):
        board.clock.pass_by(0.1)
        board.advance()


def say(board, text):
    """What the board answers to a text at once."""
    board.receive(text.encode("latin1"))
    return b"".join(board.due())


def goto(board, ra_deg, dec_deg):
    """In the board's own language."""
    if isinstance(board, BOARDS["ioptron"]):
        say(board, f":SRA{round(ra_deg * 360000):09d}#:Sd{round(dec_deg * 360000):+09d}#")
        return say(board, ":MS1#") == b"1"
    if isinstance(board, BOARDS["nexstar"]):
        turns = [round(angle % 360.0 / 360.0 * 2**32) for angle in (ra_deg, dec_deg)]
        return say(board, f"r{turns[0]:08X},{turns[1]:08X}") == b"#"
    say(board, f":Sr{board.hours(ra_deg)}#:Sd{board.sexagesimal(dec_deg, sign=True, marks='*:')}#")
    return say(board, ":MS#") == b"0"


@pytest.fixture(params=KNOW_THE_SKY)
def kind(request):
    return request.param


def test_the_sky_of_the_boards_is_astropys():
    with iers.conf.set_temp("auto_download", False), iers.conf.set_temp("iers_degraded_accuracy", "ignore"):
        time = Time(START)
        time.delta_ut1_utc = 0.0
        place = EarthLocation(lat=50.0 * units.deg, lon=8.0 * units.deg)
        assert time.sidereal_time("apparent", 8.0 * units.deg).deg == pytest.approx(
            sidereal_deg(START.timestamp(), 8.0), abs=0.001
        )
        star = SkyCoord(113.0 * units.deg, 40.0 * units.deg, frame=TETE(obstime=time, location=place))
        high = star.transform_to(AltAz(obstime=time, location=place))
    ours = altaz_deg(sidereal_deg(START.timestamp(), 8.0) - 113.0, 40.0, 50.0)
    assert apart_deg((ours[1], ours[0]), (high.az.deg, high.alt.deg)) < 0.02  # topocentric aberration
    assert sun_deg(START.timestamp()) == pytest.approx((298.0, -21.0), abs=0.6)  # an almanac's page of 15 January


def test_the_two_sides_of_the_pier_look_at_the_same_sky():
    for hour_angle, dec in ((-20.0, 40.0), (75.0, -5.0), (-170.0, 80.0)):
        sides = [axes_deg(hour_angle, dec, beyond) for beyond in (False, True)]
        assert sides[0] != sides[1]
        for axes in sides:
            assert looks_at_deg(*axes) == pytest.approx((hour_angle, dec))


def test_a_goto_accelerates_arrives_and_follows_the_sky(kind):
    board = board_of(kind)
    ra, dec = board.align(-40.0, 40.0)
    assert goto(board, ra + 10.0, dec + 5.0)
    later(board, 0.3)
    assert all(0.0 < abs(axis.rate_deg_s) <= 0.31 * axis.acceleration_deg_s2 for axis in board.tube.axes)
    later(board, 5.0)
    assert not board.moving
    assert apart_deg(board.radec_deg(), (ra + 10.0, dec + 5.0)) < 0.005
    later(board, 600.0)
    assert apart_deg(board.radec_deg(), (ra + 10.0, dec + 5.0)) < 0.005
    assert board.false_by_deg() < 1e-6
    assert not board.false_slews()


def test_a_stop_takes_time_and_a_lost_stop_does_nothing(kind):
    board = board_of(kind)
    ra, dec = board.align(-40.0, 40.0)
    goto(board, ra, dec - 30.0)
    later(board, 1.5)
    board.lose_stops(1)
    say(board, STOPS[kind])
    later(board, 1.0)
    assert board.going == "goto"
    say(board, STOPS[kind])
    assert board.moving  # it runs out
    later(board, 2.0)
    assert not board.moving
    assert 5.0 < dec - board.radec_deg()[1] < 29.0


def test_a_nudge_runs_out_after_its_stop(kind):
    board = board_of(kind)
    board.align(-40.0, 40.0)
    say(board, NORTH_FAST.get(kind, ":R9#:Mn#"))
    later(board, 1.0)
    say(board, NORTH_END.get(kind, ":Qn#"))
    after_stop = board.radec_deg()[1]
    assert after_stop > 40.0  # north, on whichever side of the pier
    later(board, 2.0)
    assert board.radec_deg()[1] > after_stop + 1.0
    assert not board.moving


def test_a_nexstar_s_key_9_is_as_fast_as_celestron_s_mounts_whatever_its_gotos_are():
    board = board_of("nexstar")
    board.align(-40.0, 40.0)
    for axis in board.tube.axes:
        axis.top_deg_s, axis.acceleration_deg_s2 = 12.0, 60.0
    say(board, NORTH_FAST["nexstar"])
    later(board, 1.0)
    before = board.radec_deg()[1]
    later(board, 2.0)
    assert 4.0 < (board.radec_deg()[1] - before) / 2.0 < 4.6


def test_a_cut_of_the_power_leaves_a_false_home(kind):
    board = board_of(kind)
    ra, dec = board.align(-40.0, 40.0)
    goto(board, ra, dec - 30.0)
    later(board, 2.0)
    board.cut_power(off_s=1.0)
    stands = board.tube.hour_angle_dec_deg()
    assert say(board, QUESTIONS.get(kind, ":GR#")) == b""
    later(board, 1.0 + board.boot_s - 0.5)
    assert not board.powered
    later(board, 1.0)
    assert board.tube.hour_angle_dec_deg() == pytest.approx(stands)
    assert board.believed_deg()[1] == pytest.approx(90.0)
    assert board.at_home or kind == "nexstar"  # it has no word for it
    assert board.false_by_deg() > 40.0
    ra, dec = board.radec_deg()
    assert goto(board, ra, dec + 5.0)  # nothing but the host keeps it from this
    assert board.false_slews()
    later(board, 20.0)
    assert apart_deg(board.radec_deg(), (ra, dec + 5.0)) > 20.0


@pytest.mark.parametrize(("kind", "word"), [("onstep", ":hC#"), ("am5", ":hC#"), ("ioptron", ":MH#")])
def test_a_home_that_lost_its_power_on_the_way_claims_to_be_there(kind, word):
    board = board_of(kind)
    board.align(-40.0, 10.0)
    say(board, word)
    later(board, 2.0)
    board.cut_power(off_s=0.5)
    later(board, 0.5 + board.boot_s + 0.1)
    status = say(board, ":GLS#" if kind == "ioptron" else ":GU#")
    assert status[18:19] == b"7" if kind == "ioptron" else b"H" in status
    assert board.false_by_deg() > 10.0


def test_an_onstepx_that_lost_its_power_while_it_parked_says_so_until_it_is_unparked():
    board = board_of("onstepx")
    board.align(-40.0, 10.0)
    assert say(board, ":hP#") == b"1"
    later(board, 2.0)
    board.cut_power()
    later(board, 1.0 + board.boot_s)
    assert say(board, ":GU#").startswith(b"nNIeH")
    assert say(board, ":hP#") == b"0"  # Park::request, PS_PARKING
    assert say(board, ":hR#") == b"0"  # no date
    say(board, ":SC01/15/26#:SL22:00:00#")
    assert say(board, ":hR#") == b"1"
    assert board.false_by_deg() > 10.0


def test_a_parked_ioptron_remembers_where_it_stands():
    board = board_of("ioptron")
    board.align(-40.0, 10.0)
    assert say(board, ":MP1#") == b"1"
    later(board, 60.0)
    assert board.parked
    board.cut_power()
    later(board, 1.0 + board.boot_s)
    assert say(board, ":GLS#")[18:19] == b"6"
    assert board.false_by_deg() < 0.01


@pytest.mark.parametrize(("kind", "year"), [("onstep", "13"), ("am5", "00")])
def test_a_clock_without_a_battery_wakes_at_its_makers_date(kind, year):
    board = board_of(kind)
    board.align(-40.0, 40.0)
    assert say(board, ":GC#") == b"01/15/26#"
    board.cut_power()
    later(board, 1.0 + board.boot_s)
    assert say(board, ":GC#") == f"01/01/{year}#".encode()
    kept = board_of(kind, keeps_clock=True)
    kept.align(-40.0, 40.0)
    kept.cut_power()
    later(kept, 1.0 + kept.boot_s)
    assert say(kept, ":GC#") == b"01/15/26#"
    assert datetime.fromtimestamp(kept.believed_unix(), UTC) == kept.clock()


def test_a_nexstar_without_its_alignment_says_yes_and_stays():
    board = board_of("nexstar", claims_home=False)
    ra, dec = board.align(-40.0, 40.0)
    board.cut_power()
    later(board, 1.0 + board.boot_s)
    assert say(board, "J") == b"\0#"
    assert goto(board, ra, dec - 5.0)
    assert not board.moving
    assert say(board, "h")[:8] == bytes([0, 0, 0, 1, 1, 0, 0, 0])  # 1 January 2000


def test_a_skywatcher_goes_by_steps_and_forgets_them_without_power():
    board = board_of("skywatcher")
    assert say(board, ":j1\r:j2\r:f1\r") == b"=000080\r=000080\r=100\r"
    assert say(board, ":J1\r") == b"!4\r"
    say(board, ":F3\r")
    quarter = board.per_turn // 4
    steps = quarter.to_bytes(3, "little").hex().upper()
    assert say(board, f":G200\r:H2{steps}\r:J2\r") == b"=\r=\r=\r"
    later(board, 1.0)
    assert say(board, ":G200\r") == b"!2\r"
    assert say(board, ":f2\r") == b"=411\r"
    later(board, 30.0)
    assert say(board, ":f2\r") == b"=401\r"
    assert say(board, ":j2\r") == b"=" + (0x800000 + quarter).to_bytes(3, "little").hex().upper().encode() + b"\r"
    hour_angle, dec = board.tube.hour_angle_dec_deg()
    assert dec == pytest.approx(0.0, abs=1e-4)  # EQMod's quarter turn; the west of the meridian is behind it
    assert hour_angle == pytest.approx(90.0)
    period = round(board.frequency * 360.0 / board.per_turn * 86164.0905 / 360.0)
    say(board, f":G110\r:I1{period.to_bytes(3, 'little').hex()}\r:J1\r")
    later(board, 60.0)
    assert not board.moving  # but with the sky
    assert board.tube.hour_angle_dec_deg()[0] == pytest.approx(hour_angle + 0.2507, abs=0.002)
    board.cut_power()
    later(board, 1.0 + board.boot_s)
    assert say(board, ":j2\r:f2\r") == b"=000080\r=100\r"
    assert board.tube.hour_angle_dec_deg()[1] == pytest.approx(0.0, abs=1e-4)


def test_an_am5_that_insists_on_its_clock_refuses_until_it_is_set():
    board = board_of("am5", insists_on_clock=True)
    ra, dec = board.align(-40.0, 40.0)
    board.cut_power()
    later(board, 1.0 + board.boot_s)
    say(board, f":Sr{board.hours(ra)}#:Sd+40*00:00#")
    assert say(board, ":MS#") == b"e7#"
    say(board, ":SC01/15/26#:SL22:00:00#")
    assert say(board, ":MS#") == b"0"
    assert say(board, ":GRR#") == b"1#"
    assert dec == 40.0


def test_lost_and_late_answers_are_of_the_answers_alone(kind):
    board = board_of(kind)
    ra, dec = board.align(-40.0, 40.0)
    question = QUESTIONS.get(kind, ":GR#")
    board.lose_answers(2)
    assert [bool(say(board, question)) for _ in range(3)] == [False, False, True]
    board.lose_answers(to=b"r" if kind == "nexstar" else b":MS")
    assert not goto(board, ra, dec - 5.0)  # the answer is lost
    assert board.going == "goto"  # not the order
    board.delay_answers(1, seconds=1.0)
    assert say(board, question) == b""
    later(board, 1.1)
    assert board.due()


def test_the_record_tells_the_lowest_altitude_and_the_sun():
    board = board_of("am5", slew_deg_s=20.0)
    ra, dec = board.align(-40.0, 40.0)
    board.site_deg = (50.0, 150.0)  # it believes the place high above the horizon
    board.sync()
    begun = board.clock.unix()
    board.target_deg = [ra, dec]
    board.goto()
    later(board, 30.0)
    assert board.lowest_deg(begun) == min(s.altitude_deg for s in board.tube.path if s.unix >= begun)
    assert board.nearest_sun_deg() == 180.0  # it is night
    day = board_of("am5")
    day.clock.at = datetime(2026, 6, 15, 11, 30, tzinfo=UTC)
    sun = sun_deg(day.clock.unix())
    day.align(sidereal_deg(day.clock.unix(), SITE.longitude_deg) - sun[0] - 3.0, sun[1])
    assert day.nearest_sun_deg() == pytest.approx(3.0 * 0.92, abs=0.1)


def test_a_port_stays_open_while_the_board_has_no_power():
    from kochab.core.errors import NoAnswerError
    from kochab.gear.mounts import open_mount
    from tests.boards import served, virtual_time

    with virtual_time() as time, served("ioptron", time=time) as board:
        board.align(-40.0, 40.0)
        mount = open_mount(board.driver, board.port, site=board.site, clock=board.clock)
        board.cut_power(off_s=600.0)
        with pytest.raises(NoAnswerError):
            mount.position()
        mount.close()
