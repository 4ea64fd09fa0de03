"""One list out of two: epochs put right, artefacts dropped, partners found, components joined."""

from dataclasses import replace
from typing import Any

import numpy as np

from catalogs.making.sources import (
    ALSO_EARLY,
    EARLY,
    MOTIONS,
    SUPPLEMENT,
    TELLING,
    Sources,
    early_by_list,
    least_of_each,
    row_of,
    shift_arcsec,
)
from kochab.core.arrays import Bools, Floats, Ints
from kochab.core.attitude import ARCSEC
from kochab.core.progress import Progress, Task
from kochab.sky.catalogue_file import HIPPARCOS, MERGED, MOVING, REDATED, V_FROM_VT, StarList
from kochab.sky.proper_motion import moved

# The cells in which an astrometry.net index keeps only so many stars: HEALPix of any size. Which cell a star falls
# in tells whether a star that the index lacks may have been left out for room: only if the cell is full, and of
# stars that are all about as bright or brighter. (That no cell of the Tycho-2 index holds more than ten, and 89,088
# hold ten as its header says, is the proof that the cells are the right ones.)

SIDE = 156  # cells along each of the 12 base squares: 22.55 arcmin
KEPT = 10  # stars kept in each cell
VT_MARGIN = 0.35  # VT is fainter than V by 0.1 on average, of red stars by 0.3


def cell_of(vector: Floats, side: int = SIDE) -> Ints:
    """The HEALPix cell (N,), 0 to 12 side^2 - 1, of unit vectors (N, 3).

    Gorski et al. 2005, ApJ 622, 759, section 4; the numbering is our own, only cells matter.
    """
    z = vector[:, 2]
    turn = (np.arctan2(vector[:, 1], vector[:, 0]) / (np.pi / 2)) % 4.0
    sector = np.minimum(turn.astype(np.int64), 3)
    along = turn - sector
    # Caps: cell borders are where sqrt(3 (1 - |z|)) times the angle from a side is constant.
    reach = np.sqrt(3.0 * (1.0 - np.abs(z)))
    kx, ky = reach * (1.0 - along), reach * along
    north = z > 2.0 / 3.0
    cap = np.abs(z) > 2.0 / 3.0
    # The belt: straight lines in (longitude, z), in diamonds above, below and between sectors.
    height = (z + 2.0 / 3.0) * 0.75
    p, q = height + along, height - along + 1.0
    right, left = p >= 1.0, q >= 1.0
    one_side = np.where(right, 4 + (sector + 1) % 4, np.where(left, 4 + sector, 8 + sector))
    square = np.where(right & left, sector, one_side)
    x = np.where(cap, np.where(north, 1.0 - kx, ky), p - right)
    y = np.where(cap, np.where(north, 1.0 - ky, kx), q - left)
    square = np.where(cap, np.where(north, sector, 8 + sector), square)
    column = np.clip((x * side).astype(np.int64), 0, side - 1)
    row = np.clip((y * side).astype(np.int64), 0, side - 1)
    return np.asarray((square * side + column) * side + row)


def crowded_out(vector: Floats, mag: Floats, kept: Floats, kept_vt: Floats) -> Bools:
    """Whether stars (N,) of V ``mag`` may lack in an index with stars ``kept`` (K, 3) for room."""
    cells = 12 * SIDE * SIDE
    home = cell_of(kept)
    count = np.bincount(home, minlength=cells)
    faintest = np.full(cells, -np.inf)
    np.maximum.at(faintest, home, kept_vt)
    cell = cell_of(vector)
    return np.asarray((count[cell] >= KEPT) & (faintest[cell] < mag + VT_MARGIN))


PARTNER = 1.5  # arcsec within which a Tycho-2 star is the same star
SAME_BRIGHT = 6.0  # arcsec, of a star without partner, if V agrees within
SAME_MAG = 0.7
JOIN = 1.5  # arcsec within which stars become one photocentre
BV_REAL = (0.02, 2.4)  # artefacts have one band missing: their colour stands at a stop


def merge(src: Sources) -> Task[tuple[StarList, StarList, Ints, dict[str, int]]]:
    """Make the bright list, of every Hipparcos star, unjoined, and the deep one, of every star.

    Also links (L, 2), pairs (deep, bright), the brightest part first within a star; and counts of what was corrected,
    dropped and joined.
    """
    from scipy.spatial import cKDTree

    yield Progress("Looking for partners in Tycho-2", 0.1)
    tree = cKDTree(src.tycho)
    stars, place_listed, mag_listed = _stellarium_stars(src)
    left_out = crowded_out(stars.vector, stars.mag, src.tycho, src.vt)
    partner, counts, early = _partners(stars, place_listed, tree, left_out)
    yield Progress("Putting epochs right", 0.3)
    vector = moved(stars.vector, stars.pm, np.where(early, 2000.0 - EARLY, 0.0))
    stars = replace(stars, vector=vector, flag=stars.flag | np.where(early, REDATED, 0).astype(np.uint8))
    yield Progress("Dropping artefacts", 0.4)
    keep = (stars.hip > 0) | (partner >= 0) | _plausible(stars, left_out)
    counts["artefacts dropped"] = int((~keep).sum())
    stars = _refined(stars, partner, src, mag_listed)
    rest = _tycho_only(src, ~_listed_already(src, stars, partner, tree))
    counts["stars of Tycho-2 alone"] = len(rest)
    both = StarList.joined([stars.take(keep), rest])
    yield Progress("Joining close components", 0.6)
    listed_hip = dict(zip(src.listed.hip.tolist(), src.listed.mag.tolist(), strict=True))
    deep, group = join(both, listed_hip)
    counts["stars with joined components"] = int((deep.flag & MERGED > 0).sum())
    hips = np.flatnonzero(stars.hip > 0)
    bright, link = _linked(stars.take(hips), group[: int(keep.sum())][stars.hip[keep] > 0])
    return bright, deep, link, counts


def _stellarium_stars(src: Sources) -> tuple[StarList, Floats, Floats]:
    """Stellarium's stars with motions, and the independent list's places and V beside them."""
    raw = src.stars
    row, known = row_of(raw.hip, src.pm_hip)
    pm = np.where((known & (raw.hip > 0))[:, None], src.pm[row], raw.pm)
    for hip, motion in MOTIONS.items():
        pm[raw.hip == hip] = motion
    row, in_list = row_of(raw.hip, src.listed.hip)
    in_list &= _brightest_of_hip(raw)
    place = np.where(in_list[:, None], src.listed.vector[row], np.nan)
    mag = np.where(in_list & (raw.component == 0), src.listed.mag[row], np.nan)
    flag = np.where(raw.hip > 0, MOVING | HIPPARCOS, MOVING).astype(np.uint8)
    # Magnitudes were floored to 0.05: the middle of the step is the best guess.
    return replace(raw, pm=pm, mag=raw.mag + 0.025, flag=flag), place, mag


def _brightest_of_hip(stars: StarList) -> Bools:
    """Each Hipparcos entry's brightest component."""
    return least_of_each(stars.hip, stars.mag) & (stars.hip > 0)


def _partners(stars: StarList, listed: Floats, tree: Any, left_out: Bools) -> tuple[Ints, dict[str, int], Bools]:
    """Each star's Tycho-2 partner (or -1), counts, and which stars stand at 1991.65."""
    same = _nearest(tree, stars.vector, PARTNER)
    supplement = _nearest(tree, moved(stars.vector, stars.pm, SUPPLEMENT - 2000.0), PARTNER)
    after = _nearest(tree, moved(stars.vector, stars.pm, 2000.0 - EARLY), PARTNER)
    lead = _brightest_of_hip(stars)
    checked = np.isfinite(listed[:, 0])
    early = lead & checked & early_by_list(stars.vector, stars.pm, listed)
    by_list = int(early.sum())
    # Of single Hipparcos stars without any partner, 222 of the 236 that can be checked stand at
    # 1991.65: so do the rest, save where the index left faint stars out for room (of those most
    # stand at J2000: at V 11 to 12 one in ten is not in Tycho-2, but half are not in the index).
    fast = shift_arcsec(stars.pm) > TELLING
    alone = lead & ~checked & fast
    alone &= (same < 0) & (supplement < 0) & (after < 0)
    alone &= ~left_out | np.isin(stars.hip, ALSO_EARLY)
    early |= alone
    early = (stars.hip > 0) & np.isin(stars.hip, stars.hip[early])  # components follow
    partner = np.where(same >= 0, same, np.where(fast, supplement, -1))
    partner = np.where(early & (after >= 0), after, partner)
    counts = {
        "redated by the independent list": by_list,
        "redated for want of a Tycho-2 partner": int(alone.sum()),
        "redated with their components": int(early.sum()),
        "Tycho-2 positions at 1991.25 set aside": int(((same < 0) & (partner >= 0)).sum()),
    }
    return partner, counts, early


def _nearest(tree: Any, vector: Floats, limit: float) -> Ints:
    """Row of the nearest Tycho-2 star within ``limit`` arcsec, or -1."""
    distance, row = tree.query(vector, distance_upper_bound=limit * ARCSEC)
    return np.where(np.isfinite(distance), row, -1).astype(np.int64)


def _plausible(stars: StarList, left_out: Bools) -> Bools:
    """Stars without partner that may be real: not bright, of a real colour, and left out."""
    real = (stars.bv > BV_REAL[0]) & (stars.bv < BV_REAL[1]) & (stars.mag > 8.0)
    return np.asarray(real & left_out)


def _refined(stars: StarList, partner: Ints, src: Sources, listed: Floats) -> StarList:
    """Finer values from the partner: V for all, and for non-Hipparcos stars the place as well."""
    vt = np.where(partner >= 0, src.vt[partner], np.nan)
    v = vt - (0.121 * stars.bv - 0.009)
    fine = np.abs(v - stars.mag) < 0.15
    mag = np.where(np.isfinite(listed), listed, np.where(fine, v, stars.mag))
    near = np.where(partner >= 0, np.linalg.norm(stars.vector - src.tycho[partner], axis=1), 9.0)
    better = (stars.hip == 0) & (near < 0.5 * ARCSEC)
    vector = np.where(better[:, None], src.tycho[partner], stars.vector)
    return replace(stars, vector=vector, mag=mag)


def _listed_already(src: Sources, stars: StarList, partner: Ints, tree: Any) -> Bools:
    """Tycho-2 stars (T,) that are in the other list, or are none.

    Besides the partners: the one at RA 0, Dec 0 to the last digit, which is a star without a
    place, and stars as bright as a Hipparcos star without partner so near that it must be it.
    """
    used = np.zeros(len(src.tycho), dtype=np.bool_)
    used[partner[partner >= 0]] = True
    used |= np.linalg.norm(src.tycho - [1.0, 0.0, 0.0], axis=1) < 1e-8
    unpartnered = stars.take((stars.hip > 0) & (partner < 0))
    for years in (0.0, SUPPLEMENT - 2000.0):
        near = _nearest(tree, moved(unpartnered.vector, unpartnered.pm, years), SAME_BRIGHT)
        alike = (near >= 0) & (np.abs(src.vt[near] - 0.10 - unpartnered.mag) < SAME_MAG)
        used[near[alike]] = True
    return used


def _tycho_only(src: Sources, index: Bools) -> StarList:
    vt = src.vt[index]
    return StarList.of(src.tycho[index], vt - 0.10, flag=np.full(len(vt), V_FROM_VT, np.uint8))


def join(stars: StarList, listed: dict[int, float]) -> tuple[StarList, Ints]:
    """Replace components closer than `JOIN` by their photocentre; also each star's new row.

    ``listed`` {HIP: V} holds the combined V of Hipparcos entries where that is known.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    n = len(stars)
    pairs = cKDTree(stars.vector).query_pairs(JOIN * ARCSEC, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, group = connected_components(graph, directed=False)
    # groups together, the brightest of each first; the row number breaks ties, so that the build repeats
    rank = np.lexsort((np.arange(n), stars.mag, group))
    first = np.concatenate([[True], np.diff(group[rank]) > 0])
    head, start = rank[first], np.flatnonzero(first)
    # photocentre and mean motion weigh each component by its light
    flux = 10.0 ** (-0.4 * stars.mag[rank])
    total = np.add.reduceat(flux, start)
    place = np.add.reduceat(flux[:, None] * stars.vector[rank], start)
    motion = np.add.reduceat(flux[:, None] * stars.pm[rank], start) / total[:, None]
    several = np.add.reduceat(np.ones(n), start) > 1
    hip = _hip_of_groups(stars, rank, start)
    flag = np.bitwise_or.reduceat(stars.flag[rank], start)
    flag = (flag | np.where(several, MERGED, 0)).astype(np.uint8)
    mag = np.where(several, -2.5 * np.log10(total), stars.mag[head])
    combined = np.array([listed.get(h, np.nan) for h in hip[several].tolist()])
    mag[several] = np.where(np.isfinite(combined), combined, mag[several])
    one = ~several
    place[several] /= np.linalg.norm(place[several], axis=1, keepdims=True)
    place[one], motion[one] = stars.vector[head[one]], stars.pm[head[one]]
    found = StarList.of(place, mag, pm=motion, bv=stars.bv[head], hip=hip, flag=flag)
    return found, group.astype(np.int64)


def _hip_of_groups(stars: StarList, rank: Ints, start: Ints) -> Ints:
    """The HIP number of each group's brightest Hipparcos member, 0 when it has none."""
    size = np.diff(np.append(start, len(rank)))
    owner = np.repeat(np.arange(len(start)), size)
    members = np.flatnonzero(stars.hip[rank] > 0)
    hip = np.zeros(len(start), dtype=np.int64)
    hip[owner[members[::-1]]] = stars.hip[rank][members[::-1]]  # the first member is set last
    return hip


def _linked(stars: StarList, group: Ints) -> tuple[StarList, Ints]:
    """The bright list by HIP and brightness, and (deep, bright) pairs; ``group`` is the deep row."""
    order = np.lexsort((stars.mag, stars.hip))
    bright, link = stars.take(order), np.stack([group[order], np.arange(len(order))], axis=1)
    return bright, link[np.lexsort((bright.mag, link[:, 0]))]
