"""Geometric voting: every pair of detections votes for the stars of every pair as far apart.

Kolomenkin, Pollak, Shimshoni and Lindenbaum (2008, IEEE Trans. Aerosp. Electron. Syst. 44, 441) as in the thesis
"Lost in space for robotic telescopes", 2018, chapter 5.3 and algorithms 1 and 2. The thesis' linear and binary
searches take 12 to 87 s a frame; here all ranges are looked up in one call and the votes counted in another.
"""

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats, Ints
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.progress import Progress, Task
from kochab.core.registry import integer, number
from kochab.core.values import frozen
from kochab.identification import Answer
from kochab.lab.methods.confirmation import AngularMethod, CandidateNames, confirm, refused, table_deg
from kochab.lab.methods.pairs import Pairs, angles_between, between, catalogue_pairs, spread


@frozen
class Voting(AngularMethod):
    """The method and its options, the thesis' values as defaults.

    The ``e`` of equation 5.6 is ``margin_px`` times the pixel scale. The thesis also leaves out
    the dozen stars brighter than magnitude 1; here they take part.
    """

    paper: ClassVar[str] = "Lost in space for robotic telescopes, 2018, section 5.3"
    fewest: ClassVar[int] = 6  # the thesis' figure 7.12: with fewer no star is ever named

    stars: int = integer(15, "stars", 6, 30, "brightest detections that vote (section 6.2: 15)")
    margin_px: float = number(2.464, "px", 0.1, 20.0, "error allowed in a separation (chapter 7: 2.464)")
    mag_limit: float = number(5.9, "mag V", 3.0, 6.5, "faintest catalogue star (5.3.1: 5.9)")

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
        yield Progress("identify", 0.0, "pairs of catalogue stars")
        # The table need be no wider than the frame: no pair of detections is farther apart.
        pairs = catalogue_pairs(table_deg(detections, focal), mag_limit=self.mag_limit, year=year)
        yield Progress("identify", 0.5, "votes")
        camera = Camera.centred(detections.width, detections.height, focal)
        body = camera.unproject(detections.xy[: self.stars])
        kept, star, tried = recognise(body, pairs, self.margin_px / focal)
        names = CandidateNames(kept, pairs.rows[star], pairs.vectors[star], tried)
        found = confirm(detections, names, focal, 2.0 * self.margin_px, year, "voting")
        return found or refused(detections, f"{len(kept)} of {len(body)} named stars agree, too few to be sure")


def recognise(body: Floats, pairs: Pairs, error_rad: float) -> tuple[Ints, Ints, int]:
    """Both rounds: the detections that keep a name (K,), their stars (K,), and what was tried."""
    winner, votes, tried = vote(body, pairs, error_rad)
    # A name needs a vote at all: argmax gives star 0 to a detection without any.
    agreed = verification_votes(body, pairs.vectors[winner], votes > 0, error_rad)
    kept = np.flatnonzero((agreed == agreed.max()) & (agreed > 0))  # equation 5.7
    # of detections with the same name the one with more votes, then the brighter
    order = kept[np.argsort(-votes[kept], kind="stable")]
    _, once = np.unique(winner[order], return_index=True)
    kept = np.sort(order[once])
    return kept, winner[kept], tried


def vote(body: Floats, pairs: Pairs, error_rad: float) -> tuple[Ints, Ints, int]:
    """The initial round (section 5.3.2) over unit vectors ``body`` (n, 3).

    Returns the star of ``pairs`` with the most votes for each detection (n,), its votes (n,), and
    how many comparisons of a pair with a pair, each way round, cast them.
    """
    n = len(body)
    i, j = np.triu_indices(n, 1)
    angle = angles_between(body[i], body[j])
    which, number = spread(*between(pairs.angle, angle - error_rad, angle + error_rad))
    first, second = pairs.first[number], pairs.second[number]
    # A pair has no direction: either detection may be either star, so each match casts four votes.
    seats = np.concatenate([i[which], i[which], j[which], j[which]]) * pairs.stars
    seats += np.concatenate([first, second, first, second])
    table = np.bincount(seats, minlength=n * pairs.stars).reshape(n, pairs.stars)
    winner = table.argmax(axis=1).astype(np.int64)  # of equal ones the brightest
    return winner, table[np.arange(n), winner].astype(np.int64), 2 * len(number)


def verification_votes(body: Floats, named: Floats, valid: NDArray[np.bool_], error_rad: float) -> Ints:
    """The final round (section 5.3.3): for each detection, how many others its name suits.

    A pair of detections taken for the same star agrees with nothing.

    Parameters
    ----------
    body : Floats
        Directions of the detections (n, 3), camera axes.
    named : Floats
        Those of the stars they were taken for (n, 3), ICRS.
    valid : NDArray[np.bool_]
        Whether each has a name (n,).
    error_rad : float
        How far separations may differ.
    """
    seen, real = angles_between(body[:, None], body), angles_between(named[:, None], named)
    # real > 0 rules out the diagonal too.
    suits = (np.abs(seen - real) <= error_rad) & (real > 0.0)
    suits &= valid[:, None] & valid[None]
    return np.asarray(suits.sum(axis=1), dtype=np.int64)
