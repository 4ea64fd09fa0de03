"""Few stars through a camera whose scale is known."""

import numpy as np

from kochab.core.frame import Hint
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Solution
from kochab.simulate.random_fields import FieldPlan, random_field, random_points
from kochab.sky import open_catalogue
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_detections

PLAN = FieldPlan(8.0, 2048, noise_px=0.3, missing=0.0, spurious=0.0, magnitude_scatter=0.0, brightest=5)


def knowing(scale: float, share: float) -> Hint:
    return Hint(scale_arcsec_px=(scale / (1 + share), scale * (1 + share)))


def test_five_stars_are_enough_when_the_scale_is_known() -> None:
    rng, catalogue = np.random.default_rng(8), open_catalogue()
    solved = 0
    for _ in range(8):
        field = random_field(catalogue, rng, PLAN)
        hint = knowing(field.camera.scale_arcsec_px, 1e-3)
        found = run(solve_detections(field.detections, SolveOptions(hint=hint)))
        if isinstance(found, NoSolution):
            continue
        solved += 1
        assert found.log10_false_alarm <= -5.0
        assert found.centre_vector @ field.attitude.boresight > np.cos(np.radians(0.02))
    assert solved >= 6


def test_points_that_are_no_stars_are_refused() -> None:
    rng = np.random.default_rng(9)
    for stars in (4, 5, 6, 8, 12):
        points = random_points(rng, stars, 2048)
        options = SolveOptions(hint=knowing(14.1, 1e-3), blind_after_hint=False)
        found = run(solve_detections(points, options))
        assert not isinstance(found, Solution)
