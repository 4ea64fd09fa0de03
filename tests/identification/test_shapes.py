"""Lists with no star field in them: crowded shapes that look like an open cluster."""

import numpy as np
import pytest

from kochab.core.frame import Hint
from kochab.core.progress import run
from kochab.core.solution import NoSolution
from kochab.identification.index import shipped
from kochab.identification.patterns import Patterns
from kochab.lab.bench.identify_shapes import LEAST_PX, SHAPES, shape_list

SEED = 20260302


@pytest.mark.parametrize(("shape", "number"), [("Plummer cluster", 7), ("King cluster", 5)])
def test_a_dense_cluster_without_truth_is_refused(shape, number) -> None:
    """Counting the stars as evenly spread solved each of these at 10^-5.6 to 10^-7."""
    answer = run(Patterns(shipped()).identify(shape_list(SHAPES[shape], SEED, number)))
    assert isinstance(answer, NoSolution)


def test_few_points_of_a_shape_are_refused_at_a_known_scale() -> None:
    method, hint = Patterns(shipped()), Hint(scale_arcsec_px=(52.0, 53.0))
    for number, shape in enumerate(SHAPES.values()):
        points = shape_list(shape, SEED, number).take(slice(0, 6 + number))
        assert isinstance(run(method.identify(points, hint)), NoSolution)


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_the_lists_are_in_the_frame_ordered_and_repeatable(shape) -> None:
    for number in range(6):
        first, again = (shape_list(shape, 3, number) for _ in range(2))
        assert np.array_equal(first.xy, again.xy)
        assert ((first.xy > 0) & (first.xy < 1023)).all()
        assert (np.diff(first.flux) <= 0).all()
        gap = np.linalg.norm(first.xy[:200, None] - first.xy[:200], axis=2)
        np.fill_diagonal(gap, np.inf)
        assert number % 2 == 0 or gap.min() >= LEAST_PX
