"""One order to the mount, as a view follows it."""

from collections.abc import Callable

from PySide6.QtCore import QObject, Signal

from kochab.gear.mount_events import OrderDone, OrderFailed


class MountTask(QObject):
    """One order, with a job's signals: ``succeeded``, ``failed`` or ``cancelled``, then ``finished``."""

    succeeded = Signal(object)
    failed = Signal(str)
    cancelled = Signal()
    finished = Signal()

    def __init__(self, name: str, stop: Callable[[], None], parent: QObject) -> None:
        super().__init__(parent)
        self.name = name
        self._stop = stop

    def cancel(self) -> None:
        """Stop the mount and end what is under way."""
        self._stop()

    def end(self, event: OrderDone | OrderFailed) -> None:
        """Emit how it ended."""
        if isinstance(event, OrderDone):
            self.succeeded.emit(event.result)
        elif event.stopped:
            self.cancelled.emit()
        else:
            self.failed.emit(event.sentence)
        self.finished.emit()
        self.deleteLater()
