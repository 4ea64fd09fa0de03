"""The equipment profile in use: shown in the bar, where its menu chooses another, for every view."""

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QMenu, QToolButton

from kochab.core import tr, tr_noop
from kochab.core.angle_text import short_name
from kochab.core.errors import KochabError
from kochab.gear.profiles import choose_profile, current_profile, saved_profiles
from kochab.window.settings import WindowSettings

LONGEST = 24  # letters of a name in the bar
LOCKED = tr_noop("Disconnect the mount before you choose other equipment.")


class Equipment(QObject):
    """Chooses the profile and tells the views; while a mount is connected it stays, with its limits."""

    changed = Signal()
    refused = Signal(str)  # why a profile can't be used

    def __init__(self, button: QToolButton, settings: WindowSettings, edit: QAction) -> None:
        super().__init__(button)
        self._button, self._settings, self._edit = button, settings, edit
        self.locked = False
        self._menu = QMenu(button)
        self._menu.aboutToShow.connect(self._fill)
        button.setMenu(self._menu)
        self._show()

    def choose(self, name: str) -> None:
        """Use the profile of this name from now on; a new name keeps what is used now, "" is none."""
        if self.locked and name != current_profile(self._settings).name:
            self.refused.emit(tr(LOCKED))
            return
        try:
            choose_profile(self._settings, name)
        except KochabError as error:
            self.refused.emit(str(error))
            return
        self.tell()

    def lock(self, on: bool) -> None:
        """Keep the profile that is used, or let another be chosen."""
        self.locked = on

    def tell(self) -> None:
        """What the profile holds has changed, or another is used."""
        self._show()
        self.changed.emit()

    def _show(self) -> None:
        profile = current_profile(self._settings)
        scale = profile.scale_arcsec_px
        self._button.setText(short_name(profile.name, LONGEST).replace("&", "&&") or tr("Equipment"))
        facts = (
            tr("Equipment: {name}", name=profile.name or tr("no profile")),
            tr("{mm:g} mm", mm=profile.focal_length_mm) if profile.focal_length_mm else "",
            tr("{scale:.2f}″/px", scale=scale) if scale else "",
            profile.source and tr("camera {source}", source=profile.source),
            profile.port and tr("mount {driver} on {port}", driver=profile.mount.driver, port=profile.port),
        )
        self._button.setToolTip(", ".join(filter(None, facts)))
        self._button.setAccessibleName(self._button.toolTip())

    def _fill(self) -> None:
        self._menu.clear()
        current, group = current_profile(self._settings).name, QActionGroup(self._menu)
        for name in ("", *(profile.name for profile in saved_profiles()[0])):
            action = self._menu.addAction(short_name(name).replace("&", "&&") or tr("No profile"))
            action.setCheckable(True)
            action.setChecked(name == current)
            action.setEnabled(not self.locked or name == current)
            action.triggered.connect(lambda _=False, chosen=name: self.choose(chosen))
            group.addAction(action)
        self._menu.addSeparator()
        self._menu.addAction(self._edit)
