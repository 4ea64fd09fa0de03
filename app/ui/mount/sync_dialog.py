"""What a sync would do, in numbers, before a person says yes."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QDialog, QGridLayout, QHBoxLayout, QVBoxLayout, QWidget

from app.ui.formats import AngleStyle, arcsec_text, radec_text
from app.ui.mount.offset import Offset, OffsetArrow, size_text
from app.ui.palette import Colours
from app.ui.widgets import button, label
from app.workflows.sync_mount import SyncOffer

NO_SYNC = "Instead the telescope can be slewed by the offset, to where the mount says it points."
IF_REFUSED = "Should the mount refuse, the telescope is slewed by the offset instead."


class SyncDialog(QDialog):
    """``wanted`` when the person says yes; Escape says no. ``mount_deg`` is ICRS."""

    wanted = Signal(object)  # SyncOffer

    def __init__(
        self, parent: QWidget, offer: SyncOffer, mount_deg: tuple[float, float],
        style: AngleStyle, colours: Colours,
    ) -> None:  # fmt: skip
        super().__init__(parent)
        self.offer = offer
        self.setWindowTitle("Sync the mount")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        offset = Offset.between(mount_deg, offer.sky_deg)
        self.arrow = OffsetArrow()
        self.arrow.colours = colours
        self.arrow.show_offset(offset)
        preview = offer.preview
        column = QVBoxLayout(self)
        column.setContentsMargins(20, 20, 20, 16)
        column.setSpacing(10)
        column.addWidget(label(f"The sky is off by {size_text(offset.total_deg)}", "heading"))
        line = QHBoxLayout()
        line.addWidget(self.arrow)
        line.addLayout(_numbers(offer, offset, mount_deg, style), 1)
        column.addLayout(line)
        for sentences, role in (
            (preview.refusals, "wrong"), (preview.confirmations, "wrong"), (preview.warnings, ""),
        ):  # fmt: skip
            for sentence in sentences:
                column.addWidget(label(sentence, role, wrap=True))
        if offer.no_sync:
            column.addWidget(label(f"{offer.no_sync} {NO_SYNC}", "", wrap=True))
        elif preview.allowed:
            column.addWidget(label(IF_REFUSED, "muted", wrap=True))
        self.yes = button(_yes(offer), self._accept, "main")
        self.yes.setVisible(preview.allowed)
        self.no = button("Cancel" if preview.allowed else "Close", self.reject)
        buttons = QHBoxLayout()
        buttons.addStretch(1)
        buttons.addWidget(self.yes)
        buttons.addWidget(self.no)
        column.addLayout(buttons)
        (self.no if preview.confirmations or not preview.allowed else self.yes).setFocus()
        self.setMinimumWidth(520)

    def _accept(self) -> None:
        self.wanted.emit(self.offer)
        self.accept()


def _yes(offer: SyncOffer) -> str:
    if offer.no_sync:
        return "Slew by the offset"
    return "Sync all the same" if offer.preview.confirmations else "Sync"


def _numbers(
    offer: SyncOffer, offset: Offset, mount_deg: tuple[float, float], style: AngleStyle
) -> QGridLayout:
    frames = len(offer.evidence.centres_deg)
    rows = (
        ("The mount says", radec_text(*mount_deg, style)),
        ("The sky says", radec_text(*offer.sky_deg, style)),
        ("Offset", offset.parts_text),
        ("Proved by", "two frames that agree" if frames > 1 else "the open frame alone"),
        ("Residual", arcsec_text(offer.solution.rms_arcsec)),
    )
    grid = QGridLayout()
    grid.setHorizontalSpacing(14)
    for row, (title, text) in enumerate(rows):
        grid.addWidget(label(title, "muted"), row, 0)
        grid.addWidget(label(text), row, 1)
    grid.setColumnStretch(1, 1)
    return grid
