"""How the open frame looks: stretch, colour and the layers over it; all remembered."""

import json
from collections.abc import Callable

from PySide6.QtCore import QObject, Signal

from kochab.sky.layer import AMOUNTS, MARKS, SHOWN
from kochab.text.translation import tr
from kochab.window.frame.field import SkyField
from kochab.window.frame.workspace import Workspace
from kochab.window.settings import WindowSettings
from kochab.window.themes import HUES


class FrameLooks(QObject):
    """Stretch, colour, layers and red light of the open frame, from the settings and the commands."""

    changed = Signal()  # also with the theme

    def __init__(
        self, panes: Workspace, field: SkyField, settings: WindowSettings, say: Callable[[str], object]
    ) -> None:
        super().__init__(panes)
        self._panes, self._field, self._settings, self._say = panes, field, settings, say
        self.layers = field.overlay.layers
        self.colour = settings.flag("colour", True)
        for name in MARKS:
            self.layers.on[name] = settings.flag(f"sky/{name}", name in SHOWN)
        kept = settings.table("sky/amounts").items()
        # Settings may be damaged, or edited by hand.
        self.layers.amount |= {k: float(v) for k, v in kept if k in AMOUNTS and type(v) is float and 0.0 <= v <= 1.0}
        kept = settings.table("sky/colours").items()
        self.layers.colour |= {name: hue for name, hue in kept if name in MARKS and hue in HUES.values()}
        panes.strip.auto.setChecked(settings.flag("stretch", True))
        panes.strip.changed.connect(self.show_frame)
        # Sliders are for the open frame; only the switch is remembered.
        panes.strip.auto.toggled.connect(lambda on: settings.keep("stretch", on))

    @property
    def is_night(self) -> bool:
        """Whether only red light is allowed."""
        return self._settings.text("theme", "dark") == "night"

    def show_frame(self, _: object = None) -> None:
        """Draw the frame anew, as it should look."""
        self._panes.view.set_look(self._panes.strip.stretch, self.colour, self.is_night)

    def use_colour(self, on: bool) -> None:
        """Show it in colour, or mono."""
        self.colour = on
        self._settings.keep("colour", on)
        self.show_frame()

    def show_mark(self, name: str, on: bool) -> None:
        """Show a layer or not."""
        self._settings.keep(f"sky/{name}", on)
        self.layers.on[name] = on
        self._panes.view.update()
        if name == "altaz" and on and self._panes.view.picture is not None and self._field.horizon() is None:
            self._say(tr("No Alt/Az grid: the frame’s time or your site is not known."))

    def set_amount(self, layer: str, amount: float) -> None:
        """Draw more or less of a layer, 0..1."""
        self.layers.amount[layer] = amount
        self._settings.keep("sky/amounts", json.dumps(self.layers.amount))
        self._panes.view.update()

    def use_layers(self, looks: tuple[dict[str, float], dict[str, str]]) -> None:
        """Draw so much of the layers that are named first, and all in the colours that are named, or in their own."""
        amounts, colours = looks
        self.layers.amount |= amounts
        self.layers.colour = dict(colours)
        self._settings.keep("sky/amounts", json.dumps(self.layers.amount))
        self._settings.keep("sky/colours", json.dumps(colours))
        self._panes.view.update()
        self.changed.emit()
