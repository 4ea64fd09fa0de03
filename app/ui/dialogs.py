"""Questions that need a window of their own; in red light they too shine red alone."""

from collections.abc import Iterable
from pathlib import Path

from PySide6.QtGui import QIcon
from PySide6.QtWidgets import QAbstractButton, QFileDialog, QMessageBox, QWidget

from app.ui.red_light import RedLight


def ask_open(parent: QWidget, folder: str, kinds: str, red: bool) -> Path | None:
    """The file to open, or None."""
    dialog = QFileDialog(parent, "Open a frame", folder, kinds)
    dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
    return _answer(dialog, red)


def ask_save(parent: QWidget, path: Path, kinds: str, red: bool) -> Path | None:
    """Where to write, or None; asks again before an existing file is replaced."""
    dialog = QFileDialog(parent, "Export", str(path.parent), kinds)
    dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
    dialog.selectFile(path.name)
    return _answer(dialog, red)


def ask_folder(parent: QWidget, folder: str, title: str, red: bool) -> Path | None:
    """A folder, or None."""
    dialog = QFileDialog(parent, title, folder)
    dialog.setFileMode(QFileDialog.FileMode.Directory)
    dialog.setOption(QFileDialog.Option.ShowDirsOnly)
    return _answer(dialog, red)


def tell(parent: QWidget, title: str, text: str) -> None:
    """Say something that must not be missed, without waiting."""
    box = QMessageBox(parent)
    box.setWindowTitle(title)
    box.setText(text)
    box.addButton(QMessageBox.StandardButton.Ok)
    without_icons(box.buttons())
    box.open()


def without_icons(buttons: Iterable[QAbstractButton]) -> None:
    """Take the icons of the style away: they are in no theme's colours, and green at night."""
    for made in buttons:
        made.setIcon(QIcon())


def _answer(dialog: QFileDialog, red: bool) -> Path | None:
    if red:  # the system's own dialog would be in its own colours
        dialog.setOption(QFileDialog.Option.DontUseNativeDialog)
        dialog.setGraphicsEffect(RedLight(dialog))
    accepted = dialog.exec()
    chosen = dialog.selectedFiles()
    dialog.deleteLater()
    return Path(chosen[0]) if accepted and chosen else None
