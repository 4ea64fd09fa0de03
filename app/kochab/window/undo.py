"""What a person changed in the window and may take back; no step of it moves a mount."""

from collections.abc import Callable
from typing import TypeVar

from PySide6.QtCore import QObject
from PySide6.QtGui import QAction, QUndoCommand, QUndoStack

from kochab.text.translation import tr

T = TypeVar("T")
MOST_STEPS = 30


class Step(QUndoCommand):
    """One change, which is made already; one that returns False could not be, and is forgotten."""

    def __init__(self, text: str, back: Callable[[], object], again: Callable[[], object]) -> None:
        super().__init__(text)
        self._back, self._again = back, again
        self._made = False

    def undo(self) -> None:
        # Most changes return None, which is no refusal.
        self.setObsolete(self._back() is False)

    def redo(self) -> None:
        """Make the change again; a stack also calls this for a step that is new to it."""
        if self._made:
            self.setObsolete(self._again() is False)
        self._made = True


class Undo(QUndoStack):
    """The steps of one window; its two actions name the next."""

    def __init__(self, undo: QAction, redo: QAction, parent: QObject) -> None:
        super().__init__(parent)
        self._actions = undo, redo
        self.setUndoLimit(MOST_STEPS)
        self.indexChanged.connect(self._show)
        self._show()

    def made(self, text: str, use: Callable[[T], object], before: T, after: T) -> None:
        """Remember a change.

        Parameters
        ----------
        text : str
            What was changed, for the menu.
        use : Callable[[T], object]
            Makes a state so.
        before, after : T
            The state before and after; nothing is remembered where they are equal.
        """
        if before != after:
            self.push(Step(text, lambda: use(before), lambda: use(after)))

    def _show(self, _: int = 0) -> None:
        undo, redo = self._actions
        undo.setEnabled(self.canUndo())
        redo.setEnabled(self.canRedo())
        # A single & in a name would become a mnemonic.
        back, again = (text.replace("&", "&&") for text in (self.undoText(), self.redoText()))
        undo.setText(tr("&Undo: {what}", what=back) if self.canUndo() else tr("&Undo"))
        redo.setText(tr("Re&do: {what}", what=again) if self.canRedo() else tr("Re&do"))
