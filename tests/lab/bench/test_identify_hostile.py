"""The hostile lists' own truths, and when their goals are met."""

import numpy as np
import pytest

from kochab.core.solution import Solution
from kochab.identification.verification import ACCEPT_LOG10
from kochab.lab.bench.identify_hostile import FIELDS, WAYS, chance_of_so_many, hostile_goals, likeness_answer, off_px
from kochab.lab.bench.identify_shapes import SHAPES, shape_list


@pytest.mark.parametrize("name", FIELDS)
def test_a_field_is_where_its_truths_say(name):
    detections, truths = FIELDS[name](np.random.default_rng(4))
    assert len(truths) == (1 if name == "stretched field" else 2)
    assert (np.diff(detections.flux) <= 0).all()
    for field, _, shift in truths:
        answer = Solution(field.camera, field.attitude, (), 0.0, -9.0, "truth")
        still = (field, np.eye(2), np.zeros(2))
        assert off_px(answer, still) < 1.0
        moved = (field, np.eye(2), np.array([30.0, 40.0]))
        assert off_px(answer, moved) == pytest.approx(50.0, abs=1.0)
        assert np.abs(shift).max() <= 80.0


@pytest.mark.parametrize("way", ["scale to 2 %", "tracking", "voting"])
def test_a_way_says_something_of_every_shape(way):
    for shape in SHAPES.values():
        answer = WAYS[way][0](shape_list(shape, 5, 1), np.random.default_rng(1))
        assert not isinstance(answer, Solution)
        assert not isinstance(answer, float) or answer == 0.0


def test_the_goals_are_missed_by_one_wrong_answer_and_by_a_bound_that_promises_too_much():
    row = {"fields": "arcs", "mode": "blind", "n": 1000, "wrong": 0, "least_log10": -2.5}
    claims = {"below_1e-2": 9, "below_1e-3": 1, "below_1e-4": 0}
    assert all(goal.met for goal in hostile_goals([row | claims]))
    assert not hostile_goals([row | claims | {"wrong": 1}])[0].met
    assert not hostile_goals([row | claims, {"fields": "ghost", "wrong": 1}])[1].met
    assert not hostile_goals([row | claims | {"below_1e-4": 3}])[2].met
    assert chance_of_so_many(0, 0.1) == 1.0
    assert chance_of_so_many(1, 0.1) == pytest.approx(1.0 - np.exp(-0.1))


def test_a_true_field_told_a_wrong_scale_counts_as_one_without_truth() -> None:
    rows = [likeness_answer(number) for number in range(12)]
    assert not any(row["wrong"] for row in rows)
    assert min(row["claim"] for row in rows) > ACCEPT_LOG10
    assert likeness_answer(3)["claim"] == rows[3]["claim"]
