"""The page of a night in the window: the one that ``kochab night`` writes, in the colours of the theme."""

import re
from collections.abc import Sequence

from PySide6.QtCore import QByteArray, QEvent, QSize, Qt, QTimer, QUrl
from PySide6.QtGui import QColor, QImage, QPainter, QResizeEvent
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QFrame, QTextBrowser

from kochab.text.translation import tr, tr_noop
from kochab.window.dialogs import is_red, reddened
from kochab.window.themes import Colours, theme_colours
from kochab.workflows.night.earlier import Compared
from kochab.workflows.night.page import night_parts
from kochab.workflows.night.summary import SHOWN, Night

SVG = re.compile(r"<svg.*?</svg>", re.DOTALL)
EMPTY = tr_noop("Choose the folder of a night, then press Measure.")
WIDEST_PX, TILE_PX, MARGIN_PX = 920, 210, 16
IMAGE = 2  # QTextDocument.ResourceType.ImageResource, as loadResource is given it


class NightBrowser(QTextBrowser):
    """Shows a night; its drawings and pictures in the colours of the theme, at night in red light alone."""

    def __init__(self) -> None:
        super().__init__()
        self.setOpenLinks(False)
        self.setAccessibleName(tr("Last night"))
        self.setMinimumSize(300, 240)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        # Always there: coming and going with the text it would change the width that the text is made for.
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOn)
        # Not within an event of the style or the size, which setting the text may send again.
        self._again = QTimer(self, singleShot=True, interval=0)
        self._again.timeout.connect(self._fill)
        self.document().setDocumentMargin(MARGIN_PX)
        self._shown: tuple[Night, str, Sequence[Compared]] | None = None
        self._drawings: dict[str, str] = {}  # by the names that the page has for them
        self._columns = self._filled_px = 0
        self._fill()

    def show_night(self, night: Night, name: str, earlier: Sequence[Compared] = ()) -> None:
        """Show what was measured of a folder."""
        self._shown = night, name, earlier
        self._fill()

    def _fill(self) -> None:
        colours = theme_colours()
        self.document().setDefaultStyleSheet(_style(colours))
        self._filled_px = self._room
        self._columns = max(1, min(self.viewport().width(), WIDEST_PX) // TILE_PX)
        if self._shown is None:
            self.setHtml(f'<p class="sub">{tr(EMPTY)}</p>')
            return
        html = "\n".join(night_parts(*self._shown, columns=self._columns))
        self._drawings = {f"drawing{k}": svg for k, svg in enumerate(SVG.findall(html))}
        for name, svg in self._drawings.items():
            html = html.replace(svg, f'<p><img src="{name}"></p>', 1)
        at = self.verticalScrollBar().value()
        self.setHtml(html)
        self.verticalScrollBar().setValue(at)

    def loadResource(self, kind: int, name: QUrl | str) -> object:
        """A drawing as it fits, or a picture that the page holds."""
        drawing = self._drawings.get(QUrl(name).toString())
        if kind != IMAGE:
            return None
        if drawing is not None:
            return self._drawn(drawing)
        image = QImage.fromData(QByteArray.fromBase64(QUrl(name).toString().partition(",")[2].encode()))
        if image.isNull():
            return None
        wide = max(120, self._room // min(self._columns, SHOWN) - 3 * MARGIN_PX)
        image = image.scaledToWidth(round(wide * self.devicePixelRatioF()), Qt.TransformationMode.SmoothTransformation)
        image.setDevicePixelRatio(self.devicePixelRatioF())
        return reddened(image) if is_red() else image

    @property
    def _room(self) -> int:
        """How wide the page is, px."""
        return max(200, min(self.viewport().width() - 2 * MARGIN_PX - 8, WIDEST_PX))

    def _drawn(self, drawing: str) -> QImage:
        colours, ratio = theme_colours(), self.devicePixelRatioF()
        head, _, rest = drawing.partition(">")
        renderer = QSvgRenderer(QByteArray(f"{head}><style>{_drawing_style(colours)}</style>{rest}".encode()))
        size = renderer.defaultSize()
        wide = min(self._room, size.width() if size.width() < 500 else WIDEST_PX)
        image = QImage(QSize(wide, round(wide * size.height() / size.width())) * ratio, QImage.Format.Format_RGB32)
        image.fill(QColor(colours.surface))
        painter = QPainter(image)
        renderer.render(painter)
        painter.end()
        image.setDevicePixelRatio(ratio)
        return image

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if self._room != self._filled_px:
            self._again.start()

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.StyleChange:
            self._again.start()


def _style(c: Colours) -> str:
    """The style sheet of the text, in the part of CSS that Qt's rich text supports."""
    return f"""
h1 {{ color: {c.text}; font-size: x-large; }} h2 {{ color: {c.text}; font-size: large; }}
p,td,b {{ color: {c.text}; }} .sub,.note,th,span,figcaption {{ color: {c.muted}; }}
.advice {{ color: {c.text}; font-size: large; font-weight: 600; }} .stopped {{ color: {c.bad}; }}
th {{ text-align: left; padding-right: 14px; }} td {{ padding-right: 14px; }} b {{ font-size: large; }}
"""


def _drawing_style(c: Colours) -> str:
    """The style sheet of the drawings; Qt's SVG supports classes, but no variables."""
    return f"""
text {{ font-size: 13px; font-family: sans-serif; fill: {c.muted}; }} text.value {{ fill: {c.text}; }}
.tick {{ text-anchor: end; }} .time {{ text-anchor: middle; }}
.box {{ fill: none; stroke: {c.line}; }} .grid {{ stroke: {c.line}; stroke-dasharray: 2 4; }}
.lost {{ fill: {c.accent}; stroke: {c.accent}; }} .fwhm {{ fill: {c.detected}; stroke: {c.detected}; }}
.sky, .star {{ fill: {c.identified}; stroke: {c.identified}; }}
.bar {{ opacity: 0.5; }} .gone {{ stroke: {c.bad}; stroke-width: 2; }}
polyline {{ fill: none; stroke-width: 2; }} .field {{ stroke: {c.text}; fill: none; }}
.moon {{ stroke: {c.cluster}; stroke-dasharray: 6 4; fill: none; }} .soft {{ fill: {c.detected}; }}
.dark {{ fill: {c.window}; }} .astronomical {{ fill: {c.faint}; opacity: 0.3; }}
.nautical {{ fill: {c.faint}; opacity: 0.5; }} .civil {{ fill: {c.faint}; opacity: 0.7; }} .day {{ fill: {c.faint}; }}
.event {{ stroke: {c.bad}; stroke-dasharray: 3 3; }}
"""
