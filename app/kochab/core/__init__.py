"""The words every room speaks: frozen values over numpy, no input or output."""

from pathlib import Path

__version__ = "0.2.0"


def data_folder(name: str) -> Path:
    """Folder ``catalogs`` or ``resources``: in the installed package, or at the top of the checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / name
    return installed if installed.is_dir() else package.parents[1] / name
