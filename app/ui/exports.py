"""What can be written of a solution, through the functions of the rooms below."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtWidgets import QFileDialog, QMessageBox, QWidget

from app.core.errors import KochabError
from app.ui.session import Known

Write = Callable[[Known, Path], None]
EXPORTS: dict[str, tuple[str, str, Write]] = {}


def run_export(parent: QWidget, known: Known, suffix: str, write: Write) -> None:
    """Ask where to, write, and say so when that fails."""
    base = known.path or Path("frame")
    start = str(base.with_name(base.stem + suffix))
    name, _ = QFileDialog.getSaveFileName(parent, "Export", start)
    if not name:
        return
    try:
        write(known, Path(name))
    except (KochabError, OSError) as error:
        QMessageBox.warning(parent, "Export", str(error))
