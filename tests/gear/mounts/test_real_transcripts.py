"""Exchanges of real mounts, played back to the drivers byte for byte, each under its number.

The numbers are those of a collection of 91 exchanges of 13 families: drivers' logs, owners' reports, and a few
that are read in sources. `ELSEWHERE` and `NOT_MET` name the others, and why; the last test counts them all.
"""

import socket
import threading
from datetime import UTC, datetime

import pytest

from kochab.core.errors import LineLostError, NoAnswerError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction, Home, PierSide, TrackingRate
from kochab.core.progress import run
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.drivers.celestron_aux import AuxMotor, CelestronAux
from kochab.gear.mounts.drivers.ioptron import Ioptron
from kochab.gear.mounts.drivers.lx200 import Lx200, OnStep
from kochab.gear.mounts.drivers.lx200_dialects import AUTOSTAR, CLONE, DIALECTS, ON_STEP
from kochab.gear.mounts.drivers.nexstar import NexStar, SynScan
from kochab.gear.mounts.drivers.skywatcher import SkyWatcher
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.mounts.probe import ask_celestron_aux
from kochab.gear.mounts.protocols import ioptron, lx200, nexstar, skywatcher
from kochab.gear.mounts.serial_line import Conversation, ProtocolError
from tests.gear.mounts.bench import SITE
from tests.gear.mounts.scripted import CLASSIC_START, ScriptedLink, transcript
from tests.gear.mounts.test_transcripts import MOTORS_START, NEXSTAR_START, noon

PLAYED = set()


def played(*numbers):
    """Note that a test plays these exchanges."""
    PLAYED.update(numbers)
    return lambda test: test


class LooseLink(ScriptedLink):
    """A line where bytes may be left over, which the next command throws away; ``thrown`` keeps them."""

    thrown = b""

    def discard(self, quiet_s=0.0):
        left = bytes(self.buffer)
        self.thrown += left
        self.buffer.clear()
        return left


def loose(driver, script, **settings):
    """The driver over such a line."""
    link = LooseLink(script)
    return driver(link, **settings), link


GPS_START = [(b":GVP#", b"LX2001#"), (b":GR#", b"00:00:00#")]
CLONE_START = [(b":GVP#", b"OpenAstroTracker#"), (b":GR#", b"15:45:04#")]
TARGET = (82.5, -12.25)
SENT = [(b":Sr05:30:00#", b"1"), (b":Sd-12*15:00#", b"1")]
READ_BACK = [(b":Gr#", b"05:30:00#"), (b":Gd#", b"-12*15:00#")]


# -- LX200: Meade and its many relatives --------------------------------------------------------


@played("L01")
def test_an_lx200gps_that_leaves_its_alignment_unanswered_still_tells_the_rest() -> None:
    nothing = [(b":GW#", b"")] * 2
    script = [
        *GPS_START,
        (b":GD#", b"+00\xdf00:00#"),
        (b":GR#", b"00:00:00#"),
        (b":D#", b"#"),
        *nothing,
        (b":D#", b"#"),
    ]
    script[2], script[3] = script[3], script[2]
    with transcript(Lx200, script) as m:
        assert m.dialect is AUTOSTAR
        assert (m.position().ra_deg, m.identify()) == (0.0, "LX2001")
        state = m.state()
        assert (state.slewing, state.aligned, state.tracking) == (False, None, None)
        assert m.state().aligned is None, "and it is not asked again"


@played("L02")
def test_its_site_has_seconds_and_grows_westward_and_its_clock_was_never_set() -> None:
    script = [
        *GPS_START,
        (b":Gt#", b"+22\xdf15:00#"),
        (b":Gg#", b"245\xdf49:19#"),
        (b":GG#", b"-08#"),
        (b":GC#", b"01/01/01#"),
        (b":GL#", b"08:02:20#"),
    ]
    with transcript(Lx200, script) as m:
        report = m.site_report()
    assert (report.site.latitude_deg, report.utc_offset_h) == (22.25, 8.0)
    assert report.site.longitude_deg == pytest.approx(114.1781, abs=1e-4)
    assert report.time_utc == datetime(2001, 1, 1, 0, 2, 20, tzinfo=UTC)


@played("L03", "L12")
def test_guide_pulses_are_not_answered() -> None:
    pulses = [(b":Mgn3000#", b""), (b":Mgs3000#", b""), (b":Mge3000#", b""), (b":Mgw3000#", b"")]
    with transcript(Lx200, [*GPS_START, *pulses]) as m:
        for direction in (Direction.NORTH, Direction.SOUTH, Direction.EAST, Direction.WEST):
            m.pulse(direction, 3000)
    with transcript(Lx200, [*CLONE_START, (b":Mgn0200#", b"")]) as m:
        m.pulse(Direction.NORTH, 200)


@played("L04", "L05")
def test_degrees_are_written_with_0xdf() -> None:
    assert lx200.parse_dec(bytes.fromhex("2b3531df31343a323023")) == pytest.approx(51.23889, abs=1e-5)
    start = [(b":GVP#", b"Autostar#"), (b":GR#", b"00:00:00#")]
    script = [*start, (b":GA#", b"+00\xdf00:00#"), (b":GZ#", b"000\xdf00:00#")]
    script += [(b":GA#", b"+02\xdf09:26#"), (b":GZ#", b"018\xdf44:19#")]
    with transcript(Lx200, script) as m:
        assert m.altaz_deg() == (0.0, 0.0)
        assert m.altaz_deg() == pytest.approx((2.1572, 18.7386), abs=1e-4)


@played("L07")
def test_no_autostar_is_ever_sent_the_mode_that_ruins_its_alignment() -> None:
    start = [(b":GVP#", b"Autostar#"), (b":GR#", b"00:00:00#")]
    with transcript(Lx200, [*start, (b":TQ#", b""), (b":TL#", b""), (b":TS#", b"")]) as m:
        with pytest.raises(RefusedError, match="without losing its alignment"):
            m.track(TrackingRate.OFF)
        for rate in (TrackingRate.SIDEREAL, TrackingRate.LUNAR, TrackingRate.SOLAR):
            m.track(rate)
    assert not {b":AP#", b":AA#", b":AL#"} & set(AUTOSTAR.commands.values())


@played("L09")
def test_an_autostar_that_has_parked_is_silent_and_taken_for_parked() -> None:
    start = [(b":GVP#", b"Autostar#"), (b":GR#", b"00:00:00#")]
    rests, slews = [(b":D#", b"#"), (b":GW#", b"PT2#")], [(b":D#", b"\x7f#"), (b":GW#", b"PT2#")]
    here, there = ([(b":GR#", ra), (b":GD#", b"+51\xdf14:14#")] for ra in (b"00:00:00#", b"00:10:00#"))
    script = [*start, *rests, *here, *rests, (b":hP#", b""), *slews, *there, (b":D#", b"")]
    night = datetime(2026, 1, 15, 22, tzinfo=UTC)
    with transcript(Lx200, script) as m:
        guard = Guard(m, None, Limits(allow_without_site=True), clock=lambda: night, wait=lambda s: None)
        run(guard.rest("park"))
        assert [entry.action for entry in guard.log.sent()] == ["park"]
        with pytest.raises(RefusedError, match="switch it off and on"):
            guard.unpark()


@played("L08")
def test_a_sync_whose_answer_comes_with_the_next_command_is_read_back() -> None:
    """The position asked next brings the text of the sync first, and is asked again."""
    late = b"Coordinates     matched.        #05:30:00#"
    start = [(b":GVP#", b"Autostar#"), (b":GR#", b"05:30:00#")]
    here, idle = [(b":GR#", b"05:30:00#"), (b":GD#", b"-12*10:00#")], [(b":D#", b"#"), (b":GW#", b"PT2#")]
    after = [(b":GR#", late), (b":GR#", b"05:30:00#"), (b":GD#", b"-12*15:00#")]
    looks = 4 * here  # as if it counted in whole minutes, which it may
    mount, link = loose(Lx200, [*start, *looks, *idle, *here, *idle, *SENT, (b":CM#", b""), *after])
    now = datetime(2026, 1, 15, 20, tzinfo=UTC)
    guard = Guard(mount, Site(10.0, 8.0), Limits(), clock=lambda: now, wait=lambda s: None)
    guard.clock_and_site.trust()  # the transcript does not hold its clock
    guard.sync(*TARGET, by_hand=True, confirmed=True)
    assert guard.can_undo
    assert not link.script


@played("L09")
def test_one_bar_is_a_slew_and_none_is_its_end() -> None:
    assert lx200.parse_slewing(b"\x7f#") is True
    assert lx200.parse_slewing(b"#") is False


@played("L10")
def test_an_openastrotracker_is_not_asked_for_an_alignment_it_writes_in_its_own_way() -> None:
    with transcript(Lx200, [*CLONE_START, (b":D#", b"#")]) as m:
        assert m.dialect is CLONE
        assert m.state().aligned is None
    with pytest.raises(ProtocolError):
        lx200.parse_aligned(b"1")


@played("L11")
def test_an_answer_that_is_cut_at_64_bytes_without_its_end_spoils_no_other() -> None:
    mount, link = loose(
        Lx200, [(b":GVP#", b"x" * 64), (b":GR#", b"05:30:00#"), (b":GR#", b"05:31:00#"), (b":GD#", b"+10*00:00#")]
    )
    assert mount.product == ""
    assert mount.position().dec_deg == 10.0
    assert not link.script


@played("L13")
def test_a_mount_that_takes_another_target_without_the_space_gets_it_with_the_space() -> None:
    """An FS2 loses the first digit: 14h15m38s became 4h05m1s, and it drove there. The target is read back first."""
    start = [(b":GVP#", b""), (b":GR#", b"05:30:00#")]
    wrong = [(b":Gr#", b"05:03:00#"), (b":Gd#", b"-02*15:00#")]
    spaced = [(b":Sr 05:30:00#", b"1"), (b":Sd -12*15:00#", b"1")]
    with transcript(Lx200, [*start, *SENT, *wrong, *spaced, *READ_BACK, (b":MS#", b"0")]) as m:
        m.goto(*TARGET)
    with (
        transcript(Lx200, [*start, *SENT, *wrong, *spaced, *wrong]) as m,
        pytest.raises(RefusedError, match="different target"),
    ):
        m.goto(*TARGET)
    with transcript(Lx200, [*start, *SENT, (b":Gr#", b""), (b":MS#", b"0"), *SENT, (b":MS#", b"0")]) as m:
        m.goto(*TARGET)  # one that does not answer this is believed, and not asked again
        m.goto(*TARGET)


@played("L14")
def test_a_bridge_that_hangs_up_after_one_exchange_is_opened_again() -> None:
    server = socket.create_server(("127.0.0.1", 0))
    ends = []

    def serve():
        for replies in ([b"TeenAstro#", b"09:53:28#"], [b"TeenAstro#", b"09:53:28#", b"09:53:30#", b"+10*00:00#"]):
            peer, _ = server.accept()
            for reply in replies:
                if peer.recv(64):
                    peer.sendall(reply)
            peer.close()

    thread = threading.Thread(target=serve)
    thread.start()
    port = f"socket://127.0.0.1:{server.getsockname()[1]}"

    def reopen():
        ends.append(open_mount("lx200", port))
        return ends[-1]

    guard = Guard(reopen(), SITE, reopen=reopen)
    with pytest.raises(LineLostError):
        guard.position()
    guard.reconnect()
    assert guard.position().dec_deg == 10.0
    thread.join()
    guard.close()
    server.close()


@played("L21", "L27")
def test_an_onstep_parks_unparks_and_goes_home_by_its_own_commands_and_is_never_reset() -> None:
    start = [(b":GVP#", b"On-Step#"), (b":GVN#", b"10.19d#"), (b":GRH#", b"05:30:00.0000#")]
    script = [
        (b":hP#", b"1"),
        (b":GU#", b"nNIEW260#"),
        (b":GU#", b"nNPEW260#"),
        (b":hR#", b"1"),
        (b":GU#", b"NpeEW260#"),
    ]
    script += [(b":hC#", b""), (b":GU#", b"nNphEW260#"), (b":GU#", b"nNpHEW260#"), (b":hP#", b"0")]
    with transcript(OnStep, [*start, *script]) as m:
        m.park()
        on_its_way, there = m.state(), m.state()
        assert (on_its_way.parked, on_its_way.slewing) == (False, True), "though there is no goto"
        assert (there.parked, there.slewing) == (True, False)
        m.unpark()
        assert m.state().parked is False
        m.go_home()
        on_its_way, there = m.state(), m.state()
        assert (on_its_way.at_home, on_its_way.slewing) == (False, True)
        assert (there.at_home, there.slewing) == (True, False)
        with pytest.raises(RefusedError, match="refuses this command: park"):
            m.park()
    assert b":hF#" not in lx200.ON_STEP_COMMANDS.values()


@played("L43")
def test_a_10micron_found_parked_says_so() -> None:
    start = [(b":GVP#", b"10micron GM1000HPS#"), (b":GR#", b"00:10:03.24#")]
    ask = [(b":D#", b"#"), (b":Gstat#", b"5#"), (b":pS#", b"West#")]
    script = [*start, *ask, (b":PO#", b""), ask[0], (b":Gstat#", b"0#"), ask[2]]
    with transcript(Lx200, script) as m:
        state = m.state()
        assert (state.parked, state.slewing, state.tracking) == (True, False, False)
        assert state.pier_side is PierSide.WEST
        m.unpark()
        state = m.state()
        assert (state.parked, state.slewing, state.tracking) == (False, False, True)


@played("L20", "L21", "L26", "L32")
@pytest.mark.parametrize(
    ("flags", "parked", "tracking", "side"),
    [
        (b"nNPEW260#", True, False, PierSide.WEST),
        (b"NpeEW260#", False, True, PierSide.WEST),
        (b"nNpeEW260#", False, False, PierSide.WEST),
        (b"nNpK260#", False, False, None),
        (b"NGM011000211#", False, True, None),
    ],
)
def test_the_status_of_onstep_and_am5(flags, parked, tracking, side) -> None:
    state = lx200.parse_flags(flags)
    assert (state.slewing, state.parked, state.tracking, state.pier_side) == (False, parked, tracking, side)


@played("L24", "L25", "L126")
@pytest.mark.parametrize(
    ("reply", "reason"),
    [
        (b"3", "standby"),
        (b"4", "parked or the target out of its reach"),
        (b"5", "not aligned"),
        (b"6", "site is not set"),
        (b"6Outside Limits.#", "Outside Limits"),
    ],
)
def test_a_slew_refused_by_a_digit_is_told_in_words(reply, reason) -> None:
    with (
        transcript(Lx200, [*CLASSIC_START, *SENT, *READ_BACK, (b":MS#", reply)]) as m,
        pytest.raises(RefusedError, match=reason),
    ):
        m.goto(*TARGET)


@played("L27", "L126")
@pytest.mark.parametrize(("reply", "reason"), [(b"E6#", "outside the mount's limits"), (b"No object!#", "No object")])
def test_a_sync_refused_by_a_text_is_no_sync(reply, reason) -> None:
    start = [(b":GVP#", b"NYX-101#"), (b":GRH#", b"05:30:00.0000#")]
    with transcript(Lx200, [*start, *SENT, (b":CM#", reply)]) as m, pytest.raises(RefusedError, match=reason):
        m.sync(*TARGET)


@played("L28", "L89")
@pytest.mark.parametrize("stray", [b"\r\n", b"x"])
def test_bytes_after_the_end_of_an_answer_are_thrown_away(stray) -> None:
    script = [(b":GVP#", b"Pegasus NYX-101#" + stray), (b":GRH#", b"05:30:00.0000#" + stray)]
    script += [(b":GRH#", b"05:30:00.0000#" + stray), (b":GDH#", b"+51*14:14.000#" + stray), (b":GU#", b"NpeEW260#")]
    mount, link = loose(Lx200, script)
    assert mount.identify() == "Pegasus NYX-101"
    assert mount.position().dec_deg == pytest.approx(51.2372, abs=1e-4)
    assert mount.state().slewing is False
    assert link.thrown == stray * 4


@played("L29")
def test_an_answer_that_belongs_to_another_question_is_asked_again() -> None:
    place = [(b":GRH#", b"On-Step#"), (b":GRH#", b"05:30:00.0000#")]
    with transcript(OnStep, [(b":GVP#", b"On-Step#"), (b":GVN#", b"10.23a#"), *place]) as m:
        assert m.product == "On-Step"


@played("L2A", "L36")
def test_what_indi_sends_an_onstep_we_send_too_and_never_60_seconds() -> None:
    start = [(b":GVP#", b"On-Step#"), (b":GVN#", b"10.23a#"), (b":GRH#", b"05:30:00.0000#")]
    target = [(b":Sr17:30:00.0000#", b"1"), (b":Sd+10*00:00.000#", b"1")]
    script = [*start, *target, (b":MS#", b"0"), *target, (b":CM#", b"N/A#")]
    script += [(b":Mgn0500#", b""), (b":Td#", b"1"), (b":TQ#:Te#", b"1")]
    with transcript(OnStep, script) as m:
        m.goto(262.5, 10.0)
        m.sync(262.5, 10.0)
        m.pulse(Direction.NORTH, 500)
        m.track(TrackingRate.OFF)
        m.track(TrackingRate.SIDEREAL)
    for tenth in range(-20, 20):
        for decimals in (0, 1, 2, 4):
            place = 17.4 * 15.0 + tenth / 2400.0, -0.0002 + tenth / 36000.0
            text = lx200.set_ra(place[0], decimals=decimals) + lx200.set_dec(place[1], decimals=decimals)
            assert b":60" not in text
    assert lx200.set_ra(359.9999999, decimals=2) == b":Sr00:00:00.00#"
    with pytest.raises(ProtocolError):
        lx200.parse_ra(b"17:23:60.00#")


@played("L2B")
def test_an_onstep_that_is_reset_by_the_opening_is_waited_for() -> None:
    """Eight seconds of silence: a second a question."""
    assert ON_STEP.boot_s >= 9
    booted = [(b":GVP#", b"0On-Step#"), (b":GVN#", b"10.23a#"), (b":GRH#", b"05:30:00.0000#")]
    with transcript(OnStep, [(b":GVP#", b"")] * 8 + booted) as m:
        assert m.identify() == "On-Step"


@played("L30", "L31")
def test_an_am5_is_found_by_its_name() -> None:
    script = [(b":GVP#", b"AM5#"), (b":GR#", b"08:04:30#"), (b":GR#", b"08:04:30#"), (b":GD#", b"+89*00:38#")]
    with transcript(Lx200, script) as m:
        here = m.position()
        assert m.identify() == "AM5"
        assert (here.ra_deg, here.dec_deg) == pytest.approx((121.125, 89.01056), abs=1e-5)


@played("L35")
def test_an_am5_refuses_with_e_and_a_number() -> None:
    start = [(b":GVP#", b"AM5#"), (b":GR#", b"08:04:30#")]
    script = [*start, *SENT, (b":MS#", b"e7#"), *SENT, (b":CM#", b"e11#"), SENT[0], (b":Sd-12*15:00#", b"e2#")]
    script += [(b":Sd -12*15:00#", b"e2#")]
    with transcript(Lx200, script) as m:
        with pytest.raises(RefusedError, match="time or site is not set"):
            m.goto(*TARGET)
        with pytest.raises(RefusedError, match="so near the pole"):
            m.sync(*TARGET)
        with pytest.raises(RefusedError, match="does not accept"):
            m.goto(*TARGET)
    told = {code: lx200.parse_slew(b"e%d#" % code, lx200.ZWO_REFUSALS) for code in range(1, 14)}
    assert not [reason for reason in told.values() if "code" in reason]


@played("L40", "L42", "L44")
def test_a_10micron_takes_a_goto_and_refuses_a_far_sync() -> None:
    start = [(b":GVP#", b"10micron GM1000HPS#"), (b":GR#", b"00:10:03.24#")]
    fine = [(b":Sr05:30:00.00#", b"1"), (b":Sd-12*15:00.0#", b"1")]
    script = [*start, *fine, (b":MS#", b"0"), *fine, (b":CM#", b"Coordinates     matched        #")]
    with transcript(Lx200, [*script, *fine, (b":CM#", b"Match fail: dist. too large#")]) as m:
        assert m.dialect is DIALECTS["10micron"]
        m.goto(*TARGET)
        m.sync(*TARGET)
        with pytest.raises(RefusedError, match=r"dist\. too large"):
            m.sync(*TARGET)


@played("L120", "L125")
def test_astro_physics_and_gemini_answer_neither_name_nor_alignment() -> None:
    """The precision of an Astro-Physics goes one way, so that a long answer must not be toggled."""
    start = [(b":GVP#", b""), (b":GR#", b"05:30:00.0#")]
    with transcript(Lx200, [*start, (b":D#", b"#"), (b"\x06", b""), (b"\x06", b""), (b":D#", b"#")]) as m:
        assert m.state().aligned is None
        assert m.state().slewing is False
    with pytest.raises(ProtocolError):
        lx200.parse_zone(b":A5#")


# -- iOptron ------------------------------------------------------------------------------------


@played("L50", "L51")
def test_an_ioptron_at_the_pole_that_says_it_slews() -> None:
    status, place = b"-0004170050763000020811#", b"+3240000003395229021#"
    script = [
        (b":MountInfo#", b"0120"),
        (b":GLS#", status),
        (b":GEP#", place),
        (b":GEP#", b"+3240000003395235021#"),
        (b":GLS#", status),
    ]
    with transcript(Ioptron, script) as m:
        assert m.identify() == "iOptron CEM120"
        state = m.state()
        assert (state.slewing, state.pier_side) == (True, None)
        here = m.position()
        assert (here.ra_deg, here.dec_deg) == pytest.approx((94.31, 90.0), abs=0.01)
        site = ioptron.parse_site(m.talk.ask(b":GLS#", m.reply(), bytes))
        assert (site.latitude_deg, site.longitude_deg) == pytest.approx((51.008, -0.116), abs=1e-3)


@played("L52", "L53")
@pytest.mark.parametrize("wrong", [b"-000417005076300002#", b"-0004170050763000020811#"])
def test_an_answer_of_another_length_or_to_another_question_is_none(wrong) -> None:
    with transcript(Ioptron, [(b":MountInfo#", b"0026"), (b":GEP#", wrong), (b":GEP#", b"+3240000003395229021#")]) as m:
        assert m.position().dec_deg == 90.0
    with pytest.raises(ProtocolError):
        ioptron.parse_status(b"-000417005076300002#")
    with pytest.raises(ProtocolError):
        ioptron.parse_position(wrong)


@played("L54", "L57")
def test_the_time_of_an_ioptron_and_a_number_that_two_models_share() -> None:
    time_utc, offset = ioptron.parse_time(b"-48000693900019792#")
    assert (time_utc.replace(microsecond=0), offset) == (datetime(2021, 12, 27, 18, 0, 19, tzinfo=UTC), -8.0)
    assert ioptron.parse_model(b"0026") == "CEM26 or CEM25-EC"


@played("L55")
def test_a_pulse_of_an_ioptron_always_has_five_digits() -> None:
    for milliseconds in (1, 80, 999, 2500, 5000):
        command = ioptron.pulse(Direction.SOUTH, milliseconds)
        assert len(command) == len(b":ZC00000#")
        assert int(command[3:8]) == milliseconds


@played("L56")
def test_a_goto_that_an_ioptron_answers_by_0_is_refused() -> None:
    script = [(b":MountInfo#", b"5035"), (b":SRA029700000#", b"1"), (b":Sd-04410000#", b"1"), (b":MS1#", b"0")]
    with transcript(Ioptron, script) as m, pytest.raises(RefusedError, match="outside its limits"):
        m.goto(*TARGET)


# -- NexStar and SynScan hand controls ----------------------------------------------------------


@played("L60", "L61")
def test_versions_and_the_bytes_of_a_goto() -> None:
    assert nexstar.parse_version(b"\x04\x29#") == (4, 41)
    assert nexstar.parse_version(b"\x02\x02#") > (1, 6)
    assert nexstar.parse_passed(b"\x05\x07#", 2) == b"\x05\x07"
    assert nexstar.parse_passed(b"\x03\x26#", 2) == b"\x03\x26"
    assert nexstar.goto(45.0, 45.0) == b"r20000000,20000000"
    assert nexstar.goto(45.0, 45.0, precise=False) == b"R2000,2000"
    assert nexstar.sync(45.0, 45.0) == b"s20000000,20000000"
    assert nexstar.parse_position(b"20000000,20000000#") == (45.0, 45.0)


@played("L62", "L63")
@pytest.mark.parametrize("reply", [b"\x37#", b"0#"])
def test_a_motor_that_does_not_take_a_move_is_told(reply) -> None:
    script = [*NEXSTAR_START, (bytes([0x50, 2, 16, 37, 9, 0, 0, 0]), reply)]
    with transcript(NexStar, script) as m, pytest.raises(NoAnswerError):
        m.move(Direction.EAST, 4.0, 20.0)
    with pytest.raises(ProtocolError):
        nexstar.parse_passed(b"\x12\x34\x00#", 2)


@played("L64", "L72")
def test_a_control_that_does_not_answer_is_not_at_0_0() -> None:
    with pytest.raises(NoAnswerError), transcript(NexStar, [(b"V", b"")]):
        pass
    with transcript(SynScan, [(b"V", b"000000#"), (b"m", b"\x00#"), (b"E", b"")]) as m, pytest.raises(NoAnswerError):
        m.position()


@played("L70", "L71")
def test_a_synscan_is_read_as_indi_reads_it() -> None:
    start = [(b"V", b"042507#"), (b"m", b"\x00#")]
    asked = [
        (b"e", b"99172500,38FA6900#"),
        (b"z", b"FB561F00,24AF0D00#"),
        (b"L", b"0#"),
        (b"J", b"\x01#"),
        (b"t", b"\x02#"),
    ]
    with transcript(SynScan, [*start, *asked]) as m:
        here = m.position()
        assert (here.ra_deg, here.dec_deg) == pytest.approx((215.2833, 80.1256), abs=2e-3)
        assert m.altaz_deg() == pytest.approx((51.5867, 353.4419), abs=2e-3)
        assert m.state().slewing is False
    ra, dec = nexstar.parse_position(b"7ABB8000,1B7FFB00#")
    assert (ra / 15.0, dec) == pytest.approx((11.506, 38.672), abs=1e-3)


# -- Sky-Watcher motor boards -------------------------------------------------------------------


@played("L80", "L84", "L94", "L96")
@pytest.mark.parametrize(
    ("reply", "steps"),
    [
        (b"=000080\r", 8388608),
        (b"=007BAA\r", 11172608),
        (b"=754492\r", 9585781),
        (b"=D7F57F\r", 8386007),
        (b"=0606A0\r", 0xA00606),
    ],
)
def test_positions_are_low_byte_first(reply, steps) -> None:
    assert skywatcher.parse_position(reply) == steps - 0x800000


@played("L81", "L82", "L83", "L95", "L96")
@pytest.mark.parametrize(
    ("reply", "running", "goto", "fast"),
    [
        (b"=101\r", False, False, False),
        (b"=001\r", False, True, False),
        (b"=711\r", True, False, True),
        (b"=301\r", False, False, False),
        (b"=401\r", False, True, True),
        (b"=411\r", True, True, True),
        (b"=511\r", True, False, True),
        (b"=501\r", False, False, True),
    ],
)
def test_the_status_of_a_motor(reply, running, goto, fast) -> None:
    status = skywatcher.parse_status(reply)
    assert (status.running, status.goto, status.fast, status.initialised) == (running, goto, fast, True)


@played("L81")
def test_an_increment_is_written_low_byte_first() -> None:
    assert skywatcher.command("H", 0, skywatcher.low_first(835343)) == b":H10FBF0C\r"
    assert skywatcher.command("I", 0, skywatcher.low_first(6)) == b":I1060000\r"


@played("L83")
def test_the_mode_is_set_whatever_the_status_says() -> None:
    """AstroEQ's status shows the new mode only when the motor has started."""
    script = [*MOTORS_START, (b":f1\r", b"=101\r"), (b":G110\r", b"=\r"), (b":I16C0200\r", b"=\r"), (b":J1\r", b"=\r")]
    with transcript(SkyWatcher, script, site=SITE, clock=noon) as m:
        m.track(TrackingRate.SIDEREAL)


@played("L85")
def test_a_cable_that_echoes_every_command() -> None:
    script = [(sent, sent + reply) for sent, reply in MOTORS_START]
    script += [(b":j1\r", b":j1\r=000080\r"), (b":j2\r", b":j2\r=000080\r")]
    with transcript(SkyWatcher, script, site=SITE, clock=noon) as m:
        assert m.position().dec_deg == 90.0


@played("L86", "L95")
def test_a_wi_fi_module_that_chatters_between_the_answers() -> None:
    script = list(MOTORS_START)
    script[0] = (b":a1\r", b"AT+CWMODE_CUR?\r=00B289\r=00B289\r")
    mount, link = loose(SkyWatcher, script, site=SITE, clock=noon)
    assert (mount.motors[0].steps_turn, link.thrown) == (9024000, b"=00B289\r")
    refused = [(b":a1\r", b"!0\r")] * 5
    with pytest.raises(NoAnswerError), transcript(SkyWatcher, refused, site=SITE, clock=noon):
        pass
    assert skywatcher.parse_refusal(b"!0\r") == "an unknown command"


@played("L87")
@pytest.mark.parametrize("version", ["033A45", "030723", "020900", "03000A", "03300C", "030720", "030522", "030044"])
def test_the_codes_of_newer_boards_are_known(version) -> None:
    assert skywatcher.parse_mount_code(version) in skywatcher.EQUATORIAL


@played("L91")
def test_a_motor_that_still_brakes_is_waited_for_and_its_refusal_told() -> None:
    braking = [(b":f1\r", b"=111\r"), (b":K1\r", b"=\r"), (b":f1\r", b"=111\r"), (b":f1\r", b"=101\r")]
    start = [(b":G110\r", b"=\r"), (b":I16C0200\r", b"=\r"), (b":J1\r", b"=\r")]
    with transcript(SkyWatcher, [*MOTORS_START, *braking, *start], site=SITE, clock=noon) as m:
        m.track(TrackingRate.SIDEREAL)
    with (
        transcript(
            SkyWatcher, [*MOTORS_START, (b":f1\r", b"=101\r"), (b":G110\r", b"!2\r")], site=SITE, clock=noon
        ) as m,
        pytest.raises(RefusedError, match="not stopped"),
    ):
        m.track(TrackingRate.SIDEREAL)


@played("L93", "L90")
def test_a_star_adventurer_gti_tracks_with_its_own_period() -> None:
    """L93 sent 0x05CC08 for 3628800 steps and 16 MHz; the sidereal day makes it two ticks more."""
    period = skywatcher.step_period(360.0 / 86164.0905, 3628800, 16000000)
    assert period == pytest.approx(0x05CC08, abs=3)
    start = [
        (b":a1\r", b"=005F37\r"),
        (b":b1\r", b"=0024F4\r"),
        (b":a2\r", b"=004C2C\r"),
        (b":b2\r", b"=0024F4\r"),
        (b":e1\r", b"=03300C\r"),
        (b":f1\r", b"=100\r"),
        (b":q1010000\r", b"!0\r"),
    ]
    order = f":I1{skywatcher.low_first(period)}\r".encode()
    begin = [(b":f1\r", b"=100\r"), (b":F1\r", b"=\r"), (b":G110\r", b"=\r"), (order, b"=\r"), (b":J1\r", b"=\r")]
    with transcript(SkyWatcher, [*start, *begin], site=SITE, clock=noon) as m:
        assert [motor.steps_turn for motor in m.motors] == [3628800, 2903040]
        m.track(TrackingRate.SIDEREAL)


# -- the AUX bus of a Celestron -------------------------------------------------------------------


def h(text):
    return bytes.fromhex(text)


EVOLUTION = [
    (h("3b032010fecf"), h("3b032010fecf 3b071020fe070a100d9d")),  # Wi-Fi sends every question back first
    (h("3b03201005c8"), h("3b03201005c8 3b05102005168729")),
]
AT_HOME = [(h("3b03201001cc"), h("3b06102001000001c8")), (h("3b03201101cb"), h("3b06112001ffffffcb"))]
AVX = [
    (h("3b032010fecf"), h("3b071020fe070f204e47")),  # a relay does not
    (h("3b03201005c8"), h("3b0510200514852d")),
    *AT_HOME,
    AT_HOME[0],
]


@played("L101", "L107")
def test_the_wi_fi_of_a_celestron_is_named() -> None:
    for script, name in ((EVOLUTION, "Celestron Evolution (AUX bus)"), (AVX[:2], "Celestron AVX (AUX bus)")):
        found = ask_celestron_aux(Conversation(ScriptedLink(script)))
        assert (found.driver, found.name) == ("celestronaux", name)
    silent = Conversation(ScriptedLink([(h("3b032010fecf"), b"")]))
    with pytest.raises(NoAnswerError):
        ask_celestron_aux(silent)


@pytest.mark.parametrize(
    ("equatorial", "latitude", "sentence"),
    [(False, 50.0, "If it is on a wedge"), (True, -33.0, "South of the equator")],
)
def test_a_fork_in_altitude_and_azimuth_is_refused_with_what_to_do(equatorial, latitude, sentence) -> None:
    refused = pytest.raises(RefusedError, match=sentence)
    with refused, transcript(CelestronAux, EVOLUTION, site=Site(latitude, 8.0), clock=noon, equatorial=equatorial):
        pass


@played("L107")
def test_an_avx_at_its_home_is_a_count_from_the_pole_on_both_axes() -> None:
    with transcript(CelestronAux, [*AVX, *AT_HOME], site=SITE, clock=noon, home=Home.POWER_ON) as m:
        assert m.position().dec_deg == pytest.approx(90.0, abs=1e-4)
        assert m.identify() == "Celestron AVX, motor board 7.15"
        assert Ability.PULSE in m.lacks


@played("L103")
def test_a_position_below_zero_is_a_negative_angle() -> None:
    motors = [
        AuxMotor(Conversation(ScriptedLink([exchange])), board, 1.0)
        for board, exchange in (
            (16, (h("3b03201001cc"), h("3b03201001cc 3b0610200100c01aef"))),
            (17, (h("3b03201101cb"), h("3b03201101cb 3b06112001ffffac1e"))),
        )
    ]
    assert [motor.angle_deg() for motor in motors] == pytest.approx([49178 / (1 << 24) * 360, -84 / (1 << 24) * 360])


@played("L104")
def test_rate_0_stops_a_motor_and_is_acknowledged() -> None:
    link = ScriptedLink([(h("3b04201024 00a8"), h("3b04201024 00a8 3b03102024a9"))])
    motor = AuxMotor(Conversation(link), 16, 1.0)
    motor.ensure_stopped()
    link.finished()
    assert motor.halt_command()[0] == h("3b0420102400a8")


@played("L105")
def test_a_goto_is_fast_then_slow_and_is_over_by_ff() -> None:
    done, busy = h("3b03201013ba 3b04102013ffba"), h("3b03201013ba 3b0410201300b9")
    ask = h("3b03201013ba")
    script = [
        (h("3b06201002020b4f6c"), h("3b06201002020b4f6c 3b03102002cb")),
        (ask, busy),
        (ask, done),
        (h("3b06201017037914 23"), h("3b0620101703791423 3b03102017b6")),
        (ask, done),
    ]
    link = ScriptedLink(script)
    motor = AuxMotor(Conversation(link), 16, 1.0)
    motor.seen_deg = 0.0
    motor.turn_by(0x020B4F / (1 << 24) * 360.0, 0)
    assert (motor.running(), motor.running()) == (True, False)
    motor.seen_deg = 0x0374FC / (1 << 24) * 360.0
    motor.turn_by((0x037914 - 0x0374FC) / (1 << 24) * 360.0, 0)
    assert not motor.running()
    link.finished()


@played("L100", "L108", "L110", "L111")
@pytest.mark.parametrize(
    ("asked", "before", "answer"),
    [
        ("3b032010fecf", b"CMD\r\n<2.40-CEL> ", "3b071020fe070a100d9d"),  # the shell of the Wi-Fi module
        ("3b032010fecf", h("3b070d20fe052208118e"), "3b051020fe050eba"),  # the hand control, to somebody else
        ("3b03201001cc", h("40feb6eafe3b030e"), "3b06102001000001c8"),  # an answer of which a part was lost
        ("3b04201146ccb9", h("3b0310204687"), "3b0311204686"),  # the other motor's
    ],
)
def test_an_answer_is_found_among_what_others_say(asked, before, answer) -> None:
    link = ScriptedLink([(h(asked), before + h(answer))])
    frame = h(asked)
    assert Conversation(link).ask(frame, nexstar.aux_reader(frame, 1.0), bytes) == h(answer)
    link.finished()


@played("L102", "L109")
def test_a_refusal_and_an_echo_alone_are_no_answer() -> None:
    refused = h("3b0320104786 3b041020f04795")
    with pytest.raises(ProtocolError):
        nexstar.parse_aux(nexstar.aux_answer(refused[:6], refused), 1)
    assert nexstar.aux_answer(h("3b0304dafe21"), h("3b0304dafe21")) is None
    motor = AuxMotor(Conversation(ScriptedLink(2 * [(h("3b03201001cc"), h("3b03201001cc"))])), 16, 1.0)
    with pytest.raises(NoAnswerError):
        motor.angle_deg()


@played("L112")
def test_guide_pulses_which_nothing_shows_are_not_sent() -> None:
    with transcript(CelestronAux, AVX, site=SITE, clock=noon) as m, pytest.raises(RefusedError, match="short gotos"):
        m.pulse(Direction.NORTH, 500)


# -- the account --------------------------------------------------------------------------------

ALL = {
    *(f"L{n:02d}" for n in range(1, 16)),
    *(f"L{n}" for n in range(20, 30)),
    "L2A",
    "L2B",
    *(
        f"L{n}"
        for n in (*range(30, 37), *range(40, 45), *range(50, 58), *range(60, 65), *range(70, 73), *range(80, 99))
    ),
    *(f"L{n}" for n in (*range(100, 113), 120, 125, 126, 130)),
}
ELSEWHERE = {"L06": "test_clock_and_site: test_l06", "L92": "test_udp: what a datagram may hold"}
NOT_SENT = "no driver sends these commands"
NO_BYTES = "the report has no bytes"
NOT_MET = {
    "L15": "what a phone sends, not what a mount answers",
    "L22": NOT_SENT,
    "L23": NO_BYTES,
    "L33": NOT_SENT,
    "L34": NOT_SENT,
    "L41": NOT_SENT,
    "L88": NO_BYTES + "; a mount that moves after a Stop: test_stop_seen",
    "L97": NOT_SENT,
    "L98": NO_BYTES,
    "L106": NOT_SENT,
    "L130": "the Star Book speaks HTTP and has no driver",
}


def test_every_exchange_is_played_or_named_with_a_reason() -> None:
    assert len(ALL) == 91
    assert PLAYED | ELSEWHERE.keys() | NOT_MET.keys() == ALL
    assert not PLAYED & NOT_MET.keys()
