"""What every simulated board has: a supply that can be cut, a belief apart from the truth, and a record of both."""

from dataclasses import dataclass
from datetime import UTC, datetime
from threading import RLock

from .mechanics import HOME_DEG, Tube, axes_deg, looks_at_deg
from .sky import LATITUDE_DEG, LONGITUDE_DEG, SIDEREAL_DEG_S, Night, altaz_deg, apart_deg, half_turn, sidereal_deg

PAST_MERIDIAN_DEG = 15.0  # it stays on its side of the pier until here
ARRIVES_DEG = 0.2


@dataclass
class Order:
    """A motion that reached the board: when, what, to which RA and Dec of date, and how wrong the board was then."""

    unix: float
    kind: str
    target_deg: tuple[float, float] | None
    from_deg: tuple[float, float]
    false_by_deg: float


class Board:
    """A mount's electronics on a :class:`~tests.boards.mechanics.Tube`.

    ``clock`` is the truth for the tube, the Sun and the sidereal time (:class:`~tests.boards.sky.Night`, or `Frozen`);
    without one it is a night ``speed`` times as fast as the computer's.
    ``keeps_clock``: a battery runs the board's clock while it has no power. ``claims_home``: it says "at home" when it
    wakes. The board's own site, longitude east, is ``site_deg``; its clock is wrong by ``clock_error_s``.
    """

    boot_s = 2.5
    wakes_at = datetime(2000, 1, 1, tzinfo=UTC)  # without a battery
    beyond_at_once = False

    def __init__(
        self, clock=None, slew_deg_s=6.0, acceleration_deg_s2=6.0, keeps_clock=False, claims_home=True, speed=1.0
    ):
        self.clock = clock or Night(speed=speed)
        self.lock = RLock()
        self.tube = Tube(self.clock, slew_deg_s, acceleration_deg_s2)
        self.keeps_clock, self.claims_home = keeps_clock, claims_home
        self.orders, self.transcript = [], []
        self.cuts = []  # (unix time, the goto, home or park that it ended)
        self.clock_error_s, self.clock_set = 0.0, True
        self.site_deg = (LATITUDE_DEG, LONGITUDE_DEG)
        self.zone_h = 0.0
        self.zero_deg = [0.0, 0.0]  # what the board counts besides the truth
        self.tracking = self.at_home = self.parked = False
        self.going = ""  # goto, home or park
        self.target_deg = [0.0, 0.0]
        self.rate_deg_s = SIDEREAL_DEG_S
        self._pulses = {}  # axis -> unix time of its end
        self._mute_until = 0.0
        self._answers = []  # (unix time when due, bytes)
        self._lost_stops = self._lost_answers = self._late_answers = 0
        self._late_s = 0.0
        self._lost_to = []
        self._buffer = b""

    # -- what a test does with it --------------------------------------------------------------------

    def align(self, hour_angle_deg, dec_deg, tracking=True):
        """Put tube and belief there, as after an honest evening's alignment; its RA and Dec of date, degrees."""
        with self.lock:
            self.tube.advance()
            places = axes_deg(hour_angle_deg, dec_deg, self._beyond(hour_angle_deg))
            for axis, place in zip(self.tube.axes, places, strict=True):
                axis.lose_power()
                axis.at_deg = place
            self.zero_deg, self.at_home, self.parked, self.going = [0.0, 0.0], False, False, ""
            self.clock_error_s, self.clock_set = 0.0, True
            self.track(tracking)
            self.tube.axes[0].rate_deg_s = self.tube.axes[0].follows_deg_s
            self.tube.sample()
            return self.tube.radec_deg()

    def cut_power(self, off_s=1.0):
        """Take its supply for ``off_s``; the port stays open. Then it boots, and wakes where it believes to be."""
        with self.lock:
            self.tube.advance()
            for axis in self.tube.axes:
                axis.lose_power()
            self.tube.sample()
            self._mute_until = self.clock.unix() + off_s + self.boot_s
            self._buffer, self._answers = b"", []
            self._pulses.clear()
            self.tracking = False
            was, self.going = self.going, ""
            self.cuts.append((self.tube.now, was))
            if not self.keeps_clock:
                self.clock_set = False
                self.clock_error_s = self.wakes_at.timestamp() - self._mute_until
            self.wake(was)

    def lose_stops(self, count=1):
        """The next Stops never reach it."""
        self._lost_stops = count

    def lose_answers(self, count=1, to=b""):
        """Its next answers never arrive; with ``to``, the answer to the next command that begins so."""
        if to:
            self._lost_to.extend([to] * count)
        else:
            self._lost_answers = count

    def delay_answers(self, count=1, seconds=2.0):
        """Its next answers come late, and all in order."""
        self._late_answers, self._late_s = count, seconds

    def nudge_by_hand(self, axis, rate_deg_s):
        """Its hand control's key, down at a rate, up at 0.0: nobody who is connected ordered it."""
        with self.lock:
            self.tube.axes[axis].by_hand_deg_s = rate_deg_s

    # -- what a test asks ----------------------------------------------------------------------------

    @property
    def powered(self):
        """Whether it is awake."""
        return self.awake_s >= 0.0

    @property
    def awake_s(self):
        """Seconds since it last woke; negative while it has no power."""
        return self.clock.unix() - self._mute_until

    @property
    def heard(self):
        """Whether it has answered anything since it last woke."""
        return any(mark == "<" and unix >= self._mute_until for unix, mark, _ in self.transcript[-200:])

    @property
    def moving(self):
        """Whether a motor does more than follow the sky: truth, not what it says."""
        with self.lock:
            self.tube.advance()
            return self.tube.runs

    def radec_deg(self):
        """Where the tube truly is, of date."""
        with self.lock:
            self.tube.advance()
            return self.tube.radec_deg()

    def believed_deg(self):
        """RA and Dec of date that the board believes, by its own clock and site."""
        with self.lock:
            hour_angle, dec = self.believed_hour_angle_dec_deg()
            return (self.sidereal_deg() - hour_angle) % 360.0, dec

    def false_by_deg(self):
        """How far the board's belief is from the truth."""
        with self.lock:
            self.tube.advance()
            return apart_deg(self.believed_deg(), self.tube.radec_deg())

    def lost_by_deg(self):
        """The same where the Dec axis stands 60 deg from here: at the pole the sky tells nothing of the other axis."""
        with self.lock:
            self.tube.advance()
            true, believed = [axis.at_deg for axis in self.tube.axes], self.believed_axes_deg()
            return max(apart_deg(*(looks_at_deg(a, b - off) for a, b in (true, believed))) for off in (0.0, 60.0))

    def lowest_deg(self, since=0.0):
        """The lowest true altitude while motors ran, since a unix time; 90 when none did."""
        return min((s.altitude_deg for s in list(self.tube.path) if s.unix >= since), default=90.0)

    def nearest_sun_deg(self, since=0.0, sun_up_deg=-10.0):
        """How near the tube truly came to a Sun that was not deep below the horizon; 180 when never."""
        seen = (s.sun_deg for s in list(self.tube.path) if s.unix >= since and s.sun_altitude_deg > sun_up_deg)
        return min(seen, default=180.0)

    def false_slews(self, beyond_deg=5.0):
        """The gotos that set out while the board was wrong about where it is."""
        return [order for order in list(self.orders) if order.kind == "goto" and order.false_by_deg > beyond_deg]

    # -- belief --------------------------------------------------------------------------------------

    def believed_unix(self):
        """Its clock."""
        return self.clock.unix() + self.clock_error_s

    def sidereal_deg(self):
        """By its clock and site."""
        return sidereal_deg(self.tube.now + self.clock_error_s, self.site_deg[1])

    def believed_axes_deg(self):
        """What its counters say."""
        return [axis.at_deg + zero for axis, zero in zip(self.tube.axes, self.zero_deg, strict=True)]

    def believed_hour_angle_dec_deg(self):
        """By its counters."""
        return looks_at_deg(*self.believed_axes_deg())

    def believed_altaz_deg(self):
        """By its counters and its site."""
        return altaz_deg(*self.believed_hour_angle_dec_deg(), self.site_deg[0])

    def target_altitude_deg(self):
        """By its clock and site."""
        return altaz_deg(self.sidereal_deg() - self.target_deg[0], self.target_deg[1], self.site_deg[0])[0]

    def beyond(self):
        """Whether it believes the tube beyond the pole, looking east."""
        return self.believed_axes_deg()[1] > 90.0

    def set_counters(self, axes_deg_):
        """From now on the axes are there."""
        self.zero_deg = [want - axis.at_deg for want, axis in zip(axes_deg_, self.tube.axes, strict=True)]

    def wake(self, was):
        """Boot after a cut during ``was``: counters at home, where the tube may not be."""
        self.set_counters(HOME_DEG)
        self.parked = False
        self.at_home = self.claims_home

    def _beyond(self, hour_angle_deg):
        return half_turn(hour_angle_deg) < 0.0

    # -- motion --------------------------------------------------------------------------------------

    def track(self, on):
        """Follow the sky or stand."""
        self.tracking = on
        self.tube.axes[0].follows_deg_s = self.rate_deg_s if on else 0.0
        self.at_home = self.at_home and not on

    def sync(self):
        """Believe to be at the target."""
        self.set_counters(self._axes_of_target(flips=self.at_home))
        if self.at_home:
            self.track(True)

    def goto(self):
        """Set out for the target."""
        self._write("goto", tuple(self.target_deg))
        wanted = self._axes_of_target(flips=True)
        self.track(True)
        self._run_to("goto", wanted)

    def go_home(self):
        """Set out for home."""
        self._write("home", None)
        self.track(False)
        self._run_to("home", HOME_DEG)

    def go_park(self, axes_deg_=HOME_DEG):
        """Set out for the park position."""
        self._write("park", None)
        self.track(False)
        self._run_to("park", axes_deg_)

    def move(self, axis, rate_deg_s):
        """Run an axis until told otherwise."""
        self._write("move", None)
        self.at_home = False
        self.going = ""
        self.tube.axes[axis].target_deg = None
        self.tube.axes[axis].by_hand_deg_s = rate_deg_s

    def pulse(self, axis, rate_deg_s, seconds):
        """Run an axis for a time."""
        self._write("pulse", None)
        self.at_home = False
        self.tube.axes[axis].by_hand_deg_s = rate_deg_s
        self._pulses[axis] = self.clock.unix() + seconds

    def stop(self, axes=(0, 1)):
        """Slow down, and follow the sky if it did."""
        self.going = ""
        for axis in axes:
            self.tube.axes[axis].stop()
            self._pulses.pop(axis, None)

    def arrived(self, what):
        """A goto, home or park came to its end."""
        self.at_home = what == "home"
        self.parked = what == "park"

    @property
    def guiding(self):
        """Whether a pulse runs."""
        return bool(self._pulses)

    @property
    def by_hand(self):
        """Whether an axis was told to run."""
        return any(axis.by_hand_deg_s for axis in self.tube.axes)

    def _run_to(self, what, wanted_deg):
        self.going, self.at_home = what, False
        for axis, zero, wanted in zip(self.tube.axes, self.zero_deg, wanted_deg, strict=True):
            axis.by_hand_deg_s = 0.0
            axis.target_deg = wanted - zero

    def _axes_of_target(self, flips):
        hour_angle = half_turn(self.sidereal_deg() - self.target_deg[0])
        beyond = self.beyond()
        past = hour_angle if beyond else -hour_angle
        if self.at_home or (flips and past > PAST_MERIDIAN_DEG):
            beyond = self._beyond(hour_angle)
        return axes_deg(hour_angle, self.target_deg[1], beyond)

    def _write(self, kind, target_deg):
        self.tube.advance()
        self.tube.sample()
        self.orders.append(Order(self.tube.now, kind, target_deg, self.tube.radec_deg(), self.false_by_deg()))

    # -- the line ------------------------------------------------------------------------------------

    def advance(self):
        """Up to now: motion, the ends of pulses, arrivals."""
        self.tube.advance()
        for axis, end in list(self._pulses.items()):
            if self.tube.now >= end:
                del self._pulses[axis]
                self.tube.axes[axis].by_hand_deg_s = 0.0
        if self.going and not self.tube.runs:
            what, self.going = self.going, ""
            self.tube.sample()
            self.arrived(what)

    def receive(self, data):
        """Bytes from the host; without power they are gone."""
        self.advance()
        self.transcript.append((self.clock.unix(), ">" if self.powered else "lost >", data))
        if not self.powered:
            self._buffer = b""
            return
        self._buffer += data
        while (cut := self.next_command(self._buffer)) is not None:
            command, self._buffer = cut
            self._obey(command)

    def due(self):
        """The answers whose time has come."""
        out = []
        while self._answers and self._answers[0][0] <= self.clock.unix() and self.powered:
            out.append(self._answers.pop(0)[1])
        self.transcript.extend((self.clock.unix(), "<", data) for data in out)
        return out

    def _obey(self, command):
        if self.is_stop(command) and self._lost_stops:
            self._lost_stops -= 1
            self.transcript.append((self.clock.unix(), "lost >", command))
            return
        answer = self.answer(command)
        if not answer:
            return
        lost = next((to for to in self._lost_to if command.startswith(to)), None)
        if lost is not None:
            self._lost_to.remove(lost)
        elif self._lost_answers:
            self._lost_answers -= 1
        else:
            late = 0.0
            if self._late_answers:
                self._late_answers -= 1
                late = self._late_s
            after = self._answers[-1][0] if self._answers else 0.0
            self._answers.append((max(after, self.clock.unix() + late), answer))

    # -- what a kind of board says -------------------------------------------------------------------

    def next_command(self, buffer):
        """The first whole command and the rest of the bytes; None while there is none."""
        raise NotImplementedError

    def is_stop(self, command):
        """Whether the command stops a motion."""
        raise NotImplementedError

    def answer(self, command):
        """Do it, and what the board says."""
        raise NotImplementedError
