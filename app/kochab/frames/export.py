"""A solution as CSV or DS9 regions, and where its north is."""

import csv
import io
from collections.abc import Iterable

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import east_north, unit
from kochab.core.solution import Solution

_COLUMNS = ("x", "y", "id", "name", "mag", "ra_deg", "dec_deg", "residual_px")
_REGION_RADIUS_PX = 8.0


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """Rows as CSV, a line each."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def stars_csv(solution: Solution) -> str:
    """The identified stars, one a line, brightest first, with a line of column names.

    ``x``, ``y`` are px from the centre of the first pixel; degrees are ICRS; ``mag`` is V.
    """
    rows: list[tuple[object, ...]] = [_COLUMNS]
    for star in sorted(solution.stars, key=lambda s: s.mag):
        place = f"{star.mag:.2f}", f"{star.ra_deg:.6f}", f"{star.dec_deg:.6f}", f"{star.residual_px:.3f}"
        rows.append((f"{star.x:.3f}", f"{star.y:.3f}", star.id, star.name, *place))
    return csv_text(rows)


def ds9_regions(solution: Solution) -> str:
    """A region file for SAOImage DS9, in ASCII: a circle on the sky for every identified star."""
    radius = _REGION_RADIUS_PX * solution.camera.scale_arcsec_px
    lines = ["# Region file format: DS9 version 4.1", "global color=green", "icrs"]
    for star in solution.stars:
        label = (star.ascii_name or star.id).replace("{", "(").replace("}", ")")
        place = f"{star.ra_deg:.6f},{star.dec_deg:.6f}"
        lines.append(f'circle({place},{radius:.3f}") # text={{{label}}}')
    return "\n".join(lines) + "\n"


def compass(solution: Solution) -> tuple[Floats, Floats]:
    """Unit vectors (2,) on the screen (x right, y down) towards north and east at the centre."""
    camera = solution.camera
    middle = np.array([(camera.width - 1) / 2.0, (camera.height - 1) / 2.0])
    centre = solution.centre_vector
    ends = centre + 2.0 / camera.focal_px * east_north(centre)  # some two pixels away
    east, north = unit(solution.pixels_of(unit(ends)) - middle)
    return north, east
