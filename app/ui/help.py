"""The two small boxes of the help menu."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QGridLayout,
    QSpacerItem,
    QVBoxLayout,
    QWidget,
)

from app import __version__
from app.ui.actions import SPECS
from app.ui.dialogs import without_icons
from app.ui.views import VIEWS
from app.ui.widgets import label

LEAST_PX = 380  # a minimum of the box itself would keep it from growing with its letters
ABOUT = (
    f"Kochab {__version__}",
    "Where your camera points: every star in the frame named, with nothing to download.",
    "Free software under the GNU General Public License, version 3 or later.",
)


def about(parent: QWidget) -> QDialog:
    """What this is."""
    box, column = _box(parent, "About Kochab")
    for text, role in zip(ABOUT, ("title", "", "muted"), strict=True):
        column.insertWidget(column.count() - 1, label(text, role, wrap=True))
    return box


def keyboard(parent: QWidget) -> QDialog:
    """Every key."""
    box, column = _box(parent, "Keyboard")
    grid = QGridLayout()
    grid.setHorizontalSpacing(18)
    grid.setVerticalSpacing(3)
    rows = [
        (s.keys.replace(" ", ", "), s.text.replace("&", "").rstrip("…")) for s in SPECS if s.keys
    ]
    rows += [(keys, title.replace("&", "")) for title, keys, _ in VIEWS.values()]
    rows += [("F7", "At the bolts, when Polar alignment is open")]
    rows += [("Esc", "Stop the mount, from every view, while one is connected")]
    rows += [("Arrows", "Move the frame or a chart that has the focus")]
    rows += [("Home", "All of a chart"), ("Tab", "To the next pane")]
    half = (len(rows) + 1) // 2
    for i, (keys, text) in enumerate(rows):
        row, column_number = i % half, i // half * 2
        grid.addWidget(label(keys, "muted"), row, column_number)
        grid.addWidget(label(text), row, column_number + 1)
    column.insertLayout(0, grid)
    return box


def _plain(text: str) -> str:
    return text.replace("&", "").rstrip("…")


def _box(parent: QWidget, title: str) -> tuple[QDialog, QVBoxLayout]:
    box = QDialog(parent)
    box.setWindowTitle(title)
    box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    column = QVBoxLayout(box)
    column.setContentsMargins(20, 20, 20, 16)
    column.setSpacing(12)
    column.addSpacerItem(QSpacerItem(LEAST_PX, 0))
    buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
    without_icons(buttons.buttons())
    buttons.rejected.connect(box.reject)
    column.addWidget(buttons)
    return box, column
