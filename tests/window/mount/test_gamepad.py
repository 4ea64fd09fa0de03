"""A game controller at a simulated mount: SDL's own virtual controller is pressed, the telescope's log is the truth."""

import sys
import warnings
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from kochab.core.errors import RefusedError
from kochab.core.mount import Direction
from kochab.gear.session import CameraSelection
from kochab.window.mount import gamepad
from tests.gear.mounts.bench import moved, still
from tests.window.mount_bench import connected

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    try:
        import sdl2
    except ImportError:
        sdl2 = None

needs_sdl = pytest.mark.skipif(sdl2 is None, reason="PySDL2 is not installed: pip install 'kochab-astro[gamepad]'")


@contextmanager
def controller(qtbot, window, commands, driver="ioptron"):
    """A mount connected in the active window, long steps at a chosen rate, and a controller that SDL has opened."""
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    with connected(qtbot, commands, driver) as mount:
        pad = mount.view.pad
        pad.step.setCurrentText("5°")
        pad.rate.setCurrentText("64 × sidereal")
        qtbot.waitUntil(lambda: bool(sdl2.SDL_WasInit(sdl2.SDL_INIT_GAMECONTROLLER)))
        if sdl2.SDL_NumJoysticks():
            pytest.skip("a real controller is plugged in")
        index = sdl2.SDL_JoystickAttachVirtual(sdl2.SDL_JOYSTICK_TYPE_GAMECONTROLLER, 6, 15, 0)
        assert index == 0, sdl2.SDL_GetError()
        number = sdl2.SDL_JoystickGetDeviceInstanceID(index)
        try:
            qtbot.waitUntil(lambda: bool(sdl2.SDL_GameControllerFromInstanceID(number)))
            stick = sdl2.SDL_JoystickFromInstanceID(number)

            def press(button, down=True):
                assert sdl2.SDL_JoystickSetVirtualButton(stick, button, int(down)) == 0

            def tilt(axis, value):
                assert sdl2.SDL_JoystickSetVirtualAxis(stick, axis, value) == 0

            def runs():
                return not still(mount.telescope)

            yield SimpleNamespace(mount=mount, pad=pad, press=press, tilt=tilt, number=number, runs=runs)
        finally:
            if sdl2.SDL_NumJoysticks():
                sdl2.SDL_JoystickDetachVirtual(0)


def ends(qtbot, held):
    """It stands, was told to stop, and stays there for some more looks at the controller."""
    control = held.mount.control
    qtbot.waitUntil(lambda: still(held.mount.telescope) and not control.known.busy)
    orders = len(moved(held.mount.telescope))
    qtbot.wait(10 * gamepad.POLL_MS)
    assert len(moved(held.mount.telescope)) == orders
    assert not any("one move of" in sentence for sentence in held.mount.said), "it was not stopped, but ended"


@needs_sdl
def test_a_direction_held_moves_and_let_go_stops(qtbot, unpainted):
    window, commands = unpainted
    with controller(qtbot, window, commands) as held:
        for button, way in (
            (sdl2.SDL_CONTROLLER_BUTTON_DPAD_UP, Direction.NORTH),
            (sdl2.SDL_CONTROLLER_BUTTON_DPAD_LEFT, Direction.EAST),
        ):
            held.mount.telescope.log.clear()
            held.press(button)
            goes(qtbot, held, way)
            held.press(button, False)
            ends(qtbot, held)
        for axis, way in ((0, Direction.WEST), (1, Direction.SOUTH)):
            held.mount.telescope.log.clear()
            held.tilt(axis, 32767 // 3)  # less than half way
            qtbot.wait(10 * gamepad.POLL_MS)
            assert not moved(held.mount.telescope)
            held.tilt(axis, 32767)
            goes(qtbot, held, way)
            held.tilt(axis, 0)
            ends(qtbot, held)


def goes(qtbot, held, way):
    """It moves this way, as far as the person at the window knows, too."""
    qtbot.waitUntil(held.runs)
    assert held.mount.control.known.busy == ("nudge dec" if way.in_dec else "nudge")
    assert str(way) in str(moved(held.mount.telescope)[0])


@needs_sdl
def test_b_and_back_stop_and_nothing_moves_before_a_direction_is_pressed_anew(qtbot, unpainted):
    window, commands = unpainted
    with controller(qtbot, window, commands) as held:
        for button in (sdl2.SDL_CONTROLLER_BUTTON_B, sdl2.SDL_CONTROLLER_BUTTON_BACK):
            held.press(sdl2.SDL_CONTROLLER_BUTTON_DPAD_DOWN)
            qtbot.waitUntil(held.runs)
            held.press(button)
            ends(qtbot, held)
            held.press(sdl2.SDL_CONTROLLER_BUTTON_DPAD_DOWN, False)
            held.press(button, False)
            qtbot.wait(10 * gamepad.POLL_MS)
        held.press(sdl2.SDL_CONTROLLER_BUTTON_DPAD_DOWN)
        qtbot.waitUntil(held.runs)
        held.mount.control.stop()  # as Esc and STOP do: the thumb is still on it
        ends(qtbot, held)


@needs_sdl
def test_b_stops_a_goto_from_another_window(qtbot, unpainted, monkeypatch):
    window, commands = unpainted
    with controller(qtbot, window, commands) as held:
        monkeypatch.setattr(window, "isActiveWindow", lambda: False)
        monkeypatch.setattr(held.pad, "window", lambda: window)
        held.press(sdl2.SDL_CONTROLLER_BUTTON_DPAD_UP)
        qtbot.wait(10 * gamepad.POLL_MS)
        assert not moved(held.mount.telescope)
        held.pad.buttons[Direction.NORTH].click()
        qtbot.waitUntil(held.runs)
        held.press(sdl2.SDL_CONTROLLER_BUTTON_B)
        ends(qtbot, held)


@needs_sdl
def test_a_window_that_is_no_longer_active_lets_go(qtbot, unpainted, monkeypatch):
    window, commands = unpainted
    with controller(qtbot, window, commands) as held:
        held.press(sdl2.SDL_CONTROLLER_BUTTON_DPAD_UP)
        qtbot.waitUntil(held.runs)
        monkeypatch.setattr(window, "isActiveWindow", lambda: False)
        monkeypatch.setattr(held.pad, "window", lambda: window)
        ends(qtbot, held)


@needs_sdl
def test_a_controller_unplugged_while_it_moves_stops_the_mount(qtbot, unpainted):
    window, commands = unpainted
    with controller(qtbot, window, commands) as held:
        held.press(sdl2.SDL_CONTROLLER_BUTTON_DPAD_UP)
        qtbot.waitUntil(held.runs)
        assert sdl2.SDL_JoystickDetachVirtual(0) == 0
        ends(qtbot, held)
        sdl2.SDL_JoystickAttachVirtual(sdl2.SDL_JOYSTICK_TYPE_GAMECONTROLLER, 6, 15, 0)
        number = sdl2.SDL_JoystickGetDeviceInstanceID(0)
        qtbot.waitUntil(lambda: bool(sdl2.SDL_GameControllerFromInstanceID(number)))


@needs_sdl
def test_a_direction_held_goes_on_step_by_step_without_frames(qtbot, unpainted, monkeypatch):
    window, commands = unpainted
    with controller(qtbot, window, commands) as held:
        frames, orders = [], held.mount.view.orders
        selection = CameraSelection("simulated", "wide")
        monkeypatch.setattr(
            held.mount.control.telescope, "camera", SimpleNamespace(selection=selection, exposure_note="", close=int)
        )
        monkeypatch.setattr(orders, "take_frame", lambda: frames.append(len(frames)))
        held.pad.step.setCurrentText("1′")
        held.press(sdl2.SDL_CONTROLLER_BUTTON_DPAD_UP)
        qtbot.waitUntil(lambda: sum("one move of" in sentence for sentence in held.mount.said) >= 2)
        held.press(sdl2.SDL_CONTROLLER_BUTTON_DPAD_UP, False)
        qtbot.waitUntil(lambda: not orders.held and still(held.mount.telescope) and not held.mount.control.known.busy)
        assert orders.auto_frame
        assert not frames
        held.pad.buttons[Direction.NORTH].click()
        qtbot.waitUntil(lambda: frames == [0])


@needs_sdl
def test_another_direction_ends_the_one_before(qtbot, unpainted):
    window, commands = unpainted
    with controller(qtbot, window, commands) as held:
        held.tilt(0, -32768)
        qtbot.waitUntil(held.runs)
        held.tilt(0, 0)
        held.tilt(1, -32768)
        qtbot.waitUntil(lambda: held.mount.control.known.busy == "nudge dec")
        assert not any("one move of" in sentence for sentence in held.mount.said)
        held.tilt(1, 0)
        ends(qtbot, held)


@needs_sdl
def test_a_refusal_is_told_once(qtbot, unpainted, monkeypatch):
    window, commands = unpainted
    with controller(qtbot, window, commands) as held:
        asked = []

        def refuse(*order):
            asked.append(order)
            raise RefusedError("Too low.")

        monkeypatch.setattr(held.mount.opening.guard, "move", refuse)
        held.press(sdl2.SDL_CONTROLLER_BUTTON_DPAD_UP)
        qtbot.waitUntil(lambda: "Too low." in held.mount.said)
        qtbot.wait(20 * gamepad.POLL_MS)
        assert len(asked) == 1


@needs_sdl
def test_the_shoulder_buttons_change_the_rate(qtbot, unpainted):
    window, commands = unpainted
    with controller(qtbot, window, commands) as held:
        rate = held.pad.rate
        before = rate.currentIndex()
        for button, after in (("RIGHT", before + 1), ("LEFT", before), ("LEFT", before - 1)):
            held.press(getattr(sdl2, f"SDL_CONTROLLER_BUTTON_{button}SHOULDER"))
            qtbot.waitUntil(lambda after=after: rate.currentIndex() == after)
            held.press(getattr(sdl2, f"SDL_CONTROLLER_BUTTON_{button}SHOULDER"), False)
            qtbot.wait(10 * gamepad.POLL_MS)
            assert rate.currentIndex() == after, "one press is one step"
        assert rate.currentData() < rate.itemData(before) < rate.itemData(before + 1)


def caught_signals():
    """The signals that the process handles, by Linux's own mask; elsewhere nothing tells them."""
    status = Path("/proc/self/status")
    return [line for line in status.read_text().splitlines() if "SigCgt" in line] if status.exists() else []


@needs_sdl
def test_sdl_runs_only_with_a_mount_and_leaves_the_signals_alone(qtbot, unpainted):
    window, commands = unpainted
    while sdl2.SDL_WasInit(sdl2.SDL_INIT_GAMECONTROLLER):  # of a window that was closed with its mount connected
        sdl2.SDL_QuitSubSystem(sdl2.SDL_INIT_GAMECONTROLLER)
    before = caught_signals()
    with controller(qtbot, window, commands) as held:
        assert sdl2.SDL_WasInit(sdl2.SDL_INIT_GAMECONTROLLER)
        assert caught_signals() == before, "the system's signals end the program as before"
        held.mount.control.disconnect_mount()
        qtbot.waitUntil(lambda: held.mount.control.known.phase == "off")
        assert not sdl2.SDL_WasInit(sdl2.SDL_INIT_GAMECONTROLLER)


def test_without_sdl_the_view_says_how_to_get_it(qtbot, unpainted, monkeypatch):
    _, commands = unpainted
    monkeypatch.setitem(sys.modules, "sdl2", None)  # an import raises ImportError
    with connected(qtbot, commands) as mount:
        qtbot.waitUntil(lambda: "pip install 'kochab-astro[gamepad]'" in mount.view.pad.hint.text())
        assert mount.control.known.phase == "on"
