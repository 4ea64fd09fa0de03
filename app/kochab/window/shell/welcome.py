"""The welcome page with the sample frames."""

import json
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from PySide6.QtCore import QEvent, QSize, Qt, Signal
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import QPushButton, QSizePolicy, QVBoxLayout, QWidget

from kochab.core.values import frozen
from kochab.folders import data_folder
from kochab.frames import format_names, suffixes
from kochab.text.angle_text import short_name
from kochab.text.translation import tr, tr_noop
from kochab.window.flow import Flow
from kochab.window.image.thumbnails import GAP, HEIGHT, WIDTH, as_pixmap, thumbnails
from kochab.window.job import Jobs
from kochab.window.themes import BASE_POINT
from kochab.window.widgets import Page, Part, button, clear_layout, column, label, page, row, scrolled, styled_frame


@frozen
class Sample:
    """A frame to try, with its title and a line about it."""

    path: Path
    title: str
    text: str


def samples(folder: Path | None = None) -> list[Sample]:
    """The frames in ``resources/samples``; empty when there are none.

    ``samples.json`` there gives ``{file: {"title": ..., "text": ...}}`` in the order to show them;
    a file it does not name comes last.
    """
    folder = folder or data_folder("resources") / "samples"
    if not folder.is_dir():
        return []
    try:
        texts = json.loads((folder / "samples.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        texts = {}
    texts = texts if isinstance(texts, dict) else {}
    found, place = [], {name: i for i, name in enumerate(texts)}
    for path in sorted(folder.iterdir(), key=lambda p: (place.get(p.name, len(place)), p.name)):
        if path.suffix.lower() in suffixes():
            entry = texts.get(path.name, {})
            title = entry.get("title") or path.stem.replace("_", " ").replace("-", " ").capitalize()
            found.append(Sample(path, title, entry.get("text", "")))
    return found


MOST_SHOWN = 6
INVITATION = tr_noop("Open an image of the night sky to see where it points and which stars are in it.")
READS = tr_noop("Or drop a file on this window: {formats}. No focal length or coordinates needed.")

PRACTICE = tr_noop("&Practice night")
PRACTICE_TIP = tr_noop("With a simulated telescope: a misaligned mount with a camera, under a simulated sky.")

LEAST_PX = 290  # of a sample: its picture and its name
WIDEST_PX = 680  # of the page, with letters of the normal size


class Welcome(Page):
    """Open a frame, try a sample, or take up a recent file."""

    open_wanted = Signal()
    file_wanted = Signal(Path)
    practice_wanted = Signal()

    def __init__(self, samples: list[Sample]) -> None:
        super().__init__()
        self._recent = QVBoxLayout()
        self._recent.setSpacing(0)
        self._recent_title = label(tr("Recent"), "heading")
        self.first = button(tr("&Open an image…"), self.open_wanted.emit, "main")
        self.practice = button(tr(PRACTICE), self.practice_wanted.emit, tip=tr(PRACTICE_TIP))
        self.practice.hide()
        self._pictures: dict[Path, np.ndarray] = {}
        self._links: dict[Path, QPushButton] = {}
        self.offered = samples
        self.samples = [self._sample(s, i) for i, s in enumerate(samples[:MOST_SHOWN])]
        offer: list[Part] = []
        if self.samples:
            heading = (
                label(tr("Try a sample"), "heading"),
                label(tr("A real photograph, and simulated images."), "muted", wrap=True),
            )
            offer = [8, styled_frame("rule"), *heading, *self.samples]
        self._inside = page()
        self._inside.setMaximumWidth(WIDEST_PX)
        column(
            label("Kochab", "title"),
            label(tr(INVITATION), wrap=True),
            8,
            Flow(self.first, self.practice),
            label(tr(READS).format(formats=format_names()), "muted", wrap=True),
            4,
            self._recent_title,
            self._recent,
            *offer,
            on=self._inside,
            spacing=10,
        )
        centred = page()
        middle = row(None, on=centred, margins=(24, 8, 24, 8))
        middle.addWidget(self._inside, 99, Qt.AlignmentFlag.AlignVCenter)
        middle.addStretch(1)
        column(scrolled(centred), on=self, margins=(0, 0, 0, 0))  # scrolled for a small screen
        self.show_recent([])

    def changeEvent(self, event: QEvent) -> None:
        """Larger letters need a wider page."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.FontChange:
            larger = max(self.font().pointSizeF() / BASE_POINT, 1.0)
            self._inside.setMaximumWidth(round(WIDEST_PX * larger))

    def _sample(self, sample: Sample, index: int) -> QPushButton:
        text = f"&{index + 1}  {tr(sample.title)}"
        text = f"{text}\n{tr(sample.text)}" if sample.text else text
        made = button(text, lambda: self.file_wanted.emit(sample.path), "sample")
        made.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        made.setMinimumWidth(LEAST_PX)  # beside a tool on a small screen
        made.setAccessibleName(tr(sample.title))
        made.setIconSize(QSize(WIDTH + GAP, HEIGHT))
        return made

    def load_pictures(self, jobs: Jobs, is_night: Callable[[], bool]) -> None:
        """Make the small pictures of samples and recent files in a job, and show them."""
        job = jobs.run(thumbnails([*(s.path for s in self.offered), *self.recent]), "thumbnails")
        job.succeeded.connect(lambda made: self.add_pictures(made, is_night()))

    def add_pictures(self, pictures: dict[Path, np.ndarray], red: bool) -> None:
        """Small pictures (H, W, 3) of the samples and recent files, to be shown on their buttons."""
        self._pictures = pictures
        self.draw_pictures(red)

    def draw_pictures(self, red: bool) -> None:
        """Draw the pictures again, in red light alone if ``red``."""
        shown = [*zip((s.path for s in self.offered), self.samples, strict=False), *self._links.items()]
        for path, made in shown:
            if path in self._pictures:
                made.setIcon(QIcon(as_pixmap(self._pictures[path], red, GAP)))

    @property
    def recent(self) -> list[Path]:
        """The recent files that are offered."""
        return list(self._links)

    def show_recent(self, paths: list[Path]) -> None:
        clear_layout(self._recent)
        # Path.exists raises for a network drive that is off, or a folder of somebody else.
        shown = [p for p in paths if os.path.exists(p)][:MOST_SHOWN]
        self._recent_title.setVisible(bool(shown))
        before: QWidget = self.practice
        self._links.clear()
        for path in shown:
            name = short_name(path.name).replace("&", "&&")
            link = button(name, partial(self.file_wanted.emit, path), "link", str(path))
            link.setMinimumHeight(HEIGHT // 2 + 8)  # nothing moves when the picture comes
            link.setIconSize(QSize((WIDTH + GAP) // 2, HEIGHT // 2))
            self._links[path] = link
            self._recent.addWidget(link)
            # Made after the samples, it would come after them by Tab.
            self.setTabOrder(before, link)
            before = link
        for sample in self.samples[:1]:
            self.setTabOrder(before, sample)
