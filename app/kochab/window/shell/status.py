"""The bar above the image: menus, the file and what is done with it. The bar below: what is under the cursor."""

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QMenuBar, QSizePolicy, QStatusBar, QToolButton, QWidget

from kochab.core.progress import Progress
from kochab.text.angle_text import short_name
from kochab.text.translation import tr, tr_noop
from kochab.window.widgets import ElidedLabel, ProgressBar, button, label, row

STAGE_TEXT = {
    "read": tr_noop("Reading"),
    "display": tr_noop("Preparing the image"),
    "detect": tr_noop("Detecting stars"),
    "identify": tr_noop("Identifying"),
    "attitude": tr_noop("Fitting"),
    "names": tr_noop("Naming stars"),
}


class TopBar(QFrame):
    """Menus, the open file and its state, progress with its Cancel; at the right end the mount, Stop last."""

    cancel_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("bar")
        self.menus = QMenuBar(self)
        self.menus.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Fixed)
        self.name, self.doing = ElidedLabel(), ElidedLabel(tr("Ready"))
        for text, role, purpose in ((self.name, "strong", tr("File")), (self.doing, "muted", tr("State"))):
            text.setProperty("role", role)
            text.setAccessibleDescription(purpose)
            text.setTextFormat(Qt.TextFormat.PlainText)
        self.progress = ProgressBar(tr("Progress"))
        self.progress.setFixedWidth(110)
        self.cancel = button(tr("Cancel"), self.cancel_wanted.emit, "small", tr("Stop (Esc)"))
        self.equipment = QToolButton(popupMode=QToolButton.ToolButtonPopupMode.InstantPopup)
        self.equipment.setObjectName("equipment")
        self.equipment.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self._row = row(
            self.menus, 10, self.name, (self.doing, 1), self.progress, self.cancel, self.equipment, on=self, spacing=8
        )
        self._row.setContentsMargins(6, 3, 8, 3)
        self._first = self._search = QWidget(self)  # until they are added
        self.show_idle(tr("Ready"))

    def add_first(self, widget: QWidget) -> None:
        """Put a widget beside the menus, which is left out where there is no room: the menus have it too."""
        self._first = widget
        self._row.insertWidget(2, widget)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.LayoutRequest:
            self._fit()
        return super().event(event)

    def _fit(self) -> None:
        """Leave out and shorten what a narrow bar has no room for; nothing is cut, least of all Stop."""
        spacing = self._row.spacing()
        least = self._row.minimumSize().width()
        if self._first.isHidden():
            least += self._first.sizeHint().width() + spacing
        if self._search.isHidden():
            least += self._search.sizeHint().width() + spacing
        for made in (self._first, self._search):
            if made.isHidden() is not (least > self.width()):
                made.setHidden(least > self.width())
            least -= made.sizeHint().width() + spacing

    def add_search(self, widget: QWidget) -> None:
        """Put a widget that looks like a field, and opens the search, between the file's state and the progress."""
        widget.setObjectName("search")
        self._search = widget
        self._row.insertWidget(self._row.indexOf(self.progress), widget)

    def add(self, widget: QWidget) -> None:
        """Put a widget at the right end."""
        self._row.addWidget(widget)

    def show_name(self, name: str) -> None:
        """The file whose image is shown."""
        self.name.setText(short_name(name))

    def show_progress(self, progress: Progress) -> None:
        text = tr(STAGE_TEXT.get(progress.stage, progress.stage.capitalize()))
        self.doing.setText(f"{text}…")
        self.doing.setToolTip(progress.detail)
        self.progress.show_share(progress.fraction)
        self.progress.show()
        self.cancel.show()

    def show_idle(self, text: str) -> None:
        self.doing.setText(text)
        self.progress.hide()
        self.cancel.hide()


class Status(QStatusBar):
    """What runs in the background, the place under the cursor, and the size of the open frame."""

    def __init__(self) -> None:
        super().__init__()
        self.setSizeGripEnabled(False)
        self.setContentsMargins(8, 0, 8, 0)
        self.place, self.background, self.frame = ElidedLabel(), ElidedLabel(), label("", "muted")
        self.place.setAccessibleDescription(tr("Under the cursor"))
        self.addWidget(self.place, 1)
        # A message hides the other widgets while it is shown, but not the permanent ones.
        self.addPermanentWidget(self.background)
        self.addPermanentWidget(self.frame)

    def show_frame(self, text: str, tip: str) -> None:
        """Size of the open frame, and its reader's warnings."""
        self.frame.setText(f"{text} ⚠" if tip else text)
        self.frame.setToolTip(tip)
