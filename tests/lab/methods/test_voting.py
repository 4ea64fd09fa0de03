import numpy as np
import pytest

from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.progress import run
from kochab.core.solution import Identification, NoSolution, Reason
from kochab.identification import IDENTIFIERS
from kochab.lab.methods.pairs import make_pairs
from kochab.lab.methods.voting import verification_votes, vote
from kochab.simulate.random_fields import FieldPlan, random_field, random_points
from kochab.sky import open_catalogue


def knowing(camera: Camera) -> Hint:
    s = camera.scale_arcsec_px
    return Hint(scale_arcsec_px=(s / 1.1, s * 1.1))


def test_both_rounds_on_a_toy_sky(toy_sky) -> None:
    stars = toy_sky[:400]
    pairs = make_pairs(np.arange(400), stars, np.radians(40.0))
    near = np.argsort(-(stars @ stars[0]))[:10]
    body = stars[near].copy()
    body[9] = stars[300]  # a false star
    winner, votes, tried = vote(body, pairs, np.radians(0.01))
    assert winner[:9].tolist() == near[:9].tolist()
    assert (votes[:9] >= 8).all()
    assert tried > 2 * 36
    agreed = verification_votes(body, stars[winner], votes > 0, np.radians(0.01))
    assert (agreed[:9] >= 8).all()


def test_real_fields_are_named_right_or_refused() -> None:
    catalogue, rng = open_catalogue(), np.random.default_rng(3)
    named = 0
    for _ in range(12):
        field = random_field(catalogue, rng, FieldPlan(15.0, noise_px=0.2))
        voting = IDENTIFIERS.make("voting", margin_px=1.0)
        found = run(voting.identify(field.detections, knowing(field.camera)))
        if isinstance(found, NoSolution):
            continue
        named += 1
        assert found.attitude.boresight @ field.attitude.boresight > np.cos(np.radians(0.05))
        assert found.camera.mirrored == field.camera.mirrored
        assert found.log10_false_alarm < -5
        places = field.camera.project(found.matches.vectors @ field.attitude.matrix.T)
        assert np.abs(places - found.matches.xy).max() < 5.0
    assert named >= 6


def test_points_that_are_no_stars_are_refused() -> None:
    rng = np.random.default_rng(8)
    camera = Camera.centred(1024, 1024, 4000.0)
    for _ in range(5):
        found = run(IDENTIFIERS.make("voting").identify(random_points(rng, 30), knowing(camera)))
        assert isinstance(found, NoSolution)


@pytest.mark.parametrize(
    ("stars", "hint", "reason"), [(20, None, Reason.NO_PATTERN_AGREED), (5, Hint((30.0, 32.0)), Reason.TOO_FEW_STARS)]
)
def test_what_it_cannot_work_with(stars, hint, reason) -> None:
    points = np.random.default_rng(1).uniform(0, 900, (stars, 2))
    found = run(IDENTIFIERS.make("voting").identify(Detections.from_list(points, 900, 900), hint))
    assert not isinstance(found, Identification)
    assert found.reason == reason
