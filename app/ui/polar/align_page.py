"""The page that is looked at while aligning: what to do, the numbers, the picture."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QBoxLayout, QVBoxLayout, QWidget

from app.polar.poles import name_of
from app.ui.palette import Colours
from app.ui.polar.numbers import Numbers
from app.ui.polar.state import State
from app.ui.polar.target import Target, primes
from app.ui.polar.wish import AlignWish, Source
from app.ui.widgets import card, label

BESIDE = 68  # letters wide, from which on numbers and picture stand side by side


class AlignPage(QWidget):
    """Shows a :class:`State`; wide, the picture stands beside the numbers, narrow, below."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("page")
        self.pole = label("", "muted", wrap=True)
        self.words = label("", "heading", wrap=True)
        self.words.setAccessibleName("What to do now")
        self.detail = label("", "muted", wrap=True)
        self.numbers = Numbers()
        self.target = Target()
        box = card()
        inside = QVBoxLayout(box)
        for widget in (self.pole, self.words, self.detail):
            inside.addWidget(widget)
        self.parts = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        self.parts.addWidget(self.numbers, 2)
        self.parts.addWidget(self.target, 3)
        column = QVBoxLayout(self)
        column.setContentsMargins(4, 8, 4, 4)
        column.addWidget(box)
        column.addLayout(self.parts, 1)

    def name_pole(self, wish: AlignWish) -> None:
        """Which pole is aligned to."""
        pole = wish.pole.value.capitalize()
        told = f"{pole} pole of the frames' own site"
        if wish.source is Source.PRACTICE:
            told = f"{pole} pole of the practice site"
        elif wish.site is not None:
            name = name_of(wish.pole, wish.site)
            told = f"{name[0].upper()}{name[1:]}"
        self.pole.setText(f"Aligning to: {told}")

    def show_state(self, state: State, now_s: float) -> None:
        """Bring everything up to date."""
        self.words.setText(primes(state.words))
        self.detail.setText(primes(state.detail))
        self.detail.setVisible(bool(state.detail))
        self.numbers.show_state(state, now_s)
        self.target.show_state(state)

    def wear(self, colours: Colours) -> None:
        """The theme's colours, for what is painted."""
        self.target.colours = colours
        self.target.update()
        self.numbers.wear(colours)

    def resizeEvent(self, event: object) -> None:
        letter = self.fontMetrics().averageCharWidth()
        wide = self.width() > BESIDE * letter
        direction = QBoxLayout.Direction.LeftToRight if wide else QBoxLayout.Direction.TopToBottom
        if self.parts.direction() != direction:
            self.parts.setDirection(direction)
            self.parts.setAlignment(self.target, Qt.AlignmentFlag(0))
