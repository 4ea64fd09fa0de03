"""The equipment profile in use: shown in the bar, where its menu chooses another, for every view."""

from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QMenu, QToolButton

from kochab.core.errors import KochabError
from kochab.gear.profiles import (
    EquipmentProfile,
    choose_profile,
    current_profile,
    keep_profile,
    remove_profile,
    save_profile,
    saved_profiles,
)
from kochab.text.angle_text import short_name
from kochab.text.translation import tr, tr_noop
from kochab.window.devices.mount_control import MountControl
from kochab.window.settings import WindowSettings
from kochab.window.undo import Undo

LONGEST = 24  # letters of a name in the bar
LOCKED = tr_noop("Disconnect the mount before you choose other equipment.")


class Equipment(QObject):
    """Chooses the profile and tells the views; while a mount is connected it stays, with its limits."""

    changed = Signal()
    refused = Signal(str)  # why a profile can't be used

    def __init__(self, button: QToolButton, settings: WindowSettings, edit: QAction, undo: Undo) -> None:
        super().__init__(button)
        self._button, self._settings, self._edit, self._undo = button, settings, edit, undo
        self.locked = False
        self._menu = QMenu(button)
        self._menu.aboutToShow.connect(self._fill)
        button.setMenu(self._menu)
        self._show()

    def follow(self, mount: MountControl) -> None:
        """Keep the profile while a mount is connected; another site than the connected mount's is told there."""
        mount.changed.connect(lambda: self.lock(mount.known.phase != "off"))
        self.changed.connect(mount.compare_site)

    def choose(self, name: str) -> None:
        """Use the profile of this name from now on; a new name keeps what is used now, "" is none."""
        before = current_profile(self._settings).name
        if self._use(name):
            self._undo.made(
                tr("use {name}", name=short_name(name, LONGEST) or tr("no profile")), self._use, before, name
            )

    def _use(self, name: str) -> bool:
        if self.locked and name != current_profile(self._settings).name:
            self.refused.emit(tr(LOCKED))
            return False
        try:
            choose_profile(self._settings, name)
        except KochabError as error:
            self.refused.emit(str(error))
            return False
        self.tell()
        return True

    def keep(self, **values: Any) -> None:
        """Give the profile that is used other values."""
        profile = current_profile(self._settings)
        before = {name: getattr(profile, name) for name in values}
        if values != before:
            self._keep((profile.name, values))
            self._undo.made(tr("change the equipment"), self._keep, (profile.name, before), (profile.name, values))

    def _keep(self, kept: tuple[str, dict[str, Any]]) -> bool:
        name, values = kept
        if name != current_profile(self._settings).name and not self._use(name):
            return False
        keep_profile(self._settings, **values)
        self.tell()
        return True

    def remove(self) -> None:
        """Delete the profile that is used; its values stay in use, without a name."""
        profile = current_profile(self._settings)
        if self.locked or not profile.name:
            self.refused.emit(tr(LOCKED) if self.locked else tr("Choose a profile first."))
        elif self._put((profile.name, None)):
            text = tr("remove the profile {name}", name=short_name(profile.name, LONGEST))
            self._undo.made(text, self._put, (profile.name, profile), (profile.name, None))

    def _put(self, there: tuple[str, EquipmentProfile | None]) -> bool:
        """Let there be a profile, and use it; or none of this name."""
        name, profile = there
        try:
            if profile is None:
                remove_profile(name)
            else:
                save_profile(profile)
        except KochabError as error:
            self.refused.emit(str(error))
            return False
        return self._use("" if profile is None else name)

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
        # A single & would underline the letter after it.
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
