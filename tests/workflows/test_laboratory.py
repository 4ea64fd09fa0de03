"""The Laboratory's engine, without a window: fair, honest about wrong answers, stoppable."""

import csv
import io
from dataclasses import replace

import numpy as np
import pytest

from kochab.core.attitude import Attitude, attitude_from, small_rotation
from kochab.core.errors import UsageError
from kochab.core.frame import Detections
from kochab.core.progress import Progress, run
from kochab.core.registry import Registry
from kochab.core.solution import Identification, NoSolution, Reason
from kochab.identification import IDENTIFIERS
from kochab.lab.laboratory import comparison, scene
from kochab.lab.laboratory.comparison import (
    Choice,
    ComparedPart,
    FieldTruth,
    compare,
    compare_pointing,
    scale_hint,
    wrong_names,
)
from kochab.lab.laboratory.curves import POINTS, SWEEPS, TRIALS, curves, points_csv, sweeps_of, trials_csv
from kochab.lab.laboratory.scene import try_method, with_fitted_pointing
from kochab.simulate.random_fields import FieldPlan, random_field
from kochab.sky import open_catalogue

EASY = FieldPlan(30.0, 2048, 0.1, 0.0, 0.0, brightest=25)


def simulated_field(wish, seeds):
    return random_field(open_catalogue(), np.random.default_rng(seeds), wish)


@pytest.fixture(scope="module")
def easy():
    return simulated_field(EASY, (3, 1))


@pytest.fixture(scope="module")
def truth(easy):
    return FieldTruth(easy.camera, easy.attitude)


def identification(easy, attitude=None):
    found = run(IDENTIFIERS.make("patterns").identify(easy.detections, None))
    assert isinstance(found, Identification)
    return found if attitude is None else replace(found, attitude=attitude)


def with_methods(detections, choices, hint, truth, **more):
    tell = more.pop("tell", lambda _: None)
    tries = [(c.name, try_method(detections, c, hint, truth, **more)) for c in choices]
    return compare(tries, tell)


def test_methods_side_by_side_on_the_same_stars(easy, truth):
    heard = []
    choices = [Choice("patterns"), Choice("voting", {"margin_px": 1.0})]
    trials = run(with_methods(easy.detections, choices, scale_hint(truth), truth, tell=heard.append))
    assert heard == trials
    assert [t.name for t in trials] == ["patterns", "voting"]
    first = trials[0]
    assert first.right
    assert first.wrong == 0
    assert first.matches >= 5
    assert first.off_arcsec < 5 * truth.camera.scale_arcsec_px
    assert 0 < first.sigma_arcsec[0] < 60
    assert first.seconds > 0
    assert first.log10_false_alarm < -5
    assert not first.reason
    assert first.paper == "Kochab's own"
    assert trials[1].paper not in ("", first.paper)


def test_no_answer_says_why_and_is_not_a_wrong_one(easy, truth):
    (trial,) = run(with_methods(easy.detections, [Choice("voting")], None, truth))
    assert not trial.answered
    assert trial.right is False
    assert trial.reason == Reason.NO_PATTERN_AGREED
    assert "scale" in trial.advice
    assert trial.wrong is None


def test_without_a_truth_nobody_is_called_right_or_wrong(easy):
    (trial,) = run(with_methods(easy.detections, [Choice("patterns")], None, None))
    assert trial.answered
    assert trial.right is trial.wrong is trial.off_arcsec is None


def test_wrong_answers_and_wrong_names_are_counted(easy, truth):
    found = identification(easy)
    matches = found.matches
    assert compare_pointing(found.camera, found.attitude, truth)[0]
    assert wrong_names(matches.xy, matches.vectors, truth) == 0
    right, off_arcsec = compare_pointing(found.camera, attitude_from(10.0, 20.0, 30.0), truth)
    assert right is False
    assert off_arcsec > 1000
    swapped = np.roll(matches.vectors, 1, axis=0)
    assert wrong_names(matches.xy, swapped, truth) == len(matches)
    assert wrong_names(matches.xy, -matches.vectors, truth) == len(matches)  # behind the camera
    mirrored = replace(found.camera, mirrored=not found.camera.mirrored)
    assert compare_pointing(mirrored, found.attitude, truth)[0] is False


def test_what_noise_explains_is_not_wrong(easy, truth):
    found = identification(easy)
    beside = replace(found.camera, cx=found.camera.cx + 8.0)
    noisy = FieldTruth.of(easy, replace(EASY, noise_px=4.0))
    assert noisy.reach_px == 16.0
    assert FieldTruth.of(easy, EASY).reach_px == 5.0
    assert compare_pointing(beside, found.attitude, truth)[0] is False
    assert compare_pointing(beside, found.attitude, noisy)[0] is True


class Slow:
    """A method that makes a table the first time, or never ends."""

    paper = "a paper"
    made = 0
    closed = 0

    def __init__(self, forever=False):
        self.forever = forever

    def identify(self, detections, hint=None, year=2016.0):
        try:
            while self.forever:
                sum(range(20_000))
                yield Progress("identify")
            if not Slow.made:
                sum(range(3_000_000))
            Slow.made += 1
            yield Progress("identify", 0.5)
            return NoSolution(Reason.TOO_FEW_STARS, "More.", detections=len(detections))
        finally:
            Slow.closed += 1


@pytest.fixture
def slow(monkeypatch):
    Slow.made = Slow.closed = 0
    room = scene
    registry = Registry("method", "kochab.methods", {"slow": f"{__name__}:Slow"})
    monkeypatch.setattr(room, "IDENTIFIERS", registry)
    monkeypatch.setattr(room, "checked", lambda method, options: options)
    monkeypatch.setattr(room, "_used", set())
    monkeypatch.setitem(comparison.REGISTRIES, ComparedPart.METHOD, registry)


def test_making_tables_is_told_apart_from_the_search(slow, easy, truth):
    first = run(try_method(easy.detections, Choice("slow"), None, truth))
    again = run(try_method(easy.detections, Choice("slow"), None, truth))
    assert Slow.made == 3
    assert first.tables_s > 0
    assert first.seconds < first.tables_s
    assert again.tables_s == 0
    assert first.paper == "a paper"


def test_a_method_that_takes_too_long_is_stopped_and_said(slow, easy, truth):
    task = try_method(easy.detections, Choice("slow", {"forever": True}), None, truth, limit_s=0.05)
    trial = run(task)
    assert trial.reason == "timed out"
    assert Slow.closed == 1


def test_a_comparison_can_be_stopped_in_the_middle(slow, easy, truth):
    choices = [Choice("slow", {"forever": True}), Choice("slow")]
    task = with_methods(easy.detections, choices, None, truth)
    for _ in range(3):
        assert next(task).stage == "laboratory"
    task.close()
    assert Slow.closed == 1


def test_an_option_that_is_not_there_is_refused(easy, truth):
    with pytest.raises(UsageError, match="no option colour"):
        run(with_methods(easy.detections, [Choice("voting", {"colour": 1})], None, truth))


@pytest.mark.parametrize("method", IDENTIFIERS)
def test_every_method_can_stand_in_the_laboratory(method):
    """An empty list and a few points: no answer, no fault, whatever the method."""
    points = np.random.default_rng(1).uniform(0, 1000, (5, 2))
    truth = FieldTruth(simulated_field(EASY, (1,)).camera, attitude_from(0.0, 0.0, 0.0))
    hint = scale_hint(truth, 10.0)
    for xy in (np.zeros((0, 2)), points[:2]):
        found = Detections.from_list(xy, 1024, 1024)
        (trial,) = run(with_methods(found, [Choice(method)], hint, truth))
        assert not trial.answered
        assert trial.reason


def test_curves_count_answers_and_grow_round_by_round():
    heard = []
    wish = FieldPlan(30.0, 2048, 0.2, 0.0, 0.0, brightest=20)
    choices = [Choice("patterns")]
    points = run(curves(wish, ComparedPart.METHOD, choices, ("missing", "stars"), 2, tell=heard.append))
    wanted = {(s, v) for s in ("missing", "stars") for v in SWEEPS[s].values}
    assert {(p.sweep, p.value) for p in points} == wanted
    assert len(heard) == 2 * len(wanted)
    assert all(p.fields == 2 for p in points)
    assert {p.fields for p in heard} == {1, 2}
    at = {(p.sweep, p.value): p for p in points}
    assert at["missing", 0.0].success == 1.0
    assert at["stars", 4.0].right <= at["stars", 30.0].right == 2
    assert sum(p.wrong for p in points) == 0
    assert all(p.median_s > 0 for p in points)


def watched_fields(monkeypatch):
    """What the curves ask to be simulated, in a list that grows: settings and seeds."""
    asked = []

    def watched(kind, wish, seeds):
        asked.append((wish, seeds))
        return scene.simulated_scene(kind, wish, seeds)

    monkeypatch.setattr("kochab.lab.laboratory.curves.simulated_scene", watched)
    return asked


def test_the_same_seed_gives_the_same_fields_to_every_method(monkeypatch):
    asked = watched_fields(monkeypatch)
    choices = [Choice("patterns"), Choice("neighbours")]
    run(curves(EASY, ComparedPart.METHOD, choices, ("noise_px",), 1, seed=5))
    assert len(asked) == len(set(asked)) == len(SWEEPS["noise_px"].values)  # one for both methods
    again = simulated_field(*asked[0])
    assert np.array_equal(again.detections.xy, simulated_field(*asked[0]).detections.xy)
    assert len({seeds for _, seeds in asked}) == len(asked)


def test_an_option_is_varied_only_where_it_is_known_and_on_the_same_fields(monkeypatch):
    asked = watched_fields(monkeypatch)
    choices = [Choice("patterns"), Choice("voting")]
    points = run(curves(EASY, ComparedPart.METHOD, choices, ("margin_px",), 1))
    assert {p.name for p in points} == {"voting"}
    assert [p.value for p in points] == list(SWEEPS["margin_px"].values)
    assert len(set(asked)) == 1


def test_curves_of_detectors_count_the_stars_they_found():
    wish = FieldPlan(25.0, 400, 0.05, 0.0, 0.0, brightest=15)
    choices = [Choice("auto"), Choice("contours")]
    points = run(curves(wish, ComparedPart.DETECTOR, choices, ("noise_px",), 2))
    at = {(p.name, p.value): p for p in points}
    assert len(at) == 2 * len(SWEEPS["noise_px"].values)
    for name in ("auto", "contours"):
        assert at[name, 0.0].found > at[name, 4.0].found
        assert at[name, 0.0].fields == 2
    assert at["auto", 0.0].found > 0.8
    assert all(at["auto", v].found >= at["contours", v].found for v in (0.25, 0.5, 1.0))
    assert all(p.median_s > 0 for p in points)
    assert not any(SWEEPS[name].option for name in sweeps_of(ComparedPart.DETECTOR))


def test_curves_of_estimators_tell_the_error_where_there_is_an_answer():
    choices = [Choice("fit"), Choice("triad")]
    points = run(curves(EASY, ComparedPart.ATTITUDE, choices, ("noise_px",), 3))
    at = {(p.name, p.value): p for p in points}
    assert at["fit", 4.0].off_arcsec > 10 * at["fit", 0.0].off_arcsec
    assert at["fit", 2.0].off_arcsec < at["triad", 2.0].off_arcsec
    assert all(p.found is None for p in points)
    none = run(curves(EASY, ComparedPart.ATTITUDE, choices, ("noise_px",), 1, limit_s=-1.0))
    assert len(none) == len(points)
    assert all(p.off_arcsec is None for p in none)
    assert all(p.median_s == p.right == p.wrong == 0 for p in none)


def test_tables_export_every_number(easy, truth):
    trials = run(with_methods(easy.detections, [Choice("patterns"), Choice("voting")], None, truth))
    rows = list(csv.DictReader(io.StringIO(trials_csv(trials))))
    assert tuple(rows[0]) == TRIALS
    assert rows[0]["answered"] == "yes"
    assert float(rows[0]["ra_deg"]) == pytest.approx(trials[0].ra_dec_deg[0], abs=1e-3)
    assert rows[1]["answered"] == "no"
    assert rows[1]["ra_deg"] == rows[1]["wrong"] == ""
    points = run(curves(EASY, ComparedPart.METHOD, [Choice("patterns")], ("missing",), 1))
    lines = list(csv.DictReader(io.StringIO(points_csv(points))))
    assert tuple(lines[0]) == POINTS
    assert [float(r["value"]) for r in lines] == list(SWEEPS["missing"].values)
    assert float(lines[0]["success"]) == points[0].success


def test_an_answer_is_judged_by_what_a_fit_makes_of_its_names(easy, truth):
    found = identification(easy)
    turn = small_rotation(np.array([9.0, 0.0, 0.0]) / found.camera.focal_px)
    nudged = replace(found, attitude=Attitude(turn @ found.attitude.matrix))
    assert compare_pointing(nudged.camera, nudged.attitude, truth)[0] is False
    better = with_fitted_pointing(nudged)
    assert compare_pointing(better.camera, better.attitude, truth)[0] is True
    assert 0.0 < max(better.attitude.sigma_arcsec[:2]) < 60.0
