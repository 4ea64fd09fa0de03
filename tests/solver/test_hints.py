"""What a person and a header say of a frame, and what few stars make of it."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from kochab.core.attitude import attitude_from, separation_deg
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.sky import open_catalogue
from kochab.solver import SolveOptions
from kochab.solver.few_stars import identify_few
from kochab.solver.pipeline import merged_hint, solve_detections, with_field, year_of

from .fields import YEAR, photograph


@pytest.mark.parametrize("fov_deg", [0.5, 12.0, 90.0])
def test_a_width_in_degrees_is_a_scale_good_to_a_tenth(fov_deg) -> None:
    low, high = with_field(SolveOptions(fov_deg=fov_deg), 2000).scale_arcsec_px
    focal_px = 1000.0 / np.tan(np.radians(fov_deg / 2.0))
    assert np.sqrt(low * high) == pytest.approx(206264.806 / focal_px)
    assert high / low == pytest.approx(1.21)
    hint = Hint(centre_deg=(10.0, 20.0, 3.0))
    assert with_field(SolveOptions(fov_deg=fov_deg, hint=hint), 2000).centre_deg == (10.0, 20.0, 3.0)
    assert with_field(SolveOptions(hint=hint), 2000) is hint


def test_what_the_person_says_comes_before_the_header() -> None:
    header = Hint(scale_arcsec_px=(1.0, 2.0), exposure_s=5.0, camera="ASI294")
    person = Hint(scale_arcsec_px=(3.0, 4.0))
    both = merged_hint(person, header)
    assert (both.scale_arcsec_px, both.exposure_s, both.camera) == ((3.0, 4.0), 5.0, "ASI294")
    assert merged_hint(None, header) is header
    assert merged_hint(person, None) is person
    assert merged_hint(None, None) is None


def test_a_julian_year_has_365_and_a_quarter_days() -> None:
    epoch = datetime(2000, 1, 1, 12, tzinfo=UTC)
    assert year_of(epoch) == 2000.0
    assert year_of(epoch + timedelta(days=3652.5)) == pytest.approx(2010.0)
    assert year_of(epoch - timedelta(days=36525.0)) == pytest.approx(1900.0)
    assert 2015.0 < year_of(None) < 2035.0


FEW = Camera.centred(600, 450, 600 / 2 / np.tan(np.radians(7.5)))
POINTING = attitude_from(84.0, 0.0, 70.0)


def few(stars=5, noise_px=0.0, hint=None):
    return identify_few(photograph(FEW, POINTING, stars, noise_px).detections, hint, open_catalogue(), YEAR)


def scale_hint(low, high, **more):
    return Hint(scale_arcsec_px=(FEW.scale_arcsec_px * low, FEW.scale_arcsec_px * high), **more)


def test_exact_stars_give_the_exact_pointing_and_scale() -> None:
    found = few()
    off = separation_deg(found.attitude.boresight, POINTING.boresight) * 3600.0
    assert off < 0.15 * FEW.scale_arcsec_px
    assert found.camera.focal_px == pytest.approx(FEW.focal_px, rel=2e-4)
    assert (found.camera.cx, found.camera.cy) == (299.5, 224.5)
    assert len(found.matches) == 5


def test_a_narrower_search_is_less_likely_to_match_by_chance() -> None:
    """Fewer pairs are tried with a narrow scale, and fewer still about a place."""
    wide, narrow = few(noise_px=0.3, hint=scale_hint(0.8, 1.25)), few(noise_px=0.3, hint=scale_hint(0.97, 1.03))
    placed = few(noise_px=0.3, hint=scale_hint(0.97, 1.03, centre_deg=(84.0, 0.0, 5.0)))
    assert placed.log10_false_alarm < narrow.log10_false_alarm < wide.log10_false_alarm


def test_a_scale_or_place_that_is_wrong_finds_nothing() -> None:
    assert few(hint=scale_hint(1.05, 1.2)) is None
    assert few(hint=scale_hint(0.8, 0.95)) is None
    assert few(hint=scale_hint(0.97, 1.03, centre_deg=(264.0, 0.0, 5.0))) is None


def test_a_wrong_place_does_not_cost_a_right_scale() -> None:
    """Six stars are too few to be found without the scale."""
    field = photograph(FEW, POINTING, 6, 0.2)
    hint = scale_hint(0.99, 1.01, centre_deg=(264.0, 0.0, 5.0))
    found = run(solve_detections(field.detections, SolveOptions(hint=hint)))
    assert isinstance(found, Solution)
    assert separation_deg(found.attitude.boresight, POINTING.boresight) < 0.01
    told = run(solve_detections(field.detections, SolveOptions(hint=replace(hint, centre_deg=None))))
    assert found.log10_false_alarm == pytest.approx(told.log10_false_alarm + np.log10(2.0))


def test_a_star_that_is_not_there_forbids_the_match() -> None:
    """All five must have a star: one moved by a hundredth of the width is one too many."""
    detections = photograph(FEW, POINTING, 5, 0.0).detections
    xy = detections.xy.copy()
    gap = np.linalg.norm(xy[:, None] - xy, axis=2)
    base = set(np.unravel_index(int(gap.argmax()), gap.shape))
    inner = next(k for k in range(5) if k not in base)
    xy[inner] += [12.0, 12.0]
    assert identify_few(replace(detections, xy=xy), scale_hint(0.97, 1.03), open_catalogue(), YEAR) is None
    assert isinstance(detections, Detections)
