"""A solution as CSV, DS9 regions or an annotated image."""

import csv
import io
import os
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import east_north, unit
from kochab.core.frame import Frame
from kochab.core.solution import NamedStar, Solution
from kochab.frames.atomic_file import write_atomically
from kochab.frames.sky_grid import grid_lines, pieces
from kochab.frames.stretch import apply, debayer_preview, stretch_parameters, white_balanced

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw


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


def annotate(frame: Frame, solution: Solution, path: str | os.PathLike[str]) -> None:
    """Write the stretched frame with its stars, grid and north: a JPEG by its suffix, else a PNG.

    Raises OSError when that is not possible.
    """
    picture = annotated_picture(frame, solution)
    packed = io.BytesIO()
    if str(os.fspath(path)).lower().endswith((".jpg", ".jpeg")):
        picture.save(packed, format="JPEG", quality=92)
    else:
        picture.save(packed, format="PNG", compress_level=4)
    write_atomically(path, packed.getvalue())


_LONGEST_PX = 2400
_NAMES = 40
_STAR, _TEXT, _GRID, _NORTH, _EAST = "#35d07f", "#ffd166", "#3f6fb5", "#ff6b6b", "#6bb8ff"


def annotated_picture(frame: Frame, solution: Solution) -> "Image":
    """An RGB picture, thinned to at most 2400 px, with circles, names, grid and compass."""
    from PIL import Image, ImageDraw

    factor = max(1, -(-max(frame.width, frame.height) // _LONGEST_PX))
    shown = debayer_preview(frame, factor)
    colour = shown.ndim == 3
    levels = apply(shown, white_balanced(shown) if colour else stretch_parameters(shown))
    picture = Image.fromarray(levels).convert("RGB")
    scale = picture.width / frame.width
    draw = ImageDraw.Draw(picture)
    for line in grid_lines(solution, -0.5, -0.5, frame.width - 0.5, frame.height - 0.5):
        for part in pieces(line.xy):
            draw.line([(x, y) for x, y in ((part + 0.5) * scale - 0.5).tolist()], fill=_GRID)
    _draw_stars(draw, solution.stars, scale, picture.size)
    _draw_compass(draw, solution, picture.size)
    return picture


def _draw_stars(draw: "ImageDraw", stars: tuple[NamedStar, ...], scale: float, size: tuple[int, int]) -> None:
    from PIL import ImageFont

    width, height = size
    radius = max(5.0, height / 120.0)
    font = ImageFont.load_default(max(10.0, height / 60.0))
    taken: list[tuple[float, float, float, float]] = []
    for star in sorted(stars, key=lambda s: s.mag):
        x, y = (star.x + 0.5) * scale - 0.5, (star.y + 0.5) * scale - 0.5
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), outline=_STAR)
        at, text, anchor = ((x + radius + 2.0, y), star.ascii_name or star.id, "lm")  # Pillow's font has no Greek
        box = draw.textbbox(at, text, font=font, anchor=anchor)
        if box[2] > width:  # to the left of its star, so that it is not cut off
            at, anchor = (x - radius - 2.0, y), "rm"
            box = draw.textbbox(at, text, font=font, anchor=anchor)
        apart = (box[0] >= b[2] or b[0] >= box[2] or box[1] >= b[3] or b[1] >= box[3] for b in taken)
        if len(taken) < _NAMES and all(apart):
            draw.text(at, text, fill=_TEXT, font=font, anchor=anchor)
            taken.append(box)


def compass(solution: Solution) -> tuple[Floats, Floats]:
    """Unit vectors (2,) on the screen (x right, y down) towards north and east at the centre."""
    camera = solution.camera
    middle = np.array([(camera.width - 1) / 2.0, (camera.height - 1) / 2.0])
    centre = solution.centre_vector
    ends = centre + 2.0 / camera.focal_px * east_north(centre)  # some two pixels away
    east, north = unit(solution.pixels_of(unit(ends)) - middle)
    return north, east


def _draw_compass(draw: "ImageDraw", solution: Solution, size: tuple[int, int]) -> None:
    from PIL import ImageFont

    length = min(size) / 12.0
    middle = np.array([1.6 * length, size[1] - 1.6 * length])
    font = ImageFont.load_default(max(10.0, min(size) / 50.0))
    for way, letter, ink in zip(compass(solution), "NE", (_NORTH, _EAST), strict=True):
        tip, name = middle + length * way, middle + 1.25 * length * way
        across = np.array([-way[1], way[0]]) * length * 0.12
        back = tip - way * length * 0.25
        draw.line([*middle, *tip], fill=ink, width=2)
        draw.polygon([tuple(tip), tuple(back + across), tuple(back - across)], fill=ink)
        draw.text(tuple(name), letter, fill=ink, font=font, anchor="mm")
