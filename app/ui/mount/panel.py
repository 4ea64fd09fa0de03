"""The widgets of the Mount view and where they stand; what they show and do comes from outside."""

from PySide6.QtWidgets import QCheckBox, QHBoxLayout, QVBoxLayout, QWidget

from app.core.progress import Progress
from app.ui.mount.asks import Asks
from app.ui.mount.bring_mode import BringMode
from app.ui.mount.camera_box import CameraBox
from app.ui.mount.connect_box import ConnectBox
from app.ui.mount.desk import Desk
from app.ui.mount.go_box import GoBox
from app.ui.mount.meridian_box import MeridianBox
from app.ui.mount.nudge_pad import NudgePad
from app.ui.mount.pointing_box import PointingBox
from app.ui.mount.reasoned import ReasonedButton, ReasonedSwitch
from app.ui.mount.stop_key import KEY
from app.ui.progress_bar import ProgressBar
from app.ui.widgets import button, card, label, rule, scrolled, set_role


class MountPanel(QWidget):
    """Cards that scroll; what is said, the progress and Stop are always in sight below."""

    def __init__(self, desk: Desk, asks: Asks, bringing: BringMode, can_practise: bool) -> None:
        super().__init__()
        self.setObjectName("page")
        self.connect_box = ConnectBox(can_practise)
        self.camera = CameraBox()
        self.take = ReasonedButton("Take a frame", asks.take_frame, "See where it really points")
        self.sync = ReasonedButton(
            "Sync…", asks.offer_sync, "Look twice, then tell the mount where it is", "main"
        )
        self.undo = ReasonedButton("Undo sync", asks.undo_sync, "Take the last sync back")
        self.ask = ReasonedButton(
            "Why?", asks.why,
            "Take a frame and name the cause: summer time, epoch, site, hemisphere, cone",
        )  # fmt: skip
        self.bring = ReasonedButton(
            "Bring a star here…",
            bringing.begin,
            "Click a star in the frame, then where it shall go",
        )
        self.pad = NudgePad(self.bring)
        self.tracking = ReasonedSwitch("Tracking", "Follow the sky")
        self.after = QCheckBox("a frame afterwards")
        self.after.setToolTip("Take one and solve it when a goto or a nudge is over")
        self.go = GoBox(self.after)
        self.meridian = MeridianBox()
        self.pointing = PointingBox(self.tracking)
        self.leave = button("Disconnect", desk.disconnect_mount, "", "Stop, and close the port")
        self.stop = ReasonedButton(
            f"STOP  ({KEY})", desk.stop, f"Stop the mount now; {KEY} does it from anywhere", "stop"
        )
        self.cancel_find = button("Cancel", lambda: None)
        self.name = label("", "heading", wrap=True)
        self.said, self.why = label("", "muted", wrap=True), label("", "muted", wrap=True)
        self.bar = ProgressBar("Progress of the mount")
        self._lay_out()
        explained = [control.explained for control in self.controls().values()]
        for signal in (*explained, self.tracking.explained, self.pad.explained):
            signal.connect(self._explain)

    def _lay_out(self) -> None:
        for hidden in (self.bar, self.cancel_find, self.why):
            hidden.setVisible(False)
        doing = QHBoxLayout()
        doing.addWidget(self.bar, 1)
        doing.addWidget(self.cancel_find)
        outer = QVBoxLayout(self)
        outer.setContentsMargins(8, 8, 8, 8)
        self.area = scrolled(self._cards())
        outer.addWidget(self.area, 1)
        outer.addWidget(self.said)
        outer.addWidget(self.why)
        outer.addLayout(doing)
        outer.addWidget(self.stop)

    def _cards(self) -> QWidget:
        looking = _line(self.take, self.sync, self.undo, self.ask)
        self.connection = _card(self.connect_box)
        self.asking = _card(self.pointing, looking, self.camera)
        self.moving = _card(self.go, self.meridian, rule(), self.pad)
        inside = QWidget()
        inside.setObjectName("page")
        column = QVBoxLayout(inside)
        column.setContentsMargins(4, 4, 4, 4)
        column.setSpacing(10)
        top = QHBoxLayout()
        top.addWidget(self.name, 1)
        top.addWidget(self.leave)
        column.addLayout(top)
        for one in (self.connection, self.asking, self.moving):
            column.addWidget(one)
        column.addStretch(1)
        return inside

    def controls(self) -> dict[str, ReasonedButton]:
        """What is greyed with a reason, by the names of :mod:`app.ui.mount.reasons`."""
        return {
            "sync": self.sync, "undo": self.undo, "take": self.take, "goto": self.go.goto,
            "centre": self.go.centre, "bring": self.bring, "why": self.ask, "stop": self.stop,
        }  # fmt: skip

    def say(self, sentence: str, role: str) -> None:
        """One sentence that stays until the next."""
        if not sentence:
            return
        self.said.setText(sentence)
        if self.said.property("role") != role:
            set_role(self.said, role)

    def show_progress(self, progress: Progress | None, whose: str = "") -> None:
        """How far what is under way has come; None when it is over. ``whose`` is said before it."""
        self.bar.setVisible(progress is not None)
        if progress is None:
            return
        self.bar.show_share(progress.fraction)
        told = (whose, progress.stage if whose else progress.stage.capitalize(), progress.detail)
        doing = ": ".join(w.rstrip(".…") for w in told if w)
        self.say(f"{doing}…", "muted")

    def _explain(self, reason: str) -> None:
        self.why.setText(reason)
        self.why.setVisible(bool(reason))


def _line(*widgets: QWidget) -> QWidget:
    made = QWidget()
    line = QHBoxLayout(made)
    line.setContentsMargins(0, 0, 0, 0)
    for widget in widgets:
        line.addWidget(widget)
    line.addStretch(1)
    return made


def _card(*widgets: QWidget) -> QWidget:
    made = card()
    column = QVBoxLayout(made)
    column.setContentsMargins(12, 10, 12, 10)
    column.setSpacing(8)
    for widget in widgets:
        column.addWidget(widget)
    return made
