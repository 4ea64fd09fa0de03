"""The star catalogue, names, and where a star is tonight.

What needs the catalogue imports it when first used: a mount that asks for apparent places
(:mod:`kochab.sky.apparent`) does without.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kochab.sky.catalogue import Catalogue, open_catalogue, shipped_folder

__all__ = ["Catalogue", "open_catalogue", "shipped_folder"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from kochab.sky import catalogue

    return getattr(catalogue, name)
