"""Wrong beliefs are told beside the answer, right ones pass in silence."""

import json

import numpy as np
import pytest

from kochab.cli.main import main
from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.frame import Hint
from kochab.core.solution import NoSolution, Reason, Solution
from kochab.frames.fits_write import write_fits
from kochab.solver import SolveOptions
from kochab.solver.pipeline import with_doubts, within_radius

CAMERA = Camera.centred(1600, 1000, 7600.0)  # 27.1 arcsec/px, 12.0 deg wide
SOLUTION = Solution(CAMERA, attitude_from(84.0, -2.0, 25.0), (), 0.3, -40.0, "x", warnings=("A.",))
SCALE = CAMERA.scale_arcsec_px


def said(options=None, header=None) -> tuple[str, ...]:
    result = with_doubts(SOLUTION, options or SolveOptions(), header)
    assert result.warnings[0] == "A."
    return result.warnings[1:]


@pytest.mark.parametrize(
    "options",
    [
        SolveOptions(),
        SolveOptions(fov_deg=12.0),
        SolveOptions(fov_deg=13.5),
        SolveOptions(hint=Hint(scale_arcsec_px=(SCALE * 1.05, SCALE * 1.3))),
        SolveOptions(hint=Hint(centre_deg=(84.0, 3.0, 1.0))),
        SolveOptions(hint=Hint(centre_deg=(444.0, -22.0, 19.0))),
    ],
)
def test_right_beliefs_pass(options) -> None:
    assert said(options) == ()


def test_wrong_scales_are_told() -> None:
    (sentence,) = said(SolveOptions(fov_deg=6.0))
    assert "given" in sentence
    assert "factor of 2.0" in sentence
    assert "7600 px" in sentence
    (sentence,) = said(header=Hint(scale_arcsec_px=(SCALE / 2.2, SCALE / 1.8)))
    assert "in the header" in sentence
    assert said(SolveOptions(use_header=False), Hint(scale_arcsec_px=(1.0, 2.0))) == ()


def test_wrong_places_are_told() -> None:
    (sentence,) = said(SolveOptions(hint=Hint(centre_deg=(264.0, 2.0, 10.0))))
    assert sentence == "The frame is 180 deg away from the position given."
    (sentence,) = said(header=Hint(centre_deg=(84.0, 28.0, 10.0)))
    assert sentence == "The frame is 30 deg away from the position in the header."


def test_without_an_answer_nothing_is_contradicted() -> None:
    none = NoSolution(Reason.TRAILED, "Wait.")
    assert with_doubts(none, SolveOptions(fov_deg=1.0), Hint(scale_arcsec_px=(1, 2))) is none


def test_the_command_line_tells_them(tmp_path, capsys) -> None:
    from kochab.core.frame import Frame
    from kochab.simulate.star_images import FWHM_PER_SIGMA
    from tests.solver.fields import photograph

    field = photograph(CAMERA, attitude_from(84.0, -2.0, 25.0), sigma_px=0.05)
    y, x = np.mgrid[-8:9, -8:9]
    pixels = np.full((1000 + 40, 1600 + 40), 100.0, np.float32)
    spot = 2000.0 * np.exp(-(x**2 + y**2) / (2 * (3.0 / FWHM_PER_SIGMA) ** 2))
    for column, row in np.rint(field.detections.xy).astype(int):
        pixels[row + 12 : row + 29, column + 12 : column + 29] += spot
    path = tmp_path / "a.fits"
    write_fits(Frame(pixels[20:-20, 20:-20].copy()), path)
    assert main(["solve", str(path), "--fov", "5", "--near", "264,2,5", "--json"]) == 0
    warnings = json.loads(capsys.readouterr().out)["warnings"]
    assert sum("given" in text for text in warnings) == 2
    near = ["--near", "84,3,4", "--json", "--strict"]  # as far away as half the field may reach
    assert main(["solve", str(path), *near]) == 1
    refused = json.loads(capsys.readouterr().out)
    assert refused["reason"] == "outside the search radius"
    assert "5 deg from the search position" in refused["advice"]


def test_an_empty_name_is_not_this_folder(capsys) -> None:
    assert main(["solve", ""]) == 2
    assert capsys.readouterr().err == "kochab: A file's name is empty.\n"


def test_a_right_field_does_not_hide_a_wrong_scale() -> None:
    (sentence,) = said(SolveOptions(fov_deg=12.0, hint=Hint(scale_arcsec_px=(0.9, 1.1))))
    assert "about 0.995 arcsec/px, is wrong" in sentence
    near = Hint(centre_deg=(264.0, 2.0, 10.0))
    assert len(said(SolveOptions(fov_deg=12.0, hint=near))) == 1


@pytest.mark.parametrize(
    ("low", "high", "passes"),
    [(1.09, 2.0, True), (1.11, 2.0, False), (0.5, 1.0 / 1.09, True), (0.5, 1.0 / 1.11, False)],
)
def test_a_scale_may_be_a_tenth_off(low, high, passes) -> None:
    assert (said(SolveOptions(hint=Hint(scale_arcsec_px=(SCALE * low, SCALE * high)))) == ()) is passes


def test_what_is_wrong_with_a_scale_is_told_by_its_geometric_middle() -> None:
    for low, high, factor in ((SCALE * 2.0, SCALE * 8.0, "4"), (SCALE / 8.0, SCALE / 2.0, "4")):
        assert said(header=Hint(scale_arcsec_px=(low, high))) == (
            f"The pixel scale in the header, about {(low * high) ** 0.5:.3g} arcsec/px, is wrong by a factor of"
            f" {factor}: measured {SCALE:.4g} arcsec/px, a focal length of 7600 px.",
        )


@pytest.mark.parametrize("radius", [0.0, 3.0])
@pytest.mark.parametrize(("beyond_deg", "passes"), [(-0.01, True), (0.01, False)])
def test_a_place_may_be_half_the_diagonal_beyond_its_radius(radius, beyond_deg, passes) -> None:
    """The frame still shows it there, or nearly."""
    width, height = (2.0 * np.degrees(np.arctan(side / 2.0 / 7600.0)) for side in (1600, 1000))
    away = radius + np.hypot(width, height) / 2.0 + beyond_deg
    assert (said(SolveOptions(hint=Hint(centre_deg=(84.0, -2.0 + away, radius)))) == ()) is passes


@pytest.mark.parametrize(("place", "away"), [((84.0, 8.0), 10.0), ((84.0, -12.0), 10.0), ((264.0, 2.0), 180.0)])
def test_a_frame_outside_the_radius_is_no_solution_and_says_what_was_found(place, away) -> None:
    inside = within_radius(SOLUTION, (*place, away + 1e-6))
    assert inside is SOLUTION
    refused = within_radius(SOLUTION, (*place, away - 0.01))
    assert refused.reason is Reason.OUTSIDE_RADIUS
    assert refused.measured == pytest.approx({"ra_deg": 84.0, "dec_deg": -2.0, "away_deg": away})
    assert refused.advice == (
        f"Solved with 0 stars at RA 84.0000, Dec -2.0000 deg, {away:.4g} deg from the search position;"
        f" the search radius is {away - 0.01:g} deg."
    )
    assert refused.warnings == ("A.",)


def test_no_bound_and_no_answer_are_passed_on() -> None:
    none = NoSolution(Reason.TRAILED, "Wait.")
    assert within_radius(none, (84.0, -2.0, 1.0)) is none
    assert within_radius(SOLUTION, None) is SOLUTION
    there = SOLUTION.ra_dec_deg
    assert within_radius(SOLUTION, (*there, 0.0)) is SOLUTION  # the very place
