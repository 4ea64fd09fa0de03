"""Whether a window can open: checked without Qt, which ends the process when it cannot."""

import ctypes
import os
import sys
from importlib.util import find_spec
from pathlib import Path

SYSTEM_LIBRARIES = "libegl1 libgl1 libxkbcommon-x11-0 libxcb-cursor0 libdbus-1-3 libfontconfig1"
INSTEAD = "Run Kochab in a desktop session, or use “kochab solve FILE”."


def trouble() -> str | None:
    """Why no window can open, with what to do; None when one can."""
    if not sys.platform.startswith("linux"):
        return None
    if not _has_display():
        return f"No display found. {INSTEAD}"
    # Only the X11 plugin needs the libraries that are tried below.
    if os.environ.get("WAYLAND_DISPLAY") or (os.environ.get("QT_QPA_PLATFORM") or "xcb") != "xcb":
        return None
    try:
        _load_screen_plugin()
    except OSError as error:
        return missing(error)
    if not _answers():
        return f"Display {os.environ.get('DISPLAY')} does not answer. {INSTEAD}"
    return None


def missing(error: Exception) -> str:
    """The sentence for a library that could not be loaded."""
    text = str(error)
    if ".so" in text and sys.platform.startswith("linux"):
        return (
            f"The window needs a system library that is missing ({text.split(':')[0]}). "
            f"Install it with “sudo apt install {SYSTEM_LIBRARIES}”."
        )
    return f"The window cannot start: {text}."


def _has_display() -> bool:
    if os.environ.get("QT_QPA_PLATFORM", "") not in ("", "xcb", "wayland"):
        return True  # offscreen and the like need none
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _load_screen_plugin() -> None:
    """Load what Qt needs for an X screen; OSError names a library that is missing."""
    found = find_spec("PySide6")
    for folder in (found.submodule_search_locations or ()) if found is not None else ():
        plugin = Path(folder) / "Qt" / "plugins" / "platforms" / "libqxcb.so"
        if plugin.exists():
            ctypes.CDLL(str(plugin))


def _answers() -> bool:
    """Whether the X server behind DISPLAY lets us in."""
    try:
        xcb = ctypes.CDLL("libxcb.so.1")
    except OSError:
        return True  # the plugin has loaded, so Qt brings its own
    xcb.xcb_connect.restype = ctypes.c_void_p
    # xcb_connect never returns null: the connection itself knows whether it failed.
    connection = ctypes.c_void_p(xcb.xcb_connect(None, None))
    failed = xcb.xcb_connection_has_error(connection)
    xcb.xcb_disconnect(connection)
    return not failed
