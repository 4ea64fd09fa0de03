"""Registries: plain dicts of name -> "module:Class", imported when used."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from app.core.errors import UsageError


def known(registry: Mapping[str, str], name: str, kind: str) -> None:
    """Raise :class:`UsageError`, which lists the names there are, when ``name`` is none of them."""
    if name not in registry:
        raise UsageError(f"There is no {kind} '{name}'; choose one of {', '.join(registry)}.")


def pick(
    registry: Mapping[str, str], name: str, kind: str, options: Mapping[str, Any] | None = None
) -> Any:
    """An instance, made with ``options``, of what ``registry`` holds under ``name``.

    Raises
    ------
    UsageError
        No such name; the sentence lists the names there are.

    """
    known(registry, name, kind)
    module, _, attribute = registry[name].partition(":")
    return getattr(import_module(module), attribute)(**(options or {}))
