"""What a solution is written as, besides WCS and JSON: CSV, DS9 regions, an annotated picture."""

import csv
import io
import os

from app.core.frame import Frame
from app.core.solution import Solution
from app.frames.whole_file import write_whole

_COLUMNS = ("x", "y", "id", "name", "mag", "ra_deg", "dec_deg", "residual_px")
_REGION_RADIUS_PX = 8.0


def stars_csv(solution: Solution) -> str:
    """The identified stars, one a line, brightest first, with a line of column names.

    ``x``, ``y`` are px from the centre of the first pixel; degrees are ICRS; ``mag`` is V.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for star in sorted(solution.stars, key=lambda s: s.mag):
        writer.writerow([
            f"{star.x:.3f}", f"{star.y:.3f}", star.id, star.name, f"{star.mag:.2f}",
            f"{star.ra_deg:.6f}", f"{star.dec_deg:.6f}", f"{star.residual_px:.3f}",
        ])  # fmt: skip
    return text.getvalue()


def ds9_regions(solution: Solution) -> str:
    """A region file for SAOImage DS9: a circle on the sky for every identified star."""
    radius = _REGION_RADIUS_PX * solution.camera.scale_arcsec_px
    lines = ["# Region file format: DS9 version 4.1", "global color=green", "icrs"]
    for star in solution.stars:
        label = (star.name or star.id).replace("{", "(").replace("}", ")")
        place = f"{star.ra_deg:.6f},{star.dec_deg:.6f}"
        lines.append(f'circle({place},{radius:.3f}") # text={{{label}}}')
    return "\n".join(lines) + "\n"


def write_csv(solution: Solution, path: str | os.PathLike[str]) -> None:
    """Write `stars_csv`; raises OSError when that is not possible."""
    write_whole(path, stars_csv(solution))


def write_regions(solution: Solution, path: str | os.PathLike[str]) -> None:
    """Write `ds9_regions`; raises OSError when that is not possible."""
    write_whole(path, ds9_regions(solution))


def annotate(frame: Frame, solution: Solution, path: str | os.PathLike[str]) -> None:
    """Write the stretched frame with its stars, grid and north: a JPEG by its suffix, else a PNG.

    Raises OSError when that is not possible.
    """
    from app.frames.annotated import annotated_picture

    picture = annotated_picture(frame, solution)
    packed = io.BytesIO()
    if str(os.fspath(path)).lower().endswith((".jpg", ".jpeg")):
        picture.save(packed, format="JPEG", quality=92)
    else:
        picture.save(packed, format="PNG", compress_level=4)
    write_whole(path, packed.getvalue())
