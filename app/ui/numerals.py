"""Numbers are typed with a point or a comma, and mean the same in every country."""

from PySide6.QtCore import QEvent, QLocale, QObject
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QAbstractSpinBox, QApplication, QDoubleSpinBox, QWidget

INSET_PX = 5  # as much as a text field's


def one_way_of_writing() -> None:
    """Write and read numbers with a point, whatever the system's language.

    In a German system Qt reads 0.5 typed into a field as 5, and goes on to show 0.5.
    """
    plain = QLocale.c()
    plain.setNumberOptions(
        QLocale.NumberOption.OmitGroupSeparator | QLocale.NumberOption.RejectGroupSeparator
    )
    QLocale.setDefault(plain)


def dress_numbers(within: QWidget) -> None:
    """Let the fields for decimal numbers in ``within`` take a comma for a point.

    And let no number stick to the edge of its field: a style sheet's padding does not reach it.
    """
    for box in within.findChildren(QDoubleSpinBox):
        box.installEventFilter(_CommaAsPoint(box))
    for number in within.findChildren(QAbstractSpinBox):
        number.lineEdit().setTextMargins(INSET_PX, 0, 0, 0)


class _CommaAsPoint(QObject):
    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() != QEvent.Type.KeyPress or not isinstance(event, QKeyEvent):
            return False
        if event.text() != ",":
            return False
        point = QKeyEvent(QEvent.Type.KeyPress, event.key(), event.modifiers(), ".")
        QApplication.sendEvent(watched, point)
        return True
