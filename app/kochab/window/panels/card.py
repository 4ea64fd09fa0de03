"""The card over the image: the state of the frame, and where it points."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame

from kochab.core.progress import Progress
from kochab.core.solution import NoSolution, Solution
from kochab.text import angle_text
from kochab.text.angle_text import AngleStyle, breakable, short_name, unbroken
from kochab.text.translation import tr, tr_n
from kochab.window.widgets import (
    button,
    clear_layout,
    column,
    copy_text,
    facts_grid,
    grid,
    label,
    position_labels,
    set_role,
    show_text,
)
from kochab.workflows import solution_text

LONGEST = 120  # letters of a stage's detail


class Card(QFrame):
    """What the frame shows and where it points; for a failed solve the advice and the numbers."""

    hints_wanted = Signal()
    again_wanted = Signal()
    open_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("card")
        self.style_of_angles = AngleStyle.SEXAGESIMAL
        self._solution: Solution | None = None
        self._altaz = ""
        self._failure: NoSolution | None = None
        self._source = ""
        self.title = label("", "heading", wrap=True)
        self.text, self.advice = label("", "muted", wrap=True), label("", "strong", wrap=True)
        self.old = label("", "old", wrap=True)
        self.ra, self.dec = position_labels()
        self.facts = label("", wrap=True)
        self._short = False
        self._numbers = facts_grid(3)
        self.again = button(tr("Solve agai&n"), self.again_wanted.emit)
        self.hints = button(tr("H&ints…"), self.hints_wanted.emit, tip=tr("Give a pixel scale, a field or a position"))
        self.copy = button(tr("Copy re&port"), self._copy)
        self.open = button(tr("Open an&other…"), self.open_wanted.emit)
        buttons = grid((self.again, self.hints), (self.copy,), (self.open,), across=8, down=6, stretch=(0, 0, 1))
        state = (self.title, self.text, self.advice, self._numbers, buttons)
        column(*state, self.old, self.ra, self.dec, self.facts, on=self, spacing=4, margins=(12, 10, 12, 10))
        self._say(tr("No image"), tr("Open an image of the night sky."))
        self.show_pointing(None)

    def show_working(self, progress: Progress) -> None:
        doing = {"read": tr("Reading"), "display": tr("Preparing the image")}.get(progress.stage, tr("Solving"))
        self._say(f"{doing}…", short_name(progress.detail or progress.stage, LONGEST))

    def show_solution(self, solution: Solution, place: str = "") -> None:
        """Show how many stars matched, and the probability of a chance match, under the ``place`` if that is known."""
        odds = angle_text.false_alarm_text(solution.log10_false_alarm)
        self._say(
            place or tr("Solved"),
            tr_n(
                "{n} star matched (chance match: {odds})",
                "{n} stars matched (chance match: {odds})",
                len(solution.stars),
                odds=odds,
            ),
            "\n".join(solution.warnings),
        )
        self.show_pointing(solution)

    def show_place(self, name: str, altaz: str) -> None:
        """Say what the frame shows, and how high it stood where that is known."""
        show_text(self.title, name)
        self.setAccessibleName(name)
        self._altaz = altaz
        self.set_style(self.style_of_angles)

    def show_pointing(self, solution: Solution | None, old_from: str = "") -> None:
        """Show where a frame points; ``old_from`` marks it as the last one known of that file. None hides it."""
        # The altitude is told later, by show_place.
        self._solution, self._altaz = solution, ""
        old = tr("OLD: last solution, from {file}", file=short_name(old_from)) if old_from else ""
        show_text(self.old, old)
        for value in (self.ra, self.dec):
            set_role(value, "value_old" if old_from else "value")
        for shown in (self.ra, self.dec):
            shown.setVisible(solution is not None)
        self._show_parts()
        self.set_style(self.style_of_angles)

    def set_style(self, style: AngleStyle) -> None:
        """How the angles are written."""
        self.style_of_angles, s = style, self._solution
        if s is None:
            return
        ra, dec = s.ra_dec_deg
        self.ra.setText(angle_text.ra_text(ra, style))
        self.dec.setText(angle_text.dec_text(dec, style))
        self.facts.setText(solution_text.field_text(s, self._altaz))

    def shorten(self, on: bool) -> None:
        """Leave out what Details says too, where the whole card would hide the image."""
        if on != self._short:
            self._short = on
            self._show_parts()

    def _show_parts(self) -> None:
        solved = self._solution is not None
        self.text.setVisible(bool(self.text.text()) and not (self._short and solved))
        self.facts.setVisible(solved and not self._short)

    def show_failure(self, failure: NoSolution, source: str = "") -> None:
        """Why there is no solution, and what to do about it."""
        tried = tr("Tried: {tried}", tried=failure.tried) if failure.tried and failure.searched else ""
        title = tr("No solution: {reason}", reason=solution_text.reason_text(failure))
        self._say(title, tried, failure.advice, role="bad")
        self._failure, self._source = failure, source
        numbers = [*solution_text.measured_rows(failure), (tr("time"), solution_text.times_text(failure.elapsed_ms))]
        for at, (name, value) in enumerate(numbers):
            self._numbers.addWidget(label(name, "muted"), at, 0)
            self._numbers.addWidget(label(unbroken(value), wrap=True), at, 1)
        for b in (self.again, self.hints, self.copy):
            b.setVisible(True)

    def show_error(self, title: str, sentence: str) -> None:
        """A file that cannot be read, or a fault; another may be opened."""
        self._say(title, sentence, role="bad")
        self.open.setVisible(True)

    def show_stopped(self) -> None:
        self._say(tr("Cancelled"), "")
        self.again.setVisible(True)
        self.hints.setVisible(True)

    def _say(self, title: str, text: str, advice: str = "", role: str = "heading") -> None:
        self._failure = None
        show_text(self.title, title, role)
        show_text(self.text, breakable(text))
        self._show_parts()
        show_text(self.advice, advice)
        clear_layout(self._numbers)
        for b in (self.again, self.hints, self.copy, self.open):
            b.setVisible(False)
        self.setAccessibleName(title)
        self.setAccessibleDescription(f"{text} {advice}".strip())

    def _copy(self) -> None:
        if self._failure is not None:
            copy_text(solution_text.failure_plain(self._failure, self._source))
