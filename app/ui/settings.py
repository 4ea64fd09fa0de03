"""What the window remembers between starts."""

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

from PySide6.QtCore import QByteArray, QSettings

from app.core.errors import UsageError
from app.core.hint import Site
from app.ui.angle_input import parse_site, site_text
from app.ui.formats import AngleStyle
from app.ui.overlay import Switches

MOST_RECENT = 10
LARGEST = 2**31 - 1  # what Qt counts with; neither infinity nor NaN is below it


class Settings:
    """Typed access to one :class:`QSettings`; damaged values read as their defaults."""

    def __init__(self, store: QSettings | None = None) -> None:
        self._store = store or QSettings(
            QSettings.Format.IniFormat, QSettings.Scope.UserScope, "kochab", "window"
        )

    def flag(self, name: str, default: bool) -> bool:
        """A yes or no."""
        value = self._store.value(name, default)
        return value if isinstance(value, bool) else str(value).lower() in ("true", "1", "yes")

    def text(self, name: str, default: str) -> str:
        """A word."""
        value = self._store.value(name, default)
        return value if isinstance(value, str) else default

    def table(self, name: str) -> dict[str, Any]:
        """Named values, kept as JSON; without those that no field of a window could show."""
        try:
            kept = json.loads(self.text(name, "{}"))
        except (ValueError, RecursionError):
            return {}
        return {k: v for k, v in kept.items() if _showable(v)} if isinstance(kept, dict) else {}

    def data(self, name: str) -> QByteArray | None:
        """Bytes, such as a window's geometry."""
        value = self._store.value(name)
        return value if isinstance(value, QByteArray) else None

    def keep(self, name: str, value: Any) -> None:
        """Remember a value."""
        self._store.setValue(name, value)

    def write(self) -> None:
        """Put everything on disk now."""
        self._store.sync()

    @property
    def angle_style(self) -> AngleStyle:
        """How angles are written."""
        value = self.text("angles", AngleStyle.SEXAGESIMAL.value)
        return AngleStyle(value) if value in list(AngleStyle) else AngleStyle.SEXAGESIMAL

    @property
    def site(self) -> Site | None:
        """Where the person observes; None when they never said."""
        try:
            return parse_site(self.text("site", ""))
        except UsageError:
            return None

    def keep_site(self, site: Site | None) -> None:
        """Remember where the person observes."""
        self.keep("site", site_text(site) if site is not None else "")

    def switches(self) -> Switches:
        """Which marks are painted."""
        return Switches(**{f.name: self.flag(f"marks/{f.name}", True) for f in fields(Switches)})

    def keep_switches(self, switches: Switches) -> None:
        """Remember which marks are painted."""
        for f in fields(Switches):
            self.keep(f"marks/{f.name}", getattr(switches, f.name))

    @property
    def recent(self) -> list[Path]:
        """Files opened of late, newest first."""
        value = self._store.value("recent", [])
        names = value if isinstance(value, list) else [value]
        return [Path(n) for n in names if isinstance(n, str) and n][:MOST_RECENT]

    def add_recent(self, path: Path) -> None:
        """Put a file first among the recent ones."""
        path = path.absolute()
        names = [str(path)] + [str(p) for p in self.recent if p != path]
        self.keep("recent", names[:MOST_RECENT])

    def clear_recent(self) -> None:
        """Forget the recent files."""
        self.keep("recent", [])


def _showable(value: Any) -> bool:
    return not isinstance(value, int | float) or abs(value) <= LARGEST
