"""What opens on request in a window of its own: Preferences, the search and the sky atlas."""

from typing import TYPE_CHECKING

from PySide6.QtCore import QObject

from kochab.core.arrays import Floats
from kochab.window.frame.picker import Picker
from kochab.window.services import Services
from kochab.window.shell.appearance import Appearance
from kochab.window.shell.main_window import MainWindow
from kochab.window.shell.views import Views
from kochab.window.widgets import bring_to_front

if TYPE_CHECKING:
    from kochab.window.atlas.dialog import Atlas
    from kochab.window.shell.palette import Palette


class Tools(QObject):
    """Opens them, or brings to the front what is open."""

    def __init__(
        self, window: MainWindow, services: Services, appearance: Appearance, picker: Picker, views: Views
    ) -> None:
        super().__init__(window)
        self._window, self._services, self._appearance = window, services, appearance
        self._picker, self._views = picker, views

    def show_preferences(self, page: str = "") -> None:
        """Open the Preferences, perhaps at the page of the layers, or bring them to the front."""
        from kochab.window.shell.preferences import Preferences  # not needed to show the window

        shown = self._window.findChild(Preferences)
        dialog = shown or Preferences(self._window, self._services, self._appearance)
        if page == "layers":
            dialog.tabs.setCurrentWidget(dialog.layers_page)
        bring_to_front(dialog)

    def show_layers(self) -> None:
        """The Preferences at the page of the layers."""
        self.show_preferences("layers")

    def search(self) -> "Palette":
        """Ask what to find."""
        from kochab.window.shell.palette import Palette

        box = Palette(
            self._window,
            self._services,
            self._picker,
            self._window.actions_by_name,
            self._views.aim,
            self._show_in_atlas,
            self._show_frame,
        )
        box.finished.connect(box.deleteLater)
        box.open()
        return box

    def _show_frame(self) -> None:
        """Bring the open frame to the front, where a view's room is in its place."""
        if self._window.in_room:
            self._views.show("image")

    def show_atlas(self) -> None:
        """Open the chart of the sky, or bring it to the front."""
        bring_to_front(self._atlas())

    def _show_in_atlas(self, place: Floats) -> None:
        """Open the chart of the sky with an ICRS unit vector (3,) in its middle."""
        atlas = self._atlas()
        atlas.chart.look(place)
        bring_to_front(atlas)

    def _atlas(self) -> "Atlas":
        from kochab.window.atlas.dialog import Atlas

        shown = self._window.findChild(Atlas)
        return shown if isinstance(shown, Atlas) else Atlas(self._window, self._services, self._views.aim)
