"""Narrow frames whose place and scale are known, with the shipped stars and with the user's own."""

from dataclasses import replace
from datetime import UTC, datetime
from types import SimpleNamespace

import numpy as np
import pytest

from kochab.core.attitude import apart_deg, attitude_from, unit, unit_vectors
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason, Solution
from kochab.identification import index, index_build
from kochab.identification.patterns import Patterns
from kochab.identification.verification import ACCEPT_LOG10
from kochab.simulate.random_fields import FieldPlan, random_field, random_points
from kochab.sky import open_catalogue, user_catalogues
from kochab.solver import SolveOptions, cone_search
from kochab.solver.cone_search import Cone, cone_stars
from kochab.solver.pipeline import solve_detections
from tests.sky import user_files

PLACE, DENSITY, HALF_DEG = (359.9, -75.0), 3000, 2.0
"""Straddling 0 h, and so far south that an index of two bands has only a few cells."""
J2000 = datetime(2000, 1, 1, 12, tzinfo=UTC)
"""When the frames are taken: the shipped stars as they are stored."""


@pytest.mark.parametrize("depth", cone_search.DEPTHS)
def test_half_the_field_needs_four_times_the_stars_of_a_cone(depth) -> None:
    """So many a field of the index's deepest level, and a hundred for a cone of few."""
    cone = Cone(10.0, 20.0, 0.05, None, 2026.0)
    wanted = [
        cone_search._wanted(cone, cone_search.Narrow(f, (f, f), True, True), depth) - 100 for f in (0.25, 0.5, 1.0)
    ]
    assert wanted[0] / wanted[1] == pytest.approx(4.0, rel=0.01)
    assert wanted[1] / wanted[2] == pytest.approx(4.0, rel=0.01)


@pytest.mark.parametrize("radius", [0.2, 1.0, 3.0])
@pytest.mark.parametrize("depth", cone_search.DEPTHS)
def test_cones_grow_until_they_reach_as_far_as_the_hint_or_as_a_cone_may(depth, radius) -> None:
    hint = Hint(centre_deg=(10.0, 20.0, radius))
    cones = [*cone_search._cones(hint, cone_search.Narrow(0.5, (0.5, 0.5), True, True), depth)]
    radii = np.array([each for *_, each in cones])
    assert {each[:2] for each in cones} == {(10.0, 20.0)}
    assert radii[-1] == min(radius, depth.most_deg(0.5))
    assert np.all(np.diff(radii) > 0.0)
    assert np.all(radii[1:] <= cone_search.GROWTH**1.5 * radii[:-1])


@pytest.fixture(scope="module")
def deep_stars():
    """Made up, as deep as nothing that is shipped: RA, Dec, magnitude (N, 3)."""
    rng = np.random.default_rng(4)
    count = int(DENSITY * 4 * HALF_DEG**2)
    ra = PLACE[0] + rng.uniform(-HALF_DEG, HALF_DEG, count) / np.cos(np.radians(PLACE[1]))
    dec = PLACE[1] + rng.uniform(-HALF_DEG, HALF_DEG, count)
    return np.column_stack([ra % 360.0, dec, 16.5 + np.log10(rng.uniform(1e-4, 1.0, count))])


@pytest.fixture(scope="module")
def database(tmp_path_factory, deep_stars):
    folder = tmp_path_factory.mktemp("astap")
    user_files.write_astap(folder, "d50", deep_stars, every_area=False)
    return folder


@pytest.fixture(scope="module")
def catalogue():
    return open_catalogue()


@pytest.fixture
def in_use(tmp_path, monkeypatch, database):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    run(user_catalogues.choose(str(database)))


@pytest.fixture
def nothing_in_use(tmp_path, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))


@pytest.fixture
def no_big_index(monkeypatch):
    """As on a computer where the index of small fields was never made, and must not be."""

    def made():
        raise AssertionError("the big index was asked for")
        yield

    monkeypatch.setattr("kochab.solver.cone_search.fine", lambda: None)
    monkeypatch.setattr("kochab.identification.patterns.fine", lambda: None)
    monkeypatch.setattr(index_build, "make_fine", made)


def deep_field(stars, rng, fov_deg, size=1024):
    """Detections of a field of the deep stars, a tenth missing and a tenth false, and the truth."""
    ra = PLACE[0] + rng.uniform(-0.6, 0.6) / np.cos(np.radians(PLACE[1]))
    dec = PLACE[1] + rng.uniform(-0.6, 0.6)
    attitude = attitude_from(ra % 360.0, dec, float(rng.uniform(-180, 180)))
    focal = size / 2.0 / np.tan(np.radians(fov_deg) / 2.0)
    camera = Camera.centred(size, size, float(focal), bool(rng.integers(2)))
    vectors = unit_vectors(stars[:, 0], stars[:, 1])
    near = vectors @ attitude.boresight > np.cos(np.radians(fov_deg))
    xy, mag = camera.project(vectors[near] @ attitude.matrix.T), stars[near, 2]
    inside = ((xy > -0.5) & (xy < size - 0.5)).all(axis=1) & (rng.random(len(xy)) > 0.1)
    xy = xy[inside] + rng.normal(0.0, 0.3, (int(inside.sum()), 2))
    false = rng.uniform(0, size - 1, (len(xy) // 10, 2))
    mags = np.concatenate([mag[inside] + rng.normal(0.0, 0.3, len(xy)), rng.choice(mag[inside], len(false))])
    order = np.argsort(mags)[:80]
    xy = np.concatenate([xy, false])[order]
    return Detections.from_list(xy, size, size, 10.0 ** (-0.4 * mags[order])), camera, attitude


def hint_near(camera, attitude, rng, radius_deg, sureness=1.1):
    ra, dec = attitude.ra_dec_deg
    off = 0.6 * radius_deg
    turn = rng.uniform(0, 2 * np.pi)
    place = (ra + off * np.sin(turn) / np.cos(np.radians(dec))) % 360.0, dec + off * np.cos(turn)
    scale = camera.scale_arcsec_px
    span = (scale / sureness, scale * sureness)
    return Hint(scale_arcsec_px=span, centre_deg=(*place, radius_deg), time_utc=J2000)


def solved(detections, hint):
    return run(solve_detections(detections, SolveOptions(hint=hint, blind_after_hint=False)))


def right(result, attitude, fov_deg):
    return isinstance(result, Solution) and apart_deg(result.ra_dec_deg, attitude.ra_dec_deg) < 0.01 * fov_deg


@pytest.mark.parametrize("fov_deg", [0.1, 0.2, 0.4])
def test_a_deep_catalogue_solves_what_the_shipped_stars_cannot(in_use, no_big_index, deep_stars, fov_deg):
    rng = np.random.default_rng(7)
    for _ in range(3):
        detections, camera, attitude = deep_field(deep_stars, rng, fov_deg)
        hint = hint_near(camera, attitude, rng, 0.4)
        result = solved(detections, hint)
        assert right(result, attitude, fov_deg)
        assert result.log10_false_alarm < -5.0
        assert all(star.id for star in result.stars)
        assert len(result.stars) >= 0.6 * len(detections)


@pytest.mark.parametrize("fov_deg", [0.5, 0.8])
def test_the_shipped_stars_suffice_where_seven_stand(nothing_in_use, no_big_index, catalogue, fov_deg):
    """And no frame with a place and a scale waits for the index of small fields."""
    rng = np.random.default_rng(12)
    fields = [random_field(catalogue, rng, FieldPlan(fov_deg, missing=0.0, spurious=0.1)) for _ in range(40)]
    rich = [field for field in fields if field.stars >= 7]
    assert len(rich) > 10
    for field in sorted(rich, key=lambda field: field.stars)[:6]:  # the poorest of them
        assert right(
            solved(field.detections, hint_near(field.camera, field.attitude, rng, 2.0)), field.attitude, fov_deg
        )


def test_four_stars_of_a_known_camera_are_enough(nothing_in_use, no_big_index, catalogue):
    rng = np.random.default_rng(2)
    found = []
    while len(found) < 12:
        field = random_field(catalogue, rng, FieldPlan(0.5, noise_px=0.2, missing=0.0, spurious=0.0))
        gap = np.linalg.norm(field.detections.xy[:, None] - field.detections.xy[None], axis=2) + 1e9 * np.eye(
            field.stars
        )
        if field.stars == 4 and gap.min() > 30.0:
            hint = hint_near(field.camera, field.attitude, rng, 1.0, 1.003)
            found.append(right(solved(field.detections, hint), field.attitude, 0.5))
    assert sum(found) >= 11


@pytest.mark.parametrize("own", [True, False])
def test_a_cone_comes_before_the_index_only_of_a_catalogue_of_the_user_s(monkeypatch, own):
    """Of the shipped stars the index, once it is made, has all that a cone has."""
    monkeypatch.setattr(cone_search, "fine", lambda: "an index")
    monkeypatch.setattr(cone_search, "opened", lambda: "a catalogue" if own else None)
    detections = random_points(np.random.default_rng(1), 20)
    scale = 3600.0 * 0.9 * cone_search.OWN_DEG / 1024
    hint = Hint(scale_arcsec_px=(scale / 1.01, scale * 1.01), centre_deg=(*PLACE, 0.3))
    assert cone_search.narrow(detections, hint).first is own


@pytest.mark.parametrize("count", [4, 6, 9, 20, 60])
def test_points_near_a_place_are_no_frame_of_it(in_use, no_big_index, count):
    """A hint makes few pointings possible, and no list of points one of them."""
    rng = np.random.default_rng(count)
    for fov_deg, sureness in ((0.1, 1.1), (0.2, 1.01), (0.4, 1.1), (0.8, 1.01))[count % 4 // 2 :: 2]:
        scale = 3600.0 * fov_deg / 1024
        hint = Hint(scale_arcsec_px=(scale / sureness, scale * sureness), centre_deg=(*PLACE, 0.3))
        assert isinstance(solved(random_points(rng, count), hint), NoSolution)


@pytest.mark.parametrize(("below", "accepted"), [(0.25, False), (0.35, True)])
def test_every_search_before_is_one_more_chance_of_a_false_alarm(
    in_use, no_big_index, catalogue, monkeypatch, below, accepted
):
    """An answer of the second search is twice as likely to be a chance match as it would be alone: 0.301 in log10."""
    rng, identify, searches = np.random.default_rng(3), Patterns.identify, []
    field = random_field(catalogue, rng, FieldPlan(0.8))
    hint = hint_near(field.camera, field.attitude, rng, 1.0)

    def second_alone(self, detections, hint, year):
        searches.append(hint)
        if len(searches) != 2:
            return NoSolution(Reason.NO_PATTERN_AGREED, "", "nothing")
        found = yield from identify(self, detections, hint, year)
        return replace(found, log10_false_alarm=ACCEPT_LOG10 - below)

    monkeypatch.setattr(Patterns, "identify", second_alone)
    known = cone_search.narrow(field.detections, hint)
    found = run(cone_search.search_cone(field.detections, hint, known, 2000.0, []))
    assert len(searches) > 1
    assert isinstance(found, NoSolution) is not accepted
    if accepted:
        assert found.log10_false_alarm == pytest.approx(ACCEPT_LOG10 - below + np.log10(2.0))


def test_a_damaged_catalogue_leaves_the_shipped_stars_and_a_sentence(
    tmp_path, in_use, no_big_index, catalogue, database
):
    rng = np.random.default_rng(1)
    field = random_field(catalogue, rng, FieldPlan(0.8))
    hint = hint_near(field.camera, field.attitude, rng, 0.5)
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    for area in user_catalogues.open_user_catalogue(user_catalogues.chosen())._tiling.areas(
        *np.radians(hint.centre_deg[:2]), np.radians(5.0)
    ):
        (damaged / f"d50_{area[0]:02d}{area[1]:02d}.1476").write_bytes(b"damaged")
    user_catalogues._remember({"kind": "ASTAP", "name": "D50", "path": str(damaged)})
    result = solved(field.detections, hint)
    assert right(result, field.attitude, 0.8)
    assert len(result.warnings) == 1
    assert "is not an ASTAP star file" in result.warnings[0]
    none = solved(random_points(rng, 20), hint)
    assert "is not an ASTAP star file" in none.warnings[0]


def test_a_catalogue_that_is_gone_is_told(tmp_path, monkeypatch, no_big_index, catalogue):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    user_catalogues._remember({"kind": "ASTAP", "name": "D50", "path": str(tmp_path / "gone")})
    rng = np.random.default_rng(1)
    field = random_field(catalogue, rng, FieldPlan(0.8))
    result = solved(field.detections, hint_near(field.camera, field.attitude, rng, 0.5))
    assert right(result, field.attitude, 0.8)
    assert "gone" in result.warnings[0]


def test_a_star_that_both_have_counts_once_and_keeps_its_name(in_use, catalogue, deep_stars, database):
    own = user_catalogues.opened()
    cone = Cone(*np.radians(PLACE).tolist(), float(np.radians(1.0)))
    both = cone_stars(cone, own)
    shipped = cone_stars(cone, None)
    assert (both.shipped >= 0).sum() == len(shipped.v)
    again = cone_stars(cone, _Twice(shipped))
    assert len(again.v) == len(shipped.v)
    assert both.labels(np.arange(5))[0][0]
    assert (np.diff(both.v) >= 0).all()


def test_a_field_without_a_shipped_star_has_the_users_alone(catalogue):
    """A cone of 30 arcsec where the shipped catalogue has none."""
    rng = np.random.default_rng(5)
    radius = np.radians(30.0 / 3600.0)
    for place in unit(rng.normal(size=(200, 3))):
        cone = Cone(float(np.arctan2(place[1], place[0])), float(np.arcsin(place[2])), float(radius))
        if not len(cone_stars(cone, None).v):
            break
    user = user_catalogues.StarCone(*(np.array([value]) for value in (cone.ra_rad, cone.dec_rad, 15.0)))
    found = cone_stars(cone, SimpleNamespace(cone=lambda asked: user))
    assert found.v.tolist() == [15.0]
    assert found.shipped.tolist() == [-1]
    nobody = user_catalogues.StarCone(*np.zeros((3, 0)))
    assert len(cone_stars(cone, SimpleNamespace(cone=lambda asked: nobody)).v) == 0


class _Twice:
    """The shipped stars as another catalogue has them, an arcsecond off."""

    def __init__(self, stars):
        self.stars = stars

    def cone(self, cone):
        x, y, z = self.stars.place.T
        dec = np.arcsin(z) + np.radians(0.8 / 3600)
        return user_catalogues.StarCone(np.arctan2(y, x), dec, self.stars.v)


def test_one_that_vague_or_wide_is_left_to_the_other_searches(nothing_in_use, catalogue):
    from kochab.solver.cone_search import narrow

    field = random_field(catalogue, np.random.default_rng(1), FieldPlan(0.8))
    hint = hint_near(field.camera, field.attitude, np.random.default_rng(1), 1.0)
    assert narrow(field.detections, hint).field_deg == pytest.approx(0.8, rel=0.02)
    assert narrow(field.detections, replace(hint, centre_deg=None)) is None
    assert narrow(field.detections, replace(hint, scale_arcsec_px=None)) is None
    assert narrow(field.detections, replace(hint, scale_arcsec_px=(1.0, 3.0))) is None
    assert narrow(field.detections, replace(hint, scale_arcsec_px=(15.0, 15.1))) is None
    assert index.LEVEL_FIELDS_DEG[4] == pytest.approx(2.83, abs=0.01)
