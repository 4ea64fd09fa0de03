"""One list out of two: epochs put right, artefacts dropped, partners found, components joined."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.core.progress import Progress, Task
from app.sky import layout
from app.sky.making import epochs
from app.sky.making.cells import crowded_out
from app.sky.making.sources import Sources

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

PARTNER = 1.5  # arcsec within which a Tycho-2 star is the same star
SAME_BRIGHT = 6.0  # arcsec, of a star without partner, if V agrees within
SAME_MAG = 0.7
JOIN = 1.5  # arcsec within which stars become one photocentre
BV_REAL = (0.02, 2.4)  # artefacts have one band missing: their colour stands at a stop


@dataclass(frozen=True, slots=True, eq=False)
class Stars:
    """A list at J2000: ``vector`` (N, 3), ``pm`` (N, 2) mas/yr, ``mag`` V, ``bv`` NaN unknown.

    ``hip`` 0 when none, ``flag`` bits of `app.sky.layout`.
    """

    vector: Floats
    pm: Floats
    mag: Floats
    bv: Floats
    hip: Ints
    flag: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.mag)

    def take(self, index: Ints | Flags) -> "Stars":
        """The stars that ``index`` selects."""
        return Stars(*(getattr(self, f.name)[index] for f in fields(self)))

    @classmethod
    def joined(cls, a: "Stars", b: "Stars") -> "Stars":
        """The stars of ``a``, then those of ``b``."""
        names = [f.name for f in fields(cls)]
        return cls(*(np.concatenate([getattr(a, n), getattr(b, n)]) for n in names))


@dataclass(frozen=True, slots=True, eq=False)
class Merged:
    """``bright`` every Hipparcos star, unjoined, with ``source`` rows of Stellarium's list.

    ``deep`` every star; ``link`` (L, 2) pairs (deep, bright), brightest part first within a star.
    ``counts`` what was corrected, dropped and joined.
    """

    bright: Stars
    source: Ints
    deep: Stars
    link: Ints
    counts: dict[str, int]


def merge(src: Sources) -> Task[Merged]:
    """Make the bright and the deep list."""
    from scipy.spatial import cKDTree

    yield Progress("Looking for partners in Tycho-2", 0.1)
    tree = cKDTree(src.tycho)
    stars, place_listed, mag_listed = _prepared(src)
    left_out = crowded_out(stars.vector, stars.mag, src.tycho, src.vt)
    partner, counts, early = _dated(stars, place_listed, tree, left_out)
    yield Progress("Putting epochs right", 0.3)
    years = np.where(early, 2000.0 - epochs.EARLY, 0.0)
    vector = epochs.moved(stars.vector, stars.pm, years)
    flag = stars.flag | np.where(early, layout.REDATED, 0).astype(np.uint8)
    stars = Stars(vector, stars.pm, stars.mag, stars.bv, stars.hip, flag)
    yield Progress("Dropping artefacts", 0.4)
    keep = (stars.hip > 0) | (partner >= 0) | _plausible(stars, left_out)
    counts["artefacts dropped"] = int((~keep).sum())
    stars = _measured(stars, partner, src, mag_listed)
    rest = _tycho_only(src, ~_accounted_for(src, stars, partner, tree))
    counts["stars of Tycho-2 alone"] = len(rest)
    both = Stars.joined(stars.take(keep), rest)
    yield Progress("Joining close components", 0.6)
    listed_hip = dict(zip(src.listed.hip.tolist(), src.listed.mag.tolist(), strict=True))
    deep, group = join(both, listed_hip)
    counts["stars with joined components"] = int((deep.flag & layout.MERGED > 0).sum())
    hips = np.flatnonzero(stars.hip > 0)
    bright, source, link = _linked(stars, hips, group[: int(keep.sum())][stars.hip[keep] > 0])
    return Merged(bright, source, deep, link, counts)


def _prepared(src: Sources) -> tuple[Stars, Floats, Floats]:
    """Stellarium's stars with motions, and the independent list's places and V beside them."""
    raw = src.stars
    at = np.minimum(np.searchsorted(src.pm_hip, raw.hip), len(src.pm_hip) - 1)
    known = (raw.hip > 0) & (src.pm_hip[at] == raw.hip)
    pm = np.where(known[:, None], src.pm[at], raw.pm)
    for hip, motion in epochs.MOTIONS.items():
        pm[raw.hip == hip] = motion
    order = np.argsort(src.listed.hip)
    ids = src.listed.hip[order]
    spot = np.minimum(np.searchsorted(ids, raw.hip), len(ids) - 1)
    in_list = (ids[spot] == raw.hip) & _brightest_of_hip(raw.hip, raw.mag)
    place = np.where(in_list[:, None], src.listed.vector[order][spot], np.nan)
    mag = np.where(in_list & (raw.component == 0), src.listed.mag[order][spot], np.nan)
    flag = np.full(len(raw), layout.MOVING, dtype=np.uint8)
    flag[raw.hip > 0] |= layout.HIPPARCOS
    # Magnitudes were floored to 0.05: the middle of the step is the best guess.
    return Stars(raw.vector, pm, raw.mag + 0.025, raw.bv, raw.hip, flag), place, mag


def _brightest_of_hip(hip: Ints, mag: Floats) -> Flags:
    order = np.lexsort((mag, hip))
    first = np.zeros(len(hip), dtype=np.bool_)
    ranked = hip[order]
    first[order[np.concatenate([[True], ranked[1:] != ranked[:-1]])]] = True
    return first & (hip > 0)


def _dated(
    stars: Stars, listed: Floats, tree: Any, left_out: Flags
) -> tuple[Ints, dict[str, int], Flags]:
    """Each star's Tycho-2 partner (or -1), counts, and which stars stand at 1991.65."""
    same = _nearest(tree, stars.vector, PARTNER)
    then = epochs.moved(stars.vector, stars.pm, epochs.SUPPLEMENT - 2000.0)
    supplement = _nearest(tree, then, PARTNER)
    later = epochs.moved(stars.vector, stars.pm, 2000.0 - epochs.EARLY)
    after = _nearest(tree, later, PARTNER)
    lead = _brightest_of_hip(stars.hip, stars.mag)
    checked = np.isfinite(listed[:, 0])
    early = lead & checked & epochs.early_by_list(stars.vector, stars.pm, listed)
    by_list = int(early.sum())
    # Of single Hipparcos stars without any partner, 222 of the 236 that can be checked stand at
    # 1991.65: so do the rest, save where the index left faint stars out for room (of those most
    # stand at J2000: at V 11 to 12 one in ten is not in Tycho-2, but half are not in the index).
    alone = lead & ~checked & (epochs.shift_arcsec(stars.pm) > epochs.TELLING)
    alone &= (same < 0) & (supplement < 0) & (after < 0)
    alone &= ~left_out | np.isin(stars.hip, epochs.ALSO_EARLY)
    early |= alone
    early = (stars.hip > 0) & np.isin(stars.hip, stars.hip[early])  # components follow
    fast = epochs.shift_arcsec(stars.pm) > epochs.TELLING
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
    distance, row = tree.query(vector, distance_upper_bound=limit * epochs.ARCSEC)
    return np.where(np.isfinite(distance), row, -1).astype(np.int64)


def _plausible(stars: Stars, left_out: Flags) -> Flags:
    """Stars without partner that may be real: not bright, of a real colour, and left out."""
    real = (stars.bv > BV_REAL[0]) & (stars.bv < BV_REAL[1]) & (stars.mag > 8.0)
    return np.asarray(real & left_out)


def _measured(stars: Stars, partner: Ints, src: Sources, listed: Floats) -> Stars:
    """Finer values from the partner: V for all, and for non-Hipparcos stars the place as well."""
    vt = np.where(partner >= 0, src.vt[partner], np.nan)
    v = vt - (0.121 * stars.bv - 0.009)
    fine = np.abs(v - stars.mag) < 0.15
    mag = np.where(np.isfinite(listed), listed, np.where(fine, v, stars.mag))
    near = np.where(partner >= 0, np.linalg.norm(stars.vector - src.tycho[partner], axis=1), 9.0)
    better = (stars.hip == 0) & (near < 0.5 * epochs.ARCSEC)
    vector = np.where(better[:, None], src.tycho[partner], stars.vector)
    return Stars(vector, stars.pm, mag, stars.bv, stars.hip, stars.flag)


def _accounted_for(src: Sources, stars: Stars, partner: Ints, tree: Any) -> Flags:
    """Tycho-2 stars (T,) that are in the other list, or are none.

    Besides the partners: the one at RA 0, Dec 0 to the last digit, which is a star without a
    place, and stars as bright as a Hipparcos star without partner so near that it must be it.
    """
    used = np.zeros(len(src.tycho), dtype=np.bool_)
    used[partner[partner >= 0]] = True
    used |= np.linalg.norm(src.tycho - [1.0, 0.0, 0.0], axis=1) < 1e-8
    lonely = stars.take((stars.hip > 0) & (partner < 0))
    for years in (0.0, epochs.SUPPLEMENT - 2000.0):
        near = _nearest(tree, epochs.moved(lonely.vector, lonely.pm, years), SAME_BRIGHT)
        alike = (near >= 0) & (np.abs(src.vt[near] - 0.10 - lonely.mag) < SAME_MAG)
        used[near[alike]] = True
    return used


def _tycho_only(src: Sources, index: Flags) -> Stars:
    n = int(index.sum())
    flag = np.full(n, layout.V_FROM_VT, dtype=np.uint8)
    return Stars(
        src.tycho[index], np.zeros((n, 2)), src.vt[index] - 0.10, np.full(n, np.nan),
        np.zeros(n, dtype=np.int64), flag,
    )  # fmt: skip


def join(stars: Stars, listed: dict[int, float]) -> tuple[Stars, Ints]:
    """Replace components closer than `JOIN` by their photocentre; also each star's new row.

    ``listed`` {HIP: V} holds the combined V of Hipparcos entries where that is known.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    n = len(stars)
    pairs = cKDTree(stars.vector).query_pairs(JOIN * epochs.ARCSEC, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, group = connected_components(graph, directed=False)
    rank = np.lexsort((np.arange(n), stars.mag, group))
    first = np.concatenate([[True], np.diff(group[rank]) > 0])
    head, start = rank[first], np.flatnonzero(first)
    flux = 10.0 ** (-0.4 * stars.mag[rank])
    total = np.add.reduceat(flux, start)
    place = np.add.reduceat(flux[:, None] * stars.vector[rank], start)
    motion = np.add.reduceat(flux[:, None] * stars.pm[rank], start) / total[:, None]
    several = np.add.reduceat(np.ones(n), start) > 1
    hip = _hip_of_groups(stars, rank, start)
    flag = np.bitwise_or.reduceat(stars.flag[rank], start)
    flag = (flag | np.where(several, layout.MERGED, 0)).astype(np.uint8)
    mag = np.where(several, -2.5 * np.log10(total), stars.mag[head])
    combined = np.array([listed.get(h, np.nan) for h in hip[several].tolist()])
    mag[several] = np.where(np.isfinite(combined), combined, mag[several])
    one = ~several
    place[several] /= np.linalg.norm(place[several], axis=1, keepdims=True)
    place[one], motion[one] = stars.vector[head[one]], stars.pm[head[one]]
    return Stars(place, motion, mag, stars.bv[head], hip, flag), group.astype(np.int64)


def _hip_of_groups(stars: Stars, rank: Ints, start: Ints) -> Ints:
    """The HIP number of each group's brightest Hipparcos member, 0 when it has none."""
    size = np.diff(np.append(start, len(rank)))
    owner = np.repeat(np.arange(len(start)), size)
    members = np.flatnonzero(stars.hip[rank] > 0)
    hip = np.zeros(len(start), dtype=np.int64)
    hip[owner[members[::-1]]] = stars.hip[rank][members[::-1]]  # the first member is set last
    return hip


def _linked(stars: Stars, rows: Ints, group: Ints) -> tuple[Stars, Ints, Ints]:
    """The bright list by HIP and brightness, its source rows, and (deep, bright) pairs."""
    order = np.lexsort((stars.mag[rows], stars.hip[rows]))
    source = rows[order]
    link = np.stack([group[order], np.arange(len(rows))], axis=1)
    rank = np.lexsort((stars.mag[source], link[:, 0]))
    return stars.take(source), source, link[rank]
