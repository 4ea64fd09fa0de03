"""A game controller, read by SDL: a direction held is the pad's button pressed again and again, let go is Stop."""

import warnings
from typing import Any

from PySide6.QtCore import QObject, QTimer

from kochab.core.mount import Direction
from kochab.core.progress import Task
from kochab.gear.mount_events import OrderDone, OrderFailed
from kochab.text.translation import tr, tr_noop
from kochab.window.devices.mount_control import MountControl
from kochab.window.job import Job
from kochab.window.mount.actions import MountActions
from kochab.window.mount.controls import HINT, NudgePad

PACKAGE = tr_noop("Game controllers need one more package: pip install 'kochab-astro[gamepad]'.")
HELD = tr_noop("Gamepad: hold to move, B stops.")
POLL_MS, LOOK_MS = 33, 1000  # with a controller, and to see whether there is one
HALF_WAY = 16384  # of 32767: a worn stick does not come back to zero
NUDGES = ("nudge", "nudge dec")
BUTTONS = ("B", "BACK", "LEFTSHOULDER", "RIGHTSHOULDER", "DPAD_UP", "DPAD_DOWN", "DPAD_LEFT", "DPAD_RIGHT")
HINTS = {
    b"SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": b"1",  # STOP works in every window
    b"SDL_NO_SIGNAL_HANDLERS": b"1",
    b"SDL_JOYSTICK_THREAD": b"1",  # Windows: SDL has no window of its own that hears of controllers
}


def _imported() -> Task[Any]:
    """PySDL2, or None if it is not installed; finding SDL runs system programs, for half a second or more."""
    yield from ()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it warns of where its library is
            import sdl2
    except ImportError:
        return None
    return sdl2


def _begun(sdl: Any) -> bool:
    """Whether SDL could start looking for controllers."""
    for name, value in HINTS.items():
        sdl.SDL_SetHint(name, value)
    return bool(sdl.SDL_InitSubSystem(sdl.SDL_INIT_GAMECONTROLLER) == 0)


class Gamepad(QObject):
    """Reads the first controller while a mount is connected; moves only while the window is active, stops always."""

    def __init__(self, pad: NudgePad, control: MountControl, orders: MountActions) -> None:
        super().__init__(pad)
        self._pad, self._control, self._orders = pad, control, orders
        self._sdl: Any = None
        self._importing: Job | None = None
        self._controller: Any = None
        self._way: Direction | None = None  # held now
        self._down: set[str] = set()
        self._timer = QTimer(self, interval=LOOK_MS)
        self._timer.timeout.connect(self._poll)
        pad.hint.setText(f"{tr(HINT)} {tr(HELD)}")
        control.stopping.connect(self._forbid)
        control.ended.connect(self._ended)
        control.changed.connect(self._follow)

    def _follow(self) -> None:
        """Poll only while a mount is connected."""
        polls = self._timer.isActive()
        if self._is_on() and self._importing is None:
            self._importing = job = Job(_imported(), "gamepad")
            job.succeeded.connect(self._begin)
            job.start()
        elif self._is_on() and not polls and self._importing and not self._importing.waits:
            self._begin(self._sdl)
        elif polls and not self._is_on():
            self._timer.stop()
            self._close()
            self._sdl.SDL_QuitSubSystem(self._sdl.SDL_INIT_GAMECONTROLLER)

    def _is_on(self) -> bool:
        return self._control.known.phase not in ("off", "leaving")

    def _begin(self, sdl: Any) -> None:
        """Poll with PySDL2 if the mount is still connected, or say how to get it."""
        self._sdl = sdl
        if not self._is_on():
            return
        if sdl is not None and _begun(sdl):
            self._timer.start(LOOK_MS)
        else:
            self._control.changed.disconnect(self._follow)
            self._pad.hint.setText(f"{tr(HINT)} {tr(PACKAGE)}")

    def _poll(self) -> None:
        sdl = self._sdl
        sdl.SDL_GameControllerUpdate()
        sdl.SDL_FlushEvents(sdl.SDL_FIRSTEVENT, sdl.SDL_LASTEVENT)  # nobody reads them
        if self._controller and not sdl.SDL_GameControllerGetAttached(self._controller):
            self._close()
        if not self._controller:
            there = (i for i in range(sdl.SDL_NumJoysticks()) if sdl.SDL_IsGameController(i))
            self._controller = next((c for c in map(sdl.SDL_GameControllerOpen, there) if c), None)
            self._timer.setInterval(POLL_MS if self._controller else LOOK_MS)
        if self._controller:
            self._read()

    def _close(self) -> None:
        self._hold(None)
        self._down = set()
        if self._controller:
            self._sdl.SDL_GameControllerClose(self._controller)
        self._controller = None

    def _read(self) -> None:
        sdl, before = self._sdl, self._down
        ask, at = sdl.SDL_GameControllerGetButton, sdl.SDL_GameControllerGetAxis
        self._down = {n for n in BUTTONS if ask(self._controller, getattr(sdl, f"SDL_CONTROLLER_BUTTON_{n}"))}
        pressed, stops = self._down - before, self._down & {"B", "BACK"}
        if pressed & stops:
            self._control.stop()
        x, y = (at(self._controller, axis) for axis in (sdl.SDL_CONTROLLER_AXIS_LEFTX, sdl.SDL_CONTROLLER_AXIS_LEFTY))
        # The D-pad counts as a stick at its end.
        x += 32767 * (("DPAD_RIGHT" in self._down) - ("DPAD_LEFT" in self._down))
        y += 32767 * (("DPAD_DOWN" in self._down) - ("DPAD_UP" in self._down))
        # Left is east, as on the window's own pad.
        way = (Direction.EAST if x < 0 else Direction.WEST) if abs(x) > abs(y) else None
        way = way or (Direction.NORTH if y < 0 else Direction.SOUTH)
        active = self._pad.window().isActiveWindow()
        self._hold(way if active and not stops and max(abs(x), abs(y)) > HALF_WAY else None)
        faster = ("RIGHTSHOULDER" in pressed) - ("LEFTSHOULDER" in pressed)
        if active and faster:
            rate = self._pad.rate
            rate.setCurrentIndex(min(max(rate.currentIndex() + faster, 0), rate.count() - 1))

    def _hold(self, way: Direction | None) -> None:
        """Nudge this way until another is held, or none."""
        if way is not self._way:
            # Only a nudge of the controller ends with its direction; others were asked for in the window.
            if self._orders.held and self._control.known.busy in NUDGES:
                self._control.stop()
            self._way, self._orders.held = way, False
            if way is not None:
                allowed = self._pad.buttons[way].explanation.allows()  # else it says why
                # A nudge of the direction before is a reason against this one only until it has ended.
                self._orders.held = allowed or self._control.known.busy in NUDGES
        if way is not None and self._orders.held and not self._pad.buttons[way].explanation.reason:
            self._pad.buttons[way].click()

    def _forbid(self) -> None:
        """After a Stop or a refusal nothing moves before a direction is pressed anew."""
        self._orders.held = False

    def _ended(self, word: OrderDone | OrderFailed) -> None:
        if isinstance(word, OrderFailed) and not word.stopped:
            self._forbid()
