"""Making the pattern index from a list of stars."""

import json
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.core.progress import Progress, Task
from app.identify.codes import canonical, planar
from app.identify.index import Grid, size_code
from app.identify.levels import LEVEL_FIELDS_DEG, all_levels
from app.identify.zones import zone_keys, zones_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Stars = NDArray[np.int32]
CHUNK = 1 << 18
PARTS = 16  # a power of two
STARS_AT_ONCE = 1 << 15  # a cancelled build ends within about a second
COMPACT = 0.95  # quads of poor sky larger than this share of a field seldom lie in a frame
AROUND = 8  # stars by whose distance the sky around a star is judged
RICH, POOR = 15.0, 9.0  # stars a field: quads enough from the nearest, and all that can be had


def level_quads(vectors: Floats, field_deg: float, neighbours: int, poorest: int) -> Task[Stars]:
    """Quads (Q, 4) of star numbers: each star with three of its nearest, each set once.

    ``neighbours`` nearest are used where the level is as rich as a level should be, up to
    ``poorest`` where it holds a quarter of that: frames there show few stars, and a few
    missing ones must not break every quad.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(vectors)
    k = min(max(neighbours, AROUND), len(vectors) - 1)
    found = tree.query(vectors, k=k + 1, workers=-1)
    reach = np.asarray(found[0])[:, k] / np.radians(field_deg)
    stars_per_field = k / (np.pi * np.maximum(reach, 1e-9) ** 2)
    share = np.clip((RICH - stars_per_field) / (RICH - POOR), 0.0, 1.0)
    wanted = np.minimum(
        neighbours + np.round(share * (poorest - neighbours)).astype(int), len(vectors) - 1
    )
    parts, done = [], 0
    for count in np.unique(wanted):
        every = np.nonzero(wanted == count)[0]
        for at in range(0, len(every), STARS_AT_ONCE):
            yield Progress("patterns", done / len(vectors), "grouping neighbours")
            rows = every[at : at + STARS_AT_ONCE]
            done += len(rows)
            near = np.asarray(found[1])[rows]
            if count > k:
                near = np.asarray(tree.query(vectors[rows], k=count + 1, workers=-1)[1])
            sets = _sets(near.astype(np.int32), int(count))
            if count > neighbours:
                sets = sets[_diameter(vectors, sets) < COMPACT * np.radians(field_deg)]
            parts.append(sets)
    quad = np.concatenate(parts)
    del parts
    mark = _marks(quad)
    first = []
    for part in range(PARTS):  # a whole sort would take ten seconds
        yield Progress("patterns", 1.0, "leaving out what is there twice")
        rows = np.nonzero(mark >> np.uint64(64 - PARTS.bit_length() + 1) == part)[0]
        first.append(rows[np.unique(mark[rows], return_index=True)[1]])
    return np.asarray(quad[np.sort(np.concatenate(first))])


def _marks(quad: Stars) -> NDArray[np.uint64]:
    """A number (Q,) for each quad (Q, 4) that no two different ones are likely to share."""
    mark = quad[:, 0].astype(np.uint64)
    factors = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9)
    with np.errstate(over="ignore"):
        for factor, column in zip(factors, quad.T[1:], strict=True):
            mark *= np.uint64(factor)
            mark += column.astype(np.uint64)
    return mark


def _within(task: Task[Stars], start: float, width: float) -> Task[Stars]:
    """The same task as a part, ``start`` to ``start + width``, of a longer one."""
    while True:
        try:
            step = next(task)
        except StopIteration as end:
            return np.asarray(end.value)
        yield Progress(step.stage, start + width * (step.fraction or 0.0), step.detail)


def _sets(near: Stars, neighbours: int) -> Stars:
    """Every star (column 0) with three of its ``neighbours`` nearest, members sorted (Q, 4)."""
    combos = np.array(list(combinations(range(1, neighbours + 1), 3)))
    first = np.broadcast_to(near[:, :1, None], (len(near), len(combos), 1))
    quad = np.concatenate([first, near[:, combos]], axis=2).reshape(-1, 4)
    quad.sort(axis=1)
    return quad


def _diameter(vectors: Floats, quads: Stars) -> NDArray[np.float32]:
    """Largest distance (Q,) between members of quads, rad."""
    p = vectors.astype(np.float32)[quads]
    pairs = [((p[:, i] - p[:, j]) ** 2).sum(axis=1) for i in range(4) for j in range(i)]
    return np.asarray(np.sqrt(np.maximum.reduce(pairs)))


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

    ``vectors`` (N, 3) ICRS unit vectors, brightest first, with their catalogue ``rows`` (N,).
    ``neighbours`` per chosen level: how many nearest stars each star forms quads with,
    where the sky is rich and where it is poor (see :func:`level_quads`).
    ``mark`` is kept in the index so that a later catalogue is noticed.
    """
    yield Progress("patterns", 0.0, "sorting the stars by field size")
    ra = np.arctan2(vectors[:, 1], vectors[:, 0]) % (2 * np.pi)
    dec = np.arcsin(np.clip(vectors[:, 2], -1.0, 1.0))
    chosen = all_levels(ra, dec)
    stars, kept, keys, offsets, zones = [], [], [], [0], []
    for k in levels:
        count = zones_of(LEVEL_FIELDS_DEG[k])
        key = zone_keys(vectors[chosen[k]], count)
        order = np.argsort(key, kind="stable")
        member = chosen[k][order]
        stars.append(vectors[member].astype(np.float32))
        kept.append(rows[member].astype(np.uint32))
        keys.append(key[order])
        zones.append(count)
        offsets.append(offsets[-1] + len(member))
    grid = Grid(steps)
    cells, codes, sizes, quads = [], [], [], []
    for i, xyz in enumerate(stars):
        begin, width = 0.1 + 0.7 * i / len(stars), 0.35 / len(stars)
        yield Progress("patterns", begin, f"level {i + 1} of {len(stars)}")
        field_deg = LEVEL_FIELDS_DEG[levels[i]]
        task = level_quads(xyz.astype(np.float64), field_deg, *neighbours[i])
        found = yield from _within(task, begin, width)
        for at in range(0, len(found), CHUNK):
            part = found[at : at + CHUNK]
            c, code, size, order = _encode(grid, xyz.astype(np.float64)[part], part)
            cells.append(c)
            codes.append(code)
            sizes.append(size)
            quads.append(_pack(order + offsets[i]))
            yield Progress("patterns", begin + width * (1.0 + at / len(found)))
    yield Progress("patterns", 0.85, "sorting the patterns by shape")
    cell = np.concatenate(cells)
    order = np.argsort(cell, kind="stable")
    start = np.zeros(grid.cells + 1, dtype=np.uint32)
    np.cumsum(np.bincount(cell, minlength=grid.cells), out=start[1:])
    facts = {
        "steps": steps, "fields_deg": [LEVEL_FIELDS_DEG[k] for k in levels],
        "offsets": offsets, "zones": zones, "quads": len(cell), "mark": mark,
    }  # fmt: skip
    yield Progress("patterns", 0.95, "writing")
    folder.mkdir(parents=True, exist_ok=True)
    for name, array in (
        ("stars", np.concatenate(stars)), ("rows", np.concatenate(kept)),
        ("keys", np.concatenate(keys)), ("cells", start),
        ("codes", np.concatenate(codes)[order]), ("sizes", np.concatenate(sizes)[order]),
        ("quads", np.concatenate(quads)[order]),
    ):  # fmt: skip
        np.save(folder / f"{name}.npy", array)
    (folder / "index.json").write_text(json.dumps(facts) + "\n", "utf-8")


def _encode(
    grid: Grid, xyz: Floats, members: Stars
) -> tuple[Ints, NDArray[np.uint32], NDArray[np.uint8], Ints]:
    """Cells, stored codes and sizes (Q,), and members in canonical order (Q, 4) of one chunk."""
    c = canonical(planar(xyz))
    place = grid.scaled(c.code)
    cell = np.floor(place).astype(np.int64)
    inside = np.clip(np.floor((place - cell) * 256.0), 0, 255).astype(np.uint8)
    code = inside.view(np.uint32).ravel()
    ordered = np.take_along_axis(members.astype(np.int64), c.order, axis=1)
    return grid.number(cell), code, size_code(c.base), ordered


def _pack(members: Ints) -> NDArray[np.uint8]:
    """Star numbers (Q, 4) below 2^24 as (Q, 12) bytes, low byte first."""
    raw = members.astype("<u4").view(np.uint8).reshape(-1, 4, 4)
    return np.ascontiguousarray(raw[:, :, :3].reshape(-1, 12))
