"""Small widgets that several panes are made of."""

import locale
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from PySide6.QtCore import QEvent, QLocale, QObject, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFontDatabase, QGuiApplication, QKeyEvent, QPainter, QPaintEvent, QWheelEvent
from PySide6.QtWidgets import (
    QBoxLayout,
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QFormLayout,
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QLayout,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QScrollArea,
    QTabWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from kochab.text.translation import tr

Box = TypeVar("Box", bound=QBoxLayout)
Named = TypeVar("Named", bound=QWidget)
INSET_PX = 5  # of the text in a field
BY_CHOICE = Qt.FocusPolicy.StrongFocus  # not by the wheel, which would take Space from the STOP button


def named(made: Named, name: str, tip: str = "") -> Named:
    """A widget with its name for screen readers, and its tip."""
    if isinstance(made, QLabel | QComboBox):  # whose names are their texts, as Qt tells them
        made.setAccessibleDescription(name)
    if not isinstance(made, QLabel):
        made.setAccessibleName(name)
    made.setToolTip(tip)
    return made


def label(text: str = "", role: str = "", wrap: bool = False) -> QLabel:
    """A label with one of the style sheet's roles."""
    made = QLabel(text, textFormat=Qt.TextFormat.PlainText, wordWrap=wrap)
    made.setProperty("role", role or None)  # None is no property
    return made


def text_field(name: str, example: str = "", tip: str = "") -> QLineEdit:
    """A field for a text; it shows ``example`` while it is empty."""
    return named(QLineEdit(placeholderText=example), name, tip)


def number_field(
    name: str, low: float, high: float, value: float, decimals: int = 0, unit: str = "", tip: str = ""
) -> QDoubleSpinBox:
    """A field for a number, with its unit.

    Parameters
    ----------
    name : str
        Read by a screen reader.
    low, high : float
        Least and largest value.
    value : float
        Shown first.
    decimals : int
        Digits after the point.
    unit : str
        Shown after the number.
    tip : str
        Shown under the pointer.
    """
    made = NumberField(decimals=decimals, minimum=low, maximum=high, value=value, suffix=unit)
    made.setFocusPolicy(BY_CHOICE)
    made.lineEdit().setTextMargins(INSET_PX, 0, 0, 0)  # which the style sheet's padding does not reach
    return named(made, name, tip)


class NumberField(QDoubleSpinBox):
    """It takes a comma and a point for the decimal point of its language; the wheel scrolls its page, never sets it."""

    def wheelEvent(self, event: QWheelEvent) -> None:
        event.ignore()  # Qt sets every field that comes under the pointer of a page that is scrolled

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.text() in (",", "."):
            event = QKeyEvent(event.type(), event.key(), event.modifiers(), self.locale().decimalPoint())
        super().keyPressEvent(event)


def switch(text: str, tip: str = "") -> QCheckBox:
    """A checkbox; ``text`` carries its mnemonic."""
    return named(QCheckBox(text), "", tip)


def field_values(fields: Mapping[str, QWidget]) -> dict[str, Any]:
    """What fields show, by their names, as :func:`fill_fields` takes it and JSON can keep it."""
    return {name: field_value(field) for name, field in fields.items()}


def field_value(field: QWidget) -> Any:
    """What one field shows: the property that Qt knows as the user's."""
    return field.metaObject().userProperty().read(field)


def fill_fields(fields: Mapping[str, QWidget], saved: Mapping[str, Any]) -> None:
    """Show saved values; one that is missing or damaged leaves its field as it is."""
    for name, field in fields.items():
        value, shown = saved.get(name), field_value(field)
        if isinstance(value, type(shown)) or (isinstance(shown, float) and isinstance(value, int)):
            field.metaObject().userProperty().write(field, value)


def value_label(name: str, tip: str = "") -> QLabel:
    """A label whose text can be selected with the mouse."""
    made = named(label(wrap=True), name, tip)
    made.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    made.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    return made


def position_labels(name: str = "") -> tuple[QLabel, QLabel]:
    """Where a right ascension and a declination are shown, large."""
    made = value_label(name or tr("Right ascension")), value_label(tr("Declination"))
    for value in made:
        value.setProperty("role", "value")
        value.setWordWrap(False)
    return made


def facts_grid(spacing: int, *rows: tuple[str, QLabel]) -> QGridLayout:
    """Titles and values in two columns, the second as wide as can be; a title has its value's tip."""
    titles = [label(title, "muted") for title, _ in rows]
    for name, (_, value) in zip(titles, rows, strict=True):
        name.setToolTip(value.toolTip())
    values = (value for _, value in rows)
    return grid(*zip(titles, values, strict=True), across=12, down=spacing, stretch=(0, 1))


def grid(
    *rows: Iterable[QWidget], across: int = 10, down: int = 4, stretch: Iterable[int] = (), on: QWidget | None = None
) -> QGridLayout:
    """Rows of widgets below each other.

    Parameters
    ----------
    *rows : Iterable[QWidget]
        The widgets of each row.
    across, down : int
        Space between them, px.
    stretch : Iterable[int]
        Share of the free width of each column.
    on : QWidget or None
        The widget laid out; None: the layout is added to another.
    """
    made = QGridLayout(on)
    made.setHorizontalSpacing(across)
    made.setVerticalSpacing(down)
    for at, widgets in enumerate(rows):
        for place, widget in enumerate(widgets):
            made.addWidget(widget, at, place)
    for place, share in enumerate(stretch):
        made.setColumnStretch(place, share)
    return made


class ChoiceBox(QComboBox):
    """A box to choose from by mouse or keys; the wheel scrolls its page and never changes the choice."""

    def __init__(self, letters: int = 0) -> None:
        super().__init__(minimumContentsLength=letters)
        self.setFocusPolicy(BY_CHOICE)

    def wheelEvent(self, event: QWheelEvent) -> None:
        event.ignore()


def choice_box(name: str, choices: Iterable[str] | Mapping[str, object], letters: int = 8) -> QComboBox:
    """A box to choose one of ``choices`` from; those of a mapping carry their values as data."""
    made = ChoiceBox(letters)
    for text in choices:
        made.addItem(text, choices[text] if isinstance(choices, Mapping) else None)
    return named(made, name)


def narrow_box(name: str, letters: int, choices: Iterable[str] | Mapping[str, object] = ()) -> QComboBox:
    """A box to choose from that asks for room for so many letters, however long its texts are."""
    made = choice_box(name, choices, letters)
    made.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
    return made


def button(text: str, pressed: Callable[[], object], role: str = "", tip: str = "") -> QPushButton:
    """A push button.

    Parameters
    ----------
    text : str
        With its mnemonic.
    pressed : Callable[[], object]
        Called without arguments.
    role : str
        Its look in the style sheet, as ``main``.
    tip : str
        Shown under the pointer.
    """
    # As an auto-default button Enter in any field of a dialog would press it.
    made = named(QPushButton(text, autoDefault=False), "", tip)
    made.setProperty("role", role or None)  # None is no property
    # `clicked` hands over its checked state, which `pressed` does not take.
    made.clicked.connect(lambda: pressed())
    return made


def styled_frame(kind: str) -> QFrame:
    """A "card", which is a raised box, or a "rule", a thin line between groups: names of the style sheet."""
    made = QFrame()
    made.setObjectName(kind)
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
    area = Column(widgetResizable=True)
    area.setWidget(inside)
    area.setFrameShape(QFrame.Shape.NoFrame)
    area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    return area


def see_through(inside: QWidget) -> QScrollArea:
    """The same, with what lies behind the area seen between its parts."""
    area = scrolled(inside)
    for each in (area, area.viewport(), inside):
        each.setObjectName("see_through")
    return area


def tab_pages(name: str, *pages: tuple[str, QWidget]) -> QTabWidget:
    """Pages under tabs with these titles."""
    made = named(QTabWidget(documentMode=True), name)
    for title, inside in pages:
        made.addTab(inside, title)
    return made


class ElidedLabel(QLabel):
    """One line that ends in … where it has no room; it never pushes its neighbours, and its tip has the whole text."""

    def minimumSizeHint(self) -> QSize:
        return QSize(1, super().minimumSizeHint().height())

    def paintEvent(self, event: QPaintEvent) -> None:
        text = self.fontMetrics().elidedText(self.text(), Qt.TextElideMode.ElideRight, self.width())
        at = int(self.alignment() | Qt.AlignmentFlag.AlignVCenter)
        self.style().drawItemText(QPainter(self), self.rect(), at, self.palette(), True, text, self.foregroundRole())


def clear_layout(layout: QLayout) -> None:
    """Remove every widget of ``layout``."""
    while (item := layout.takeAt(0)) is not None:
        if (old := item.widget()) is not None:
            old.hide()  # deleteLater waits for the event loop; until then it would still be seen
            old.deleteLater()


Margins = tuple[int, int, int, int]  # left, top, right, bottom
Part = QWidget | QLayout | tuple[QWidget | QLayout, int] | int | None


def row(
    *parts: Part, on: QWidget | None = None, spacing: int | None = None, margins: Margins | None = None
) -> QHBoxLayout:
    """Parts side by side.

    Parameters
    ----------
    *parts : Part
        Widgets, layouts, ``(widget or layout, stretch)``, px of space, and None to stretch.
    on : QWidget or None
        The widget laid out; None: the layout is added to another.
    spacing : int or None
        Between the parts, px; None for the style's.
    margins : Margins or None
        Around them, px; None for none or the style's.
    """
    return _fill(QHBoxLayout(on) if on is not None else QHBoxLayout(), parts, spacing, margins)


def column(
    *parts: Part, on: QWidget | None = None, spacing: int | None = None, margins: Margins | None = None
) -> QVBoxLayout:
    """The same from top to bottom.

    Parameters
    ----------
    *parts : Part
        As in :func:`row`.
    on : QWidget or None
        The widget laid out; None: the layout is added to another.
    spacing : int or None
        Between the parts, px; None for the style's.
    margins : Margins or None
        Around them, px; None for none or the style's.
    """
    return _fill(QVBoxLayout(on) if on is not None else QVBoxLayout(), parts, spacing, margins)


def _fill(layout: Box, parts: tuple[Part, ...], spacing: int | None, margins: Margins | None) -> Box:
    if spacing is not None:
        layout.setSpacing(spacing)
    if margins is not None:
        layout.setContentsMargins(*margins)
    for part in parts:
        inside, stretch = part if isinstance(part, tuple) else (part, 0)
        if inside is None:
            layout.addStretch(1)
        elif isinstance(inside, int):
            layout.addSpacing(inside)
        elif isinstance(inside, QLayout):
            layout.addLayout(inside, stretch)
        else:
            layout.addWidget(inside, stretch)
    return layout


class Fold(QWidget):
    """A line with a title; pressed, it shows what is behind it, and hides it again."""

    def __init__(self, title: str, *inside: Part) -> None:
        super().__init__()
        self.line = QToolButton()
        self.line.setText(title)
        self.line.setCheckable(True)
        self.line.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.line.setObjectName("fold")
        self.line.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.inside = QWidget()
        column(*inside, on=self.inside, spacing=8, margins=(0, 4, 0, 0))
        column(row(self.line, None), self.inside, on=self, spacing=0, margins=(0, 0, 0, 0))
        self.line.toggled.connect(self._fold)
        self._fold(False)

    def _fold(self, on: bool) -> None:
        self.inside.setVisible(on)
        self.line.setArrowType(Qt.ArrowType.DownArrow if on else Qt.ArrowType.RightArrow)


def form(*rows: tuple[str, QWidget | QLayout], spacing: int = 8) -> QFormLayout:
    """Fields below each other, each beside its title."""
    made = QFormLayout(horizontalSpacing=12, verticalSpacing=spacing)
    for title, field in rows:
        made.addRow(title, field)
    return made


class Page(QWidget):
    """A part of the window that the style sheet knows as ``page``."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("page")


def bring_to_front(window: QWidget) -> None:
    """Show a window, before all others."""
    window.show()
    window.raise_()
    window.activateWindow()


def page() -> QWidget:
    """A part of the window with its background, which Qt paints for its own class alone."""
    made = QWidget()
    made.setObjectName("page")
    return made


def draw_text(painter: QPainter, centre: QPointF, text: str, ground: str) -> None:
    """Draw a short text on a box.

    Parameters
    ----------
    painter : QPainter
        Its font is used.
    centre : QPointF
        Middle of the box.
    text : str
        One line.
    ground : str
        Colour of the box.
    """
    metrics = painter.fontMetrics()
    box = QRectF(0, 0, metrics.horizontalAdvance(text) + 6, metrics.height())
    box.moveCenter(centre)
    painter.fillRect(box, QColor(ground))
    painter.drawText(box, Qt.AlignmentFlag.AlignCenter, text)


def copy_text(text: str) -> None:
    """Put ``text`` on the clipboard."""
    QGuiApplication.clipboard().setText(text)


def fixed_font_family() -> str:
    """The system's font for columns of figures."""
    return QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont).family()


def set_property(widget: QWidget, name: str, value: object) -> None:
    """Change what the style sheet selects by, and style ``widget`` anew."""
    widget.setProperty(name, value)
    # Qt compares a widget with the style sheet's selectors only when it is polished.
    widget.style().unpolish(widget)
    widget.style().polish(widget)


def set_role(widget: QWidget, role: str) -> None:
    """Give ``widget`` one of the style sheet's roles."""
    if widget.property("role") != role:  # each change costs a look at the style sheet
        set_property(widget, "role", role)


def show_text(target: QLabel, text: str, role: str | None = None) -> None:
    """Show a text, in a role of the style sheet if one is given; an empty text hides its label."""
    target.setText(text)
    target.setVisible(bool(text))
    if role is not None:
        set_role(target, role)


def use_plain_numerals() -> None:
    """Write and read numbers with a point, and report system errors in English, in every country.

    In a German system Qt reads 0.5 typed into a field as 5, and goes on to show 0.5. It also sets
    C's own language, in which the system says why a file cannot be written.
    """
    for kind in ("LC_MESSAGES", "LC_NUMERIC"):  # Windows has no messages
        if hasattr(locale, kind):
            locale.setlocale(getattr(locale, kind), "C")
    plain = QLocale.c()
    plain.setNumberOptions(QLocale.NumberOption.OmitGroupSeparator | QLocale.NumberOption.RejectGroupSeparator)
    QLocale.setDefault(plain)


STEPS = 1000


class ProgressBar(QProgressBar):
    """Progress, or that it is unknown; painted once a turn of the event loop.

    Qt's bar repaints within ``setValue`` everything in the window that waits to be painted.
    """

    def __init__(self, name: str) -> None:
        super().__init__()
        self.setRange(0, STEPS)
        self.setTextVisible(False)
        self.setAccessibleName(name)

    def show_share(self, share: float | None) -> None:
        """A share in 0..1; None for unknown."""
        self.setUpdatesEnabled(False)
        self.setRange(0, 0 if share is None else STEPS)
        if share is not None:
            self.setValue(round(STEPS * min(max(share, 0.0), 1.0)))
        self.setUpdatesEnabled(True)  # asks to be painted, later
