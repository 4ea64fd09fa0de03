"""The newest frame of an alignment on the screen, with the star to drag and where it belongs."""

import math

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QPainter, QPen

from kochab.core.frame import Frame
from kochab.core.solution import Solution
from kochab.polar.star_target import StarTarget, star_target
from kochab.text.translation import tr
from kochab.window.image.frame_image import FrameImage, prepare
from kochab.window.image.frame_view import FrameView
from kochab.window.image.screen_image import Viewport
from kochab.window.job import Job
from kochab.window.services import Services
from kochab.window.themes import theme_colours
from kochab.window.widgets import draw_text
from kochab.workflows.session.alignment_state import AlignmentState

STAR_PX, PLACE_PX, CROSS_PX = 15.0, 17.0, 30.0  # radii on the screen
NEAR_PX = 6.0  # nearer to each other the two are one
EDGE_PX = 60.0  # of the view, for a place that is outside it
BELOW_PX = 16.0  # of a mark, for the middle of its word


class LiveFrame(FrameView):
    """Shows frames as they come, the newest always next; a frame is prepared in a job."""

    pictured = Signal()  # there is a picture now, or none any more

    def __init__(self, services: Services) -> None:
        super().__init__()
        self.setAccessibleName(tr("Live frame"))
        self._services = services
        self._job: Job | None = None
        self._next: tuple[Frame, Solution | None] | None = None
        self._solution: Solution | None = None
        self.target: StarTarget | None = None
        self.marks = self._paint_target
        services.looks.changed.connect(self._look_again)

    def begin(self) -> None:
        """Nothing of another alignment is shown any more."""
        self._next = self._solution = self.target = None
        self.show_picture(None)
        self.pictured.emit()

    def see(self, frame: Frame, solution: Solution | None) -> None:
        """Show a frame; one that comes while another is prepared takes the place of those that wait."""
        self._next = (frame, solution)
        if self._job is None:
            self._prepare()

    def show_state(self, state: AlignmentState) -> None:
        """Find the star and its place anew."""
        error, now = state.bolt_error, state.attitude
        if error is None or now is None or self._solution is None or not state.running:
            self.target = None
        else:
            before = None if self.target is None else self.target.star
            self.target = star_target(self._solution, now.matrix, error, before)
        self.update()

    def _prepare(self) -> None:
        coming, self._next = self._next, None
        if coming is None:
            return
        frame, solution = coming
        self._job = job = self._services.jobs.run(prepare(frame), "polar-frame")
        job.succeeded.connect(lambda picture: self._show(picture, solution))
        job.finished.connect(self._prepared)

    def _show(self, picture: FrameImage, solution: Solution | None) -> None:
        kept = self.picture is not None and (self.picture.width, self.picture.height) == (picture.width, picture.height)
        self._solution = solution or self._solution
        self.show_picture(picture, keep_view=kept)
        self.set_look(picture.auto, colour=False, red=self._services.looks.is_night)
        self.pictured.emit()

    def _prepared(self) -> None:
        self._job = None
        self._prepare()

    def _look_again(self) -> None:
        if isinstance(self.picture, FrameImage):
            self.set_look(self.picture.auto, colour=False, red=self._services.looks.is_night)

    def _paint_target(self, painter: QPainter, viewport: Viewport) -> None:
        if self.target is None:
            return
        colours = theme_colours()
        star, place = (QPointF(x, y) for x, y in viewport.to_screen(np.array([self.target.at, self.target.belongs])))
        words = tr("belongs here") if self.target.inside else tr("belongs beyond the edge")
        if not self.target.inside:
            place = _towards(star, place, QRectF(self.rect()).adjusted(EDGE_PX, EDGE_PX, -EDGE_PX, -EDGE_PX))
        apart = math.hypot(place.x() - star.x(), place.y() - star.y())
        if apart > STAR_PX + PLACE_PX:
            way = (place - star) / apart
            painter.setPen(QPen(QColor(colours.detected), 2.0, Qt.PenStyle.DashLine))
            painter.drawLine(star + way * STAR_PX, place - way * PLACE_PX)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(QColor(colours.detected), 2.0))
        painter.drawEllipse(star, STAR_PX, STAR_PX)
        good = QColor(colours.horizon_text)  # the theme's own green is dark on the dark sky of the light one
        painter.setPen(QPen(good, 2.5))
        painter.drawEllipse(place, PLACE_PX, PLACE_PX)
        for dx, dy in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            painter.drawLine(place + QPointF(dx, dy) * PLACE_PX * 0.7, place + QPointF(dx, dy) * CROSS_PX)
        draw_text(painter, place + QPointF(0, CROSS_PX + BELOW_PX), words, colours.sky)
        if apart > CROSS_PX:
            painter.setPen(QColor(colours.detected))
            beside = STAR_PX + BELOW_PX  # on the side where its place is not
            below = QPointF(0, -beside if place.y() > star.y() else beside)
            draw_text(painter, star + below, tr("this star"), colours.sky)


def _towards(star: QPointF, place: QPointF, box: QRectF) -> QPointF:
    """The last point of the way from a star to its place that is inside the box."""
    way, shares = place - star, [1.0]
    for along, at, low, high in (
        (way.x(), star.x(), box.left(), box.right()),
        (way.y(), star.y(), box.top(), box.bottom()),
    ):
        if along:
            shares.append(max(0.0, ((high if along > 0.0 else low) - at) / along))
    return star + way * min(shares)
