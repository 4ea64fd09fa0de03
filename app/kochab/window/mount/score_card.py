"""How a practice went: two numbers, a word for each, and what to do next."""

from PySide6.QtWidgets import QFrame, QWidget

from kochab.gear.session import PracticeScore
from kochab.text.angle_text import angle_text
from kochab.text.translation import tr, tr_noop
from kochab.window.widgets import Part, button, column, grid, label, row, styled_frame

AXIS_GOAL_ARCSEC, POINTING_GOAL_ARCSEC = 30.0, 60.0
GOOD = 4.0  # times the goal
MOVED_BY_ASKING = 2.0  # so many times what is blamed, the pointing is off for what was asked
EXCELLENT, FINE, NOT_YET = tr_noop("excellent"), tr_noop("good"), tr_noop("not there yet")
SYNC_AGAIN = tr_noop("sync again after aligning")
ROLES = {EXCELLENT: "good", FINE: "", NOT_YET: "wrong"}


def grade(error_arcsec: float, goal_arcsec: float) -> str:
    """A word for an error, not translated."""
    if error_arcsec <= goal_arcsec:
        return EXCELLENT
    return FINE if error_arcsec <= GOOD * goal_arcsec else NOT_YET


def pointing_words(score: PracticeScore) -> str:
    """A word for the pointing, or what to do where the alignment has moved it: turning bolts is no mistake."""
    if score.off_arcsec > max(POINTING_GOAL_ARCSEC, MOVED_BY_ASKING * score.pointing_arcsec):
        return SYNC_AGAIN
    return grade(score.off_arcsec, POINTING_GOAL_ARCSEC)


def axis_advice(score: PracticeScore) -> str:
    """What to do about the polar axis."""
    if score.axis_arcsec <= AXIS_GOAL_ARCSEC:
        return ""
    return tr("Polar alignment (F4) brings it below 30″.")


class ScoreCard(QFrame):
    """Lies over the room when a practice is over; nothing waits for it."""

    def __init__(self, score: PracticeScore) -> None:
        super().__init__()
        self.setObjectName("card")
        self.setAccessibleName(tr("Practice"))
        minutes = max(1, round(score.elapsed_s / 60.0))
        head = label(tr("{points} of 100", points=score.points), "title")
        under = label(tr("after {minutes} min under a simulated sky", minutes=minutes), "muted")
        axis = grade(score.axis_arcsec, AXIS_GOAL_ARCSEC)
        rows = grid(
            self._row(tr("Polar axis"), score.axis_arcsec, axis),
            self._row(tr("Pointing"), score.off_arcsec, pointing_words(score)),
            across=18,
            down=8,
            stretch=(0, 0, 1),
        )
        advice = [label(text, wrap=True) for text in [axis_advice(score)] if text]
        self.close_button = button(tr("Close"), self.hide, "main")
        parts: list[Part] = [head, under, styled_frame("rule"), rows, *advice, row(None, self.close_button)]
        self.setFocusProxy(self.close_button)
        column(*parts, on=self, spacing=10, margins=(22, 18, 22, 16))

    @staticmethod
    def _row(title: str, error_arcsec: float, word: str) -> tuple[QWidget, ...]:
        return (
            label(title, "muted"),
            label(angle_text(error_arcsec / 3600.0), "value"),
            label(tr(word), ROLES.get(word, "")),
        )
