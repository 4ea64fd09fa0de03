"""What the window remembers between starts."""

import sys
from pathlib import Path
from typing import Any

from PySide6.QtCore import QByteArray, QSettings

from kochab.core.frame import Site
from kochab.folders import config_folder, data_folder
from kochab.parsing.text_input import TextError, parse_json
from kochab.text.angle_text import AngleStyle

MOST_RECENT = 10
LARGEST = 2**31 - 1  # what Qt counts with; neither infinity nor NaN is below it


def languages(folder: Path | None = None) -> list[str]:
    """What the window can speak beside English, as "de"; ``folder`` has the translations that came with Kochab."""
    there = (folder or data_folder("resources") / "translations").glob("kochab_*.qm")
    return sorted(path.stem.removeprefix("kochab_") for path in there)


def own_store() -> QSettings:
    """Where the window's settings lie: on Windows beside all else that a person keeps, not in Qt's roaming folder."""
    if sys.platform == "win32":
        return QSettings(str(config_folder() / "window.ini"), QSettings.Format.IniFormat)
    return QSettings(QSettings.Format.IniFormat, QSettings.Scope.UserScope, "kochab", "window")


class WindowSettings:
    """Typed access to one :class:`QSettings`; damaged values read as their defaults."""

    def __init__(self, store: QSettings | None = None) -> None:
        self._store = store or own_store()

    def _value(self, name: str, default: Any = None) -> Any:
        try:
            return self._store.value(name, default)
        except RuntimeError:  # of a type of Qt's that Python does not know
            return default

    def flag(self, name: str, default: bool) -> bool:
        value = self._value(name, default)
        # A bool read back from the INI file is text.
        return value if isinstance(value, bool) else str(value).lower() in ("true", "1", "yes")

    def text(self, name: str, default: str) -> str:
        value = self._value(name, default)
        return value if isinstance(value, str) else default

    def table(self, name: str) -> dict[str, Any]:
        """Named values, kept as JSON; without those that no field of a window could show."""
        try:
            kept = parse_json(self.text(name, "{}"))
        except TextError:
            return {}
        return {k: v for k, v in kept.items() if _showable(v)} if isinstance(kept, dict) else {}

    def data(self, name: str) -> QByteArray | None:
        """Bytes, such as a window's geometry."""
        value = self._value(name)
        return value if isinstance(value, QByteArray) else None

    def keep(self, name: str, value: Any) -> None:
        self._store.setValue(name, value)

    def as_dict(self) -> dict[str, str]:
        """Every setting as text, for a report; without bytes such as a window's geometry."""
        values = {name: self._value(name) for name in self._store.allKeys()}
        return {name: str(value) for name, value in values.items() if not isinstance(value, QByteArray)}

    def write(self) -> None:
        self._store.sync()

    @property
    def angle_style(self) -> AngleStyle:
        value = self.text("angles", AngleStyle.SEXAGESIMAL.value)
        return AngleStyle(value) if value in list(AngleStyle) else AngleStyle.SEXAGESIMAL

    @property
    def site(self) -> Site | None:
        """Where the person observes; None when they never said."""
        from kochab.gear.profiles import current_profile

        return current_profile(self).site

    def keep_site(self, site: Site | None) -> None:
        from kochab.gear.profiles import keep_profile

        keep_profile(self, site=site)

    @property
    def image_folder(self) -> Path:
        """Where images are looked for: the folder that was chosen for good, else the one used last."""
        return Path(self.text("start_folder", "") or self.text("folder", "") or Path.home())

    @property
    def recent(self) -> list[Path]:
        """Files opened of late, newest first."""
        value = self._value("recent", [])
        # QSettings reads a list of one back as its only item.
        names = value if isinstance(value, list) else [value]
        return [Path(n) for n in names if isinstance(n, str) and n][:MOST_RECENT]

    def add_recent(self, path: Path) -> None:
        path = path.absolute()
        names = [str(path)] + [str(p) for p in self.recent if p != path]
        self.keep("recent", names[:MOST_RECENT])


def _showable(value: Any) -> bool:
    return not isinstance(value, int | float) or abs(value) <= LARGEST
