"""The Laboratory's detectors: one picture, every way to find its stars, all else as ever."""

import csv
import io
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.errors import UsageError
from kochab.core.frame import Frame, Hint
from kochab.core.progress import run
from kochab.core.solution import Reason
from kochab.detection import DETECTORS
from kochab.lab.laboratory.comparison import (
    REACH_PX,
    REGISTRIES,
    Choice,
    ComparedPart,
    FieldTruth,
    counted,
    scale_hint,
    try_detector,
)
from kochab.lab.laboratory.curves import trials_csv
from kochab.lab.laboratory.scene import LARGEST_PX, Scene, comparison, simulated_scene
from kochab.simulate.random_fields import FieldPlan, random_picture
from kochab.sky import open_catalogue

BRIGHT = FieldPlan(20.0, 700, 0.03, 0.0, 0.1, brightest=30)
compared = partial(comparison, scale=True, place=False, limit_s=20.0, tell=lambda _: None)


def simulated_picture(wish, seeds):
    return random_picture(open_catalogue(), np.random.default_rng(seeds), wish)


@pytest.fixture(scope="module")
def picture():
    return simulated_picture(BRIGHT, (9,))


@pytest.fixture(scope="module")
def truth(picture):
    return FieldTruth.of(picture, BRIGHT)


@pytest.fixture(scope="module")
def trials():
    choices = [Choice(name) for name in DETECTORS]
    scene = simulated_scene(ComparedPart.DETECTOR, BRIGHT, (9,))
    return {t.name: t for t in run(compared(scene, ComparedPart.DETECTOR, choices))}


@pytest.mark.parametrize("name", DETECTORS)
def test_every_detector_finds_the_bright_stars_of_asimulated_picture(trials, name):
    trial = trials[name]
    assert trial.kind is ComparedPart.DETECTOR
    assert trial.right
    assert trial.wrong == 0
    assert trial.found.there == 30
    assert 20 <= trial.found.true <= trial.found.stars
    assert trial.matches <= trial.found.stars
    assert 0 < trial.found.error_px < 0.6
    assert 0 < trial.rms_px < 2.0
    assert 0 < trial.seconds < 10
    assert trial.sigma_arcsec[0] > 0


def test_the_default_finds_every_star_and_no_hot_pixel(trials):
    assert trials["auto"].found.true == trials["auto"].found.stars == 30
    assert trials["auto"].found.error_px == min(t.found.error_px for t in trials.values())
    assert trials["auto"].paper == "Kochab's own"
    assert "2018" in trials["gaussian"].paper


def test_options_reach_the_detector(picture, truth):
    task = partial(try_detector, picture.frame, hint=scale_hint(truth), truth=truth)
    few = run(task(Choice("clusters", {"max_stars": 5}), places=picture.places))
    assert few.found.stars == 5
    with pytest.raises(UsageError, match="no option colour"):
        run(task(Choice("clusters", {"colour": 1})))
    with pytest.raises(UsageError, match="no detector 'eye'"):
        run(task(Choice("eye")))


@pytest.mark.parametrize("name", DETECTORS)
def test_a_picture_without_stars_gives_no_answer_and_a_reason(name):
    empty = np.random.default_rng(1).normal(500.0, 10.0, (300, 300)).astype(np.uint16)
    trial = run(try_detector(Frame(empty), Choice(name), None, None))
    assert not trial.answered
    assert trial.right is None
    assert trial.reason in list(Reason)
    assert trial.advice
    assert trial.found.true is None


def test_without_true_places_the_stars_are_only_counted(picture, truth):
    trial = run(try_detector(picture.frame, Choice("auto"), scale_hint(truth), None))
    assert trial.answered
    assert trial.right is trial.wrong is None
    assert trial.found.stars > 25
    assert trial.found.true is trial.found.error_px is None


def test_a_wrong_picture_is_told_as_wrong(picture, truth):
    elsewhere = replace(truth, attitude=simulated_picture(BRIGHT, (5,)).attitude)
    trial = run(try_detector(picture.frame, Choice("auto"), Hint(), elsewhere))
    assert trial.right is False
    assert trial.wrong == trial.matches > 0


def test_a_list_of_stars_has_no_picture_and_a_huge_picture_is_refused():
    with pytest.raises(UsageError, match="no image"):
        run(compared(simulated_scene(ComparedPart.METHOD, BRIGHT, (1,)), ComparedPart.DETECTOR, [Choice("auto")]))
    huge = replace(BRIGHT, size_px=LARGEST_PX + 1)
    with pytest.raises(UsageError, match="px wide at most"):
        run(simulated_scene(ComparedPart.DETECTOR, huge, (1,)))
    with pytest.raises(UsageError, match="Open a frame first"):
        run(compared(None, ComparedPart.DETECTOR, [Choice("auto")]))


def test_a_frame_is_looked_at_by_the_default_where_nobody_did_before(picture, truth):
    def scene():
        yield from ()
        return Scene(frame=picture.frame, truth=truth)

    for kind in (ComparedPart.METHOD, ComparedPart.ATTITUDE):
        (trial,) = run(compared(scene(), kind, [Choice(next(iter(REGISTRIES[kind])))]))
        assert trial.right
        assert trial.found is None


def test_the_table_tells_what_was_found(trials):
    rows = {r["name"]: r for r in csv.DictReader(io.StringIO(trials_csv(trials.values())))}
    assert rows["auto"]["compared"] == "detector"
    assert rows["auto"]["stars_true"] == rows["auto"]["stars_found"]
    assert rows["auto"]["stars_there"] == "30"
    assert float(rows["peaks"]["place_error_px"]) > float(rows["auto"]["place_error_px"])
    assert rows["auto"]["from_fit_arcsec"] == ""


@given(st.integers(0, 10_000), st.integers(0, 30), st.integers(0, 20), st.floats(0.0, 1.0))
def test_true_ones_are_counted_once_whatever_their_order_and_company(seed, stars, false, shift):
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(np.arange(8), np.arange(8)), axis=-1).reshape(-1, 2) * 40.0
    places = rng.permutation(grid)[:stars]
    turn = rng.uniform(0, 2 * np.pi, stars)
    seen = places + shift * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    beside = rng.permutation(grid)[:false] + 20.0  # farther than the reach from any star
    told = counted(rng.permutation(np.concatenate([seen, seen + 0.1, beside])), places)
    assert told.stars == 2 * stars + false
    assert told.true == told.there == stars
    assert told.error_px is None or told.error_px <= (shift + 0.2) / np.sqrt(2.0)
    assert (told.error_px is None) == (stars == 0)
    far = counted(seen + 2 * REACH_PX, places)
    assert far.true == 0
