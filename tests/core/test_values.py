"""The smaller words: detections, hints, solutions, tasks, and a frame."""

from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Frame, Hint, Site
from kochab.core.progress import Progress, run
from kochab.core.solution import Solution

fluxes = st.lists(st.floats(-1e6, 1e6), max_size=20)


def detections(n=5):
    """``n`` stars each of whose numbers says which star it belongs to."""
    i = np.arange(n, dtype=np.float64)
    return Detections(
        100,
        80,
        np.column_stack([i, i + 0.5]),
        100 - i,
        50 - i,
        2 + i,
        1 + i,
        i / 10,
        i % 2 == 0,
        i % 3 == 0,
        background=7.0,
        noise=0.5,
    )


@given(fluxes)
def test_a_list_is_put_brightest_first_and_keeps_its_positions(flux):
    xy = np.column_stack([np.arange(len(flux)), np.zeros(len(flux))])
    found = Detections.from_list(xy, 10, 10, np.array(flux))
    assert len(found) == len(flux)
    assert (np.diff(found.flux) <= 0).all()
    assert [flux[int(i)] for i in found.xy[:, 0]] == list(found.flux)
    ties = np.diff(found.flux) == 0
    assert (np.diff(found.xy[:, 0])[ties] > 0).all()


def test_a_list_without_flux_is_taken_as_brightest_first():
    xy = [[3.0, 1.0], [2.0, 9.0], [7.0, 7.0]]
    found = Detections.from_list(xy, 10, 10)
    assert found.xy.tolist() == xy
    assert (np.diff(found.flux) < 0).all()
    assert len(Detections.from_list(np.empty((0, 2)), 10, 10)) == 0


@pytest.mark.parametrize("index", [np.array([3, 0]), np.array([True, False, False, True, False]), slice(1, 4)])
def test_take_keeps_every_array_in_step(index):
    whole = detections()
    part = whole.take(index)
    chosen = np.arange(5)[index]
    assert len(part) == len(chosen)
    for name in ("xy", "flux", "snr", "fwhm_px", "elongation", "angle_rad", "saturated", "blended"):
        assert np.array_equal(getattr(part, name), getattr(whole, name)[chosen]), name
    assert (part.width, part.height, part.background, part.noise) == (100, 80, 7.0, 0.5)


def test_a_hint_helps_when_it_tells_of_the_sky():
    site, when = Site(47.0, 11.0, 800.0), datetime(2024, 3, 1, 22, tzinfo=UTC)
    assert not Hint(None, None, when, 2.0, site, "a camera", "header").helps
    assert Hint(centre_deg=(0.0, 0.0, 1.0)).helps
    assert Hint(scale_arcsec_px=(1.0, 2.0)).helps
    assert not Hint().helps


def test_a_task_is_driven_to_its_result_and_reports_on_the_way():
    def task():
        yield Progress("read", 0.5)
        yield Progress("solve", detail="level 3")
        return "done"

    heard = []
    assert run(task(), heard.append) == "done"
    assert heard == [Progress("read", 0.5), Progress("solve", None, "level 3")]
    assert run(task()) == "done"


def test_a_task_that_fails_is_not_swallowed():
    def task():
        yield Progress("read")
        raise ValueError("broken")

    with pytest.raises(ValueError, match="broken"):
        run(task())


def test_a_frame_measures_columns_by_rows():
    frame = Frame(np.zeros((3, 5), np.uint16))
    assert (frame.width, frame.height) == (5, 3)
    assert not frame.hint.helps


def test_a_solution_speaks_for_the_frames_middle_with_distortion_included():
    camera = Camera(600, 400, 1200.0, 100.0, 350.0, k1=-0.1, p2=0.01)
    solution = Solution(camera, attitude_from(83.0, -5.0, 20.0), (), 0.5, -20.0, "test")
    x, y = solution.pixels_of(solution.centre_vector[None])[0]
    assert (x, y) == pytest.approx((299.5, 199.5))
    assert solution.ra_dec_deg != pytest.approx((83.0, -5.0), abs=1.0)
    assert solution.rms_arcsec == pytest.approx(0.5 * 206264.806 / 1200)
