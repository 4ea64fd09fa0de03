"""Five stars are enough when all of them are bright stars, and chance does not get through."""

import numpy as np
import pytest

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.sky import open_catalogue
from kochab.solver.few_stars import identify_few

from .fields import YEAR, photograph


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(("ra", "dec", "fov_deg"), [(84.0, 0.0, 15.0), (278.5, 37.2, 12.0)])
@pytest.mark.parametrize("hinted", [False, True])
def test_the_five_brightest_name_themselves(ra, dec, fov_deg, mirrored, hinted) -> None:
    focal = 600 / 2 / np.tan(np.radians(fov_deg / 2))
    camera = Camera.centred(600, 450, focal, mirrored)
    field = photograph(camera, attitude_from(ra, dec, 70.0), 5, 0.3)
    scale = camera.scale_arcsec_px
    hint = Hint(scale_arcsec_px=(scale / 1.1, scale * 1.1)) if hinted else None
    found = identify_few(field.detections, hint, open_catalogue(), YEAR)
    assert found is not None
    assert found.camera.mirrored is mirrored
    assert (found.matches.star == field.rows[found.matches.detection]).all()
    assert found.log10_false_alarm < -5
    cosine = found.attitude.boresight @ field.attitude.boresight
    assert np.degrees(np.arccos(min(1.0, cosine))) < 0.1


def test_random_places_are_refused() -> None:
    rng = np.random.default_rng(8)
    for _ in range(40):
        xy = rng.uniform(0, 1, (rng.integers(5, 7), 2)) * [600, 450]
        hint = Hint(scale_arcsec_px=(70.0, 85.0))
        assert identify_few(Detections.from_list(xy, 600, 450), hint, open_catalogue(), YEAR) is None


@pytest.mark.parametrize("count", [0, 1, 4, 7])
def test_other_counts_are_not_its_business(count: int) -> None:
    xy = np.random.default_rng(0).uniform(0, 400, (count, 2))
    assert identify_few(Detections.from_list(xy, 600, 450), None, open_catalogue(), YEAR) is None


def test_a_field_too_narrow_for_the_bright_sky_is_left_alone() -> None:
    xy = np.random.default_rng(0).uniform(0, 400, (5, 2))
    hint = Hint(scale_arcsec_px=(1.0, 1.1))
    assert identify_few(Detections.from_list(xy, 600, 450), hint, open_catalogue(), YEAR) is None


def test_one_place_twice_is_no_crash() -> None:
    xy = np.full((5, 2), 100.0)
    assert identify_few(Detections.from_list(xy, 600, 450), None, open_catalogue(), YEAR) is None


def test_stars_that_crowd_where_the_detections_stand_make_it_less_certain(monkeypatch) -> None:
    camera = Camera.centred(600, 450, 600 / 2 / np.tan(np.radians(7.5)))
    field = photograph(camera, attitude_from(84.0, 0.0, 70.0), 5, 0.3)
    alarms = []
    for crowd in (1.0, 3.0, 1e3):
        monkeypatch.setattr("kochab.identification.verification.crowding", lambda *_, crowd=crowd: crowd)
        found = identify_few(field.detections, None, open_catalogue(), YEAR)
        alarms.append(found.log10_false_alarm if found else None)
    plain, dense, densest = alarms
    assert dense == pytest.approx(plain + 3 * np.log10(3.0))  # three stars confirm the two
    assert densest is None
