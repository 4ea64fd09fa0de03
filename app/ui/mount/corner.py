"""How the mount is and a Stop, in the window's lower edge: in sight whichever view is open."""

from collections.abc import Callable

from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.ui.mount.known import MountKnown
from app.ui.mount.stop_key import KEY
from app.ui.widgets import button, label, set_role

LINES = {
    "off": "No mount", "connecting": "Mount: connecting…", "leaving": "Mount: closing the line…",
    "lost": "Mount: LINE LOST",
}  # fmt: skip
SHORT = {
    "goto": "going there", "centre": "centring", "nudge": "nudging", "bring": "bringing a star",
    "take": "taking a frame", "offer": "looking twice", "accept": "syncing",
    "undo": "undoing a sync", "track": "switching tracking", "why": "asking why",
    "polar": "polar alignment",
}  # fmt: skip


class MountCorner(QWidget):
    """A few words and one button; the button is there while a mount is connected."""

    def __init__(self, stop: Callable[[], None]) -> None:
        super().__init__()
        self.text = label("", "muted")
        self.text.setAccessibleName("Mount")
        tip = f"Stop the mount now; {KEY} does it from anywhere"
        self.stop = button(f"Stop mount ({KEY})", stop, "small", tip)
        line = QHBoxLayout(self)
        line.setContentsMargins(10, 0, 0, 0)
        line.setSpacing(8)
        line.addWidget(self.text)
        line.addWidget(self.stop)

    def show_known(self, known: MountKnown) -> None:
        """Bring it up to date."""
        self.text.setText(corner_text(known))
        self.text.setToolTip(_whole(known))
        role = "wrong" if known.phase == "lost" else "muted" if known.phase == "off" else ""
        if self.text.property("role") != role:
            set_role(self.text, role)
        self.stop.setVisible(known.phase not in ("off", "leaving"))


def corner_text(known: MountKnown) -> str:
    """The mount in three words: what it is used for, else how it is."""
    if known.phase in LINES:
        return LINES[known.phase]
    name = "Practice mount" if known.practice else "Mount"
    if known.busy:
        return f"{name}: {SHORT.get(known.busy, known.busy)}"
    state = None if known.report is None else known.report.state
    if state is None:
        return f"{name}: connected"
    if state.parked:
        return f"{name}: parked"
    if state.slewing:
        return f"{name}: slewing"
    tracks = {True: "tracking", False: "not tracking", None: "connected"}
    return f"{name}: {tracks[state.tracking]}"


def _whole(known: MountKnown) -> str:
    """Its name and port."""
    if known.connected is None:
        return ""
    return ", ".join(w for w in (known.connected.name, known.port, known.user) if w)
