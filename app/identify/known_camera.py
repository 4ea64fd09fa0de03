"""When the quick road of a known camera is taken, and what its answer is made of."""

from app.core.detections import Detections
from app.core.progress import Progress, Task
from app.core.solution import Identification
from app.identify.answer import answered
from app.identify.index import Volume
from app.identify.known_search import BRIGHTEST, FEW, POOR, KnownSearch
from app.identify.known_table import DENSE, SPARSE, table_for
from app.identify.known_triangles import Sight
from app.identify.search import Search

FEWEST, MOST = 3, 24
"""So many detections are looked at so; of more the quads make as short work without a table."""
COMPLETE = 6
"""Of so many detections quads have found none that triangles had not."""
KNOWN, ROUGHLY = 1.03, 1.25
"""Highest over lowest scale: of any frame, and of one with few stars."""


def known_camera(
    search: Search, volumes: tuple[Volume, ...], year: float
) -> tuple[KnownSearch, ...]:
    """The searches by triangles to make; none where the scale or the field is not for them.

    Where the stars are so few that chance has room, a table of fewer stars is asked first.
    """
    low, high = search.scale
    poor = len(search.xy) <= POOR
    if high > low * (ROUGHLY if poor else KNOWN) or not FEWEST <= len(search.xy) <= MOST:
        return ()
    field_deg = search.field_deg((low * high) ** 0.5)
    wanted = (SPARSE, DENSE) if len(search.xy) <= FEW else (DENSE,)
    tables = [table_for(volumes, field_deg, year, density) for density in wanted]
    there = [table for table in tables if table is not None]
    if not there:
        return ()
    asked = POOR if poor and high <= low * KNOWN else BRIGHTEST
    sight = Sight.of(search.xy[:asked], search.scale)
    search.ways = len(there) + (len(search.xy) > COMPLETE)
    return tuple(KnownSearch(t, search.xy, search.half, sight, search.ways) for t in there)


def first_answer(
    search: Search, searches: tuple[KnownSearch, ...], detections: Detections
) -> Task[Identification | None]:
    """What the triangles say, if they say anything where the hint allows it."""
    for known in searches:
        yield Progress("identify", 0.0, "triangles of the known camera")
        for verdict in known.verdicts():
            p = verdict.pointing
            if search.centre is None or search.allows(p.matrix[2], p.focal):
                table = known.table
                return answered(
                    verdict, detections, table.rows, table.vectors, verdict.log10_tail, known.tried
                )
        search.least = min(search.least, known.least)
        search.before += known.tried
        search.asked += known.triangles
    return None
