"""Hints from EXIF."""

from typing import Any

from PIL import Image

from app.core.hint import Hint


def hint_from_exif(
    exif: Image.Exif, size: tuple[int, int]
) -> tuple[Hint, dict[str, Any], tuple[str, ...]]:
    """What a camera wrote beside its picture."""
    return Hint(), {}, ()
