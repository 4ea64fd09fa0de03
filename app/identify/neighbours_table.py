"""The star database of the 1992 paper: every star by its nearest neighbours, errors included.

Liebe (1992, IEEE Aerosp. Electron. Syst. Mag. 7(6), 34), sections "Star Characteristics" to "Star
Exchange". A star is told by the distance to its first and second neighbour and the angle between
them. All three are quantised, and the star is entered under every class that it can be measured in:

- each place may be off, so a distance comes with the classes beside its own, an angle with those
  within its error;
- a neighbour near the limit of detection ("maybe") may not be seen, so that any star up to the
  first "certain" one may be the first neighbour, any up to the second certain one the second; the
  paper's example (its table of neighbouring constellations) shows that the two are counted apart;
- a star hardly further away than such a certain one may change places with it.

The paper states the error of its example's angle as 1.724 deg, which is ``2 tolerance (1/d1 +
1/d2)`` and the worst there is; the entries it prints in figure 11 are exactly those of twice that.
The text's is the default, as it comes nearer to the paper's number of entries; ``angle_errors`` 2
is the figure's.
"""

from dataclasses import asdict, dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from app.core.errors import UsageError
from app.identify.table_cache import kept
from app.identify.table_file import Arrays

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

MOST_ENTRIES, MOST_COMPARED = 60_000_000, 400_000_000
"""Entries before doubles are left out, and pairs of neighbours: some seconds and a gigabyte."""
TOO_LARGE = (
    "make the table of neighbours too large: take fewer stars, a smaller spread or tolerance, or"
    " larger steps."
)
KEPT = ("rows", "vectors", "mag", "certain", "key", "star")
PLACES = 4096  # a key is (first * PLACES + second) * PLACES + angle


@dataclass(frozen=True, slots=True)
class Quanta:
    """What features are measured and entered with, degrees.

    ``tolerance_deg`` is the largest error of a star's place, ``step_deg`` and ``angle_step_deg``
    the classes of distances and angles, ``exchange`` how many tolerances two neighbours' distances
    must differ by to keep their order; ``angle_errors`` multiplies the error of an angle.
    """

    tolerance_deg: float = 0.05
    step_deg: float = 0.1
    angle_step_deg: float = 5.0
    exchange: float = 4.0
    angle_errors: float = 1.0

    def key(self, first_deg: Floats, second_deg: Floats, angle_deg: Floats) -> Ints:
        """The class (T,) of measured features (T,)."""
        parts = np.stack([first_deg / self.step_deg, second_deg / self.step_deg,
                          angle_deg / self.angle_step_deg]).astype(np.int64)  # fmt: skip
        return np.asarray((parts[0] * PLACES + parts[1]) * PLACES + parts[2])

    def entries(
        self, first_deg: Floats, second_deg: Floats, angle_deg: Floats
    ) -> tuple[Ints, Ints]:
        """Every class that true features (T,) can be measured in: which feature, and the key."""
        reach = int(np.ceil(2.0 * self.tolerance_deg / self.step_deg - 1e-9))
        beside = np.arange(-reach, reach + 1)
        error = 2.0 * np.degrees(self.tolerance_deg * (1 / first_deg + 1 / second_deg))
        error = self.angle_errors * error
        low = (np.maximum(angle_deg - error, 0.0) / self.angle_step_deg).astype(np.int64)
        high = (np.minimum(angle_deg + error, 180.0) / self.angle_step_deg).astype(np.int64)
        if int((high - low + 1).sum()) * len(beside) ** 2 > MOST_ENTRIES:
            raise UsageError(f"So many classes {TOO_LARGE}")
        which = np.repeat(np.arange(len(first_deg)), high - low + 1)
        begin = np.cumsum(high - low + 1) - (high - low + 1)
        angle = np.arange(len(which)) - begin[which] + low[which]
        a = (first_deg / self.step_deg).astype(np.int64)[which, None, None] + beside[:, None]
        b = (second_deg / self.step_deg).astype(np.int64)[which, None, None] + beside
        keys = (a * PLACES + b) * PLACES + angle[:, None, None]
        possible = (a >= 0) & (a <= b)  # the nearer one is always measured first
        which = np.broadcast_to(which[:, None, None], keys.shape)
        return which[possible], keys[possible]


@dataclass(frozen=True, slots=True, eq=False)
class NeighbourTable:
    """N stars, brightest first, and E entries by ascending ``key``.

    ``rows`` (N,) of the catalogue, ``vectors`` (N, 3) ICRS, ``mag`` (N,), ``certain`` (N,);
    ``key`` (E,) and the ``star`` (E,) entered under it. ``triplets`` is how many neighbouring
    constellations the entries come from and ``faintest`` the V magnitude of detection.
    """

    rows: Ints
    vectors: Floats
    mag: Floats
    certain: Bools
    key: Ints
    star: NDArray[np.int32]
    triplets: int
    faintest: float

    def __len__(self) -> int:
        return len(self.key)

    @property
    def nbytes(self) -> int:
        """Bytes of the entries."""
        return int(self.key.nbytes + self.star.nbytes)

    @property
    def per_star(self) -> float:
        """Entries a star, on the average."""
        return len(self.key) / max(1, len(self.rows))

    def find(self, key: Ints) -> tuple[Ints, Ints]:
        """Which of the asked keys (Q,), and the star, of every entry under them."""
        start, stop = np.searchsorted(self.key, key), np.searchsorted(self.key, key, "right")
        which = np.repeat(np.arange(len(key)), stop - start)
        before = np.cumsum(stop - start) - (stop - start)
        entry = np.arange(len(which)) - before[which] + start[which]
        return which, self.star[entry].astype(np.int64)


def make_table(
    rows: Ints, vectors: Floats, mag: Floats, certain: Bools, quanta: Quanta, faintest: float
) -> NeighbourTable:
    """The table of N stars given brightest first; see :class:`NeighbourTable`."""
    star, first, second, angle = neighbourhoods(vectors, certain, quanta)
    which, key = quanta.entries(first, second, angle)
    both = np.sort(key * len(rows) + star[which])  # a tenth of the time of np.unique for so many
    both = both[np.append(True, both[1:] != both[:-1])] if len(both) else both
    key, entered = both // len(rows), (both % len(rows)).astype(np.int32)
    return NeighbourTable(rows, vectors, mag, certain, key, entered, len(star), faintest)


def neighbourhoods(
    vectors: Floats, certain: Bools, quanta: Quanta
) -> tuple[Ints, Floats, Floats, Floats]:
    """All neighbouring constellations: star (T,), both distances and the angle (T,), degrees."""
    count = min(32, len(vectors))
    while True:
        distance, near = _nearest(vectors, count)
        limits = _limits(distance, certain[near], quanta)
        short = (limits[:, 1] > distance[:, -1]).any()
        if not short or count == len(vectors):
            break
        count = min(2 * count, len(vectors))
        if len(vectors) * count * count > MOST_COMPARED:
            raise UsageError(f"So many stars that may be unseen {TOO_LARGE}")
    i, j = np.triu_indices(distance.shape[1], 1)
    wanted = (distance[:, i] <= limits[:, :1]) & (distance[:, j] <= limits[:, 1:])
    star, k = np.nonzero(wanted)
    first, second = near[star, i[k]], near[star, j[k]]
    angle = angle_at(vectors[star], vectors[first], vectors[second])
    return star, distance[star, i[k]], distance[star, j[k]], angle


def _limits(distance: Floats, certain: Bools, quanta: Quanta) -> Floats:
    """How far the first and the second neighbour of each star (N, 2) may be, degrees."""
    order = np.cumsum(certain, axis=1)
    limits = [np.where(order >= n, distance, 180.0).min(axis=1) for n in (1, 2)]
    return np.stack(limits, axis=1) + quanta.exchange * quanta.tolerance_deg


def _nearest(vectors: Floats, count: int) -> tuple[Floats, Ints]:
    """Distances (N, count - 1), degrees, and numbers of the nearest other stars."""
    chord, near = (np.asarray(a) for a in cKDTree(vectors).query(vectors, k=count))
    own = near == np.arange(len(vectors))[:, None]
    own[~own.any(axis=1), 0] = True  # of stars in one place any may be itself
    shape = len(vectors), count - 1
    chord, near = chord[~own].reshape(shape), near[~own].reshape(shape)
    distance = np.degrees(2.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)))
    return np.maximum(distance, 1e-6), near.astype(np.int64)


def angle_at(middle: Floats, first: Floats, second: Floats) -> Floats:
    """The angle (T,), degrees, at ``middle`` between great circles to the others, all (T, 3)."""
    a = first - (first * middle).sum(axis=1, keepdims=True) * middle
    b = second - (second * middle).sum(axis=1, keepdims=True) * middle
    sine = np.linalg.norm(np.cross(a, b), axis=1)
    return np.asarray(np.degrees(np.arctan2(sine, (a * b).sum(axis=1))))


def catalogue_table(
    brightest: int, spread: float, double_deg: float, quanta: Quanta, year: float = 2016.0
) -> NeighbourTable:
    """The table of the shipped catalogue, from memory, from disk, or made.

    The ``brightest`` stars set the limit of detection. With a brightness uncertain by the share
    ``spread``, stars are certain above ``1 + spread`` times that limit and maybe there down to ``1
    - spread``; so are both stars of a pair closer than ``double_deg``.
    """
    return _tabled(brightest, spread, double_deg, quanta, round(year))


@lru_cache(maxsize=4)
def _tabled(
    brightest: int, spread: float, double_deg: float, quanta: Quanta, year: int
) -> NeighbourTable:
    from app.sky import open_catalogue

    catalogue = open_catalogue()
    pole = np.array([0.0, 0.0, 1.0])
    rows = catalogue.brightest(pole, np.pi, brightest)
    faintest = float(catalogue.mag(rows)[-1])
    rows = catalogue.cone(pole, np.pi, faintest - 2.5 * float(np.log10(1.0 - spread)), year)

    def make() -> Arrays:
        mag, vectors = catalogue.mag(rows), catalogue.vectors(rows, year)
        certain = mag < faintest - 2.5 * np.log10(1.0 + spread)
        chord = 2.0 * np.sin(np.radians(double_deg) / 2.0)
        if len(double := cKDTree(vectors).query_pairs(chord, output_type="ndarray")):
            certain[double.ravel()] = False
        table = make_table(rows, vectors, mag, certain, quanta, faintest)
        arrays = {name: getattr(table, name) for name in KEPT}
        return {**arrays, "triplets": np.array(table.triplets)}

    options = {
        "brightest": brightest, "spread": spread, "double_deg": double_deg, "year": year,
        **asdict(quanta),
    }  # fmt: skip
    found = kept("neighbours", options, make)
    triplets = int(found.pop("triplets"))
    return NeighbourTable(**found, triplets=triplets, faintest=faintest)
