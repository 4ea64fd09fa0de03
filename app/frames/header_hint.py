"""Hints from FITS keywords; the long list of names that capture programs use."""

from collections.abc import Mapping
from typing import Any

from app.core.hint import Hint


def hint_from_keywords(
    values: Mapping[str, Any], comments: Mapping[str, str], shape: tuple[int, ...]
) -> tuple[Hint, tuple[str, ...]]:
    """What a header believes, and sentences about what was not believable."""
    return Hint(), ()
