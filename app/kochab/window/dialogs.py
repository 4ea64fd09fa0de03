"""Dialogs for files and messages, how files are saved, and red light over windows that are not ours."""

from collections.abc import Callable, Iterable
from pathlib import Path

from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QColor, QDropEvent, QGuiApplication, QIcon, QImage, QPainter, QPalette
from PySide6.QtWidgets import QAbstractButton, QFileDialog, QGraphicsEffect, QInputDialog, QMessageBox, QWidget

from kochab.core.errors import KochabError
from kochab.core.progress import Progress, Task
from kochab.text.translation import tr


def is_red() -> bool:
    """Whether the application uses red light alone."""
    text = QGuiApplication.palette().color(QPalette.ColorRole.WindowText)
    return text.red() > 0 and text.green() == text.blue() == 0


def reddened(image: QImage) -> QImage:
    """An image without transparency in red light alone."""
    red = image.convertToFormat(QImage.Format.Format_RGB32)
    painter = QPainter(red)
    painter.setCompositionMode(QPainter.CompositionMode.CompositionMode_Multiply)
    painter.fillRect(red.rect(), QColor(255, 0, 0))
    painter.end()
    return red


def redden_caret(field: QWidget) -> None:
    """Make a field's caret red at night: Qt inverts the background, which gives white."""
    # None removes the effect, which PySide's stubs do not know.
    field.setGraphicsEffect(RedLight(field) if is_red() else None)  # type: ignore[arg-type]


class RedLight(QGraphicsEffect):
    """Multiplies what a widget painted with pure red."""

    def draw(self, painter: QPainter) -> None:
        offset = QPoint()
        picture = self.sourcePixmap(Qt.CoordinateSystem.DeviceCoordinates, offset)
        shape = picture.copy()
        filtered = QPainter(picture)
        filtered.setCompositionMode(QPainter.CompositionMode.CompositionMode_Multiply)
        filtered.fillRect(picture.rect(), QColor(255, 0, 0))
        # What was transparent, as outside rounded corners, has become red: cut it out again.
        filtered.setCompositionMode(QPainter.CompositionMode.CompositionMode_DestinationIn)
        filtered.drawPixmap(0, 0, shape)
        filtered.end()
        painter.save()
        painter.resetTransform()
        painter.drawPixmap(offset, picture)
        painter.restore()


def save_task(write: Callable[[], object], path: Path) -> Task[Path]:
    """Save a file with ``write`` and return its path; KochabError when the disk refuses."""
    yield Progress("export", None, path.name)
    try:
        write()
    except OSError as error:
        why = error.strerror or error
        raise KochabError("Can't write {name}: {why}.", name=path.name, why=why) from error
    return path


def dropped_files(event: QDropEvent) -> list[Path]:
    """The files that are dragged or dropped; none of anything else."""
    urls = event.mimeData().urls() if event.mimeData().hasUrls() else []
    return [Path(u.toLocalFile()) for u in urls if u.isLocalFile()]


def ask_frames(parent: QWidget, folder: str, title: str, kinds: str) -> list[Path]:
    """The files to use; none when the person cancels.

    Parameters
    ----------
    parent : QWidget
        The window that the dialog belongs to.
    folder : str
        Where it begins.
    title : str
        Of the dialog.
    kinds : str
        The file types offered, in Qt's form.
    """
    return _answers(QFileDialog(parent, title, folder, kinds, fileMode=QFileDialog.FileMode.ExistingFiles))


def ask_save(parent: QWidget, path: Path, kinds: str) -> Path | None:
    """Where to write, or None; asks again before an existing file is replaced."""
    dialog = QFileDialog(parent, tr("Export"), str(path.parent), kinds, acceptMode=QFileDialog.AcceptMode.AcceptSave)
    dialog.selectFile(path.name)
    return _answer(dialog)


def ask_folder(parent: QWidget, folder: str, title: str) -> Path | None:
    """A folder, or None."""
    dialog = QFileDialog(parent, title, folder, fileMode=QFileDialog.FileMode.Directory)
    dialog.setOption(QFileDialog.Option.ShowDirsOnly)
    return _answer(dialog)


def tell(parent: QWidget, title: str, text: str) -> None:
    """Show a message box without waiting for it."""
    box = QMessageBox(parent)
    box.setWindowTitle(title)
    box.setText(text)
    box.addButton(QMessageBox.StandardButton.Ok)
    without_icons(box.buttons())
    box.open()


def ask_text(parent: QWidget, title: str, question: str, then: Callable[[str], object]) -> None:
    """Ask for one line, without waiting for it.

    Parameters
    ----------
    parent : QWidget
        The view that asks.
    title, question : str
        Of the dialog, and of its field.
    then : Callable
        Called with what was typed; not called on Cancel.
    """
    dialog = QInputDialog(parent)
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    dialog.setWindowTitle(title)
    dialog.setLabelText(question)
    without_icons(dialog.findChildren(QAbstractButton))
    dialog.textValueSelected.connect(lambda text: then(text.strip()))
    dialog.open()


def without_icons(buttons: Iterable[QAbstractButton]) -> None:
    """Remove the style's icons: they are in no theme's colours, and green at night."""
    for made in buttons:
        made.setIcon(QIcon())


def _answer(dialog: QFileDialog) -> Path | None:
    return next(iter(_answers(dialog)), None)


def _answers(dialog: QFileDialog) -> list[Path]:
    if is_red():  # the system's own dialog would be in its own colours
        dialog.setOption(QFileDialog.Option.DontUseNativeDialog)
        dialog.setGraphicsEffect(RedLight(dialog))
    chosen = [Path(name) for name in dialog.selectedFiles()] if dialog.exec() else []
    dialog.deleteLater()  # its parent would keep it
    return chosen
