"""The neighbour method: a star by its two nearest neighbours and the angle between them.

The Initial Estimate of Liebe (1992, IEEE Aerosp. Electron. Syst. Mag. 7(6), 34): stars whose second
neighbour is nearer than the rim of the picture are looked up in the star database
(:mod:`kochab.lab.methods.neighbours`), and of the few candidates those are right whose distances
are those measured. Parity is free, as no feature has a sense of turning.
"""

from dataclasses import asdict, replace
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from kochab.attitude import wahba
from kochab.core.arrays import Bools, Floats, Ints
from kochab.core.attitude import cross_product
from kochab.core.camera import Camera
from kochab.core.errors import UsageError
from kochab.core.frame import Detections, Hint
from kochab.core.progress import Progress, Task
from kochab.core.registry import integer, number, switch
from kochab.core.values import frozen
from kochab.identification import Answer
from kochab.identification.table_cache import Arrays, cached_table
from kochab.lab.methods.confirmation import AngularMethod, CandidateNames, confirm, refused
from kochab.lab.methods.pairs import angles_between, spread
from kochab.sky import open_catalogue

# -- The star database: every star by its nearest neighbours, errors included -------------------
# Liebe (1992), sections "Star Characteristics" to "Star Exchange". A star is known by the distances
# to its first and second neighbour and the angle between them. All three are quantised, and the
# star is entered under every class that it can be measured in:
#
# - each place may be off, so a distance comes with the classes beside its own, an angle with those
#   within its error;
# - a neighbour near the limit of detection ("maybe") may not be seen, so that any star up to the
#   first "certain" one may be the first neighbour, any up to the second certain one the second; the
#   paper's example (its table of neighbouring constellations) shows that the two are counted apart;
# - a star hardly further away than such a certain one may change places with it.
#
# The paper states the error of its example's angle as 1.724 deg, which is ``2 tolerance (1/d1 + 1/d2)`` and the
# worst there is; the entries it prints in figure 11 are exactly those of twice that. The text's is the default, as
# it comes nearer to the paper's number of entries; ``angle_errors`` 2 is the figure's.

MOST_ENTRIES, MOST_COMPARED = 60_000_000, 400_000_000
"""Entries before doubles are left out, and pairs of neighbours: some seconds and a gigabyte."""
TOO_LARGE = "make the table of neighbours too large: take fewer stars, a smaller spread or tolerance, or larger steps."
TYPICAL_BV = 0.7  # the median over stars of the catalogue whose colour is known
PLACES = 4096  # a key is (first * PLACES + second) * PLACES + angle


@frozen(eq=False)
class NeighbourTable:
    """N stars, brightest first, and E entries by ascending ``key``.

    ``rows`` (N,) of the catalogue, ``vectors`` (N, 3) ICRS; ``key`` (E,) and the ``star`` (E,) entered under it.
    """

    rows: Ints
    vectors: Floats
    key: Ints
    star: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.key)

    def find(self, key: Ints) -> tuple[Ints, Ints]:
        """Which of the asked keys (Q,), and the star, of every entry under them."""
        which, entry = spread(np.searchsorted(self.key, key), np.searchsorted(self.key, key, "right"))
        return which, self.star[entry].astype(np.int64)


def make_table(rows: Ints, vectors: Floats, certain: Bools, options: "Neighbours") -> Arrays:
    """What a :class:`NeighbourTable` has of N stars given brightest first.

    Parameters
    ----------
    rows : Ints
        Their catalogue rows (N,).
    vectors : Floats
        ICRS unit vectors (N, 3).
    certain : Bools
        Whether each is sure to be seen (N,).
    options : Neighbours
        The method's.
    """
    star, first, second, angle = neighbourhoods(vectors, certain, options.exchange * options.tolerance_deg)
    which, key = options.entries(first, second, angle)
    both = np.sort(key * len(rows) + star[which])  # a tenth of the time of np.unique for so many
    both = both[np.append(True, both[1:] != both[:-1])] if len(both) else both
    key, entered = both // len(rows), (both % len(rows)).astype(np.int32)
    return {"rows": rows, "vectors": vectors, "key": key, "star": entered}


def neighbourhoods(vectors: Floats, certain: Bools, exchange_deg: float) -> tuple[Ints, Floats, Floats, Floats]:
    """All neighbouring constellations: star (T,), both distances and the angle (T,), degrees.

    Neighbours whose distances differ by no more than ``exchange_deg`` may change places.
    """
    count = min(32, len(vectors))
    while True:
        distance, near = _nearest(vectors, count)
        # how far the first and the second neighbour of each star may be, degrees
        # Certain stars counted outwards: the first and the second neighbour end where the count is 1 and 2.
        order = np.cumsum(certain[near], axis=1)
        ends = [np.where(order >= n, distance, 180.0).min(axis=1) for n in (1, 2)]
        limits = np.stack(ends, axis=1) + exchange_deg
        # A star whose second certain neighbour is beyond those asked for needs more: the count doubles.
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


def _nearest(vectors: Floats, count: int) -> tuple[Floats, Ints]:
    """Distances (N, count - 1), degrees, and numbers of the nearest other stars."""
    chord, near = (np.asarray(a) for a in cKDTree(vectors).query(vectors, k=count))
    own = near == np.arange(len(vectors))[:, None]
    own[~own.any(axis=1), 0] = True  # of stars in one place any may be itself
    shape = len(vectors), count - 1
    chord, near = chord[~own].reshape(shape), near[~own].reshape(shape)
    distance = np.degrees(2.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)))
    # Two stars in one place would divide by zero in the error of the angle.
    return np.maximum(distance, 1e-6), near.astype(np.int64)


def angle_at(middle: Floats, first: Floats, second: Floats) -> Floats:
    """The angle (T,), degrees, at ``middle`` between great circles to the others, all (T, 3)."""
    a = first - (first * middle).sum(axis=1, keepdims=True) * middle
    b = second - (second * middle).sum(axis=1, keepdims=True) * middle
    sine = np.linalg.norm(cross_product(a, b), axis=1)
    return np.asarray(np.degrees(np.arctan2(sine, (a * b).sum(axis=1))))


def sensor_magnitude(v: Floats, bv: Floats, colour_term: float) -> Floats:
    """Magnitudes (N,) as a sensor sees them: ``v + colour_term (bv - 0)``, zero for B-V = 0.

    The paper (section "Correction to CCD-Sensitivity") integrates black bodies over the sensor's
    response; over the colours of stars that is close to this line. Stars of unknown colour (NaN)
    count as typical. A red-sensitive sensor has a negative term: red stars look brighter to it.
    """
    return np.asarray(v + colour_term * np.where(np.isnan(bv), TYPICAL_BV, bv))


@lru_cache(maxsize=4)
def _tabled(options: "Neighbours", year: int) -> NeighbourTable:
    """The table of the shipped catalogue, from memory, from disk, or made."""
    wanted = asdict(options) | {"year": year}
    return NeighbourTable(**cached_table("neighbourhoods", wanted, lambda: _of_catalogue(options, year)))


def _of_catalogue(options: "Neighbours", year: int) -> Arrays:
    """The table of the shipped catalogue.

    The ``brightest`` stars set the limit of detection. With a brightness uncertain by the share ``spread``, stars
    are certain above ``1 + spread`` times that limit and maybe there down to ``1 - spread``; so are both stars of a
    pair closer than ``double_deg``. Brightness is that of a sensor with ``colour_term``, see `sensor_magnitude`.
    """
    catalogue, pole = open_catalogue(), np.array([0.0, 0.0, 1.0])
    limit = float(catalogue.mag(catalogue.brightest(pole, np.pi, options.brightest))[-1])
    fainter = -2.5 * float(np.log10(1.0 - options.spread))
    # B-V is below 4.5 in the catalogue: no star beyond can be bright enough to the sensor
    rows = catalogue.cone(pole, np.pi, limit + fainter + 9.0 * abs(options.colour_term), year)
    mag = sensor_magnitude(catalogue.mag(rows), catalogue.bv(rows), options.colour_term)
    order = np.argsort(mag, kind="stable")
    rows, mag = rows[order], mag[order]
    faintest = float(mag[options.brightest - 1])
    seen = int(np.searchsorted(mag, round(faintest + fainter, 3) + 1e-6))
    rows, mag = rows[:seen], mag[:seen]
    vectors = catalogue.vectors(rows, year)
    certain = mag < faintest - 2.5 * np.log10(1.0 + options.spread)
    chord = 2.0 * np.sin(np.radians(options.double_deg) / 2.0)
    if len(double := cKDTree(vectors).query_pairs(chord, output_type="ndarray")):
        certain[double.ravel()] = False
    return make_table(rows, vectors, certain, options)


FEWEST = 3
SEEDS = 6  # so many candidates, the best supported first, are let gather others around them
DEPTHS = (1.0, 0.7, 1.4, 0.5, 2.0)  # times the expected number of stars, brightest first
MOST_CANDIDATES = 1500


@frozen
class Neighbours(AngularMethod):
    """The method and its options, the paper's values as defaults; they suit a field of 30 deg.

    The camera of the paper sees stars down to a fixed brightness. A list may go deeper: of a
    longer one, as many of the brightest are taken as the catalogue's stars would fill the frame
    with on the average, then some fewer and more.
    """

    paper: ClassVar[str] = "Liebe 1992, Initial Estimate"
    fewest: ClassVar[int] = FEWEST

    brightest: int = integer(1107, "stars", 200, 20000, "of the catalogue, above the limit of detection")
    spread: float = number(0.25, "", 0.0, 0.9, "uncertainty of a brightness, as a share of it")
    tolerance_deg: float = number(0.05, "deg", 0.0005, 0.5, "largest error of a star's place")
    distance_step_deg: float = number(0.1, "deg", 0.001, 1.0, "class of a distance")
    angle_step_deg: float = number(5.0, "deg", 0.5, 45.0, "class of an angle")
    angle_errors: float = number(1.0, "", 1.0, 3.0, "times the error of an angle (figure 11: 2)")
    exchange: float = number(4.0, "tolerances", 0.0, 10.0, "neighbours so near change places")
    double_deg: float = number(0.1, "deg", 0.0, 1.0, "closer stars are a double: maybe seen")
    colour_term: float = number(0.0, "mag", -2.0, 2.0, "sensor minus V magnitude, for each B-V")
    circle: bool = switch(False, "only the circle within the frame is the picture")

    def search(self, detections: Detections, focal: float, hint: Hint | None, year: float) -> Task[Answer]:
        """Name the stars of a frame.

        Parameters
        ----------
        detections : Detections
            Of one frame; every one has a place.
        focal : float
            Focal length, px.
        hint : Hint or None
            What else is known of the frame; None: nothing.
        year : float
            Epoch of the stars' places, Julian year.
        """
        yield Progress("identify", 0.0, "neighbours of every catalogue star")
        table = self.table(year)
        yield Progress("identify", 0.5, "candidates")
        camera = Camera.centred(detections.width, detections.height, focal)
        tried = 0
        for depth in self._depths(len(detections), camera):
            xy = detections.xy[:depth]
            body, rim_deg = camera.unproject(xy), _rim_deg(xy, camera, self.circle)
            found, compared = self.recognise(body, rim_deg, table)
            tried += compared
            for seen, star in found:
                if float(np.ptp(body[seen], axis=0).max()) < 1e-6:
                    continue  # one place, listed twice
                named, stars = self._all(body, seen, star, table)
                names = CandidateNames(named, table.rows[stars], table.vectors[stars], 2 * max(1, tried))
                reach = max(2.0, 2.0 * np.radians(self.tolerance_deg) * focal)
                sure = confirm(detections, names, focal, reach, year, "neighbours")
                if sure is not None:
                    return sure
        return refused(detections, f"{tried} pairs of candidates compared")

    def table(self, year: float = 2016.0) -> NeighbourTable:
        """The star database for these options; made once, in a fraction of a second."""
        return _tabled(replace(self, circle=False), round(year))  # the picture's shape is no part of it

    def key(self, first_deg: Floats, second_deg: Floats, angle_deg: Floats) -> Ints:
        """The class (T,) of measured features (T,): both distances and the angle."""
        first, second = ((d / self.distance_step_deg).astype(np.int64) for d in (first_deg, second_deg))
        angle = (angle_deg / self.angle_step_deg).astype(np.int64)
        return np.asarray((first * PLACES + second) * PLACES + angle)

    def entries(self, first_deg: Floats, second_deg: Floats, angle_deg: Floats) -> tuple[Ints, Ints]:
        """Every class that true features (T,) can be measured in: which feature, and the key."""
        # Both ends of a distance may be off by the tolerance.
        reach = int(np.ceil(2.0 * self.tolerance_deg / self.distance_step_deg - 1e-9))
        steps = np.arange(-reach, reach + 1)
        error = self.angle_errors * 2.0 * np.degrees(self.tolerance_deg * (1 / first_deg + 1 / second_deg))
        low = (np.maximum(angle_deg - error, 0.0) / self.angle_step_deg).astype(np.int64)
        high = (np.minimum(angle_deg + error, 180.0) / self.angle_step_deg).astype(np.int64)
        if int((high - low + 1).sum()) * len(steps) ** 2 > MOST_ENTRIES:
            raise UsageError(f"So many classes {TOO_LARGE}")
        which, angle = spread(low, high + 1)
        a = (first_deg / self.distance_step_deg).astype(np.int64)[which, None, None] + steps[:, None]
        b = (second_deg / self.distance_step_deg).astype(np.int64)[which, None, None] + steps
        keys = (a * PLACES + b) * PLACES + angle[:, None, None]
        possible = (a >= 0) & (a <= b)  # the nearer one is always measured first
        which = np.broadcast_to(which[:, None, None], keys.shape)
        return which[possible], keys[possible]

    def recognise(self, body: Floats, rim_deg: Floats, table: NeighbourTable) -> tuple[list[tuple[Ints, Ints]], int]:
        """Sets of (detection, star) that agree, the largest first, and how many pairs were tried.

        ``body`` (n, 3) are the directions in the camera and ``rim_deg`` (n,) how far each is from
        the rim of the picture.
        """
        detection, star = self.candidates(body, rim_deg, table)
        # The matrices below are square in the candidates: 1,500 are 2.25 million pairs.
        if not 0 < len(star) <= MOST_CANDIDATES:
            return [], 0
        sky = table.vectors[star]
        seen = angles_between(body[detection][:, None], body[detection])
        real = angles_between(sky[:, None], sky)
        suits = np.abs(seen - real) <= np.radians(2.0 * self.tolerance_deg)
        suits &= (detection[:, None] != detection) & (star[:, None] != star)
        sets: dict[tuple[int, ...], None] = {}
        for seed in np.argsort(-suits.sum(axis=1), kind="stable")[:SEEDS]:
            # candidates that all agree with each other, one a detection, around the seed
            kept, open_ = [int(seed)], suits[seed].copy()
            while open_.any():
                kept.append(int(np.where(open_, (suits & open_).sum(axis=1), -1).argmax()))
                open_ &= suits[kept[-1]] & (detection != detection[kept[-1]])
            if len(kept) >= 2:
                sets[tuple(sorted(kept))] = None
        order = sorted((np.array(kept) for kept in sets), key=len, reverse=True)
        compared = len(star) * (len(star) - 1) // 2
        return [(detection[kept], star[kept]) for kept in order], compared

    def candidates(self, body: Floats, rim_deg: Floats, table: NeighbourTable) -> tuple[Ints, Ints]:
        """Detections whose triplet is whole, and every star of the database that fits, (C,)."""
        if len(body) < FEWEST:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        gap = np.degrees(angles_between(body[:, None], body))
        np.fill_diagonal(gap, np.inf)
        near = np.argsort(gap, axis=1, kind="stable")[:, :2]
        distance = np.take_along_axis(gap, near, axis=1)
        whole = np.flatnonzero(distance[:, 1] <= rim_deg)
        near, distance = near[whole], distance[whole]
        angle = angle_at(body[whole], body[near[:, 0]], body[near[:, 1]])
        which, star = table.find(self.key(distance[:, 0], distance[:, 1], angle))
        return whole[which].astype(np.int64), star

    def _all(self, body: Floats, seen: Ints, star: Ints, table: NeighbourTable) -> tuple[Ints, Ints]:
        """The names of every detection once those of two or more stars tell the axis.

        Stars next to the rim and those with a false neighbour have no triplet of their own.
        """
        best: tuple[Ints, Ints] = seen, star
        for mirrored in (1.0, -1.0):
            turned = body * np.array([mirrored, 1.0, 1.0])
            sky = turned @ wahba(turned[seen], table.vectors[star]).matrix
            chord = np.linalg.norm(sky[:, None] - table.vectors, axis=2)
            mine, theirs = chord.argmin(axis=1), chord.argmin(axis=0)
            ok = chord[np.arange(len(sky)), mine] < np.radians(2.0 * self.tolerance_deg)
            ok &= theirs[mine] == np.arange(len(sky))
            if int(ok.sum()) > len(best[0]):
                best = np.flatnonzero(ok), mine[ok]
        return best

    def _depths(self, count: int, camera: Camera) -> list[int]:
        """How many of the brightest detections to try, the likeliest number first."""
        w, h = np.radians(camera.fov_deg) / 2.0
        share = np.arcsin(np.sin(w) * np.sin(h)) / np.pi  # of the sphere
        expected = self.brightest * float(share)
        depths = [min(count, max(FEWEST, round(expected * part))) for part in DEPTHS]
        if count <= 2.5 * expected:
            depths.insert(0, count)
        return list(dict.fromkeys(depths))


def _rim_deg(xy: Floats, camera: Camera, circle: bool) -> Floats:
    """How far places (N, 2) px are from the nearest point of the picture's rim, degrees."""
    size = np.array([camera.width, camera.height], dtype=np.float64)
    middle = (size - 1.0) / 2.0
    body = camera.unproject(xy)
    if circle:
        half = np.arctan(size.min() / 2.0 / camera.focal_px)
        axis = camera.unproject(middle[None])[0]
        return np.asarray(np.degrees(half - np.arccos(np.clip(body @ axis, -1.0, 1.0))))
    edges = []
    for axis_number in (0, 1):
        for edge in (-0.5, size[axis_number] - 0.5):
            foot = xy.copy()
            foot[:, axis_number] = edge
            edges.append(angles_between(body, camera.unproject(foot)))
    return np.asarray(np.degrees(np.min(edges, axis=0)))
