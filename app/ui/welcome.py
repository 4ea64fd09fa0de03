"""What is seen before a frame is open."""

from pathlib import Path

import numpy as np
from PySide6.QtCore import QEvent, QSize, Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QSizePolicy, QVBoxLayout, QWidget

from app.ui.formats import short_name
from app.ui.samples import Sample
from app.ui.theme import BASE_POINT
from app.ui.thumbnails import GAP, HEIGHT, WIDTH, as_icon
from app.ui.widgets import button, label, rule, scrolled

MOST_SHOWN = 5
INVITATION = (
    "Open a picture of the night sky and see where it points, which stars are in it, and how sure "
    "that is."
)
READS = (
    "Or drop a file anywhere on this window: FITS, XISF, TIFF, PNG, JPEG, HEIC and camera RAW. "
    "Nothing has to be known about the frame."
)

PRACTICE = "&Practice with a simulated telescope"
PRACTICE_TIP = "A mount that stands wrong and a camera on it, under a sky of their own."

LEAST_PX = 320  # of a sample: its picture and its name
WIDEST_PX = 680  # of the page, with letters of the normal size


class Welcome(QWidget):
    """Open a frame, try a sample, or take up a recent file."""

    open_wanted = Signal()
    file_wanted = Signal(Path)
    practice_wanted = Signal()

    def __init__(self, samples: list[Sample]) -> None:
        super().__init__()
        self.setObjectName("page")
        self._recent = QVBoxLayout()
        self._recent.setSpacing(0)
        self._recent_title = label("Recent", "heading")
        self.first = button("&Open a frame…", self.open_wanted.emit, "main")
        self.practice = button(PRACTICE, self.practice_wanted.emit, tip=PRACTICE_TIP)
        self.practice.hide()
        self._pictures: dict[Path, np.ndarray] = {}
        self._offered = samples[:MOST_SHOWN]
        self.samples = [self._sample(s, i) for i, s in enumerate(self._offered)]
        self._inside = QWidget()
        self._inside.setObjectName("page")
        self._inside.setMaximumWidth(WIDEST_PX)
        column = QVBoxLayout(self._inside)
        column.setSpacing(10)
        self._invite(column)
        if self.samples:
            self._offer(column)
        outer = QVBoxLayout(self)
        outer.setContentsMargins(0, 0, 0, 0)
        outer.addWidget(scrolled(_in_the_middle(self._inside)))  # on a small screen
        self.show_recent([])

    def _invite(self, column: QVBoxLayout) -> None:
        column.addWidget(label("Kochab", "title"))
        column.addWidget(label(INVITATION, wrap=True))
        column.addSpacing(8)
        line = QHBoxLayout()
        line.addWidget(self.first)
        line.addWidget(self.practice)
        line.addStretch(1)
        column.addLayout(line)
        column.addWidget(label(READS, "muted", wrap=True))
        column.addSpacing(4)
        column.addWidget(self._recent_title)
        column.addLayout(self._recent)

    def _offer(self, column: QVBoxLayout) -> None:
        column.addSpacing(8)
        column.addWidget(rule())
        column.addWidget(label("Try a sample", "heading"))
        column.addWidget(label("Made by Kochab’s own sky renderer.", "muted"))
        for made in self.samples:
            column.addWidget(made)

    def changeEvent(self, event: QEvent) -> None:
        """Larger letters need a wider page."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.FontChange:
            larger = max(self.font().pointSizeF() / BASE_POINT, 1.0)
            self._inside.setMaximumWidth(round(WIDEST_PX * larger))

    def _sample(self, sample: Sample, index: int) -> QPushButton:
        text = f"&{index + 1}  {sample.title}"
        made = button(f"{text}\n{sample.text}" if sample.text else text,
                      lambda: self.file_wanted.emit(sample.path), "sample")  # fmt: skip
        made.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        made.setMinimumWidth(LEAST_PX)  # beside a tool on a small screen
        made.setAccessibleName(sample.title)
        made.setIconSize(QSize(WIDTH + GAP, HEIGHT))
        return made

    def add_picture(self, path: Path, picture: np.ndarray, red: bool) -> None:
        """A small picture (H, W, 3) of a sample, to be shown on its button."""
        self._pictures[path] = picture
        self.draw_pictures(red)

    def draw_pictures(self, red: bool) -> None:
        """Draw the pictures again, in red light alone or in all colours."""
        for sample, made in zip(self._offered, self.samples, strict=True):
            if sample.path in self._pictures:
                made.setIcon(as_icon(self._pictures[sample.path], red))

    def show_recent(self, paths: list[Path]) -> None:
        """The recent files, newest first."""
        while (item := self._recent.takeAt(0)) is not None:
            if (old := item.widget()) is not None:
                old.hide()
                old.deleteLater()
        shown = [p for p in paths if p.exists()][:MOST_SHOWN]
        self._recent_title.setVisible(bool(shown))
        before: QWidget = self.practice
        for path in shown:
            link = self._link(path)
            self._recent.addWidget(link)
            self.setTabOrder(before, link)
            before = link
        for sample in self.samples[:1]:
            self.setTabOrder(before, sample)

    def _link(self, path: Path) -> QWidget:
        text = short_name(path.name).replace("&", "&&")
        return button(text, lambda: self.file_wanted.emit(path), "link", str(path))


def _in_the_middle(inside: QWidget) -> QWidget:
    page = QWidget()
    page.setObjectName("page")
    middle = QHBoxLayout(page)
    middle.setContentsMargins(24, 8, 24, 8)
    middle.addStretch(1)
    middle.addWidget(inside, 99, Qt.AlignmentFlag.AlignVCenter)
    middle.addStretch(1)
    return page
