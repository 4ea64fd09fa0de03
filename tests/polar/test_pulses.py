"""What a guider's pulses did, of loops written down here and behind the gears of tests.nights."""

import re

import numpy as np
import pytest

from kochab.core.frame import Site
from kochab.lab.bench import polar_guided as bench
from kochab.polar.error import CHI2_95
from kochab.polar.measure import PolarFindingKind
from kochab.polar.pole import Pole
from kochab.polar.pulses import behind_play, pulse_response
from kochab.sky.horizon import Refraction
from kochab.workflows.polar.solutions import FilesRequest, axis_of
from tests.nights.guide_logs import Play

STEP_S = 3.0


def loop(scale, seed, *, seeing=0.1, shared=0.0, play=0.0, dithered=True, frames=900, drift=0.004):
    """Time, star, pulses as calibrated and level of a guider whose pulses move the star ``scale`` times as far, px."""
    rng, gear, lock, noise = np.random.default_rng(seed), Play(play), 0.0, 0.0
    rows, moved, level = [], 0.0, 0
    for k in range(frames):
        if dithered and k % 90 == 89:
            lock, level = lock + rng.uniform(-4.0, 4.0), level + 1
        noise = shared * noise + np.sqrt(1.0 - shared**2) * rng.normal(0.0, seeing)
        star = drift * k + gear.telescope - lock + noise
        rows.append((k * STEP_S, star, moved, level))
        if abs(star) > 0.15:
            moved -= 0.8 * star
            gear.turn(-0.8 * star * scale)
    return np.array(rows).T


@pytest.mark.parametrize(("shared", "play"), [(0.0, 0.0), (0.3, 0.0), (0.7, 0.0), (0.0, 1.5), (0.3, 1.5)])
def test_dithers_tell_how_far_pulses_move_whatever_the_seeing_and_the_gears(shared, play):
    pulls = []
    for seed, scale in enumerate((0.7, 0.85, 1.0, 1.15, 1.3, 1.45)):
        told = pulse_response(*loop(scale, seed, shared=shared, play=play))
        if told is not None:
            pulls.append((told.scale - scale) / told.sigma)
            assert told.sigma < 0.1
    assert len(pulls) >= 3
    assert np.abs(pulls).max() < 3.0
    assert np.sqrt(np.mean(np.square(pulls))) < 1.5


def test_what_gears_swallowed_is_left_out():
    _, _, pushed, _ = rows = loop(1.0, 1, play=1.5, seeing=0.05)
    told = pulse_response(*rows)
    gear = Play(1.5)
    truth = []
    for step in np.diff(pushed, prepend=0.0):
        gear.turn(step)
        truth.append(gear.telescope)
    off = told.moved - np.array(truth)
    assert np.ptp(off) < 0.4
    assert np.ptp(pushed - np.array(truth)) > 1.0


def test_an_axis_behind_play_goes_as_that_of_the_nights():
    rng = np.random.default_rng(2)
    motor = np.cumsum(rng.normal(0.0, 1.0, 200))
    plays = np.array([0.0, 0.5, 3.0])
    ours = behind_play(motor, plays, np.zeros(3))
    for column, width in enumerate(plays):
        gear = Play(width, motor[0], motor[0])
        theirs = []
        for step in np.diff(motor, prepend=motor[0]):
            gear.turn(step)
            theirs.append(gear.telescope)
        assert ours[:, column] == pytest.approx(theirs)


def test_too_little_tells_nothing():
    assert pulse_response(*loop(1.0, 1, frames=50)) is None
    time_s, star, _, level = loop(1.0, 1)
    assert pulse_response(time_s, star, np.zeros(len(star)), level) is None
    assert pulse_response(*loop(1.0, 1, frames=120, dithered=False, seeing=0.01, drift=0.0)) is None


CHI2_99 = 9.2103  # two degrees of freedom


def answers(path, text, evening):
    """Of a log: with no word of its sign, and with each."""
    head = "PHD2 version 2.6.13, Log version 2.5. Log enabled at 2026-03-14 20:00:00"
    path.write_text(f"{head}\n{text}")
    told = FilesRequest(Site(evening.latitude_deg, 0.0), Pole.TRUE, Refraction(0.0))
    return [
        axis_of([], [], [str(path)], FilesRequest(told.site, told.pole, told.refraction, dec_sign=sign)).result
        for sign in (0, 1, -1)
    ]


def distance2(drift, evening):
    return drift.error.with_systematics.distance2(evening.axis)


@pytest.mark.parametrize("kind", ["dithers", "Dec reversed"])
def test_pulses_proved_to_go_against_the_calibration_leave_north_unknown(kind, tmp_path):
    """The same star, the letters of its Dec pulses turned round: what the log says of its parity counts no more."""
    proved = 0
    for seed in range(2):
        rng = np.random.default_rng([29, seed])
        evening = bench.replace(bench.drawn(kind, rng), dithered=True, minutes=40.0)
        text = bench.log_of(evening, rng)
        plain, *_ = answers(tmp_path / "PHD2_GuideLog.txt", text, evening)
        assert not plain.spoilt
        turned = re.sub(r",([NS])(?=,,,1500)", lambda way: f",{'NS'[way[1] == 'N']}", text)
        unsaid, north, south = answers(tmp_path / "PHD2_GuideLog.txt", turned, evening)
        right, wrong = (south, north) if evening.north > 0 else (north, south)
        doubts = [finding for finding in unsaid.findings if finding.kind is PolarFindingKind.DEC_SIGN]
        if not doubts:
            continue
        proved += 1
        assert unsaid.spoilt
        assert "against the calibration" in doubts[0].text
        assert unsaid.otherwise is not None
        assert not right.spoilt
        assert distance2(right, evening) < CHI2_99
        assert right.error.axis == pytest.approx(plain.error.axis, abs=2e-4)
        assert distance2(wrong, evening) > distance2(right, evening) + CHI2_95
    assert proved >= 1
