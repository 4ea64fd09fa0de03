"""Windows of a frame, when the whole finds no pattern: pictures, captions, roofs and whole skies."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from kochab.core.attitude import Attitude, apart_deg, attitude_from, radec_deg, small_rotation
from kochab.core.camera import Camera, FisheyeCamera
from kochab.core.frame import Detections, Hint
from kochab.core.progress import run
from kochab.core.solution import Identification, Matches, NoSolution, Reason, Solution
from kochab.frames import read_frame
from kochab.identification.patterns import Patterns
from kochab.lab.bench.reach import roof
from kochab.simulate.random_fields import FieldPlan, random_field
from kochab.simulate.whole_skies import RADII, whole_sky
from kochab.sky import open_catalogue
from kochab.solver import SolveOptions, pipeline, window_ladder
from kochab.solver.pipeline import solve_detections, solve_frame
from tests.solver.fields import YEAR, photograph

REACHED = {
    "DESIHIGH__attic_images_Amazon.jpg",
    "UNISvalb__Test_images_LYR_Sony_111220_200933.jpg",
    "asky__data_Toscano1_2025_6_21_01_39_45_UTC.jpeg",
    "emijrp__images_iridium8.jpg",
    "jakeschu__public_images_gallery_cygnus_loop.jpg",
    "jbsco__docs_images_01-input-tree-occlusion.jpg",
    "stic6021__app_assets_images_home_page_background.jpg",
    "stic6021__p_assets_images_EN_HD_images_portrait_NavyHill_2021Apr29.jpg",
    "teuben__www_gallery_meteor_Meteor_20191028.png",
    "tjallsky__html_documentation_explanations_Stretch_20x10.png",
}


NO_MATCHES = Matches(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 3)))


def test_no_window_of_a_frame_is_asked_twice_and_the_middle_ones_have_four_sizes() -> None:
    xy = np.random.default_rng(3).uniform(0.0, [1600.0, 1000.0], (400, 2))
    windows = list(window_ladder._windows(Detections.from_list(xy, 1600, 1000)))
    asked = {(*w.middle.tolist(), w.detections.width, w.detections.height) for w in windows}
    assert len(asked) == len(windows) <= window_ladder.MOST_WINDOWS
    sizes = [w.detections.width for w in windows if w.middle.tolist() == [799.5, 499.5]]
    assert sorted(sizes) == [400, 560, 800, 1120]


@pytest.mark.parametrize(("lit", "sides"), [((0.6, 1.0), {"top", "right"}), ((1.0, 0.6), {"top", "bottom"})])
def test_the_windows_beside_roofs_and_opposite_lights_begin_at_the_frames_edges(lit, sides) -> None:
    """Most lights are at the left, or above: the sky is then at the right, or below."""
    xy = np.random.default_rng(3).uniform(0.0, [1600.0, 1000.0], (400, 2))
    xy[:300] *= lit
    windows = list(window_ladder._windows(Detections.from_list(xy, 1600, 1000)))
    for window in windows:
        half = np.array([window.detections.width, window.detections.height]) / 2.0
        assert (window.middle - half >= -0.5).all()
        assert (window.middle + half <= [1599.5, 999.5]).all()
    shares = {
        "top": (799.5, 299.5, 1600, 600),
        "bottom": (799.5, 699.5, 1600, 600),
        "right": (1119.5, 499.5, 960, 1000),
    }
    asked = {(*w.middle.tolist(), w.detections.width, w.detections.height) for w in windows}
    assert {name for name, window in shares.items() if window in asked} == sides


@pytest.mark.parametrize("name", sorted(REACHED))
def test_pictures_that_failed_as_a_whole_are_where_others_say(frames_reach, name):
    truth = json.loads((frames_reach / "truth.json").read_text())[name]
    answer = run(solve_frame(read_frame(str(frames_reach / name))))
    assert isinstance(answer, Solution), answer
    pixel = np.array([truth.get("pixel", [(answer.camera.width - 1) / 2, (answer.camera.height - 1) / 2])], dtype=float)
    place = radec_deg(answer.sky_at(pixel)[0])
    assert apart_deg(place, (truth["ra_deg"], truth["dec_deg"])) < truth["tol_deg"]


def spoilt(kind, seed):
    """The brightest 90 stars of a field of 24 deg, and what is brighter still and no star; the field's truth."""
    rng = np.random.default_rng([seed, 7])
    camera = Camera.centred(1600, 1000, 1600 / 2 / math.tan(math.radians(12.0)))
    field = photograph(camera, attitude_from(rng.uniform(0, 360), rng.uniform(-70, 70), rng.uniform(-180, 180)), 90)
    d, bright = field.detections, 10.0 * field.detections.flux.max()
    if kind == "captions":  # four lines of forty letters
        xy = np.concatenate([np.stack([rng.uniform(40, 900, 40), np.full(40, y)], 1) for y in (880, 910, 940, 970)])
        kept = np.ones(len(d), bool)
    else:  # a roof over two fifths, with lit windows
        xy, kept = rng.uniform([0, 600], [1600, 1000], (60, 2)), d.xy[:, 1] < 600
    places = np.concatenate([d.xy[kept], xy])
    flux = np.concatenate([d.flux[kept], bright * rng.uniform(1, 2, len(xy))])
    return Detections.from_list(places, 1600, 1000, flux), field.attitude


@pytest.mark.parametrize("kind", ["captions", "roof"])
def test_captions_and_roofs_hide_no_sky(kind, monkeypatch):
    lists = [spoilt(kind, seed) for seed in range(2)]
    for detections, truth in lists:
        answer = run(solve_detections(detections))
        assert isinstance(answer, Solution)
        assert apart_deg(answer.ra_dec_deg, truth.ra_dec_deg) < 0.05
    monkeypatch.setattr(pipeline, "_may_climb", lambda request: False)
    assert not all(isinstance(run(solve_detections(detections)), Solution) for detections, _ in lists)


@pytest.mark.parametrize("quarters", range(4))
def test_a_roof_on_any_side_hides_no_sky(quarters):
    """The windows with most stars are then full of lights: before, half of the roofs at the foot of a frame did."""
    rng = np.random.default_rng([20261127, quarters])
    for _ in range(2):
        field = random_field(open_catalogue(), rng, FieldPlan(24.0, missing=0.0, spurious=0.0))
        hidden = roof(field.detections, rng)
        xy, side = hidden.xy, hidden.width
        for _ in range(quarters):
            xy = np.stack([side - 1 - xy[:, 1], xy[:, 0]], axis=1)
        answer = run(solve_detections(Detections.from_list(xy, side, side, hidden.flux)))
        assert isinstance(answer, Solution)
        assert apart_deg(answer.ra_dec_deg, field.attitude.ra_dec_deg) < 0.05


def solved(projection, field_deg, seed):
    """The solution or refusal, and how far its middle is from the truth, degrees."""
    detections, middle = whole_sky(projection, field_deg, np.random.default_rng([seed, int(field_deg)]))
    answer = run(solve_detections(detections))
    if not isinstance(answer, Solution):
        return answer, math.nan
    return answer, apart_deg(answer.ra_dec_deg, radec_deg(middle))


@pytest.mark.parametrize(
    ("projection", "field_deg"), [*((kind, 170.0) for kind in RADII), *((kind, 100.0) for kind in list(RADII)[::2])]
)
def test_whole_skies_of_four_projections_are_found(projection, field_deg):
    answer, off_deg = solved(projection, field_deg, 11)
    assert off_deg < 0.3, answer
    if field_deg > 150.0:
        assert isinstance(answer.camera, FisheyeCamera)
        assert len(answer.stars) > 60


def test_a_whole_sky_is_found_though_a_perspective_fit_of_it_goes_astray():
    """To a focal length of one pixel, at which all places lie in one direction of a fisheye."""
    detections, middle = whole_sky("equisolid", 180.0, np.random.default_rng([20261127, 2, 180]))
    answer = run(solve_detections(detections))
    assert isinstance(answer, Solution)
    assert apart_deg(answer.ra_dec_deg, radec_deg(middle)) < 0.3


def test_every_window_asked_is_one_more_chance_of_a_false_alarm(monkeypatch):
    detections, _ = spoilt("captions", 1)
    bounds, searches = [], []
    identify = Patterns.identify

    def told(self, own, hint=None, year=YEAR):
        searches.append(own)
        answer = yield from identify(self, own, hint, year)
        if isinstance(answer, Identification):
            bounds.append((len(searches), answer.log10_false_alarm))
        return answer

    monkeypatch.setattr(Patterns, "identify", told)
    found = run(window_ladder.climb(detections, YEAR))
    assert isinstance(found, Identification)
    assert found.log10_false_alarm == pytest.approx(min(bound + math.log10(asked) for asked, bound in bounds), abs=1e-9)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(
    ("longer", "turned_deg", "focal", "agree"),
    [
        (1.0, 0.0, 1.0, True),
        (1.3, 0.0, 1.0, True),
        (1.4, 0.0, 1.0, False),
        (0.7, 0.0, 1.0, True),
        (0.6, 0.0, 1.0, False),
        (1.0, 13.0, 1.0, True),
        (1.0, -17.0, 1.0, False),
        (1.0, 180.0, 1.0, False),
        (1.0, 0.0, 1.5, True),
        (1.0, 0.0, 1.7, False),
        (1.0, 0.0, 1 / 1.7, False),
    ],
)
def test_the_second_window_lies_where_the_first_looks_for_it(mirrored, longer, turned_deg, focal, agree):
    """Half a radian to one side: to a third of the angle, 15 deg of its direction, and a factor of 1.6 of the lens."""
    away, turn = 0.5, np.radians(turned_deg)
    for step in ((1.0, 0.0), (0.0, -1.0), (-0.6, 0.8)):
        across, down = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ step
        seen = longer * away * np.array([-across if mirrored else across, down, 0.0])
        looks = attitude_from(84.0, -2.0, 25.0)
        other = Attitude(small_rotation(np.cross(seen, [0.0, 0.0, 1.0])) @ looks.matrix)
        one, two = (
            (
                window_ladder._Window(np.array(middle), np.zeros(0, np.int64), Detections.from_list([], 100, 100)),
                Identification(NO_MATCHES, Camera.centred(100, 100, focal_px, mirrored), attitude, -20.0, "test"),
            )
            for middle, focal_px, attitude in (
                ((800.0, 500.0), 600.0 / focal**0.5, looks),
                ((800.0 + 300.0 * step[0], 500.0 + 300.0 * step[1]), 600.0 * focal**0.5, other),
            )
        )
        assert window_ladder._agree(one, two) is agree
        flipped = replace(two[1], camera=replace(two[1].camera, mirrored=not mirrored))
        assert window_ladder._agree(one, (two[0], flipped)) is False


def test_two_windows_of_one_frame_agree_and_others_do_not():
    field = photograph(Camera.centred(1600, 1000, 1500.0), attitude_from(84.0, -2.0, 25.0), 300)
    windows = list(window_ladder._windows(field.detections))
    method = Patterns()
    found = [(w, a) for w in windows if isinstance(a := run(method.identify(w.detections)), Identification)]
    assert len(found) >= 4
    assert all(window_ladder._agree(a, b) for a in found for b in found if a is not b)
    window, answer = found[0]
    for changed in (
        replace(answer, attitude=attitude_from(200.0, 30.0, 25.0)),
        replace(answer, camera=replace(answer.camera, mirrored=not answer.camera.mirrored)),
        replace(answer, camera=replace(answer.camera, focal_px=2.0 * answer.camera.focal_px)),
    ):
        assert not window_ladder._agree((window, changed), found[1])


def test_a_part_that_no_lens_joins_with_the_rest_is_told_and_is_no_answer(monkeypatch):
    detections, truth = spoilt("captions", 1)
    monkeypatch.setattr(window_ladder, "_joined", lambda detections, agreeing: None)
    refused = run(window_ladder.climb(detections, YEAR))
    assert isinstance(refused, NoSolution)
    assert refused.reason is Reason.DISTORTION_TOO_STRONG
    place = refused.measured["part_ra_deg"], refused.measured["part_dec_deg"]
    assert apart_deg(place, truth.ra_dec_deg) < 20.0  # a window of a frame 24 deg wide
    assert f"RA {place[0]:.2f}" in refused.advice


def test_the_whole_frame_s_refusal_keeps_what_its_search_measured():
    points = np.random.default_rng(8).uniform(0, [1600, 1000], (120, 2))
    answer = run(solve_detections(Detections.from_list(points, 1600, 1000)))
    assert "pointings from" in answer.tried
    assert answer.measured["log10_false_alarm"] <= 0.0


def test_a_person_who_trusts_a_hint_alone_gets_no_windows():
    detections, truth = spoilt("captions", 1)
    far = (truth.ra_dec_deg[0] + 90.0, -truth.ra_dec_deg[1], 5.0)
    hint = Hint(scale_arcsec_px=(50.0, 60.0), centre_deg=far)
    answer = run(solve_detections(detections, SolveOptions(hint=hint, blind_after_hint=False)))
    assert isinstance(answer, NoSolution)


def test_noise_climbs_to_nothing():
    rng = np.random.default_rng(5)
    for count in (60, 300):
        answer = run(solve_detections(Detections.from_list(rng.uniform(0, [1600, 1000], (count, 2)), 1600, 1000)))
        assert isinstance(answer, NoSolution)


def test_chance_counts_as_many_windows_as_are_asked_of_a_frame_full_of_stars():
    """More of them on the left and above than elsewhere, so that what lies opposite is a window of its own."""
    xy = np.random.default_rng(1).uniform(0.0, 1000.0, (500, 2)) * [0.9, 1.0]
    assert len(list(window_ladder._windows(Detections.from_list(xy, 1000, 1000)))) == window_ladder.MOST_WINDOWS == 9
