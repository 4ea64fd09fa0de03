"""The second sweep: told in words, made by the mount or by hand, and what it is worth."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from kochab.core.frame import Site
from kochab.core.mount import Direction, Epoch, MountState, Pointing
from kochab.core.progress import Progress, run
from kochab.lab.bench.polar_rig import ALIGN, follow, make_rig
from kochab.polar.measure import PolarFindingKind
from kochab.polar.plan import BACK_DEG, creep_to_show_arcsec, from_start_deg
from kochab.simulate.mechanics.geometry import MountConfig
from kochab.simulate.rig import PracticeRig, RigConfig
from kochab.sky import open_catalogue
from kochab.workflows.polar.align import AdjustingEnd, adjust, align
from kochab.workflows.polar.measure import (
    NO_SECOND_SWEEP,
    HandTurner,
    MountTurner,
    Sweep,
    back_at_start,
    measure_axis,
    second_sweep,
)
from kochab.workflows.polar.sources import NotMeasuredError
from kochab.workflows.polar.update import PolarButton, PolarControls, PolarUpdate
from tests.workflows.rig_mount import Bench

SWEEP = Sweep(turn_deg=60.0)


def rig(flexure=60.0, latitude=40.0, dec=70.0, hour=-45.0, seed=1):
    sky = make_rig(np.random.default_rng([9, seed]), latitude)
    mount = sky.rig.config.mount
    mount = replace(mount, build=replace(mount.build, flexure_arcsec=flexure))
    sky.rig = PracticeRig(replace(sky.rig.config, mount=mount), open_catalogue())
    sky.point(hour, dec)
    return sky


@pytest.mark.parametrize("latitude", [-35.0, 40.0])
def test_the_droop_of_the_rigs_tube_is_found_and_taken_out(latitude):
    sky = rig(latitude=latitude, dec=np.sign(latitude) * 70.0)
    first = run(measure_axis(sky, sky, sky.settings, SWEEP))
    said = []
    both = run(second_sweep(sky, sky, first, SWEEP), said.append)
    one, two = first.measurement, both.measurement
    assert sky.missed_arcsec(one.error) > 2.5 * one.error.uncertainty_arcsec
    assert sky.missed_arcsec(one.error) < 3.0 * one.error.with_systematics.uncertainty_arcsec
    assert sky.missed_arcsec(two.error) < 0.6 * sky.missed_arcsec(one.error)
    assert two.droop.arcsec == pytest.approx(60.0, abs=3.0 * two.droop.sigma_arcsec)
    assert PolarFindingKind.DROOP in {f.kind for f in both.findings}
    words = said[0].detail
    assert "Don't touch the bolts" in words
    assert f"° {'south' if latitude > 0 else 'north'}" in words
    assert len(two.results) == 2


class Hand(HandTurner):
    """A person who does what is asked, some frames later."""

    def __init__(self, sky):
        self.sky = sky
        self.words = []
        self.left = []

    def turn(self, direction, degrees):
        for progress in super().turn(direction, degrees):
            self.words.append(progress.detail)
            yield progress
        self.left = [3, direction, degrees]

    def sight(self):
        if self.left:
            self.left[0] -= 1
            if self.left[0] == 0:
                run(self.sky.turn(*self.left[1:]))
                self.left = []
        return (yield from self.sky.sight())


def test_by_hand_words_are_said_and_the_frames_show_when_it_was_done():
    sky = rig()
    hand = Hand(sky)
    few = replace(SWEEP, frames=3, most_frames=3)
    first = run(measure_axis(hand, hand, sky.settings, few))
    both = run(second_sweep(hand, hand, first, few))
    asked = [w for w in hand.words if "Rotate declination about" in w]
    assert len(asked) == 1
    assert "° south, then lock it. Don't touch RA or the bolts" in asked[0]
    assert len(both.measurement.results) == 2


def test_where_it_would_not_help_the_first_measurement_comes_back():
    sky = rig(dec=3.0)
    first = run(measure_axis(sky, sky, sky.settings, SWEEP))
    updates = []
    assert run(second_sweep(sky, sky, first, SWEEP), updates.append) is first
    assert updates[-1].detail == NO_SECOND_SWEEP


def test_a_declination_axis_that_was_not_turned_is_no_second_sweep():
    sky = rig()

    class Stuck:
        by_hand = False

        def turn(self, direction, degrees):
            yield Progress("turn")

    first = run(measure_axis(sky, sky, sky.settings, SWEEP))
    with pytest.raises(NotMeasuredError, match="rotated by only"):
        run(second_sweep(sky, Stuck(), first, replace(SWEEP, frames=3, most_frames=3)))


def test_an_alignment_with_a_second_sweep_ends_at_the_pole_in_spite_of_the_tube():
    alone, both = rig(seed=5), rig(seed=5)
    follow(alone)
    done = follow(both, replace(ALIGN, second_sweep=True))
    assert both.true_total_arcsec() < 30.0 < alone.true_total_arcsec()
    assert done.good
    assert done.last.droop.arcsec == pytest.approx(60.0, abs=25.0)
    assert done.last.error.flexure_total_arcsec < 15.0


def test_a_person_may_ask_for_it_while_adjusting():
    sky = rig()
    found = run(measure_axis(sky, sky, sky.settings, SWEEP))
    from kochab.polar.tutor import BoltTutor

    controls = PolarControls()
    controls.press(PolarButton.SECOND_SWEEP)
    ended = run(adjust(sky, found.measurement, BoltTutor(), controls))
    assert ended.end is AdjustingEnd.SECOND_SWEEP
    assert controls.take(PolarButton.SECOND_SWEEP)  # it is for the alignment to answer
    assert not controls.pressed(PolarButton.SECOND_SWEEP)


def test_asked_for_before_the_first_frame_it_follows_the_first_sweep():
    from kochab.workflows.polar.align import align

    sky, controls, seen = rig(), PolarControls(), []
    controls.press(PolarButton.SECOND_SWEEP)
    for update in align(sky, sky, sky.settings, ALIGN, controls):
        if isinstance(update, PolarUpdate):
            seen.append(update)
            if update.stage == "adjust":
                break
    assert any("Second sweep to measure flexure" in u.detail for u in seen)
    assert len(seen[-1].measurement.results) == 2


# The mount.


class Motor:
    """Moves in declination as it is told."""

    epoch = Epoch.DATE

    def __init__(self):
        self.asked, self.stops, self.dec = [], 0, 20.0

    def position(self):
        return Pointing(100.0, self.dec, self.epoch)

    def move(self, direction, rate_deg_s, seconds):
        self.asked.append(direction)
        self.dec += rate_deg_s * seconds * (1 if direction is Direction.NORTH else -1)

    def state(self):
        return MountState(slewing=False)

    def stop(self):
        self.stops += 1


@pytest.mark.parametrize("direction", [Direction.NORTH, Direction.SOUTH])
def test_the_mount_turns_its_declination_and_is_stopped_at_the_end(direction):
    motor, time = Motor(), [0.0]

    def sleep(seconds):
        time[0] += seconds

    run(MountTurner(motor, 2.0, sleep, lambda: time[0]).turn(direction, 50.0))
    assert motor.dec == pytest.approx(70.0 if direction is Direction.NORTH else -30.0, abs=1.1)
    assert set(motor.asked) == {direction}
    assert motor.stops == 1


def test_within_the_guard_the_real_declination_turns():
    night = datetime(2026, 1, 15, 22, 0, tzinfo=UTC).timestamp()
    bench = Bench(
        RigConfig(
            seed=2,
            site=Site(45.0, 8.0, 300.0),
            start_deg=(-60.0, 60.0),
            start_unix=night,
            mount=MountConfig(german=False),
        )
    )
    turner = MountTurner(bench.guard, 1.0, bench.wait, bench.rig.clock.now_unix)
    before = bench.rig.truth().of_date_deg[1]
    run(turner.turn(Direction.SOUTH, 30.0))
    assert before - bench.rig.truth().of_date_deg[1] == pytest.approx(30.0, abs=3.0)
    assert bench.mount.did[-1] == ("stop",)


# -- A last frame, back where the sweep began ----------------------------------------------------


def test_a_last_frame_back_at_the_start_shows_what_crept():
    sky = rig(flexure=0.0)
    first = run(measure_axis(sky, sky, sky.settings, SWEEP))
    assert creep_to_show_arcsec(first.measurement) > 10.0
    said = []
    last = run(back_at_start(sky, sky, first), said.append)
    one, two = first.measurement, last.measurement
    assert "Back to the start of RA" in said[0].detail
    assert said[0].stage == "turn"
    assert len(two.attitudes) == len(one.attitudes) + 1
    assert from_start_deg(one) > 50.0
    assert from_start_deg(two) < BACK_DEG
    assert two.error.creep_total_arcsec < 0.5 * one.error.creep_total_arcsec
    assert creep_to_show_arcsec(two) == 0.0
    assert sky.missed_arcsec(two.error) < 3.0 * two.error.with_systematics.uncertainty_arcsec
    assert last.ahead == (
        Direction.WEST if first.path.direction is Direction.EAST else Direction.EAST,
        first.path.turn_deg,
    )
    assert run(back_at_start(sky, sky, last)) is last  # it is there already
    second = run(second_sweep(sky, sky, last, SWEEP))
    assert (
        sky.missed_arcsec(second.measurement.error) < 3.0 * second.measurement.error.with_systematics.uncertainty_arcsec
    )


def test_by_hand_the_way_back_is_asked_for():
    sky = rig(flexure=0.0)
    hand = Hand(sky)
    first = run(measure_axis(hand, hand, sky.settings, replace(SWEEP, frames=2, most_frames=2)))
    asked = len(hand.words)
    last = run(back_at_start(hand, hand, first))
    assert len(hand.words) == asked + 1
    assert f"° {'east' if first.path.direction is Direction.WEST else 'west'}" in hand.words[-1]
    assert from_start_deg(last.measurement) < BACK_DEG


@pytest.mark.parametrize("when", ["measuring", "adjusting"])
def test_back_at_the_start_is_one_button(when):
    """Pressed while a bolt is turned it is measured once more, and the last frame comes at the end of that sweep."""
    sky, controls, ways, adjusts = rig(flexure=0.0), PolarControls(), [], 0
    if when == "measuring":
        controls.press(PolarButton.BACK)
    task = align(sky, sky, sky.settings, replace(ALIGN, sweep=replace(SWEEP, frames=3, most_frames=3)), controls)
    for step in task:
        if isinstance(step, PolarUpdate) and step.stage == "adjust":
            adjusts += 1
            if adjusts == 1 and when == "adjusting":
                controls.press(PolarButton.BACK)
            elif ways:
                break
        elif "Back to the start of RA" in step.detail:
            ways.append(len(step.measurement.attitudes))
    assert ways == [3]
    assert adjusts == (1 if when == "measuring" else 2)
    assert not controls.pressed(PolarButton.BACK)
