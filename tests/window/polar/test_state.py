"""What the screens know: every step of real measurements on the rig, and of a person's hand."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest

from kochab.core.attitude import ARCSEC
from kochab.core.mount import Direction
from kochab.core.progress import Progress
from kochab.lab.bench.polar_rig import make_rig
from kochab.polar.error import Knob, altitude_in_words, cure, total_in_words
from kochab.polar.measure import PolarFinding, PolarFindingKind
from kochab.polar.tutor import BoltTutor
from kochab.server.phone_page import PhonePage
from kochab.window.polar.bolts_view import BoltsView
from kochab.window.polar.error_display import more_text, signed_text, uncertainty_words
from kochab.window.polar.messages import Message, all_known, most_urgent
from kochab.window.polar.room import KnobCard, NumberCard
from kochab.window.polar.sound_cues import SoundCues, speech_text
from kochab.window.tones import Cue, Cues
from kochab.workflows.polar.align import AdjustingEnd, adjust
from kochab.workflows.polar.measure import HandTurner, Sweep, measure_axis
from kochab.workflows.polar.update import PolarButton, PolarControls, PolarUpdate
from kochab.workflows.session.alignment_state import HANDS_OFF, OLD_S, AlignmentState, absorb
from tests.window.polar_cases import adjusting, error


def follow(state, task, now_s=0.0, most=400):
    """The states along a task, and its result."""
    seen, result = [state], None
    for _ in range(most):
        try:
            step = next(task)
        except StopIteration as end:
            result = end.value
            break
        seen.append(absorb(seen[-1], step, now_s))
    return seen, result


@pytest.fixture(scope="module")
def measured():
    sky = make_rig(np.random.default_rng([7, 1]), 45.0)
    sky.point(-40.0, 50.0)
    states, result = follow(AlignmentState(), measure_axis(sky, sky, sky.settings, Sweep(turn_deg=60.0)))
    return sky, states, result.measurement


def test_measuring_tells_the_error_and_how_much_further_to_turn(measured):
    _, states, measurement = measured
    assert states[1].words == HANDS_OFF
    told = [s.more_turn_deg for s in states if s.more_turn_deg]
    assert told
    assert told[0] >= 5.0
    assert states[-1].error is measurement.error
    assert not states[-1].live
    first_with_error = next(s for s in states if s.error is not None)
    assert more_text(first_with_error).startswith("Rotate RA ")


def test_adjusting_follows_the_axis_and_what_the_tutor_says(measured):
    sky, states, measurement = measured
    controls = PolarControls()
    task = adjust(sky, measurement, BoltTutor(), controls)
    first = absorb(states[-1], next(task), 10.0)
    assert first.instruction is not None
    assert first.hand_needed
    assert first.words == first.instruction.words
    assert first.measured == (measurement.error,)
    before = first.error.total_arcsec
    sky.turn_bolt(first.instruction)
    controls.press(PolarButton.TURNED)
    later, _ = follow(first, task, 11.0, most=40)
    assert later[-1].live
    assert later[-1].trail
    assert later[-1].error_at_s == 11.0
    truth = sky.true_total_arcsec()
    assert later[-1].error.total_arcsec == pytest.approx(truth, abs=30.0)
    assert abs(truth - before) > 30.0


def test_what_was_asked_of_a_hand_stands_until_it_is_measured():
    (asked,) = list(HandTurner().turn(Direction.EAST, 30.0))
    state = absorb(AlignmentState("measure", HANDS_OFF), asked, 0.0)
    assert "RA about 30° east" in state.words
    assert state.hand_needed
    turning = absorb(state, PolarUpdate("turn", 0.5, "15° of 30°"), 0.0)
    assert turning.words == state.words
    assert turning.detail == "15° of 30°"
    trailed = absorb(turning, PolarUpdate("measure", None, "trailed: wait", solved=False), 0.0)
    assert trailed.hand_needed
    assert trailed.words == state.words
    assert not trailed.solved
    done = absorb(trailed, PolarUpdate("measure", 0.4, "no axis yet"), 0.0)
    assert not done.hand_needed
    assert done.words == HANDS_OFF


def test_a_mount_that_turns_says_keep_clear():
    state = absorb(AlignmentState("turn", ""), Progress("turn", 0.3, "20 deg to the west"), 0.0)
    assert "Keep clear" in state.words
    assert "20 deg to the west" in state.words
    assert not state.hand_needed


def test_an_old_number_is_called_old():
    state = adjusting(300.0, 20.0, error_at_s=100.0)
    assert not state.old(101.0)
    assert "live 1 s ago" in state.age_words(101.0)
    assert state.old(100.0 + OLD_S + 0.1)
    assert state.age_words(120.0).startswith("OLD")
    lost = absorb(state, PolarUpdate("adjust", None, "clouded", solved=False), 101.0)
    assert lost.old(101.0)
    assert "not solved" in lost.age_words(101.0)


@pytest.mark.parametrize(
    ("altitude", "azimuth", "cures"),
    [
        (60.0, 60.0, ("▼ lower the axis", "◀ anticlockwise, seen from above")),
        (-60.0, -60.0, ("▲ raise the axis", "▶ clockwise, seen from above")),
    ],
)
def test_cures_undo_the_error(altitude, azimuth, cures):
    off = error(altitude, azimuth)
    assert tuple(f"{cure(off, knob).sign} {cure(off, knob).way}" for knob in Knob) == cures
    assert total_in_words(off).startswith("73″ ± ")


def test_one_uncertainty_is_told_everywhere_and_it_counts_flexure(qtbot):
    seen = error(60.0, 60.0, sigma_arcsec=3.0)
    off = replace(seen, flexure=np.diag([1.0, 1.0]) * (30.0 * ARCSEC) ** 2)
    assert total_in_words(off) == "73″ ± 30″"
    page = PhonePage("token")
    page.show(AlignmentState(error=off))
    served = page.answer("/token/now.json")
    assert served is not None
    assert json.loads(served[1])["sigma"] == "± 30″"
    assert signed_text(off, Knob.ALTITUDE).endswith("± 30″")
    assert altitude_in_words(off).startswith("60″ ± 30″")
    assert signed_text(off, Knob.AZIMUTH).endswith("± 44″"), "at the knob, not shortened by the altitude"
    bolts = BoltsView()
    qtbot.addWidget(bolts)
    bolts.show_state(AlignmentState("done", error=off), 0.0)
    assert bolts.face.total == "total 73″ ± 30″"
    number = NumberCard()
    qtbot.addWidget(number)
    number.show_state(AlignmentState("done", error=off), 0.0)
    assert (number.total.text(), number.sigma.text()) == ("73″", "± 30″")
    assert uncertainty_words(AlignmentState("done", error=off)) == "3″ measurement, 30″ possible flexure."
    assumed = PolarFinding(PolarFindingKind.FLEXURE_NOT_MEASURED, "Flexure not measured (±30″ assumed).")
    state = AlignmentState("done", error=off, findings=(assumed,))
    assert uncertainty_words(state) == "±30″, nearly all assumed flexure.", "what was not measured is not split"
    assert "not measured" in all_known(state)
    assert np.hypot(seen.sigma_total_arcsec, off.flexure_along_arcsec) == pytest.approx(
        off.with_systematics.sigma_total_arcsec
    )


def test_the_worse_axis_is_shown_until_a_bolt_is_named():
    assert AlignmentState(error=error(10.0, 300.0)).knob is Knob.AZIMUTH
    assert AlignmentState(error=error(300.0, 10.0)).knob is Knob.ALTITUDE
    assert adjusting(900.0, 100.0).knob is Knob.ALTITUDE


def test_findings_of_live_frames_replace_each_other(measured):
    _, _, measurement = measured
    far = PolarFinding(PolarFindingKind.REMEASURE, "measure again")
    state = AlignmentState("adjust", error=measurement.error, findings=(far,))
    again = absorb(state, PolarUpdate("measure", 0.0, "The first frame.", findings=()), 0.0)
    assert again.findings == (far,)  # nothing new is known yet


def test_a_bolt_turned_by_two_degrees_asks_to_measure_again(qtbot, measured):
    sky, states, measurement = measured
    task = adjust(sky, measurement, BoltTutor())
    first = absorb(states[-1], next(task), 0.0)
    sky.rig.mount.turn_bolts(180.0, 0.0)
    later, ended = follow(first, task, 1.0)
    sky.rig.mount.turn_bolts(-180.0, 0.0)
    assert ended.end is AdjustingEnd.LARGE_MOVE
    assert "Measure again" in most_urgent(later[-1], Message()).text


def test_stop_when_the_error_is_below_its_uncertainty(measured):
    off = error(40.0, 10.0, sigma_arcsec=60.0)
    told = BoltTutor().advise(off)
    state = AlignmentState("adjust", told.words, error=off, instruction=told)
    assert state.stop
    assert not state.hand_needed
    assert state.words.startswith("Finer than one sweep can tell (±6")


def test_the_wheel_turns_while_the_number_is_old_and_stops(qtbot):
    numbers = NumberCard()
    qtbot.addWidget(numbers)
    numbers.show_state(adjusting(300.0, 20.0), 1.0)
    assert not numbers.spinner.wheel.isActive()
    numbers.show_state(adjusting(300.0, 20.0), 100.0)
    assert numbers.spinner.wheel.isActive()
    before = numbers.spinner.grab().toImage()
    qtbot.waitUntil(lambda: numbers.spinner.grab().toImage() != before, timeout=5_000)
    numbers.show_state(AlignmentState("done", error=error(3.0, 3.0)), 200.0)
    assert not numbers.spinner.wheel.isActive()


# Cues.


class Heard:
    def __init__(self):
        self.cues = []

    def play(self, cue):
        self.cues.append(cue)

    def say(self, words):
        self.cues.append(words)


def test_what_is_heard():
    heard = Heard()
    sound_cues = SoundCues(heard)
    far, near = adjusting(900.0, 100.0), adjusting(200.0, 100.0)
    sound_cues.play_change(AlignmentState("measure"), far)
    assert heard.cues[0] is Cue.TURN
    assert "Altitude bolt" in heard.cues[1]
    nearer = AlignmentState("adjust", far.words, error=near.error, live=True, instruction=far.instruction)
    heard.cues.clear()
    sound_cues.play_change(far, nearer)
    assert heard.cues == [Cue.NEARER]
    sound_cues.play_change(nearer, far)
    assert heard.cues[-1] is Cue.FURTHER
    stop = adjusting(3.0, 3.0)
    assert stop.stop
    assert SoundCues(Heard()).cue_of(nearer, stop) is Cue.STOP
    lost = absorb(far, PolarUpdate("adjust", None, "clouded", solved=False), 1.0)
    assert SoundCues(Heard()).cue_of(far, lost) is Cue.LOST


def test_units_are_spoken():
    assert speech_text("12″ ± 3′") == "12 arc seconds plus or minus 3 arc minutes"


WITH_PLAYERS = pytest.mark.skipif(sys.platform == "win32", reason="Windows plays them itself (winsound)")


@WITH_PLAYERS
def test_cues_are_played_by_what_is_there_or_the_bell(tmp_path):
    rung = []
    silent = Cues(lambda: rung.append(1), find=lambda name: None)
    assert "bell only" in silent.description
    silent.play(Cue.TURN)
    assert not rung  # sounds are off until asked for
    silent.on = True
    silent.play(Cue.TURN)
    assert rung == [1]
    silent.close()


@WITH_PLAYERS
def test_a_player_is_given_a_file_of_tones(tmp_path, qtbot):
    kept = tmp_path / "heard.wav"
    player = tmp_path / "aplay"
    player.write_text(f'#!/bin/sh\ncp "$2" "{kept}.part"\nmv "{kept}.part" "{kept}"\n')
    player.chmod(0o755)
    cues = Cues(lambda: None, find=lambda name: str(player) if name == "aplay" else None)
    assert "tones by aplay" in cues.description
    cues.on = True
    cues.play(Cue.STOP)
    qtbot.waitUntil(kept.exists, timeout=10_000)
    cues.close()
    data = kept.read_bytes()
    assert data[:4] == b"RIFF"
    assert len(data) > 20_000  # 0.7 s at 22 kHz, two bytes each
    assert len(set(data[1000:9000])) > 50


@pytest.mark.parametrize("spoils", [False, True])
def test_a_spoilt_measurement_shows_the_error_but_no_way_to_turn(qtbot, spoils):
    finding = PolarFinding(PolarFindingKind.DISAGREE, "Something slipped.", spoils=spoils)
    state = replace(adjusting(300.0, 20.0), findings=(finding,))
    number, bolts, cards = NumberCard(), BoltsView(), [KnobCard(knob) for knob in Knob]
    for made in (number, bolts, *cards):
        qtbot.addWidget(made)
    number.show_state(state, 0.0)
    bolts.show_state(state, 0.0)
    for card in cards:
        card.show_state(state, 10.0)
    assert f"{number.total.text()} {number.sigma.text()}" == total_in_words(state.error)
    assert all((card.way.text() == "") is spoils for card in cards)
    assert (bolts.way() == "") is spoils
    assert most_urgent(state, Message()) == Message("Something slipped.", "wrong")


@pytest.mark.parametrize(
    ("state", "now_s"),
    [
        (AlignmentState("adjust", error=error(60.0, 60.0), live=True, error_at_s=99.0), 100.4),
        (AlignmentState("adjust", error=error(60.0, 60.0), live=True, error_at_s=99.0), 111.0),
        (AlignmentState("adjust", error=error(60.0, 60.0), live=True, error_at_s=99.0), 99.0 + OLD_S + 1.0),
        (AlignmentState("adjust", error=error(60.0, 60.0), live=True, error_at_s=99.0, solved=False), 140.0),
        (AlignmentState("ended", error=error(60.0, 60.0), error_at_s=99.0), 4000.0),
    ],
)
def test_phone_and_window_tell_one_age(qtbot, state, now_s):
    """The phone's page counts by itself: a window that hangs must not leave its last number young there."""
    page, number = PhonePage("token", lambda: now_s), NumberCard()
    qtbot.addWidget(number)
    page.show(state)
    number.show_state(state, now_s)
    (_, served) = page.answer("/token/now.json")
    told = json.loads(served)
    assert told["age"] == number.age.text() != ""
    assert told["old"] is (number.total.property("role") == "number_old")
