"""The angle method: separations of two stars, narrowed down by pivoting on a shared star.

The thesis on spherical triangles, sections 2.2, 2.3, 3.8.1 and 5.2. The largest angle comes first;
each further one shares a star with the one before. Its table of 106,308 angles took a few hours;
the brightest 8,118 stars of this catalogue make 139,964 of them in hundredths of a second.
"""

from abc import abstractmethod
from dataclasses import fields, replace
from functools import lru_cache
from math import factorial
from typing import Any, ClassVar, Self

import numpy as np

from kochab.core.arrays import Bools, Floats, Ints
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.progress import Progress, Task
from kochab.core.registry import integer, number, switch
from kochab.core.values import frozen
from kochab.identification import Answer
from kochab.lab.methods.confirmation import AngularMethod, CandidateNames, confirm, refused
from kochab.lab.methods.pairs import Pairs, between, catalogue_pairs, spread

# -- Pivoting: candidates of one figure are kept when they share stars with those of the next ----
# The thesis on spherical triangles, sections 2.3, 2.6, 5.2.3-5.2.5 and 5.3.3-5.3.5. Its binary
# trees are one sort and two binary searches here.

MOST_FINALISTS = 200_000  # beyond, the search has lost its way: inconclusive


@frozen(eq=False)
class Chain:
    """What pivoting led to: ``figures`` (F,) of the frame and ``entries`` (F,) of the catalogue.

    ``entries`` is None when no single solution was reached. ``pivots`` is how many were made and
    ``compared`` how many candidates of the catalogue were looked at.
    """

    figures: Ints
    entries: Ints | None
    pivots: int
    compared: int


def pivot_order(size: Floats, keys: Ints, limit: int) -> Ints:
    """The largest figure first, then always the largest unused one that shares a key with the last.

    ``size`` (F,) and ``keys`` (F, c), what two figures may share; at most ``limit`` pivots.
    """
    free = np.ones(len(size), dtype=np.bool_)
    order = [int(size.argmax())]
    free[order[0]] = False
    while len(order) <= limit:
        shares = (keys[:, :, None] == keys[order[-1]]).any(axis=(1, 2)) & free
        if not shares.any():
            break
        order.append(int(np.where(shares, size, -np.inf).argmax()))
        free[order[-1]] = False
    return np.array(order, dtype=np.int64)


def join(finalists: Ints, pivots: Ints, once: bool = True) -> tuple[Ints, Ints]:
    """Numbers of the rows of two key tables (A, c) and (B, c) that share a key.

    Each pair of rows comes once, or, unless ``once``, for every key that they share.
    """
    c = pivots.shape[1]
    flat = pivots.ravel()
    order = np.argsort(flat, kind="stable")
    ranked = flat[order]
    start = np.searchsorted(ranked, finalists.ravel(), "left")
    stop = np.searchsorted(ranked, finalists.ravel(), "right")
    # Checked before anything is allocated; two rows may share c keys and so be counted c times.
    if int((stop - start).sum()) > MOST_FINALISTS * c:
        raise OverflowError
    asked, place = spread(start, stop)
    # A pair of rows as one integer: row of the first times the second table's length, plus its row.
    both = asked // c * len(pivots) + order[place] // c
    both = np.unique(both) if once else both
    return both // max(1, len(pivots)), both % max(1, len(pivots))


def pivot(order: Ints, candidates: list[Ints], keys: Ints, as_printed: bool = False) -> Chain:
    """Pivot through figures until one solution is left.

    Two figures of a frame are never one entry of the catalogue.

    Parameters
    ----------
    order : Ints
        Numbers of the figures (F,), in the order they are tried.
    candidates : list[Ints]
        The catalogue's entries for each figure of the order.
    keys : Ints
        What entries may share (N, c).
    as_printed : bool
        Follow the thesis' programs (E.34, E.35) where they differ: an entry may stand for two figures, counts for
        every key it shares, and when a pivot leaves more finalists than there were, the search is given up.
    """
    finalists = candidates[0][:, None]
    compared = len(finalists)
    for step in range(len(order)):
        if step:
            compared += len(candidates[step])
            try:
                a, b = join(keys[finalists[:, -1]], keys[candidates[step]], not as_printed)
            except OverflowError:
                return Chain(order[: step + 1], None, step, compared)
            new = candidates[step][b]
            if as_printed and len(new) > len(finalists):
                return Chain(order[: step + 1], None, step - 1, compared)
            # The figures of the chain are all different, so their entries must be as well.
            fresh = (finalists[a] != new[:, None]).all(axis=1) | as_printed
            finalists = np.column_stack([finalists[a], new])[fresh]
        if len(finalists) == 1:
            return Chain(order[: step + 1], finalists[0], step, compared)
        if len(finalists) == 0 or len(finalists) > MOST_FINALISTS:
            break
    return Chain(order[: step + 1], None, step, compared)


@frozen(eq=False)
class FigureTable:
    """``stars`` (F, c) of ``pairs`` in the catalogue's figures; ``values`` (F,) to search ascend."""

    pairs: Pairs
    stars: Ints
    values: Floats

    def take(self, chosen: Bools) -> Self:
        """Of all figures (F,) these."""
        kept = {part.name: getattr(self, part.name)[chosen] for part in fields(self) if part.name != "pairs"}
        return replace(self, **kept)


@frozen
class PivotingMethod(AngularMethod):
    """What the two methods of the thesis share: its values as defaults, and the way to names.

    Of the error of a star's place the thesis says 0.87 microradian in section 2.2.2; its programs
    use 87.2665 / 3, which is the reading that gives its results.
    """

    name: ClassVar[str]
    figure: ClassVar[str]
    corners: ClassVar[int]  # stars of the figure

    sigma_urad: float = number(87.2665 / 3.0, "microradian", 0.1, 1000.0, "error of a star's place a coordinate")
    bound_sigma: float = number(
        3.0, "sigma", 1.0, 6.0, "half-width of a range in errors of what is compared (section 2.2.2: 3)"
    )
    sigma_px: float = number(0.2, "px", 0.0, 3.0, "the error is never taken to be less than this")
    limit_deg: float = number(6.94, "deg", 1.0, 10.0, "largest figure used (sections 3.3 and 3.5: 6.94)")
    stars: int = integer(25, "stars", 4, 60, "brightest detections used")
    brightest: int = integer(8118, "stars", 100, 20000, "brightest catalogue stars used (the thesis' list had 8,118)")
    mag_limit: float | None = number(
        None, "mag V", 2.0, 8.0, "faintest catalogue star, instead of their number", "by number"
    )
    pivots: int = integer(9, "pivots", 1, 1000, "most pivots (table 6.2: 9)")
    most: int = integer(10_000, "solutions", 10, 1_000_000, "figures with more are left out (6.1: 10,000)")
    as_printed: bool = switch(False, "pivot as the thesis' programs do: give up when a pivot leaves more finalists")

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
        yield Progress("identify", 0.0, f"{self.figure}s of the catalogue")
        table = self.table(year)
        yield Progress("identify", 0.5, "pivots")
        camera = Camera.centred(detections.width, detections.height, focal)
        body = camera.unproject(detections.xy[: self.stars])
        # The thesis' error is that of its sensor; a detection list is rarely better than sigma_px.
        sigma = max(self.sigma_urad * 1e-6, self.sigma_px / focal)
        figures, chain = self.recognise(body, table, sigma)
        if chain.entries is not None:
            pairs, ways = table.pairs, factorial(self.corners)
            stars_of = self.named(figures[chain.figures], table.stars[chain.entries], body, pairs.vectors)
            # a star that the chain names in two ways is left out, and so is a name given twice
            # s holds one star here; min() takes it out of the set.
            sure = {d: min(s) for d, s in stars_of.items() if len(s) == 1}
            once = [d for d, s in sorted(sure.items()) if list(sure.values()).count(s) == 1]
            seen, star = (np.array(a, dtype=np.int64) for a in (once, [sure[d] for d in once]))
            names = CandidateNames(seen, pairs.rows[star], pairs.vectors[star], ways * chain.compared)
            reach = max(2.0, 2.0 * self.bound_sigma * sigma * focal)
            found = confirm(detections, names, focal, reach, year, self.name)
            if found is not None:
                return found
        return refused(detections, f"{chain.pivots} pivots from {self.figure} to {self.figure}")

    @abstractmethod
    def table(self, year: float = 2016.0) -> FigureTable:
        """The catalogue's figures for these options."""

    @abstractmethod
    def recognise(self, body: Floats, table: Any, sigma: float) -> tuple[Ints, Chain]:
        """The figures (F, c) of directions ``body`` (n, 3) and the chain that pivoting gives.

        ``sigma`` is the error of a direction a coordinate, radians.
        """

    @abstractmethod
    def named(self, figures: Ints, entries: Ints, body: Floats, sky: Floats) -> dict[int, set[int]]:
        """The stars that a chain of figures (F, c) takes each detection for.

        Parameters
        ----------
        figures : Ints
            Detections of each figure of the chain (F, c).
        entries : Ints
            Stars of the catalogue's entry for each (F, c).
        body : Floats
            Directions of the detections (D, 3), camera axes.
        sky : Floats
            ICRS unit vectors of the stars (N, 3).
        """


@frozen
class Angles(PivotingMethod):
    """The angle method; for its options see `PivotingMethod`."""

    paper: ClassVar[str] = "Spherical triangles, chapters 2.2, 2.3 and 5.2"
    name: ClassVar[str] = "angles"
    figure: ClassVar[str] = "angle"
    corners: ClassVar[int] = 2
    fewest: ClassVar[int] = 3

    limit_deg: float = number(6.94, "deg", 1.0, 40.0, "largest angle used (section 3.3: 6.94)")

    def table(self, year: float = 2016.0) -> FigureTable:
        """The catalogue's angles for these options."""
        return angle_table(self.limit_deg, self.brightest, self.mag_limit, year)

    def recognise(self, body: Floats, table: FigureTable, sigma: float) -> tuple[Ints, Chain]:
        """The angles (F, 2) of directions ``body`` (n, 3) and the chain that pivoting gives."""
        figures = np.stack(np.triu_indices(len(body), 1), axis=1).astype(np.int64)
        # Rounding puts cosines of coincident directions above 1, where arccos is NaN.
        cosine = np.clip((body[figures[:, 0]] * body[figures[:, 1]]).sum(axis=1), -1.0, 1.0)
        angle = np.arccos(cosine)
        bound = self.bound_sigma * np.sqrt(2.0) * sigma  # equation 2.15
        # The table is in cosines, which fall as the angle grows: the larger angle is the lower end.
        start, stop = between(table.values, np.cos(angle + bound), np.cos(np.maximum(angle - bound, 0.0)))
        # Beyond the limit the table has no entries, and an angle cut by its edge would look rare.
        use = (angle < np.radians(self.limit_deg)) & (stop - start <= self.most)
        figures, angle, start, stop = figures[use], angle[use], start[use], stop[use]
        if len(figures) == 0:
            return figures, Chain(np.zeros(0, dtype=np.int64), None, 0, 0)
        order = pivot_order(angle, figures, self.pivots)
        lists = [np.arange(start[f], stop[f]) for f in order]
        return figures, pivot(order, lists, table.stars, self.as_printed)

    def named(self, figures: Ints, entries: Ints, body: Floats, sky: Floats) -> dict[int, set[int]]:
        """By the star that two neighbours of a chain of angles (F, 2) share, and those they do not.

        Parameters
        ----------
        figures : Ints
            Detections of each figure of the chain (F, c).
        entries : Ints
            Stars of the catalogue's entry for each (F, c).
        body : Floats
            Directions of the detections (D, 3), camera axes.
        sky : Floats
            ICRS unit vectors of the stars (N, 3).
        """
        stars_of: dict[int, set[int]] = {}
        # One angle does not say which of its two stars is which; the next one, which shares a star, does.
        for k in range(len(figures) - 1):
            ours, theirs = ([set(map(int, pair)) for pair in part[k : k + 2]] for part in (figures, entries))
            for mine, its in (
                (ours[0] & ours[1], theirs[0] & theirs[1]),
                (ours[0] - ours[1], theirs[0] - theirs[1]),
                (ours[1] - ours[0], theirs[1] - theirs[0]),
            ):
                for detection, star in zip(mine, its, strict=True):
                    stars_of.setdefault(detection, set()).add(star)
        return stars_of


def angle_table(limit_deg: float, brightest: int, mag_limit: float | None, year: float = 2016.0) -> FigureTable:
    """The angles of the catalogue.

    Parameters
    ----------
    limit_deg : float
        The largest angle, degrees.
    brightest : int
        How many stars.
    mag_limit : float or None
        V down to which all stars count, in place of ``brightest``; None: not used.
    year : float
        Epoch of their places, Julian year.
    """
    return angles_of(catalogue_pairs(limit_deg, brightest=brightest, mag_limit=mag_limit, year=year))


@lru_cache(maxsize=4)
def angles_of(pairs: Pairs) -> FigureTable:
    """The angles of any pairs, the widest first, so that cosines ascend; kept while they are."""
    stars = np.stack([pairs.first, pairs.second], axis=1)[::-1].astype(np.int64)
    return FigureTable(pairs, stars, np.cos(pairs.angle[::-1]))
