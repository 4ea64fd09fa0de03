"""One order of a view that wants to hear of its own end; heard of like a job."""

from collections.abc import Callable

from PySide6.QtCore import QObject, Signal

from app.ui.mount.words import Done, Failed


class Errand(QObject):
    """Exactly one of ``succeeded``, ``failed`` or ``cancelled`` comes, and then ``finished``."""

    succeeded = Signal(object)
    failed = Signal(str)
    cancelled = Signal()
    finished = Signal()

    def __init__(self, name: str, give_up: Callable[[], None], parent: QObject) -> None:
        super().__init__(parent)
        self.name = name
        self._give_up = give_up

    def cancel(self) -> None:
        """Stop the mount and give up what is under way."""
        self._give_up()

    def end(self, word: Done | Failed) -> None:
        """Say how it ended."""
        if isinstance(word, Done):
            self.succeeded.emit(word.result)
        elif word.stopped:
            self.cancelled.emit()
        else:
            self.failed.emit(word.sentence)
        self.finished.emit()
        self.deleteLater()
