"""Random evenings at simulated telescopes: 0 motions outside the limits but by another program.

``python -m tests.gear.mounts.sequences 2000`` plays so many and prints how each kind of mount fared; a seed plays
the same again. Kochab's own line, guard and driver meet a far end that was written from the protocol's document and
that INDI's own driver controls, too (:mod:`tests.simulate.test_indi`). Time is simulated: it passes where something
waits for it. At every quarter second the two mechanical axes are looked at, of which Kochab sees nothing.
"""

import argparse
import shutil
import sys
import tempfile
from collections import Counter
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from math import asin, atan2, cos, degrees, radians, sin
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import erfa
import numpy as np

from kochab.core.errors import KochabError, LineLostError, NoAnswerError
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_DEG_S, Ability, Direction, Epoch, Home, Pointing, TrackingRate
from kochab.core.progress import Progress
from kochab.gear import mount_events as events
from kochab.gear import mount_line
from kochab.gear.mounts import COUNT_STEPS, DRIVERS, emergency_stop, serial_line, slew_supervisor
from kochab.gear.mounts.coordinates import from_mount_epoch
from kochab.gear.mounts.drivers import celestron_aux, skywatcher
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits, SyncEvidence
from kochab.simulate.mechanics.geometry import MountConfig
from kochab.simulate.mechanics.mount import EquatorialMount
from kochab.simulate.night_sky import SimulatedClock
from kochab.simulate.responders import RESPONDERS
from kochab.workflows.goto_target import flip_mount
from kochab.workflows.nudge import RUNS_ON, nudge
from tests.simulate.celestron_aux import frame
from tests.simulate.dialects import DIALECT_RESPONDERS, open_any

NIGHT_UNIX = datetime(2026, 1, 15, 20, 0, tzinfo=UTC).timestamp()
LOOK_S, SELDOM_S, EXCHANGE_S, TURN_S = 0.25, 5.0, 0.02, 0.25  # seldom: while nothing but tracking moves it
SLEW_DEG_S = 12.0
FORKS = ("lx200",)
ALIGNS = ("lx200", "nexstar", "synscan")  # switched on, they say that they are not aligned
MOUNTS = (*RESPONDERS, *DIALECT_RESPONDERS)
COUNTERS = COUNT_STEPS  # which are told where home is
LOW_DEG, PAST_DEG = 5.0, 15.0
TOLERANCE_DEG = 0.6  # syncs by others are so good
OWN_WAY_DEG = 3.0  # where only the mount knows its way it is stopped at the limit, which takes a second at 12 deg/s
FALLS_DEG = 0.05  # less is no motion towards a limit
GRACE_S = 1.0  # how much longer than told a bounded motion may last


# -- Time, and what happens in it ---------------------------------------------------------------


class World:
    """Simulated time, and what is due in it."""

    def __init__(self, unix_s):
        self.clock = SimulatedClock(unix_s, 0.0)
        self.due = []
        self.look = lambda: None
        self._inside = False

    def now(self):
        return self.clock.now_unix()

    def now_utc(self):
        return self.clock.now_utc()

    def at(self, seconds, do):
        """``do`` in so many seconds."""
        entry = [self.now() + seconds, do]
        self.due.append(entry)
        return entry

    def pass_time(self, seconds):
        end = self.now() + max(0.0, seconds)
        while True:
            first = min((entry[0] for entry in self.due), default=end)
            step = min(end, first, self.now() + LOOK_S) - self.now()
            if step > 0.0:
                self.clock.step(step)
                self.look()
            ready = [entry for entry in self.due if entry[0] <= self.now() + 1e-9]
            for entry in ready:
                if entry in self.due:
                    self.due.remove(entry)
                    entry[1]()
            if not ready and self.now() >= end - 1e-9:
                return

    def timer(self, seconds, function, args=()):
        """In place of `threading.Timer`: it runs where the time passes."""
        entry = []

        def start():
            entry.append(self.at(seconds, lambda: function(*args)))

        def cancel():
            self.due = [one for one in self.due if one not in entry]

        return SimpleNamespace(start=start, cancel=cancel, daemon=False)


class Wire:
    """The line: bytes go over at once, answers take their time. Stands for a `SerialLink`."""

    port, lossy = "line", False

    def __init__(self, world, answer):
        self.world, self.answer = world, answer
        self.buffer, self.cut, self.closed, self.asked = bytearray(), False, False, False

    def write(self, data):
        self._check()
        self.asked = True
        self.buffer += self.answer(data)

    def read_exact(self, count, timeout_s):
        return self._read(lambda: count if len(self.buffer) >= count else 0, timeout_s)

    def read_until(self, terminator, limit, timeout_s):
        return self._read(
            lambda: self.buffer.find(terminator) + len(terminator) if terminator in self.buffer else 0, timeout_s
        )

    def discard(self, quiet_s=0.0):
        self._check()
        self.world.pass_time(quiet_s)
        stale, self.buffer = bytes(self.buffer), bytearray()
        return stale

    def close(self):
        self.closed = True

    def _read(self, complete, timeout_s):
        self.world.pass_time(EXCHANGE_S * self.asked)
        self.asked = False
        if not complete():
            self.world.pass_time(timeout_s)
        self._check()
        if not complete():
            raise NoAnswerError("The device on line did not answer.")
        count = complete()
        taken, self.buffer = bytes(self.buffer[:count]), self.buffer[count:]
        return taken

    def _check(self):
        if self.cut or self.closed:
            raise LineLostError("Lost the mount on line. Check its cable and power.")


class Inline:
    """In place of `threading.Thread`: the work is done where it is started."""

    def __init__(self, target, args=(), **_):
        self.start = lambda: target(*args)
        self.join = lambda _: None


@contextmanager
def simulated_time(world):
    with ExitStack() as patched:
        for module in (slew_supervisor, emergency_stop, skywatcher, celestron_aux, serial_line, mount_line):
            patched.enter_context(patch.object(module, "monotonic", world.now))
        for module in (serial_line, mount_line, celestron_aux):
            patched.enter_context(patch.object(module, "sleep", world.pass_time))
        patched.enter_context(patch.object(emergency_stop, "Timer", world.timer))
        patched.enter_context(patch.object(mount_line, "threading", SimpleNamespace(Thread=Inline)))
        patched.enter_context(patch.object(mount_line, "LISTEN_S", 0.0))
        yield


# -- The telescope, and who has moved it ----------------------------------------------------------


class Telescope(EquatorialMount):
    """Remembers who moved it last, how, and for how long it was told to."""

    who, mover, until = "hands", "hands", None

    def __init__(self, config, site, clock):
        self._epoch = None
        super().__init__(config, site, clock)
        self.orders = []

    def sidereal_deg(self, t=None):
        """The same, from one look at ERFA."""
        at = self.clock.now_unix() if t is None else t
        if self._epoch is None:
            jd = 2440587.5 + at / 86400.0
            self._epoch = at, np.degrees(erfa.gst06a(jd, 0.0, jd, 69.184 / 86400.0)) + self.site.longitude_deg
        begun, then = self._epoch
        return float((then + (at - begun) * SIDEREAL_DEG_S) % 360.0)

    def _note(self, kind, *given):
        self.orders.append((self.clock.now_unix(), self.who, kind, given))
        self.mover = self.who

    def goto(self, ra_deg, dec_deg):
        refused = super().goto(ra_deg, dec_deg)
        if refused is None:
            self._note("goto", ra_deg, dec_deg)
        return refused

    def go_home(self):
        self._note("home")
        return super().go_home()

    def move(self, direction, rate_deg_s):
        self._note("move", direction, rate_deg_s)
        super().move(direction, rate_deg_s)

    def pulse(self, direction, milliseconds):
        if not self.slewing:  # else it is not heeded
            self._note("pulse", direction, milliseconds)
        super().pulse(direction, milliseconds)

    def turn_axis(self, axis, rate_deg_s):
        if rate_deg_s and not (axis == 0 and abs(rate_deg_s) < 2.0 * SIDEREAL_DEG_S):
            self._note("turn", axis, rate_deg_s)
        super().turn_axis(axis, rate_deg_s)

    def turn_axis_to(self, axis, angle_deg):
        self._note("turn to", axis, angle_deg)
        super().turn_axis_to(axis, angle_deg)

    def true_place(self):
        """See :func:`place_of_axes`."""
        return place_of_axes(*self.true_axes_deg(self.clock.now_unix()))

    def rates_deg_s(self):
        t = self.clock.now_unix()
        return tuple(axis.motor_rate_deg_s(t) for axis in self._axes)

    def power_off(self):
        """Everything stands, and its computer takes that for home when it is switched on again."""
        t = self.clock.now_unix()
        true = self.true_axes_deg(t)
        for axis, home, here in zip(self._axes, self._home_deg, true, strict=True):
            axis.place(t, home)
            axis.displace(t, here - home)
        self._carrier_deg_s, self._parks_at, self._parked = 0.0, None, False
        self._offset_deg = 0.0, 0.0

    def align(self):
        """Its computer knows where the tube points, and on which side of the pier."""
        t = self.clock.now_unix()
        for axis, angle, rate in zip(self._axes, self.true_axes_deg(t), self.rates_deg_s(), strict=True):
            axis.place(t, angle)
            axis.run(t, rate, gently=False)
        self._offset_deg = 0.0, 0.0

    def carry_home(self):
        """Somebody opens the clutches, and puts the tube at the pole with the weights below."""
        true = self.true_axes_deg(self.clock.now_unix())
        self.turn_by_hand(*(home - here for home, here in zip(self._home_deg, true, strict=True)))


def place_of_axes(first_deg, second_deg):
    """Hour angle in [-180, 180) and declination of the tube, degrees, and how far the weights are from below.

    The axes are the hour angle and the declination of a tube east of its pier; home is 90, 90.
    """
    hour, dec = radians(first_deg), radians(second_deg)
    x, y, z = cos(dec) * cos(hour), -cos(dec) * sin(hour), sin(dec)
    return degrees(atan2(-y, x)), degrees(asin(max(-1.0, min(1.0, z)))), abs(first_deg - 90.0)


def altitude_deg(hour_deg, dec_deg, latitude_deg):
    """Of a place, without air."""
    h, d, p = radians(hour_deg), radians(dec_deg), radians(latitude_deg)
    return degrees(asin(max(-1.0, min(1.0, sin(p) * sin(d) + cos(p) * cos(d) * cos(h)))))


# -- One evening --------------------------------------------------------------------------------

Step = tuple[str, tuple[float, ...]]
CHANCES = {
    "connect": 4,
    "disconnect": 1,
    "kill": 2,
    "unplug": 2,
    "mute": 1,
    "power": 2,
    "other": 4,
    "sync": 3,
    "goto": 7,
    "flip": 2,
    "nudge": 4,
    "pulse": 2,
    "track": 2,
    "park": 1,
    "home": 1,
    "unpark": 1,
    "stop": 3,
    "wait": 3,
    "long wait": 1,
}
STEPS = 14
WHILE = ("stop", "kill", "unplug", "mute", "power")  # what may come in the middle of another step


def ordered(name, do, guard):
    """The task of an order: what ``do`` asks of the guard, which may be done at once."""
    yield Progress(name)
    task = do(guard)
    if task is not None:
        yield from task


@dataclass
class Plan:
    """The steps drawn from a seed; none depends on the outcome of the steps before."""

    seed: int
    driver: str
    latitude_deg: float
    flips: bool
    steps: list[Step] = field(default_factory=list)


def planned(seed):
    rng = np.random.default_rng([seed, 14])
    driver = MOUNTS[seed % len(MOUNTS)]
    plan = Plan(seed, driver, float(rng.choice([50.0, 35.0, 60.0, -33.0])), bool(rng.random() < 0.5))
    names, weights = list(CHANCES), np.array(list(CHANCES.values()), dtype=float)
    plan.steps.append(("connect", tuple(rng.random(6).tolist())))
    plan.steps += [
        (str(rng.choice(names, p=weights / weights.sum())), tuple(rng.random(6).tolist())) for _ in range(STEPS)
    ]
    return plan


class Evening:
    """A telescope, whoever uses it, and Kochab, whose line is stepped as the window's thread does."""

    def __init__(self, plan, kept):
        self.plan, self.kept = plan, kept
        self.world = world = World(NIGHT_UNIX)
        self.site = Site(plan.latitude_deg, 8.0)
        config = MountConfig(slew_deg_s=SLEW_DEG_S, acceleration_deg_s2=12.0, german=plan.driver not in FORKS)
        self.telescope = Telescope(config, self.site, world.clock)
        self.telescope.aligned = plan.driver not in ALIGNS
        self.far_end = open_any(plan.driver, self.telescope)
        self.violations, self.counts = [], Counter()
        self.wire = self.line = self.running = self.guard = None
        self.plugged, self.mute_until = True, 0.0
        self.lies, self.fresh = False, True  # about where it points; as it was switched on, at home
        self.asked = self.killed = False  # an order of ours is under way; our process is to end in it
        self.stopped_at = None  # a Stop of ours was seen to work
        self.tells_side = False  # else nothing tells that there is a pier
        self.lasts = None  # how long the order of ours may move it
        self.told_until = None  # when the bounded motion that we ordered is over
        self.healthy_since = world.now()
        self.number = self.moving = 0  # of our present order, and of the one that moved the mount last
        self.tracks_since = np.inf
        self.told_to_run_on = set()  # numbers of moves that, as Kochab has said, would
        self.cut_off = False  # since the last order of ours our bytes did not reach the mount
        self.step = ("begin", ())
        self._before, self._tracked, self.looked, self.fast = self._altitude(), -90.0, 0.0, False
        world.look = self.look

    # what is true

    def _altitude(self):
        hour, dec, weights = self.telescope.true_place()
        return altitude_deg(hour, dec, self.site.latitude_deg), weights

    def true_deg(self):
        """RA and Dec of date."""
        hour, dec, _ = self.telescope.true_place()
        return (self.telescope.sidereal_deg() - hour) % 360.0, dec

    def look(self):
        telescope, now = self.telescope, self.world.now()
        ra_rate, dec_rate = telescope.rates_deg_s()
        fast = abs(ra_rate) > 2.0 * SIDEREAL_DEG_S or abs(dec_rate) > 0.5 * SIDEREAL_DEG_S
        if not fast and now < self.looked + SELDOM_S:
            return
        self.looked, was_fast, self.fast = now, self.fast, fast
        altitude, weights = self._altitude()
        if not was_fast:
            self._before = altitude, weights
        was_high, was_out = self._before  # when this motion began
        ours = telescope.mover == "kochab"
        if ours and fast and was_fast:
            self.counts["looks at a motion of ours"] += 1
            beyond_deg = OWN_WAY_DEG if telescope.orders[-1][2] == "home" else TOLERANCE_DEG
            low = altitude < LOW_DEG - beyond_deg and altitude < was_high - FALLS_DEG
            out = (
                telescope.config.german
                and self.tells_side
                and weights > 90.0 + PAST_DEG + TOLERANCE_DEG
                and weights > was_out + FALLS_DEG
                and abs(ra_rate) > 2.0 * SIDEREAL_DEG_S
            )
            if (low or out) and self.cut_off and self.moving in self.told_to_run_on:
                telescope.mover = "runaway"
            elif low or out:
                what = f"{altitude:.1f} deg high" if low else f"the weights {weights:.1f} deg from below"
                self.found("while it lies about where it points, " * self.lies + what, lies=self.lies)
            if self.told_until is not None and now > self.told_until + GRACE_S:
                if self.cut_off and self.moving in self.told_to_run_on:
                    self.counts["moves of a chosen rate that went on when all was lost, as told"] += 1
                    telescope.mover = "runaway"
                else:
                    self.found(f"a motion {now - self.told_until:.1f} s longer than told")
                self.told_until = None
        if self.stopped_at is not None and fast and ours and now > self.stopped_at:
            self.found("it moves after a Stop that was seen")
            self.stopped_at = None
        tracks = not fast and not was_fast and abs(ra_rate) > 0.5 * SIDEREAL_DEG_S
        self.tracks_since = min(self.tracks_since, now) if tracks else np.inf
        if (
            now > self.tracks_since + 2.0 * mount_line.WATCH_S
            and self._may_hold(now)
            and altitude < min(LOW_DEG - TOLERANCE_DEG, self._tracked - 1e-6)
        ):
            self.found(f"it tracks at {altitude:.1f} deg")
        self._tracked = altitude

    def _may_hold(self, now):
        """Whether Kochab watches the tracking, and has had the time to stop it."""
        if self.guard is None or not self.plugged or now < self.mute_until or self.lies:
            self.healthy_since = now
            return False
        return now > self.healthy_since + 30.0 and Ability.TRACKING not in self.guard.lacks

    def found(self, sentence, lies=False):
        if lies:
            self.counts["motions of a mount that lies about where it points"] += 1
            return
        self.violations.append(f"{self.world.now() - NIGHT_UNIX:.1f} s, {self.step[0]}: {sentence}")
        self.telescope.mover = "found"  # once

    # Kochab

    def answer(self, wire, data):
        if wire is not self.wire or self.world.now() < self.mute_until or not self.plugged:
            self.cut_off = True
            return b""
        before = len(self.telescope.orders)
        with self.acting("kochab"):
            reply = self.far_end.feed(data)
        for at, _, kind, given in self.telescope.orders[before:]:
            self.stopped_at, self.cut_off, self.fast, self.moving = None, False, False, self.number
            self.told_until = at + self.lasts + 2.0 if self.lasts is not None and kind in ("move", "turn") else None
            self.counts["orders of ours"] += 1
            if not self.asked:
                self.found(f"{kind} {given} that nobody asked for")
        return reply

    @contextmanager
    def acting(self, who):
        before, self.telescope.who = self.telescope.who, who
        try:
            yield
        finally:
            self.telescope.who = before

    def opened(self, stop_first=False, home=None):
        if not self.plugged:
            raise LineLostError("No port line.")
        driver = DRIVERS.load(self.plan.driver)
        self.wire = wire = Wire(self.world, lambda data: self.answer(wire, data))
        if stop_first:
            wire.write(driver.blind_stop)
            wire.discard(0.5)
        more = {"home": home} if self.plan.driver in COUNTERS else {}
        return driver(wire, site=self.site, clock=self.world.now_utc, kept=self.kept, **more)

    def connect(self):
        home = Home.NOW if self._at_home() else None

        def opening():
            self.guard = Guard(
                self.opened(home=home),
                self.site,
                Limits(allow_flip=self.plan.flips, crosses_meridian=self.plan.driver in FORKS),
                clock=self.world.now_utc,
                reopen=lambda: self.opened(stop_first=True),
                wait=self.world.pass_time,
            )
            return self.guard

        self.line = mount_line.MountLine(opening, self.tell)
        self.running = self.line.run()
        self.turn(1.0)

    def tell(self, event):
        self.counts[type(event).__name__] += 1
        if isinstance(event, events.PositionReport):
            self.tells_side |= event.state.pier_side is not None
        if isinstance(event, events.StandsStill):
            self.stopped_at = self.world.now()
        if isinstance(event, events.OrderProgress):
            self.told_to_run_on |= {self.number} if RUNS_ON in event.progress.detail else set()
        if isinstance(event, (events.OrderDone, events.OrderFailed)):
            self.asked = False

    def turn(self, seconds):
        """Let so much time pass, and Kochab do its work."""
        end = self.world.now() + seconds
        while self.world.now() < end:
            if self.running is None:
                self.world.pass_time(end - self.world.now())
                return
            running = self.running
            try:
                progress = next(running)
            except StopIteration:
                self.gone()
            except (KochabError, Killed) as error:
                self.counts["ended: " + type(error).__name__] += 1
                self.kill() if self.killed else self.gone()
            else:
                if progress.stage in ("listening", "line lost"):
                    self.world.pass_time(TURN_S)

    def gone(self):
        self.line = self.running = self.guard = None

    def disconnect(self):
        if self.running is not None:
            self.running.close()
        self.gone()

    def kill(self):
        """As by ``kill -9``: nothing more is sent, kept or timed."""
        running, self.running = self.running, None
        self.cut_off = True
        if self.wire is not None:
            self.wire.closed = True
        if self.guard is not None and self.plan.driver in COUNTERS:
            self.guard.mount.kept = None
        self.world.due = []
        self.gone()
        self.asked = False
        with suppress(KochabError, RuntimeError):
            if running is not None:
                running.close()

    def order(self, name, do, lasts=None):
        """Ask for something, and wait for its end; ``lasts``: it is bounded by that many seconds."""
        self.do_connect()
        if self.line is None:
            return
        self.asked, self.lasts, self.number = True, lasts, self.number + 1
        self.line.order(name, partial(ordered, name, do))
        self.counts[name] += 1
        end = self.world.now() + 400.0
        self.killed = False
        while self.asked and self.running is not None and self.world.now() < end:
            self.turn(TURN_S)
        self.asked = self.killed = False
        self.turn(0.0 if lasts is None else 3.0)

    # the steps

    def play(self):
        for k, (name, numbers) in enumerate(self.plan.steps):
            self.step = (f"step {k}, {name}", numbers)
            getattr(self, "do_" + name.replace(" ", "_"))(*numbers)
        self.turn(20.0)
        self.disconnect()
        self.world.pass_time(60.0)

    def _at_home(self):
        axes = self.telescope.true_axes_deg(self.world.now())
        home = self.telescope._home_deg
        return all(abs(a - h) < 1.0 for a, h in zip(axes, home, strict=True)) and not any(self.telescope.rates_deg_s())

    def _meanwhile(self, a, b):
        """In a third of the motions something else comes in between."""
        if a < 1.0 / 3.0:
            name = WHILE[int(a * 3.0 * len(WHILE))]
            self.world.at(0.5 + 10.0 * b, lambda: self.interrupt(name, b))

    def interrupt(self, name, b):
        match name:
            case "stop" if self.line is not None:
                self.line.stop()
            case "unplug":
                self.unplug(5.0 + 20.0 * b)
            case "mute":
                self.mute_until = self.world.now() + 3.0 + 20.0 * b
            case "power":
                self.power(b < 0.5)
            case "kill":
                self.killed = True

    def unplug(self, seconds):
        self.plugged, self.cut_off = False, True
        if self.wire is not None:
            self.wire.cut = True
        self.world.at(seconds, self.plug)

    def plug(self):
        self.plugged = True

    def power(self, carried):
        telescope = self.telescope
        if self.plan.driver == "skywatcher":
            for one in self.far_end.motors:
                one.stop()
                one.initialised = False
        telescope.power_off()
        if carried:
            telescope.carry_home()
        if self.plan.driver == "skywatcher":
            for one in self.far_end.motors:
                one.set_steps(0x800000)
        if self.plan.driver == "celestronaux":
            self.far_end.power_on()
        telescope.aligned = self.plan.driver not in ALIGNS
        telescope.mover, self.told_until, self.stopped_at = "hands", None, None
        self.lies = self.plan.driver not in COUNTERS and not self._at_home()
        self.counts["power cycles"] += 1

    def do_connect(self, *_):
        if self.line is None:
            self.align()
            self.connect()

    def align(self):
        """What a hand control asks for when it was switched on."""
        if not self.telescope.aligned:
            self.telescope.align()
            self.telescope.aligned, self.lies = True, False

    def do_disconnect(self, *_):
        self.disconnect()

    def do_kill(self, *_):
        self.kill()
        self.world.pass_time(5.0)

    def do_unplug(self, a, *_):
        self.unplug(5.0 + 60.0 * a)
        self.turn(10.0 + 60.0 * a)

    def do_mute(self, a, *_):
        self.mute_until = self.world.now() + 3.0 + 20.0 * a
        self.turn(5.0 + 20.0 * a)

    def do_power(self, a, b, *_):
        if b < 0.5:
            self.unplug(4.0)
        self.power(a < 0.5)
        self.turn(6.0)

    def hand_sync(self, a, b):
        ra, dec = self.true_deg()
        if abs(dec) > 80.0 or self.lies:  # people sync on a star that they see, and far from the pole
            return
        with self.acting("hands"):
            self.telescope.sync(ra + 0.2 * (a - 0.5), dec + 0.2 * (b - 0.5))

    def do_other(self, a, b, c, d, *_):
        """A hand control at any time, another program where Kochab does not hold the line."""
        if self.plan.driver == "skywatcher":
            if self.line is None:
                self.eqmod(a, b, c)
            return
        if self.plan.driver == "celestronaux":
            self.hand_control(a, b, c)
            return
        telescope = self.telescope
        with self.acting("other"):
            if a < 0.4:
                telescope.goto(*self._somewhere(b, c))
            elif a < 0.6:
                self.hand_sync(b, c)
            elif a < 0.8:
                direction = list(Direction)[int(4 * b)]
                telescope.move(direction, 4.0)
                self.world.at(10.0 * c, lambda: telescope.halt(direction))
            else:
                telescope.tracking = not telescope.tracking
        self.turn(20.0 * d)

    def eqmod(self, a, b, c):
        """Its first words to a board that was switched on at home, and motions of either motor."""
        telescope = self.telescope
        with self.acting("other"):
            if not self.far_end.motors[0].initialised and self._at_home():
                self.far_end.feed(b":F1\r:F2\r:E1000080\r:E2806CA2\r")
            elif a < 0.7 and self.far_end.motors[0].initialised:
                for axis, part in (b"1", b), (b"2", c):
                    steps = int(abs(part - 0.5) * 100.0 / 360.0 * 9024000) + 1
                    way = b"0" if part > 0.5 else b"1"
                    self.far_end.feed(b":K%s\r" % axis)
                    self.world.pass_time(2.0)
                    self.far_end.feed(
                        b":G%s0%s\r:H%s%s\r:J%s\r"
                        % (axis, way, axis, steps.to_bytes(3, "little").hex().upper().encode(), axis)
                    )
                self.world.pass_time(15.0)
        assert telescope.who == "hands"

    def hand_control(self, a, b, c):
        """On the same bus, at any time: a goto of a motor, or a key that is held for a while."""
        board = 0x10 + (a < 0.5)
        with self.acting("other"):
            if b < 0.5:
                count = int((c - 0.5) * 160.0 / 360.0 * (1 << 24)) % (1 << 24)
                self.far_end.reply(frame(0x0D, board, 0x02, count.to_bytes(3, "big")))
            else:
                self.far_end.reply(frame(0x0D, board, 0x24 + (c < 0.5), bytes([1 + int(16 * (b - 0.5))])))
                self.world.at(10.0 * c, lambda: self.far_end.reply(frame(0x0D, board, 0x24, bytes([0]))))
        self.turn(20.0 * a)

    def _somewhere(self, b, c):
        """RA and Dec that is up."""
        hour, sine = 180.0 * (b - 0.5), -0.3 + 1.25 * c
        dec = float(np.degrees(np.arcsin(np.clip(sine, -0.99, 0.99)))) * np.sign(self.site.latitude_deg)
        return (self.telescope.sidereal_deg() - hour) % 360.0, float(dec)

    def _own(self, guard, place):
        return guard.to_mount(*from_mount_epoch(Pointing(*place, Epoch.DATE), self.world.now_utc()))

    def do_sync(self, a, b, *_):
        self.align()

        def do(guard):
            ra, dec = self.true_deg()
            place = ra, dec - np.sign(dec) * (2.0 + 8.0 * a) / 3600.0  # a solve is so good
            solved = from_mount_epoch(Pointing(*place, Epoch.DATE), self.world.now_utc())
            seen = SyncEvidence((solved, solved), (0.3, 0.3), (-20.0, -20.0))
            guard.allow_large_sync = a < 0.2
            guard.sync(*self._own(guard, place), seen, by_hand=b < 0.3, confirmed=True)
            self.lies = False

        self.order("sync", do)

    def do_goto(self, a, b, c, d, *_):
        self._meanwhile(c, d)
        hour, sine = 300.0 * (a - 0.5), -0.5 + 1.5 * b
        dec = float(np.degrees(np.arcsin(sine))) * np.sign(self.site.latitude_deg)
        self._goto((self.telescope.sidereal_deg() - hour) % 360.0, dec)

    def _goto(self, ra, dec):
        def do(guard):
            return self._killable(guard.slew(*self._own(guard, (ra, dec))))

        self.order("goto", do)

    def _killable(self, task):
        """Steps of an order until our process is killed in it."""
        while True:
            try:
                progress = next(task)
            except StopIteration:
                return
            if self.killed:
                self.wire.closed = True
                with suppress(KochabError):
                    task.close()
                raise Killed
            yield progress

    def do_flip(self, a, b, *_):
        """Flip as asked by a person who has checked that the way is clear."""
        self._meanwhile(a, b)
        self.order("flip", lambda guard: self._killable(flip_mount(guard)))

    def do_nudge(self, a, b, c, d, e, f):
        """By an angle, as the arrows of the window do; in a third at a rate that a person has chosen."""
        direction, rate = list(Direction)[int(4 * a)], float([0.02, 0.1, 0.5, 2.0, 4.0][int(5 * b)]) * (f < 1.0 / 3.0)
        seconds = 0.2 + (30.0 if c > 0.8 else 5.0) * c
        arcsec = 3600.0 * (rate * seconds if rate else 10.0 ** (4.0 * c - 3.0))
        self._meanwhile(d, e)

        def do(guard):
            return self._killable(nudge(guard, direction, arcsec, self.world.pass_time, rate))

        self.order("nudge", do, 4.0 * seconds if rate else 60.0)

    def do_pulse(self, a, b, *_):
        milliseconds = int(50 + 4000 * b)
        self.order("pulse", lambda guard: guard.pulse(list(Direction)[int(4 * a)], milliseconds), milliseconds / 1000.0)

    def do_track(self, a, *_):
        rate = list(TrackingRate)[int(5 * a)] if a < 0.6 else TrackingRate.SIDEREAL
        self.order("track", lambda guard: guard.track(rate))

    def do_park(self, a, b, *_):
        self._meanwhile(a, b)
        self.order("park", lambda guard: self._killable(guard.rest("park")))

    def do_home(self, a, b, *_):
        self._meanwhile(a, b)
        self.order("home", lambda guard: self._killable(guard.rest("home")))

    def do_unpark(self, *_):
        self.order("unpark", lambda guard: guard.unpark())

    def do_stop(self, *_):
        if self.line is not None:
            self.line.stop()
            self.turn(6.0)

    def do_wait(self, a, *_):
        self.turn(2.0 + 20.0 * a)

    def do_long_wait(self, a, *_):
        """Hours of tracking, looked at twice a minute."""
        for _ in range(int(240 * a)):
            self.world.pass_time(29.0)
            self.turn(1.0)


class Killed(Exception):  # noqa: N818
    """Our process is no more."""


def play(plan):
    """One evening; what went against the rules."""
    folder = Path(tempfile.mkdtemp(prefix="kochab-sequences-"))
    evening = Evening(plan, folder)
    try:
        with simulated_time(evening.world):
            evening.play()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return evening


def main() -> int:
    """Play so many evenings and tell how each kind of mount fared; 1 when a rule was broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int, nargs="?", default=2000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--show", action="store_true")
    given = parser.parse_args()
    rows = {name: Counter() for name in MOUNTS}
    for seed in range(given.first, given.first + given.count):
        plan = planned(seed)
        evening = play(plan)
        rows[plan.driver] += evening.counts
        if seed % 100 == 99:
            print(f"{seed + 1 - given.first} of {given.count}", file=sys.stderr, flush=True)
        rows[plan.driver]["evenings"] += 1
        rows[plan.driver]["violations"] += len(evening.violations)
        if evening.violations or given.show:
            print(
                seed,
                plan.driver,
                plan.latitude_deg,
                "flips" if plan.flips else "stays",
                *evening.violations,
                sep="\n    ",
            )
    for name, row in rows.items():
        print(name, dict(row))
    return int(any(row["violations"] for row in rows.values()))


if __name__ == "__main__":
    sys.exit(main())
