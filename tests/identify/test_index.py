import subprocess
import sys

import numpy as np
import pytest

from app.core.errors import CatalogueError
from app.core.progress import run
from app.identify import build, volumes
from app.identify.build import level_quads
from app.identify.codes import canonical, planar
from app.identify.index import open_volume
from app.identify.levels import all_levels

BRIGHT = 20_000  # far more stars than the levels of large fields have


def test_every_stored_quad_is_found_by_its_own_shape(toy_volume):
    rows = np.arange(0, len(toy_volume.quads), 37)
    sky = toy_volume.stars[toy_volume.members(rows)].astype(float)
    c = canonical(planar(sky))
    size = np.stack([c.base * 0.95, c.base * 1.05], axis=1)
    query, entry = toy_volume.lookup(c.code, np.full(len(rows), 1e-3), size)
    found = set(zip(query.tolist(), entry.tolist(), strict=True))
    assert all((i, int(r)) in found for i, r in enumerate(rows))


def test_lookup_is_the_same_as_looking_at_every_quad(toy_volume):
    everything = np.arange(len(toy_volume.quads))
    codes = canonical(planar(toy_volume.stars[toy_volume.members(everything)].astype(float)))
    asked = codes.code[::200] + 0.004
    tolerance = np.full(len(asked), 0.012)
    wide = np.tile([1e-6, 10.0], (len(asked), 1))
    query, entry = toy_volume.lookup(asked, tolerance, wide)
    got = np.zeros((len(asked), len(everything)), dtype=bool)
    got[query, entry] = True
    worst = np.abs(asked[:, None] - codes.code[None]).max(axis=2)
    step = 1.5 / 256 / toy_volume.grid.steps  # how finely codes are stored
    assert got[worst < 0.012 - step].all()
    assert not got[worst > 0.012 + 3 * step].any()


def test_size_limits_the_answer(toy_volume):
    c = canonical(planar(toy_volume.stars[toy_volume.members(np.arange(50))].astype(float)))
    none = np.tile([3.0, 3.1], (50, 1))
    query, _ = toy_volume.lookup(c.code, np.full(50, 0.01), none)
    assert len(query) == 0


def test_poor_sky_gets_more_quads_for_each_star():
    rng = np.random.default_rng(4)
    v = rng.normal(size=(400, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    same = run(level_quads(v, 60.0, 4, 7))
    more = run(level_quads(v, 30.0, 4, 7))  # a level of 30 degrees should hold twice as many stars
    assert len(more) > 2 * len(same)
    spread = run(level_quads(v, 10.0, 4, 7))  # none of them would fit a frame
    assert len(spread) < len(same) / 10
    assert (np.diff(same, axis=1) > 0).all()
    assert len(np.unique(same, axis=0)) == len(same)


def test_a_missing_or_damaged_index_is_one_sentence(tmp_path, toy_volume):
    with pytest.raises(CatalogueError, match="cannot be opened"):
        open_volume(tmp_path / "nothing")
    (tmp_path / "index.json").write_text("{")
    with pytest.raises(CatalogueError, match="cannot be opened"):
        open_volume(tmp_path)


@pytest.fixture
def small_plan(monkeypatch, tmp_path):
    monkeypatch.setenv("KOCHAB_CACHE", str(tmp_path))
    monkeypatch.setattr(volumes, "FINE", (range(12, 15), ((4, 5),) * 3, 8))
    monkeypatch.setattr(build, "all_levels", lambda ra, dec: all_levels(ra[:BRIGHT], dec[:BRIGHT]))
    return tmp_path


def test_the_fine_volume_is_made_once_and_kept(small_plan):
    assert volumes.fine() is None
    seen = []
    first = run(volumes.make_fine(), seen.append)
    assert seen[-1].fraction is not None
    assert seen[-1].fraction > 0.9
    again = run(volumes.make_fine(), seen.append)
    assert np.array_equal(first.codes, again.codes)
    assert [p.name for p in small_plan.iterdir()] == [volumes.fine_folder().name]


@pytest.mark.parametrize("name", ["codes.npy", "index.json", "cells.npy"])
def test_a_volume_that_was_damaged_is_made_again(small_plan, name):
    made = run(volumes.make_fine())
    damaged = volumes.fine_folder() / name
    damaged.unlink()  # for what is mapped into memory may not be cut
    damaged.write_bytes(b"")
    volumes._opened.cache_clear()
    assert volumes.fine() is None
    again = run(volumes.make_fine())
    assert np.array_equal(made.cells, again.cells)
    assert volumes.fine() is not None


def test_a_cancelled_build_leaves_nothing_behind(small_plan):
    task = volumes.make_fine()
    for _ in range(4):
        next(task)
    task.close()
    assert list(small_plan.iterdir()) == []
    assert volumes.fine() is None


def test_a_second_program_waits_for_the_first(small_plan):
    first = volumes.make_fine()
    next(first)
    second = volumes.make_fine()
    assert "waiting" in next(second).detail
    run(first)
    assert run(second) is not None


def test_a_lock_left_by_the_dead_is_dropped(small_plan):
    lock = volumes.fine_folder().with_suffix(".lock")
    holder = (
        "import sys; from pathlib import Path; from app.identify.lock import acquire; "
        "print(acquire(Path(sys.argv[1])) is not None, flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", holder, str(lock)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as dying:  # fmt: skip
        assert dying.stdout.readline() == "True\n"
        task = volumes.make_fine()
        assert "waiting" in next(task).detail
        dying.kill()
        dying.wait()
        assert lock.exists()
        assert run(task) is not None
    assert not lock.exists()


def test_a_cache_that_cannot_be_written_is_one_sentence(monkeypatch, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    monkeypatch.setenv("KOCHAB_CACHE", str(blocked / "below"))
    with pytest.raises(CatalogueError, match="small fields"):
        run(volumes.make_fine())


def test_a_full_disk_is_told_before_the_work(monkeypatch, small_plan):
    monkeypatch.setattr(volumes, "ROOM_BYTES", 10**18)
    with pytest.raises(CatalogueError, match=r"free \(KOCHAB_CACHE names"):
        run(volumes.make_fine())
    assert list(small_plan.iterdir()) == []


def test_shipped_volumes_belong_to_the_shipped_catalogue():
    import json

    for name in volumes.SHIPPED:
        facts = json.loads((volumes.shipped_folder() / name / "index.json").read_text())
        assert facts["mark"] == volumes._mark()
