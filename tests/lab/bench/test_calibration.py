"""The counts of hostile lists: what is counted, and that no claim is reached oftener than it promises."""

from types import SimpleNamespace

import numpy as np
import pytest

from kochab.identification.verification import ACCEPT_LOG10
from kochab.lab.bench.identify_hostile import WAYS, chance_of_so_many, shape_answer
from kochab.lab.methods import confirmation, voting
from kochab.solver import track_windows

from .calibration import A_PART, counted, draw, every_claim, interval, reaching


def test_the_lists_counted_so_far_were_refused_and_none_claims_what_it_does_not_keep():
    kept = counted()
    assert kept["lists"] == sum(way["lists"] for way in kept["ways"].values()) >= 1000
    for name, way in kept["ways"].items():
        assert way["wrong"] == 0, name
        assert sum(way["claims"]) == way["lists"] == A_PART[name] * kept["parts"], name
    for ways in (list(kept["ways"].values()), *([way] for way in kept["ways"].values())):
        lists, seen = reaching(ways)
        for k, count in enumerate(seen.tolist(), 1):
            assert chance_of_so_many(count, lists * 10.0 ** (-k / 2)) > 1e-4, (k, count, lists)


def test_counts_reach_every_higher_claim_too_and_their_limits_are_poisson_s():
    one = {"lists": 10, "claims": [6, 3, 0, 1]}
    lists, seen = reaching([one, one])
    assert lists == 20
    assert seen.tolist() == [8, 2, 2]
    low, high = interval(np.array([0, 1, 10]))
    assert low == pytest.approx([0.0, 0.0253, 4.795], abs=1e-3)
    assert high == pytest.approx([3.689, 5.572, 18.39], abs=1e-2)


def test_a_refused_verdict_s_claim_is_heard_and_stays_refused(monkeypatch):
    """Tracking and the published methods keep the claim of what they refuse to themselves."""
    verdicts = iter([None, SimpleNamespace(log10_false_alarm=-3.2), SimpleNamespace(log10_false_alarm=-6.0)])
    monkeypatch.setattr(confirmation, "confirm", lambda *given: next(verdicts))
    with every_claim() as claims:
        assert voting.confirm() is None
        assert voting.confirm() is None
        assert voting.confirm() is not None
        assert track_windows.ACCEPT_LOG10 == 0.0
    assert claims == [-3.2, -6.0]
    assert track_windows.ACCEPT_LOG10 == ACCEPT_LOG10


def test_a_list_s_random_hints_are_its_own_so_that_a_night_may_begin_anywhere(monkeypatch):
    monkeypatch.setitem(WAYS, "tracking", (lambda points, rng: -rng.random(), 2.0))
    alone = shape_answer("arcs", "tracking", 7)
    before = shape_answer("arcs", "tracking", 6)
    assert shape_answer("arcs", "tracking", 7)["claim"] == alone["claim"] != before["claim"]
    assert not alone["wrong"]
    monkeypatch.setitem(WAYS, "tracking", (lambda points, rng: ACCEPT_LOG10, 2.0))
    assert shape_answer("arcs", "tracking", 7)["wrong"]


def test_the_picture_is_small(tmp_path):
    draw(counted(), tmp_path / "plot.png")
    assert 3_000 < (tmp_path / "plot.png").stat().st_size < 60_000
