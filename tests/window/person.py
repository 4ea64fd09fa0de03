"""What a person does with a field or a box."""

from PySide6.QtCore import Qt


def choose(box, data):
    """Take the row of a box that holds ``data``."""
    box.setCurrentIndex(box.findData(data))
    box.activated.emit(box.currentIndex())


def type_in(qtbot, field, text):
    """Type a text over what a field holds, and Enter."""
    field.clear()
    qtbot.keyClicks(field, text)
    qtbot.keyClick(field, Qt.Key.Key_Return)
