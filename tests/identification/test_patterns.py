import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.progress import run
from kochab.core.solution import Identification, NoSolution, Reason
from kochab.identification import IDENTIFIERS
from kochab.identification.patterns import Patterns, SearchStage
from kochab.identification.quads import image_quads
from kochab.identification.verification import ACCEPT_LOG10

STAGES = (
    SearchStage(12, 6, 1.0, 0.004, 40, focal=(1.9, 1.42, 1.08)),
    SearchStage(24, 6, 1.0, 0.006, 50, focal=(1.9, 1.42, 1.08), spread=3.0),
)
WIDTH, HEIGHT = 1200, 900


def view(sky, ra, dec, roll, fov=32.0, mirrored=False, seed=0, missing=0.1, false=4):
    attitude = attitude_from(ra, dec, roll)
    focal = WIDTH / 2 / np.tan(np.radians(fov) / 2)
    camera = Camera.centred(WIDTH, HEIGHT, focal, mirrored)
    rng = np.random.default_rng(seed)
    xy = camera.project(sky @ attitude.matrix.T)
    with np.errstate(invalid="ignore"):
        inside = (xy > 0).all(axis=1) & (xy[:, 0] < WIDTH) & (xy[:, 1] < HEIGHT)
    star = np.nonzero(inside)[0][:40]
    star = star[rng.random(len(star)) > missing]
    seen = xy[star] + rng.normal(0, 0.2, (len(star), 2))
    rank = np.concatenate([star, rng.choice(star, false) + 0.5])
    seen = np.concatenate([seen, rng.uniform(0, 900, (false, 2))])
    return attitude, camera, Detections.from_list(seen[np.argsort(rank)], WIDTH, HEIGHT)


@pytest.fixture(scope="module")
def method(toy_volume):
    return Patterns((toy_volume,), STAGES)


def off_deg(answer, attitude):
    return np.degrees(np.linalg.norm(answer.attitude.boresight - attitude.boresight))


@given(st.floats(0, 360), st.floats(-89, 89), st.floats(-180, 180), st.booleans(), st.integers(0, 10**6))
@settings(max_examples=40)
def test_any_pointing_roll_and_parity(toy_sky, method, ra, dec, roll, mirrored, seed):
    attitude, camera, detections = view(toy_sky, ra, dec, roll, mirrored=mirrored, seed=seed)
    answer = run(method.identify(detections))
    assert isinstance(answer, Identification)
    assert off_deg(answer, attitude) < 0.1
    assert answer.camera.mirrored == mirrored
    assert answer.camera.focal_px == pytest.approx(camera.focal_px, rel=0.01)
    assert answer.log10_false_alarm < ACCEPT_LOG10
    # the rows are the catalogue's, which the toy sky starts at 100
    error = camera.project(toy_sky[answer.matches.star - 100] @ attitude.matrix.T)
    assert np.median(np.abs(error - answer.matches.xy)) < 1.0


@pytest.mark.parametrize("share", [0.1, 1e-2, 1e-3, 1e-4])
def test_the_better_the_scale_is_known_the_surer_the_answer(toy_sky, method, share):
    """A pair of stars tells the scale worse than that: it must not contradict who knows it."""
    for seed in range(12):
        place = (30.0 * seed, 5.0 * seed - 30.0, 70.0)
        attitude, camera, detections = view(toy_sky, *place, seed=seed)
        scale = camera.scale_arcsec_px
        hint = Hint(scale_arcsec_px=(scale / (1.0 + share), scale * (1.0 + share)))
        answer = run(method.identify(detections, hint))
        assert isinstance(answer, Identification)
        assert off_deg(answer, attitude) < 0.1


def test_a_scale_known_better_than_a_supposed_one_stands_for_is_asked_about_once(toy_sky, method):
    """Between two supposed focal lengths as at one of them, and to the ends of what it stands for."""
    xy, asked = np.random.default_rng(5).uniform(0, 900, (40, 2)), []
    for side, share in ((1.9, 1.01), (1.643, 1.1), (1.643, 1.17)):
        scale = Camera.centred(WIDTH, HEIGHT, side * WIDTH).scale_arcsec_px
        answer = run(
            method.identify(
                Detections.from_list(xy, WIDTH, HEIGHT), Hint(scale_arcsec_px=(scale / share, scale * share))
            )
        )
        asked.append(int(answer.tried.split()[-3]))
    assert asked[0] == asked[1] == asked[2] // 2
    for seed in range(12):
        attitude, camera, detections = view(toy_sky, 30.0 * seed, 5.0 * seed - 30.0, 70.0, seed=seed)
        for ends in ((0.998, 1.34), (1.0 / 1.34, 1.002)):
            scales = (camera.scale_arcsec_px * ends[0], camera.scale_arcsec_px * ends[1])
            answer = run(method.identify(detections, Hint(scale_arcsec_px=scales)))
            assert isinstance(answer, Identification)
            assert off_deg(answer, attitude) < 0.1


@given(st.permutations(range(12)))
@settings(max_examples=15)
def test_the_order_of_the_brightest_does_not_matter(toy_sky, method, order):
    attitude, _, d = view(toy_sky, 40.0, -30.0, 70.0)
    mixed = np.concatenate([d.xy[:12][list(order)], d.xy[12:]])
    answer = run(method.identify(Detections.from_list(mixed, WIDTH, HEIGHT)))
    assert isinstance(answer, Identification)
    assert off_deg(answer, attitude) < 0.1


@given(st.integers(0, 10**6), st.integers(0, 60))
@settings(max_examples=40)
def test_false_stars_never_make_a_confident_wrong_answer(toy_sky, method, seed, false):
    attitude, _, d = view(toy_sky, 200.0, 10.0, 0.0, seed=seed, missing=0.5, false=false)
    answer = run(method.identify(d))
    assert isinstance(answer, NoSolution) or off_deg(answer, attitude) < 0.2


@given(st.integers(0, 10**6), st.integers(6, 80))
@settings(max_examples=40)
def test_points_that_are_no_stars_are_refused(method, seed, count):
    xy = np.random.default_rng(seed).uniform(0, 900, (count, 2))
    answer = run(method.identify(Detections.from_list(xy, WIDTH, HEIGHT)))
    assert isinstance(answer, NoSolution)
    assert answer.reason == Reason.NO_PATTERN_AGREED


@pytest.mark.parametrize("count", [0, 1, 3, 5])
def test_too_few_stars(method, count):
    xy = np.random.default_rng(count).uniform(0, 900, (count, 2))
    answer = run(method.identify(Detections.from_list(xy, WIDTH, HEIGHT)))
    assert isinstance(answer, NoSolution)
    assert answer.reason == Reason.TOO_FEW_STARS


@pytest.mark.parametrize("xy", [np.ones((20, 2)), np.stack([np.arange(20.0)] * 2, axis=1) * 40])
def test_stars_in_one_place_or_on_a_line_are_no_pattern(method, xy):
    answer = run(method.identify(Detections.from_list(xy, WIDTH, HEIGHT)))
    assert isinstance(answer, NoSolution)


def test_a_right_hint_asks_fewer_pointings_and_a_wrong_one_finds_nothing(toy_sky, method):
    _, camera, d = view(toy_sky, 300.0, 45.0, 10.0)
    blind = run(method.identify(d))
    s = camera.scale_arcsec_px
    near = Hint(scale_arcsec_px=(s / 1.05, s * 1.05), centre_deg=(300.0, 45.0, 5.0))
    hinted = run(method.identify(d, near))
    assert isinstance(hinted, Identification)
    assert hinted.candidates <= blind.candidates
    assert isinstance(run(method.identify(d, Hint(scale_arcsec_px=(s * 2, s * 3)))), NoSolution)
    assert isinstance(run(method.identify(d, Hint(centre_deg=(100.0, -45.0, 5.0)))), NoSolution)


def test_the_registered_method_knows_the_sky():
    from kochab.simulate.random_fields import FieldPlan, random_field
    from kochab.sky import open_catalogue

    assert "patterns" in IDENTIFIERS
    catalogue, rng = open_catalogue(), np.random.default_rng(1)
    for fov in (4.0, 12.0, 35.0):
        truth = random_field(catalogue, rng, FieldPlan(fov))
        answer = run(IDENTIFIERS.make("patterns").identify(truth.detections))
        assert isinstance(answer, Identification)
        assert np.degrees(np.linalg.norm(answer.attitude.boresight - truth.attitude.boresight)) < 0.05


def test_quads_are_of_near_neighbours_but_for_those_whose_distance_would_be_noise() -> None:
    """Five detections, the second 3 px from the first, whose three neighbours it is one of, or is not."""
    xy = np.array([[0.0, 0.0], [3.0, 0.0], [100.0, 10.0], [-20.0, 150.0], [90.0, 160.0]])
    for smallest_px, passed_over in ((2.0, False), (2.9, False), (3.1, True)):
        quads = set(map(tuple, image_quads(xy, 3, smallest_px).tolist()))
        assert ((0, 2, 3, 4) in quads) is passed_over
        assert all(len(set(quad)) == 4 for quad in quads)
    assert image_quads(xy[:3], 4, 1.0).shape == (0, 4)


def test_a_search_that_ends_without_an_answer_tells_how_much_was_tried(method):
    """Pointings tried are counted in the sentence, and as a number for programs."""
    xy = np.random.default_rng(8).uniform(0.0, [1200.0, 800.0], (40, 2))
    answer = run(method.identify(Detections.from_list(xy, 1200, 800)))
    assert isinstance(answer, NoSolution)
    pointings = answer.measured["pointings"]
    assert pointings > 0
    assert answer.tried.startswith(f"{pointings:.0f} pointings from ")
