"""Find a star, an object, a body of the frame, a place of the sky or a command by what a person types."""

from collections.abc import Callable
from datetime import datetime

import numpy as np
from PySide6.QtWidgets import QDialog, QWidget

from kochab.core.arrays import Floats
from kochab.core.attitude import angle_between, east_north
from kochab.core.frame import Hint, Site
from kochab.core.progress import run as finish
from kochab.core.solution import Solution
from kochab.sky.finder import Found, NotFound, find
from kochab.sky.horizon import horizon_of
from kochab.text.translation import tr, tr_noop
from kochab.window.frame.picker import Picker
from kochab.window.frame.session import Session
from kochab.window.settings import WindowSettings
from kochab.window.widgets import column, label, text_field

WAYS = (
    tr_noop("{angle:.1f}° north of the frame’s centre, outside the frame"),
    tr_noop("{angle:.1f}° north-east of the frame’s centre, outside the frame"),
    tr_noop("{angle:.1f}° east of the frame’s centre, outside the frame"),
    tr_noop("{angle:.1f}° south-east of the frame’s centre, outside the frame"),
    tr_noop("{angle:.1f}° south of the frame’s centre, outside the frame"),
    tr_noop("{angle:.1f}° south-west of the frame’s centre, outside the frame"),
    tr_noop("{angle:.1f}° west of the frame’s centre, outside the frame"),
    tr_noop("{angle:.1f}° north-west of the frame’s centre, outside the frame"),
)
CLOSEST_PX = 5.0  # a mark so near the place is what was sought
EXAMPLE = tr_noop("M 42, theta1 Ori, Sh2-155, 05h35m -5 23, grid")


def taken_for(text: str, found: Found) -> str:
    """What was taken where a name is short for several things; nothing where there is no doubt."""
    if found.sure and not found.alternatives:
        return ""
    others = ", ".join(found.alternatives) or "–"
    return tr("{text} is taken for {name}. Others: {others}", text=text, name=found.name, others=others)


def outside(solution: Solution, vector: Floats) -> str:
    """How far from the frame's centre a place (3,) is, and in which direction of the sky."""
    centre = solution.centre_vector
    east, north = east_north(centre) @ vector
    way = WAYS[round(float(np.degrees(np.arctan2(east, north))) / 45.0) % 8]
    return tr(way, angle=np.degrees(angle_between(centre, vector)))


def sought(text: str, when: datetime | None = None, site: Site | None = None) -> Found | NotFound:
    """What a person means; bodies of the Solar System where they are at a time, with the person's own elements."""
    from kochab.sky.elements import kept_elements

    return finish(find(text, when, site, [] if when is None else kept_elements()))


class Search(QDialog):
    """One field; Enter finds, Escape closes. ``command`` gives what runs the command that is called so."""

    def __init__(
        self,
        parent: QWidget,
        session: Session,
        settings: WindowSettings,
        picker: Picker,
        command: Callable[[str], Callable[[], None] | None],
    ) -> None:
        super().__init__(parent)
        self._session, self._settings, self._picker = session, settings, picker
        self._command = command
        self.setWindowTitle(tr("Search"))
        self.field = text_field(tr("Search"), tr(EXAMPLE), tr("A star, an object, a planet, coordinates or a command"))
        self.field.setMinimumWidth(self.fontMetrics().averageCharWidth() * 48)
        self.answer = label("", "muted", wrap=True)
        column(self.field, self.answer, on=self, spacing=8, margins=(12, 12, 12, 12))
        self.field.returnPressed.connect(self.seek)

    def seek(self) -> None:
        """Mark what is typed and close, or say where it is, or that nothing is called so."""
        text = self.field.text().strip()
        reply = self._sought(text) if text else ""
        self.answer.setText(reply)
        self.answer.setAccessibleName(reply)
        if not reply and text:
            self.accept()

    def _sought(self, text: str) -> str:
        """What is to be said; nothing when it is done."""
        run = self._command(text)
        if run is not None:
            self.accept()
            run()
            return ""
        solution = self._picker.overlay.solution
        body = next((m for m in self._picker.overlay.bodies if m.text.casefold() == text.casefold()), None)
        frame, site = self._session.known.frame, self._settings.site
        hint = Hint() if frame is None else frame.hint
        doubt = ""
        if body is not None and body.body is not None:
            vector = body.body.vector
        else:
            found = sought(text, hint.taken_utc, hint.site or site)
            if isinstance(found, NotFound):
                return found.sentence
            vector, doubt = found.vector, taken_for(text, found)
        if solution is None:
            return tr("No solved image is open.")
        x, y = solution.pixels_of(vector[None])[0].tolist()
        if not (-0.5 <= x < solution.camera.width - 0.5 and -0.5 <= y < solution.camera.height - 0.5):
            horizon = None if frame is None else horizon_of(frame, site)
            below = horizon is not None and horizon.altaz_deg(vector)[0] < 0.0
            return outside(solution, vector) + below * f", {tr('below the horizon')}"
        self._picker.find(x, y, CLOSEST_PX)
        return doubt
