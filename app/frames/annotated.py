"""The frame as a picture for people: stretched, its stars named, the sky's grid over it."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import radec_deg, unit_vectors
from app.core.frame import Frame
from app.core.solution import NamedStar, Solution
from app.frames.stretch import apply, debayer_preview, stretch_parameters, white_balanced

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

Floats = NDArray[np.float64]

_LONGEST_PX = 2400
_NAMES = 40
_STAR, _TEXT, _GRID, _NORTH, _EAST = "#35d07f", "#ffd166", "#3f6fb5", "#ff6b6b", "#6bb8ff"
_STEPS_DEG = (
    90.0, 45.0, 30.0, 20.0, 10.0, 5.0, 2.0, 1.0, 1 / 2, 1 / 3, 1 / 6, 1 / 12, 1 / 30, 1 / 60,
    1 / 120, 1 / 360,
)  # fmt: skip


def annotated_picture(frame: Frame, solution: Solution, grid: bool = True) -> "Image":
    """An RGB picture, thinned to at most 2400 px, with circles, names, grid and compass."""
    from PIL import Image, ImageDraw

    factor = max(1, -(-max(frame.width, frame.height) // _LONGEST_PX))
    shown = debayer_preview(frame, factor)
    colour = shown.ndim == 3
    levels = apply(shown, white_balanced(shown) if colour else stretch_parameters(shown))
    picture = Image.fromarray(levels).convert("RGB")
    scale = picture.width / frame.width
    draw = ImageDraw.Draw(picture)
    if grid:
        _draw_grid(draw, solution, scale)
    _draw_stars(draw, solution.stars, scale, picture.size)
    _draw_compass(draw, solution, picture.size)
    return picture


def _draw_stars(
    draw: "ImageDraw", stars: tuple[NamedStar, ...], scale: float, size: tuple[int, int]
) -> None:
    from PIL import ImageFont

    width, height = size
    radius = max(5.0, height / 120.0)
    font = ImageFont.load_default(max(10.0, height / 60.0))
    taken: list[tuple[float, float, float, float]] = []
    for star in sorted(stars, key=lambda s: s.mag):
        x, y = (star.x + 0.5) * scale - 0.5, (star.y + 0.5) * scale - 0.5
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), outline=_STAR)
        at, text, anchor = (x + radius + 2.0, y), star.name or star.id, "lm"
        box = draw.textbbox(at, text, font=font, anchor=anchor)
        if box[2] > width:  # to the left of its star, so that it is not cut off
            at, anchor = (x - radius - 2.0, y), "rm"
            box = draw.textbbox(at, text, font=font, anchor=anchor)
        if len(taken) < _NAMES and not any(_overlap(box, other) for other in taken):
            draw.text(at, text, fill=_TEXT, font=font, anchor=anchor)
            taken.append(box)


def _overlap(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _draw_grid(draw: "ImageDraw", solution: Solution, scale: float) -> None:
    for line in grid_lines(solution):
        points = (line + 0.5) * scale - 0.5
        draw.line([(float(x), float(y)) for x, y in points], fill=_GRID)


def grid_lines(solution: Solution) -> list[Floats]:
    """Lines of equal RA and of equal Dec over the frame, each (N, 2) px, N at least 2.

    The step is the roundest that puts four or so lines of declination into the frame.
    """
    camera = solution.camera
    x, y = np.meshgrid(
        np.linspace(-0.5, camera.width - 0.5, 25), np.linspace(-0.5, camera.height - 0.5, 25)
    )
    sky = solution.sky_at(np.stack([x.ravel(), y.ravel()], axis=-1))
    centre = solution.centre_vector
    reach = float(np.arccos(np.clip((sky @ centre).min(), -1.0, 1.0)))
    ra0, dec0 = radec_deg(centre)
    low, high = max(dec0 - np.degrees(reach), -90.0), min(dec0 + np.degrees(reach), 90.0)
    step = next((s for s in _STEPS_DEG if (high - low) / s >= 4.0), _STEPS_DEG[-1])
    polar = max(abs(low), abs(high)) > 89.9
    ra_reach = 180.0 if polar else _ra_reach_deg(dec0, reach)
    ra_step = _ra_step(step, dec0, ra_reach)
    lines = []
    dec_samples = np.linspace(low, high, 240)
    for k in range(int(np.ceil((ra0 - ra_reach) / ra_step)), int((ra0 + ra_reach) // ra_step) + 1):
        if k * ra_step < ra0 - ra_reach + 360.0:  # all the way round once, not twice
            lines += _inside(solution, unit_vectors(np.full(240, k * ra_step), dec_samples), reach)
    ra_samples = ra0 + np.linspace(-ra_reach, ra_reach, 480)
    for k in range(int(np.ceil(low / step)), int(high // step) + 1):
        lines += _inside(solution, unit_vectors(ra_samples, np.full(480, k * step)), reach)
    return lines


def _ra_reach_deg(dec0_deg: float, reach_rad: float) -> float:
    """Half the span of right ascension of a cap that holds no pole."""
    share = np.sin(reach_rad) / max(np.cos(np.radians(dec0_deg)), 1e-9)
    return float(np.degrees(np.arcsin(min(share, 1.0))))


def _ra_step(step_deg: float, dec0_deg: float, ra_reach_deg: float) -> float:
    wanted = step_deg / max(float(np.cos(np.radians(dec0_deg))), 0.02)
    rounded = next((s for s in _STEPS_DEG if s <= wanted), _STEPS_DEG[-1])
    return max(min(rounded, 30.0), ra_reach_deg / 60.0)


def _inside(solution: Solution, vectors: Floats, reach: float) -> list[Floats]:
    """The pieces of a line on the sky that lie on the frame."""
    camera = solution.camera
    pixels = solution.pixels_of(vectors)
    # A distorting lens folds what is far outside back in: only what is near may be drawn.
    near = vectors @ solution.centre_vector > np.cos(min(1.05 * reach, np.pi / 2))
    with np.errstate(invalid="ignore"):
        inside = near & ((pixels > -1.0) & (pixels < [camera.width, camera.height])).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(np.int8), [0]])))
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return [pixels[start:end] for start, end in pairs if end - start > 1]


def compass(solution: Solution) -> tuple[Floats, Floats]:
    """Unit vectors (2,) on the screen (x right, y down) towards north and east at the centre."""
    camera = solution.camera
    middle = np.array([(camera.width - 1) / 2.0, (camera.height - 1) / 2.0])
    centre = solution.centre_vector
    east = np.array([-centre[1], centre[0], 0.0])
    if not np.linalg.norm(east) > 1e-9:
        east = np.array([0.0, 1.0, 0.0])
    east /= np.linalg.norm(east)
    small = 2.0 / camera.focal_px
    ends = centre + small * np.stack([np.cross(centre, east), east])
    shift = solution.pixels_of(ends / np.linalg.norm(ends, axis=1, keepdims=True)) - middle
    shift /= np.linalg.norm(shift, axis=1, keepdims=True)
    return shift[0], shift[1]


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
