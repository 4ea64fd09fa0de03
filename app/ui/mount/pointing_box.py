"""Where the mount says it is, where the sky says it is, and the offset between them."""

from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLabel, QVBoxLayout, QWidget

from app.core.hint import Site
from app.core.mount import MountState
from app.ui.formats import AngleStyle, dec_text, ra_text
from app.ui.mount.known import MountKnown
from app.ui.mount.offset import Offset, OffsetArrow, size_text
from app.ui.widgets import label, set_role, value_label

NOT_ASKED = "not asked yet"


class PointingBox(QWidget):
    """Shows; decides nothing. ``beside`` stands at the side of the state."""

    def __init__(self, beside: QWidget) -> None:
        super().__init__()
        self.mount = [value_label("The mount says, right ascension"), value_label("Declination")]
        self.sky = [value_label("The sky says, right ascension"), value_label("Declination")]
        for value in (*self.mount, *self.sky):
            value.setProperty("role", "value")
            value.setWordWrap(False)
        self.state = value_label("State of the mount")
        self.total, self.parts = value_label("Offset"), value_label("Offset, both parts")
        self.total.setProperty("role", "value")
        self.age = label("", "muted", wrap=True)
        self.arrow = OffsetArrow()
        self._lay_out(beside)

    def _lay_out(self, beside: QWidget) -> None:
        grid = QGridLayout()
        grid.setHorizontalSpacing(16)
        grid.setVerticalSpacing(2)
        for column, (title, values) in enumerate(
            (("The mount says", self.mount), ("The sky says", self.sky))
        ):
            grid.addWidget(label(title, "muted"), 0, column)
            for row, value in enumerate(values):
                grid.addWidget(value, row + 1, column)
            grid.setColumnStretch(column, 1)
        numbers = QVBoxLayout()
        numbers.addWidget(label("The sky is off by", "muted"))
        numbers.addWidget(self.total)
        numbers.addWidget(self.parts)
        numbers.addWidget(self.age)
        numbers.addStretch(1)
        line = QHBoxLayout()
        line.setSpacing(14)
        line.addWidget(self.arrow)
        line.addLayout(numbers, 1)
        column_ = QVBoxLayout(self)
        column_.setContentsMargins(0, 0, 0, 0)
        first = QHBoxLayout()
        first.addWidget(self.state, 1)
        first.addWidget(beside)
        column_.addLayout(first)
        column_.addLayout(grid)
        column_.addLayout(line)

    def show_known(self, known: MountKnown, style: AngleStyle) -> None:
        """Write everything anew."""
        report, sight = known.report, known.sight
        _write(self.mount, None if report is None else report.icrs_deg, style, "–")
        sky = None if sight is None else sight.solution.ra_dec_deg
        _write(self.sky, sky, style, NOT_ASKED if known.phase == "on" else "–")
        offset = None if sight is None or sky is None else Offset.between(sight.mount_deg, sky)
        self.total.setText("–" if offset is None else size_text(offset.total_deg))
        self.parts.setText("" if offset is None else offset.parts_text)
        self.arrow.show_offset(offset, known.moved_since)
        age = "" if sight is None else f"from the frame solved at {sight.when:%H:%M:%S} UTC"
        if known.moved_since:
            age = f"OLD: the mount has moved since; {age}"
        self.age.setText(age)
        role = "wrong" if known.phase == "lost" else ""
        if self.state.property("role") != role:
            set_role(self.state, role)
        self.state.setText(state_text(known))


def state_text(known: MountKnown) -> str:
    """How the mount is, in words."""
    if known.phase == "off":
        return "Not connected."
    if known.phase == "connecting":
        return "Connecting…"
    if known.phase == "leaving":
        return "Closing the line…"
    if known.phase == "lost":
        return "LINE LOST: what is shown is old. It is tried again by itself."
    if known.report is None:
        return known.trouble or "Asking where it is…"
    words = words_of(known.report.state)
    site: Site | None = known.connected.site if known.connected is not None else None
    if site is None:
        words.append("no site: give yours, or nothing may move")
    told = ", ".join(words)
    trouble = f". {known.trouble}" if known.trouble else ""
    return f"{told[:1].upper()}{told[1:]}, on {known.port}{trouble}"


def words_of(state: MountState) -> list[str]:
    """What the mount tells of itself; what it does not tell is left out."""
    words = []
    if state.parked:
        words.append("parked")
    elif state.slewing:
        words.append("slewing")
    elif state.tracking is None:
        words.append("not slewing" if state.slewing is False else "at rest or slewing: not told")
    else:
        words.append("tracking" if state.tracking else "standing still, not tracking")
    if state.aligned is not None:
        words.append("aligned" if state.aligned else "not aligned")
    if state.pier_side is not None:
        words.append(f"{state.pier_side} of the pier")
    return words


def _write(
    labels: list[QLabel], place: tuple[float, float] | None, style: AngleStyle, empty: str
) -> None:
    texts = (empty, "") if place is None else (ra_text(place[0], style), dec_text(place[1], style))
    for one, text in zip(labels, texts, strict=True):
        one.setText(text)
