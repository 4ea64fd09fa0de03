import numpy as np
import pytest
from scipy.spatial import cKDTree

from kochab.core.attitude import unit_vectors
from kochab.core.errors import UsageError
from kochab.core.progress import run
from kochab.sky import Catalogue
from kochab.sky.catalogue_file import StarList, write_deep
from kochab.sky.inventory import coverage, even_points


def test_even_points_are_even():
    v = even_points(5000)
    assert np.linalg.norm(v, axis=1) == pytest.approx(1.0)
    assert v.mean(axis=0) == pytest.approx(0.0, abs=1e-3)
    assert np.mean(np.abs(v[:, 2]) < 0.5) == pytest.approx(0.5, abs=1e-3)
    nearest = cKDTree(v).query(v, k=2)[0][:, 1]
    assert nearest.min() > 0.7 * np.sqrt(4.0 * np.pi / 5000), "none is beside another"


def test_the_hole_in_the_sky_is_found(tmp_path):
    v = even_points(60_000)
    hole = unit_vectors(123.0, -34.0)
    v = v[v @ hole < np.cos(np.radians(4.0))]
    write_deep(tmp_path / "deep.kcat", StarList.of(v, np.full(len(v), 8.0)))
    told = run(coverage(Catalogue(tmp_path / "deep.kcat"), 4.0, fields=20_000))
    want = 60_000 / 41253.0 * 16.0
    assert told["median"] == pytest.approx(want, abs=2)
    assert told["fewest"] == 0
    place = unit_vectors(told["poorest_ra_deg"], told["poorest_dec_deg"])
    assert np.degrees(np.arccos(place @ hole)) < 2.5


def test_counts_agree_with_a_camera(catalogue):
    from kochab.core.attitude import attitude_from
    from kochab.core.camera import Camera

    told = run(coverage(catalogue, 3.0, mag_limit=8.0, fields=400))
    assert told["mag_limit"] == 8.0
    camera = Camera.centred(1000, 1000, 500.0 / np.tan(np.radians(1.5)))
    counts = []
    for centre in even_points(400):
        ra, dec = np.degrees(np.arctan2(centre[1], centre[0])), np.degrees(np.arcsin(centre[2]))
        rows = catalogue.cone(centre, np.radians(2.2), mag_limit=8.0)
        sky = catalogue.vectors(rows) @ attitude_from(ra, dec, 0.0).matrix.T
        xy = camera.project(sky)
        counts.append(int(np.sum(np.all((xy > -0.5) & (xy < 999.5), axis=1))))
    assert (told["fewest"], told["most"]) == (min(counts), max(counts))
    assert told["median"] == sorted(counts)[199]
    assert told["share_with_10"] == pytest.approx(np.mean(np.array(counts) >= 10))


@pytest.mark.parametrize("fov", [0.0, -1.0, 91.0, float("nan")])
def test_absurd_fields_are_refused(catalogue, fov):
    with pytest.raises(UsageError, match="between"):
        run(coverage(catalogue, fov))
