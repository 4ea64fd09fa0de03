"""The sample frames that come with Kochab."""

import json
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

SUFFIXES = {".fits", ".fit", ".fts", ".fz", ".xisf", ".tif", ".tiff", ".png", ".jpg", ".jpeg"}


@dataclass(frozen=True, slots=True)
class Sample:
    """A frame to try, with what to call it."""

    path: Path
    title: str
    text: str


def samples(folder: Path | None = None) -> list[Sample]:
    """The frames in ``resources/samples``; empty when there are none.

    ``samples.json`` there gives ``{file: {"title": ..., "text": ...}}`` in the order to show them;
    a file it does not name comes last.
    """
    folder = folder or Path(str(files("resources"))) / "samples"
    if not folder.is_dir():
        return []
    told = _told(folder / "samples.json")
    found = []
    place = {name: i for i, name in enumerate(told)}
    for path in sorted(folder.iterdir(), key=lambda p: (place.get(p.name, len(place)), p.name)):
        if path.suffix.lower() in SUFFIXES:
            about = told.get(path.name, {})
            title = about.get("title") or path.stem.replace("_", " ").replace("-", " ").capitalize()
            found.append(Sample(path, title, about.get("text", "")))
    return found


def _told(path: Path) -> dict[str, dict[str, str]]:
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return told if isinstance(told, dict) else {}
