"""A narrow frame whose place and scale are known: an index of that part of the sky alone, made for it.

The stars are the shipped ones and those of the catalogue that the user has chosen (:mod:`kochab.sky.user_catalogues`).
Small cones are asked first, since most hints are better than they say; each is one more chance of error and counted.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from kochab.core.arrays import Bools, Floats, Ints
from kochab.core.attitude import ARCSEC
from kochab.core.errors import CatalogueError
from kochab.core.frame import Detections, Hint
from kochab.core.progress import Progress, Task
from kochab.core.solution import Identification, NoSolution, Reason
from kochab.core.values import frozen
from kochab.identification.index import LEVEL_FIELDS_DEG, PER_FIELD, Volume, fine
from kochab.identification.local_index import local_pairs, local_volume
from kochab.identification.patterns import Patterns, SearchStage
from kochab.identification.verification import ACCEPT_LOG10
from kochab.sky import Catalogue, open_catalogue
from kochab.sky.names import position_name
from kochab.sky.user_catalogues import Cone, UserCatalogue, opened
from kochab.text.translation import tr

WIDEST_DEG = LEVEL_FIELDS_DEG[4]
"""Wider fields are served by the shipped patterns."""
OWN_DEG = 1.2
"""In wider fields the shipped stars are enough, and found sooner."""


@frozen
class Depth:
    """One way through the cones.

    ``levels`` are the smallest and the largest field of the index's levels, over the frame's; ``most_fields`` is how
    many frames the largest cone would hold.
    """

    levels: tuple[float, float]
    stages: tuple[SearchStage, ...]
    most_fields: int

    def most_deg(self, field_deg: float) -> float:
        """Radius of the largest cone that is asked."""
        return field_deg * math.sqrt(self.most_fields / math.pi)


DEPTHS = (
    Depth(
        (0.9, 2.8),
        (
            SearchStage(10, 5, 0.9, 0.003, 30, max_verified=4, spread=1.6),
            SearchStage(18, 6, 0.9, 0.003, 40, max_verified=20),
        ),
        2_000,
    ),
    Depth((0.45, 1.41), (SearchStage(30, 6, 1.0, 0.003, 50), SearchStage(40, 6, 1.0, 0.004, 60, spread=3.0)), 500),
)
"""The brightest stars of every cone first: a quarter of the index, and mostly enough. The largest takes a second."""
FIRST_FIELDS, GROWTH = 2.0, 2.0
"""Radius of the first cone over the frame's field, and of each cone over the one before."""
VAGUE = 1.6
"""Nor are scales less certain than this factor: every size of field would need its index."""
SAME_ARCSEC = 3.0
"""Within which a star of the user's is one that is shipped."""
MORE_STARS = 3.0
"""Stars taken over those that the deepest level can use, for fields that are richer than the cone's mean."""


@frozen(eq=False)
class ConeStars:
    """The stars of a cone as a catalogue of their own: rows 0 to N - 1, brightest first.

    ``place`` (N, 3) are ICRS unit vectors at the frame's year, ``v`` (N,) magnitudes, ``shipped`` (N,) the rows of
    the shipped catalogue, -1 for stars of the user's.
    """

    catalogue: Catalogue
    place: Floats
    v: Floats
    shipped: Ints

    def vectors(self, rows: Ints, year: float) -> Floats:
        """ICRS unit vectors (N, 3); those of the user's stars as the cone had them, since few have motions."""
        out = self.place[rows]
        known = self.shipped[rows] >= 0
        out[known] = self.catalogue.vectors(self.shipped[rows][known], year)
        return np.asarray(out)

    def mag(self, rows: Ints) -> Floats:
        """V magnitudes (N,), or nearly."""
        return np.asarray(self.v[rows])

    def brightest(self, vector: Floats, radius_rad: float, n: int, year: float) -> Ints:
        """The brightest rows around an ICRS unit vector (3,).

        Parameters
        ----------
        vector : Floats
            Axis of the circle, ICRS unit vector (3,).
        radius_rad : float
            Its half angle, radians.
        n : int
            How many at most.
        year : float
            As the cone's own.
        """
        gap = self.place - vector
        chord = 2.0 * np.sin(min(radius_rad, np.pi) / 2.0)
        return np.flatnonzero((gap * gap).sum(axis=1) <= chord * chord)[:n]

    def labels(self, rows: Ints) -> list[tuple[str, str]]:
        """Identifiers and names; a star of the user's is named by its place."""
        known = self.shipped[rows] >= 0
        names = iter(self.catalogue.labels(self.shipped[rows][known]))
        places = zip(known.tolist(), self.place[rows], strict=True)
        return [next(names) if shipped else (position_name(place), "") for shipped, place in places]


def cone_stars(cone: Cone, own: UserCatalogue | None) -> ConeStars:
    """The shipped stars of a cone and, of the user's, those that are none of these."""
    catalogue = open_catalogue()
    rows = catalogue.cone(cone.axis, cone.radius_rad, cone.mag_limit, cone.year)
    place, mag = catalogue.vectors(rows, cone.year), catalogue.mag(rows)
    if own is not None:
        more = own.cone(cone)
        vectors = more.vectors
        new = _absent(place, vectors)
        place, mag = np.concatenate([place, vectors[new]]), np.concatenate([mag, more.mag[new]])
        rows = np.concatenate([rows, np.full(int(new.sum()), -1)])
    order = np.argsort(mag, kind="stable")
    return ConeStars(catalogue, place[order], mag[order], rows[order])


def _absent(there: Floats, place: Floats) -> Bools:
    """Which of ``place`` (N, 3) are none of ``there`` (M, 3)."""
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(there).query(place, distance_upper_bound=SAME_ARCSEC * ARCSEC)
    return np.asarray(~np.isfinite(distance))


@frozen
class Narrow:
    """What a hint says of a narrow frame: the middle and the ends of its field, degrees.

    ``first`` is whether a cone is asked before the index of the whole sky, ``whole`` whether cones reach all around the
    hint's place, so that nothing is left for that.
    """

    field_deg: float
    span_deg: tuple[float, float]
    first: bool
    whole: bool


def narrow(detections: Detections, hint: Hint | None) -> Narrow | None:
    """What is known of a frame that a cone may serve, None when it is no such frame."""
    scale = hint.focal_px if hint else None
    if hint is None or hint.centre_deg is None or scale is None or scale[1] > VAGUE * scale[0]:
        return None
    half = math.sqrt(detections.width * detections.height) / 2.0
    largest, smallest = (math.degrees(2.0 * math.atan(half / focal)) for focal in scale)
    field = math.sqrt(smallest * largest)
    if field > WIDEST_DEG:
        return None
    first = fine() is None or (field < OWN_DEG and _own()[0] is not None)
    return Narrow(field, (smallest, largest), first, hint.centre_deg[2] <= DEPTHS[0].most_deg(smallest))


def _own() -> tuple[UserCatalogue | None, str]:
    """The user's catalogue, or the sentence that says why it cannot be read."""
    try:
        return opened(), ""
    except CatalogueError as error:
        return None, str(error)


def search_cone(
    detections: Detections, hint: Hint, known: Narrow, year: float, unreadable: list[str]
) -> Task[Identification | NoSolution]:
    """Identify the stars of a narrow frame near the hint's place.

    Parameters
    ----------
    detections : Detections
        Of the frame.
    hint : Hint
        With place and scale.
    known : Narrow
        What :func:`narrow` says of it.
    year : float
        Epoch of the stars' places, Julian year.
    unreadable : list[str]
        Takes the sentence that says why the user's catalogue cannot be read, should it be damaged.
    """
    own, problem = _own()
    unreadable += [problem] if problem else []
    refusal = NoSolution(Reason.NO_PATTERN_AGREED, "", "nothing")
    searches = 0
    for depth in DEPTHS:
        limit = None
        for place in _cones(hint, known, depth):
            yield Progress("identify", 0.2, tr("near the given position"))
            ra, dec = np.radians(place[:2]).tolist()
            cone = Cone(ra, dec, _reach(place[2], detections, hint), limit, year)
            try:
                stars = cone_stars(cone, own)
            except CatalogueError as error:  # the shipped stars may do
                own = None
                unreadable.append(str(error))
                stars = cone_stars(cone, own)
            limit = _faintest_needed(stars, cone, known, depth)
            volume = yield from _volume(stars, cone, known, depth)
            if volume is None:
                continue
            searches += 1
            pairs = partial(local_pairs, volume, area_sr=cone.area_sr)
            there = replace(hint, centre_deg=place)
            found = yield from Patterns((volume,), depth.stages, pairs).identify(detections, there, year)
            if isinstance(found, NoSolution):
                refusal = found
                continue
            alarm = min(0.0, found.log10_false_alarm + math.log10(searches))
            if alarm <= ACCEPT_LOG10:
                return replace(found, log10_false_alarm=alarm, catalogue=stars)
    return refusal


def _cones(hint: Hint, known: Narrow, depth: Depth) -> Iterator[tuple[float, float, float]]:
    """Place and radius, degrees, of the cones to ask, ever larger, none larger than the hint's."""
    assert hint.centre_deg is not None
    ra, dec, radius = hint.centre_deg
    most = depth.most_deg(known.span_deg[0])
    step = max(FIRST_FIELDS * known.span_deg[1], 0.1)
    while step * GROWTH**0.5 < min(radius, most):
        yield ra, dec, step
        step *= GROWTH
    yield ra, dec, min(radius, most)


def _reach(radius_deg: float, detections: Detections, hint: Hint) -> float:
    """Radius, rad, that holds every frame in which the hint's place may lie."""
    assert hint.focal_px is not None
    diagonal = math.atan(math.hypot(detections.width, detections.height) / 2.0 / hint.focal_px[0])
    return min(math.radians(radius_deg) + 2.2 * diagonal, math.pi / 3.0)


def _wanted(cone: Cone, known: Narrow, depth: Depth) -> int:
    """The stars that the deepest level can have in a cone."""
    smallest = math.radians(depth.levels[0] * known.span_deg[0])
    return int(MORE_STARS * PER_FIELD * cone.area_sr / smallest**2) + 100


def _faintest_needed(stars: ConeStars, cone: Cone, known: Narrow, depth: Depth) -> float | None:
    """The magnitude to which the next cone, around this one, must be read; None: all."""
    wanted = _wanted(cone, known, depth)
    return float(stars.v[wanted]) + 0.5 if len(stars.v) > wanted else None


def _volume(stars: ConeStars, cone: Cone, known: Narrow, depth: Depth) -> Task[Volume | None]:
    low, high = depth.levels[0] * known.span_deg[0], depth.levels[1] * known.span_deg[1]
    fields = np.geomspace(low, high, 1 + round(math.log2(high / low) * 2.0)).tolist()
    place = stars.place[: _wanted(cone, known, depth)]
    return (yield from local_volume(place, np.arange(len(place)), cone.axis, tuple(fields)))
