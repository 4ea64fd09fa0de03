"""What can be chosen about each identifier, for the command line and the window.

::

    for option in method_options("triads"):
        print(option.name, option.value_text, option.range_text, option.text)
    make_identifier("triads", **checked_options("triads", {"separation_deg": "0.08"}))
"""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from app.core.errors import UsageError
from app.core.options import Option, checked, options_of

__all__ = ["Option", "checked_options", "method_class", "method_options", "paper_of"]


def method_class(name: str) -> type:
    """The class registered as ``name``; UsageError when there is none."""
    from app.identify import IDENTIFIERS

    if name not in IDENTIFIERS:
        raise UsageError(f"There is no method '{name}'; choose one of {', '.join(IDENTIFIERS)}.")
    module, _, kind = IDENTIFIERS[name].partition(":")
    found: type = getattr(import_module(module), kind)
    return found


def method_options(name: str) -> tuple[Option, ...]:
    """The options of the method ``name``; () when it has none, as the default has."""
    return options_of(method_class(name))


def checked_options(name: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """``values`` of options of the method ``name``, texts read as if typed; UsageError if wrong."""
    return checked(method_class(name), values)


def paper_of(name: str) -> str:
    """Author or title, year and chapter of the method's source; "" for our own."""
    return str(getattr(method_class(name), "paper", ""))
