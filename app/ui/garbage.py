"""Python's cyclic garbage, collected only in the window's thread and never for long.

Left alone, Python collects in whatever thread happens to allocate. In a worker that destroys Qt
objects outside their thread, which ends the program; and a full collection walks a hundred
thousand objects of imported modules, which holds up the window for a tenth of a second.
"""

import gc
import sys

from PySide6.QtCore import QObject, QTimer

EVERY_MS = 1000
FULL_EVERY = 10  # ticks


class Garbage(QObject):
    """Takes over from Python's own schedule while it lives; `stop` gives it back."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._modules = 0
        self._ticks = 0
        self._timer = QTimer(self)
        self._timer.timeout.connect(self.tick)
        self._timer.start(EVERY_MS)
        gc.disable()
        self.tick()

    def tick(self) -> None:
        """Set aside what imports made, which stays for good; collect the rest when it is young."""
        self._ticks += 1
        if len(sys.modules) != self._modules:
            self._modules = len(sys.modules)
            gc.freeze()
        else:
            gc.collect(2 if self._ticks % FULL_EVERY == 0 else 1)

    def stop(self) -> None:
        """Let Python collect when it likes again."""
        self._timer.stop()
        gc.unfreeze()
        gc.enable()
