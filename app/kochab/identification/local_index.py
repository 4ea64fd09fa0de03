"""A pattern index of one cone of the sky, made in memory for one frame whose place and scale are known.

The same volume as :mod:`kochab.identification.index` keeps on the disk, with levels for the frame's own size: a few
thousand stars and their quads take a tenth of a second.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats, Ints, Ints32
from kochab.core.attitude import east_north
from kochab.core.progress import Task
from kochab.identification.index import PER_FIELD, Grid, Volume, ways, zone_keys, zones_of
from kochab.identification.index_build import encode, level_quads
from kochab.identification.pair_table import DENSE, PairTable, table_of

NEIGHBOURS = (5, 12)
"""Nearest stars that each star forms quads with, where the sky is as rich as the level wants and where it is poor."""
SAME_LEVEL = 0.95
"""A level with this share of the finer one's stars stands for both: where the catalogue ends, all levels are alike."""
WIDEST_PAIR = 1.5
"""Over the frame's field: its diagonal."""
MOST_PAIRS = 300_000
"""A table of more would take longer than all else."""
STEPS = 16
"""Cells of code space along an axis: few quads need few cells."""


def local_volume(vectors: Floats, rows: Ints, axis: Floats, fields_deg: tuple[float, ...]) -> Task[Volume | None]:
    """The volume of stars about ``axis``, or None: there are too few for a quad.

    Parameters
    ----------
    vectors : Floats
        ICRS unit vectors (N, 3), brightest first, within 60 degrees of the axis.
    rows : Ints
        What the volume calls them (N,).
    axis : Floats
        ICRS unit vector (3,).
    fields_deg : tuple[float, ...]
        Sizes of field that there are levels for, ascending.
    """
    grid, offsets, zones = Grid(STEPS), [0], []
    stars: list[NDArray[np.float32]] = []
    kept: list[NDArray[np.uint32]] = []
    keys: list[NDArray[np.uint32]] = []
    cells: list[Ints] = []
    parts: list[tuple[NDArray[np.uint32], NDArray[np.uint32]]] = []
    neighbours: list[Ints32] = []
    kept_fields = []
    plane = vectors @ east_north(axis).T / (vectors @ axis)[:, None]
    levels = _levels(plane, fields_deg)
    nearest = [min(max(NEIGHBOURS), len(member) - 1) for _, member in levels]
    n_ways = len(ways(max(nearest, default=0)))
    for (field, member), most in zip(levels, nearest, strict=True):
        kept_fields.append(field)
        count = zones_of(field)
        key = zone_keys(vectors[member], count)
        order = np.argsort(key, kind="stable")
        here = member[order]
        xyz = vectors[here].astype(np.float32)
        level = yield from level_quads(vectors[here], field, *NEIGHBOURS)
        for quads, three in level.parts():
            number = quads[:, 0].astype(np.int64) + offsets[-1]
            cell, code, quad = encode(grid, xyz[quads].astype(np.float64), number, three, n_ways)
            cells.append(cell)
            parts.append((code, quad))
        neighbours.append(level.steps_on(most).ravel())
        stars.append(xyz)
        kept.append(rows[here].astype(np.uint32))
        keys.append(key[order])
        zones.append(count)
        offsets.append(offsets[-1] + len(here))
    if not parts:
        return None
    cell = np.concatenate(cells)
    order = np.argsort(cell, kind="stable")
    codes, quads_ = (np.concatenate(column)[order] for column in zip(*parts, strict=True))
    first = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=grid.cells))]).astype(np.uint32)
    return Volume(
        grid,
        np.array(kept_fields),
        np.array(offsets, dtype=np.int64),
        np.array(zones, dtype=np.int64),
        np.concatenate(stars),
        np.concatenate(kept),
        np.concatenate(keys),
        np.concatenate(neighbours),
        first,
        codes,
        quads_,
        np.array(nearest, dtype=np.int64),
    )


def local_pairs(volume: Volume, field_deg: float, density: float, area_sr: float) -> PairTable | None:
    """The pairs of the stars of the deepest level that has not too many, or, where that is asked for, of a sparse one.

    A frame of few stars may be a gap in a rich part of the sky, whose stars only the deepest level has. None: every
    level has too many pairs.

    Parameters
    ----------
    volume : Volume
        Of one cone.
    field_deg : float
        Root of the frame's area, degrees.
    density : float
        The fewest stars a frame shows on average.
    area_sr : float
        Of the cone, over which the stars lie.
    """
    reach = math.radians(WIDEST_PAIR * field_deg)
    stars = np.diff(volume.offsets)
    level = int(np.argmax(stars * stars * (math.pi * reach * reach / 2.0 / area_sr) <= MOST_PAIRS))
    if density < DENSE:
        enough = np.flatnonzero(PER_FIELD * (field_deg / volume.fields_deg) ** 2 >= DENSE)
        level = max(level, int(enough[-1]) if len(enough) else 0)
    if stars[level] ** 2 * (math.pi * reach * reach / 2.0 / area_sr) > MOST_PAIRS:
        return None
    return table_of(volume, level, reach, area_sr)


def _levels(plane: Floats, fields_deg: tuple[float, ...]) -> list[tuple[float, Ints]]:
    """Fields and the stars of their levels; of levels with nearly the same stars only the one for the largest field."""
    member = np.arange(len(plane))
    out: list[tuple[float, Ints]] = []
    for field in fields_deg:
        member = member[brightest_of_each_field(plane[member], math.radians(field))] if len(member) else member
        if len(member) < 4:
            break
        if out and len(member) >= SAME_LEVEL * len(out[-1][1]):
            out.pop()
        out.append((field, member))
    return out


def brightest_of_each_field(xy: Floats, field_rad: float) -> Ints:
    """Numbers of the stars (N, 2), brightest first, with fewer than ``PER_FIELD`` brighter in a box of a field."""
    # cells of a third of the field: the nine about a star are its box, as in the index of the whole sky
    cell = np.floor((xy - xy.min(axis=0)) / (field_rad / 3.0)).astype(np.int64) + 1
    columns = int(cell[:, 1].max()) + 2
    number, n = cell[:, 0] * columns + cell[:, 1], len(xy)
    keys = np.sort(number * n + np.arange(n))
    brighter = np.zeros(n, dtype=np.int64)
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            other = (number + dx * columns + dy) * n
            brighter += np.searchsorted(keys, other + np.arange(n)) - np.searchsorted(keys, other)
    return np.flatnonzero(brighter < PER_FIELD)
