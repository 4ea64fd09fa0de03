"""The triads of the thesis on attitude from stellar images: its own frames, and simulated ones."""

import numpy as np
import pytest

from kochab.core.frame import Detections, Hint
from kochab.core.progress import run
from kochab.core.solution import Identification, NoSolution, Reason
from kochab.identification import IDENTIFIERS
from kochab.lab.methods.triad_tests import FoundTriads, TriadDetections
from kochab.lab.methods.triads import group_by_rotation
from kochab.simulate.random_fields import FieldPlan, random_field, random_points
from kochab.sky import open_catalogue
from tests.cli.test_paper_tables import DENEB, VEGA

FIELD = (9.0130, 6.9049)
SADR = np.array([[210.0, 121.1], [169.4, 234.8], [153.3, 304.4]])
NAMES = {"vega": (7001, 7139, 7056, 7051, 6872), "deneb": (7924, 7735, 7751, 7977, 7844, 7851, 8001, 8003, 7798)}


def detections_of(table) -> Detections:
    w, h = table["size"]
    xy = [((w - 1) / 2 + x, (h - 1) / 2 - y) for x, y, _ in table["stars"]]
    return Detections.from_list(np.array(xy), w, h)


@pytest.mark.parametrize("options", [{}, {"planar": True, "dec_deg": (30.0, 90.0)}])
@pytest.mark.parametrize("name", ["vega", "deneb"])
def test_the_papers_tables(name, options) -> None:
    table = {"vega": VEGA, "deneb": DENEB}[name]
    triads = IDENTIFIERS.make("triads", field_deg=FIELD, **options)
    found = run(triads.identify(detections_of(table), None, 2000.0))
    assert isinstance(found, Identification)
    catalogue = open_catalogue()
    expected = [catalogue.find(f"HR {star}") for star in NAMES[name]]
    assert found.matches.star.tolist() == expected
    assert found.matches.detection.tolist() == list(range(len(expected)))
    ra, dec = found.attitude.ra_dec_deg
    assert abs(ra - table["centre"][0]) < 0.02
    assert abs(dec - table["centre"][1]) < 0.02
    assert found.log10_false_alarm < -5
    assert not found.camera.mirrored


def test_the_papers_separations() -> None:
    """Table 4.1, degrees."""
    sight = TriadDetections.of(detections_of(VEGA), 2700.0, False, FIELD)
    paper = [3.8045, 1.8857, 1.6315, 4.2873, 1.9725, 3.2715, 6.8250, 1.9924, 5.1148, 5.9112]
    ours = np.degrees(sight.separation[np.triu_indices(5, 1)])
    np.testing.assert_allclose(ours, paper, atol=1e-4)


def test_sadr_has_no_answer_at_vote_number_two() -> None:
    triads = IDENTIFIERS.make("triads", field_deg=FIELD)
    found = run(triads.identify(Detections.from_list(SADR, 469, 360)))
    assert isinstance(found, NoSolution)


def test_triads_of_like_rotation_are_grouped_across_the_full_turn() -> None:
    turn = np.radians([359.0, 1.0, 90.0, 3.0, 94.0])
    none = np.zeros((5, 3), dtype=np.int64)
    groups = group_by_rotation(FoundTriads(none, none, turn), np.radians(5.0))
    assert [group.tolist() for group in groups] == [[0, 1, 3], [2, 4]]


def test_real_fields_are_named_right_or_refused() -> None:
    catalogue, rng = open_catalogue(), np.random.default_rng(3)
    named = 0
    for _ in range(6):
        field = random_field(catalogue, rng, FieldPlan(12.0, noise_px=0.2))
        s = field.camera.scale_arcsec_px
        triads = IDENTIFIERS.make("triads", separation_deg=0.03)
        found = run(triads.identify(field.detections, Hint((s / 1.1, s * 1.1))))
        if isinstance(found, NoSolution):
            continue
        named += 1
        assert found.attitude.boresight @ field.attitude.boresight > np.cos(np.radians(0.05))
        assert found.camera.mirrored == field.camera.mirrored
    assert named >= 3


@pytest.mark.parametrize(
    ("stars", "hint", "reason"),
    [
        (20, None, Reason.NO_PATTERN_AGREED),
        (2, Hint((30.0, 32.0)), Reason.TOO_FEW_STARS),
        (20, Hint((30.0, 32.0)), Reason.NO_PATTERN_AGREED),
    ],
)
def test_what_it_cannot_work_with(stars, hint, reason) -> None:
    found = run(IDENTIFIERS.make("triads").identify(random_points(np.random.default_rng(1), stars), hint))
    assert isinstance(found, NoSolution)
    assert found.reason == reason


def test_it_gives_up_with_a_reason_where_the_triads_are_too_many() -> None:
    field = random_field(open_catalogue(), np.random.default_rng(3), FieldPlan(40.0, 2048, brightest=20))
    scale = field.camera.scale_arcsec_px
    method = IDENTIFIERS.make("triads", most=1)
    found = run(method.identify(field.detections, Hint(scale_arcsec_px=(scale / 1.1, scale * 1.1))))
    assert isinstance(found, NoSolution)
    assert "1 million triads" in found.tried


def test_there_is_a_place_to_cancel_at_every_triad() -> None:
    field = random_field(open_catalogue(), np.random.default_rng(3), FieldPlan(10.0, 2048, brightest=12))
    scale = field.camera.scale_arcsec_px
    task = IDENTIFIERS.make("triads").identify(field.detections, Hint(scale_arcsec_px=(scale, scale)))
    assert sum(1 for _ in task) >= 220
