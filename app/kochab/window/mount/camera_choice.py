"""The camera that solves for the mount: chosen here or in another view, kept in the profile, in use at once."""

from PySide6.QtCore import QObject

from kochab.gear.profiles import save_selection
from kochab.gear.session import CameraSelection
from kochab.window.devices.cameras import CameraBox, Cameras
from kochab.window.devices.mount_control import MountControl
from kochab.window.settings import WindowSettings


class CameraChoice(QObject):
    """Keeps the fields of ``box``, the mount's camera and the choice of the other views the same."""

    def __init__(self, parent: QObject, control: MountControl, cameras: Cameras, settings: WindowSettings) -> None:
        super().__init__(parent)
        self.box = CameraBox(at_once=True)
        self._control, self._cameras, self._settings = control, cameras, settings
        self._shown: CameraSelection | None = None
        self.box.chosen.connect(self._use)
        self.box.follow(cameras)
        # The box does not adopt it by itself: here a camera is in use as soon as it is chosen.
        cameras.chosen.connect(self._adopt)

    def use_profiles(self, camera: CameraSelection, of_other_view: tuple[str, str] | None = None) -> None:
        """Use the profile's camera, or the one that another view has chosen; a practice telescope keeps its own."""
        if not self._control.known.practice:
            if of_other_view is not None:
                camera = CameraSelection(*of_other_view, camera.exposure_s)
            self.box.show_selection(camera)
            self._control.use_camera(camera if camera.source else None)

    def tell_others(self) -> None:
        """Let the other views choose this camera, too."""
        if (camera := self.box.selection) is not None:
            self._cameras.choose(camera.source, camera.address)

    def show(self) -> None:
        """Show the mount's camera as it is in use."""
        camera = self._control.telescope.camera
        selection = None if camera is None else camera.selection
        # Not whenever the fields differ: this runs twice a second, and a person may be typing in them.
        if selection != self._shown:
            self._shown = selection
            self.box.show_selection(selection or CameraSelection("", "", self.box.exposure.value()))
        self.box.show_note("" if camera is None else camera.exposure_note)

    def _use(self, selection: CameraSelection | None) -> None:
        if not self._control.known.practice:
            # The practice camera must not become the profile's.
            save_selection(self._settings, selection or CameraSelection(""))
        self._control.use_camera(selection)
        if selection is not None:
            self._cameras.choose(selection.source, selection.address)

    def _adopt(self, source: str, address: str) -> None:
        """Use the camera that another view has chosen; a practice telescope keeps its own."""
        selection = CameraSelection(source, address, self.box.exposure.value())
        # This view's own choice comes back here, too.
        if selection != self.box.selection and not self._control.known.practice:
            self.box.show_selection(selection)
            self._use(selection)
