"""The user's own stars in an index: narrow frames of which neither place nor scale is known.

The index has one level, the brightest stars of every field of 0.4 degrees, shipped ones and the user's, and so no more
than eight million of any catalogue: frames of 0.22 to 0.7 degrees. The catalogue is read band by band of declination,
and the index made in four parts of the sky, for a quarter of the memory: what is done is not done again should the work
be ended. What it finds is a place and a scale, which the cone search then believes or not, and names the stars.
"""

import hashlib
import math
import os
import shutil
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import east_north, unit_vectors
from kochab.core.errors import CatalogueError, DamagedPatternsError
from kochab.core.frame import Detections, Hint
from kochab.core.progress import Progress, Task
from kochab.core.solution import Identification, NoSolution, Reason
from kochab.folders import cache_folder
from kochab.identification.index import Volume, open_volume
from kochab.identification.index_build import EPOCH, acquire, put_in_place, release, write_volume
from kochab.identification.local_index import brightest_of_each_field
from kochab.identification.patterns import Patterns, SearchStage
from kochab.sky import user_catalogues
from kochab.sky.user_catalogues import Cone, UserCatalogue
from kochab.solver.cone_search import Narrow, cone_stars, search_cone
from kochab.text.translation import tr

FIELD_DEG = 0.4
"""Of the level."""
SERVES_DEG = (0.22, 0.7)
"""Sides of the frames that are looked up."""
NEIGHBOURS, STEPS = (5, 5), 32
BAND_DEG = 5.0
SOUTH_DEG = tuple(np.arange(-90.0, 90.0, BAND_DEG).tolist())
"""Lower edges of the bands."""
PARTS_DEG = ((-90.0, -30.0), (-30.0, 0.0), (0.0, 30.0), (30.0, 90.0))
"""Declinations of the parts, as large as one another."""
MARGIN_DEG = FIELD_DEG
"""Beyond its edge a cell's stars are counted in its fields too; and so far parts overlap."""
FAINTER_MAG = 0.7
"""The next cell is read so much deeper than the faintest star wanted of the one before."""
SURE = 1.02
"""What a scale that was found may be off by, as a factor."""
ROOM_BYTES = 1_500_000_000
READING = 0.4
"""What of the work reading is, about."""
DEPTHS = (
    SearchStage(10, 5, 0.9, 0.003, 30, max_verified=4, spread=1.6),
    SearchStage(18, 6, 0.9, 0.003, 40, max_verified=20),
    SearchStage(30, 6, 1.0, 0.003, 50),
    SearchStage(40, 6, 1.0, 0.004, 60, spread=3.0),
)


def own_folder() -> Path | None:
    """Where the index of the catalogue in use lies, or will; None: only the shipped stars are used."""
    where = user_catalogues.chosen()
    if where is None:
        return None
    with suppress(OSError):
        facts = f"{where.kind} {where.name} {where.path} {where.path.stat().st_mtime_ns}"
        return cache_folder() / f"own-{hashlib.sha256(facts.encode()).hexdigest()[:16]}"
    return None


def own_volumes() -> tuple[Volume, ...]:
    """The parts of the index of the catalogue in use when it has been made and is whole, else none."""
    folder = own_folder()
    if folder is None or not folder.exists():
        return ()
    with suppress(CatalogueError):
        return _opened(folder)
    return ()


@lru_cache(maxsize=1)
def _opened(folder: Path) -> tuple[Volume, ...]:
    return tuple(open_volume(folder / f"part-{number}") for number in range(len(PARTS_DEG)))


def make_own() -> Task[tuple[Volume, ...]]:
    """Return the index of the catalogue in use, making it first if need be; nothing: there is no such catalogue.

    Ended, it goes on where it stopped. The index of another catalogue is removed. Raises CatalogueError when the
    catalogue is damaged, the disk is full, or another program is making it.
    """
    folder, own = own_folder(), user_catalogues.opened()
    if folder is None or own is None:
        return ()
    ready = own_volumes()
    if ready:
        return ready
    lock, scratch = folder.with_suffix(".lock"), folder.with_suffix(".part")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        if shutil.disk_usage(folder.parent).free < ROOM_BYTES:
            raise CatalogueError("The index of your stars needs 1.5 GB free in {path}.", path=folder.parent)
        handle = acquire(lock)
        if handle is None:
            raise CatalogueError("Another program is building the index of your stars.")
        try:
            yield from _make(own, scratch)
            for other in folder.parent.glob("own-*"):
                if other.is_dir() and other != scratch:
                    shutil.rmtree(other, ignore_errors=True)
            put_in_place(scratch, folder)
        finally:
            release(handle, lock)
    except OSError as error:
        why = error.strerror or error
        raise CatalogueError(
            "The index of your stars can't be written to {path}: {why}.", path=folder, why=why
        ) from None
    _opened.cache_clear()
    return own_volumes()


def _make(own: UserCatalogue, scratch: Path) -> Task[None]:
    scratch.mkdir(exist_ok=True)
    bands = [scratch / f"band-{number:02d}.npy" for number in range(len(SOUTH_DEG))]
    for number, (path, south) in enumerate(zip(bands, SOUTH_DEG, strict=True)):
        detail = tr("reading {name}", name=f"{own.kind} {own.name}")
        yield Progress("patterns", READING * number / len(bands), detail)
        if not path.exists():
            stars = yield from _band(own, south)
            new = path.with_suffix(".new")
            with new.open("wb") as file:
                np.save(file, stars)
                file.flush()
                os.fsync(file.fileno())
            new.replace(path)  # whole, or not there
    for number, (south, north) in enumerate(PARTS_DEG):
        place, done = scratch / f"part-{number}", number / len(PARTS_DEG)
        if (place / "index.json").exists():  # written last
            continue
        every = [np.load(path) for path in bands]
        stars = np.concatenate([b[(b[:, 1] >= south - MARGIN_DEG) & (b[:, 1] < north + MARGIN_DEG)] for b in every])
        del every
        vectors, numbers = unit_vectors(stars[:, 0], stars[:, 1]), np.arange(len(stars))
        writing = write_volume(place, vectors, numbers, [FIELD_DEG], [numbers], neighbours=[NEIGHBOURS], steps=STEPS)
        del vectors
        for step in writing:
            share = READING + (1.0 - READING) * (done + (step.fraction or 0.0) / len(PARTS_DEG))
            yield Progress(step.stage, share, step.detail)
    for path in bands:
        path.unlink()


def _band(own: UserCatalogue, south: float) -> Task[Floats]:
    """RA and Dec, degrees, and magnitude (N, 3) of the level's stars in a band of declination."""
    middle = south + BAND_DEG / 2.0
    widest = min(abs(south), abs(south + BAND_DEG)) if south * (south + BAND_DEG) > 0.0 else 0.0
    cells = max(1, math.ceil(360.0 * math.cos(math.radians(widest)) / BAND_DEG))
    width, limit, found = 360.0 / cells, None, []
    for cell in range(cells):
        yield Progress("patterns", None)
        ra = (cell + 0.5) * width
        corners = unit_vectors(
            np.array([ra - width / 2.0, ra - width / 2.0]), np.array([max(south, -90.0), min(south + BAND_DEG, 90.0)])
        )
        axis = unit_vectors(ra, middle)
        reach = float(np.arccos(np.clip(corners @ axis, -1.0, 1.0)).max()) + math.radians(MARGIN_DEG)
        wanted, faintest = _cell(own, Cone(math.radians(ra), math.radians(middle), reach, limit, EPOCH))
        if limit is not None and faintest > limit - 0.1:  # there may be stars that are fainter
            wanted, faintest = _cell(own, Cone(math.radians(ra), math.radians(middle), reach, None, EPOCH))
        limit = faintest + FAINTER_MAG if math.isfinite(faintest) else None
        off = (wanted[:, 0] - (ra - width / 2.0)) % 360.0
        inside = (off < width) & (wanted[:, 1] >= south) & (wanted[:, 1] < south + BAND_DEG + 1e-9 * (south > 84.0))
        found.append(wanted[inside])
    return np.concatenate(found)


def _cell(own: UserCatalogue, cone: Cone) -> tuple[Floats, float]:
    """RA and Dec, degrees, and magnitude (N, 3) of the level's stars in a cone, and the faintest of these."""
    stars = cone_stars(cone, own)
    if not len(stars.v):
        return np.zeros((0, 3)), -math.inf
    plane = stars.place @ east_north(cone.axis).T / (stars.place @ cone.axis)[:, None]
    kept = brightest_of_each_field(plane, math.radians(FIELD_DEG))
    x, y, z = stars.place[kept].T
    places = np.degrees(np.arctan2(y, x)) % 360.0, np.degrees(np.arcsin(np.clip(z, -1.0, 1.0)))
    return np.column_stack([*places, stars.v[kept]]), float(stars.v[kept].max())


def search_own(
    detections: Detections, hint: Hint | None, volumes: tuple[Volume, ...], year: float, unreadable: list[str]
) -> Task[Identification | NoSolution]:
    """Identify the stars of a narrow frame anywhere in the sky.

    Parameters
    ----------
    detections : Detections
        Of the frame.
    hint : Hint or None
        Its scale limits the search; a place does not.
    volumes : tuple of Volume
        Of the catalogue in use.
    year : float
        Epoch of the stars' places, Julian year.
    unreadable : list[str]
        Takes the sentence that says why the catalogue cannot be read, should it be damaged.
    """
    half = math.sqrt(detections.width * detections.height) / 2.0
    narrow, wide = (half / math.tan(math.radians(field) / 2.0) for field in SERVES_DEG)
    low, high = (hint.focal_px if hint else None) or (wide, narrow)
    low, high = max(low, wide), min(high, narrow)
    if low >= high:
        return NoSolution(Reason.NO_PATTERN_AGREED, "", "nothing")
    yield Progress("identify", 0.6, tr("your own stars"))
    there = Hint(scale_arcsec_px=(_scale(high), _scale(low)))
    stages = tuple(replace(depth, volume=part) for depth in DEPTHS for part in range(len(volumes)))
    try:
        found = yield from Patterns(volumes, stages).identify(detections, there, year)
    except DamagedPatternsError as error:  # it is made again
        (error.folder / "index.json").unlink(missing_ok=True)
        _opened.cache_clear()
        return NoSolution(Reason.NO_PATTERN_AGREED, "", "nothing")
    if isinstance(found, NoSolution):
        return found
    field = math.degrees(2.0 * math.atan(half / found.camera.focal_px))
    scale = _scale(found.camera.focal_px)
    placed = Hint(scale_arcsec_px=(scale / SURE, scale * SURE), centre_deg=(*found.attitude.ra_dec_deg, field))
    known = Narrow(field, (field / SURE, field * SURE), first=True, whole=True)
    return (yield from search_cone(detections, placed, known, year, unreadable))


def _scale(focal_px: float) -> float:
    """Arcseconds a pixel."""
    return math.degrees(1.0 / focal_px) * 3600.0
