"""Numbers are typed with a point or a comma, and mean the same in every country."""

from PySide6.QtCore import QEvent, QLocale, QObject
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QDoubleSpinBox, QWidget


def one_way_of_writing() -> None:
    """Write and read numbers with a point, whatever the system's language.

    In a German system Qt reads 0.5 typed into a field as 5, and goes on to show 0.5.
    """
    plain = QLocale.c()
    plain.setNumberOptions(
        QLocale.NumberOption.OmitGroupSeparator | QLocale.NumberOption.RejectGroupSeparator
    )
    QLocale.setDefault(plain)


def take_commas(within: QWidget) -> None:
    """Let the fields for decimal numbers in ``within`` take a comma for a point."""
    for box in within.findChildren(QDoubleSpinBox):
        box.installEventFilter(_CommaAsPoint(box))


class _CommaAsPoint(QObject):
    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() != QEvent.Type.KeyPress or not isinstance(event, QKeyEvent):
            return False
        if event.text() != ",":
            return False
        point = QKeyEvent(QEvent.Type.KeyPress, event.key(), event.modifiers(), ".")
        QApplication.sendEvent(watched, point)
        return True
