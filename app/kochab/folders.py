"""Where data, caches and settings lie."""

import os
import re
from functools import cache
from pathlib import Path


def data_folder(name: str) -> Path:
    """Folder ``catalogs`` or ``resources``: in the installed package, or at the top of the checkout."""
    package = Path(__file__).resolve().parent
    installed = package / name
    return installed if installed.is_dir() else package.parents[1] / name


def cache_folder() -> Path:
    """Where all that is made once lies: ``KOCHAB_CACHE`` or the user's cache."""
    base = os.environ.get("KOCHAB_CACHE")
    return Path(base) if base else _user_cache()


@cache  # every blind frame asks for it
def _user_cache() -> Path:
    # Imported here: this module loads at every start, and most commands need no folder.
    from platformdirs import user_cache_path

    return user_cache_path("kochab", appauthor=False)


def state_folder() -> Path:
    """Where what is known of the last sessions lies: beside a configuration of its own, or the user's own state."""
    from platformdirs import user_state_path

    base = os.environ.get("KOCHAB_CONFIG")
    return Path(base, "state") if base else user_state_path("kochab", appauthor=False)


def file_stem(name: str, otherwise: str) -> tuple[str, str]:
    """What a file is called that belongs to a name of a person's choice: readable, and a mark that differs.

    Parameters
    ----------
    name : str
        Any text.
    otherwise : str
        The readable part where the name has no letter of ASCII.
    """
    import hashlib

    plain = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower()[:40] or otherwise
    return plain, hashlib.sha256(name.encode("utf-8")).hexdigest()[:8]


def config_folder() -> Path:
    """Where what the user has set up lies: ``KOCHAB_CONFIG`` or the user's own configuration."""
    from platformdirs import user_config_path

    base = os.environ.get("KOCHAB_CONFIG")
    return Path(base) if base else user_config_path("kochab", appauthor=False)
