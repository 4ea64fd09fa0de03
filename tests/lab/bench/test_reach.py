import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from kochab.core.attitude import radec_deg, small_rotation
from kochab.core.frame import Detections
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason
from kochab.frames.fits_write import write_fits
from kochab.lab.bench import Only, narrow_fields, reach
from kochab.simulate.random_fields import FieldPlan, random_field, random_picture
from kochab.sky import open_catalogue
from kochab.solver.pipeline import solve_detections, solve_frame


@pytest.fixture
def few(monkeypatch, tmp_path):
    monkeypatch.setattr(reach, "FIELDS_DEG", (120.0,))
    monkeypatch.setattr(reach, "QUICK_SPOILT", 2)
    monkeypatch.setattr(reach, "QUICK_LISTS", 1)
    monkeypatch.setattr(reach, "RADII", dict(list(reach.RADII.items())[:2]))
    monkeypatch.setattr(narrow_fields, "FIELDS_DEG", (0.8, 1.4))
    monkeypatch.setattr(narrow_fields, "QUICK_COUNT", 2)
    monkeypatch.setattr(reach.shutil, "which", lambda _: None)
    monkeypatch.setenv("KOCHAB_FRAMES_REACH", str(tmp_path))
    return tmp_path


def remembered(make):
    """``make``'s sheets, solved when they are first asked for and given again after that."""
    kept = []

    def again(*arguments):
        kept.extend([] if kept else make(*arguments))
        return iter(kept)

    return again


def goals_of(result):
    return {goal.name.split(" (")[0]: goal for goal in result.goals}


def test_what_is_found_and_refused_is_counted(few, monkeypatch) -> None:
    # Three runs differ in their picture's truth alone.
    for name in ("rendered_skies", "spoilt_fields", "stretched_fields", "narrow_fields", "hostile_lists"):
        monkeypatch.setattr(reach, name, remembered(getattr(reach, name)))
    monkeypatch.setattr(reach, "sheet", cache(reach.sheet))
    picture = random_picture(open_catalogue(), np.random.default_rng(3), FieldPlan(12.0, size_px=512))
    write_fits(picture.frame, few / "sky.fits")
    ra, dec = picture.attitude.ra_dec_deg
    there = {"ra_deg": ra, "dec_deg": dec, "tol_deg": 0.1, "fov_deg": 12.0}
    corner = radec_deg((picture.camera.unproject(np.array([[60.0, 450.0]])) @ picture.attitude.matrix)[0])
    (few / "truth.json").write_text(
        json.dumps({"sky.fits": {**there, "ra_deg": float(corner[0]), "dec_deg": float(corner[1]), "pixel": [60, 450]}})
    )
    assert goals_of(reach.run(True, lambda _: None))["hard pictures found, %"].value == 100.0
    elsewhere = {**there, "ra_deg": (ra + 40.0) % 360.0, "what": "whole sky"}
    (few / "truth.json").write_text(json.dumps({"sky.fits": there, "a-table.fits": {"what": "no place"}}))
    result = reach.run(True, lambda _: None)
    assert [row["n"] for row in result.rows] == [1, 2, 2, 2, 1, *[2] * 4]
    assert all(0.0 < row["median_cpu_s"] <= row["cpu_s_99"] for row in result.rows)
    goals = goals_of(result)
    assert goals["hard pictures found, %"].value == 100.0
    assert goals["centres within the 95 % radius of their middles', %"].value == 100.0
    assert goals["whole-sky pictures found, %"].met is None
    assert goals["1.4 deg, blind, shipped patterns, found, %"].value == 100.0
    assert goals["0.8 deg, blind, found, %"].met is None, "the index is made by whole benches alone"
    assert goals["wrong answers"].value == 0
    (few / "truth.json").write_text(json.dumps({"sky.fits": elsewhere}))
    goals = goals_of(reach.run(True, lambda _: None))
    assert goals["hard pictures found, %"].met is False
    assert goals["whole-sky pictures found, %"].met is False
    assert goals["wrong answers"].value == 1


def test_without_the_pictures_and_answers_no_goal_of_theirs_is_met(few, monkeypatch) -> None:
    def refuse(*_):
        return NoSolution(Reason.NO_PATTERN_AGREED, "")
        yield

    monkeypatch.setattr(reach, "solve_detections", refuse)
    lines = []
    goals = goals_of(reach.run(True, lines.append))
    assert goals["hard pictures found, %"].met is None
    assert any("not measured" in line for line in lines)
    assert goals["rendered whole skies found, %"].met is False
    assert goals["captions and roofs found, %"].met is False


def test_rows_are_measured_one_by_one_and_written_as_they_come(few) -> None:
    lines = []
    result = reach.run(True, lines.append, Only(("stretched", "1.4 deg, blind, shipped")))
    names = ["stretched fields", "1.4 deg, blind, shipped patterns"]
    assert [row["what"] for row in result.rows] == names
    assert [line.split(":")[0] for line in lines] == names
    measured = [goal.name for goal in result.goals if goal.met is not None]
    assert measured == ["stretched fields found, %", "1.4 deg, blind, shipped patterns, found, %", "wrong answers"]


def test_letters_and_windows_outshine_the_stars_they_stand_among() -> None:
    rng = np.random.default_rng(4)
    stars = Detections.from_list(rng.uniform(0, 1000, (200, 2)), 1000, 1000, rng.uniform(1, 2, 200))
    for hide, lights in ((reach.captions, 160), (reach.roof, 60)):
        hidden = hide(stars, rng)
        assert (hidden.xy[:lights, 1] > 600).all()
        assert hidden.flux[lights - 1] > hidden.flux[lights]
    assert (hidden.xy[lights:, 1] < 600).all()


def test_bright_stars_count_where_they_shine_and_their_names_are_counted() -> None:
    picture = random_picture(open_catalogue(), np.random.default_rng(5), FieldPlan(24.0, size_px=1024))
    result = run(solve_frame(picture.frame))
    shining, named = reach.bright_stars(picture.frame, result)
    assert 0 < named == shining
    nameless = replace(result, stars=result.stars[-8:], seen=())
    assert reach.bright_stars(picture.frame, nameless) == (shining, 0)
    dark = replace(picture.frame, pixels=np.full_like(picture.frame.pixels, 100))
    assert reach.bright_stars(dark, result) == (0, 0)


def test_a_centre_is_measured_by_what_its_middle_says() -> None:
    field = random_field(open_catalogue(), np.random.default_rng(6), FieldPlan(24.0, brightest=300))
    result = run(solve_detections(field.detections))
    near = reach.sigmas_of_the_middle(field.detections, result)
    turned = small_rotation(np.array([0.003, 0.0, 0.0])) @ result.attitude.matrix
    elsewhere = replace(result, attitude=replace(result.attitude, matrix=turned))
    far = reach.sigmas_of_the_middle(field.detections, elsewhere)
    assert near < 4.0 < 20.0 < far
    assert reach.sigmas_of_the_middle(field.detections.take(slice(0, 4)), result) is None
