"""How the window and the frame look: theme, text size, stretch, colour, marks; all remembered."""

from PySide6.QtCore import QObject, QSignalBlocker, Signal
from PySide6.QtGui import QActionGroup, QColor
from PySide6.QtWidgets import QApplication, QLineEdit, QWidget

from app.ui.actions import MARKS, dress
from app.ui.palette import THEMES, Colours
from app.ui.presenter import Presenter
from app.ui.red_light import dress_field
from app.ui.theme import apply_theme
from app.ui.wardrobe import Wardrobe


class Looks(QObject):
    """Owns no widget; sets their looks from the settings and from the person's choices."""

    changed = Signal(object)  # Colours

    def __init__(self, presenter: Presenter) -> None:
        super().__init__(presenter.window)
        self._window, self._settings = presenter.window, presenter.settings
        self._overlay = presenter.overlay
        self._actions = self._window.actions_by_name
        self._wardrobe = Wardrobe(self._window)
        self._panes = self._window.workspace
        self._restore()
        self._panes.strip.changed.connect(self._stretched)
        # A slider is moved for the frame at hand: only the switch is remembered for others.
        self._panes.strip.auto.toggled.connect(lambda on: self._settings.keep("stretch", on))
        self._window.menus.themes.triggered.connect(lambda a: self.use_theme(a.data()))
        self._window.menus.text_sizes.triggered.connect(
            lambda a: self.use_theme(text_size=a.data())
        )

    def _restore(self) -> None:
        for name in MARKS:
            self._actions[name].setChecked(getattr(self._overlay.switches, name))
        automatic = self._settings.flag("stretch", True)
        self._actions["stretch"].setChecked(automatic)
        self._panes.strip.auto.setChecked(automatic)
        self._actions["colour"].setChecked(self._settings.flag("colour", True))
        self.use_theme()

    @property
    def is_night(self) -> bool:
        """Whether only red light is allowed."""
        return self._settings.text("theme", "dark") == "night"

    def use_theme(self, name: str | None = None, text_size: str | None = None) -> None:
        """Dress the application and remember it; what is not given stays as it is."""
        name = name or self._settings.text("theme", "dark")
        name = name if name in THEMES else "dark"
        size = text_size or self._settings.text("text_size", "normal")
        app = QApplication.instance()
        assert isinstance(app, QApplication)
        colours, sheet = apply_theme(app, name, size)
        self._wardrobe.wear(sheet)
        self._settings.keep("theme", name)
        self._settings.keep("text_size", size)
        if name != "night":
            self._settings.keep("day_theme", name)
        dress(self._actions, colours)
        self._overlay.colours, self._overlay.font = colours, app.font()
        self._panes.strip.histogram.wear(colours)
        self._panes.view.background = QColor(colours.sky)
        _check(self._window.menus.themes, name)
        _check(self._window.menus.text_sizes, size)
        with QSignalBlocker(self._actions["night"]):
            self._actions["night"].setChecked(name == "night")
        self.dress_fields(self._window)
        self._window.welcome.draw_pictures(name == "night")
        self.show_frame()
        self.changed.emit(colours)

    @property
    def colours(self) -> Colours:
        """Those of the present theme."""
        return self._overlay.colours

    @property
    def settled(self) -> bool:
        """Whether the whole window wears the present theme; it takes a few turns of the loop."""
        return self._wardrobe.done

    def dress_fields(self, within: QWidget) -> None:
        """Make the carets of the fields in ``within`` red at night."""
        for field in within.findChildren(QLineEdit):
            dress_field(field)

    def use_night(self, on: bool) -> None:
        """Red light, or back to the theme of before."""
        self.use_theme("night" if on else self._settings.text("day_theme", "dark"))

    def show_frame(self, _: object = None) -> None:
        """Draw the frame with the present stretch and colouring."""
        colour = self._actions["colour"].isChecked()
        self._settings.keep("colour", colour)
        self._panes.view.set_look(self._panes.strip.stretch, colour, self.is_night)

    def show_mark(self, name: str, on: bool) -> None:
        """Switch one kind of mark."""
        setattr(self._overlay.switches, name, on)
        self._settings.keep_switches(self._overlay.switches)
        self._panes.view.update()

    def _stretched(self, _: object) -> None:
        automatic = self._panes.strip.auto.isChecked()
        self._actions["stretch"].setChecked(automatic)
        self.show_frame()


def _check(group: QActionGroup, name: str) -> None:
    for action in group.actions():
        action.setChecked(action.data() == name)
