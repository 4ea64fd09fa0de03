"""Narrow frames of which nothing is known, by an index of the user's own stars."""

import shutil

import numpy as np
import pytest

from kochab.core.attitude import apart_deg, unit_vectors
from kochab.core.errors import CatalogueError
from kochab.core.frame import Hint
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Solution
from kochab.identification.index import shipped
from kochab.identification.index_build import acquire, release
from kochab.simulate.random_fields import random_points
from kochab.sky import user_catalogues
from kochab.solver import SolveOptions, own_index
from kochab.solver.pipeline import solve_detections
from tests.windows.mapped import let_go

from .test_cone_search import PLACE, database, deep_field, deep_stars, in_use  # noqa: F401 (fixtures)

BANDS = (-80.0, -75.0)
PARTS = ((-81.0, -75.0), (-75.0, -69.0))
"""Those that hold the deep stars; parts meet in their middle."""


def of_two_bands(monkeypatch, cache):
    """An index is made of two bands of the sky, in a cache of its own."""
    monkeypatch.setenv("KOCHAB_CACHE", str(cache))
    monkeypatch.setattr(own_index, "SOUTH_DEG", BANDS)
    monkeypatch.setattr(own_index, "PARTS_DEG", PARTS)


@pytest.fixture(scope="module")
def made(tmp_path_factory, database):  # noqa: F811
    """A cache with the index in it, to be copied."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("KOCHAB_CONFIG", str(folder))
        of_two_bands(monkeypatch, folder / "cache")
        run(user_catalogues.choose(str(database)))
        assert run(own_index.make_own())
    return folder / "cache"


@pytest.fixture
def own_cache(tmp_path, monkeypatch, in_use):  # noqa: F811
    of_two_bands(monkeypatch, tmp_path / "cache")
    # as if the index of small fields were there, without a star of theirs
    monkeypatch.setattr("kochab.identification.patterns.fine", lambda: shipped()[-1])
    return tmp_path / "cache"


def right(result, attitude, fov_deg):
    return isinstance(result, Solution) and apart_deg(result.ra_dec_deg, attitude.ra_dec_deg) < 0.01 * fov_deg


def test_frames_of_a_third_of_a_degree_are_solved_blind_once_the_index_is_made(own_cache, made, deep_stars):  # noqa: F811
    rng = np.random.default_rng(1)  # 61 of 64 such frames are found, all of these
    frames = [(deep_field(deep_stars, rng, fov), fov) for fov in (0.28, 0.3, 0.3, 0.35, 0.45)]
    (detections, _, _), _ = frames[0]
    assert own_index.own_volumes() == ()
    assert isinstance(run(solve_detections(detections)), NoSolution)
    shutil.copytree(made, own_cache)
    level = np.concatenate([volume.stars for volume in own_index.own_volumes()]).astype(float)
    # no more than the level's share, and the deep stars among them
    around = unit_vectors(*PLACE)
    assert 60.0 < np.count_nonzero(level @ around > np.cos(np.radians(1.0))) / np.pi < 350.0
    for (detections, _, attitude), fov in frames:
        result = run(solve_detections(detections))
        assert right(result, attitude, fov)
        assert result.log10_false_alarm < -5.0
        assert len(result.stars) >= 0.6 * len(detections)
    # what is known of the scale is believed, and a wrong place is not
    (detections, camera, attitude), fov = frames[1]
    scale = camera.scale_arcsec_px
    wrong = Hint(scale_arcsec_px=(scale / 1.1, scale * 1.1), centre_deg=(120.0, 40.0, 1.0))
    assert right(run(solve_detections(detections, SolveOptions(hint=wrong))), attitude, fov)
    other = Hint(scale_arcsec_px=(3.0 * scale, 3.3 * scale))
    assert isinstance(run(solve_detections(detections, SolveOptions(hint=other, blind_after_hint=False))), NoSolution)
    for count in (6, 20, 80):
        assert isinstance(run(solve_detections(random_points(rng, count))), NoSolution)


def test_a_build_that_was_ended_goes_on_where_it_stopped(own_cache, monkeypatch):
    task = own_index.make_own()
    for _ in task:
        if [*own_cache.glob("own-*.part/band-00.npy")]:
            break
    task.close()
    assert own_index.own_volumes() == ()
    read = []
    band = own_index._band
    monkeypatch.setattr(own_index, "_band", lambda own, south: read.append(south) or band(own, south))
    seen, named = [], []
    put = own_index.put_in_place
    monkeypatch.setattr(own_index, "put_in_place", lambda *places: named.append(places) or put(*places))
    volumes = run(own_index.make_own(), seen.append)
    assert len(named) == 1, "a power cut may leave a name without its content"
    folder = volumes[0].folder.parent
    assert read == [BANDS[1]]
    assert "ASTAP D50" in seen[0].detail
    assert [path.name for path in own_cache.iterdir()] == [folder.name]
    assert not [*folder.glob("band-*")]
    assert run(own_index.make_own()) is volumes


def test_without_a_catalogue_there_is_nothing_to_make(own_cache):
    user_catalogues.forget()
    assert run(own_index.make_own()) == ()
    assert own_index.own_folder() is None


def test_two_programs_do_not_make_it_at_once(own_cache):
    own_cache.mkdir()
    lock = own_index.own_folder().with_suffix(".lock")
    handle = acquire(lock)
    with pytest.raises(CatalogueError, match="Another program"):
        run(own_index.make_own())
    release(handle, lock)


def test_a_damaged_index_costs_no_frame_and_is_made_again(own_cache, made, deep_stars):  # noqa: F811
    shutil.copytree(made, own_cache)
    volumes = own_index.own_volumes()
    own_index._opened.cache_clear()
    places = [volume.folder / "cells.npy" for volume in volumes]
    del volumes
    let_go()
    for place in places:
        cells = np.load(place)
        cells[1:-1] = 2**31
        place.unlink()  # what is mapped may not be written to
        np.save(place, cells)
    detections, _, attitude = deep_field(deep_stars, np.random.default_rng(3), 0.28)
    assert isinstance(run(solve_detections(detections)), NoSolution)
    assert own_index.own_volumes() == ()
    run(own_index.make_own())
    assert right(run(solve_detections(detections)), attitude, 0.28)
