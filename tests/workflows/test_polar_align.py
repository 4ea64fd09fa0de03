"""The whole alignment on the practice rig: by the mount, by hand, and when things go wrong."""

from dataclasses import fields, replace
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest

from kochab.core.errors import RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Direction, Epoch, MountState, Pointing
from kochab.core.progress import Progress, run
from kochab.core.solution import NoSolution, Reason
from kochab.gear.adjusters import AdjusterAxis
from kochab.lab.bench import polar_rig
from kochab.lab.bench.polar_rig import ALIGN, RigSky, follow, make_rig
from kochab.polar.bolts import Base
from kochab.polar.measure import MeasureSettings, PolarFinding, PolarFindingKind, measure_local
from kochab.polar.plan import Optics, best_path, sweep_path
from kochab.polar.sighting import Sighting, to_local
from kochab.polar.tutor import BoltTutor, TutorStep
from kochab.simulate.camera import CameraConfig
from kochab.simulate.mechanics.geometry import Build, MountConfig
from kochab.simulate.rig import PracticeRig, RigConfig
from kochab.sky import open_catalogue
from kochab.sky.horizon import Refraction
from kochab.workflows.polar.align import AdjustingEnd, AdjustmentGuide, AlignOptions, _agree, adjust, align, good
from kochab.workflows.polar.measure import (
    MOST_POINTS,
    HandTurner,
    MountTurner,
    Sweep,
    foreseen_arcsec,
    measure_axis,
    measure_drifting,
    plan_path,
)
from kochab.workflows.polar.sources import NotMeasuredError, turned_deg
from kochab.workflows.polar.update import PolarButton, PolarControls, PolarUpdate
from kochab.workflows.session.alignment import AlignmentRequest, FrameSource, _tutor, options_of
from tests.polar.test_tutor import error_at
from tests.workflows.rig_mount import Bench


def rig(seed=1, hour=-40.0, dec=50.0, latitude=45.0):
    sky = make_rig(np.random.default_rng([1, seed]), latitude)
    sky.point(hour, dec)
    return sky


@pytest.mark.parametrize("latitude", [-40.0, 45.0])
def test_measure_adjust_measure_again_ends_at_the_pole(latitude):
    sky = rig(latitude=latitude, dec=np.sign(latitude) * 50.0)
    done = follow(sky)
    assert done.good
    assert sky.true_total_arcsec() < 30.0
    assert done.moves <= 5
    kinds = [entry.kind for entry in done.history.entries]
    assert kinds[0] == kinds[-1] == "measured"
    assert {"live", "instruction"} <= set(kinds)


def test_by_hand_each_place_is_seen_four_times_until_something_moves(monkeypatch):
    sky = rig()
    sky.by_hand = True
    told = []
    found = run(measure_axis(sky, sky, sky.settings, Sweep(turn_deg=60.0, frames=2, most_frames=2)), told.append)
    assert len(found.measurement.attitudes) == 2
    assert [t.detail for t in told if t.detail.endswith("here.")] == [f"Frame {n} of 4 here." for n in (2, 3, 4)] * 2
    assert PolarFindingKind.UNCHECKED in {f.kind for f in found.findings}, "however often: they show no slip"
    look, seen = RigSky.look, []

    def bumped(sky):
        seen.append(sky)
        if len(seen) == 4:
            sky.rig.mount.turn_by_hand(0.5)
        return look(sky)

    monkeypatch.setattr(RigSky, "look", bumped)
    task = measure_axis(sky, sky, sky.settings, Sweep(turn_deg=60.0, frames=2, most_frames=2))
    assert "Frame 4 of 4 here." not in [next(task).detail for _ in range(9)]


@pytest.mark.parametrize("slipped_deg", [0.0, 0.05])
def test_by_hand_one_turn_confirms_what_was_read_at_the_bolts(monkeypatch, slipped_deg):
    """Two frames alone can't show that declination slipped: where they disagree, more are asked for.

    The tutor goes to 5 arcsec here: with the usual 15 it may stop where three sigmas of the last sweep are beyond the
    goal, and then one turn can't confirm anything, whatever was read.
    """
    turns, turn = [], RigSky.turn
    monkeypatch.setattr(polar_rig, "BoltTutor", lambda: BoltTutor(goal_arcsec=5.0))

    def counted(sky, direction, degrees):
        turns.append(degrees)
        if len(turns) == 3:
            sky.rig.mount.turn_by_hand(0.0, slipped_deg)
        return turn(sky, direction, degrees)

    monkeypatch.setattr(RigSky, "turn", counted)
    sky = rig(seed=2)
    sky.by_hand = True
    done = follow(sky, options_of(AlignmentRequest(FrameSource.CAMERA)))
    assert done.good
    assert sky.true_total_arcsec() < 30.0
    assert (len(turns) == 3) is (slipped_deg == 0.0), "there and back, and there once more after the bolts"
    if not slipped_deg:  # two sweeps, opposite ways, that agree show what two frames can't
        assert PolarFindingKind.UNCHECKED not in {f.kind for f in done.last.findings}
        assert done.last.error.creep_total_arcsec < 10.0


def test_what_was_read_and_what_is_measured_agree_within_their_sigmas():
    def read(error, *findings):
        return SimpleNamespace(error=error, findings=findings)

    assert _agree(read(error_at(6.0, 0.0)), error_at(-2.0, 0.0))  # of 2.8
    assert not _agree(read(error_at(6.0, 0.0)), error_at(-6.0, 0.0))
    slipped = PolarFinding(PolarFindingKind.DEC_MOVED, "", spoils=True)
    assert not _agree(read(error_at(6.0, 0.0), slipped), error_at(6.0, 0.0))


def test_without_a_thread_nobody_is_asked_for_half_an_arcminute():
    wish = AlignmentRequest(FrameSource.CAMERA)
    for base, adjusters, wished, goal in (
        (Base.BOLTS, "", 30.0, 30.0),
        (Base.WEDGE, "", 30.0, 30.0),
        (Base.HEAD, "", 30.0, 240.0),
        (Base.PLATFORM, "", 30.0, 240.0),
        (Base.HEAD, "", 600.0, 600.0),
        (Base.HEAD, "/dev/ttyUSB0", 30.0, 30.0),
    ):
        asked = replace(wish, base=base, adjusters=adjusters, goal_arcsec=wished)
        assert options_of(asked).goal_arcsec == goal
        assert _tutor(asked, Site(47.0, 8.0)).goal_arcsec == goal / 2.0


def test_what_is_likely_good_is_measured_again_before_a_bolt_is_touched():
    """18 arcsec off on the sky: one sweep of 5 cannot promise 30, two together can."""
    sky = rig(seed=3)
    config = replace(sky.rig.config.mount, misalignment_arcmin=(0.0, 18.0 / 60.0 * np.sqrt(2.0)))
    sky.rig = PracticeRig(replace(sky.rig.config, mount=config), open_catalogue())
    sky.point(-40.0, 50.0)
    done = follow(sky)
    first, told, last = done.history.entries
    assert first.total_arcsec + 3.0 * first.noise_arcsec > 30.0
    assert "measuring once more" in told.text
    assert last.noise_arcsec < 0.8 * first.noise_arcsec  # both count
    assert (done.good, done.moves, done.rounds) == (True, 0, 2)


def test_measuring_says_how_surely_and_how_much_further():
    sky = rig()
    updates = []
    found = run(measure_axis(sky, sky, sky.settings, Sweep(turn_deg=60.0)), updates.append)
    told = [u for u in updates if isinstance(u, PolarUpdate) and u.measurement is not None]
    assert len(told) == 4  # from the second frame of five on
    assert told[0].more_turn_deg > told[2].more_turn_deg
    assert f"Rotate {told[0].more_turn_deg:.0f}° more for 10″" in told[0].detail
    assert sky.missed_arcsec(found.measurement.error) < 4 * found.measurement.error.uncertainty_arcsec
    assert found.measurement.turn_deg == pytest.approx(60.0, abs=1.5)
    assert PolarFindingKind.SLIPPING not in {f.kind for f in found.findings}


def test_a_person_may_stop_measuring_early():
    sky, controls = rig(), PolarControls()
    controls.press(PolarButton.ENOUGH)
    found = run(measure_axis(sky, sky, sky.settings, Sweep(turn_deg=60.0), controls))
    assert len(found.measurement.attitudes) == 3, "two can't show whether something moved"
    assert found.measurement.checked


class ByHand(HandTurner):
    """A person who turns the axis while frames go on, some time after being asked."""

    def __init__(self, sky):
        self.sky = sky
        self.words = []
        self.left = None

    def turn(self, direction, degrees):
        for progress in super().turn(direction, degrees):
            self.words.append(progress.detail)
            yield progress
        self.left = [3, direction, degrees]

    def sight(self):
        if self.left is not None:
            self.left[0] -= 1
            if self.left[0] == 0:
                run(self.sky.turn(self.left[1], self.left[2]))
                self.left = None
        return (yield from self.sky.sight())


def test_without_a_mount_words_are_said_and_the_frames_show_when_it_was_done():
    sky = rig()
    hand = ByHand(sky)
    updates = []
    found = run(measure_axis(hand, hand, sky.settings, Sweep(turn_deg=60.0, frames=3, most_frames=3)), updates.append)
    assert len(hand.words) == 2
    assert all("Rotate RA about 60°" in words for words in hand.words)
    assert found.measurement.turn_deg == pytest.approx(60.0, abs=1.5)
    assert any(u.stage == "turn" and u.detail == "0° of 60°" for u in updates)


class Presser(ByHand):
    """A person who also presses Done: as soon as it is turned, at so much of what was asked, or much later."""

    def __init__(self, sky, share=1.0, late=0):
        super().__init__(sky)
        self.controls, self.share, self.late, self.turned = PolarControls(), share, late, 0

    def turn(self, direction, degrees):
        yield from super().turn(direction, degrees)
        self.left[2] *= self.share

    def sight(self):
        waiting = self.left is not None
        seen = yield from super().sight()
        self.turned = self.turned + 1 if not waiting or self.left is None else 0
        if len(self.words) and self.turned == self.late + 1:
            self.controls.press(PolarButton.TURNED)
        assert self.sky.sights < 60, "it waits for a second press"
        return seen


@pytest.mark.parametrize("late", [0, 3])
def test_a_press_of_done_confirms_no_other_turn(monkeypatch, late):
    """The frames showed the turn anyway: pressed right away, or while the frames of the place are taken."""
    monkeypatch.setattr("kochab.workflows.polar.measure._far", lambda found: False)
    hand = Presser(rig(), late=late)
    sweep = Sweep(turn_deg=60.0, frames=3, most_frames=3)
    found = run(measure_axis(hand, hand, hand.sky.settings, sweep, hand.controls))
    first, second, third = (next(a for a in found.measurement.attitudes if a.place == n) for n in range(3))
    assert turned_deg(first, second) == pytest.approx(60.0, abs=1.5)
    assert turned_deg(second, third) == pytest.approx(60.0, abs=1.5)
    assert hand.controls.pressed(PolarButton.TURNED) is bool(late)


def test_a_press_of_done_after_a_short_turn_needs_no_second_one():
    hand = Presser(rig(), share=0.4)
    sweep = Sweep(turn_deg=60.0, frames=2, most_frames=2)
    found = run(measure_axis(hand, hand, hand.sky.settings, sweep, hand.controls))
    assert found.measurement.turn_deg == pytest.approx(24.0, abs=1.5)


class Quick(ByHand):
    """A person who turns and presses Done while frames from before the turn are still being solved."""

    def __init__(self, sky):
        super().__init__(sky)
        self.controls = PolarControls()

    def sight(self):
        if self.left is not None and self.left[0] == 2:
            self.controls.press(PolarButton.TURNED)
        return (yield from super().sight())


def test_frames_from_before_the_turn_are_none_of_the_place_that_done_tells_of():
    """They agree with each other and passed for the new place: "RA rotated by only 0.01°" ended the alignment."""
    hand = Quick(rig())
    sweep = Sweep(turn_deg=60.0, frames=2, most_frames=2)
    found = run(measure_axis(hand, hand, hand.sky.settings, sweep, hand.controls))
    assert found.measurement.turn_deg == pytest.approx(60.0, abs=1.5)


def test_a_press_of_done_for_the_axis_is_no_bolts():
    """The tutor would take its test move as made, and learn backlash that is not there."""
    sky, controls = rig(), PolarControls()
    found = run(measure_axis(sky, sky, sky.settings, Sweep(turn_deg=60.0)))
    controls.press(PolarButton.TURNED)
    tutor = BoltTutor()
    task = adjust(sky, found.measurement, tutor, controls)
    for _ in range(30):
        next(task)
    assert tutor.bolts == BoltTutor().bolts, "no bolt was turned: nothing is learned"


class Clutch:
    """A turner whose mount turns less than it is asked, as with a loose clutch."""

    by_hand = False

    def __init__(self, sky):
        self.sky = sky

    def turn(self, direction, degrees):
        yield from self.sky.turn(direction, 0.6 * degrees)
        return degrees


def test_a_slipping_clutch_is_told():
    sky = rig()
    found = run(measure_axis(sky, Clutch(sky), sky.settings, Sweep(turn_deg=60.0, frames=3, most_frames=3)))
    assert found.findings[0].kind is PolarFindingKind.SLIPPING
    assert "reports a turn of 30°, the frames show 18°" in found.findings[0].text


class Clouds:
    """A source whose frames have no answer, or that gives none."""

    def __init__(self, answer):
        self.answer = answer

    def sight(self):
        yield Progress("wait")
        return self.answer


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (None, "The camera sends no frames"),
        (NoSolution(Reason.CLOUDED_OR_DARK, "Wait for the clouds to pass."), "clouded or dark"),
    ],
)
def test_frames_that_never_help_end_in_one_sentence(answer, words):
    sky = rig()
    with pytest.raises(NotMeasuredError, match=words):
        run(measure_axis(Clouds(answer), sky, sky.settings))


def test_nothing_turned_is_one_sentence():
    class Lazy(Clutch):
        def turn(self, direction, degrees):
            yield Progress("turn")

    sky = rig()
    with pytest.raises(NotMeasuredError, match=r"stood still .* rotate its RA axis"):  # nor does the rig track
        run(measure_axis(sky, Lazy(sky), sky.settings, Sweep(turn_deg=60.0, frames=3, most_frames=3)))


def test_a_frame_without_an_answer_keeps_the_last_error_and_says_so():
    sky = rig()
    found = run(measure_axis(sky, sky, sky.settings, Sweep(turn_deg=60.0)))

    class Sometimes:
        def __init__(self):
            self.count = 0

        def sight(self):
            self.count += 1
            if self.count == 6:
                return (yield from Clouds(NoSolution(Reason.TRAILED, "Wait.")).sight())
            return (yield from sky.sight())

    controls, updates = PolarControls(), []

    def watch(update):
        updates.append(update)
        if len([u for u in updates if isinstance(u, PolarUpdate)]) > 9:
            controls.press(PolarButton.REMEASURE)

    ended = run(adjust(Sometimes(), found.measurement, BoltTutor(), controls), watch)
    assert ended.end is AdjustingEnd.REQUESTED
    lost = [u for u in updates if isinstance(u, PolarUpdate) and not u.solved]
    assert len(lost) == 1
    assert lost[0].steady is not None
    assert "trailed" in lost[0].detail


def test_no_bolt_is_turned_by_a_spoilt_measurement(monkeypatch):
    """It is measured again; when it stays spoilt the alignment ends without an instruction."""
    from kochab.workflows.polar import align as module

    sky, real = rig(), module.measure_axis
    spoils = PolarFinding(PolarFindingKind.DISAGREE, "Something slipped.", spoils=True)

    def spoilt(*args):
        found = yield from real(*args)
        measurement = replace(found.measurement, findings=(spoils,))
        return replace(found, measurement=measurement, findings=(spoils,))

    monkeypatch.setattr(module, "measure_axis", spoilt)
    updates = []
    ended = run(module.align(sky, sky, sky.settings), updates.append)
    told = [u for u in updates if isinstance(u, PolarUpdate)]
    assert all(u.instruction is None for u in told)
    assert (ended.good, ended.moves, ended.rounds) == (False, 0, module.MOST_ROUNDS)
    assert told[-1].detail.startswith("Unusable: don't adjust. Something slipped.")
    assert sum("Don't turn a bolt: measuring again." in u.detail for u in told) == module.MOST_ROUNDS - 1


def test_a_large_move_measures_again():
    sky = rig()
    found = run(measure_axis(sky, sky, sky.settings, Sweep(turn_deg=60.0)))
    tutor, controls = BoltTutor(), PolarControls()
    task = adjust(sky, found.measurement, tutor, controls)
    next(task)
    sky.rig.mount.turn_bolts(180.0, 0.0)
    assert run(task).end is AdjustingEnd.LARGE_MOVE


def test_a_declination_that_moves_while_adjusting_is_told_and_measured_again():
    sky = rig(hour=-70.0)
    found = run(measure_axis(sky, sky, sky.settings, Sweep(turn_deg=60.0)))
    updates = []
    task = adjust(sky, found.measurement, BoltTutor())
    for update in task:
        updates.append(update)
        if isinstance(update, PolarUpdate) and update.live is not None:
            break
    sky.rig.mount.turn_by_hand(0.0, 0.25)
    assert run(task, updates.append).end is AdjustingEnd.DEC_MOVED
    said = [f.text for f in updates[-1].findings if f.kind is PolarFindingKind.DEC_MOVED]
    assert len(said) == 1
    assert "Declination moved by 15." in said[0] or "moved by 14.9" in said[0]


def test_a_noisy_reading_does_not_overrule_a_fresh_measurements_stop():
    """20 arcsec off, and frames that say 40: it was measured, and nobody has touched a bolt."""
    sky = rig(seed=3)
    config = replace(sky.rig.config.mount, misalignment_arcmin=(18.0 / 60.0, 0.0))
    sky.rig = PracticeRig(replace(sky.rig.config, mount=config), open_catalogue())
    sky.point(-40.0, 50.0)
    found = run(measure_axis(sky, sky, sky.settings, ALIGN.sweep))
    adjuster = AdjustmentGuide(found.measurement, BoltTutor())
    assert adjuster.instruction.step is TutorStep.STOP
    last = adjuster.live.update(to_local(sky.look(), sky.settings.site, sky.settings.refraction))
    for frame in range(12):
        off = last.error.axis + 1.5 * np.sqrt(last.frame_covariance[0, 0]) * np.array([0, 0, 1.0])
        reading = replace(last, error=replace(last.error, axis=off / np.linalg.norm(off)))
        noisy = frame < 3
        steady, told = adjuster.see(reading if noisy else last, False)
        assert told.step is TutorStep.STOP, steady
    sky.rig.mount.turn_bolts(3.0, 0.0)
    for _ in range(8):
        _, told = adjuster.see(
            adjuster.live.update(to_local(sky.look(), sky.settings.site, sky.settings.refraction)), False
        )
    assert told.step is not TutorStep.STOP  # what really moved is answered


def test_every_step_can_be_the_last():
    sky = rig()
    task = measure_axis(sky, sky, sky.settings, Sweep(turn_deg=60.0))
    for _ in range(4):
        next(task)
    task.close()
    with pytest.raises(StopIteration):
        next(task)


# Which way to turn.


def test_the_way_stays_up_and_on_its_side_of_the_meridian():
    for latitude in (-40.0, 45.0):
        for hour in (-60.0, -30.0, 30.0, 60.0):
            sky = rig(latitude=latitude, hour=hour, dec=np.sign(latitude) * 20.0)
            first = to_local(sky.look(), sky.settings.site, sky.settings.refraction)
            path = best_path(first.boresight, sky.settings, 60.0)
            assert path.lowest_deg >= 20.0
            assert path.past_meridian_deg <= 5.0
            assert path.turn_deg >= 20.0
            # what it foresees is what happens
            run(sky.turn(path.direction, path.turn_deg))
            after = to_local(sky.look(), sky.settings.site, sky.settings.refraction)
            assert after.altitude_deg >= path.lowest_deg - 6.0  # the axis is up to 5 deg off


def test_west_sinks_in_the_west():
    sky = rig(latitude=45.0, hour=40.0, dec=20.0)
    first = to_local(sky.look(), sky.settings.site, sky.settings.refraction)
    west = sweep_path(first.boresight, sky.settings, Direction.WEST, 30.0)
    east = sweep_path(first.boresight, sky.settings, Direction.EAST, 30.0)
    assert west.lowest_deg < first.altitude_deg - 10.0
    assert east.lowest_deg == pytest.approx(first.altitude_deg, abs=1e-6)


def test_the_planner_turns_less_near_the_pole_and_backwards_the_second_time():
    near, far = rig(latitude=45.0, dec=80.0), rig(latitude=45.0, hour=-70.0, dec=30.0)
    sweep = Sweep(goal_arcsec=10.0)
    ways = []
    for sky in (near, far):
        first = to_local(sky.look(), sky.settings.site, sky.settings.refraction)
        ways.append(plan_path(first, sky.settings, sweep))
    assert ways[0].turn_deg < ways[1].turn_deg
    first = to_local(near.look(), near.settings.site, near.settings.refraction)
    back = plan_path(first, near.settings, Sweep(turn_deg=40.0, backwards=Direction.WEST))
    assert back.direction is Direction.EAST
    assert foreseen_arcsec(first, near.settings, sweep) <= 10.0


# The mount, through whatever guards it.


class Motor:
    """Moves as it is told, at a share of the rate asked for; refuses when told to."""

    epoch = Epoch.DATE

    def __init__(self, refuse=False, share=1.0):
        self.asked = []
        self.stops = 0
        self.refuse = refuse
        self.share = share
        self.slewing_for = 0
        self.ra = 350.0

    def position(self):
        return Pointing(self.ra % 360.0, 20.0, self.epoch)

    def move(self, direction, rate_deg_s, seconds):
        if self.refuse:
            raise RefusedError("The guard says no.")
        self.asked.append((direction, seconds))
        self.ra += rate_deg_s * seconds * self.share * (1 if direction is Direction.EAST else -1)

    def state(self):
        self.slewing_for -= 1
        return MountState(slewing=self.slewing_for > 0)

    def stop(self):
        self.stops += 1


def clocked(motor):
    time = [0.0]

    def sleep(seconds):
        time[0] += seconds

    return MountTurner(motor, 2.0, sleep, lambda: time[0]), time


@pytest.mark.parametrize("share", [1.0, 0.5, 1.6])
@pytest.mark.parametrize("direction", [Direction.WEST, Direction.EAST])
def test_the_mount_turns_in_bounded_parts_and_is_stopped_at_the_end(share, direction):
    """Whatever its fast is: the position decides."""
    motor = Motor(share=share)
    turner, time = clocked(motor)
    begun = motor.ra
    reported = run(turner.turn(direction, 60.0))
    assert abs(motor.ra - begun) == pytest.approx(60.0, abs=20.0 if share > 1 else 1.1)
    assert reported == pytest.approx(abs(motor.ra - begun))
    assert max(seconds for _, seconds in motor.asked) <= 20.0
    assert {way for way, _ in motor.asked} == {direction}
    assert motor.stops == 1
    assert time[0] >= sum(seconds for _, seconds in motor.asked)
    before = motor.ra
    run(turner.turn(direction, 30.0))  # by now it knows its rate
    assert abs(motor.ra - before) == pytest.approx(30.0, abs=1.1)


def test_a_mount_that_does_not_move_is_told():
    motor = Motor(share=0.0)
    turner, _ = clocked(motor)
    with pytest.raises(RefusedError, match="has not moved"):
        run(turner.turn(Direction.WEST, 30.0))
    assert motor.stops == 1


def test_a_cancelled_turn_stops_the_mount():
    motor = Motor()
    turner, _ = clocked(motor)
    task = turner.turn(Direction.EAST, 30.0)
    for _ in range(4):
        next(task)
    task.close()
    assert motor.stops == 1


def test_a_refusal_of_the_guard_is_passed_on_and_the_mount_stopped():
    motor = Motor(refuse=True)
    turner, _ = clocked(motor)
    with pytest.raises(RefusedError, match="guard says no"):
        run(turner.turn(Direction.EAST, 30.0))
    assert motor.stops == 1
    assert motor.asked == []


def test_a_mount_that_never_comes_to_rest_is_stopped():
    motor = Motor()
    motor.slewing_for = 10**9
    turner, _ = clocked(motor)
    with pytest.raises(RefusedError, match="still reports"):
        run(turner.turn(Direction.EAST, 10.0))
    assert motor.stops == 1


# All of it together: star lists through the solver, the mount through the real guard.


class SeenByTheSolver:
    """A source over the rig's star lists, each really solved."""

    def __init__(self, bench):
        self.bench = bench

    def sight(self):
        begun = self.bench.rig.clock.now_utc()
        found = yield from self.bench.solve_now()
        if isinstance(found, NoSolution):
            return found
        return Sighting.of(found, begun + timedelta(seconds=1.0))


def guarded(**limits):
    site = Site(45.0, 8.0, 300.0)
    mount = MountConfig(misalignment_arcmin=(18.0, -31.0), german=False)
    night = datetime(2026, 1, 15, 22, 0, tzinfo=UTC).timestamp()
    camera = CameraConfig(width=900, height=700, fov_deg=6.0)
    bench = Bench(
        RigConfig(seed=2, site=site, mount=mount, start_deg=(-60.0, 40.0), start_unix=night, camera=camera), **limits
    )
    turner = MountTurner(bench.guard, 1.0, bench.wait, bench.rig.clock.now_unix)
    return bench, turner, MeasureSettings(site, refraction=Refraction(pressure_hpa=1010.0))


def test_within_the_guard_the_axis_of_the_rig_is_found_by_the_solver():
    bench, turner, settings = guarded()
    sweep = Sweep(turn_deg=45.0, frames=4, most_frames=4)
    found = run(measure_axis(SeenByTheSolver(bench), turner, settings, sweep))
    truth = bench.rig.truth().axis_enu
    assert found.measurement.error.distance2(truth) < 14.0  # one in a thousand
    assert found.measurement.error.uncertainty_arcsec < 25.0
    assert found.measurement.turn_deg == pytest.approx(45.0, abs=3.5)
    assert {f.kind for f in found.findings} <= {PolarFindingKind.FLEXURE_NOT_MEASURED}
    moves = [did for did in bench.mount.did if did[0] == "move"]
    assert len(moves) >= 3
    assert bench.mount.did[-1] == ("stop",)


def test_a_turn_beyond_the_guards_limits_is_refused_before_it_begins():
    bench, turner, _ = guarded(lowest_altitude_deg=50.0)
    with pytest.raises(RefusedError, match="°"):
        run(turner.turn(Direction.EAST, 60.0))
    assert not [did for did in bench.mount.did if did[0] == "move"]


@pytest.mark.parametrize("flexure", [0.0, 60.0])
def test_flexure_hides_from_one_sweep_and_shows_in_a_second(flexure):
    """A drooping tube biases the axis, and the residuals of one sweep are as good as ever."""
    sky = rig()
    config = sky.rig.config
    build = Build(flexure_arcsec=flexure)
    sky.rig = PracticeRig(replace(config, mount=replace(config.mount, build=build)), open_catalogue())
    sky.optics = Optics(0.5, 5.0)
    seen = []
    for sweep, dec in enumerate((20.0, 75.0)):
        sky.point(-50.0, dec)
        for _ in range(5):
            local = to_local(sky.look(), sky.settings.site, sky.settings.refraction)
            seen.append(replace(local, sweep=sweep))
            run(sky.turn(Direction.WEST, 15.0))
    one = measure_local(seen[:5], sky.settings)
    both = measure_local(seen, sky.settings)
    assert one.fit.chance > 0.001
    assert {f.kind for f in one.findings} == {PolarFindingKind.FLEXURE_NOT_MEASURED}
    shown = [f for f in both.findings if f.kind is PolarFindingKind.DROOP]
    if flexure:
        assert sky.missed_arcsec(one.error) > 3.0 * one.error.uncertainty_arcsec
        assert len(shown) == 1
    else:
        assert sky.missed_arcsec(both.error) < 3.0 * both.error.uncertainty_arcsec
        assert shown == []


# -- A clock that is wrong by an hour ----------------------------------------------------------------


class HourAhead(RigSky):
    """Its frames' clock is an hour fast."""

    hours = 1.0

    def look(self):
        seen = RigSky.look(self)
        return replace(seen, time_utc=seen.time_utc + timedelta(hours=self.hours))


def witnesses(sky, bolts=BoltTutor):
    """What the bolts' own moves say while somebody follows the tutor."""
    task, controls, told, before = None, PolarControls(), set(), None
    measured = run(measure_axis(sky, sky, sky.settings, Sweep(turn_deg=60.0)))
    task = adjust(sky, measured.measurement, bolts(), controls)
    for step in task:
        if not isinstance(step, PolarUpdate) or step.instruction is None:
            continue
        told |= {f.text for f in step.findings if f.kind is PolarFindingKind.CLOCK}
        if step.instruction is not before:
            before = step.instruction
            sky.turn_bolt(before)
            controls.press(PolarButton.TURNED)
        if step.moves > 4 or told:
            break
    task.close()
    return told


@pytest.mark.parametrize("latitude", [-35.0, 50.0])
def test_a_bolts_own_move_tells_a_clock_that_is_an_hour_wrong(latitude):
    right = rig(seed=8, latitude=latitude, dec=np.sign(latitude) * 50.0)
    wrong = HourAhead(**{field.name: getattr(right, field.name) for field in fields(RigSky)})
    (told,) = witnesses(wrong)
    assert "away from its own direction" in told
    hours = float(told.split("off by ")[1].split(" h")[0])
    assert hours == pytest.approx(1.0, abs=0.4)


def test_bolts_that_move_each_others_axis_end_the_alignment_before_anything_is_far():
    """Six hours: what is above the pole seems to be beside it. 14 arcmin became 3 degrees."""
    right = rig(seed=8, latitude=50.0, dec=50.0)
    sky = HourAhead(**{field.name: getattr(right, field.name) for field in fields(RigSky)})
    sky.hours = 6.0
    before = sky.true_total_arcsec()
    with pytest.raises(RefusedError, match="Each bolt moves the other axis"):
        follow(sky)
    assert sky.true_total_arcsec() < before


@pytest.mark.parametrize("seed", range(6))
def test_with_the_right_clock_no_bolt_accuses_it(seed):
    assert not witnesses(rig(seed=seed))


# -- Nobody turns the axis ----------------------------------------------------------------------------


def tracking(on=True, seed=1):
    sky = rig(seed, hour=-20.0, dec=20.0)
    sky.rig = PracticeRig(replace(sky.rig.config, tracking=on), open_catalogue())
    sky.point(-20.0, 20.0)
    sky.optics = Optics(0.5, 5.0)
    return sky


def test_a_tracked_place_gives_the_axis_by_itself():
    sky, updates = tracking(), []
    drift = run(measure_drifting(sky, sky.settings, PolarControls()), updates.append)
    told = [u for u in updates if isinstance(u, PolarUpdate) and u.drift is not None]
    assert drift.minutes_more == 0.0
    assert drift.known
    assert sky.missed_arcsec(drift.error) < 4.0 * drift.error.uncertainty_arcsec
    assert max(len(s.attitudes) for u in told for s in u.drift.stretches) <= MOST_POINTS + 1
    more = [u.drift.minutes_more for u in told if u.drift.minutes_more]
    assert more[0] > more[-1]
    assert "of drift" in told[0].detail
    assert {u.stage for u in updates if isinstance(u, PolarUpdate)} == {"measure"}


def test_a_drift_is_enough_when_a_person_says_so():
    sky, controls = tracking(), PolarControls()

    def person(update):
        if isinstance(update, PolarUpdate) and update.drift is not None and update.drift.minutes > 3.0:
            controls.press(PolarButton.ENOUGH)

    drift = run(measure_drifting(sky, sky.settings, controls), person)
    assert 3.0 < drift.minutes < 4.0
    controls.press(PolarButton.ENOUGH)
    with pytest.raises(NotMeasuredError, match="more than a minute"):
        run(measure_drifting(tracking(), sky.settings, controls))


def test_a_mount_that_does_not_track_is_told():
    sky = tracking(on=False)
    with pytest.raises(NotMeasuredError, match="Turn the mount’s tracking on"):
        run(measure_drifting(sky, sky.settings, PolarControls()))


# -- Motors at the bolts --------------------------------------------------------------------------------


class RigMotors:
    """Motors of some pitch, in arcmin a unit, at the bolts of a rig, which have backlash of their own."""

    def __init__(self, sky, altitude, azimuth):
        self.sky, self.arcmin = sky, {AdjusterAxis.ALTITUDE: altitude, AdjusterAxis.AZIMUTH: azimuth}
        self.moves = []

    def move(self, axis, amount):
        yield Progress("turn")
        arcmin = amount * self.arcmin[axis]
        self.moves.append((axis, arcmin))
        self.sky.rig.mount.turn_bolts(*((arcmin, 0.0) if axis is AdjusterAxis.ALTITUDE else (0.0, arcmin)))


@pytest.mark.parametrize(
    ("altitude", "azimuth"),
    [(0.05, 0.05), (-0.05, 0.02), (0.0003, -0.0002), (1.0, -0.5)],
    ids=["plain", "reversed", "fine", "coarse"],
)
def test_motors_of_any_pitch_and_sense_end_at_the_pole_and_ask_nobody(altitude, azimuth):
    sky, updates = rig(seed=2), []
    motors = RigMotors(sky, altitude, azimuth)
    done = run(align(sky, sky, sky.settings, ALIGN, motors=motors), updates.append)
    assert done.good
    assert sky.true_total_arcsec() < 30.0
    told = [u.instruction for u in updates if isinstance(u, PolarUpdate) and u.instruction is not None]
    assert not any(one.knob for one in told), "nobody has anything to turn"
    words = {one.words for one in told}
    assert any("small move" in text for text in words)
    assert any("to go. Keep clear." in text for text in words)
    whole = sky.hidden_total_arcmin
    assert max(abs(arcmin) for _, arcmin in motors.moves) < 1.5 * whole / np.cos(np.radians(45.0)) + 5.0
    first = next(abs(arcmin) for _, arcmin in motors.moves)
    assert first <= max(abs(altitude), abs(azimuth))  # one unit


def test_motors_that_move_nothing_are_told():
    sky = rig(seed=2)
    with pytest.raises(RefusedError, match="does not move the axis"):
        run(align(sky, sky, sky.settings, ALIGN, motors=RigMotors(sky, 0.0, 0.0)))


# -- By hand: one long turn, and no more frames than the numbers ask for ----------------------------------


@pytest.mark.parametrize("off_arcmin", [47.0, 0.3])
def test_a_hand_turns_there_and_a_step_back_where_bolts_have_to_be_turned_anyway(off_arcmin):
    sky = rig(seed=3)
    config = replace(sky.rig.config.mount, misalignment_arcmin=(off_arcmin, 0.0))
    sky.rig = PracticeRig(replace(sky.rig.config, mount=config), open_catalogue())
    sky.point(-40.0, 50.0)
    hand = ByHand(sky)
    found = run(measure_axis(hand, hand, sky.settings, Sweep(frames=2, most_frames=6, goal_arcsec=4.0)))
    first, *back = [float(words.split("about ")[1].split("°")[0]) for words in hand.words]
    assert 60.0 <= first <= 90.0
    if off_arcmin > 1.0:
        assert len(back) == 1, "of two places nothing is known to have stood"
        assert found.ahead[1] == pytest.approx(first - back[0], abs=1.6)
    else:
        assert len(back) >= 2, "what is nearly good has to be known well"
        assert sum(back) == pytest.approx(first, abs=1.0 + len(back))
        assert found.went_deg == pytest.approx(0.0, abs=1e-6)
        assert len({words.split("° ")[1].split(",")[0] for words in hand.words[1:]}) == 1
        assert hand.words[0].split("° ")[1].split(",")[0] not in hand.words[1]
    assert (
        sky.missed_arcsec(found.measurement.error) < 4.0 * found.measurement.error.with_systematics.uncertainty_arcsec
    )


@pytest.mark.parametrize(("sigma", "enough"), [(20.0, True), (66.0, False)])
def test_the_pole_within_an_uncertainty_larger_than_the_goal_is_no_end(sigma, enough):
    """22 arcsec told at 66 each way stood 71 from the pole: another sweep costs no turn of a bolt."""
    error = error_at(15.0, 15.0, sigma=sigma)
    assert error.below_uncertainty
    assert good(SimpleNamespace(error=error, spoilt=False), AlignOptions()) is enough


def test_sweeps_with_bolts_turned_between_are_surer_together():
    """The camera sees the axis at one place before and after: three frames of 30 degrees say little alone."""
    sky = rig(seed=4)
    done = follow(sky, replace(ALIGN, sweep=Sweep(turn_deg=30.0, frames=3, most_frames=3)))
    alone = measure_local(done.last.attitudes, done.last.settings)
    assert done.moves
    assert done.last.error.uncertainty_arcsec < 0.9 * alone.error.uncertainty_arcsec
