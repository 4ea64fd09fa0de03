"""A solved frame with the sky drawn over it, as a picture to share: full resolution, the file's own colours."""

import base64
import io
import json
import os
from collections.abc import Sequence
from dataclasses import field, replace
from functools import lru_cache
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg
from kochab.core.errors import KochabError, printable
from kochab.core.frame import Frame
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.core.values import mutable
from kochab.folders import data_folder
from kochab.frames.atomic_file import write_atomically
from kochab.frames.export import avm_packet, compass
from kochab.frames.sky_grid import GridLine, SiteSky, grid_lines, named_lines, pieces
from kochab.frames.stretch import apply, debayer_preview, stretch_parameters, white_balanced
from kochab.sky.frame_bodies import body_marks
from kochab.sky.horizon import horizon_of
from kochab.sky.kinds import FAMILIES
from kochab.sky.layer import (
    DOT_PX,
    DOTTED,
    LAYER_OF,
    LINES,
    MARKS,
    OUTLINE,
    SHOWN,
    TEXTS,
    Layers,
    Mark,
    View,
    among,
    around_text,
    constellation_labels,
    in_frame,
    labels,
    outlined,
)
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
    "figure": "#9fb4d6",
    "grid": "#86a8cc",
    "grid_text": "#b4cbe4",
    "horizon": "#84c9a2",
    "horizon_text": "#b2dfc4",
    "centre": "#ff7ab0",
    "identified": "#62d6ff",
    "detected": "#f0b440",
}
"""The colours of the window's dark theme."""
NORTH, EAST, EDGE = "#ff6b6b", "#6bb8ff", "#0c0e11"
SMALL_PX = 12_000_000  # a picture this small has smooth lines; in others they are wide
TINY_PX = 800  # a smaller picture is written twice as large
LETTER_PX, ACROSS = 13, 1200.0  # of a picture 1200 px across; larger ones have larger letters
STELLARIUM_DEG, STELLARIUM_PX = 20.0, 4096  # the widest field, and the largest picture that any computer shows
CREDIT, SHORT_CREDIT = "Kochab · OpenNGC (CC BY-SA 4.0), Stellarium, Hipparcos", "OpenNGC, CC BY-SA 4.0"
"""Whose the names are; the shorter one where a picture has no room."""


USUAL = Layers({name: name in SHOWN and name != "centre" for name in MARKS})
NOTHING: Floats = np.empty((0, 2))
_TURN = np.linspace(0.0, 2.0 * np.pi, 33)
CIRCLE: Floats = np.column_stack([np.cos(_TURN), np.sin(_TURN)])
Stroke = tuple[Floats, str, float]  # places (N, 2), colour "#rrggbbaa", width


@mutable
class Drawing:
    """What is drawn over a picture of ``width`` x ``height`` px.

    ``words`` are (upper left corner, text, colour), in letters of ``letter`` px.
    """

    width: int
    height: int
    letter: int
    strokes: list[Stroke] = field(default_factory=list)
    words: list[tuple[tuple[float, float], str, str]] = field(default_factory=list)


@lru_cache(maxsize=8)
def font_of(size: int) -> "FreeTypeFont":
    """DejaVu Sans, which has the Greek letters."""
    from PIL import ImageFont

    return ImageFont.truetype(data_folder("resources") / "DejaVuSans.ttf", size)


def drawing_of(
    solution: Solution,
    year: float = EPOCH,
    bodies: tuple[Mark, ...] = (),
    layers: Layers = USUAL,
    horizon: SiteSky | None = None,
    detected: Floats = NOTHING,
) -> Drawing:
    """The layers over a solved frame, as the window has them; names as dense as there.

    Parameters
    ----------
    solution : Solution
        Where it points.
    year : float
        Epoch of the stars' places, Julian year.
    bodies : tuple[Mark, ...]
        Marks of the Solar System.
    layers : Layers
        What is drawn.
    horizon : SiteSky or None
        The sky above the site, for lines of altitude and azimuth; None: there are none.
    detected : Floats
        Stars detected (N, 2), px.
    """
    camera = solution.camera
    unit = max(camera.width, camera.height) / ACROSS
    letter = max(9, round(LETTER_PX * unit))
    made, line = Drawing(camera.width, camera.height, letter), max(1.0, 1.2 * unit)
    scale = LETTER_PX / letter  # labels are laid out on a screen with letters of 13 px
    view = View(scale, 0.0, 0.0, (4.0, 4.0, camera.width * scale - 4.0, camera.height * scale - 4.0))

    def ink_of(mark: Mark) -> str:
        return _ink(layers, LAYER_OF[mark.group], FAMILIES.get(mark.kind, "nebula"))

    def size(text: str) -> tuple[float, float]:
        left, _, right, bottom = font_of(letter).getbbox(text)
        return (right - left + 2) * scale, (bottom + 2) * scale

    tables = sky_tables()
    sky, grids = in_frame(tables, solution, year, bodies), _grids(solution, layers, horizon)
    lines = {kind: [part for one in drawn for part in pieces(one.xy)] for kind, drawn in grids.items()}
    lines |= {kind: [*parts] for kind, parts in sky.lines.items() if layers.on[kind]}
    for kind, parts in lines.items():
        ink = f"{_ink(layers, kind, LINES[kind][0])}{layers.opaque(kind):02x}"
        made.strokes += [(part, ink, line) for xy in parts for part in (_dots(xy, line) if kind == DOTTED else [xy])]
    made.strokes += _circles(solution, layers, detected, unit, line)
    ranks = layers.faintest(view, solution)
    # What labels must leave free: the credit line, and the compass.
    credit = CREDIT if size(CREDIT)[0] + LETTER_PX < view.bounds[2] else SHORT_CREDIT
    taken = [(0.0, view.bounds[3] - 1.6 * LETTER_PX, size(credit)[0] + LETTER_PX, 1.6 * LETTER_PX + 4.0)]
    taken += [_compass_box(view)] if layers.on["compass"] else []
    if layers.on["objects"] and (within := around_text(tables, solution)):
        corner = (view.bounds[0] + 4.0, view.bounds[1] + 4.0, *size(within))
        taken.append(corner)
        made.words.append(((corner[0] / scale, corner[1] / scale), within, _ink(layers, "objects", "nebula")))
    shown = labels(sky, view, ranks, size, taken, layers.density)
    for mark in outlined(sky, view, ranks):
        made.strokes += [(shape, f"{ink_of(mark)}{OUTLINE:02x}", line) for shape in mark.shapes]
    for label in shown:
        if label.mark.kind != "star" and label.mark.radius * scale < DOT_PX:
            ring = label.mark.xy + CIRCLE * DOT_PX / scale
            made.strokes.append((ring, f"{ink_of(label.mark)}{OUTLINE:02x}", line))
    words = [(label.box, label.text, ink_of(label.mark)) for label in shown]
    for kind, drawn in {**named_lines(sky.lines, layers.on), **grids}.items():
        ink = _ink(layers, kind, TEXTS[kind])
        for one in drawn:
            width, height = size(one.text)
            if (spot := one.spot(view.to_screen(one.xy), *view.bounds)) is not None:
                x, y = min(spot[0] + 4.0, view.bounds[2] - width), max(spot[1] - 4.0 - height, view.bounds[1])
                boxes = [*taken, *(box for box, _, _ in words)]
                if not any(x < u + w and u < x + width and y < v + h and v < y + height for u, v, w, h in boxes):
                    words.append(((x, y, width, height), one.text, ink))
    boxes = [*taken, *(box for box, _, _ in words)]
    named = constellation_labels(sky, view, size, boxes) if layers.on["figures"] else []
    words += [(box, text, _ink(layers, "figures", "figure")) for text, box in named]
    made.words += [((x / scale - 0.5, y / scale - 0.5), text, ink) for (x, y, _, _), text, ink in words]
    if layers.on["compass"]:
        _draw_compass(made, solution)
    made.words.append(((0.6 * letter, camera.height - 1.6 * letter), credit, INKS["dark"]))
    return made


def _dots(xy: Floats, width: float) -> list[Floats]:
    """A line (N, 2) as dots of this width, twice as far apart."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
    begun = np.arange(0.0, along[-1], 3.0 * width)
    ends = np.column_stack([begun, begun + width])
    return list(np.stack([np.interp(ends, along, side) for side in xy.T], axis=-1))


def _ink(layers: Layers, layer: str, usual: str) -> str:
    return layers.colour.get(layer, INKS[usual])


def _grids(solution: Solution, layers: Layers, horizon: SiteSky | None) -> dict[str, list[GridLine]]:
    edges = -0.5, -0.5, solution.camera.width - 0.5, solution.camera.height - 0.5
    grids = {"grid": grid_lines(solution, *edges)} if layers.on["grid"] else {}
    if layers.on["altaz"] and horizon is not None:
        grids["altaz"] = grid_lines(solution, *edges, horizon)
    return grids


def _circles(solution: Solution, layers: Layers, detected: Floats, unit: float, line: float) -> list[Stroke]:
    """Those of detections and identified stars, and the cross in the centre, where they are on."""
    if layers.on["identified"]:  # which have circles of their own
        detected = detected[~among(detected, solution.named_px)]
    rings = {"detected": (detected, 4.5), "identified": (solution.named_px, 8.0)}
    made = [
        (place + radius * unit * CIRCLE, f"{_ink(layers, layer, layer)}ff", line)
        for layer, (places, radius) in rings.items()
        if layers.on[layer]
        for place in places
    ]
    if layers.on["centre"]:
        middle = np.array([solution.camera.width - 1, solution.camera.height - 1]) / 2.0
        ink = f"{_ink(layers, 'centre', 'centre')}ff"
        ways = np.vstack([np.eye(2), -np.eye(2)])
        made += [(middle + unit * np.outer((6.0, 18.0), way), ink, 1.5 * line) for way in ways]
    return made


def dated_drawing(
    frame: Frame, solution: Solution, more: Sequence[Moving] = (), layers: Layers = USUAL, detected: Floats = NOTHING
) -> Drawing:
    """The same at the frame's date: stars where they have moved to, and the bodies of the Solar System.

    Parameters
    ----------
    frame : Frame
        Says when and where it was taken.
    solution : Solution
        Where it points.
    more : Sequence[Moving]
        Tables of moving bodies beside the shipped ones.
    layers : Layers
        What is drawn.
    detected : Floats
        Stars detected (N, 2), px.
    """
    from kochab.solver.pipeline import year_of

    bodies = run(body_marks(frame, solution, more=more))
    horizon = None if frame.hint.time_of_file else horizon_of(frame)  # a file's date may be a copy's
    return drawing_of(solution, year_of(frame.hint.time_utc), bodies, layers, horizon, detected)


ARROW, RIGHT, UP = 2.6, 1.9, 2.4  # letters long; the arrows' origin from the left and from below, arrows' lengths


def _compass_box(view: View) -> tuple[float, float, float, float]:
    """Where the arrows and their letters are, screen px: at the lower left, above the credit line."""
    length, bottom = ARROW * LETTER_PX, view.bounds[3] + 4.0
    top = bottom - (UP + 1.3) * length - LETTER_PX
    return 0.0, top, (RIGHT + 1.3) * length + LETTER_PX, bottom - top


def _draw_compass(made: Drawing, solution: Solution) -> None:
    length = ARROW * made.letter
    middle = np.array([RIGHT * length, made.height - UP * length])
    for way, name, ink in zip(compass(solution), "NE", (NORTH, EAST), strict=True):
        side = np.array([-way[1], way[0]]) * length * 0.12
        tip, back = middle + length * way, middle + 0.75 * length * way
        for places in ([middle, tip], [tip, back + side, back - side, tip]):
            made.strokes.append((np.array(places), f"{ink}ff", made.letter / 8.0))
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


def annotated_picture(frame: Frame, drawn: Drawing) -> "Image":
    """The frame with a drawing over it; strokes of one colour are one, so that none is stronger where they meet."""
    from PIL import Image, ImageDraw

    picture = picture_of(frame)
    if picture.size != (drawn.width, drawn.height):
        picture = picture.resize((drawn.width, drawn.height), Image.Resampling.LANCZOS)
    fine = 2 if picture.width * picture.height < SMALL_PX else 1  # Pillow does not antialias: drawn twice as large
    for ink in dict.fromkeys(ink for _, ink, _ in drawn.strokes):
        mask = Image.new("L", (fine * picture.width, fine * picture.height))
        draw = ImageDraw.Draw(mask)
        for places, of, width in drawn.strokes:
            if of == ink:
                at = [(x, y) for x, y in ((places + 0.5) * fine - 0.5).tolist()]
                draw.line(at, fill=int(ink[7:], 16), width=max(1, round(fine * width)))
        picture.paste(ink[:7], mask=mask.reduce(fine))
    draw, font, edge = ImageDraw.Draw(picture), font_of(drawn.letter), max(1, drawn.letter // 8)
    for place, text, ink in drawn.words:
        draw.text(place, text, fill=ink, font=font, stroke_width=edge, stroke_fill=EDGE)
    return picture


def as_svg(frame: Frame, drawn: Drawing) -> str:
    """The same as SVG: the picture inside, lines and letters as such."""
    packed = io.BytesIO()
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
        opaque = f'stroke="{ink[:7]}" stroke-opacity="{int(ink[7:], 16) / 255.0:.2f}"'
        lines.append(f'<polyline points="{points}" {opaque} stroke-width="{width:.1f}"/>')
    lines.append(f'</g><g {style} stroke-width="{drawn.letter / 6:.1f}">')
    for (x, y), text, ink in drawn.words:
        lines.append(f'<text x="{x:.1f}" y="{y + drawn.letter:.1f}" fill="{ink}">{escape(text, quote=False)}</text>')
    return "\n".join([*lines, "</g></svg>", ""])


def doubled(solution: Solution) -> Solution:
    """The solution of the same frame with twice as many pixels each way; pixel (0, 0) becomes four."""
    camera = solution.camera
    lens = replace(
        camera,
        width=2 * camera.width,
        height=2 * camera.height,
        focal_px=2.0 * camera.focal_px,
        cx=2.0 * camera.cx + 0.5,
        cy=2.0 * camera.cy + 0.5,
    )
    stars, seen = (
        tuple(replace(star, x=2.0 * star.x + 0.5, y=2.0 * star.y + 0.5) for star in some)
        for some in (solution.stars, solution.seen)
    )
    return replace(solution, camera=lens, stars=stars, seen=seen)


def annotate(
    frame: Frame,
    solution: Solution,
    path: str | os.PathLike[str],
    more: Sequence[Moving] = (),
    layers: Layers = USUAL,
    detected: Floats = NOTHING,
) -> None:
    """Write the frame with the layers over it: PNG, JPEG, TIFF, PDF or SVG by the name. OSError when it cannot be.

    The first three carry tags that place them on the sky. A small frame is written twice as large, but for SVG, which
    every viewer enlarges: its names had letters of 9 px and hid what they name.

    Parameters
    ----------
    frame : Frame
        Its pixels, and when it was taken.
    solution : Solution
        Where it points.
    path : str or os.PathLike[str]
        The file to write.
    more : Sequence[Moving]
        Tables of asteroids and comets that are looked for beside the shipped ones.
    layers : Layers
        What is drawn.
    detected : Floats
        Stars detected (N, 2), px.
    """
    ending = Path(path).suffix.lower()
    if max(frame.width, frame.height) < TINY_PX and ending != ".svg":
        solution, detected = doubled(solution), 2.0 * detected + 0.5
    drawn = dated_drawing(frame, solution, more, layers, detected)
    if ending == ".svg":
        write_atomically(path, as_svg(frame, drawn))
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
        packing["TIFF"] |= {"tiffinfo": {700: packet}}  # the tag of XMP
    annotated_picture(frame, drawn).save(packed, format=kind, **packing.get(kind, {}))
    write_atomically(path, packed.getvalue())


def _marker(content: bytes) -> bytes:
    """A segment APP1 of a JPEG."""
    return b"\xff\xe1" + (len(content) + 2).to_bytes(2, "big") + content  # the length counts its own two bytes


def _png_text(key: str, content: bytes) -> "PngInfo":
    from PIL.PngImagePlugin import PngInfo

    info = PngInfo()
    info.add_itxt(key, content.decode("utf-8"))
    return info


def write_stellarium(frame: Frame, solution: Solution, path: str | os.PathLike[str]) -> None:
    """Write a script that lays the frame over Stellarium's sky, and the picture that it loads beside it.

    Stellarium stretches a picture between its corners, which is good to 0.3 % at 10 degrees. KochabError for a
    field that is too wide, and rather than write over a picture that nobody asked about; OSError.
    """
    from PIL import Image

    script, picture = Path(path), Path(path).with_suffix(".png")
    if max(solution.camera.fov_deg) > STELLARIUM_DEG:
        raise KochabError("Stellarium bends a field wider than {most:.0f}°: crop the image first.", most=STELLARIUM_DEG)
    if picture.exists() and not script.exists():  # the dialog asked about the script alone
        raise KochabError("{name} already exists. Choose another name for the script.", name=picture.name)
    shown, packed = picture_of(frame), io.BytesIO()
    shown.thumbnail((STELLARIUM_PX, STELLARIUM_PX), Image.Resampling.LANCZOS)
    shown.save(packed, format="PNG", compress_level=4)
    write_atomically(picture, packed.getvalue())
    write_atomically(script, stellarium_script(solution, picture.name))


def stellarium_script(solution: Solution, picture: str) -> str:
    """The script: corners from the lower left counterclockwise as ``core.loadSkyImage`` takes them, J2000 degrees."""
    # The outer edges of the pixels: 0 is the centre of the first.
    right, low = solution.camera.width - 0.5, solution.camera.height - 0.5
    corners = solution.sky_at(np.array([[-0.5, low], [right, low], [right, -0.5], [-0.5, -0.5]]))
    places = ", ".join(f"{angle:.6f}" for corner in corners for angle in radec_deg(corner))
    name = json.dumps(picture)
    ra, dec = solution.ra_dec_deg
    return "\n".join(
        (
            f"// Name: {printable(picture)}",
            "// Description: put this script and the picture into Stellarium's folder scripts, and run it there (F12).",
            f"core.loadSkyImage({name}, {name}, {places}, 2.5, 14, true);",
            f'core.moveToRaDecJ2000("{ra:.6f}d", "{dec:.6f}d", 1);',
            f"StelMovementMgr.zoomTo({2.0 * max(solution.camera.fov_deg):.3f}, 1);\n",
        )
    )
