import json
import mmap
import os
import shutil
import subprocess
import sys
import tracemalloc
from contextlib import suppress
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from kochab.core.attitude import apart_deg, attitude_from
from kochab.core.camera import Camera
from kochab.core.errors import CatalogueError, DamagedPatternsError
from kochab.core.frame import Detections
from kochab.core.progress import run
from kochab.identification import index, index_build
from kochab.identification.index import ARRAYS, FINENESS, PLACE, open_volume, pack, packed_size, ways
from kochab.identification.index_build import build_volume, by_brightness, level_quads
from kochab.identification.index_sort import QuadSort
from kochab.identification.patterns import FINE, Patterns, SearchStage
from kochab.identification.quads import Hypotheses, canonical, planar
from kochab.identification.verification import support
from kochab.sky import open_catalogue
from tests.windows.mapped import let_go

BRIGHT = 20_000  # far more stars than the levels of large fields have


def test_every_stored_quad_is_found_by_its_own_shape(toy_volume):
    rows = np.arange(0, len(toy_volume.quads), 37)
    sky = toy_volume.stars[toy_volume.members(rows)].astype(float)
    c = canonical(planar(sky))
    size = np.stack([c.base * 0.95, c.base * 1.05], axis=1)
    query, entry = toy_volume.lookup(c.code, np.full(len(rows), 1e-3), size)
    found = set(zip(query.tolist(), entry.tolist(), strict=True))
    assert all((i, int(r)) in found for i, r in enumerate(rows))


def test_codes_keep_place_and_size():
    rng = np.random.default_rng(3)
    inside, size = rng.integers(0, 256, (1000, 4)).astype(np.uint8), rng.integers(0, 128, 1000).astype(np.uint8)
    stored = pack(inside, size)
    assert np.array_equal(packed_size(stored), size)
    lost = inside.astype(int) - (stored & PLACE).view(np.uint8).reshape(-1, 4)
    assert lost.min() == 0
    assert lost.max() == FINENESS - 1


def test_ways_of_fewer_neighbours_come_first():
    few, many = ways(4), ways(7)
    assert few.shape == (96, 4)
    assert np.array_equal(many[:96], few)
    assert len(np.unique(many, axis=0)) == len(many) == 840
    assert ((many == 0).sum(axis=1) == 1).all()


@pytest.mark.parametrize("nearest", [[-3] * 4, [10**9] * 4, [5] * 3, ["x"] * 4])
def test_counts_of_neighbours_that_cannot_be_are_damage(toy_volume, tmp_path, nearest):
    for path in toy_volume.folder.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    facts = json.loads((tmp_path / "index.json").read_text())
    (tmp_path / "index.json").write_text(json.dumps(facts | {"nearest": nearest}))
    with pytest.raises(DamagedPatternsError):
        open_volume(tmp_path)


def test_lookup_is_the_same_as_looking_at_every_quad(toy_volume):
    everything = np.arange(len(toy_volume.quads))
    codes = canonical(planar(toy_volume.stars[toy_volume.members(everything)].astype(float)))
    asked = codes.code[::200] + 0.004
    tolerance = np.full(len(asked), 0.012)
    wide = np.tile([1e-6, 10.0], (len(asked), 1))
    query, entry = toy_volume.lookup(asked, tolerance, wide)
    got = query * len(everything) + entry
    tree = cKDTree(codes.code)

    def within(reach):
        """The same as ``got``, found by comparing every quad."""
        near = tree.query_ball_point(asked, reach, p=np.inf)
        return np.concatenate([k * len(everything) + np.array(one, dtype=int) for k, one in enumerate(near)])

    step = 1.5 * FINENESS / 256 / toy_volume.grid.steps  # how finely codes are stored
    assert len(within(0.012 - step)) > len(asked)
    assert np.isin(within(0.012 - step), got).all()
    assert np.isin(got, within(0.012 + 3 * step)).all()


class Mapped:
    """A file of so many bytes that notes what it is asked to fetch."""

    def __init__(self, size):
        self.size = size
        self.fetched = []

    def __len__(self):
        return self.size

    def madvise(self, advice, begin=0, length=0):
        if advice == mmap.MADV_WILLNEED:
            self.fetched.append((begin, length))


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such advice")
def test_what_is_read_next_is_announced_once_and_within_the_file():
    part = 1 << index.AHEAD_BITS
    mapped = Mapped(4 * part + 100)
    ahead = index.ReadAhead(mapped, 12)
    ahead.tell(np.array([[0, 5], [part // 12, 3]]))
    assert mapped.fetched == [(0, 2 * part)]  # neighbours in one call
    ahead.tell(np.array([1, 2 * part // 12, 4 * part // 12]))
    assert mapped.fetched[1:] == [(2 * part, part), (4 * part, 100)]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such advice")
def test_a_system_that_takes_no_advice_is_searched_all_the_same():
    class Refusing(Mapped):
        def madvise(self, advice, begin=0, length=0):
            if begin % (1 << 16):  # as Linux does with pages of 64 kB
                raise OSError(22, "Invalid argument")

    index.ReadAhead(Refusing(1 << 20), 12).tell(np.array([3 * (1 << index.AHEAD_BITS) // 12]))


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such advice")
def test_a_search_announces_what_it_reads(toy_volume):
    told = {name: Mapped(1 << 30) for name in index.SCATTERED}
    ahead = {name: index.ReadAhead(mapped, getattr(toy_volume, name).strides[0]) for name, mapped in told.items()}
    volume = replace(toy_volume, ahead=ahead)
    c = canonical(planar(volume.directions(volume.members(np.arange(50)))))
    volume.lookup(c.code, np.full(50, 0.01), np.tile([1e-6, 10.0], (50, 1)))
    assert all(mapped.fetched for mapped in told.values())
    assert set(open_volume(toy_volume.folder).ahead) == set(index.SCATTERED)


def test_the_quick_look_finds_the_stars_around_each_place_in_one_zone_or_two(toy_volume):
    """By all distances: reaches of 0.15 of a zone's height, so that many places have stars in two zones."""
    rng, level, count = np.random.default_rng(4), 2, 200
    xy, focal, zones = rng.uniform(-400.0, 400.0, (12, 2)), 900.0, toy_volume.zones[level]
    matrix, flip = Rotation.random(count, random_state=5).as_matrix(), np.arange(count) % 2 == 1
    proposers = np.tile([0, 1, 9, 10], (count, 1))
    found = Hypotheses(matrix, np.full(count, focal), flip, np.full(count, level), proposers, proposers)
    reach = 0.15 * np.pi / zones
    stars = toy_volume.stars[slice(*toy_volume.offsets[level : level + 2])].astype(float)
    ra = np.arctan2(stars[:, 1], stars[:, 0]) % (2 * np.pi)
    expected, in_the_zone_alone = np.zeros((2, count, len(xy)), dtype=bool)
    for h in range(count):
        seen = np.column_stack([xy * [-1.0 if flip[h] else 1.0, 1.0] / focal, np.ones(len(xy))]) @ matrix[h]
        seen /= np.linalg.norm(seen, axis=1)[:, None]
        near = np.linalg.norm(seen[:, None] - stars, axis=2) < reach
        near &= np.abs(ra - (np.arctan2(*seen[:, 1::-1].T) % (2 * np.pi))[:, None]) < 3.0  # not across RA 0h
        zone, own = ((np.arcsin(v[:, 2]) / np.pi + 0.5) * zones // 1 for v in (stars, seen))
        expected[h], in_the_zone_alone[h] = near.any(axis=1), (near & (zone == own[:, None])).any(axis=1)
    assert 0.05 < expected.mean() < 0.6
    assert expected.sum() > 1.04 * in_the_zone_alone.sum()
    expected[:, [0, 1, 9, 10]] = False
    first, second = (support(toy_volume, xy[k : k + 6], found, reach * focal, first=k) for k in (0, 6))
    np.testing.assert_array_equal(first, expected[:, :6].sum(axis=1))
    np.testing.assert_array_equal(second, expected[:, 6:].sum(axis=1))


@pytest.mark.parametrize(("pointings", "detections"), [(0, 5), (3, 0), (0, 0)])
def test_the_quick_look_at_nothing_finds_nothing(toy_volume, pointings, detections):
    """With many pointings, eight detections are looked at first; there may be no ninth."""
    matrix = Rotation.random(3, random_state=5).as_matrix()[:pointings]
    ones = np.ones(pointings, dtype=int)
    proposers = np.tile(np.arange(4), (pointings, 1))
    found = Hypotheses(matrix, 900.0 * ones, ones < 0, ones, proposers, proposers)
    assert support(toy_volume, np.zeros((detections, 2)), found, 5.0, first=8).tolist() == [0] * pointings


def test_size_limits_the_answer(toy_volume):
    c = canonical(planar(toy_volume.stars[toy_volume.members(np.arange(50))].astype(float)))
    none = np.tile([3.0, 3.1], (50, 1))
    query, _ = toy_volume.lookup(c.code, np.full(50, 0.01), none)
    assert len(query) == 0


def every(task):
    """All quads (Q, 4) of a level at once, their members in order."""
    return np.sort(np.concatenate([quads for quads, _ in run(task).parts()]), axis=1)


def test_poor_sky_gets_more_quads_for_each_star():
    rng = np.random.default_rng(4)
    v = rng.normal(size=(400, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    same = every(level_quads(v, 60.0, 4, 7))
    more = every(level_quads(v, 30.0, 4, 7))  # a level of 30 degrees should hold twice as many stars
    assert len(more) > 2 * len(same)
    spread = every(level_quads(v, 10.0, 4, 7))  # none of them would fit a frame
    assert len(spread) < len(same) / 10
    assert (np.diff(same, axis=1) > 0).all()
    assert len(np.unique(same, axis=0)) == len(same)


def random_sky(count, seed=4):
    v = np.random.default_rng(seed).normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def build_peak(folder, sky):
    """Memory (bytes) that a build needs at most beside its sky, and how many quads it makes."""
    tracemalloc.start()
    try:
        run(build_volume(folder, sky, np.arange(len(sky)), range(7, 10), neighbours=[(4, 4)] * 3, steps=24))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    return peak, len(open_volume(folder).codes)


def test_the_memory_of_a_build_grows_by_less_than_its_quads(monkeypatch, tmp_path):
    """All quads at once would need 58 bytes each; one level's marks and the stars need 19.

    With 24 the 25.9 million quads of the small fields need 0.62 GB beside the sky and the program itself.
    """
    monkeypatch.setattr(index_build, "SETS_AT_ONCE", 1 << 12)
    monkeypatch.setattr(index_build, "STARS_AT_ONCE", 1 << 12)
    monkeypatch.setattr(index_build, "all_levels", lambda ra, dec: [np.arange(len(ra))] * 15)
    build_peak(tmp_path / "first", random_sky(500))  # what is imported for it
    small, few = build_peak(tmp_path / "small", random_sky(2_000))
    large, many = build_peak(tmp_path / "large", random_sky(24_000))
    assert many > 11 * few
    assert large - small < 24 * (many - few)


def test_parts_of_any_size_make_the_same_volume(monkeypatch, tmp_path):
    sky, rows, plan = random_sky(3_000), np.arange(3_000), {"neighbours": [(4, 7)] * 2, "steps": 40}
    run(build_volume(tmp_path / "whole", sky, rows, range(9, 11), **plan))
    monkeypatch.setattr(index_build, "SETS_AT_ONCE", 100)
    monkeypatch.setattr(index_build, "STARS_AT_ONCE", 100)
    monkeypatch.setattr(index_build, "PARTS", 2)
    run(build_volume(tmp_path / "parts", sky, rows, range(9, 11), **plan))
    names = {path.name for path in (tmp_path / "parts").iterdir()}
    assert names == {*(f"{name}.npy" for name in ARRAYS), "index.json"}
    for name in names:
        assert (tmp_path / "parts" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_quads_come_sorted_by_cell_and_within_one_as_they_came(tmp_path):
    cells, count = 150_000, 5_000
    cell = np.random.default_rng(1).integers(0, 40, count) * 3_749
    codes, quads = np.arange(count, dtype=np.uint32), np.arange(count, dtype=np.uint32) * 3
    with QuadSort(tmp_path, cells) as found:
        for part in np.array_split(np.arange(count), 7):
            found.add(cell[part], codes[part], quads[part])
        run(found.write(tmp_path))
    order = np.argsort(cell, kind="stable")
    told = {name: np.load(tmp_path / f"{name}.npy") for name in ("cells", "codes", "quads")}
    assert np.array_equal(told["codes"], codes[order])
    assert np.array_equal(told["quads"], quads[order])
    assert np.array_equal(told["cells"], np.searchsorted(cell[order], np.arange(cells + 1)))
    assert len(list(tmp_path.iterdir())) == 3


def test_a_missing_or_damaged_index_is_one_sentence(tmp_path, toy_volume):
    with pytest.raises(CatalogueError, match="damaged and cannot be used"):
        open_volume(tmp_path / "nothing")
    (tmp_path / "index.json").write_text("{")
    with pytest.raises(CatalogueError, match="damaged and cannot be used"):
        open_volume(tmp_path)


@cache
def brightest():
    """The brightest stars, read once: the vectors of all 1.9 million take longer than building a small volume."""
    vectors, rows = by_brightness()
    return vectors[:BRIGHT].copy(), rows[:BRIGHT].copy()


@pytest.fixture
def small_plan(monkeypatch, tmp_path):
    monkeypatch.setenv("KOCHAB_CACHE", str(tmp_path))
    monkeypatch.setattr(index_build, "FINE", (range(12, 15), ((4, 5),) * 3, 8))
    monkeypatch.setattr(index_build, "by_brightness", brightest)
    return tmp_path


def test_a_build_gets_its_name_once_all_its_files_are_on_the_disk(tmp_path, monkeypatch):
    """After a power cut a name may be there without its content."""
    scratch, place, synced = tmp_path / "build.part", tmp_path / "build", set()
    (scratch / "part-0").mkdir(parents=True)
    files = [scratch / "index.json", scratch / "part-0" / "quads.npy"]
    for path in files:
        path.write_text("content")
    wanted = {path.stat().st_ino for path in files}

    def fsync(handle):
        assert not place.exists()
        synced.add(os.fstat(handle).st_ino)

    monkeypatch.setattr(index_build.os, "fsync", fsync)
    index_build.put_in_place(scratch, place)
    assert synced == wanted
    assert (place / "part-0" / "quads.npy").exists()
    assert not scratch.exists()


def test_the_fine_volume_is_made_once_and_kept(small_plan):
    assert index.fine() is None
    seen = []
    first = run(index_build.make_fine(), seen.append)
    assert seen[-1].fraction is not None
    assert seen[-1].fraction > 0.9
    again = run(index_build.make_fine(), seen.append)
    assert np.array_equal(first.codes, again.codes)
    assert [p.name for p in small_plan.iterdir()] == [index.fine_folder().name]


@pytest.mark.parametrize("name", ["codes.npy", "index.json", "cells.npy"])
def test_a_volume_that_was_damaged_is_made_again(small_plan, name):
    cells = run(index_build.make_fine()).cells.copy()
    damaged = index.fine_folder() / name
    let_go_of_fine()
    damaged.unlink()  # for what is mapped into memory may not be cut
    damaged.write_bytes(b"")
    assert index.fine() is None
    again = run(index_build.make_fine())
    assert np.array_equal(cells, again.cells)
    assert index.fine() is not None
    assert list(small_plan.iterdir()) == [damaged.parent], "hundreds of megabytes are not kept twice"


def test_a_damaged_volume_that_cannot_be_removed_is_made_beside(small_plan, monkeypatch):
    """As on Windows, where its files are mapped."""
    run(index_build.make_fine())
    damage("rows", lambda rows: rows.fill(2**31))
    first, again = index.fine_folders()
    removes = shutil.rmtree
    monkeypatch.setattr(
        index_build.shutil, "rmtree", lambda path, **how: path != first and path.exists() and removes(path, **how)
    )
    assert run(index_build.make_fine()).folder == again
    assert index.fine().folder == again
    assert index.drop_fine(again)
    assert index.fine() is None


def let_go_of_fine():
    index._opened_fine.cache_clear()
    let_go()


def damage(name, change):
    """``change`` an array's file, which is replaced: what is mapped may not be written to."""
    path = index.fine_folder() / f"{name}.npy"
    array = np.load(path)
    let_go_of_fine()
    path.unlink()
    change(array)
    np.save(path, array)


def bright_sky(ra, dec):
    attitude, camera = attitude_from(ra, dec, 20.0), Camera.centred(1200, 900, 800.0)
    catalogue = open_catalogue()
    rows = catalogue.cone(attitude.boresight, 0.8, 6.0)
    xy = camera.project(catalogue.vectors(rows, 2016.0) @ attitude.matrix.T)
    seen = ((xy > 0) & (xy < (1200, 900))).all(axis=1)
    return attitude, Detections.from_list(xy[seen][np.argsort(catalogue.mag(rows)[seen])], 1200, 900)


@pytest.mark.parametrize(
    ("name", "change"), [("cells", lambda cells: cells[1:-1].fill(2**31)), ("stars", lambda stars: stars.fill(0.0))]
)
def test_damage_that_shows_in_use_costs_the_patterns_not_the_frame(small_plan, name, change):
    run(index_build.make_fine())
    damage(name, change)
    damaged = index.fine()
    assert damaged is not None  # nobody has looked
    stage = SearchStage(20, 6, 1.0, 0.006, 40, focal=(0.83, 0.64, 0.5), volume=FINE)
    attitude, detections = bright_sky(90.0, 5.0)
    answer = run(Patterns(stages=(stage,)).identify(detections))
    assert apart_deg(answer.attitude.ra_dec_deg, attitude.ra_dec_deg) < 0.1
    assert index.fine() is not damaged


@pytest.mark.parametrize(
    ("name", "change"), [("rows", lambda rows: rows.fill(2**31)), ("keys", lambda keys: keys.sort())]
)
def test_damage_that_shows_at_once_is_no_volume(small_plan, name, change):
    run(index_build.make_fine())
    damage(name, change)
    assert index.fine() is None


@pytest.mark.parametrize(
    ("name", "value"), [("quads", 2**32 - 1), ("neighbours", 0), ("neighbours", 2**15 - 1), ("neighbours", -(2**15))]
)
def test_quads_that_cannot_be_are_damage(toy_volume, name, value):
    damaged = replace(toy_volume, **{name: np.full_like(getattr(toy_volume, name), value)})
    with pytest.raises(DamagedPatternsError):
        damaged.members(np.arange(3))


@given(data=st.data())
@settings(max_examples=150)
def test_a_flip_or_a_cut_is_one_sentence_or_harmless(toy_volume, tmp_path_factory, data):
    name = data.draw(st.sampled_from([*ARRAYS, "index"]))
    file = f"{name}.json" if name == "index" else f"{name}.npy"
    content = bytearray((toy_volume.folder / file).read_bytes())
    folder = tmp_path_factory.mktemp("flipped")
    for path in toy_volume.folder.iterdir():
        if path.name != file:
            (folder / path.name).hardlink_to(path)
    if data.draw(st.booleans()):
        del content[data.draw(st.integers(0, len(content) - 1)) :]
    else:
        bit = data.draw(st.integers(0, min(8 * len(content), 4096) - 1))
        content[bit // 8] ^= 1 << bit % 8
    (folder / file).write_bytes(content)
    some = np.arange(0, len(toy_volume.quads), 97)
    code = canonical(planar(toy_volume.directions(toy_volume.members(some)))).code
    with suppress(DamagedPatternsError):
        volume = open_volume(folder)
        _, found = volume.lookup(code, np.full(len(code), 0.01), np.tile([0.0, 4.0], (len(code), 1)))
        volume.directions(volume.members(found))


def test_a_cancelled_build_leaves_nothing_behind(small_plan):
    task = index_build.make_fine()
    for _ in range(4):
        next(task)
    task.close()
    assert list(small_plan.iterdir()) == []
    assert index.fine() is None


def whole_levels(task, count):
    """Cancel a build when so many levels are done, in the middle of the next."""
    for step in task:
        if step.detail == f"level {count + 1} of 3":
            next(task)
            break
    task.close()


@pytest.fixture(scope="module")
def three_levels(tmp_path_factory):
    """Stars, their rows, a plan of three levels, and the volume that it makes of them."""
    sky, rows, plan = random_sky(3_000), np.arange(3_000), {"neighbours": [(4, 7)] * 3, "steps": 40}
    whole = tmp_path_factory.mktemp("volume") / "whole"
    run(build_volume(whole, sky, rows, range(9, 12), **plan))
    return sky, rows, plan, whole


@pytest.mark.parametrize("count", [1, 2])
def test_a_cancelled_build_goes_on_after_its_last_whole_level(three_levels, monkeypatch, tmp_path, count):
    sky, rows, plan, whole = three_levels
    whole_levels(build_volume(tmp_path / "parts", sky, rows, range(9, 12), **plan), count)
    with next((tmp_path / "parts").glob("quads-*.part")).open("ab") as file:
        file.write(b"of a level that was not finished")
    made = []
    monkeypatch.setattr(index_build, "level_quads", lambda *args: made.append(args[1]) or level_quads(*args))
    run(build_volume(tmp_path / "parts", sky, rows, range(9, 12), **plan))
    assert made == [index.LEVEL_FIELDS_DEG[k] for k in range(9 + count, 12)]
    assert {p.name for p in (tmp_path / "parts").iterdir()} == {p.name for p in whole.iterdir()}
    for path in whole.iterdir():
        assert (tmp_path / "parts" / path.name).read_bytes() == path.read_bytes()


@pytest.mark.parametrize("spoilt", ["another plan", "cut", "no record"])
def test_what_cannot_be_gone_on_from_is_made_anew(three_levels, tmp_path, spoilt):
    sky, rows, plan, whole = three_levels
    mark = "an older sky" if spoilt == "another plan" else ""
    whole_levels(build_volume(tmp_path / "parts", sky, rows, range(9, 12), mark=mark, **plan), 2)
    if spoilt == "cut":
        for path in (tmp_path / "parts").glob("quads-*.part"):
            path.write_bytes(path.read_bytes()[:1000])
    elif spoilt == "no record":
        (tmp_path / "parts" / index_build.BEGUN).write_text("{")
    run(build_volume(tmp_path / "parts", sky, rows, range(9, 12), **plan))
    for path in whole.iterdir():
        assert (tmp_path / "parts" / path.name).read_bytes() == path.read_bytes()


def test_the_fine_volume_goes_on_where_it_was_cancelled(small_plan):
    task = index_build.make_fine()
    while next(task).detail != "level 2 of 3":
        pass
    task.close()
    assert [path.suffix for path in small_plan.iterdir()] == [".part"]
    assert index.fine() is None
    details = []
    assert run(index_build.make_fine(), lambda step: details.append(step.detail)) is not None
    assert "level 2 of 3" in details
    assert "level 1 of 3" not in details
    assert [p.name for p in small_plan.iterdir()] == [index.fine_folder().name]


def test_a_disk_that_fills_up_keeps_nothing(small_plan, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    task = index_build.make_fine()
    while next(task).detail != "level 2 of 3":
        pass
    monkeypatch.setattr(QuadSort, "kept", full)
    with pytest.raises(CatalogueError, match="No space left"):
        run(task)
    assert list(small_plan.iterdir()) == []


def test_a_second_program_waits_for_the_first(small_plan):
    first = index_build.make_fine()
    next(first)
    second = index_build.make_fine()
    assert "waiting" in next(second).detail
    run(first)
    assert run(second) is not None


def test_a_lock_left_by_the_dead_is_dropped(small_plan):
    lock = index.fine_folder().with_suffix(".lock")
    holder = (
        "import sys; from pathlib import Path; from kochab.identification.index_build import acquire; "
        "print(acquire(Path(sys.argv[1])) is not None, flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", holder, str(lock)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as dying:
        assert dying.stdout.readline() == "True\n"
        task = index_build.make_fine()
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
        run(index_build.make_fine())


def test_a_full_disk_is_told_before_the_work(monkeypatch, small_plan):
    monkeypatch.setattr(index_build, "ROOM_BYTES", 10**18)
    with pytest.raises(CatalogueError, match=r"free \(KOCHAB_CACHE names"):
        run(index_build.make_fine())
    assert list(small_plan.iterdir()) == []


def test_shipped_volumes_belong_to_the_shipped_catalogue():
    for name in index.SHIPPED:
        facts = json.loads((index.shipped_volume_folder() / name / "index.json").read_text())
        assert facts["mark"] == index.catalogue_mark()
