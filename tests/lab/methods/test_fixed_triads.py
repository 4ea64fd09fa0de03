"""The fixed-point path of the triads against the floating one, and its silence about nothing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kochab.core.frame import Detections, Hint
from kochab.core.progress import run
from kochab.core.solution import Identification, NoSolution
from kochab.identification import IDENTIFIERS
from kochab.lab.fixed_point import FixedPointOverflowError
from kochab.lab.methods import triads_fixed_point
from kochab.lab.methods.triad_tests import TriadDetections
from kochab.sky import open_catalogue
from tests.cli.test_paper_tables import DENEB, VEGA
from tests.lab.methods.test_triads import FIELD, NAMES, detections_of

FIXED_VEGA = [3.8027, 1.8848, 1.6309, 4.2861, 1.9717, 3.2715, 6.8281, 1.9912, 5.1152, 5.9102]


def both(detections: Detections, field=FIELD):
    sight = TriadDetections.of(detections, 2700.0, False, field)
    pairs = np.triu_indices(len(sight.body), 1)
    fixed = triads_fixed_point.ANGLE.floats(triads_fixed_point.separations(sight))[pairs]
    return fixed, np.degrees(sight.separation)[pairs]


@pytest.mark.parametrize("table", [VEGA, DENEB])
def test_separations_agree_to_the_thesis_figure(table) -> None:
    fixed, floating = both(detections_of(table))
    assert np.abs(fixed - floating).max() < 0.003  # section 4.2.4.2


def test_the_thesis_own_integers() -> None:
    """Table 4.17: to the last bit, or to one, of its 1/1024 deg."""
    fixed, _ = both(detections_of(VEGA))
    off = np.round((fixed - FIXED_VEGA) * 1024)
    assert (off == 0).sum() >= 8
    assert np.abs(off).max() <= 1


def test_the_look_up_tables_are_the_thesis_own() -> None:
    assert len(triads_fixed_point.cosine_table()) == 2**15
    angles, left_out = triads_fixed_point.arc_cosine_table()
    assert len(angles) + left_out == 2**15 + 1
    assert angles[-1] == 0
    assert angles.max() <= triads_fixed_point.ANGLE.high


def test_beyond_the_crossover_the_tables_are_better() -> None:
    """Figure 3.1: below 11.65 deg Pythagoras, above it the tables, within 0.02 deg in all."""
    step = np.arange(0.25, 22.0, 0.25)
    exact = np.degrees(np.arccos(np.cos(np.radians(step)) ** 2))
    pythagoras = np.abs(step * np.sqrt(2.0) - exact)
    side = triads_fixed_point.ANGLE.of(np.stack([step, step], axis=1))
    tables = np.abs(triads_fixed_point.ANGLE.floats(triads_fixed_point.by_tables(side)) - exact)
    beyond = exact > triads_fixed_point.CROSSOVER_DEG
    assert tables[beyond].max() < 0.02
    assert (tables < pythagoras)[exact > 14.0].all()
    assert pythagoras[~beyond].max() < 0.021


@pytest.mark.parametrize("name", ["vega", "deneb"])
def test_the_names_are_those_of_floating_point(name) -> None:
    table = {"vega": VEGA, "deneb": DENEB}[name]
    triads = IDENTIFIERS.make("triads", field_deg=FIELD, dec_deg=(30.0, 90.0), arithmetic="fixed")
    found = run(triads.identify(detections_of(table), None, 2000.0))
    assert isinstance(found, Identification)
    catalogue = open_catalogue()
    assert found.matches.star.tolist() == [catalogue.find(f"HR {star}") for star in NAMES[name]]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.floats(0, 1100), st.floats(0, 1100)), min_size=2, max_size=8), st.floats(1.0, 60.0))
def test_separations_are_right_or_refused(points, field) -> None:
    detections = Detections.from_list(np.array(points), 1100, 1100)
    try:
        fixed, floating = both(detections, (field, field))
    except FixedPointOverflowError:
        span = np.ptp(np.array(points), axis=0).max()
        reach = max(span, np.abs(np.array(points) - 549.5).max())
        assert reach >= 511.9 or field >= 31.9 or both_float(detections, field).max() > 31.0
        return
    assert np.abs(fixed - floating).max() < 0.03


def both_float(detections: Detections, field: float):
    sight = TriadDetections.of(detections, 2700.0, False, (field, field))
    return np.degrees(sight.separation)


@given(st.lists(st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(-(2**31), 2**31 - 1)), min_size=1, max_size=10))
def test_directions_are_right_to_a_bit_or_two(steps) -> None:
    step = np.array([s for s in steps if max(map(abs, s)) > 500_000] or [(900_000, 0)], np.int64)
    got = triads_fixed_point.TURN.floats(triads_fixed_point.direction(step))
    true = np.degrees(np.arctan2(step[:, 1], step[:, 0]))
    # near the axis x the arc cosine of a 1.15 number has steps of 0.45 and 0.19 deg
    assert np.abs((got - true + 180.0) % 360.0 - 180.0).max() < 0.7


def test_a_field_too_wide_for_the_formats_is_no_answer_and_says_why() -> None:
    points = np.random.default_rng(2).uniform(0, 400, (12, 2))
    triads = IDENTIFIERS.make("triads", arithmetic="fixed", scales=1)
    found = run(triads.identify(Detections.from_list(points, 400, 400), Hint((300.0, 300.0))))
    assert isinstance(found, NoSolution)
    assert "6.10" in found.tried
