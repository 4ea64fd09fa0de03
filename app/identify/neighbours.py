"""Neighbours: each star is told by its two nearest, and by the angle between them.

The Initial Estimate of Liebe (1992, IEEE Aerosp. Electron. Syst. Mag. 7(6), 34): stars whose second
neighbour is nearer than the rim of the picture are looked up in the star database
(:mod:`app.identify.neighbours_table`), and of the few candidates those are right whose distances
are those measured. Parity is free, as no feature has a sense of turning.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from app.attitude.wahba import wahba
from app.core.camera import Camera
from app.core.detections import Detections
from app.core.hint import Hint
from app.core.options import integer, number, switch
from app.core.progress import Progress, Task
from app.core.solution import Identification, NoSolution
from app.identify.confirm import Names, confirm
from app.identify.neighbours_table import NeighbourTable, Quanta, angle_at, catalogue_table
from app.identify.refusals import known_focal, no_scale, not_agreed, too_few

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FEWEST = 3
SEEDS = 6  # so many candidates, the best supported first, are let gather others around them
DEPTHS = (1.0, 0.7, 1.4, 0.5, 2.0)  # times the expected number of stars, brightest first
MOST_CANDIDATES = 1500


@dataclass(frozen=True, slots=True)
class Neighbours:
    """The method and its options, the paper's values as defaults; they suit a field of 30 deg.

    The camera of the paper sees stars down to a fixed brightness. A list may go deeper: of a
    longer one, as many of the brightest are taken as the catalogue's stars would fill the frame
    with on the average, then some fewer and more.
    """

    paper: ClassVar[str] = "Liebe 1992, Initial Estimate"

    brightest: int = integer(
        1107, "stars", 200, 20000, "of the catalogue, above the limit of detection"
    )
    spread: float = number(0.25, "", 0.0, 0.9, "uncertainty of a brightness, as a share of it")
    tolerance_deg: float = number(0.05, "deg", 0.0005, 0.5, "largest error of a star's place")
    distance_step_deg: float = number(0.1, "deg", 0.001, 1.0, "class of a distance")
    angle_step_deg: float = number(5.0, "deg", 0.5, 45.0, "class of an angle")
    angle_errors: float = number(1.0, "", 1.0, 3.0, "times the error of an angle (figure 11: 2)")
    exchange: float = number(4.0, "tolerances", 0.0, 10.0, "neighbours so near change places")
    double_deg: float = number(0.1, "deg", 0.0, 1.0, "closer stars are a double: maybe seen")
    circle: bool = switch(False, "only the circle within the frame is the picture")

    def identify(
        self, detections: Detections, hint: Hint | None = None, year: float = 2016.0
    ) -> Task[Identification | NoSolution]:
        """Name the stars of one frame; see :class:`app.identify.Identifier`."""
        focal = known_focal(detections, hint)
        if focal is None:
            return no_scale(detections)
        finite = np.isfinite(detections.xy).all(axis=1)
        if int(finite.sum()) < FEWEST:
            return too_few(detections, FEWEST)
        yield Progress("identify", 0.0, "neighbours of every catalogue star")
        table = self.table(year)
        yield Progress("identify", 0.5, "candidates")
        camera = Camera.centred(detections.width, detections.height, focal)
        tried = 0
        for depth in self._depths(int(finite.sum()), camera):
            chosen = np.flatnonzero(finite)[:depth]
            body = camera.unproject(detections.xy[chosen])
            rim_deg = _rim_deg(detections.xy[chosen], camera, self.circle)
            found, compared = self.recognise(body, rim_deg, table)
            tried += compared
            for seen, star in found:
                if float(np.ptp(body[seen], axis=0).max()) < 1e-6:
                    continue  # one place, listed twice
                names = self._all(body, seen, star, table)
                told = Names(chosen[names[0]], table.rows[names[1]], table.vectors[names[1]],
                             2 * max(1, tried))  # fmt: skip
                reach = max(2.0, 2.0 * np.radians(self.tolerance_deg) * focal)
                sure = confirm(detections, told, focal, reach, year, "neighbours")
                if sure is not None:
                    return sure
        return not_agreed(detections, f"{tried} pairs of candidates compared")

    def table(self, year: float = 2016.0) -> NeighbourTable:
        """The star database for these options; made once, in a fraction of a second."""
        quanta = Quanta(
            self.tolerance_deg, self.distance_step_deg, self.angle_step_deg, self.exchange,
            self.angle_errors,
        )  # fmt: skip
        return catalogue_table(self.brightest, self.spread, self.double_deg, quanta, year)

    def recognise(
        self, body: Floats, rim_deg: Floats, table: NeighbourTable
    ) -> tuple[list[tuple[Ints, Ints]], int]:
        """Sets of (detection, star) that agree, the largest first, and how many pairs were tried.

        ``body`` (n, 3) are the directions in the camera and ``rim_deg`` (n,) how far each is from
        the rim of the picture.
        """
        detection, star = self.candidates(body, rim_deg, table)
        if not 0 < len(star) <= MOST_CANDIDATES:
            return [], 0
        seen = _apart(body[detection])
        real = _apart(table.vectors[star])
        suits = np.abs(seen - real) <= np.radians(2.0 * self.tolerance_deg)
        suits &= (detection[:, None] != detection) & (star[:, None] != star)
        sets: dict[tuple[int, ...], None] = {}
        for seed in np.argsort(-suits.sum(axis=1), kind="stable")[:SEEDS]:
            kept = _gathered(int(seed), suits, detection)
            if len(kept) >= 2:
                sets[tuple(sorted(kept))] = None
        order = sorted((np.array(kept) for kept in sets), key=len, reverse=True)
        compared = len(star) * (len(star) - 1) // 2
        return [(detection[kept], star[kept]) for kept in order], compared

    def candidates(self, body: Floats, rim_deg: Floats, table: NeighbourTable) -> tuple[Ints, Ints]:
        """Detections whose triplet is whole, and every star of the database that fits, (C,)."""
        if len(body) < FEWEST:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        gap = np.degrees(_apart(body))
        np.fill_diagonal(gap, np.inf)
        near = np.argsort(gap, axis=1, kind="stable")[:, :2]
        distance = np.take_along_axis(gap, near, axis=1)
        whole = np.flatnonzero(distance[:, 1] <= rim_deg)
        near, distance = near[whole], distance[whole]
        angle = angle_at(body[whole], body[near[:, 0]], body[near[:, 1]])
        key = Quanta(
            step_deg=self.distance_step_deg, angle_step_deg=self.angle_step_deg
        ).key(distance[:, 0], distance[:, 1], angle)  # fmt: skip
        which, star = table.find(key)
        return whole[which].astype(np.int64), star

    def _all(
        self, body: Floats, seen: Ints, star: Ints, table: NeighbourTable
    ) -> tuple[Ints, Ints]:
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


def _gathered(seed: int, suits: NDArray[np.bool_], detection: Ints) -> list[int]:
    """Candidates that all agree with each other, one a detection, around ``seed``."""
    kept = [seed]
    open_ = suits[seed].copy()
    while open_.any():
        support = (suits & open_).sum(axis=1)
        nxt = int(np.where(open_, support, -1).argmax())
        kept.append(nxt)
        open_ &= suits[nxt] & (detection != detection[nxt])
    return kept


def _apart(vectors: Floats) -> Floats:
    """Angles (N, N), radians, between unit vectors (N, 3)."""
    chord = np.linalg.norm(vectors[:, None] - vectors, axis=2)
    return np.asarray(2.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)))


def _rim_deg(xy: Floats, camera: Camera, circle: bool) -> Floats:
    """How far places (N, 2) px are from the nearest point of the picture's rim, degrees."""
    size = np.array([camera.width, camera.height], dtype=np.float64)
    middle = (size - 1.0) / 2.0
    body = camera.unproject(xy)
    if circle:
        half = np.arctan(size.min() / 2.0 / camera.focal_px)
        axis = camera.unproject(middle[None])[0]
        return np.asarray(np.degrees(half - np.arccos(np.clip(body @ axis, -1.0, 1.0))))
    nearest = np.full(len(xy), np.inf)
    for axis_number in (0, 1):
        for edge in (-0.5, size[axis_number] - 0.5):
            foot = xy.copy()
            foot[:, axis_number] = edge
            nearest = np.minimum(nearest, np.linalg.norm(body - camera.unproject(foot), axis=1))
    return np.asarray(np.degrees(2.0 * np.arcsin(np.minimum(nearest / 2.0, 1.0))))
