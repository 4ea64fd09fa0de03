"""The boards that only INDI's drivers drive: their words, their motion, and what a cut of their power leaves."""

import struct
from datetime import UTC, datetime

import pytest

from tests.boards import BEHIND_INDI, Exos2, Frozen, StarBook, StarGo
from tests.boards.exos2 import ASK_SITE, CLOCK, GOTO, NORTH, PARK, STOP, SYNC, frame
from tests.boards.sky import apart_deg
from tests.boards.test_boards import later, say

ROUNDED_DEG = 2.0 / 60.0  # of the coarsest


def board_of(kind, **settings):
    """A board on a clock that a test turns."""
    return BEHIND_INDI[kind](clock=Frozen(), **settings)


def http(board, path):
    """What the page holds."""
    page = say(board, f"GET /{path} HTTP/1.1\r\nHost: 169.254.0.1\r\n\r\n").decode()
    return page.partition("<!--")[2].partition("-->")[0]


def starbook_place(ra_deg, dec_deg):
    minutes = abs(dec_deg) * 60.0
    sign = "-" if dec_deg < 0.0 else ""
    dec = f"{sign}{minutes // 60:03.0f}+{minutes % 60:02.0f}"
    return f"RA={ra_deg // 15.0:02.0f}+{ra_deg % 15.0 * 4.0:04.1f}&DEC={dec}"


def exos(board, command, first=0.0, second=0.0):
    return say(board, frame(command, first, second).decode("latin1"))


def goto(board, ra_deg, dec_deg):
    """In the board's own language; whether it says that it goes."""
    if isinstance(board, StarBook):
        return http(board, f"GOTORADEC?{starbook_place(ra_deg, dec_deg)}") == "OK"
    if isinstance(board, Exos2):
        exos(board, GOTO, ra_deg / 15.0, dec_deg)
        return True
    say(board, f":Sr{board.hours(ra_deg)}#:Sd{board.sexagesimal(dec_deg, sign=True, marks='*:')}#")
    return say(board, ":MS#") == b"0"


def stop(board):
    if isinstance(board, StarBook):
        return http(board, "STOP")
    return exos(board, STOP) if isinstance(board, Exos2) else say(board, ":Q#")


@pytest.fixture(params=BEHIND_INDI)
def kind(request):
    return request.param


def test_a_goto_arrives_and_follows_the_sky(kind):
    board = board_of(kind)
    ra, dec = board.align(-40.0, 40.0)
    assert goto(board, ra + 10.0, dec + 5.0)
    later(board, 0.3)
    assert board.moving
    later(board, 6.0)
    assert not board.moving
    assert apart_deg(board.radec_deg(), (ra + 10.0, dec + 5.0)) < ROUNDED_DEG
    there = board.radec_deg()
    later(board, 600.0)
    assert apart_deg(board.radec_deg(), there) < 0.001
    assert not board.false_slews()


def test_a_stop_takes_time_and_a_lost_stop_does_nothing(kind):
    board = board_of(kind)
    ra, dec = board.align(-40.0, 40.0)
    goto(board, ra, dec - 30.0)
    later(board, 1.5)
    board.lose_stops(1)
    stop(board)
    later(board, 1.0)
    assert board.going == "goto"
    stop(board)
    assert board.moving  # it runs out
    later(board, 2.0)
    assert not board.moving
    assert 5.0 < dec - board.radec_deg()[1] < 29.0
    assert board.tracking is (kind != "exos2")  # whose Stop ends that as well


def test_a_cut_of_the_power_leaves_a_false_place_and_silence(kind):
    board = board_of(kind)
    ra, dec = board.align(-40.0, 40.0)
    goto(board, ra, dec - 30.0)
    later(board, 2.0)
    stands = board.tube.hour_angle_dec_deg()
    board.cut_power(off_s=1.0)
    assert not goto(board, ra, dec) or kind == "exos2"  # which never says anything
    later(board, 1.0 + board.boot_s + 0.5)
    assert board.powered
    assert board.due() == []
    assert board.tube.hour_angle_dec_deg() == pytest.approx(stands)
    assert board.false_by_deg() > 40.0


def test_a_clock_that_runs_faster_brings_the_end_of_a_slew_sooner():
    """So that an evening of tests takes minutes."""
    board = StarGo(speed=50.0)
    ra, dec = board.align(-40.0, 40.0)
    goto(board, ra, dec + 30.0)
    begun = datetime.now(UTC)
    while board.moving:
        pass
    assert board.orders[0].unix < board.clock.unix() - 5.0  # the motors' seconds
    assert (datetime.now(UTC) - begun).total_seconds() < (board.clock.unix() - board.orders[0].unix) / 10.0


def test_a_starbook_tells_minutes_and_takes_them():
    board = board_of("starbook")
    ra, dec = board.align(-40.0, -5.5)
    told = dict(part.split("=") for part in http(board, "GETSTATUS").split("&"))
    assert told["DEC"] == "-005+30"
    hours, minutes = told["RA"].split("+")
    assert 0.0 <= ra / 15.0 - int(hours) - float(minutes) / 60.0 < 0.1 / 60.0
    assert (told["GOTO"], told["STATE"]) == ("0", "SCOPE")
    assert http(board, "VERSION") == "version=2.7B26"
    assert http(board, f"ALIGN?{starbook_place(ra, dec + 2.0)}") == "OK"
    assert board.believed_deg()[1] == pytest.approx(dec + 2.0, abs=ROUNDED_DEG)
    assert http(board, f"GOTORADEC?{starbook_place(ra, -60.0)}") == "ERROR:BELOW HORIZONE"
    assert http(board, "GOTORADEC?RA=x") == "ERROR:FORMAT"
    assert http(board, "HOME") == "ERROR:FORMAT"  # as of firmware 2.7
    assert http(board, "GOHOME?HOME=0") == "OK"
    later(board, 40.0)
    assert board.believed_hour_angle_dec_deg() == pytest.approx((90.0, 0.0))  # the west, where it begins


def test_a_starbook_without_its_alignment_goes_nowhere_until_it_is_started():
    board = board_of("starbook")
    ra, dec = board.align(-40.0, 40.0)
    board.cut_power()
    later(board, 1.0 + board.boot_s)
    assert http(board, "GETSTATUS").endswith("STATE=INIT")
    assert not goto(board, ra, dec)
    assert http(board, f"ALIGN?{starbook_place(ra, dec)}") == "ERROR:ILLEGAL STATE"
    assert http(board, "SETTIME?TIME=2026+01+15+23+00+00") == "OK"
    assert http(board, "SETPLACE?longitude=E008+00&latitude=N50+00&timezone=1") == "OK"
    assert board.site_deg == (50.0, 8.0)
    assert http(board, "SETPLACE?longitude=E08+00latitude=N50+00&timezone=1") == "ERROR:FORMAT"  # INDI's slip
    assert http(board, "START") == "OK"
    assert http(board, "SETTIME?TIME=2026+01+15+23+00+00") == "ERROR:ILLEGAL STATE"
    assert board.believed_hour_angle_dec_deg() == pytest.approx((90.0, 0.0))
    assert goto(board, ra, dec)
    assert board.false_slews()


def test_a_stargo_tells_its_motors_by_itself_and_its_places_to_a_hundredth_of_an_arcsecond():
    board = board_of("stargo")
    ra, dec = board.align(-40.0, -0.5)
    assert say(board, ":X590#") == f"RD{round(ra / 15.0 * 1e6):08d}-0050000#".encode()
    assert say(board, ":X34#:X38#:X39#") == b"m10#p0#PE#"
    later(board, 0.2)
    assert goto(board, ra, dec + 10.0)
    later(board, 0.2)
    assert say(board, ":X34#") == b":Z1333#m15#"
    later(board, 5.0)
    assert say(board, ":X34#") == b"ge#:Z1233#m10#"
    assert say(board, ":X362#") == b"pB#"
    later(board, 40.0)
    assert b"p2#" in say(board, ":X38#")
    assert board.parked
    assert not goto(board, ra, dec)
    assert say(board, ":X370#").endswith(b"p0#")


def test_a_stargo_has_no_clock_and_forgets_its_sidereal_time():
    board = board_of("stargo", claims_home=False)
    ra, _ = board.align(-40.0, 40.0)
    hours = board.hours(board.sidereal_deg())
    board.cut_power()
    later(board, 1.0 + board.boot_s)
    assert say(board, ":GS#:X39#").startswith(b"00:00:0")
    assert say(board, ":X39#").endswith(b"PX#")
    assert say(board, f":X32{hours.replace(':', '')}#") == b""
    assert apart_deg((board.sidereal_deg(), 0.0), (ra - 40.0, 0.0)) < 0.1


def test_an_exos2_reports_once_a_second_after_the_first_question_and_never_how_it_moves():
    board = board_of("exos2")
    ra, dec = board.align(-40.0, 40.0)
    later(board, 3.0)
    assert board.due() == []
    told = exos(board, ASK_SITE)
    assert struct.unpack("<ff", told[5:13]) == (50.0, 8.0)
    later(board, 2.5)
    reports = board.due()
    assert [(len(one), one[4]) for one in reports] == [(13, 0xFF)] * 3
    hours, degrees = struct.unpack("<ff", reports[-1][5:])
    assert apart_deg((15.0 * hours, degrees), (ra, dec)) < 1.0 / 3600.0
    assert len({one[5:] for one in reports}) == 3  # it follows by whole counts, so no two are alike
    exos(board, 0x77)
    board.due()
    later(board, 3.0)
    assert board.due() == []  # what it does not know silences it


def test_an_exos2_syncs_and_steps_only_while_it_tracks_and_parks_at_its_home():
    board = board_of("exos2", needs_keys=True)
    ra, dec = board.align(-40.0, 40.0)
    exos(board, SYNC, ra / 15.0, dec + 2.0)
    assert board.false_by_deg() < 0.001  # no key of the hand control was used
    board.nudge_by_hand(0, 0.1)
    board.nudge_by_hand(0, 0.0)
    exos(board, SYNC, ra / 15.0, dec + 2.0)
    assert board.false_by_deg() == pytest.approx(2.0, abs=0.01)
    for _ in range(5):
        exos(board, NORTH)
        later(board, 0.1)
    later(board, 1.0)
    assert 0.05 < board.radec_deg()[1] - dec < 0.3
    exos(board, STOP)
    before = board.radec_deg()[1]
    exos(board, NORTH)
    later(board, 1.0)
    assert board.radec_deg()[1] == before
    say(board, (b"\x55\xaa\x01\x09" + bytes([CLOCK, 20, 26, 2, 3, 4, 5, 6, 0])).decode("latin1"))
    assert datetime.fromtimestamp(board.believed_unix(), UTC) == datetime(2026, 2, 3, 4, 5, 6, tzinfo=UTC)
    exos(board, PARK)
    later(board, 60.0)
    assert board.parked
    assert board.believed_deg()[1] == pytest.approx(90.0)
