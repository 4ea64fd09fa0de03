"""The Predictional Estimate as a method of its own, for frames whose place is known.

Liebe (1992, IEEE Aerosp. Electron. Syst. Mag. 7(6), 34); the estimate itself is in
:mod:`kochab.identification.predictional_estimate`. The paper's prediction comes from the rotation
of the satellite. Here it is what a person or a mount says: place and scale, from which all predictions are tried
that could be meant, over the unknown roll and the radius around the place.
"""

from dataclasses import replace
from typing import ClassVar

import numpy as np
from scipy.spatial import cKDTree

from kochab.core.arrays import Floats, Ints
from kochab.core.attitude import Attitude, attitude_from, radec_deg
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.pairing import mutual_nearest_of_few
from kochab.core.progress import Progress, Task
from kochab.core.registry import choice, integer, number
from kochab.core.solution import Identification, Matches
from kochab.core.values import frozen
from kochab.identification import Answer
from kochab.identification.predictional_estimate import expected_px, predictional_estimate
from kochab.identification.verification import ACCEPT_LOG10, CandidatePointing, chance_of, improve
from kochab.lab.methods.confirmation import AngularMethod, refused
from kochab.sky import open_catalogue

LOOKED_AT = 40  # so many predictions, the best supported first, are refined
BATCH = 256
SCALES = (1.0, 0.93, 1.075)  # a hint's range is a tenth to either side


@frozen
class Predict(AngularMethod):
    """The method and its options."""

    paper: ClassVar[str] = "Liebe 1992, Predictional Estimate"
    fewest: ClassVar[int] = 6
    needs: ClassVar[str] = "Give coordinates and the field of view: this method refines a known pointing."

    stars: int = integer(40, "stars", 6, 200, "brightest detections matched")
    roll_deg: float | None = number(
        None, "deg", -360.0, 360.0, "position angle of the frame's up, east of north", none="every roll is tried"
    )
    parity: str = choice("either", ("either", "plain", "mirrored"), "whether the optics mirror")
    reach: float = number(0.25, "", 0.05, 0.5, "least distance that may match, over the stars' mean distance")
    most: int = integer(150_000, "predictions", 100, 1_000_000, "tried at most")

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
        if hint is None or hint.centre_deg is None:
            return refused(detections, "nothing: there is no prediction", self.needs)
        yield Progress("identify", 0.0, "the expected stars")
        xy = detections.xy[: self.stars]
        ra, dec, radius = hint.centre_deg
        camera = Camera.centred(detections.width, detections.height, focal)
        attitude, radius_rad = attitude_from(ra, dec, self.roll_deg or 0.0), float(np.radians(radius))
        rows, vectors = _sky(attitude, camera, radius_rad, len(xy), year)
        reach_px = self.reach * float(np.sqrt(camera.width * camera.height / len(xy)))
        trials = self._trials(attitude, camera, radius_rad, reach_px)
        parities = {"either": (False, True), "plain": (False,), "mirrored": (True,)}[self.parity]
        tried = len(trials) * len(SCALES) * len(parities)
        if tried > self.most:
            why = f"nothing: more than {tried - 1} predictions would have to be tried"
            advice = "Give a smaller radius around the place, or use the method 'patterns'."
            return refused(detections, why, advice)
        best = yield from _supported(trials, camera, parities, xy, vectors, reach_px)
        yield Progress("identify", 0.7, "differential refinement")
        for matrix, lens in best:
            found = _checked(matrix, lens, xy, vectors, reach_px, tried)
            if found is not None:
                pointing, i, j, alarm = found
                matches = Matches(i, rows[j], xy[i], vectors[j])
                plain = Camera.centred(detections.width, detections.height, pointing.focal, lens.mirrored)
                seen, attitude = replace(plain, k1=pointing.k1), Attitude(pointing.matrix)
                return Identification(matches, seen, attitude, alarm, "predict", tried)
        return refused(detections, f"{tried} predictions tried")

    def _trials(self, centre: Attitude, camera: Camera, radius_rad: float, reach_px: float) -> Floats:
        """Attitudes (T, 3, 3) no further than the reach from any that may be meant."""
        # On a grid of 1.2 reaches no place is farther than 0.85 reaches from a node.
        step = 1.2 * reach_px / camera.focal_px
        across = int(np.ceil(radius_rad / step))
        if self.roll_deg is None:
            half = float(np.hypot(camera.width, camera.height)) / 2.0
            # 0.7 of the half diagonal: there a step of roll moves a star by 1.2 reaches.
            turns = max(8, int(np.ceil(2.0 * np.pi * 0.7 * half / (1.2 * reach_px))))
            rolls = np.arange(turns) * 360.0 / turns
        else:
            rolls = np.array([self.roll_deg])
        if (2 * across + 1) ** 2 * len(rolls) > self.most:
            # Never tried: the caller sees that there are more than most and refuses. It spares making them all.
            return np.zeros((self.most + 1, 3, 3))
        steps = np.arange(-across, across + 1) * step
        dx, dy = (g.ravel() for g in np.meshgrid(steps, steps))
        inside = np.hypot(dx, dy) <= radius_rad + step
        # Nearest to the told place first, so that a tie of votes goes to the likelier one.
        order = np.argsort(np.hypot(dx, dy)[inside], kind="stable")
        axes = np.stack([dx[inside], dy[inside], np.ones(int(inside.sum()))], axis=1)[order]
        places = [radec_deg(axis) for axis in axes @ centre.matrix]
        return np.array([attitude_from(*place, roll).matrix for place in places for roll in rolls.tolist()])


def _sky(attitude: Attitude, camera: Camera, radius_rad: float, seen: int, year: float) -> tuple[Ints, Floats]:
    """Rows and vectors of the stars that may be expected: as bright as those seen, and some more.

    A field is as dense as it is: the number a square degree is that of the frame, over the disc
    that the frame may lie in.
    """
    catalogue = open_catalogue()
    half = float(np.arctan(np.hypot(camera.width, camera.height) / 2.0 / camera.focal_px))
    # The frame may lie anywhere within the told radius, so the stars of the whole disc are expected.
    whole = min(half + radius_rad, np.pi)
    frame = np.radians(camera.fov_deg[0]) * np.radians(camera.fov_deg[1])
    discs = 2.0 * np.pi * (1.0 - np.cos(whole)) / max(frame, 1e-12)
    rows = catalogue.brightest(attitude.boresight, whole, int(1.5 * seen * max(discs, 1.0)), year)
    return rows.astype(np.int64), catalogue.vectors(rows, year)


def _supported(
    trials: Floats, camera: Camera, parities: tuple[bool, ...], xy: Floats, vectors: Floats, reach_px: float
) -> Task[list[tuple[Floats, Camera]]]:
    """The predictions that put most detections near an expected star, best first."""
    found: list[tuple[int, Floats, Camera]] = []
    tree = cKDTree(vectors)
    lenses = [
        Camera.centred(camera.width, camera.height, camera.focal_px * scale, mirrored)
        for mirrored in parities
        for scale in SCALES
    ]
    for k, lens in enumerate(lenses):
        yield Progress("identify", 0.6 * k / len(lenses), "least distances")
        body = lens.unproject(xy)
        for start in range(0, len(trials), BATCH):
            part = trials[start : start + BATCH]
            sky = np.einsum("ni,tij->tnj", body, part)
            distance, _ = tree.query(sky, distance_upper_bound=reach_px / lens.focal_px)
            votes = np.isfinite(distance).sum(axis=1)
            # No batch can give more than the LOOKED_AT that are kept, so the others are dropped at once.
            best = np.argsort(-votes, kind="stable")[:LOOKED_AT]
            found.extend((int(votes[t]), part[t], lens) for t in best)
        found = sorted(found, key=lambda f: -f[0])[:LOOKED_AT]
    return [(matrix, lens) for _, matrix, lens in found]


def _checked(
    matrix: Floats, lens: Camera, xy: Floats, vectors: Floats, reach_px: float, tried: int
) -> tuple[CandidatePointing, Ints, Ints, float] | None:
    """The refined pointing, its matches and its false-alarm bound, when chance is excluded."""
    first = predictional_estimate(lens, matrix, xy, vectors, reach_px, closest_px=3.0)
    if first is None:
        return None
    middle = np.array([(lens.width - 1) / 2.0, (lens.height - 1) / 2.0])
    half = np.array([lens.width, lens.height]) / 2.0
    places = expected_px(lens, first.attitude.matrix, vectors) - middle
    near = np.flatnonzero((np.abs(places) < half + reach_px).all(axis=1))
    start = CandidatePointing(first.attitude.matrix, lens.focal_px, lens.mirrored, lens.k1)
    pointing = improve(start, xy - middle, vectors[near], reach_px, 5)
    if pointing is None or abs(np.log(pointing.focal / lens.focal_px)) > 0.1:
        return None
    places, _ = pointing.project(vectors[near])
    i, j, distance2 = mutual_nearest_of_few(xy - middle, places, reach_px)
    alarm, _ = chance_of(distance2, xy - middle, places, half, reach_px, free=5, candidates=tried)
    if alarm > ACCEPT_LOG10:
        return None
    usual = max(3.0, 5.0 * float(np.sqrt(np.median(distance2))))
    keep = distance2 <= min(usual, reach_px) ** 2
    return pointing, i[keep], near[j[keep]].astype(np.int64), alarm
