"""The order of attempts, the clock, and what an answer holds."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from kochab.core.errors import UsageError
from kochab.core.frame import Detections, Frame, Hint, Site
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason, Solution
from kochab.detection import DETECTORS
from kochab.identification import IDENTIFIERS
from kochab.solver import SolveOptions
from kochab.solver.pipeline import examine_frame, merged_hint, solve_detections, solve_frame, year_of

from .fields import Field, Told, orion

NOTHING = Hint()
OPTIONS = SolveOptions(method="told")
SCALE = Hint(scale_arcsec_px=(20.0, 30.0), time_utc=datetime(2024, 1, 1, 12, tzinfo=UTC))


class Fixed:
    """A detector that finds what the test wants."""

    field: Field

    def detect(self, frame):
        return type(self).field.detections


@pytest.fixture
def identifier(monkeypatch):
    class Fresh(Told):
        field = orion()
        asked = []  # noqa: RUF012

    monkeypatch.setitem(globals(), "Fresh", Fresh)
    monkeypatch.setitem(IDENTIFIERS.own, "told", f"{__name__}:Fresh")
    monkeypatch.setattr(Fixed, "field", Fresh.field, raising=False)
    monkeypatch.setitem(DETECTORS.own, "fixed", f"{__name__}:Fixed")
    return Fresh


def frame_like(field: Field, hint: Hint = NOTHING) -> Frame:
    return Frame(np.zeros((field.camera.height, field.camera.width), np.uint8), hint=hint)


def test_an_answer_is_where_the_camera_points(identifier) -> None:
    result = run(solve_detections(identifier.field.detections, OPTIONS))
    assert isinstance(result, Solution)
    assert result.ra_dec_deg == pytest.approx((84.0, -2.0), abs=1e-3)
    assert result.roll_deg == pytest.approx(25.0, abs=0.01)
    assert result.detections == len(identifier.field.detections)
    assert len(result.stars) > 70
    mags = [star.mag for star in result.stars]
    assert mags == sorted(mags)
    assert {"Alnilam", "Alnitak", "Mintaka"} <= {star.name for star in result.stars}
    assert all(star.residual_px < 2 for star in result.stars)
    assert set(result.elapsed_ms) == {"read", "detect", "identify", "attitude", "total"}
    assert result.method == "told"
    assert result.log10_false_alarm == -12.0


def test_named_stars_are_where_the_solution_puts_them(identifier) -> None:
    from kochab.core.attitude import unit_vectors

    result = run(solve_detections(identifier.field.detections, OPTIONS))
    sky = unit_vectors(*np.array([(s.ra_deg, s.dec_deg) for s in result.stars]).T)
    seen = result.pixels_of(sky)
    recorded = np.array([(s.x, s.y) for s in result.stars])
    residual = [s.residual_px for s in result.stars]
    np.testing.assert_allclose(np.hypot(*(seen - recorded).T), residual, atol=1e-6)


def test_without_a_hint_there_is_one_blind_attempt(identifier) -> None:
    run(solve_detections(identifier.field.detections, OPTIONS))
    assert [hint for hint, _ in identifier.asked] == [None]


def test_a_hint_is_tried_first_and_the_sky_blind_after_it(identifier) -> None:
    identifier.only_when_blind = True
    options = replace(OPTIONS, hint=SCALE)
    assert isinstance(run(solve_detections(identifier.field.detections, options)), Solution)
    assert [hint for hint, _ in identifier.asked] == [SCALE, None]


def test_a_person_may_ask_for_the_hint_alone(identifier) -> None:
    identifier.only_when_blind = True
    options = replace(OPTIONS, hint=SCALE, blind_after_hint=False)
    assert isinstance(run(solve_detections(identifier.field.detections, options)), NoSolution)
    assert len(identifier.asked) == 1


def test_a_hint_that_says_nothing_of_the_sky_is_no_attempt_but_gives_the_year(identifier) -> None:
    hint = Hint(time_utc=datetime(2009, 7, 2, 12, tzinfo=UTC))
    run(solve_detections(identifier.field.detections, replace(OPTIONS, hint=hint)))
    assert [hint for hint, _ in identifier.asked] == [None]
    assert identifier.asked[0][1] == pytest.approx(2009.5, abs=0.01)


def test_the_header_is_a_hint_and_can_be_left_aside(identifier) -> None:
    frame = frame_like(identifier.field, SCALE)
    options = replace(OPTIONS, detector="fixed")
    run(solve_frame(frame, options))
    run(solve_frame(frame, replace(options, use_header=False)))
    assert [hint for hint, _ in identifier.asked] == [SCALE, None]


def test_the_field_of_view_becomes_a_scale(identifier) -> None:
    run(solve_detections(identifier.field.detections, replace(OPTIONS, fov_deg=12.0)))
    low, high = identifier.asked[0][0].scale_arcsec_px
    true = identifier.field.camera.scale_arcsec_px
    assert (low, high) == pytest.approx((true / 1.1, true * 1.1))


def test_examining_hands_back_the_detections(identifier) -> None:
    examined = run(examine_frame(frame_like(identifier.field), replace(OPTIONS, detector="fixed")))
    assert examined.detections is identifier.field.detections
    assert isinstance(examined.result, Solution)
    assert examined.result.elapsed_ms["total"] >= examined.result.elapsed_ms["detect"] > 0


def test_a_refusal_is_diagnosed(identifier) -> None:
    identifier.never = True
    result = run(solve_detections(identifier.field.detections, OPTIONS))
    assert isinstance(result, NoSolution)
    assert result.reason is Reason.NO_PATTERN_AGREED
    assert result.tried == "told to refuse"
    assert result.advice
    assert result.measured["stars_found"] == len(identifier.field.detections)


@pytest.mark.parametrize("method", ["voting", "angles", "triads", "neighbours", "predict"])
def test_what_a_method_lacks_is_asked_for(method) -> None:
    result = run(solve_detections(orion().detections, SolveOptions(method=method)))
    assert isinstance(result, NoSolution)
    assert result.tried.startswith("nothing")
    assert "field" in result.advice


def test_a_hint_that_was_given_is_not_asked_for() -> None:
    stars = Detections.from_list(np.random.default_rng(1).uniform(0, 900, (30, 2)), 900, 900)
    result = run(solve_detections(stars, SolveOptions(method="angles", fov_deg=10.0)))
    assert isinstance(result, NoSolution)
    assert "pivots" in result.tried


def test_time_runs_out_between_steps(identifier) -> None:
    identifier.steps = 10**9
    options = replace(OPTIONS, timeout_s=0.02)
    result = run(solve_detections(identifier.field.detections, options))
    assert isinstance(result, NoSolution)
    assert result.reason is Reason.TIMED_OUT
    assert "0.02 s" in result.tried
    assert identifier.closed


def test_making_the_patterns_is_not_the_frames_time(identifier, monkeypatch) -> None:
    from kochab.core import progress as stopwatch
    from kochab.core.progress import Progress

    now = [0.0]
    monkeypatch.setattr(stopwatch, "perf_counter", lambda: now[0])

    def task(stage: str):
        for _ in range(10):
            yield Progress(stage)
            now[0] += 10.0
        return "done"

    assert run(stopwatch.Stopwatch(25.0).watch(task("patterns"))) == "done"
    with pytest.raises(stopwatch.TimedOut):
        run(stopwatch.Stopwatch(25.0).watch(task("identify")))


def test_closing_the_task_stops_the_identifier(identifier) -> None:
    identifier.steps = 10**9
    task = solve_detections(identifier.field.detections, OPTIONS)
    while next(task).stage != "identify" or not identifier.asked:
        pass
    task.close()
    assert identifier.closed


@pytest.mark.parametrize("change", [{"method": "guess"}, {"detector": "eyes"}, {"attitude": "x"}])
def test_a_name_that_does_not_exist_is_told_with_those_that_do(change) -> None:
    frame = Frame(np.zeros((50, 60), np.uint8))
    with pytest.raises(UsageError, match=r"choose one of|there are"):
        run(solve_frame(frame, replace(SolveOptions(), **change)))


def test_the_persons_word_goes_before_the_headers() -> None:
    said = Hint(scale_arcsec_px=(1.0, 2.0), source="person")
    header = Hint((3.0, 4.0), (10.0, 20.0, 5.0), site=Site(50.0, 8.0), source="header")
    both = merged_hint(said, header)
    assert both == replace(header, scale_arcsec_px=(1.0, 2.0), source="person")
    assert merged_hint(None, header) is header
    assert merged_hint(said, None) is said
    assert merged_hint(None, None) is None


def test_years() -> None:
    assert year_of(datetime(2000, 1, 1, 12, tzinfo=UTC)) == 2000.0
    assert year_of(datetime(2025, 1, 1, tzinfo=UTC)) == pytest.approx(2025.0, abs=0.01)
    assert 2010 < year_of(None) < 2030


def test_aberration_is_taken_out_on_request(identifier) -> None:
    from kochab.sky.apparent import with_aberration

    options = replace(OPTIONS, hint=SCALE)
    seen = run(solve_detections(identifier.field.detections, options))
    geometric = run(solve_detections(identifier.field.detections, replace(options, aberration=True)))
    moved = np.linalg.norm(seen.centre_vector - geometric.centre_vector) * 206264.8
    expected = with_aberration(seen.centre_vector[None], SCALE.time_utc)[0]
    assert 5 < moved < 21
    assert np.linalg.norm(expected - geometric.centre_vector) * 206264.8 < 0.05
    assert [s.ra_deg for s in seen.stars] == [s.ra_deg for s in geometric.stars]


def test_aberration_leaves_the_weights_of_the_stars(identifier) -> None:
    """Faint stars weighed as much as bright ones once it was corrected: 0.9 arcsec beside the place."""
    from kochab.sky.apparent import with_aberration

    seen = identifier.field.detections
    snr = np.geomspace(300.0, 3.0, len(seen))
    xy = seen.xy + np.random.default_rng(1).normal(size=seen.xy.shape) * (2.0 / snr)[:, None]
    seen = replace(seen, xy=xy, snr=snr, fwhm_px=np.full(len(seen), 4.0))
    plain, geometric = (
        run(solve_detections(seen, replace(OPTIONS, hint=SCALE, aberration=corrected))) for corrected in (False, True)
    )
    expected = with_aberration(plain.centre_vector[None], SCALE.time_utc)[0]
    assert np.linalg.norm(expected - geometric.centre_vector) * 206264.8 < 0.1
    assert geometric.attitude.sigma_arcsec == pytest.approx(plain.attitude.sigma_arcsec, rel=0.03)


@pytest.mark.parametrize("hint", [None, replace(SCALE, time_of_file=True)])
def test_aberration_without_a_time_is_a_warning(identifier, hint) -> None:
    options = replace(OPTIONS, hint=hint, aberration=True)
    result = run(solve_detections(identifier.field.detections, options))
    assert "has no date" in result.warnings[0]


def test_when_a_file_was_written_is_no_date_of_its_frame(identifier) -> None:
    dated, undated = (
        run(solve_detections(identifier.field.detections, replace(OPTIONS, hint=replace(SCALE, time_of_file=of_file))))
        for of_file in (False, True)
    )
    assert np.all(np.diag(undated.attitude.covariance)[:2] > np.diag(dated.attitude.covariance)[:2])


def test_the_frames_warnings_stay_with_the_answer(identifier) -> None:
    frame = replace(frame_like(identifier.field), warnings=("Odd header.",))
    result = run(solve_frame(frame, replace(OPTIONS, detector="fixed")))
    assert result.warnings == ("Odd header.",)


@pytest.mark.parametrize("from_frame", [True, False])
def test_the_journal_has_one_line_of_every_search(identifier, caplog, from_frame) -> None:
    """Where and how surely, or why not."""
    caplog.set_level("DEBUG", logger="kochab.solver.pipeline")
    options = replace(OPTIONS, detector="fixed")
    if from_frame:
        result = run(examine_frame(frame_like(identifier.field), options)).result
    else:
        result = run(solve_detections(identifier.field.detections, options))
    ra, dec = result.ra_dec_deg
    (line,) = [record.getMessage() for record in caplog.records]
    assert line == (
        f"solved in {result.elapsed_ms['total']:.0f} ms by {result.method}: RA {ra:.5f} Dec {dec:+.5f},"
        f" {len(result.stars)} stars, RMS {result.rms_px:.2f} px"
    )
    caplog.clear()
    refused = run(solve_detections(identifier.field.detections.take(slice(0, 1)), options))
    assert [record.getMessage() for record in caplog.records] == [
        f"no solution in {refused.elapsed_ms['total']:.0f} ms: {refused.reason}"
    ]


@pytest.mark.parametrize(("stars", "asked"), [(2, 0), (3, 1)])
def test_no_method_is_asked_for_less_than_three_stars(identifier, stars, asked) -> None:
    identifier.never = True
    result = run(solve_detections(identifier.field.detections.take(slice(0, stars)), OPTIONS))
    assert result.reason is Reason.TOO_FEW_STARS
    assert len(identifier.asked) == asked
