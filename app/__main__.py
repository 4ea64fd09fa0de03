"""``kochab`` and ``python -m app``: the window, or the command that was named."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from app.core.solution import Solution

SYSTEM_LIBRARIES = "libegl1 libgl1 libxkbcommon-x11-0 libxcb-cursor0 libdbus-1-3 libfontconfig1"


def main(argv: Sequence[str] | None = None) -> int:
    """Open the window for nothing or for a file; leave all else to the command line.

    Returns the exit code: 2 when the window cannot open, with one sentence that says what to do.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    if not arguments or _is_file(arguments):
        return _window(arguments)
    from app.cli.main import main as cli_main

    return cli_main(arguments)


def _is_file(arguments: list[str]) -> bool:
    """Whether the one argument is a file to open rather than a command of the same name."""
    if len(arguments) != 1 or arguments[0].startswith("-"):
        return False
    from app.cli.main import COMMANDS

    name = arguments[0]
    return name not in COMMANDS and (Path(name).exists() or bool(Path(name).suffix))


def _window(paths: list[str]) -> int:
    trouble = _no_display()
    if trouble is None:
        try:
            from app.ui.application import run

            _load_screen_plugin()
        except (ImportError, OSError) as error:
            trouble = _missing(error)
    if trouble is not None:
        print(f"kochab: {trouble}", file=sys.stderr)
        return 2
    return run(paths, to_json=_to_json)


def _to_json(file: str, solution: "Solution") -> str:
    from app.cli.output import as_json, to_line

    return to_line(as_json(file, solution))


def _no_display() -> str | None:
    """Qt aborts the process without a display; say it instead."""
    chosen = os.environ.get("QT_QPA_PLATFORM", "")
    if not sys.platform.startswith("linux") or chosen not in ("", "xcb", "wayland"):
        return None
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        return None
    return ("There is no display to open a window on; run it in a desktop session, "
            "or use “kochab solve FILE”.")  # fmt: skip


def _load_screen_plugin() -> None:
    """Load what Qt needs for an X screen; Qt itself ends the process when that is missing."""
    if not sys.platform.startswith("linux") or os.environ.get("WAYLAND_DISPLAY"):
        return
    if os.environ.get("QT_QPA_PLATFORM", "xcb") != "xcb":
        return
    import ctypes

    import PySide6

    plugin = Path(PySide6.__file__).parent / "Qt" / "plugins" / "platforms" / "libqxcb.so"
    if plugin.exists():
        ctypes.CDLL(str(plugin))


def _missing(error: Exception) -> str:
    text = str(error)
    if ".so" in text and sys.platform.startswith("linux"):
        return (
            f"A system library of the window is missing ({text.split(':')[0]}); install it with "
            f"“sudo apt install {SYSTEM_LIBRARIES}”."
        )
    return f"The window cannot start: {text}."


if __name__ == "__main__":
    sys.exit(main())
