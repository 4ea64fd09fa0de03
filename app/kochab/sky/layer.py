"""The sky over a solved frame: outlines, lines and names, each where the solution puts it, no name over another.

:func:`in_frame` projects the tables once for a solution; :func:`labels` chooses and places names for what is
seen of it. Marks are in image px, label boxes in screen px; whoever draws brings the size of a text.
"""

from collections.abc import Callable, Iterable
from dataclasses import field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from kochab.core.arrays import Bools, Floats, Ints
from kochab.core.attitude import cross_product, unit
from kochab.core.solution import Solution
from kochab.core.values import frozen, mutable
from kochab.sky.object_index import MOST, holding, inside
from kochab.sky.sky_tables import EPOCH, SkyTables
from kochab.text.translation import tr

if TYPE_CHECKING:
    from kochab.sky.solar_system import Body

BODY_MAG = 60.0  # by which a body of the Solar System ranks before all else
BODIES = -20.0  # the rank down to which all are bodies
MOST_OUTLINES = 200  # of one view, the best known
Magnitude = TypeVar("Magnitude", float, Floats)
NUMBERED, FIRST = 2.0, 1.5  # ranks by which a star with only a number is named later, and one of one word earlier
NAMELESS = 7.0  # the rank that a frame's first name has at least: no solved frame is without one
MOST_RADII = 1.0  # of the view: a larger outline says nothing
POINTS = 48  # of an ellipse
SAMPLES = 16  # of a line across the half diagonal
WAYS = np.array([[1, 0], [1, -1], [-1, 0], [0, -1], [0, 1], [-1, -1], [1, 1], [-1, 1]], dtype=np.float64)
AROUND_FIGURE = ((0, 0), (0, 1), (0, -1), (0, 2), (0, -2), (1, 0), (-1, 0), (1, 2), (-1, 2), (1, -2), (-1, -2))
GAP_PX, STAR_PX = 4.0, 5.0  # from an outline and from a star to the name
DISC_PX = 4.0  # of the image: how far the disc of a bright star reaches, which grows with the zoom
APART_PX = 5.0  # between two names on a line
BRIGHTEST = 1.0  # stars so bright are known by their names, however many words those have
TWIN_PX = 3.0  # so near on the screen, two stars are one, with one name
DOT_PX = 6.0  # so small on the screen, an object has its short name alone
AREA_PX2 = 22_000.0  # of the screen for each name, in the middle of the scale
LEAST_FIGURE = 2  # stars of a figure in a frame that has the constellation's name
TO_MAG = 4.0  # the frame's stars down to it are named, however wide it is
BEST = 400  # candidates that are looked at for a view

MARKS = (
    *("objects", "names", "bodies", "figures", "boundaries", "ecliptic", "galactic", "grid", "altaz"),
    *("centre", "compass", "identified", "detected"),
)
"""The layers, by their names in the settings."""
SHOWN = ("objects", "names", "bodies", "figures", "grid", "centre", "compass")  # until the person switches
LAYER_OF = {"star": "names", "object": "objects", "body": "bodies"}
LINES = {
    "figures": ("figure", 150),
    "boundaries": ("figure", 150),
    "ecliptic": ("ecliptic", 150),
    "galactic": ("galaxy", 150),
    "grid": ("grid", 85),
    "altaz": ("horizon", 85),
}
"""The layers that are lines: their colours' names in a theme, and how opaque they are, of 255."""
DOTTED = "boundaries"
TEXTS = {"grid": "grid_text", "altaz": "horizon_text", "ecliptic": "ecliptic", "galactic": "galaxy"}
"""Layers of lines that say what they are, and in which colour of the theme."""
AMOUNTS = dict.fromkeys((*LAYER_OF.values(), *LINES), 0.5) | {"bodies": 1.0}
"""The layers with more or less of them, and how much at first, 0..1: the density of names, the strength of lines."""
OUTLINE = 190  # how opaque an outline is, of 255

TextSize = Callable[[str], tuple[float, float]]
"""Width and height of a text, px."""


@mutable
class Layers:
    """Which of :data:`MARKS` are drawn, how much of each, and in which colour ("#rrggbb") where not in its own."""

    on: dict[str, bool] = field(default_factory=lambda: {name: name in SHOWN for name in MARKS})
    amount: dict[str, float] = field(default_factory=lambda: dict(AMOUNTS))
    colour: dict[str, str] = field(default_factory=dict)

    @property
    def density(self) -> float:
        """How close names may stand."""
        return max(self.amount["names"], self.amount["objects"])

    def opaque(self, line: str) -> int:
        """How opaque a layer of lines is, of 255: as it is made at half the amount, wholly at all of it."""
        return int(255.0 * (LINES[line][1] / 255.0) ** (2.0 - 2.0 * self.amount[line]) + 0.5)

    def faintest(self, view: "View", solution: Solution) -> dict[str, float]:
        """The ranks down to which marks of the kinds that are on are named and outlined, for :func:`labels`."""
        bodies = BODIES if self.amount["bodies"] >= 1.0 else 4.0 + 16.0 * self.amount["bodies"] - BODY_MAG
        ranks = faintest_of(view, solution, self.amount["names"], self.amount["objects"]) | {"body": bodies}
        return {kind: rank for kind, rank in ranks.items() if self.on[LAYER_OF[kind]]}


@frozen
class View:
    """``screen = (pixel + 0.5) * scale + (dx, dy)``; names stay within ``bounds`` (x0, y0, x1, y1), screen px."""

    scale: float
    dx: float
    dy: float
    bounds: tuple[float, float, float, float]

    def to_screen(self, xy: Floats) -> Floats:
        """Screen places (N, 2) of image pixels (N, 2)."""
        return np.asarray((xy + 0.5) * self.scale + (self.dx, self.dy))


@frozen(eq=False)
class Mark:
    """An object or a star of the frame: where, what its name is, and how it ranks.

    ``row`` is that of the objects, or of the named stars for ``kind`` "star", or any for a ``body``; ``xy`` (2,) and
    ``radius`` are px of the image; ``shapes`` are its outlines, px; ``text`` is its name and ``short`` the name without
    a common one; ``mag`` is the rank, a magnitude that counts how well known it is.
    """

    kind: str
    row: int
    xy: Floats
    radius: float
    mag: float
    text: str
    short: str
    shapes: tuple[Floats, ...] = ()
    body: "Body | None" = None

    @property
    def group(self) -> str:
        """What is shown or hidden together: "star", "object" or "body"."""
        return "body" if self.body is not None else "star" if self.kind == "star" else "object"


@frozen(eq=False)
class SkyInFrame:
    """What one frame holds: marks by rank, the best first, and lines (N, 2) px by what they are.

    ``constellations`` are names and the middle (2,) px of what the frame has of their figures.
    """

    marks: tuple[Mark, ...]
    lines: dict[str, tuple[Floats, ...]]
    places: Floats = field(default_factory=lambda: np.empty((0, 2)))
    constellations: tuple[tuple[str, Floats], ...] = ()


@frozen(eq=False)
class Label:
    """A name on the screen: its box (x, y, width, height) px, and what it belongs to."""

    text: str
    box: tuple[float, float, float, float]
    mark: Mark


def in_frame(tables: SkyTables, solution: Solution, year: float = EPOCH, also: Iterable[Mark] = ()) -> SkyInFrame:
    """The objects, stars and lines of a solved frame; a few ms.

    Parameters
    ----------
    tables : SkyTables
        Objects, named stars and lines of the sky.
    solution : Solution
        Where the frame points.
    year : float
        Epoch of the stars' places, Julian year.
    also : Iterable[Mark]
        Marks from elsewhere, as of planets.
    """
    centre, reach = solution.centre_vector, solution.radius_rad
    marks = [*_objects(tables, solution, centre, reach), *_stars(tables, solution, centre, reach, year), *also]
    marks.sort(key=lambda mark: mark.mag)
    if marks and marks[0].mag > NAMELESS:
        marks[0] = replace(marks[0], mag=NAMELESS)
    lines = {kind: tuple(_lines(solution, chains, centre, reach)) for kind, chains in tables.lines.items()}
    places = np.array([mark.xy for mark in marks]).reshape(-1, 2)
    return SkyInFrame(tuple(marks), lines, places, tuple(_constellations(tables, solution, centre, reach)))


def _constellations(
    tables: SkyTables, solution: Solution, centre: Floats, reach: float
) -> Iterable[tuple[str, Floats]]:
    """Of every figure that has two stars and more in the frame its name, and the middle of these."""
    if not tables.constellations:
        return
    names, figures = zip(*tables.constellations, strict=True)
    vectors, whose = np.concatenate(figures), np.repeat(np.arange(len(names)), [len(figure) for figure in figures])
    rows = np.flatnonzero(in_reach(vectors, centre, reach))
    xy = solution.pixels_of(vectors[rows])
    seen = inside(solution, xy)
    whose, xy = whose[rows[seen]], xy[seen]
    for k in np.flatnonzero(np.bincount(whose, minlength=len(names)) >= LEAST_FIGURE).tolist():
        yield names[k], xy[whose == k].mean(axis=0)


def around_text(tables: SkyTables, solution: Solution) -> str:
    """What is said of the smallest object with a name that the whole frame lies in; nothing where there is none."""
    objects = tables.objects
    for row in holding(objects, solution.centre_vector, solution.radius_rad).tolist():
        if objects.common[row] or objects.messier[row]:
            name = str(objects.common[row]).partition(",")[0] or objects.designation(row)
            return tr("within {name}", name=name)
    return ""


def in_reach(vectors: Floats, centre: Floats, reach_rad: float) -> Bools:
    """Which unit vectors (N, 3) are within ``reach_rad`` of the centre."""
    return np.asarray(vectors @ centre > np.cos(min(reach_rad, np.pi)))


def _objects(tables: SkyTables, solution: Solution, centre: Floats, reach: float) -> Iterable[Mark]:
    objects, ranks = tables.objects, tables.ranks
    rows = np.flatnonzero(in_reach(objects.vector, centre, 1.2 * reach) & np.isfinite(ranks))
    xy = solution.pixels_of(objects.vector[rows])
    seen = np.flatnonzero(inside(solution, xy))
    seen = seen[np.argsort(ranks[rows[seen]], kind="stable")[:MOST]]
    rows, xy = rows[seen], xy[seen]
    rings = solution.pixels_of(ellipses(tables, rows).reshape(-1, 3)).reshape(len(rows), POINTS + 1, 2)
    radii = np.nan_to_num(np.hypot(*np.moveaxis(rings - xy[:, None], -1, 0)).max(axis=1), nan=0.0)
    largest = MOST_RADII * np.hypot(solution.camera.width, solution.camera.height) / 2.0
    for row, place, ring, radius in zip(rows.tolist(), xy, rings, radii.tolist(), strict=True):
        shapes: tuple[Floats, ...] = (ring,) if radius > 0.0 else ()
        if row in tables.outlines:
            drawn = (solution.pixels_of(shape) for shape in tables.outlines[row])
            shapes = tuple(shape for shape in drawn if np.isfinite(shape).all()) or shapes
            radius = max((float(np.hypot(*(shape - place).T).max()) for shape in shapes), default=0.0)
        elif not 0.0 < radius < largest and objects.major[row] > 1.0:
            continue  # about the whole frame
        name, text = tables.texts[row]
        yield Mark(str(objects.kind[row]), row, place, radius, float(ranks[row]), text, name, shapes)


def ellipses(tables: SkyTables, rows: Ints) -> Floats:
    """ICRS vectors (N, POINTS + 1, 3) of the ellipses of objects; circles of the same area where the PA is unknown."""
    objects = tables.objects.take(rows)
    x, y = objects.vector[:, 0], objects.vector[:, 1]
    flat = np.maximum(np.hypot(x, y), 1e-12)
    east = np.stack([-y / flat, x / flat, np.zeros_like(x)], axis=1)[:, None]
    north = cross_product(objects.vector[:, None], east)
    major = np.nan_to_num(objects.major)
    minor = np.where(np.isfinite(objects.minor), objects.minor, major)
    known = np.isfinite(objects.pa_deg)
    mean = np.sqrt(major * minor)
    a, b = (np.radians(np.where(known, side, mean) / 120.0)[:, None, None] for side in (major, minor))
    pa = np.radians(np.nan_to_num(objects.pa_deg))[:, None, None]
    along, across = np.cos(pa) * north + np.sin(pa) * east, np.cos(pa) * east - np.sin(pa) * north
    t = np.linspace(0.0, 2.0 * np.pi, POINTS + 1)[None, :, None]
    step = a * np.cos(t) * along + b * np.sin(t) * across
    far = np.linalg.norm(step, axis=2, keepdims=True)
    return np.asarray(np.cos(far) * objects.vector[:, None] + np.sinc(far / np.pi) * step)


def _stars(tables: SkyTables, solution: Solution, centre: Floats, reach: float, year: float) -> Iterable[Mark]:
    stars = tables.stars
    rows = np.flatnonzero(in_reach(stars.vector, centre, 1.1 * reach + 1e-4))
    nameless = stars.name[rows] == ""
    rows = rows[~nameless | (np.cumsum(nameless) <= MOST)]  # of a wide frame the brightest
    xy = solution.pixels_of(unit(stars.vector[rows] + (year - EPOCH) * stars.step[rows]))
    rows, xy = rows[seen := inside(solution, xy)], xy[seen]
    given, mags = stars.name[rows].tolist(), stars.mag[rows].tolist()
    for row, place, named, mag in zip(rows.tolist(), xy, given, mags, strict=True):
        name = named or stars.called(row)
        plain = " " not in name or mag < BRIGHTEST  # Rigil Kentaurus comes before Toliman
        later = -FIRST * plain if named else NUMBERED
        yield Mark("star", row, place, 0.0, star_rank(mag) + later, name, name)


def _lines(solution: Solution, chains: tuple[Floats, ...], centre: Floats, reach: float) -> Iterable[Floats]:
    """The parts of chains of great-circle arcs within the frame, px; each arc is cut by the circle about the frame.

    On the arc's plane the circle of radius R about the centre c cuts angles t0 +- w with cos w = cos R / |c in plane|.
    """
    first = np.concatenate([chain[:-1] for chain in chains])
    last = np.concatenate([chain[1:] for chain in chains])
    pole = cross_product(first, last)
    length = np.arctan2(np.linalg.norm(pole, axis=1), np.sum(first * last, axis=1))
    side = cross_product(unit(pole + 1e-30), first)
    x, y = first @ centre, side @ centre
    flat = np.maximum(np.hypot(x, y), 1e-12)
    radius = min(1.05 * reach, np.pi - 1e-3)
    half = np.arccos(np.clip(np.cos(radius) / flat, -1.0, 1.0))
    middle = np.arctan2(y, x)
    # middle is in -pi..pi while the arc runs from 0 up: the stretch may lie a turn away
    for turn in (-2.0 * np.pi, 0.0, 2.0 * np.pi):
        low, high = np.maximum(middle + turn - half, 0.0), np.minimum(middle + turn + half, length)
        rows = np.flatnonzero((high > low) & (length > 1e-9))
        if not len(rows):
            continue
        counts = 2 + np.minimum((high - low)[rows] / reach * SAMPLES, 4 * SAMPLES).astype(np.int64)
        ends = np.cumsum(counts)
        share = (np.arange(ends[-1]) - np.repeat(ends - counts, counts)) / np.repeat(counts - 1, counts)
        arc = np.repeat(rows, counts)
        angle = (low[arc] + share * (high - low)[arc])[:, None]
        xy = solution.pixels_of(np.cos(angle) * first[arc] + np.sin(angle) * side[arc])
        # the solution gives NaN outside the lens model's domain, where the distortion would fold back
        good = np.isfinite(xy[:, 0])
        ends = np.cumsum(np.add.reduceat(good, ends - counts))
        xy = xy[good]
        for begin, end in pairwise([0, *ends.tolist()]):
            if end - begin > 1:
                yield xy[begin:end]


def among(xy: Floats, stars: Floats) -> Bools:
    """Which places (N, 2) are those of one of the stars (M, 2), to 0.01 px."""
    grid = np.array([1.0, 1e7])
    return np.isin(np.rint(xy * 100.0) @ grid, np.rint(stars * 100.0) @ grid)


def faintest_of(view: View, solution: Solution, stars: float = 0.5, objects: float = 0.5) -> dict[str, float]:
    """The ranks down to which stars and objects are named: fewer in a wide view, more in a narrow one.

    Parameters
    ----------
    view : View
        What part of the image is seen, and at which zoom.
    solution : Solution
        Gives the scale.
    stars, objects : float
        How much the person wishes to see of each, 0 to 1.
    """
    x0, y0, x1, y1 = view.bounds
    across = max(x1 - x0, y1 - y0, 1.0) / view.scale * solution.camera.scale_arcsec_px / 3600.0
    return named_to(across, stars, objects)


def named_to(across_deg: float, stars: float = 1.0, objects: float = 1.0) -> dict[str, float]:
    """The ranks down to which so wide a view names stars and objects; of each as much as is wished, 0 to 1."""
    wide = float(np.log10(np.clip(across_deg, 0.05, 180.0)))
    return {
        "star": max(12.0 - 4.2 * wide, star_rank(TO_MAG)) + 8.0 * (stars - 0.5),
        "object": 15.5 - 6.0 * wide + 10.0 * (objects - 0.5),
        "body": BODIES,
    }


def star_rank(mag: Magnitude) -> Magnitude:
    """The rank of stars by their magnitude; `NUMBERED` and `FIRST` move it by what kind of name they have."""
    return 1.2 * mag + 2.0


def mark_at(sky: SkyInFrame, x: float, y: float, reach: float, shown: dict[str, float]) -> Mark | None:
    """The smallest mark shown at a place of the image; None when there is none.

    Parameters
    ----------
    sky : SkyInFrame
        The marks of the frame.
    x, y : float
        The place, image px.
    reach : float
        How near a mark counts, image px.
    shown : dict[str, float]
        The last rank shown of each group.
    """
    away = np.hypot(*(sky.places - (x, y)).T)
    last = [shown.get(mark.group, -np.inf) for mark in sky.marks]
    held = (
        (max(mark.radius, reach) + far, k)
        for k, (mark, far) in enumerate(zip(sky.marks, away.tolist(), strict=True))
        if far <= max(mark.radius, reach) and mark.mag <= last[k]
    )
    best = min(held, default=None)
    return None if best is None else sky.marks[best[1]]


def outlined(sky: SkyInFrame, view: View, faintest: dict[str, float]) -> list[Mark]:
    """Marks down to the rank of their kind, with an outline larger than a dot and not about the whole view."""
    at = view.to_screen(sky.places)
    x0, y0, x1, y1 = view.bounds
    largest = MOST_RADII * max(x1 - x0, y1 - y0)
    drawn = []
    for mark, (x, y) in zip(sky.marks, at.tolist(), strict=True):
        radius = mark.radius * view.scale
        near = x0 - radius < x < x1 + radius and y0 - radius < y < y1 + radius
        if mark.mag > max(faintest.values(), default=-np.inf):
            break
        seen = mark.mag <= faintest.get(mark.group, -np.inf)
        if seen and mark.shapes and DOT_PX <= radius < largest and near:
            drawn.append(mark)
    return drawn[:MOST_OUTLINES]


def labels(
    sky: SkyInFrame,
    view: View,
    faintest: dict[str, float],
    text_size: TextSize,
    taken: Iterable[tuple[float, float, float, float]] = (),
    amount: float = 0.5,
) -> list[Label]:
    """Names of the marks in sight, the best first, none over another.

    Parameters
    ----------
    sky : SkyInFrame
        The marks of the frame.
    view : View
        What part of the image is seen.
    faintest : dict[str, float]
        The last rank named of "star", "object" and "body"; a kind that is absent has no names.
    text_size : TextSize
        Width and height of a text, screen px.
    taken : Iterable[tuple[float, float, float, float]]
        Boxes (x, y, w, h) to leave free, screen px.
    amount : float
        How many names the person wishes to see, 0 to 1.
    """
    at = view.to_screen(sky.places)
    x0, y0, x1, y1 = view.bounds
    seen = np.flatnonzero((at[:, 0] >= x0) & (at[:, 0] <= x1) & (at[:, 1] >= y0) & (at[:, 1] <= y1))
    boxes = np.full((4, BEST + 64), np.inf)  # left, top, right and bottom
    count, room = 0, boxes.shape[1]
    for x, y, w, h in taken:
        boxes[:, count % room] = x, y, x + w, y + h
        count += 1
    most = int((x1 - x0) * (y1 - y0) / AREA_PX2 * 4.0 ** (2.0 * amount - 1.0)) + 4
    chosen: list[Label] = []
    spots_x, spots_y = np.ascontiguousarray(at[seen[: 2 * most]].T)  # which a name rather leaves free
    used: set[str] = set()
    named, stars = np.full((BEST, 2), np.inf), 0  # places of the stars that have a name
    for number in seen[:BEST].tolist():
        mark = sky.marks[number]
        if len(chosen) >= most or count >= room - 2:
            break
        if mark.mag > faintest.get(mark.group, -np.inf):
            continue
        px, py = at[number].tolist()
        if mark.kind == "star" and (np.hypot(*(named[:stars] - at[number]).T) < TWIN_PX).any():
            continue  # Toliman beside Rigil Kentaurus: on the screen one star
        common = mark.text.removeprefix(mark.short).strip()
        dot = mark.kind != "star" and mark.radius * view.scale < DOT_PX
        text = mark.short if dot or common in used else mark.text
        used.add(common or text)
        width, height = text_size(text)
        free = None
        for x, y in _spots(_outline(mark, view, at[number]), at[number], width, height):
            box = (x, y, x + width, y + height)
            if x < x0 or y < y0 or box[2] > x1 or box[3] > y1:
                continue
            lefts, tops, rights, bottoms = boxes[:, :count]
            hit = (lefts < box[2] + APART_PX) & (x - APART_PX < rights) & (tops < box[3]) & (y < bottoms)
            if not hit.any():
                inside_x, inside_y = (spots_x > x) & (spots_x < box[2]), (spots_y > y) & (spots_y < box[3])
                covers = (inside_x & inside_y).any()
                free = box if free is None or not covers else free
                if not covers:
                    break
        if free is not None:
            boxes[:, count] = free
            count += 1
            chosen.append(Label(text, (free[0], free[1], width, height), mark))
            if mark.kind == "star":
                named[stars], stars = at[number], stars + 1
            if mark.radius * view.scale < DOT_PX:  # no other name over the spot itself
                boxes[:, count] = px - STAR_PX, py - STAR_PX, px + STAR_PX, py + STAR_PX
                count += 1
    return chosen


def constellation_labels(
    sky: SkyInFrame, view: View, text_size: TextSize, taken: Iterable[tuple[float, float, float, float]]
) -> list[tuple[str, tuple[float, float, float, float]]]:
    """The names of constellations and their boxes, at the middle of what is seen of a figure or beside it.

    Parameters
    ----------
    sky : SkyInFrame
        What the frame holds.
    view : View
        What is seen of it.
    text_size : TextSize
        Width and height of a text, px.
    taken : iterable of (float, float, float, float)
        Boxes (x, y, w, h) that names leave free.
    """
    found = []
    boxes = np.array([*taken, *[(np.inf, np.inf, 0.0, 0.0)] * len(sky.constellations)]).reshape(-1, 4)
    boxes[:, 2:] += boxes[:, :2]
    x0, y0, x1, y1 = view.bounds
    for name, xy in sky.constellations:
        width, height = text_size(name.upper())
        middle = view.to_screen(xy) - (width / 2.0, height / 2.0)
        for way in AROUND_FIGURE:
            x, y = (middle + np.multiply(way, (0.6 * width, 1.5 * height))).tolist()
            if not (x0 <= x <= x1 - width and y0 <= y <= y1 - height):
                continue
            hit = (boxes[:, 0] < x + width) & (x < boxes[:, 2]) & (boxes[:, 1] < y + height) & (y < boxes[:, 3])
            if not hit.any():
                found.append((name.upper(), (x, y, width, height)))
                boxes[-len(found)] = x, y, x + width, y + height
                break
    return found


def _outline(mark: Mark, view: View, at: Floats) -> Floats:
    """The places (N, 2) of the screen that a name stands beside: the outline's in sight, or a circle's."""
    if mark.shapes and mark.radius * view.scale >= DOT_PX:
        places = view.to_screen(np.concatenate(mark.shapes))
        places = places[((places >= view.bounds[:2]) & (places <= view.bounds[2:])).all(axis=1)]
        if len(places):
            return places
    least = max(STAR_PX, DISC_PX * view.scale) if mark.kind == "star" else DOT_PX
    radius = max(mark.radius * view.scale, least)
    return np.asarray(at + radius * WAYS / np.hypot(*WAYS.T)[:, None])


def _spots(outline: Floats, at: Floats, width: float, height: float) -> Iterable[tuple[float, float]]:
    """Upper left corners of a name beside an outline (N, 2) px, the nicest first."""
    for way in WAYS:
        x, y = outline[np.argmax(outline @ way)] + GAP_PX * way + (way - 1.0) / 2.0 * (width, height)
        yield float(x), float(y)
    if np.ptp(outline[:, 0]) > 2.0 * width:
        yield float(at[0]) - width / 2.0, float(at[1]) - height / 2.0
