"""What every view of the window is given; made once, in :func:`kochab.window.application.build`."""

from collections.abc import Callable

from PySide6.QtWidgets import QPushButton

from kochab.core.values import frozen
from kochab.window.devices.cameras import Cameras
from kochab.window.devices.equipment import Equipment
from kochab.window.devices.mount_control import MountControl
from kochab.window.frame.looks import FrameLooks
from kochab.window.frame.session import Session
from kochab.window.frame.workspace import Workspace
from kochab.window.job import Jobs
from kochab.window.settings import WindowSettings
from kochab.window.undo import Undo
from kochab.workflows.session.wiring import Wiring


@frozen
class Services:
    """What a view may use of the window.

    ``session`` holds the open frame, ``panes`` show it and ``looks`` are how. ``mount`` is the one owner of the mount's
    line and ``stop`` its STOP in the bar, ``cameras`` the owner of every camera, ``equipment`` the profile in use.
    ``jobs`` run what takes time, ``say`` shows a sentence in the status bar for a while, ``undo`` has what may be taken
    back. ``wiring`` is what comes from rooms that the window may not import.
    """

    settings: WindowSettings
    session: Session
    panes: Workspace
    looks: FrameLooks
    mount: MountControl
    stop: QPushButton
    cameras: Cameras
    equipment: Equipment
    jobs: Jobs
    say: Callable[[str], None]
    undo: Undo
    wiring: Wiring
