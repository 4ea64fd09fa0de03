"""Registries: plain dicts of name -> "module:Class", imported when used."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from app.core.errors import UsageError


def pick(registry: Mapping[str, str], name: str, kind: str) -> Any:
    """An instance of what ``registry`` holds under ``name``.

    Raises
    ------
    UsageError
        No such name; the sentence lists the names there are.

    """
    if name not in registry:
        raise UsageError(f"There is no {kind} '{name}'; choose one of {', '.join(registry)}.")
    module, _, attribute = registry[name].partition(":")
    return getattr(import_module(module), attribute)()
