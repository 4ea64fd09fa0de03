"""What the published methods share: what they need to begin, and whether proposed names hold.

The methods that compare angular separations end with names and no measure of trust, so all of them end here. Two of
the named stars, the proposers, fix rotation and focal length; the evidence is how many of the other detections then
fall on catalogue stars, against what chance would give (:mod:`kochab.identification.verification`), after counting
every pair of catalogue stars the method looked at.
"""

import math
from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from kochab.attitude import wahba
from kochab.core.arrays import Floats, Ints
from kochab.core.attitude import Attitude
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.pairing import mutual_nearest_of_few
from kochab.core.progress import Task
from kochab.core.solution import Identification, Matches, NoSolution, Reason
from kochab.core.values import frozen
from kochab.identification import Answer, with_places
from kochab.identification.verification import ACCEPT_LOG10, CandidatePointing, chance_of, refit
from kochab.sky import open_catalogue

MOST_EVIDENCE = 40  # so many of the brightest detections may be evidence
PROPOSERS = 15  # so many pairs of named stars, the widest first, are let propose
FEWEST = 3
ODD, ODD_PX = 5.0, 3.0  # a name is dropped beyond so many times the median error, and so many px


@frozen(eq=False)
class CandidateNames:
    """Supposed names: ``detection`` (M,), catalogue ``rows`` (M,) and their ``vectors`` (M, 3).

    ``tried`` is how many pairs of catalogue stars were compared with pairs of detections on the
    way, each way round; ``mirrored`` is the parity, None when separations alone were used.
    """

    detection: Ints
    rows: Ints
    vectors: Floats
    tried: int
    mirrored: bool | None = None


def confirm(
    detections: Detections, names: CandidateNames, focal_px: float, reach_px: float, year: float, method: str
) -> Identification | None:
    """The answer that names amount to, or None when chance could explain them.

    Parameters
    ----------
    detections : Detections
        Of the frame.
    names : CandidateNames
        The stars that some are taken for.
    focal_px : float
        Focal length.
    reach_px : float
        The error allowed in a star's place; names further off are dropped.
    year : float
        Epoch of the stars' places, Julian year.
    method : str
        The name that the answer bears.
    """
    if len(names.detection) < FEWEST:
        return None
    half = np.array([(detections.width - 1) / 2.0, (detections.height - 1) / 2.0])
    seen = detections.xy - half
    try:
        start = _start(detections, names, focal_px)
    except ValueError:  # all in one direction
        return None
    evidence = seen[:MOST_EVIDENCE]
    corner = float(np.hypot(*half)) + 3.0 * reach_px
    catalogue = open_catalogue()
    # The 3 reaches and a tenth cover a pointing that is still a little off; 1.4 rad keeps well within a half sphere.
    radius = min(1.1 * float(np.arctan(corner / focal_px)), 1.4)
    rows = catalogue.brightest(start.matrix[2], radius, 2 * len(evidence) + 5, year)
    sky = catalogue.vectors(rows, year)
    best = 0.0
    named = seen[names.detection]
    pairs = np.stack(np.triu_indices(len(named), 1), axis=1)
    widest = np.argsort(-np.hypot(*(named[pairs[:, 0]] - named[pairs[:, 1]]).T), kind="stable")
    # Two stars fix rotation and focal length, and the widest pair fixes them best. Only two propose, so that
    # all other detections are left as independent evidence.
    for two in pairs[widest[:PROPOSERS]]:
        pointing = _refitted(start, named[two], names.vectors[two])
        # The scale is a premise of these methods: a pair that needs a focal length 10 % off is wrong.
        if abs(np.log(pointing.focal / focal_px)) < 0.1:
            others = np.delete(evidence, names.detection[two][names.detection[two] < MOST_EVIDENCE], 0)
            strange = ~np.isin(rows, names.rows[two])  # in a clump any detection finds the star that proposed
            best = min(best, _tail(pointing, others, sky[strange], half, reach_px))
    # Separations alone fit both parities, and _start picks the better one: that is two chances.
    parities = 2 if names.mirrored is None else 1
    alarm = min(0.0, best + np.log10(max(1, names.tried * parities)))
    if alarm > ACCEPT_LOG10:
        return None
    pointing, kept = _fitted(start, named, names.vectors, reach_px)
    if len(kept) < FEWEST:
        return None
    chosen = names.detection[kept]
    matches = Matches(chosen, names.rows[kept], detections.xy[chosen], names.vectors[kept])
    camera = Camera.centred(detections.width, detections.height, pointing.focal, pointing.mirrored)
    return Identification(matches, camera, Attitude(pointing.matrix), float(alarm), method, max(1, names.tried))


def _start(detections: Detections, names: CandidateNames, focal_px: float) -> CandidatePointing:
    """The pointing of the parity that suits the names better."""
    tried = []
    for mirrored in (False, True) if names.mirrored is None else (names.mirrored,):
        camera = Camera.centred(detections.width, detections.height, focal_px, mirrored)
        # A rotation cannot mirror, so the wrong parity leaves large residuals, unless there are only two stars.
        body = camera.unproject(detections.xy[names.detection])
        matrix = wahba(body, names.vectors).matrix
        left = float(np.square(body - names.vectors @ matrix.T).sum())
        tried.append((left, CandidatePointing(matrix, focal_px, mirrored)))
    return min(tried, key=lambda one: one[0])[1]


def _refitted(pointing: CandidatePointing, seen: Floats, vectors: Floats) -> CandidatePointing:
    """Rotation and focal length by these stars alone; three rounds, as the fit is linear."""
    for _ in range(3):
        pointing = refit(pointing, seen, *pointing.project(vectors), bend=False)
    return pointing


def _tail(pointing: CandidatePointing, seen: Floats, sky: Floats, half: Floats, reach_px: float) -> float:
    """log10 of the chance that one pointing agrees so well with stars that did not propose it."""
    places, _ = pointing.project(sky)
    xy = places[(np.abs(places) < half).all(axis=1)]
    # free=0: nothing was fitted to these stars.
    return chance_of(mutual_nearest_of_few(seen, xy, reach_px)[2], seen, places, half, reach_px, free=0)[0]


def _fitted(start: CandidatePointing, seen: Floats, vectors: Floats, reach_px: float) -> tuple[CandidatePointing, Ints]:
    """Rotation and focal length by named stars at ``seen`` (M, 2) px, and those (K,) that agree with it.

    The worst star is dropped while it is too far off, until fewer than ``FEWEST`` are left.
    """
    pointing, kept = start, np.arange(len(seen))
    while len(kept) >= FEWEST:
        # Each round starts over from the first pointing, so that a star that was dropped leaves no trace.
        pointing = _refitted(start, seen[kept], vectors[kept])
        off = np.hypot(*(pointing.project(vectors[kept])[0] - seen[kept]).T)
        if off.max() <= min(reach_px, max(ODD_PX, ODD * float(np.median(off)))):
            break
        kept = np.delete(kept, off.argmax())
    return pointing, kept


# -- What the published methods need before they can begin, and how they refuse -----------------

WIDEST_DEG = 40.0  # pairs further apart are not tabled: most of the sky's pairs would be


def known_focal(hint: Hint | None) -> float | None:
    """Focal length, px, at the geometric middle of the hint's range of scale; None without one."""
    focal_px = hint.focal_px if hint else None
    return math.sqrt(math.prod(focal_px)) if focal_px else None


def table_deg(detections: Detections, focal_px: float) -> float:
    """The largest separation the frame can hold, whole degrees up, at most ``WIDEST_DEG``."""
    diagonal = np.hypot(detections.width, detections.height)
    return float(min(np.ceil(np.degrees(2.0 * np.arctan(diagonal / 2.0 / focal_px))), WIDEST_DEG))


@frozen
class AngularMethod(ABC):
    """A method that compares angles between stars, so that it has to know the scale.

    ``fewest`` is how many stars it can work with, ``needs`` what a person is asked for without a scale.
    """

    fewest: ClassVar[int]
    needs: ClassVar[str] = "Give the field of view: this method compares angles."

    def identify(self, detections: Detections, hint: Hint | None = None, year: float = 2016.0) -> Task[Answer]:
        """Name the stars of one frame; see :class:`kochab.identification.Identifier`."""
        return with_places(detections, lambda listed: self._begin(listed, hint, year))

    def _begin(self, listed: Detections, hint: Hint | None, year: float) -> Task[Answer]:
        focal = self.focal_px(listed, hint)
        if focal is None:
            return refused(listed, "nothing: the scale is unknown", self.needs)
        if len(listed) < self.fewest:
            tried = f"{len(listed)} stars, at least {self.fewest} are needed"
            advice = "Expose longer or point at a richer part of the sky."
            return NoSolution(Reason.TOO_FEW_STARS, advice, tried, len(listed))
        return (yield from self.search(listed, focal, hint, year))

    def focal_px(self, detections: Detections, hint: Hint | None) -> float | None:
        """The focal length it takes, px; None when it is not known."""
        return known_focal(hint)

    @abstractmethod
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


def refused(detections: Detections, tried: str, advice: str = "") -> NoSolution:
    """The method could not begin, or its names did not hold."""
    advice = advice or "Check the field of view, or use the method 'patterns'."
    return NoSolution(Reason.NO_PATTERN_AGREED, advice, tried, len(detections))
