"""The pattern volumes of this installation: two shipped, one made on the user's machine.

``wide`` and ``coarse`` lie in ``catalogs/patterns`` and serve fields from about 2.5 degrees up.
``fine`` serves smaller ones. It is several times as large, so it is made from the shipped catalogue
where it is first needed, once, and kept in the user's cache folder.
"""

import json
import os
import shutil
import time
from functools import lru_cache
from pathlib import Path

import numpy as np

from app.core.errors import CatalogueError, DamagedPatternsError
from app.core.progress import Progress, Task
from app.identify.build import build_volume
from app.identify.index import Volume, open_volume
from app.identify.lock import acquire, release

FORMAT = 2
EPOCH = 2020.0  # a middling year: quads outlive a few decades of proper motion
SHIPPED: dict[str, tuple[range, tuple[tuple[int, int], ...], int]] = {
    # name: levels, nearest stars taken at each (rich, poor sky), cells of code space
    "wide": (range(9, 15), ((6, 6),) * 6, 16),
    "coarse": (range(4, 11), ((4, 4), *((5, 5),) * 6), 24),
}
ROOM_BYTES = 600_000_000
ELSEWHERE = "KOCHAB_CACHE names another folder"
WAITING = "waiting for the patterns of small fields, which are being made once on this computer"
FINE = (range(5), ((4, 12), (4, 4), (4, 4), (4, 4), (4, 4)), 40)


def shipped_folder() -> Path:
    """Where the shipped volumes lie."""
    from app.sky.catalogue import shipped_folder as catalogs

    return catalogs() / "patterns"


def fine_folder() -> Path:
    """Where the volume of small fields lies, or will: ``KOCHAB_CACHE`` or the user's cache."""
    from platformdirs import user_cache_path

    base = os.environ.get("KOCHAB_CACHE")
    root = Path(base) if base else user_cache_path("kochab", appauthor=False)
    return root / f"patterns-{FORMAT}-{_mark()[:12]}"


@lru_cache(maxsize=1)
def shipped() -> tuple[Volume, ...]:
    """The shipped volumes, ``wide`` first; raises CatalogueError when one is missing."""
    volumes = tuple(open_volume(shipped_folder() / name) for name in SHIPPED)
    if any(volume.mark != _mark() for volume in volumes):
        raise CatalogueError(
            "The shipped patterns belong to another catalogue: run kochab catalog build."
        )
    return tuple(_of_catalogue(volume) for volume in volumes)


def fine() -> Volume | None:
    """The volume of small fields when it has been made and is whole, else None."""
    folder = fine_folder()
    try:
        return _opened(folder) if (folder / "index.json").exists() else None
    except CatalogueError:  # it is made again
        return None


def drop_fine(folder: Path) -> bool:
    """Whether ``folder`` is that of the volume of small fields, which is then made anew."""
    if folder != fine_folder():
        return False
    (folder / "index.json").unlink(missing_ok=True)
    _opened.cache_clear()
    return True


@lru_cache(maxsize=1)
def _opened(folder: Path) -> Volume:
    volume = open_volume(folder)
    if not is_shipped(volume):
        raise DamagedPatternsError(folder)
    return _of_catalogue(volume)


def _of_catalogue(volume: Volume) -> Volume:
    """The same; DamagedPatternsError when it names stars that the shipped catalogue lacks."""
    from app.sky import open_catalogue

    if int(volume.rows.max()) >= len(open_catalogue()):
        raise DamagedPatternsError(volume.folder)
    return volume


def is_shipped(volume: Volume) -> bool:
    """Whether the rows of ``volume`` are those of the shipped catalogue."""
    return volume.mark == _mark()


@lru_cache(maxsize=1)
def _mark() -> str:
    """The catalogue the patterns must belong to: its SHA-256 from the manifest."""
    from app.sky.catalogue import shipped_folder as catalogs

    try:
        manifest = json.loads((catalogs() / "manifest.json").read_text("utf-8"))
        return str(manifest["files"]["deep.kcat"]["sha256"])
    except (OSError, ValueError, KeyError) as error:
        raise CatalogueError("The catalogue's manifest is missing or damaged.") from error


def build_shipped(folder: Path | None = None) -> Task[None]:
    """Make the shipped volumes from the shipped catalogue; the same input gives the same bytes."""
    _mark.cache_clear()
    for name, plan in SHIPPED.items():
        yield from _build((folder or shipped_folder()) / name, *plan)
    shipped.cache_clear()


def make_fine() -> Task[Volume]:
    """Return the volume of small fields, making it first if need be: half a minute, once.

    Safe when several programs ask at once: one makes it, the others wait. Raises CatalogueError
    when it cannot be written.
    """
    folder = fine_folder()
    lock = folder.with_suffix(".lock")
    while True:
        ready = fine()
        if ready is not None:
            return ready
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
            _need_room(folder.parent)
            handle = acquire(lock)
        except OSError as error:
            raise CatalogueError(
                f"Patterns for small fields cannot be kept in {folder.parent}: {error.strerror}"
                f" ({ELSEWHERE})."
            ) from error
        if handle is not None:
            break
        yield Progress("patterns", None, WAITING)
        time.sleep(0.2)
    scratch = folder.with_suffix(".part")
    try:
        ready = fine()  # another may have been done since we looked
        if ready is not None:
            return ready
        shutil.rmtree(scratch, ignore_errors=True)
        yield from _build(scratch, *FINE)
        _on_disk(scratch)
        shutil.rmtree(folder, ignore_errors=True)
        scratch.rename(folder)
    except OSError as error:
        raise CatalogueError(
            f"The patterns for small fields cannot be written to {folder.parent}: {error.strerror}."
        ) from error
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
        release(handle, lock)
    return open_volume(folder)


def _on_disk(folder: Path) -> None:
    """Return when files are on the disk itself: a name may get there before what it names."""
    for path in folder.iterdir():
        with path.open("rb+") as file:
            os.fsync(file.fileno())


def _need_room(parent: Path) -> None:
    """Refuse at once what would fill the disk after a minute's work."""
    free = shutil.disk_usage(parent).free
    if free < ROOM_BYTES:
        raise CatalogueError(
            f"Patterns for small fields need {ROOM_BYTES // 1_000_000} MB in {parent}, where"
            f" {free // 1_000_000} MB are free ({ELSEWHERE})."
        )


def _build(
    folder: Path,
    levels: range,
    neighbours: tuple[tuple[int, int], ...],
    steps: int,
) -> Task[None]:
    from app.sky import open_catalogue

    yield Progress("patterns", 0.0, "reading the catalogue")
    catalogue = open_catalogue()
    rows = np.arange(len(catalogue))
    rows = rows[np.argsort(catalogue.mag(rows), kind="stable")]
    vectors = catalogue.vectors(rows, EPOCH)
    yield from build_volume(
        folder, vectors, rows, levels, neighbours=neighbours, steps=steps, mark=_mark()
    )
