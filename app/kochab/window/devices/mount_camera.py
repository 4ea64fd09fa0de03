"""The camera that looks through the mount's telescope."""

from kochab.core.errors import RefusedError
from kochab.core.solution import SolveNow
from kochab.gear.mount_events import FrameTaken
from kochab.gear.mounts.guard import Guard
from kochab.gear.session import CameraSelection
from kochab.text.translation import tr
from kochab.window.devices.cameras import Cameras
from kochab.window.devices.mount_connection import MountConnection
from kochab.window.frame.session import Session
from kochab.workflows.session.mount_camera import MountCamera, close_camera, frame_solver


class TelescopeCamera:
    """Which camera takes the frames that the mount's orders solve; they are taken in the thread of its line."""

    def __init__(self, connection: MountConnection, session: Session, cameras: Cameras) -> None:
        self.camera: MountCamera | None = None
        self._connection, self._session, self._cameras = connection, session, cameras
        self._shown = 0  # frames that the session was given

    def use(self, selection: CameraSelection | None) -> bool:
        """Use this camera from now on; another exposure of the same holds for the other views that use it, too.

        False where it is the one in use.
        """
        before, new = self.camera, None
        if before is not None and selection == before.selection:
            return False
        if selection is not None:
            same = before is not None and before.selection.camera == selection.camera
            new = MountCamera(selection, self._cameras.open, insists=same)
        self.camera = new
        if before is not None:
            # In the line's thread, which opened it and may be taking a frame just now.
            self._connection.aside("camera", lambda _: close_camera(before))
        return True

    def close(self) -> None:
        """Close the camera until the next frame; in the thread of the line."""
        if self.camera is not None:
            self.camera.close()

    def solver(self, guard: Guard) -> SolveNow:
        """Takes and solves a frame in the line's thread, and shows it in the window's."""
        # Those of the moment of the order, whatever is connected or chosen when it is carried out.
        line, camera = self._connection.line, self.camera
        if camera is None:
            raise RefusedError("No camera is chosen.")
        return frame_solver(camera, guard, lambda event: self._connection.post(event, line))

    def show(self, event: FrameTaken) -> None:
        """Open a frame that was taken; while frames stream, the Live view shows it."""
        if not self._session.streams:
            self._shown += 1
            self._session.show(event.frame, tr("Camera frame {number}", number=self._shown))
