"""Small pieces that several panes are made of."""

from collections.abc import Callable

from PySide6.QtCore import QEvent, QObject, QSize, Qt
from PySide6.QtGui import QFontDatabase, QGuiApplication
from PySide6.QtWidgets import (
    QComboBox,
    QFrame,
    QGridLayout,
    QLabel,
    QPushButton,
    QScrollArea,
    QWidget,
)


def label(text: str = "", role: str = "", wrap: bool = False) -> QLabel:
    """A label dressed by the style sheet's ``role``."""
    made = QLabel(text)
    made.setTextFormat(Qt.TextFormat.PlainText)
    if role:
        made.setProperty("role", role)
    made.setWordWrap(wrap)
    return made


def value_label(name: str) -> QLabel:
    """A label whose text can be selected with the mouse; the keyboard has the copy buttons."""
    made = label(wrap=True)
    made.setAccessibleName(name)
    made.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    made.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    return made


def position_labels() -> tuple[QLabel, QLabel]:
    """Where a right ascension and a declination are shown, large."""
    made = value_label("Right ascension"), value_label("Declination")
    for value in made:
        value.setProperty("role", "value")
        value.setWordWrap(False)
    return made


def facts_grid(spacing: int, *rows: tuple[str, QLabel]) -> QGridLayout:
    """Titles and values in two columns, the second as wide as can be."""
    grid = QGridLayout()
    grid.setHorizontalSpacing(12)
    grid.setVerticalSpacing(spacing)
    grid.setColumnStretch(1, 1)
    for row, (title, value) in enumerate(rows):
        grid.addWidget(label(title, "muted"), row, 0)
        grid.addWidget(value, row, 1)
    return grid


def narrow_box(name: str, letters: int) -> QComboBox:
    """A box to choose from that asks for room for so many letters, however long its texts are."""
    made = QComboBox()
    made.setAccessibleName(name)
    made.setMinimumContentsLength(letters)
    made.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
    return made


def button(text: str, pressed: Callable[[], object], role: str = "", tip: str = "") -> QPushButton:
    """A push button; ``text`` carries its mnemonic."""
    made = QPushButton(text)
    if role:
        made.setProperty("role", role)
    if tip:
        made.setToolTip(tip)
    made.setAutoDefault(False)
    made.clicked.connect(lambda: pressed())
    return made


def rule() -> QFrame:
    """A thin line between groups."""
    made = QFrame()
    made.setObjectName("rule")
    return made


def card() -> QFrame:
    """A raised box."""
    made = QFrame()
    made.setObjectName("card")
    return made


class Column(QScrollArea):
    """An area that scrolls up and down and is never narrower than what it holds."""

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        done = super().eventFilter(watched, event)
        if event.type() == QEvent.Type.LayoutRequest and watched is self.widget():
            self.updateGeometry()  # what it holds may have become wider
        return done

    def minimumSizeHint(self) -> QSize:
        inside = self.widget()
        width = inside.minimumSizeHint().width() if inside is not None else 0
        return QSize(width + self.verticalScrollBar().sizeHint().width(), 120)


def scrolled(inside: QWidget) -> QScrollArea:
    """``inside`` in an area that scrolls up and down."""
    area = Column()
    area.setWidget(inside)
    area.setWidgetResizable(True)
    area.setFrameShape(QFrame.Shape.NoFrame)
    area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    return area


def copy_text(text: str) -> None:
    """Put ``text`` on the clipboard."""
    QGuiApplication.clipboard().setText(text)


def fixed_font_family() -> str:
    """The system's font for columns of figures."""
    return QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont).family()


def set_role(widget: QWidget, role: str) -> None:
    """Dress ``widget`` differently from now on."""
    widget.setProperty("role", role)
    widget.style().unpolish(widget)
    widget.style().polish(widget)
