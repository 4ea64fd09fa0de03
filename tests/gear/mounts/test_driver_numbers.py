"""The numbers of the drivers over a line, each from both sides, byte for byte."""

from types import SimpleNamespace

import pytest

from kochab.core.errors import LineLostError, NoAnswerError, RefusedError
from kochab.core.mount import CONFIRM_HOME, Ability, Direction, Home, PierSide, TrackingRate
from kochab.core.progress import run
from kochab.gear.mounts import DRIVERS, probe
from kochab.gear.mounts.drivers import skywatcher as motors_of
from kochab.gear.mounts.drivers.lx200 import Lx200, OnStep
from kochab.gear.mounts.drivers.motor_mount import KeptZero, reads, to_axes
from kochab.gear.mounts.drivers.nexstar import NexStar, SynScan
from kochab.gear.mounts.drivers.skywatcher import SkyWatcher
from kochab.gear.mounts.protocols import lx200
from kochab.gear.mounts.serial_line import ProtocolError

from .scripted import CLASSIC_START, transcript
from .test_replies_in_range import low, nex_site
from .test_transcripts import MOTORS_START, ONSTEP_START, SITE, TARGET, noon

# -- LX200 -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("silent", [0, 9, 10])
def test_an_onstep_that_boots_is_asked_ten_times(silent) -> None:
    answered = [] if silent == 10 else ONSTEP_START
    script = [(b":GVP#", b"")] * silent + answered
    if answered:
        with transcript(OnStep, script) as m:
            assert m.identify() == "On-Step"
    else:
        with pytest.raises(NoAnswerError, match="does not give its name"), transcript(OnStep, script):
            pass


@pytest.mark.parametrize(
    ("product", "title"),
    [
        *((name, "Meade Autostar") for name in ("Autostar", "AudioStar 1", "LX2001", "LX200 GPS", "ETX-90", "RCX400")),
        ("10micron GM2000", "10micron GM and AZ"),
        ("FS2", "LX200 compatible mount"),
    ],
)
def test_a_dialect_is_known_by_the_product_s_name(product, title) -> None:
    with transcript(Lx200, [(b":GVP#", product.encode() + b"#"), (b":GR#", b"05:30:00#")]) as m:
        assert m.dialect.title == title
        assert m.identify() == product
        assert (Ability.PARK in m.lacks) is (title == "LX200 compatible mount")


@pytest.mark.parametrize(
    "script",
    [
        [(b":Sr05:30:00#", b"0"), (b":Sr 05:30:00#", b"0")],
        [(b":Sr05:30:00#", b"1"), (b":Sd-12*15:00#", b"0"), (b":Sd -12*15:00#", b"0")],
    ],
)
def test_coordinates_that_are_not_accepted_in_either_form_are_told(script) -> None:
    with transcript(Lx200, [*CLASSIC_START, *script]) as m, pytest.raises(RefusedError, match="not accept these"):
        m.goto(*TARGET)


@pytest.mark.parametrize(("dec", "held"), [(b"-12*20:00#", True), (b"-12*21:30#", False)])
def test_a_target_is_read_back_to_a_tenth_of_a_degree(dec, held) -> None:
    """Six arcminutes; else it is sent again with a space, which the FS2 needs."""
    first = [(b":Sr05:30:00#", b"1"), (b":Sd-12*15:00#", b"1")]
    again = [(b":Sr 05:30:00#", b"1"), (b":Sd -12*15:00#", b"1")]
    back = [(b":Gr#", b"05:30:00#"), (b":Gd#", dec)]
    script = [*CLASSIC_START, *first, *back, *([(b":MS#", b"0")] if held else [*again, *back])]
    with transcript(Lx200, script) as m:
        if held:
            m.goto(*TARGET)
        else:
            with pytest.raises(RefusedError, match="different target than Kochab sent"):
                m.goto(*TARGET)


def test_a_classic_that_does_not_read_back_its_target_is_believed_once_and_for_all() -> None:
    target = [(b":Sr05:30:00#", b"1"), (b":Sd-12*15:00#", b"1")]
    sync = (b":CM#", b"matched#")
    with transcript(Lx200, [*CLASSIC_START, *target, (b":Gr#", b""), (b":MS#", b"0"), *target, sync]) as m:
        m.goto(*TARGET)
        m.sync(*TARGET)


def test_nonsense_for_a_state_is_no_state() -> None:
    for bars, status in (([b"05:30#"] * 2, []), ([b"#"], [b"X#"] * 2)):
        script = [(b":D#", bar) for bar in bars] + [(b":GW#", one) for one in status]
        start = [(b":GVP#", b"Autostar#"), (b":GR#", b"05:30:00#")]
        with transcript(Lx200, start + script) as m, pytest.raises(ProtocolError):
            m.state()


def test_a_mount_that_does_not_know_the_question_for_its_status_is_asked_once() -> None:
    start = [(b":GVP#", b"Autostar#"), (b":GR#", b"05:30:00#")]
    with transcript(Lx200, [*start, (b":D#", b"#"), (b":GW#", b""), (b":GW#", b""), (b":D#", b"\x7f#")]) as m:
        assert (m.state().slewing, m.state().slewing) == (False, True)


def test_a_date_that_there_is_not_leaves_its_site_and_zone() -> None:
    told = [
        (b":Gt#", b"+50*00#"),
        (b":Gg#", b"352*00#"),
        (b":GG#", b"-01#"),
        (b":GC#", b"02/30/26#"),
        (b":GL#", b"22:00:00#"),
    ]
    with transcript(Lx200, [*CLASSIC_START, *told]) as m:
        report = m.site_report()
    assert (report.site.latitude_deg, report.site.longitude_deg) == (50.0, 8.0)
    assert (report.time_utc, report.utc_offset_h) == (None, 1.0)


# -- NexStar and SynScan -------------------------------------------------------------------------------------

ALIGNED = (b"J", b"\x01#")


@pytest.mark.parametrize(("version", "precise"), [(b"\x01\x05#", False), (b"\x01\x06#", True)])
def test_a_hand_control_is_precise_since_1_6(version, precise) -> None:
    start = [(b"V", version), (b"v", b""), (b"m", b"\x14#")]
    moves = [(b"e", b"3AAAAAAB,F749F49F#"), (b"z", b"3AAAAAAB,F749F49F#"), ALIGNED, (b"r3AAAAAAB,F749F49F", b"#")]
    coarse = [(b"E", b"3AAB,F74A#"), (b"Z", b"3AAB,F74A#"), ALIGNED, (b"R3AAA,F749", b"#")]
    with transcript(NexStar, [*start, *(moves if precise else coarse)]) as m:
        here, (altitude, azimuth) = m.position(), m.altaz_deg()
        assert (here.ra_deg, here.dec_deg) == pytest.approx(TARGET, abs=3e-3)
        assert (azimuth, altitude) == pytest.approx(TARGET, abs=3e-3)
        m.goto(*TARGET)


@pytest.mark.parametrize(("version", "syncs"), [(b"\x04\x09#", False), (b"\x04\x0a#", True)])
def test_a_hand_control_syncs_since_4_10(version, syncs) -> None:
    with transcript(NexStar, [(b"V", version), (b"m", b"\x14#")]) as m:
        assert (Ability.SYNC in m.lacks) is not syncs


@pytest.mark.parametrize(("version", "tells"), [(b"\x04\x0e#", False), (b"\x04\x0f#", True)])
def test_a_hand_control_tells_its_side_since_4_15(version, tells) -> None:
    script = [
        (b"V", version),
        (b"m", b"\x14#"),
        *([(b"p", b"E#")] if tells else []),
        (b"L", b"0#"),
        ALIGNED,
        (b"t", b"\x02#"),
    ]
    with transcript(NexStar, script) as m:
        assert m.state().pier_side is (PierSide.WEST if tells else None)


@pytest.mark.parametrize(
    ("milliseconds", "percent", "hundredths"),
    [
        (1, 50, 1),
        (14, 50, 1),
        (16, 50, 2),
        (500, 50, 50),
        (2550, 50, 255),
        (2560, 100, 128),
        (5000, 100, 250),
        (5200, 100, 255),
    ],
)
@pytest.mark.parametrize(
    ("direction", "board", "sign"),
    [(Direction.NORTH, 17, 1), (Direction.SOUTH, 17, -1), (Direction.WEST, 16, 1), (Direction.EAST, 16, -1)],
)
def test_a_pulse_is_in_hundredths_of_a_second_and_a_long_one_twice_as_fast(
    milliseconds, percent, hundredths, direction, board, sign
) -> None:
    """The motor board takes one byte: 2.55 s."""
    sent = bytes([0x50, 3, board, 0x26, sign * percent % 256, hundredths, 0, 0])
    with transcript(NexStar, [(b"V", b"\x04\x15#"), (b"m", b"\x14#"), (sent, b"#")]) as m:
        m.pulse(direction, milliseconds)


@pytest.mark.parametrize(("model", "mode"), [(127, 2), (128, 1), (160, 1), (5, 2)])
def test_a_synscan_tracks_in_altitude_and_azimuth_from_model_128_on(model, mode) -> None:
    asked = [] if mode == 1 else [(b"w", nex_site(50, 0, 0, 0, 8, 0, 0, 0))]
    script = [(b"V", b"042507#"), (b"m", bytes([model]) + b"#"), (b"t", b"\x00#"), *asked, (b"T" + bytes([mode]), b"#")]
    with transcript(SynScan, script) as m:
        assert Ability.PULSE in m.lacks
        m.track(TrackingRate.SIDEREAL)


# -- Motor boards --------------------------------------------------------------------------------------------


def board(*script, start=MOTORS_START, **settings):
    asked = start[:-1] if "home" in settings else start  # its features, for where home is
    return transcript(SkyWatcher, [*asked, *script], site=SITE, clock=noon, **settings)


DONE = b"=\r"


def counters(first_deg, second_deg):
    """What both motors answer for their angles; 9024000 steps are a turn."""
    steps = (0x800000 + round(angle / 360.0 * 9024000) for angle in (first_deg, second_deg))
    return [(b":j%d\r" % axis, b"=%s\r" % low(count)) for axis, count in enumerate(steps, start=1)]


def test_a_motor_is_asked_five_times() -> None:
    with board(*[(b":f1\r", b"")] * 4, (b":f1\r", b"=001\r")) as m:
        assert m.motors[0].status().initialised
    with board(*[(b":f1\r", b"")] * 5) as m, pytest.raises(NoAnswerError):
        m.motors[0].status()


@pytest.mark.parametrize(("steps", "again"), [(3, True), (4, False), (-3, True), (-4, False)])
def test_a_lost_start_is_said_again_where_the_motor_has_moved_three_steps_at_most(steps, again) -> None:
    at = (b":j2\r", b"=%s\r" % low(0x800000 + steps))
    order = [(b":J2\r", b""), (b":f2\r", b"=001\r"), at, *([(b":J2\r", DONE)] if again else [])]
    turn = [(b":G220\r", DONE), (b":H2640000\r", DONE), (b":M20B0000\r", DONE)]
    with board((b":j2\r", b"=000080\r"), *turn, *order) as m:
        m.motors[1].angle_deg()
        m.motors[1].turn_by(100 / 9024000 * 360.0, m.talk.stops)


@pytest.mark.parametrize(("angle", "mode"), [(0.99, b"20"), (1.01, b"00"), (-0.99, b"21"), (-1.01, b"01")])
def test_above_a_degree_a_turn_is_fast(angle, mode) -> None:
    steps = round(abs(angle) / 360.0 * 9024000)
    braking = min(steps // 10 + 1, 3500)
    with board(
        (b":G1" + mode + b"\r", DONE),
        (b":H1%s\r" % low(steps), DONE),
        (b":M1%s\r" % low(braking), DONE),
        (b":J1\r", DONE),
    ) as m:
        m.motors[0].turn_by(angle, m.talk.stops)


@pytest.mark.parametrize(("looks", "stops"), [(3, True), (4, False)])
def test_a_motor_has_three_seconds_to_stop(monkeypatch, looks, stops) -> None:
    now = [0.0]

    def monotonic():
        now[0] += 1.0
        return now[0]

    monkeypatch.setattr(motors_of, "monotonic", monotonic)
    running = [(b":f1\r", b"=011\r"), (b":K1\r", DONE), *[(b":f1\r", b"=011\r")] * looks]
    with board(*running, *([(b":f1\r", b"=001\r")] if stops else [])) as m:
        if stops:
            m.motors[0].ensure_stopped()
        else:
            with pytest.raises(NoAnswerError, match="does not stop"):
                m.motors[0].ensure_stopped()


def test_home_is_not_confirmed_while_a_motor_runs() -> None:
    for first, second in ((b"=011\r", []), (b"=001\r", [(b":f2\r", b"=011\r")])):
        with (
            pytest.raises(RefusedError, match="stop it before you confirm its home"),
            board((b":f1\r", first), *second, home=Home.NOW),
        ):
            pass


@pytest.mark.parametrize(("off_deg", "contradicts"), [(0.09, True), (0.11, False)])
@pytest.mark.parametrize(("home", "other"), [(Home.POWER_ON, (0.0, 90.0)), (Home.EQMOD, (0.0, 0.0))])
def test_counters_within_a_tenth_of_a_degree_are_those_of_a_home(home, other, off_deg, contradicts) -> None:
    at = counters(other[0] + off_deg, other[1] - off_deg)
    if contradicts:
        with pytest.raises(RefusedError, match="motor counters match the home position"), board(*at, home=home):
            pass
    else:
        with board(*at, home=home) as m:
            assert m.offset_deg == ((0.0, 0.0) if home is Home.POWER_ON else (0.0, -90.0))
    assert reads((-5.0, 7.0), (5.0 + off_deg, -7.0)) is contradicts
    assert reads((-5.0, 7.0), (5.0, -7.0 + off_deg)) is contradicts


@pytest.mark.parametrize(("off_deg", "fits"), [(14.9, True), (15.1, False)])
def test_a_solved_place_confirms_a_home_within_fifteen_degrees(off_deg, fits) -> None:
    """At home both angles are zero: at 30 and -60 deg it points to hour angle -60, declination 30."""
    with board(*counters(30.0, -60.0)) as m:
        if fits:
            assert m.offset_from_sky(-60.0, 30.0 + off_deg) == (0.0, 0.0)
        else:
            with pytest.raises(RefusedError, match="match no home position"):
                m.offset_from_sky(-60.0, 30.0 + off_deg)


@pytest.mark.parametrize(
    ("hour", "side", "allowed"),
    [
        (14.0, PierSide.WEST, True),
        (16.0, PierSide.WEST, False),
        (-14.0, PierSide.EAST, True),
        (-16.0, PierSide.EAST, False),
    ],
)
def test_the_first_axis_reaches_fifteen_degrees_beyond_the_level(hour, side, allowed) -> None:
    with board() as m:
        m.target_side = side
        ra = (m.sidereal() - hour) % 360.0
        if allowed:
            assert m.aim(ra, 20.0, 0.0) == pytest.approx(to_axes(hour, 20.0, side, False))
        else:
            with pytest.raises(RefusedError, match=r"turn to -?106°, beyond its limit: a flip is due"):
                m.aim(ra, 20.0, 0.0)


@pytest.fixture
def slews(monkeypatch):
    """A board's slews without a line: its axes, where they are sent, and how far ahead the target was looked for."""

    def begun(axes, target_axes, settles_at=None):
        with board() as m:
            pass
        now = {"axes": axes}
        sent, ahead = [], []
        m.home_confirmed = True
        monkeypatch.setattr(m, "axes", lambda: now["axes"])
        monkeypatch.setattr(m, "aim", lambda _ra, _dec, ahead_s: ahead.append(ahead_s) or target_axes)
        monkeypatch.setattr(m, "keep", lambda: None)

        class Standing:
            def __init__(self, axis):
                self.axis = axis

            def ensure_stopped(self):
                pass

            def angle_deg(self):
                return 0.0

            def halt_command(self):
                return b":K2\r", ()

            def running(self):
                return False

            def turn_by(self, angle_deg, _since):
                sent.append((self.axis, angle_deg))

            def run(self, rate, backwards, _since):
                sent.append(("track", -rate.deg_s if backwards else rate.deg_s))

        m.motors = (Standing(0), Standing(1))
        return m, now, sent, ahead

    return begun


@pytest.mark.parametrize(("seconds", "allowed"), [(1.9, True), (2.1, False)])
def test_without_a_home_it_is_moved_by_two_degrees_at_most(slews, seconds, allowed) -> None:
    m, _, sent, _ = slews((10.0, -20.0), (10.0, -20.0))
    m.home_confirmed = False
    if allowed:
        m.move(Direction.NORTH, 1.0, seconds)
        m.watchdog.disarm()
        assert sent == [(1, pytest.approx(seconds))]
    else:
        with pytest.raises(RefusedError) as caught:
            m.move(Direction.NORTH, 1.0, seconds)
        assert str(caught.value) == CONFIRM_HOME
        assert not sent


@pytest.mark.parametrize(("turn", "ahead_s"), [(30.0, 10.3), (0.11, 0.11 / 3.0 + 0.3), (0.09, 0.1), (0.0, 0.1)])
def test_a_slew_of_three_degrees_a_second_ends_where_the_sky_will_be(slews, turn, ahead_s) -> None:
    m, _, sent, ahead = slews((10.0, -20.0), (10.0 + turn, -20.0 - turn / 2.0))
    m.approach(1.0, 2.0, 0)
    assert ahead == pytest.approx([0.0, ahead_s])
    assert sent == [(0, pytest.approx(turn)), (1, pytest.approx(-turn / 2.0))]


@pytest.mark.parametrize(
    ("left_arcsec", "approaches", "again"), [(1.9, 0, False), (2.1, 0, True), (2.1, 2, True), (2.1, 3, False)]
)
def test_a_slew_is_approached_four_times_or_until_two_arcseconds_are_left(
    slews, left_arcsec, approaches, again
) -> None:
    m, _, sent, _ = slews((10.0, -20.0), (10.0, -20.0 - left_arcsec / 3600.0))
    m.target_deg, m.approaches, m.tracking = (1.0, 2.0), approaches, True
    m.finish_slew()
    assert (m.target_deg is not None) is again
    assert sent[-1] == ((1, pytest.approx(-left_arcsec / 3600.0)) if again else ("track", m.sky_rate))


def test_a_stop_while_the_motors_are_started_leaves_no_target(slews, monkeypatch) -> None:
    m, _, _, _ = slews((10.0, -20.0), (20.0, -30.0))
    monkeypatch.setattr(m, "approach", lambda *_: m.talk.stopping())
    m.goto(1.0, 2.0)
    assert (m.target_deg, m.tracking) == (None, False)
    monkeypatch.setattr(m, "approach", lambda *_: None)
    m.goto(1.0, 2.0)
    assert (m.target_deg, m.tracking) == ((1.0, 2.0), True)


@pytest.mark.parametrize(("second", "taken"), [(-4.9, True), (-5.1, False), (4.9, True), (5.1, False)])
def test_within_five_degrees_of_the_pole_a_sync_may_be_of_the_other_side(second, taken) -> None:
    """Just beyond the pole is hardly a turn on the other side, and nearly half a one on this."""
    at = counters(0.0, second)
    with board(*at, *at, home=Home.POWER_ON) as m:
        hour = 85.0 if second < 0.0 else -85.0
        beyond = (m.sidereal() - hour) % 360.0, 90.0 - abs(second)
        if taken:
            m.sync(*beyond)
            assert m.offset_deg == pytest.approx((-5.0 if second < 0.0 else 5.0, -2.0 * second), abs=1e-3)
        else:
            with pytest.raises(RefusedError, match=r"would turn the RA axis by [+-]175°"):
                m.sync(*beyond)


@pytest.mark.parametrize(
    ("turned", "seconds", "holds"),
    [
        ((0.09, 0.0), 0.0, True),
        ((0.11, 0.0), 0.0, False),
        ((-0.09, 0.0), 60.0, True),
        ((-0.11, 0.0), 60.0, False),
        ((15.09, 0.0), 3600.0, True),
        ((15.11, 0.0), 3600.0, False),
        ((0.0, 0.09), 0.0, True),
        ((0.0, -0.11), 0.0, False),
        ((5.0, 0.0), 43100.0, True),
        ((5.0, 0.0), 43300.0, False),
    ],
)
def test_kept_counters_have_turned_by_a_tenth_of_a_degree_or_with_the_sky_at_most(turned, seconds, holds) -> None:
    kept = KeptZero((1.0, 2.0), (10.0, 20.0), tracking=True, unix_s=1000.0)
    assert kept.holds((10.0 + turned[0], 20.0 + turned[1]), 15.0 / 3600.0, 1000.0 + seconds) is holds
    still = KeptZero((1.0, 2.0), (10.0, 20.0), tracking=False, unix_s=1000.0)
    assert still.holds((10.0 + turned[0], 20.0 + turned[1]), 15.0 / 3600.0, 1000.0 + seconds) is (
        max(map(abs, turned)) < 0.1
    )


# -- What is on a port ---------------------------------------------------------------------------------------


def test_a_line_that_breaks_while_it_is_asked_says_so_itself(monkeypatch) -> None:
    def lost(_talk):
        raise LineLostError("Lost the mount.")

    monkeypatch.setattr(probe, "QUESTIONS", ((9600, (lost,)),))
    lost.__name__ = "ask_lost"
    link = SimpleNamespace(close=lambda: None)
    found = run(probe.probe_port("/dev/x", lambda *_: link))
    assert (found.port, found.advice, found.found) == ("/dev/x", "Lost the mount.", False)


@pytest.mark.parametrize(
    ("name", "timeout_s", "sidereal", "deg_s"),
    [
        ("lx200", 4.5, (2, 32), (2.0, 6.0)),
        ("onstep", 4.5, (1, 8, 20, 48), ()),
        ("nexstar", 4.5, (0.5, 1, 4, 8, 16, 64), (0.5, 2.0, 4.0)),
        ("synscan", 3.0, (0.5, 1, 4, 8, 16, 64), (0.5, 2.0, 4.0)),
        ("ioptron", 4.5, (1, 2, 8, 16, 64, 128, 256, 512), ()),  # its "maximum" is not known
        ("skywatcher", 1.5, (0.5, 1, 8, 16, 64), (0.5, 1.0, 3.0)),
    ],
)
def test_the_speeds_of_a_hand_control_s_keys_and_its_patience(name, timeout_s, sidereal, deg_s) -> None:
    """So many times that of the stars, 15.041 arcsec a second, and the fastest in degrees."""
    driver = DRIVERS.load(name)
    expected = [times * 15.041067 / 3600.0 for times in sidereal] + list(deg_s)
    assert driver.rates_deg_s == pytest.approx(expected, rel=1e-6)
    assert driver.timeout_s == timeout_s


@pytest.mark.parametrize(("length", "told"), [(63, "x" * 63), (64, "below the horizon")])
def test_a_refusal_has_up_to_sixty_four_bytes(length, told) -> None:
    """After its digit, which alone is understood when there is no end to it."""
    target = [(b":Sr05:30:00#", b"1"), (b":Sd-12*15:00#", b"1"), (b":Gr#", b"05:30:00#"), (b":Gd#", b"-12*15:00#")]
    script = [*CLASSIC_START, *target, (b":MS#", b"1" + b"x" * length + b"#")]
    with transcript(Lx200, script) as m, pytest.raises(RefusedError, match=told):
        m.goto(*TARGET)


@pytest.mark.parametrize(
    ("code", "slewing", "parked", "tracking"),
    [
        (0, False, False, True),
        (1, False, False, False),
        (2, True, False, False),
        (3, True, False, False),
        (4, True, False, False),
        (5, False, True, False),
        (6, True, False, False),
        (7, False, False, False),
        (8, False, False, False),
        (10, False, False, True),
        (99, False, False, False),
    ],
)
def test_the_states_of_a_10micron(code, slewing, parked, tracking) -> None:
    state = lx200.parse_10micron(b"%d#" % code)
    assert (state.slewing, state.parked, state.tracking) == (slewing, parked, tracking)


def test_what_is_kept_is_kept_again_in_a_folder_of_its_own(tmp_path) -> None:
    folder = tmp_path / "config" / "mounts"
    with board(*counters(0.0, 0.0), home=Home.POWER_ON, kept=folder) as m:
        m.keep()
        (file,) = folder.iterdir()
        assert file.name == "script-020300-9024000-9024000.json"
        m.offset_deg = (1.5, -2.5)
        m.keep()
        assert m.recall().offset_deg == [1.5, -2.5]
        m.home_confirmed = False
        m.offset_deg = (7.0, 7.0)
        m.keep()
        assert m.recall().offset_deg == [1.5, -2.5]


@pytest.mark.parametrize(
    ("axes", "hour", "side"),
    [
        ((80.0, -40.0), -30.0, PierSide.WEST),  # hour angle -10, as usual
        ((80.0, -40.0), 30.0, PierSide.EAST),
        ((-100.0, 40.0), -30.0, PierSide.EAST),  # the same place from the other side: it stays there
        ((-100.0, 40.0), 30.0, PierSide.EAST),
        ((100.0, -40.0), 30.0, PierSide.WEST),  # followed past the meridian
        ((100.0, -40.0), -30.0, PierSide.WEST),
    ],
)
def test_a_slew_changes_the_side_of_the_pier_only_across_the_meridian(slews, axes, hour, side) -> None:
    m, _, _, _ = slews(axes, axes)
    assert m.side_for((m.sidereal() - hour) % 360.0) is side


def test_what_is_kept_at_the_end_is_where_the_motors_then_stand(tmp_path) -> None:
    with board(*counters(0.0, 0.0), *counters(12.0, -34.0), home=Home.POWER_ON, kept=tmp_path) as m:
        m.close()
        assert m.recall().counters_deg == pytest.approx([12.0, -34.0], abs=1e-4)


@pytest.mark.parametrize("version", [b"0203", b"", b"02030012"])
def test_a_version_of_another_length_is_no_motor_board(version) -> None:
    start = [(command, b"=%s\r" % version if command == b":e1\r" else reply) for command, reply in MOTORS_START[:7]]
    with pytest.raises(ProtocolError, match="version of a motor board"), board(start=start):
        pass
