"""The marks over a frame: how each kind is painted, and all of them in one pass; sizes are screen px."""

from collections.abc import Callable, Sequence
from dataclasses import field
from functools import lru_cache
from struct import pack

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QByteArray, QDataStream, QPointF, QRect, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPainterPath, QPen, QPixmap, QPolygonF

from kochab.core.arrays import Floats
from kochab.core.solution import Solution
from kochab.core.values import mutable
from kochab.frames.export import compass
from kochab.frames.sky_grid import GridLine, SiteSky, grid_lines, named_lines, pieces
from kochab.sky.kinds import FAMILIES
from kochab.sky.layer import (
    DOT_PX,
    DOTTED,
    LAYER_OF,
    LINES,
    OUTLINE,
    TEXTS,
    Label,
    Layers,
    Mark,
    SkyInFrame,
    TextSize,
    View,
    among,
    around_text,
    constellation_labels,
    in_frame,
    mark_at,
    outlined,
)
from kochab.sky.layer import labels as place_labels
from kochab.sky.sky_tables import SkyTables
from kochab.window.image.screen_image import LabelSpace, Viewport
from kochab.window.themes import THEMES, Colours, theme_colours, translucent

DETECTED_PX, IDENTIFIED_PX = 4.5, 8.0  # radii
MOST_CIRCLES = 4000  # the brightest
CROWDED = 300  # from this many circles on they are drawn fainter and smaller
HALO_PX = 3.0  # of the dark edge around a text
ARROW_PX, AROUND_ARROW_PX = 32.0, 52.0
EDGE_PX = 4.0  # how much wider an arrow's dark edge is


@mutable
class Brush:
    """What every mark needs to paint itself."""

    painter: QPainter
    view: Viewport
    colours: Colours
    space: LabelSpace
    chosen: dict[str, str] = field(default_factory=dict)  # colours of layers, where the theme's are not wanted
    _font: str = field(init=False)
    _ratio: float = field(init=False)

    def __post_init__(self) -> None:
        self._font, self._ratio = self.painter.font().toString(), self.painter.device().devicePixelRatio()

    def ink(self, layer: str, usual: str) -> str:
        """The colour of a layer: the chosen one, or the theme's of this name; at night always the theme's red."""
        own = str(getattr(self.colours, usual))
        return own if self.colours is THEMES["night"] else self.chosen.get(layer, own)

    def ink_of(self, mark: Mark) -> str:
        """The colour of a mark's name and outline."""
        return self.ink(LAYER_OF[mark.group], FAMILIES.get(mark.kind, "nebula"))

    def pen(self, colour: str, width: float, alpha: int = 255) -> None:
        self.painter.setPen(QPen(translucent(colour, alpha), width))
        self.painter.setBrush(Qt.BrushStyle.NoBrush)

    def text(self, at: QPointF, text: str, colour: str) -> None:
        """Text with a dark edge from its base line on, unless its place is taken."""
        placed = self.space.place(self.box(text).translated(at))
        if placed is not None:
            self.draw(placed.topLeft(), text, colour)

    def box(self, text: str) -> QRectF:
        """The bounding box of a text, relative to the start of its baseline."""
        return _box(text, self._font)

    def draw(self, corner: QPointF, text: str, colour: str) -> None:
        """Text whose box has its upper left corner there."""
        words = _words(text, self._font, colour, self.colours.halo, self._ratio)
        self.painter.drawPixmap(corner - QPointF(HALO_PX, HALO_PX), words)


@lru_cache(maxsize=64)
def _written(font: str) -> tuple[QFont, QFontMetricsF]:
    written = QFont()
    written.fromString(font)
    return written, QFontMetricsF(written)


@lru_cache(maxsize=4096)
def _box(text: str, font: str) -> QRectF:
    """The same, cached apart from the drawing: most texts that are measured find no room and are never drawn."""
    return _written(font)[1].boundingRect(text)


@lru_cache(maxsize=2048)
def _words(text: str, font: str, colour: str, halo: str, ratio: float) -> QPixmap:
    """A text drawn with a dark edge."""
    written, _ = _written(font)
    ground = _box(text, font).adjusted(-HALO_PX, -HALO_PX, HALO_PX, HALO_PX)
    picture = QPixmap(*(int(np.ceil(side * ratio)) for side in (ground.width(), ground.height())))
    picture.setDevicePixelRatio(ratio)
    picture.fill(Qt.GlobalColor.transparent)
    painter = QPainter(picture)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    letters = QPainterPath()
    letters.addText(-ground.topLeft(), written, text)
    painter.strokePath(letters, QPen(translucent(halo, 200), HALO_PX, j=Qt.PenJoinStyle.RoundJoin))
    painter.setFont(written)
    painter.setPen(QColor(colour))
    painter.drawText(-ground.topLeft(), text)
    painter.end()
    return picture


def circles(brush: Brush, xy: Floats, colour: str, radius: float, width: float) -> None:
    """A circle around each image place (N, 2) in sight.

    Parameters
    ----------
    brush : Brush
        Paints, and knows what part is in sight.
    xy : Floats
        Image places (N, 2), px.
    colour : str
        Of the line.
    radius, width : float
        Of circle and line, screen px.
    """
    at = brush.view.to_screen(xy[:MOST_CIRCLES])
    at = at[in_sight(at, brush.view)]
    ratio = brush.painter.device().devicePixelRatio()
    alpha, size = (235, 1.0) if len(at) < CROWDED else (170, 0.65)
    ring = _ring(colour, alpha, size * radius, width, ratio)
    half = ring.deviceIndependentSize().width() / 2.0
    for x, y in (at - half).tolist():
        brush.painter.drawPixmap(QPointF(x, y), ring)


@lru_cache(maxsize=32)
def _ring(colour: str, alpha: int, radius: float, width: float, ratio: float) -> QPixmap:
    """A circle drawn once: copying it takes a twentieth of the time."""
    size = int(np.ceil(2 * radius + width)) + 2
    picture = QPixmap(round(size * ratio), round(size * ratio))
    picture.setDevicePixelRatio(ratio)
    picture.fill(Qt.GlobalColor.transparent)
    painter = QPainter(picture)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(QPen(translucent(colour, alpha), width))
    middle = picture.deviceIndependentSize().width() / 2.0
    painter.drawEllipse(QPointF(middle, middle), radius, radius)
    painter.end()
    return picture


def name(brush: Brush, text: str, at: Floats, colour: str) -> None:
    """One label beside its circle: to the right, or to the left where the widget ends.

    Parameters
    ----------
    brush : Brush
        Paints, and knows what part is in sight.
    text : str
        The label.
    at : Floats
        Middle of its circle (2,), screen px.
    colour : str
        Of the text.
    """
    away = IDENTIFIED_PX + 4
    x = float(at[0]) + away
    width = QFontMetricsF(brush.painter.font()).horizontalAdvance(text)
    if x + width > brush.view.width - 6:
        x = float(at[0]) - away - width
    brush.text(QPointF(x, at[1] + 4), text, colour)


def selection(brush: Brush, at: Floats, text: str) -> None:
    """Four ticks around a screen place, and its label."""
    brush.pen(brush.colours.selected, 2.0)
    inner, outer = IDENTIFIED_PX + 3, IDENTIFIED_PX + 11
    cross(brush, at[0], at[1], inner, outer)
    name(brush, text, at + np.array([6.0, -10.0]), brush.colours.selected)


def cross(brush: Brush, x: float, y: float, inner: float, outer: float) -> None:
    """Four ticks that leave the middle free.

    Parameters
    ----------
    brush : Brush
        Paints.
    x, y : float
        Its middle, screen px.
    inner, outer : float
        Where each tick begins and ends, px from there.
    """
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        near = QPointF(x + dx * inner, y + dy * inner)
        brush.painter.drawLine(near, QPointF(x + dx * outer, y + dy * outer))


def sky_lines(brush: Brush, lines: list[GridLine], edges: QRectF, colour: str, alpha: int) -> None:
    """The lines of a grid inside the frame.

    Parameters
    ----------
    brush : Brush
        Paints, and knows what part is in sight.
    lines : list[GridLine]
        In image px.
    edges : QRectF
        The frame's, screen px.
    colour, alpha : str, int
        Of the lines.
    """
    brush.pen(colour, 1.0, alpha)
    brush.painter.save()
    brush.painter.setClipRect(edges)
    for line in lines:
        for part in pieces(line.xy):
            brush.painter.drawPolyline([QPointF(x, y) for x, y in brush.view.to_screen(part).tolist()])
    brush.painter.restore()


def sky_labels(brush: Brush, lines: list[GridLine], edges: QRectF, colour: str) -> None:
    """What each line is, where it enters the frame.

    Parameters
    ----------
    brush : Brush
        Paints, and knows what part is in sight.
    lines : list[GridLine]
        In image px.
    edges : QRectF
        The frame's, screen px.
    colour : str
        Of the text.
    """
    inside = edges.adjusted(2, 2, -2, -2)
    for line in lines:
        box = inside.left(), inside.top(), inside.right(), inside.bottom()
        spot = line.spot(brush.view.to_screen(line.xy), *box)
        if spot is not None:
            right = inside.right() - 2 - brush.box(line.text).width()
            at = QPointF(min(spot[0] + 4, right), min(spot[1] - 4, inside.bottom() - 6))
            brush.text(at, line.text, colour)


def in_sight(xy: Floats, view: Viewport) -> NDArray[np.bool_]:
    """Which screen places (N, 2) the widget shows, with room for a circle."""
    x, y = xy[:, 0], xy[:, 1]
    return np.asarray((x > -20) & (y > -20) & (x < view.width + 20) & (y < view.height + 20))


def arrows(brush: Brush, solution: Solution, covered: Sequence[QRect] = ()) -> None:
    """Arrows at the top right, or just below what covers them, with dark edges so they show on a bright sky."""
    north, east = compass(solution)
    box = QRectF(brush.view.width - 2 * AROUND_ARROW_PX - 10, 10, 2 * AROUND_ARROW_PX, 2 * AROUND_ARROW_PX)
    for taken in covered:
        if box.intersects(QRectF(taken)):
            box.moveTop(taken.bottom() + 4)
    # No label goes under the arrows.
    brush.space.place(box)
    for shade, more in (
        (translucent(brush.colours.halo, 190), EDGE_PX),
        (QColor(brush.ink("compass", "identified")), 0.0),
    ):
        for way, letter, width in ((north, "N", 2.4), (east, "E", 1.6)):
            _arrow(brush.painter, box.center(), way, QPen(shade, width + more))
            _letter(brush.painter, box.center(), way, letter, shade, ground=more > 0.0)
    brush.painter.setBrush(Qt.BrushStyle.NoBrush)


def _arrow(painter: QPainter, at: QPointF, way: Floats, pen: QPen) -> None:
    dx, dy = way.tolist()
    tip = at + QPointF(dx, dy) * ARROW_PX
    side = QPointF(-dy, dx) * 4.5
    back = at + QPointF(dx, dy) * (ARROW_PX - 10)
    painter.setPen(pen)
    painter.setBrush(pen.color())
    painter.drawLine(at, tip)
    painter.drawPolygon(QPolygonF([tip, back + side, back - side]))


def _letter(painter: QPainter, at: QPointF, way: Floats, letter: str, shade: QColor, ground: bool) -> None:
    """The letter beyond the tip, or its dark background."""
    spot = at + QPointF(*way.tolist()) * (ARROW_PX + 12)
    box = QRectF(spot.x() - 9, spot.y() - 9, 18, 18)
    if ground:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(shade)
        painter.drawRoundedRect(box, 4, 4)
    else:
        painter.setPen(shade)
        painter.drawText(box, Qt.AlignmentFlag.AlignCenter, letter)


@mutable
class Overlay:
    """Paints the sky over a solved frame, and detections, as the ``layers`` say.

    ``selected`` indexes the solution's stars; ``horizon`` tells where and when the frame was taken. No label
    goes where the view is ``covered``, screen px. Without ``tables`` there is no sky layer.
    """

    layers: Layers = field(default_factory=Layers)
    horizon: Callable[[], SiteSky | None] = lambda: None
    covered: list[QRect] = field(default_factory=list)
    tables: SkyTables | None = None
    bodies: tuple[Mark, ...] = ()  # of the Solar System, in this frame
    year: float = 2000.0  # to which the stars have moved
    selected: int | None = None
    picked: Mark | None = None
    labels: list[Label] = field(default_factory=list)
    ranks: dict[str, float] = field(default_factory=dict)  # down to which stars and objects were shown last
    solution: Solution | None = None
    detected: Floats = field(default_factory=lambda: np.empty((0, 2)))
    _stars: Floats = field(default_factory=lambda: np.empty((0, 2)))
    _others: Floats = field(default_factory=lambda: np.empty((0, 2)))
    _grids: dict[str, tuple[object, list[GridLine]]] = field(default_factory=dict)
    _sky: SkyInFrame | None = None
    _paths: dict[str, QPainterPath] = field(default_factory=dict)

    def show(self, detected: Floats, solution: Solution | None) -> None:
        """Detections (N, 2) px, brightest first, and their solution."""
        if solution is not self.solution:
            self._sky, self.picked, self.bodies, self._grids = None, None, (), {}
        self.detected, self.solution, self.selected = detected, solution, None
        self._stars = np.empty((0, 2)) if solution is None else solution.named_px
        self._others = detected[~among(detected, self._stars)]

    def clear(self) -> None:
        self.show(np.empty((0, 2)), None)

    def show_bodies(self, bodies: tuple[Mark, ...]) -> None:
        """Add the bodies of the Solar System to the present frame."""
        self.bodies, self._sky = bodies, None

    @property
    def circled(self) -> Floats:
        """The detections (N, 2) with a circle; an identified star has its own, unless that kind is off."""
        shown = self._others if self.layers.on["identified"] else self.detected
        return shown if self.layers.on["detected"] else shown[:0]

    @property
    def sky(self) -> SkyInFrame | None:
        """What the tables have in the frame, found when first asked for."""
        if self._sky is None and self.solution is not None and self.tables is not None:
            self._sky = in_frame(self.tables, self.solution, self.year, self.bodies)
            self._paths = {kind: _path(lines) for kind, lines in self._sky.lines.items()}
        return self._sky

    def mark_at(self, x: float, y: float, reach: float) -> Mark | None:
        """The star or object at a place of the image, px, of those that suit the zoom."""
        return None if self.sky is None else mark_at(self.sky, x, y, reach, self.ranks)

    def paint(self, painter: QPainter, view: Viewport) -> None:
        """Everything that is switched on, back to front."""
        brush = Brush(painter, view, theme_colours(), LabelSpace(view.width, view.height), self.layers.colour)
        for box in self.covered:
            brush.space.place(QRectF(box))
        solution = self.solution
        edges = _edges(view, solution)
        grids = {} if solution is None else self._grid(view, solution)
        for kind, lines in grids.items():
            sky_lines(brush, lines, edges, brush.ink(kind, LINES[kind][0]), self.layers.opaque(kind))
        self._draw_lines(brush, edges)
        circles(brush, self.circled, brush.ink("detected", "detected"), DETECTED_PX, 1.0)
        if solution is not None:
            self._solved(brush, solution, edges)
        named = {} if self.sky is None else named_lines(self.sky.lines, self.layers.on)
        for kind, lines in {**named, **grids}.items():
            sky_labels(brush, lines, edges, brush.ink(kind, TEXTS[kind]))

    def _solved(self, brush: Brush, solution: Solution, edges: QRectF) -> None:
        if self.layers.on["identified"]:
            circles(brush, self._stars, brush.ink("identified", "identified"), IDENTIFIED_PX, 1.5)
        if self.layers.on["centre"]:
            camera = solution.camera
            x, y = brush.view.to_screen(np.array([(camera.width - 1) / 2, (camera.height - 1) / 2]))
            # A dark edge below keeps the cross readable on a bright sky.
            for colour, width, alpha in ((brush.colours.halo, 4.5, 140), (brush.ink("centre", "centre"), 1.8, 255)):
                brush.pen(colour, width, alpha)
                cross(brush, x, y, 6.0, 18.0)
        if self.layers.on["compass"]:
            arrows(brush, solution, self.covered)
        if self.selected is not None and self.selected < len(solution.named):
            star = solution.named[self.selected]
            at = brush.view.to_screen(self._stars[self.selected])
            selection(brush, at, star.name or star.id)
        elif self.picked is not None:
            brush.pen(brush.colours.selected, 2.0)
            x, y = brush.view.to_screen(self.picked.xy)
            cross(brush, x, y, IDENTIFIED_PX + 3, IDENTIFIED_PX + 11)
        self._draw_sky(brush, solution, edges)

    def _draw_lines(self, brush: Brush, edges: QRectF) -> None:
        """Figures, boundaries and circles of the sky; kept as paths in image px, so that zooming costs nothing."""
        if self.sky is None:
            return
        painter, view = brush.painter, brush.view
        painter.save()
        painter.setClipRect(edges)
        painter.translate(view.dx, view.dy)
        painter.scale(view.scale, view.scale)
        # Pixel (0, 0) is the centre of the first pixel, half a pixel inside the image's corner.
        painter.translate(0.5, 0.5)
        for kind, path in self._paths.items():
            if self.layers.on[kind]:
                dashes = Qt.PenStyle.DotLine if kind == DOTTED else Qt.PenStyle.SolidLine
                # Of one px of the screen: Qt fills the outlines of wider lines, which at 4K takes ten times as long.
                pen = QPen(translucent(brush.ink(kind, LINES[kind][0]), self.layers.opaque(kind)), 1.0, dashes)
                pen.setCosmetic(True)
                painter.strokePath(path, pen)
        painter.restore()

    def _draw_sky(self, brush: Brush, solution: Solution, edges: QRectF) -> None:
        """Outlines and names: those that suit the zoom, and no name over another or over what covers the view."""
        self.labels, self.ranks = [], {}
        if self.sky is None or not any(self.layers.on[layer] for layer in LAYER_OF.values()):
            return
        view, bounds = brush.view, (edges.left(), edges.top(), edges.right(), edges.bottom())
        seen = View(view.scale, view.dx, view.dy, bounds)
        self.ranks = self.layers.faintest(seen, solution)

        def size(text: str) -> tuple[float, float]:
            box = brush.box(text)
            return box.width(), box.height()

        taken = [(box.x(), box.y(), box.width(), box.height()) for box in brush.space.taken]
        self.labels = place_labels(self.sky, seen, self.ranks, size, taken, self.layers.density)
        brush.painter.save()
        brush.painter.setClipRect(edges)
        for mark in outlined(self.sky, seen, self.ranks):
            brush.pen(brush.ink_of(mark), 1.2, OUTLINE)
            for shape in mark.shapes:
                brush.painter.drawPolyline([QPointF(x, y) for x, y in view.to_screen(shape).tolist()])
        brush.painter.restore()
        for label in self.labels:
            x, y, width, height = label.box
            brush.space.taken.append(QRectF(x, y, width, height))
            if label.mark.kind != "star" and label.mark.radius * view.scale < DOT_PX:
                brush.pen(brush.ink_of(label.mark), 1.2, OUTLINE)
                brush.painter.drawEllipse(QPointF(*view.to_screen(label.mark.xy).tolist()), DOT_PX, DOT_PX)
            brush.draw(QPointF(x, y), label.text, brush.ink_of(label.mark))
        self._draw_wholes(brush, solution, seen, size)

    def _draw_wholes(self, brush: Brush, solution: Solution, seen: View, size: TextSize) -> None:
        """The constellations' names, and in a corner the object that the whole frame lies in."""
        assert self.sky is not None, "drawn"
        assert self.tables is not None, "drawn"
        if self.layers.on["objects"] and (within := around_text(self.tables, solution)):
            corner = QRectF(seen.bounds[0] + 8.0, seen.bounds[1] + 8.0, *size(within))
            brush.space.taken.append(corner)
            brush.draw(corner.topLeft(), within, brush.ink("objects", "nebula"))
        taken = [(box.x(), box.y(), box.width(), box.height()) for box in brush.space.taken]
        for text, box in constellation_labels(self.sky, seen, size, taken) if self.layers.on["figures"] else ():
            brush.space.taken.append(QRectF(*box))
            brush.draw(QPointF(box[0], box[1]), text, brush.ink("figures", "figure"))

    def _grid(self, view: Viewport, solution: Solution) -> dict[str, list[GridLine]]:
        """The lines of the grids that are on; that of the horizon only where and when the frame says so."""
        wanted: dict[str, SiteSky | None] = {"grid": None} if self.layers.on["grid"] else {}
        if self.layers.on["altaz"] and (horizon := self.horizon()) is not None:
            wanted["altaz"] = horizon
        for kind, horizon in wanted.items():
            # `show` forgets the grids of another solution, whose id Python may give to this one.
            key = view, id(solution), horizon
            if kind not in self._grids or self._grids[kind][0] != key:
                self._grids[kind] = key, grid_lines(solution, *view.corners(), horizon)
        return {kind: self._grids[kind][1] for kind in wanted}


def _path(lines: tuple[Floats, ...]) -> QPainterPath:
    """Lines (N, 2) as one path, read from what Qt writes of one: ten times as fast as adding points to it."""
    path, lengths = QPainterPath(), [len(line) for line in lines]
    if lengths:
        elements = np.ones(sum(lengths), dtype=[("is_line", ">i4"), ("xy", ">f8", 2)])
        elements["is_line"][np.cumsum([0, *lengths[:-1]])] = 0  # a move, to where a line begins
        elements["xy"] = np.concatenate(lines)
        begin, fill_rule = 0, 0
        head, tail = pack(">i", len(elements)), pack(">ii", begin, fill_rule)
        stream = QDataStream(QByteArray(head + elements.tobytes() + tail))
        stream >> path
    return path


def _edges(view: Viewport, solution: Solution | None) -> QRectF:
    """The part of the frame that the widget shows, screen px."""
    whole = QRectF(0, 0, view.width, view.height)
    if solution is None:
        return whole
    (x0, y0), (x1, y1) = view.to_screen(
        np.array([[-0.5, -0.5], [solution.camera.width - 0.5, solution.camera.height - 0.5]])
    )
    return whole.intersected(QRectF(QPointF(x0, y0), QPointF(x1, y1)))
