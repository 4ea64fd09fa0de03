"""Making the pattern index: which stars and quads are in it, and the volumes made on this computer.

A frame shows the brightest stars of its field, whatever its size. So there is a list of stars for
each size (a level; sizes grow by sqrt 2): a star is in it when fewer than ``PER_FIELD`` brighter
stars lie in a box of that field's area around it.
"""

import json
import math
import os
import shutil
import sys
import time
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats, Ints, Ints32
from kochab.core.errors import CatalogueError
from kochab.core.progress import Progress, Task
from kochab.core.threads import processors
from kochab.core.values import frozen
from kochab.identification.index import (
    ARRAYS,
    HEADER_BYTES,
    LEVEL_FIELDS_DEG,
    ORDERS,
    PER_FIELD,
    SHIPPED,
    Grid,
    Volume,
    catalogue_mark,
    fine,
    fine_folder,
    fine_folders,
    first_neighbours,
    open_volume,
    pack,
    shipped,
    shipped_volume_folder,
    size_code,
    threes,
    ways,
    zone_keys,
    zones_of,
)
from kochab.identification.index_sort import QuadSort, write_header
from kochab.identification.quads import canonical, planar
from kochab.parsing.text_input import read_json

PARTS = 16  # of the 2^64 marks, evenly: a power of two
STARS_AT_ONCE = 1 << 15  # a cancelled build ends within about a second
SETS_AT_ONCE = 1 << 16  # what is known of a quad while it is encoded takes a kilobyte
COMPACT = 0.95  # quads of poor sky larger than this share of a field seldom lie in a frame
AROUND = 8  # stars by whose distance the sky around a star is judged
RICH, POOR = 15.0, 9.0  # stars a field: quads enough from the nearest, and all that can be had
EPOCH = 2020.0  # a middling year: quads outlive a few decades of proper motion
FINE = (range(2), ((4, 7), (4, 4)), 36)
"""As the entries of ``SHIPPED``. With 12 neighbours in poor sky, not 7, half as much again is to be made and kept; of
250 fields of 0.8 deg, 30 % of their stars missing, 245 are solved for 242."""
AT_ONCE = 2
STEP = np.dtype(ARRAYS["neighbours"][0])
Encoded = tuple[Ints, NDArray[np.uint32], NDArray[np.uint32]]
BASE4 = np.array([64, 16, 4, 1])
ORDER_OF = np.zeros(256, dtype=np.int64)
ORDER_OF[ORDERS @ BASE4] = np.arange(len(ORDERS))
BEGUN = "begun.json"
"""In the folder of a build that is not done: what of it is, once that is worth going on from."""
ROOM_BYTES = 240_000_000  # the volume and the largest part of what it is sorted from
ELSEWHERE = "KOCHAB_CACHE names another folder"
WAITING = "waiting for another program to build the small-field index"


def select(ra: Floats, dec: Floats, candidates: Ints, field_deg: float) -> Ints:
    """The rows of ``candidates`` that are in the level of one size of field.

    Parameters
    ----------
    ra, dec : Floats
        Places of all stars (N,), radians.
    candidates : Ints
        Rows of the next finer level, brightest first; every level is a subset of it, as a bigger box holds no fewer
        brighter stars.
    field_deg : float
        Side of the square field that the level is for, degrees.
    """
    a, d = ra[candidates], dec[candidates]
    # cells of a third of the field's side: the nine about a star are its box
    step = np.radians(field_deg) / 3.0
    zones = max(3, round(np.pi / step))
    zone = np.clip(((d / np.pi + 0.5) * zones).astype(np.int64), 0, zones - 1)
    middle = (np.arange(zones) + 0.5) / zones * np.pi - np.pi / 2
    # at least three, or near a pole both neighbours of a cell would be the same one
    columns = np.maximum(3, np.round(2 * np.pi * np.cos(middle) / step)).astype(np.int64)
    first = np.concatenate([[0], np.cumsum(columns)])
    n = len(candidates)
    rank = np.arange(n, dtype=np.int64)
    turn = a / (2 * np.pi)
    cell = first[zone] + np.minimum((turn * columns[zone]).astype(np.int64), columns[zone] - 1)
    order = np.argsort(cell, kind="stable")
    # by cell and then by brightness: one search finds how many stars of a cell are brighter
    keys = cell[order] * n + rank[order]
    start = np.searchsorted(cell[order], np.arange(first[-1] + 1))
    brighter = np.zeros(n, dtype=np.int64)
    for dz in (-1, 0, 1):
        z = zone + dz
        inside = (z >= 0) & (z < zones)
        zc = np.clip(z, 0, zones - 1)
        column = np.minimum((turn * columns[zc]).astype(np.int64), columns[zc] - 1)
        for dc in (-1, 0, 1):
            other = first[zc] + (column + dc) % columns[zc]
            # walking in cell order keeps the look-ups in the cache
            found = np.empty(n, dtype=np.int64)
            found[order] = np.searchsorted(keys, (other * n + rank)[order])
            brighter += np.where(inside, found - start[other], 0)
    return candidates[brighter < PER_FIELD]


def all_levels(ra: Floats, dec: Floats) -> list[Ints]:
    """Rows (brightest first) of every level of ``LEVEL_FIELDS_DEG``; stars are given so sorted."""
    rows = np.arange(len(ra), dtype=np.int64)
    out = []
    for field in LEVEL_FIELDS_DEG:
        rows = select(ra, dec, rows, field)
        out.append(rows)
    return out


@frozen(eq=False)
class LevelQuads:
    """The quads of one level, a part at a time: all at once they would need a gigabyte.

    ``vectors`` (N, 3) float32; ``near`` (N, k + 1) each star and its nearest, of which it forms quads
    with ``wanted`` (N,); those of poor sky, with more than ``rich``, are no longer than ``longest`` rad.
    ``first`` (Q,) says of every set whether it is there for the first time.
    """

    vectors: NDArray[np.float32]
    near: Ints32
    wanted: NDArray[np.uint8]
    rich: int
    longest: float
    first: NDArray[np.bool_]

    def parts(self) -> Iterator[tuple[Ints32, Ints]]:
        """Quads (Q, 4), a star and three of its nearest, each set once, and which three (Q,); see :func:`threes`."""
        at = 0
        for sets, three in self.sets():
            first = self.first[at : at + len(sets)]
            yield sets[first], three[first]
            at += len(sets)

    def sets(self) -> Iterator[tuple[Ints32, Ints]]:
        """The same with the sets (Q, 4) that several of their stars form."""
        for count in np.unique(self.wanted).tolist():
            every = np.flatnonzero(self.wanted == count)
            stars = max(1, SETS_AT_ONCE // math.comb(count, 3))
            for at in range(0, len(every), stars):
                sets, three = _sets(self.near[every[at : at + stars]], count)
                if count > self.rich:
                    compact = _diameter(self.vectors, sets) < self.longest
                    sets, three = sets[compact], three[compact]
                yield sets, three

    def steps_on(self, nearest: int) -> Ints32:
        """How many places on, in the level's order, each star's ``nearest`` stand (N, nearest)."""
        near = self.near[:, 1 : nearest + 1]
        return np.asarray(near - np.arange(len(near), dtype=np.int32)[:, None])


def level_quads(vectors: Floats, field_deg: float, neighbours: int, poorest: int) -> Task[LevelQuads]:
    """Each star of a level with three of its nearest, each set once.

    Parameters
    ----------
    vectors : Floats
        The level's stars, ICRS unit vectors (N, 3).
    field_deg : float
        Side of the field that the level is for, degrees.
    neighbours : int
        How many nearest stars are used where the level is as rich as it should be.
    poorest : int
        How many where it holds a quarter of that: frames there show few stars, and a few missing ones must not
        break every quad.
    """
    from scipy.spatial import cKDTree

    n = len(vectors)
    tree = cKDTree(vectors)
    threads = processors()  # scipy's own -1 fails where the system does not say
    k = min(max(neighbours, AROUND), n - 1)
    most = min(max(k, poorest), n - 1)
    near = np.zeros((n, most + 1), dtype=np.int32)
    wanted = np.zeros(n, dtype=np.uint8)
    for at in range(0, n, STARS_AT_ONCE):
        yield Progress("patterns", 0.5 * at / n, "grouping neighbours")
        here = vectors[at : at + STARS_AT_ONCE]
        distance, number = (np.asarray(found) for found in tree.query(here, k=k + 1, workers=threads))
        near[at : at + len(here), : k + 1] = number
        # k stars lie in the disc out to the k-th, whose chord is its angle nearly enough
        stars_per_field = k / (np.pi * np.maximum(distance[:, k] / np.radians(field_deg), 1e-9) ** 2)
        share = np.clip((RICH - stars_per_field) / (RICH - POOR), 0.0, 1.0)
        count = np.minimum(neighbours + np.round(share * (poorest - neighbours)).astype(int), n - 1)
        wanted[at : at + len(here)] = count
        poor = np.flatnonzero(count > k)
        if len(poor):
            near[at + poor] = tree.query(here[poor], k=most + 1, workers=threads)[1]
    del tree
    level = LevelQuads(
        vectors.astype(np.float32), near, wanted, neighbours, COMPACT * math.radians(field_deg), np.zeros(0, dtype=bool)
    )
    return replace(level, first=(yield from _first_of_each(level)))


def _first_of_each(level: LevelQuads) -> Task[NDArray[np.bool_]]:
    """Whether each set (Q,) of a level is there for the first time."""
    marks, starts = [], [0]
    for sets, _ in level.sets():
        yield Progress("patterns", 0.6, "grouping neighbours")
        marks.append(_marks(np.sort(sets, axis=1)))
        starts.append(starts[-1] + len(sets))
    first = np.zeros(starts[-1], dtype=bool)
    step = (1 << 64) // PARTS
    for part in range(PARTS):  # a whole sort would take ten seconds, and as much memory again
        yield Progress("patterns", 0.7 + 0.3 * part / PARTS, "leaving out what is there twice")
        low = np.uint64(part * step)
        here = [np.flatnonzero(mark - low < np.uint64(step)) for mark in marks]  # wraps below low
        mark = np.concatenate([mark[rows] for mark, rows in zip(marks, here, strict=True)])
        rows = np.concatenate([rows + start for rows, start in zip(here, starts[:-1], strict=True)])
        first[rows[np.unique(mark, return_index=True)[1]]] = True
    return first


def _marks(quad: Ints32) -> NDArray[np.uint64]:
    """A number (Q,) for each quad (Q, 4) that no two different ones are likely to share."""
    mark = quad[:, 0].astype(np.uint64)
    factors = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9)
    with np.errstate(over="ignore"):
        for factor, column in zip(factors, quad.T[1:], strict=True):
            mark *= np.uint64(factor)
            mark += column.astype(np.uint64)
    return mark


def _as_part(task: Task[LevelQuads], start: float, width: float) -> Task[LevelQuads]:
    """The same task as a part, ``start`` to ``start + width``, of a longer one."""
    while True:
        try:
            step = next(task)
        except StopIteration as end:
            found: LevelQuads = end.value
            return found
        yield Progress(step.stage, start + width * (step.fraction or 0.0), step.detail)


def _sets(near: Ints32, neighbours: int) -> tuple[Ints32, Ints]:
    """Every star (column 0) with three of its ``neighbours`` nearest (Q, 4), and which three (Q,)."""
    combos = np.array(threes(neighbours))
    first = np.broadcast_to(near[:, :1, None], (len(near), len(combos), 1))
    return np.concatenate([first, near[:, combos]], axis=2).reshape(-1, 4), np.tile(np.arange(len(combos)), len(near))


def _diameter(vectors: NDArray[np.float32], quads: Ints32) -> NDArray[np.float32]:
    """Largest distance (Q,) between members of quads, rad."""
    p = vectors[quads]
    gaps = [p[:, i] - p[:, j] for i in range(4) for j in range(i)]
    return np.asarray(np.sqrt(np.maximum.reduce([np.einsum("qi,qi->q", gap, gap) for gap in gaps])))


def build_volume(
    folder: Path,
    vectors: Floats,
    rows: Ints,
    levels: Sequence[int],
    *,
    neighbours: Sequence[tuple[int, int]],
    steps: int,
    mark: str = "",
) -> Task[None]:
    """Write the volume of the chosen ``levels`` of a sky into ``folder``.

    A build of the same plan that was cancelled goes on after its last whole level.

    Parameters
    ----------
    folder : Path
        Where the volume is written.
    vectors : Floats
        ICRS unit vectors (N, 3), brightest first.
    rows : Ints
        The stars' catalogue rows (N,).
    levels : Sequence[int]
        Numbers of the levels, each for one size of field.
    neighbours : Sequence[tuple[int, int]]
        For each chosen level how many nearest stars each star forms quads with, where the sky is rich and where it
        is poor (see :func:`level_quads`).
    steps : int
        Cells of the grid along each coordinate of a quad's shape.
    mark : str
        Kept in the index so that a later catalogue is noticed.
    """
    yield Progress("patterns", 0.0, "sorting the stars by field size")
    ra = np.arctan2(vectors[:, 1], vectors[:, 0]) % (2 * np.pi)
    dec = np.arcsin(np.clip(vectors[:, 2], -1.0, 1.0))
    chosen = all_levels(ra, dec)
    members, fields_deg = [chosen[k] for k in levels], [LEVEL_FIELDS_DEG[k] for k in levels]
    del ra, dec, chosen
    yield from write_volume(folder, vectors, rows, fields_deg, members, neighbours=neighbours, steps=steps, mark=mark)


def write_volume(
    folder: Path,
    vectors: Floats,
    rows: Ints,
    fields_deg: Sequence[float],
    members: Sequence[Ints],
    *,
    neighbours: Sequence[tuple[int, int]],
    steps: int,
    mark: str = "",
) -> Task[None]:
    """The same of levels that are given.

    Parameters
    ----------
    folder : Path
        Where the volume is written.
    vectors : Floats
        ICRS unit vectors (N, 3).
    rows : Ints
        What the volume calls the stars (N,).
    fields_deg : Sequence[float]
        The size of field that each level is for, ascending.
    members : Sequence[Ints]
        Numbers of each level's stars, in any order.
    neighbours : Sequence[tuple[int, int]]
        As in :func:`build_volume`.
    steps : int
        As there.
    mark : str
        As there.
    """
    stars, kept, keys, offsets, zones = [], [], [], [0], []
    for field_deg, level_members in zip(fields_deg, members, strict=True):
        count = zones_of(field_deg)
        key = zone_keys(vectors[level_members], count)
        order = np.argsort(key, kind="stable")
        member = level_members[order]
        stars.append(vectors[member].astype(np.float32))
        kept.append(rows[member].astype(np.uint32))
        keys.append(key[order])
        zones.append(count)
        offsets.append(offsets[-1] + len(member))
    folder.mkdir(parents=True, exist_ok=True)
    for name, arrays in (("stars", stars), ("rows", kept), ("keys", keys)):
        np.save(folder / f"{name}.npy", np.concatenate(arrays))
    del vectors, rows, members, kept, keys  # the quads need the room
    grid = Grid(steps)
    plan = {
        "steps": steps,
        "fields_deg": [*fields_deg],
        "neighbours": [[*n] for n in neighbours],
        "stars": offsets,
        "mark": mark,
    }
    nearest = [min(max(both), len(xyz) - 1) for both, xyz in zip(neighbours, stars, strict=True)]
    n_ways, first = len(ways(max(nearest))), first_neighbours(np.array(offsets), np.array(nearest)).tolist()
    begun = _begun(folder, plan)
    with (
        (folder / "neighbours.npy").open("r+b" if begun["levels"] else "wb") as neighbours_file,
        QuadSort(folder, grid.cells, begun["sizes"], begun["quads"]) as found,
    ):
        write_header(neighbours_file, "neighbours", first[-1])
        for i, xyz in enumerate(stars):
            if i < begun["levels"]:
                continue
            begin, width = 0.1 + 0.75 * i / len(stars), 0.3 / len(stars)
            yield Progress("patterns", begin, f"level {i + 1} of {len(stars)}")
            task = level_quads(xyz.astype(np.float64), fields_deg[i], *neighbours[i])
            level = yield from _as_part(task, begin, width)
            wanted, done = max(1, int(level.first.sum())), 0
            neighbours_file.seek(HEADER_BYTES + STEP.itemsize * first[i])
            neighbours_file.write(level.steps_on(nearest[i]).astype(STEP).tobytes())
            neighbours_file.flush()
            os.fsync(neighbours_file.fileno())
            tasks = (
                (grid, xyz[part].astype(np.float64), part[:, 0] + np.int64(offsets[i]), three, n_ways)
                for part, three in level.parts()
            )
            for encoded in _ahead(tasks):
                found.add(*encoded)
                done += len(encoded[0])
                yield Progress("patterns", begin + width * (1.0 + 1.5 * done / wanted))
            # all of it is on the disk before that is told, as `kept` sees to; replaced whole, it is never half a file
            whole = {"plan": plan, "levels": i + 1, "sizes": found.kept(), "quads": found.quads}
            (folder / "begun.new").write_text(json.dumps(whole), "utf-8")
            (folder / "begun.new").replace(folder / BEGUN)
        yield Progress("patterns", 0.85, "sorting the patterns by shape")
        (folder / BEGUN).unlink()  # the scratch files are used up from here on
        yield from found.write(folder)
    # last: a folder without it is no volume
    header = {
        "steps": steps,
        "fields_deg": [*fields_deg],
        "offsets": offsets,
        "zones": zones,
        "nearest": nearest,
        "quads": found.quads,
        "mark": mark,
    }
    (folder / "index.json").write_text(json.dumps(header) + "\n", "utf-8")


def _ahead(tasks: Iterable[tuple[Grid, Floats, Ints, Ints, int]]) -> Iterator[Encoded]:
    """What :func:`encode` makes of each, in their order, while the next ones are made: numpy lets threads run."""
    with ThreadPoolExecutor(AT_ONCE) as pool:
        waiting: deque[Future[Encoded]] = deque()
        for task in tasks:
            waiting.append(pool.submit(encode, *task))
            if len(waiting) > AT_ONCE:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


def _begun(folder: Path, plan: dict[str, Any]) -> dict[str, Any]:
    """What a cancelled build of this plan has finished: how many levels, and the quads and scratch files of then."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        kept: dict[str, Any] = read_json(folder / BEGUN)
        paths = (folder / f"quads-{k}.part" for k in range(len(kept["sizes"])))
        if kept["plan"] == plan and all(p.stat().st_size >= n for p, n in zip(paths, kept["sizes"], strict=True)):
            return kept
    return {"levels": 0, "sizes": [], "quads": 0}


def encode(grid: Grid, xyz: Floats, star: Ints, three: Ints, n_ways: int) -> Encoded:
    """Cells, stored codes and stored quads (Q,) of quads at ``xyz`` (Q, 4, 3).

    Parameters
    ----------
    grid : Grid
        The volume's.
    xyz : Floats
        Unit vectors (Q, 4, 3) of the star that forms the quad, and of its three.
    star : Ints
        Its number in the volume (Q,).
    three : Ints
        Which three of its nearest (Q,); see :func:`threes`.
    n_ways : int
        How many :func:`ways` the volume has.
    """
    c = canonical(planar(xyz))
    place = grid.scaled(c.code)
    cell = np.floor(place).astype(np.int64)
    inside = np.clip(np.floor((place - cell) * 256.0), 0, 255).astype(np.uint8)
    way = three * len(ORDERS) + ORDER_OF[c.order @ BASE4]
    return grid.number(cell), pack(inside, size_code(c.base)), (star * n_ways + way).astype(np.uint32)


# -- The volumes of this installation ----------------------------------------------------------


def build_shipped(folder: Path | None = None) -> Task[None]:
    """Make the shipped volumes from the shipped catalogue; the same input gives the same bytes."""
    catalogue_mark.cache_clear()
    for name, plan in SHIPPED.items():
        yield from _build((folder or shipped_volume_folder()) / name, *plan)
    shipped.cache_clear()


def make_fine() -> Task[Volume]:
    """Return the volume of small fields, making it first if need be: a quarter of a minute, once.

    Cancelled, it goes on where it stopped. Safe when several programs ask at once: one makes it, the others
    wait. Raises CatalogueError when it cannot be written.
    """
    folder = fine_folder()
    lock, scratch = folder.with_suffix(".lock"), folder.with_suffix(".part")
    while True:
        ready = fine()
        if ready is not None:
            return ready
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
            _need_room(folder.parent, scratch)
            handle = acquire(lock)
        except OSError as error:
            raise CatalogueError(
                f"Patterns for small fields cannot be kept in {folder.parent}: {error.strerror} ({ELSEWHERE})."
            ) from error
        if handle is not None:
            break
        yield Progress("patterns", None, WAITING)
        time.sleep(0.2)
    try:
        ready = fine()  # another may have been done since we looked
        if ready is not None:
            return ready
        yield from _build(scratch, *FINE)
        for place in fine_folders():
            shutil.rmtree(place, ignore_errors=True)
            if not place.exists():
                break
        put_in_place(scratch, place)
    except OSError as error:
        shutil.rmtree(scratch, ignore_errors=True)
        raise CatalogueError(
            f"The patterns for small fields cannot be written to {folder.parent}: {error.strerror}."
        ) from error
    finally:
        drop_unless_begun(scratch)
        release(handle, lock)
    return open_volume(place)


def put_in_place(scratch: Path, place: Path) -> None:
    """Give the folder of a build its name, once all its files are on the disk itself: a name may get there before."""
    for path in scratch.rglob("*"):
        if path.is_file():
            with path.open("rb+") as file:
                os.fsync(file.fileno())
    scratch.rename(place)


def drop_unless_begun(scratch: Path) -> None:
    """Remove what a build has left in its folder, unless the next one can go on from it."""
    if not (scratch / BEGUN).exists():
        shutil.rmtree(scratch, ignore_errors=True)


def _need_room(parent: Path, scratch: Path) -> None:
    """Refuse at once what would fill the disk after a minute's work; ``scratch`` has what is done of it."""
    free = shutil.disk_usage(parent).free + sum(path.stat().st_size for path in scratch.glob("*"))
    if free < ROOM_BYTES:
        raise CatalogueError(
            f"Patterns for small fields need {ROOM_BYTES // 1_000_000} MB in {parent}, where"
            f" {free // 1_000_000} MB are free ({ELSEWHERE})."
        )


def by_brightness() -> tuple[Floats, Ints]:
    """Unit vectors (N, 3) of all shipped stars at the index's epoch, ICRS, and their rows (N,), the brightest first."""
    from kochab.sky import open_catalogue

    catalogue = open_catalogue()
    rows = np.arange(len(catalogue))
    rows = rows[np.argsort(catalogue.mag(rows), kind="stable")]
    return catalogue.vectors(rows, EPOCH), rows


def _build(folder: Path, levels: range, neighbours: tuple[tuple[int, int], ...], steps: int) -> Task[None]:
    yield Progress("patterns", 0.0, "reading the catalogue")
    vectors, rows = by_brightness()
    yield from build_volume(folder, vectors, rows, levels, neighbours=neighbours, steps=steps, mark=catalogue_mark())


def acquire(path: Path) -> int | None:
    """Lock the file at ``path``, made if need be; its handle, or None when another holds it.

    The system gives the lock up when its holder dies. A file system without locks lets everyone
    in. Raises OSError when the file cannot be made.
    """
    handle = os.open(path, os.O_CREAT | os.O_RDWR)
    try:
        _lock(handle)
    except OSError as error:
        # the C library of Windows sets EACCES, Wine's none
        if isinstance(error, BlockingIOError | PermissionError) or not error.errno:
            os.close(handle)
            return None
        return handle
    with suppress(FileNotFoundError):
        if os.path.samestat(os.fstat(handle), path.stat()):
            return handle
    os.close(handle)  # its last holder has just removed it
    return None


def release(handle: int, path: Path) -> None:
    """Give the lock up and remove its file."""
    if sys.platform != "win32":  # before the lock is given up, or another may hold a removed file
        path.unlink(missing_ok=True)
    os.close(handle)
    if sys.platform == "win32":  # an open file cannot be removed there
        with suppress(OSError):  # another has it by now
            path.unlink(missing_ok=True)


def _lock(handle: int) -> None:
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
