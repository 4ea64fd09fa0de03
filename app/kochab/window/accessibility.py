"""Accessibility interfaces that replace Qt's own where those can crash the program."""

from PySide6.QtCore import QObject
from PySide6.QtGui import QAccessible, QAccessibleInterface
from PySide6.QtWidgets import QAccessibleWidget, QWidget

SCROLL_AREAS = ("QScrollArea", "QAbstractScrollArea")


def keep_scroll_areas_steady() -> None:
    """Give a scroll area the same children whether its bars are in sight or not; call it after `QApplication` is made.

    Qt 6.11.3 leaves hidden bars out and looks a child up by its number without a bound: a reader that counted two,
    and asks for the second when a bar has gone meanwhile, makes it read past the end of the list, which crashed the
    program in three runs of eight. A plain widget's interface counts all children and knows its bounds.
    """
    QAccessible.installFactory(_steady)


def _steady(class_name: str, asked: QObject) -> QAccessibleInterface | None:
    if class_name in SCROLL_AREAS and isinstance(asked, QWidget):
        return QAccessibleWidget(asked, QAccessible.Role.Client, "")
    return None
