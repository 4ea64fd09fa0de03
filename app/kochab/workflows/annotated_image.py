"""A solved frame with the sky drawn over it, as a picture to share: full resolution, the file's own colours."""

import base64
import io
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kochab.core import data_folder
from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg
from kochab.core.frame import Frame
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.frames.atomic_file import write_atomically
from kochab.frames.export import avm_packet, compass, csv_text, ds9_regions
from kochab.frames.sky_grid import grid_lines, pieces
from kochab.frames.stretch import apply, debayer_preview, stretch_parameters, white_balanced
from kochab.sky.frame_bodies import body_marks
from kochab.sky.layer import DOT_PX, FAMILIES, Mark, View, faintest_of, in_frame, labels, outlined
from kochab.sky.sky_tables import EPOCH, sky_tables
from kochab.sky.solar_system import Moving

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageFont import FreeTypeFont
    from PIL.PngImagePlugin import PngInfo

FORMATS = {".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG", ".tif": "TIFF", ".tiff": "TIFF", ".pdf": "PDF"}
ENDINGS = (*FORMATS, ".svg")
INKS = {
    "star": "#dce8f6",
    "galaxy": "#c3b1ff",
    "cluster": "#ffd873",
    "nebula": "#ff9db4",
    "dark": "#b9c4d0",
    "ecliptic": "#f2c14e",
}
FIGURE, GRID, NORTH, EAST, EDGE = "#6f83a5", "#3f5f85", "#ff6b6b", "#6bb8ff", "#0c0e11"
LETTER_PX, ACROSS = 13, 1200.0  # of a picture 1200 px across; larger ones have larger letters
CREDIT = "Kochab · OpenNGC (CC BY-SA 4.0), Stellarium, Hipparcos"


@dataclass(slots=True)
class Drawing:
    """What is drawn over a picture of ``width`` x ``height`` px.

    ``strokes`` are (places (N, 2), colour, width); ``words`` (upper left corner, text, colour), in letters of
    ``letter`` px.
    """

    width: int
    height: int
    letter: int
    strokes: list[tuple[Floats, str, float]] = field(default_factory=list)
    words: list[tuple[tuple[float, float], str, str]] = field(default_factory=list)


@lru_cache(maxsize=8)
def font_of(size: int) -> "FreeTypeFont":
    """DejaVu Sans, which has the Greek letters."""
    from PIL import ImageFont

    return ImageFont.truetype(data_folder("resources") / "DejaVuSans.ttf", size)


def drawing_of(solution: Solution, year: float = EPOCH, bodies: tuple[Mark, ...] = ()) -> Drawing:
    """Outlines, figures, names, grid and compass of a solved frame; names as dense as in the window."""
    camera = solution.camera
    unit = max(camera.width, camera.height) / ACROSS
    letter = max(9, round(LETTER_PX * unit))
    made, line = Drawing(camera.width, camera.height, letter), max(1.0, 1.2 * unit)
    for grid in grid_lines(solution, -0.5, -0.5, camera.width - 0.5, camera.height - 0.5):
        made.strokes += [(part, GRID, max(1.0, 0.7 * unit)) for part in pieces(grid.xy)]
    sky = in_frame(sky_tables(), solution, year, bodies)
    made.strokes += [(part, FIGURE, line) for part in sky.lines["figures"]]
    scale = LETTER_PX / letter
    view = View(scale, 0.0, 0.0, (4.0, 4.0, camera.width * scale - 4.0, camera.height * scale - 4.0))
    ranks = faintest_of(view, solution)

    def size(text: str) -> tuple[float, float]:
        left, _, right, bottom = font_of(letter).getbbox(text)
        return (right - left + 2) * scale, (bottom + 2) * scale

    shown = labels(sky, view, ranks, size, [_compass_box(view)])
    for mark in outlined(sky, view, ranks["object"]):
        made.strokes += [(shape, _ink(mark), line) for shape in mark.shapes]
    turn = np.linspace(0.0, 2.0 * np.pi, 33)
    ring = np.column_stack([np.cos(turn), np.sin(turn)]) * DOT_PX / scale
    for label in shown:
        if label.mark.kind != "star" and label.mark.radius * scale < DOT_PX:
            made.strokes.append((label.mark.xy + ring, _ink(label.mark), line))
        x, y = label.box[0] / scale - 0.5, label.box[1] / scale - 0.5
        made.words.append(((x, y), label.text, _ink(label.mark)))
    _draw_compass(made, solution)
    made.words.append(((0.6 * letter, camera.height - 1.6 * letter), CREDIT, INKS["dark"]))
    return made


def dated_drawing(frame: Frame, solution: Solution, more: Sequence[Moving] = ()) -> Drawing:
    """The same at the frame's date: stars where they have moved to, and the bodies of the Solar System."""
    from kochab.solver.pipeline import year_of

    return drawing_of(solution, year_of(frame.hint.time_utc), run(body_marks(frame, solution, more=more)))


def _ink(mark: Mark) -> str:
    return INKS[FAMILIES.get(mark.kind, "nebula")]


def _compass_box(view: View) -> tuple[float, float, float, float]:
    """Where the arrows are, screen px: at the lower left, with the credit line below."""
    bottom = view.bounds[3]
    return 0.0, bottom - 5.0 * LETTER_PX - 30.0, 110.0, 5.0 * LETTER_PX + 40.0


def _draw_compass(made: Drawing, solution: Solution) -> None:
    length = 2.6 * made.letter
    middle = np.array([1.5 * length, made.height - 2.0 * length])
    for way, name, ink in zip(compass(solution), "NE", (NORTH, EAST), strict=True):
        side = np.array([-way[1], way[0]]) * length * 0.12
        tip, back = middle + length * way, middle + 0.75 * length * way
        for places in ([middle, tip], [tip, back + side, back - side, tip]):
            made.strokes.append((np.array(places), ink, made.letter / 8.0))
        x, y = middle + 1.3 * length * way - (0.35 * made.letter, 0.6 * made.letter)
        made.words.append(((float(x), float(y)), name, ink))


def picture_of(frame: Frame) -> "Image":
    """The frame as RGB in full size: finished files as they are, others with one stretch for all channels.

    A mosaic's channels are balanced, for a sensor's green is twice as bright.
    """
    from PIL import Image

    shown = debayer_preview(frame, 1)
    if shown.dtype == np.uint8 and shown.ndim == 3 and frame.bayer is None:
        levels = shown
    else:
        levels = apply(shown, stretch_parameters(shown) if frame.bayer is None else white_balanced(shown))
    picture = Image.fromarray(levels).convert("RGB")
    return picture if picture.width == frame.width else picture.resize((frame.width, frame.height))


def annotated_picture(frame: Frame, solution: Solution, more: Sequence[Moving] = ()) -> "Image":
    """The frame with the sky drawn over it."""
    from PIL import ImageDraw

    picture, drawn = picture_of(frame), dated_drawing(frame, solution, more)
    draw = ImageDraw.Draw(picture)
    for places, ink, width in drawn.strokes:
        draw.line([(x, y) for x, y in places.tolist()], fill=ink, width=max(1, round(width)))
    font, edge = font_of(drawn.letter), max(1, drawn.letter // 8)
    for place, text, ink in drawn.words:
        draw.text(place, text, fill=ink, font=font, stroke_width=edge, stroke_fill=EDGE)
    return picture


def as_svg(frame: Frame, solution: Solution, more: Sequence[Moving] = ()) -> str:
    """The same as SVG: the picture inside, lines and letters as such."""
    packed, drawn = io.BytesIO(), dated_drawing(frame, solution, more)
    picture_of(frame).save(packed, format="JPEG", quality=92)
    size = f'width="{drawn.width}" height="{drawn.height}"'
    data = base64.b64encode(packed.getvalue()).decode()
    style = f'font-family="DejaVu Sans, sans-serif" font-size="{drawn.letter}" paint-order="stroke" stroke="{EDGE}"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="-0.5 -0.5 {drawn.width} {drawn.height}">',
        f'<image x="-0.5" y="-0.5" {size} href="data:image/jpeg;base64,{data}"/>',
        '<g fill="none" stroke-linejoin="round">',
    ]
    for places, ink, width in drawn.strokes:
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in places.tolist())
        lines.append(f'<polyline points="{points}" stroke="{ink}" stroke-width="{width:.1f}"/>')
    lines.append(f'</g><g {style} stroke-width="{drawn.letter / 6:.1f}">')
    for (x, y), text, ink in drawn.words:
        lines.append(f'<text x="{x:.1f}" y="{y + drawn.letter:.1f}" fill="{ink}">{escape(text, quote=False)}</text>')
    return "\n".join([*lines, "</g></svg>", ""])


def annotate(frame: Frame, solution: Solution, path: str | os.PathLike[str], more: Sequence[Moving] = ()) -> None:
    """Write the frame with the sky over it: PNG, JPEG, TIFF, PDF or SVG by the name. OSError when it cannot be.

    The first three carry tags that place them on the sky. Asteroids and comets of ``more`` tables are looked for
    beside the shipped ones.
    """
    ending = Path(path).suffix.lower()
    if ending == ".svg":
        write_atomically(path, as_svg(frame, solution, more))
        return
    packed, kind = io.BytesIO(), FORMATS.get(ending, "PNG")
    packing: dict[str, dict[str, Any]] = {
        "JPEG": {"quality": 92},
        "PNG": {"compress_level": 4},
        "TIFF": {"compression": "tiff_deflate"},
    }
    if packet := avm_packet(solution, CREDIT):
        packing["JPEG"] |= {"extra": _marker(b"http://ns.adobe.com/xap/1.0/\0" + packet)}
        packing["PNG"] |= {"pnginfo": _png_text("XML:com.adobe.xmp", packet)}
        packing["TIFF"] |= {"tiffinfo": {700: packet}}
    annotated_picture(frame, solution, more).save(packed, format=kind, **packing.get(kind, {}))
    write_atomically(path, packed.getvalue())


def _marker(content: bytes) -> bytes:
    """A segment APP1 of a JPEG."""
    return b"\xff\xe1" + (len(content) + 2).to_bytes(2, "big") + content


def _png_text(key: str, content: bytes) -> "PngInfo":
    from PIL.PngImagePlugin import PngInfo

    info = PngInfo()
    info.add_itxt(key, content.decode("utf-8"))
    return info


def objects_csv(solution: Solution) -> str:
    """The deep-sky objects of the frame, the best known first: px, ICRS degrees, magnitude, sizes in arcmin, PA."""
    tables = sky_tables()
    objects = tables.objects
    head = ("name", "names", "type", "x", "y", "ra_deg", "dec_deg", "mag", "major_arcmin", "minor_arcmin", "pa_deg")
    rows: list[tuple[object, ...]] = [head]
    for mark in in_frame(tables, solution).marks:
        if mark.kind != "star":
            k = mark.row
            ra, dec = radec_deg(objects.vector[k])
            sizes = (objects.mag[k], objects.major[k], objects.minor[k], objects.pa_deg[k])
            place = (f"{mark.xy[0]:.2f}", f"{mark.xy[1]:.2f}", f"{ra:.5f}", f"{dec:.5f}")
            told = ("" if np.isnan(value) else f"{value:g}" for value in sizes)
            rows.append((mark.short, ";".join(objects.names(k)[1:]), mark.kind, *place, *told))
    return csv_text(rows)


def sky_regions(frame: Frame, solution: Solution) -> str:
    """DS9's regions of the stars, and of the frame's deep-sky objects and bodies, ICRS.

    DS9 counts an ellipse's angle from west over north, 90 degrees more than the position angle.
    """
    objects, lines = sky_tables().objects, []
    marks = in_frame(sky_tables(), solution, also=run(body_marks(frame, solution))).marks
    for mark in (mark for mark in marks if mark.kind != "star"):
        k, body = mark.row, mark.body
        ra, dec = radec_deg(objects.vector[k] if body is None else body.vector)
        sides = (objects.major[k], objects.minor[k]) if body is None else (body.diameter_arcsec / 60.0, np.nan)
        major, minor = (float(side) * 30.0 for side in sides)
        least = DOT_PX * solution.camera.scale_arcsec_px
        shape = f'circle({ra:.6f},{dec:.6f},{max(float(np.nan_to_num(major)), least):.2f}")'
        if body is None and np.isfinite([minor, objects.pa_deg[k]]).all():
            shape = f'ellipse({ra:.6f},{dec:.6f},{major:.2f}",{minor:.2f}",{(objects.pa_deg[k] + 90.0) % 360.0:g})'
        ink = INKS[FAMILIES.get(mark.kind, "nebula")]
        name = mark.short.encode("ascii", "replace").decode()
        lines.append(f"{shape} # color={ink} text={{{name}}}\n")
    return ds9_regions(solution) + "".join(lines)
