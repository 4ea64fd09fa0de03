"""The card at the top of the side pane: solving, solved, or why not and what to do."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QFrame, QGridLayout, QVBoxLayout

from app.core.progress import Progress
from app.core.solution import NoSolution, Solution
from app.ui.formats import breakable, false_alarm_text, short_name, unbroken
from app.ui.solution_text import failure_plain, measured_rows, times_text
from app.ui.widgets import button, copy_text, label, set_role

LONGEST = 120  # of what a stage says of itself


class StateCard(QFrame):
    """One sentence about the frame, and for a failed solve the advice and the numbers."""

    hints_wanted = Signal()
    again_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("card")
        self.title = label("No frame", "heading", wrap=True)
        self.text = label("", wrap=True)
        self.advice = label("", wrap=True)
        self.advice.setStyleSheet("font-weight: 600;")
        self._failure: NoSolution | None = None
        self._source = ""
        self._numbers = QGridLayout()
        self._numbers.setHorizontalSpacing(12)
        self._numbers.setVerticalSpacing(3)
        self._numbers.setColumnStretch(1, 1)
        self.again = button("Solve agai&n", self.again_wanted.emit)
        self.hints = button("G&ive a hint…", self.hints_wanted.emit, tip="Scale, field or place")
        self.copy = button("Copy re&port", self._copy)
        buttons = QGridLayout()
        buttons.setSpacing(8)
        for i, b in enumerate((self.again, self.hints, self.copy)):
            buttons.addWidget(b, i // 2, i % 2)
        buttons.setColumnStretch(2, 1)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(12, 10, 12, 10)
        layout.setSpacing(6)
        for w in (self.title, self.text, self.advice):
            layout.addWidget(w)
        layout.addLayout(self._numbers)
        layout.addLayout(buttons)
        self._say("No frame", "Open a picture of the night sky.")

    def show_working(self, progress: Progress) -> None:
        """What is being done now."""
        doing = {"read": "Reading", "display": "Preparing the picture"}.get(
            progress.stage, "Solving"
        )
        self._say(f"{doing}…", short_name(progress.detail or progress.stage, LONGEST))

    def show_solution(self, solution: Solution) -> None:
        """How sure the answer is."""
        odds = false_alarm_text(solution.log10_false_alarm)
        self._say("Solved", f"{len(solution.stars)} stars agree; by chance that happens {odds}.",
                  role="good")  # fmt: skip
        if solution.warnings:
            self.advice.setText("\n".join(solution.warnings))
            self.advice.setVisible(True)

    def show_failure(self, failure: NoSolution, source: str = "") -> None:
        """Why there is no answer, and what to do about it."""
        tried = f"Tried: {failure.tried}" if failure.tried else ""
        self._say(f"No solution: {failure.reason}", tried, failure.advice, role="bad")
        self._failure, self._source = failure, source
        numbers = [*measured_rows(failure), ("time", times_text(failure.elapsed_ms))]
        for row, (name, value) in enumerate(numbers):
            self._numbers.addWidget(label(name, "muted"), row, 0, Qt.AlignmentFlag.AlignTop)
            self._numbers.addWidget(label(unbroken(value), wrap=True), row, 1)
        for b in (self.again, self.hints, self.copy):
            b.setVisible(True)

    def show_trouble(self, sentence: str) -> None:
        """A file that cannot be read, or a fault."""
        self._say("This did not work", sentence, role="bad")

    def show_stopped(self) -> None:
        """The person stopped it."""
        self._say("Cancelled", "Nothing was found yet.")
        self.again.setVisible(True)
        self.hints.setVisible(True)

    def _say(self, title: str, text: str, advice: str = "", role: str = "heading") -> None:
        self._failure = None
        self.title.setText(title)
        set_role(self.title, role if role != "good" else "heading")
        self.text.setText(breakable(text))
        self.text.setVisible(bool(text))
        self.advice.setText(advice)
        self.advice.setVisible(bool(advice))
        while (item := self._numbers.takeAt(0)) is not None:
            if (old := item.widget()) is not None:
                old.hide()
                old.deleteLater()
        for b in (self.again, self.hints, self.copy):
            b.setVisible(False)
        self.setAccessibleName(title)
        self.setAccessibleDescription(f"{text} {advice}".strip())

    def _copy(self) -> None:
        if self._failure is not None:
            copy_text(failure_plain(self._failure, self._source))
