"""Star catalogues that the user already has, read in place: found, chosen and remembered.

A folder of ASTAP's databases, of astrometry.net's index files, or a Gaia table. One of them is in use beside the
shipped stars, and makes narrow fields solvable whose place and scale are known.
"""

import json
import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from kochab.core.errors import CatalogueError
from kochab.core.progress import Progress, Task
from kochab.core.values import frozen
from kochab.folders import config_folder
from kochab.parsing.text_input import TextError, read_json
from kochab.sky.user_catalogues.star_cone import Cone, Reach, StarCone, UserCatalogue
from kochab.text.translation import tr

__all__ = [
    "CatalogueError",
    "Cone",
    "Reach",
    "StarCone",
    "UserCatalogue",
    "Where",
    "choose",
    "chosen",
    "forget",
    "found",
    "open_user_catalogue",
    "opened",
]

SETTINGS = "catalogue.json"
WHOLE_SKY = 0.995


@frozen
class Where:
    """One catalogue: its kind, its name within ``path`` as ``D50`` or ``4100``, and the folder or file."""

    kind: str
    name: str
    path: Path

    @property
    def title(self) -> str:
        """What people call it: ``ASTAP D50``."""
        return f"{self.kind} {self.name}"


def usual_folders() -> list[Path]:
    """Where ASTAP and astrometry.net keep their stars on this system, and Kochab's own data folder."""
    from platformdirs import user_data_path

    home = Path.home()
    own = user_data_path("kochab", appauthor=False) / "catalogs"
    if sys.platform == "win32":
        roots = [os.environ.get(name) for name in ("PROGRAMFILES", "PROGRAMFILES(X86)", "PROGRAMDATA", "LOCALAPPDATA")]
        there = [Path(root) / "astap" for root in roots if root]
        local = os.environ.get("LOCALAPPDATA")
        there += [Path(local, *parts) for parts in (("cygwin_ansvr", "usr", "share", "astrometry", "data"),) if local]
    elif sys.platform == "darwin":
        there = [Path(p) for p in ("/Applications/ASTAP.app/Contents/MacOS", "/usr/local/opt/astap", "/opt/astap")]
        there += [home / "Library/Application Support/Astrometry", Path("/usr/local/share/astrometry")]
        there += [Path("/opt/homebrew/share/astrometry")]
    else:
        shares = [Path("/usr/share"), Path("/usr/local/share"), home / ".local/share"]
        there = [Path("/opt/astap"), *(s / name for s in shares for name in ("astap", "astap/data", "astrometry"))]
        there += [Path("/usr/local/astrometry/data"), home / ".local/share/kstars/astrometry"]
    return [*there, own]


def inside(folder: Path) -> Iterator[Where]:
    """The catalogues of one folder."""
    from kochab.sky.user_catalogues.astap_database import databases
    from kochab.sky.user_catalogues.index_files import index_files

    with suppress(CatalogueError):
        yield from (Where("ASTAP", name, folder) for name in databases(folder))
    series = {file.series for file in index_files(folder)}
    yield from (Where("astrometry.net", name, folder) for name in sorted(series))


def found() -> list[Where]:
    """The catalogues in the usual folders, those of ASTAP first."""
    every = [w for folder in usual_folders() if folder.is_dir() for w in inside(folder)]
    return sorted(every, key=lambda w: (w.kind, w.name))


def open_user_catalogue(where: Where) -> UserCatalogue:
    """The catalogue, opened; `CatalogueError`, one sentence, when it is missing or damaged."""
    if where.kind == "ASTAP":
        from kochab.sky.user_catalogues.astap_database import AstapDatabase

        return AstapDatabase(where.path, where.name)
    if where.kind == "astrometry.net":
        from kochab.sky.user_catalogues.index_files import IndexFiles

        return IndexFiles(where.path, where.name)
    from kochab.sky.user_catalogues.gaia_table import GaiaTable

    return GaiaTable(where.path)


def located(text: str) -> Where:
    """What a person means by a path, or by a name as ``D50`` in the usual folders.

    A folder that holds several means the one with the most stars. Raises `CatalogueError` when there is none.
    """
    path = Path(text).expanduser()
    if path.is_dir():
        there = list(inside(path.resolve()))
        if not there:
            raise CatalogueError("{path} has no ASTAP database and no astrometry.net index files.", path=path)
        return max(there, key=lambda w: open_user_catalogue(w).reach().density_deg2)
    if path.is_file():
        from kochab.sky.user_catalogues.gaia_table import is_table
        from kochab.sky.user_catalogues.index_files import index_file

        path = path.resolve()
        if is_table(path):
            return Where("Gaia", path.name, path)
        index, name = index_file(path), path.name.lower()
        near = [w for w in inside(path.parent) if w.name == (index.series if index else name.split("_")[0].upper())]
        if not near:
            raise CatalogueError(
                "{path} is no star catalogue: use an ASTAP folder, astrometry.net index files, or a Gaia table.",
                path=path,
            )
        return near[0]
    every = found()
    wanted = text.lower().split()[-1] if text.strip() else ""
    named = [w for w in every if w.name.lower() == wanted]
    if not named:
        names = ", ".join(w.name for w in every)
        if names:
            raise CatalogueError("No catalogue {name} was found; there are {names}.", name=text, names=names)
        raise CatalogueError("No catalogue named {name} was found. Give its folder.", name=text)
    return named[0]


def choose(text: str) -> Task[UserCatalogue]:
    """Use the catalogue at a path or of a name from now on; it is tried first, and a Gaia table sorted."""
    return (yield from choose_at(located(text)))


def choose_at(where: Where) -> Task[UserCatalogue]:
    """The same for a catalogue that was found; it yields once at least."""
    yield Progress("catalog")
    if where.kind == "Gaia":
        from kochab.sky.user_catalogues.gaia_table import sort_table

        catalogue: UserCatalogue = yield from sort_table(where.path)
    else:
        catalogue = open_user_catalogue(where)
    catalogue.reach()  # a damaged one is told now
    _remember({"kind": where.kind, "name": where.name, "path": str(where.path)})
    return catalogue


def facts_of(catalogue: UserCatalogue) -> dict[str, Any]:
    """What is told of a catalogue: its kind, name, place, depth and the narrowest field that it serves."""
    reach = catalogue.reach()
    return {
        "kind": catalogue.kind,
        "name": catalogue.name,
        "path": str(catalogue.path),
        "faintest_mag": round(reach.faintest_mag, 1),
        "stars_per_deg2": round(reach.density_deg2, 1),
        "narrowest_field_deg": round(reach.narrowest_deg, 3),
        "sky_share": round(reach.sky_share, 4),
    }


def listed() -> list[dict[str, Any]]:
    """Of every catalogue found and of the one in use its facts and ``in_use``; ``problem`` where it is damaged."""
    mine, rows = chosen(), []
    for where in [*found(), *([mine] if mine and mine not in found() else [])]:
        try:
            facts = facts_of(open_user_catalogue(where))
        except CatalogueError as error:
            facts = {"kind": where.kind, "name": where.name, "path": str(where.path), "problem": str(error)}
        rows.append(facts | {"in_use": where == mine})
    return rows


def described(facts: dict[str, Any]) -> str:
    """One sentence about a row of :func:`listed`."""
    if "problem" in facts:
        return tr("{kind} {name}: {problem}", **facts)
    text = tr(
        "{kind} {name}: to magnitude {faintest_mag:.1f}, {stars_per_deg2:,.0f} stars a square degree, fields from"
        " {narrowest_field_deg:.2g}° ({path})",
        **facts,
    )
    if facts["sky_share"] < WHOLE_SKY:
        text += ", " + tr("{percent:.2g} % of the sky", percent=100.0 * facts["sky_share"])
    return text


def forget() -> None:
    """Use the shipped stars alone again."""
    _remember({"kind": "", "name": "", "path": ""})


def asked_before() -> bool:
    """Whether the user has chosen a catalogue, or none, already."""
    return (config_folder() / SETTINGS).exists()


def chosen() -> Where | None:
    """The catalogue in use; None: the shipped stars alone."""
    try:
        kept: Any = read_json(config_folder() / SETTINGS)
        where = Where(str(kept["kind"]), str(kept["name"]), Path(str(kept["path"])))
    except (TextError, KeyError, TypeError):
        return None
    return where if where.kind else None


@lru_cache(maxsize=2)
def _opened(where: Where) -> UserCatalogue:
    return open_user_catalogue(where)


def opened() -> UserCatalogue | None:
    """The catalogue in use, opened once; `CatalogueError` when it is gone or damaged."""
    where = chosen()
    return None if where is None else _opened(where)


def _remember(facts: dict[str, str]) -> None:
    folder = config_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        scratch = folder / f"{SETTINGS}.part"
        scratch.write_text(json.dumps(facts) + "\n", "utf-8")
        scratch.replace(folder / SETTINGS)
    except OSError as error:
        raise CatalogueError("{folder} cannot be written: {why}.", folder=folder, why=error.strerror or error) from None
