"""Does a set of names hold? From supposed names to an answer, or to nothing.

The methods that compare angular separations end with names and no measure of trust, so all of them
end here. Two of the named stars, the proposers, fix rotation and focal length; the evidence is how
many of the other detections then fall on catalogue stars, against what chance would give
(:mod:`app.identify.chance`), after counting every pair of catalogue stars the method looked at.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.attitude.wahba import wahba
from app.core.attitude import Attitude
from app.core.camera import Camera
from app.core.detections import Detections
from app.core.solution import Identification, Matches
from app.identify.chance import ACCEPT_LOG10, log10_false_alarm
from app.identify.verify import RADII, Pointing, pair, refit
from app.sky import open_catalogue

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

WITNESSES = 40  # so many of the brightest detections may testify
PROPOSERS = 15  # so many pairs of named stars, the widest first, are let propose
FEWEST = 3
ODD, ODD_PX = 5.0, 3.0  # a name is dropped beyond so many times the median error, and so many px


@dataclass(frozen=True, slots=True, eq=False)
class Names:
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
    detections: Detections, names: Names, focal_px: float, reach_px: float, year: float, method: str
) -> Identification | None:
    """The answer that ``names`` amount to, or None when chance could explain them.

    ``reach_px`` is the error allowed in a star's place; names further off are dropped.
    """
    if len(names.detection) < FEWEST:
        return None
    half = np.array([(detections.width - 1) / 2.0, (detections.height - 1) / 2.0])
    seen = detections.xy - half
    try:
        start = _start(detections, names, focal_px)
    except ValueError:  # all in one direction
        return None
    witnesses = seen[:WITNESSES]
    corner = float(np.hypot(*half)) + 3.0 * reach_px
    catalogue = open_catalogue()
    radius = min(1.1 * float(np.arctan(corner / focal_px)), 1.4)
    rows = catalogue.brightest(start.matrix[2], radius, 2 * len(witnesses) + 5, year)
    sky = catalogue.vectors(rows, year)
    best = 0.0
    for two in _widest(seen[names.detection]):
        pointing = start
        for _ in range(3):
            pointing = refit(
                pointing,
                seen[names.detection[two]],
                *pointing.project(names.vectors[two]),
                bend=False,
            )
        if abs(np.log(pointing.focal / focal_px)) < 0.1:
            others = np.delete(witnesses, names.detection[two][names.detection[two] < WITNESSES], 0)
            best = min(best, _tail(pointing, others, sky, half, reach_px))
    parities = 2 if names.mirrored is None else 1
    alarm = min(0.0, best + np.log10(max(1, names.tried * parities)))
    if alarm > ACCEPT_LOG10:
        return None
    return _answer(detections, names, start, seen, reach_px, float(alarm), method)


def _start(detections: Detections, names: Names, focal_px: float) -> Pointing:
    """The pointing of the parity that suits the names better."""
    best, least = None, np.inf
    for mirrored in (False, True) if names.mirrored is None else (names.mirrored,):
        camera = Camera.centred(detections.width, detections.height, focal_px, mirrored)
        body = camera.unproject(detections.xy[names.detection])
        matrix = wahba(body, names.vectors).matrix
        left = float(np.square(body - names.vectors @ matrix.T).sum())
        if best is None or left < least:
            best, least = Pointing(matrix, focal_px, mirrored), left
    assert best is not None
    return best


def _widest(xy: Floats) -> list[Ints]:
    i, j = np.triu_indices(len(xy), 1)
    order = np.argsort(-np.hypot(*(xy[i] - xy[j]).T), kind="stable")[:PROPOSERS]
    return [np.array([i[k], j[k]]) for k in order]


def _tail(pointing: Pointing, seen: Floats, sky: Floats, half: Floats, reach_px: float) -> float:
    """log10 of the chance that one pointing agrees so well with stars that did not propose it."""
    xy, _ = pointing.project(sky)
    xy = xy[(np.abs(xy) < half).all(axis=1)]
    _, _, d2 = pair(seen, xy, reach_px)
    radii = reach_px / np.sqrt(2.0) ** np.arange(RADII)
    matched = np.searchsorted(np.sort(d2), radii**2)
    area = float(4.0 * half[0] * half[1])
    return min(
        log10_false_alarm(
            int(m), len(seen), len(xy), r, area, reach_px=reach_px, radii=RADII, candidates=1,
            free=0,
        )
        for m, r in zip(matched, radii.tolist(), strict=True)
    )  # fmt: skip


def _answer(
    detections: Detections, names: Names, start: Pointing, seen: Floats, reach_px: float,
    alarm: float, method: str,
) -> Identification | None:  # fmt: skip
    """Fit rotation and focal length to the names, dropping the worst while it is too far off."""
    kept = np.arange(len(names.detection))
    while len(kept) >= FEWEST:
        pointing = start
        for _ in range(3):
            pointing = refit(
                pointing,
                seen[names.detection[kept]],
                *pointing.project(names.vectors[kept]),
                bend=False,
            )
        gap = pointing.project(names.vectors[kept])[0] - seen[names.detection[kept]]
        off = np.hypot(gap[:, 0], gap[:, 1])
        limit = max(ODD_PX, ODD * float(np.median(off)))
        if off.max() <= min(reach_px, limit):
            break
        kept = np.delete(kept, off.argmax())
    else:
        return None
    chosen = names.detection[kept]
    matches = Matches(chosen, names.rows[kept], detections.xy[chosen], names.vectors[kept])
    camera = Camera.centred(
        detections.width, detections.height, pointing.focal, pointing.mirrored
    )  # fmt: skip
    return Identification(
        matches, camera, Attitude(pointing.matrix), alarm, method, max(1, names.tried)
    )
