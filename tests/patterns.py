"""The patterns of small fields that the tests share: ``python -m tests.patterns`` makes them.

They take a minute to make. They outlive a session, as on a user's machine, until the code or the
catalogue that makes them changes.
"""

import contextlib
import hashlib
import os
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
MAKERS = [
    *(
        REPOSITORY / "app" / "kochab" / "identification" / f"{name}.py"
        for name in ("index_build", "index_sort", "quads", "index")
    ),
    REPOSITORY / "catalogs" / "manifest.json",
]


def choose_folder() -> None:
    """A cache of the tests' own, before anything asks where it is."""
    mark = hashlib.sha256(b"".join(path.read_bytes() for path in MAKERS)).hexdigest()[:12]
    folder = REPOSITORY / ".pytest_cache" / f"kochab-{mark}"
    os.environ.setdefault("KOCHAB_CACHE", str(folder))


def make() -> None:
    """One process makes them, others wait for it; the tests that miss them will say so."""
    from kochab.core.errors import CatalogueError
    from kochab.core.progress import run
    from kochab.identification.index_build import make_fine

    with contextlib.suppress(CatalogueError):
        run(make_fine())


if __name__ == "__main__":
    choose_folder()
    make()
