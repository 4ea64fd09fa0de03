"""What is seen and its numbers, as files: pictures as PNG, tables as CSV."""

import csv
import io
from collections.abc import Callable, Iterable
from pathlib import Path

from PySide6.QtCore import QByteArray, QPoint
from PySide6.QtGui import QImage, QImageWriter
from PySide6.QtWidgets import QWidget

from app.core.errors import KochabError
from app.core.progress import Progress, Task
from app.frames.whole_file import whole_file, write_whole

RATIO = 2.0  # pixels of the picture for one of the screen


def picture_of(widget: QWidget) -> QImage:
    """What a widget shows, at twice the size."""
    size = widget.size() * RATIO
    image = QImage(size, QImage.Format.Format_RGB32)
    image.setDevicePixelRatio(RATIO)
    image.fill(widget.palette().window().color())
    widget.render(image, QPoint())
    return image


def table_of(rows: Iterable[Iterable[object]]) -> str:
    """Rows as CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def writing_picture(picture: QImage, path: Path) -> Task[Path]:
    """Write a picture; KochabError when that cannot be done."""

    def write() -> None:
        with whole_file(path) as part:
            writer = QImageWriter(str(part), QByteArray(b"PNG"))
            if not writer.write(picture):
                raise OSError(writer.errorString())

    return _writing(write, path)


def writing_text(text: str, path: Path) -> Task[Path]:
    """Write a text; KochabError when that cannot be done."""
    return _writing(lambda: write_whole(path, text), path)


def _writing(write: Callable[[], None], path: Path) -> Task[Path]:
    yield Progress("export", None, path.name)
    try:
        write()
    except OSError as error:
        why = error.strerror or error
        raise KochabError(f"{path.name} could not be written: {why}.") from error
    return path
