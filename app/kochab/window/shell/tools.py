"""What opens on request in a window of its own: Preferences, the search and the sky atlas."""

from functools import partial

from PySide6.QtCore import QObject, Qt

from kochab.window.frame.picker import Picker
from kochab.window.frame.search import Search
from kochab.window.services import Services
from kochab.window.shell.actions import command_called
from kochab.window.shell.appearance import Appearance
from kochab.window.shell.main_window import MainWindow
from kochab.window.shell.views import Views
from kochab.window.widgets import bring_to_front


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

    def search(self) -> Search:
        """Ask what to find."""
        command = partial(command_called, actions=self._window.actions_by_name)
        box = Search(self._window, self._services.session, self._services.settings, self._picker, command)
        box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose, False)
        box.open()
        return box

    def show_atlas(self) -> None:
        """Open the chart of the sky, or bring it to the front."""
        from kochab.window.atlas.dialog import Atlas

        bring_to_front(self._window.findChild(Atlas) or Atlas(self._window, self._services, self._views.aim))
