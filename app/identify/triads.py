"""Triads: three detections at a time against catalogue stars as far apart and turned alike.

The thesis "Attitude from stellar images", chapter 2.3: angular separations of the brightest
detections, lists of catalogue pairs, triads, the rotation-angle test (2.3.4.1), the enclosed-angle
test (2.3.4.2), grouping by mean rotation, votes with a `vote number`, multiple stars merged and the
final check of separations (2.3.4.3). The rooms: :mod:`app.identify.triad_search` finds triads,
:mod:`app.identify.triad_votes` groups and names.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from app.core.detections import Detections
from app.core.hint import Hint
from app.core.options import integer, number, pair, switch
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

    ``field_deg`` is for frames whose pixels are not square: separations then follow equation 2.4
    with a scale for each axis, as in the thesis; otherwise the scale of the hint and the gnomonic
    camera are used. ``planar`` takes right ascension and declination for plane coordinates in the
    rotation-angle test, as the thesis does for the sake of its processor. That fails far from the
    equator; the default does it on the sphere, which the thesis recommends where floats are at
    hand.
    """

    paper: ClassVar[str] = "Attitude from stellar images, chapter 2"

    stars: int = integer(12, "stars", 3, 15, "brightest detections used")
    separation_deg: float = number(0.15, "deg", 0.001, 1.0, "tolerance of a separation")
    rotation_deg: float = number(5.0, "deg", 0.1, 20.0, "tolerance of the rotation-angle test")
    enclosed_deg: float = number(1.0, "deg", 0.1, 20.0, "tolerance of the enclosed-angle test")
    group_deg: float = number(5.0, "deg", 0.1, 20.0, "tolerance of grouping by rotation")
    vote_number: int = integer(2, "triads", 1, 50, "fewest triads that give a star its name")
    merge_px: float = number(
        8.0, "px", 0.0, 50.0, "catalogue stars closer than this are seen as one"
    )
    mag_limit: float = number(6.0, "mag V", 3.0, 7.0, "faintest catalogue star")
    dec_deg: tuple[float, float] = pair(
        (-90.0, 90.0), "deg", -90.0, 90.0, "declinations searched (the thesis: 30 to 90)"
    )
    field_deg: tuple[float, float] | None = pair(
        None, "deg", 0.1, 40.0, "width and height of the frame", "by the hint's scale"
    )
    planar: bool = switch(False, "rotations in plane coordinates, as the thesis has them")

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
