"""Triads: three detections at a time against catalogue stars as far apart and turned alike.

The thesis "Attitude from stellar images", chapter 2.3: angular separations of the brightest
detections, lists of catalogue pairs, triads, the rotation-angle test (2.3.4.1), the enclosed-angle
test (2.3.4.2), grouping by mean rotation, votes with a `vote number`, multiple stars merged and the
final check of separations (2.3.4.3). The rooms: :mod:`app.identify.triad_search` finds triads,
:mod:`app.identify.triad_votes` groups and names.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.core.detections import Detections
from app.core.hint import Hint
from app.core.progress import Progress, Task
from app.core.solution import Identification, NoSolution
from app.identify.confirm import Names, confirm
from app.identify.pairs import catalogue_pairs
from app.identify.refusals import known_focal, no_scale, not_agreed, table_deg, too_few
from app.identify.triad_search import Sight, Tests, find_triads
from app.identify.triad_votes import agreeing, grouped, named

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Triads:
    """The method and its options, the thesis' values (section 4.2.1) as defaults.

    Parameters
    ----------
    stars : int
        Brightest detections, 3 to 15 (12).
    separation_deg : float
        Tolerance of a separation, degrees, 0.001 to 1 (0.15).
    rotation_deg, enclosed_deg, group_deg : float
        Tolerances of the rotation-angle test, the enclosed-angle test and of grouping, degrees,
        0.1 to 20 (5, 1, 5).
    vote_number : int
        Fewest triads that must give a star its name, 1 to 50 (2).
    merge_px : float
        Catalogue stars closer than this are seen as one, px, 0 to 50 (8, the clustering radius).
    mag_limit : float
        Faintest catalogue star, V, 3 to 7 (6.0).
    dec_deg : (float, float)
        Declinations searched, degrees. The thesis had 30 to 90; the whole sky is the default.
    field_deg : (float, float), optional
        Width and height of the frame, degrees, when its pixels are not square: separations then
        follow equation 2.4 with a scale for each axis, as in the thesis. Otherwise the scale of
        the hint and the gnomonic camera are used.
    planar : bool
        Take right ascension and declination for plane coordinates in the rotation-angle test, as
        the thesis does for the sake of its processor. It fails far from the equator; the default
        does it on the sphere, which the thesis recommends (section 4.2.1) where floats are at hand.

    """

    stars: int = 12
    separation_deg: float = 0.15
    rotation_deg: float = 5.0
    enclosed_deg: float = 1.0
    group_deg: float = 5.0
    vote_number: int = 2
    merge_px: float = 8.0
    mag_limit: float = 6.0
    dec_deg: tuple[float, float] = (-90.0, 90.0)
    field_deg: tuple[float, float] | None = None
    planar: bool = False

    def identify(
        self, detections: Detections, hint: Hint | None = None, year: float = 2016.0
    ) -> Task[Identification | NoSolution]:
        """Name the stars of one frame; see :class:`app.identify.Identifier`."""
        focal = known_focal(detections, hint)
        if self.field_deg is not None:
            focal = detections.width / 2.0 / float(np.tan(np.radians(self.field_deg[0]) / 2.0))
        if focal is None:
            return no_scale(detections)
        if len(detections) < 3:
            return too_few(detections, 3)
        yield Progress("identify", 0.0, "pairs of catalogue stars")
        pairs = catalogue_pairs(
            table_deg(detections, focal), mag_limit=self.mag_limit, year=year
        ).within_declinations(*self.dec_deg)
        tests = Tests(*np.radians([self.separation_deg, self.rotation_deg, self.enclosed_deg]))
        reach = max(np.radians(self.separation_deg) * focal, 3.0)
        merge = self.merge_px * self._widest_pixel(detections, focal)
        tried = most = 0
        for step, mirrored in enumerate((False, True)):
            sight = Sight.of(detections, self.stars, focal, mirrored, self.field_deg)
            triads, looked = yield from find_triads(sight, pairs, tests, self.planar, step / 2.0)
            tried += looked
            groups = grouped(triads, np.radians(self.group_deg))
            for group in groups:
                if len(group) < len(groups[0]):
                    break  # only the groups with the most triads are considered
                votes = named(triads, group, len(sight.body), pairs, self.vote_number, merge)
                stars = agreeing(*votes, sight.separation, pairs, tests.separation)
                kept = np.flatnonzero(stars >= 0)
                most = max(most, len(kept))
                rows, vectors = pairs.rows[stars[kept]], pairs.vectors[stars[kept]]
                names = Names(kept, rows, vectors, 2 * tried, mirrored)
                found = confirm(detections, names, focal, reach, year, "triads")
                if found is not None:
                    return found
        return not_agreed(detections, f"{most} stars got names, too few to be sure")

    def _widest_pixel(self, detections: Detections, focal_px: float) -> float:
        """The larger side of a pixel on the sky, radians."""
        if self.field_deg is None:
            return 1.0 / focal_px
        wide, high = np.radians(self.field_deg)
        return float(max(wide / detections.width, high / detections.height))
