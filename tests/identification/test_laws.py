"""Laws that every registered method keeps, on a field of the kind it is made for.

A method that answers rightly, or not at all, keeps a law; a confident wrong answer breaks it.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from kochab.core.frame import Detections, Hint
from kochab.core.progress import run
from kochab.core.solution import Identification, NoSolution, Reason
from kochab.identification import IDENTIFIERS
from kochab.simulate.random_fields import FieldPlan, RandomField, random_field
from kochab.sky import open_catalogue

NEAR = np.cos(np.radians(0.2))
LAW = settings(max_examples=4, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])


@dataclass(frozen=True)
class Home:
    """The field a method is at home in: width, stars in it, options; ``place`` if it needs one."""

    width_deg: float
    stars: int
    options: dict[str, Any] = field(default_factory=dict)
    size_px: int = 2048
    place: bool = False


HOMES = {
    "patterns": Home(12.0, 25),
    "voting": Home(15.0, 14, {"margin_px": 1.0}),
    "triads": Home(14.0, 9, {"separation_deg": 0.02, "scales": 1, "stars": 9}),
    "angles": Home(8.0, 12),
    "spherical_triangles": Home(8.0, 10, {"stars": 10}),
    "neighbours": Home(30.0, 24, {"tolerance_deg": 0.02}),
    "predict": Home(12.0, 25, place=True),
}
METHODS = pytest.mark.parametrize("name", sorted(IDENTIFIERS))


def test_every_method_has_a_home() -> None:
    assert set(HOMES) == set(IDENTIFIERS)


@lru_cache(maxsize=len(HOMES))
def solved(name: str) -> tuple[RandomField, Identification]:
    """A field, all of whose stars are in its inscribed circle, and the method's right answer."""
    home, rng = HOMES[name], np.random.default_rng(12)
    plan = FieldPlan(
        home.width_deg,
        home.size_px,
        noise_px=0.1,
        missing=0.0,
        spurious=0.0,
        magnitude_scatter=0.0,
        brightest=3 * home.stars,
    )
    for _ in range(30):
        made = random_field(open_catalogue(), rng, plan)
        off = np.linalg.norm(made.detections.xy - (home.size_px - 1) / 2, axis=1)
        within = np.flatnonzero(off < home.size_px / 2 - 2)[: home.stars]
        made = replace(made, detections=made.detections.take(within))
        found = answer(name, made.detections, made)
        if isinstance(found, Identification):
            assert right(found, made)
            return made, found
    raise AssertionError(f"{name} has solved none of thirty of its own fields")


def answer(name: str, detections: Detections, truth: RandomField) -> Identification | NoSolution:
    scale = truth.camera.scale_arcsec_px
    centre = (*truth.attitude.ra_dec_deg, 0.5) if HOMES[name].place else None
    method = IDENTIFIERS.make(name, **HOMES[name].options)
    return run(method.identify(detections, Hint((scale / 1.001, scale * 1.001), centre)))


def right(found: Identification, truth: RandomField, mirrored: bool = False) -> bool:
    same = found.attitude.boresight @ truth.attitude.boresight > NEAR
    return bool(same) and found.camera.mirrored == (truth.camera.mirrored ^ mirrored)


def named(found: Identification) -> dict[tuple[float, float], int]:
    xy = np.round(found.matches.xy, 6).tolist()
    return {(x, y): s for (x, y), s in zip(xy, found.matches.star.tolist(), strict=True)}


def listed(truth: RandomField, xy: np.ndarray, flux: np.ndarray | None = None) -> Detections:
    return Detections.from_list(xy, truth.detections.width, truth.detections.height, flux)


def right_or_none(found: Identification | NoSolution, truth: RandomField, mirrored=False) -> None:
    if isinstance(found, NoSolution):
        assert found.advice
        return
    assert found.log10_false_alarm <= -5.0
    assert right(found, truth, mirrored)


@METHODS
@LAW
@given(seed=st.integers(0, 2**31))
def test_the_order_of_the_list_does_not_matter(name, seed) -> None:
    """With their brightnesses, the same stars in any order have the same names."""
    truth, before = solved(name)
    order = np.random.default_rng(seed).permutation(len(truth.detections))
    shuffled = listed(truth, truth.detections.xy[order], truth.detections.flux[order])
    after = answer(name, shuffled, truth)
    assert isinstance(after, Identification)
    assert named(after) == named(before)
    bare = listed(truth, truth.detections.xy[order])
    right_or_none(answer(name, bare, truth), truth)


@METHODS
@LAW
@given(turn_deg=st.floats(-180.0, 180.0))
def test_a_rolled_camera_sees_the_same_stars(name, turn_deg) -> None:
    truth, before = solved(name)
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    middle = (truth.detections.width - 1) / 2
    xy = (truth.detections.xy - middle) @ np.array([[c, s], [-s, c]]) + middle
    after = answer(name, listed(truth, xy), truth)
    right_or_none(after, truth)
    if isinstance(after, NoSolution):
        assert name in ("patterns", "neighbours")  # they look at neighbours near an edge
        return
    stars = dict(zip(after.matches.detection.tolist(), after.matches.star.tolist(), strict=True))
    for k, star in zip(before.matches.detection.tolist(), before.matches.star, strict=True):
        assert stars.get(k, star) == star
    rolled = (after.attitude.roll_deg - before.attitude.roll_deg + 180.0) % 360.0 - 180.0
    expected = -turn_deg if truth.camera.mirrored else turn_deg
    assert abs((rolled - expected + 180.0) % 360.0 - 180.0) < 0.5


@METHODS
@LAW
@given(seed=st.integers(0, 2**31), share=st.floats(0.1, 2.0))
def test_false_stars_never_make_a_confident_wrong_answer(name, seed, share) -> None:
    truth, _ = solved(name)
    rng = np.random.default_rng(seed)
    false = rng.uniform(0, truth.detections.width - 1, (round(share * len(truth.detections)), 2))
    xy = np.concatenate([truth.detections.xy, false])
    flux = np.concatenate([truth.detections.flux, rng.choice(truth.detections.flux, len(false))])
    right_or_none(answer(name, listed(truth, xy, flux), truth), truth)


@METHODS
@LAW
@given(seed=st.integers(0, 2**31), stars=st.integers(3, 60))
def test_points_that_are_no_stars_have_no_answer(name, seed, stars) -> None:
    truth, _ = solved(name)
    points = np.random.default_rng(seed).uniform(0, truth.detections.width - 1, (stars, 2))
    assert isinstance(answer(name, listed(truth, points), truth), NoSolution)


@METHODS
@pytest.mark.parametrize("stars", [0, 1, 2])
def test_too_few_stars_have_no_answer(name, stars) -> None:
    truth, _ = solved(name)
    found = answer(name, truth.detections.take(slice(0, stars)), truth)
    assert isinstance(found, NoSolution)
    assert found.reason == Reason.TOO_FEW_STARS
    assert found.detections == stars


@METHODS
def test_a_mirrored_picture_is_told_from_a_plain_one(name) -> None:
    truth, _ = solved(name)
    xy = truth.detections.xy * [-1, 1] + [truth.detections.width - 1, 0]
    found = answer(name, listed(truth, xy), truth)
    assert isinstance(found, Identification)
    right_or_none(found, truth, mirrored=True)


@METHODS
def test_stars_on_a_line_have_no_answer(name) -> None:
    truth, _ = solved(name)
    along = np.sort(np.random.default_rng(4).uniform(50, 1900, 14))
    for xy in (np.stack([along, along], 1), np.stack([along, np.full(14, 700.0)], 1)):
        assert isinstance(answer(name, listed(truth, xy), truth), NoSolution)


@METHODS
def test_stars_listed_twice_do_no_harm(name) -> None:
    truth, _ = solved(name)
    twice = np.repeat(truth.detections.xy, 2, axis=0)
    right_or_none(answer(name, listed(truth, twice), truth), truth)
    one_place = np.repeat(truth.detections.xy[:1], 20, axis=0)
    assert isinstance(answer(name, listed(truth, one_place), truth), NoSolution)


@METHODS
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_stars_without_a_place_are_set_aside(name, bad) -> None:
    truth, _ = solved(name)
    xy = np.insert(truth.detections.xy, [0, 3, 5], bad, axis=0)
    xy[6, 0] = truth.detections.xy[3, 0]
    found = answer(name, listed(truth, xy), truth)
    right_or_none(found, truth)
    if isinstance(found, Identification):
        assert np.isfinite(found.matches.xy).all()
        np.testing.assert_array_equal(xy[found.matches.detection], found.matches.xy)
    nothing = listed(truth, np.full((12, 2), bad))
    assert isinstance(answer(name, nothing, truth), NoSolution)
