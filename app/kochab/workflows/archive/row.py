"""One input to one row: fetched, hashed, solved and measured; whatever goes wrong with it is in its row."""

import hashlib
import json
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from datetime import UTC, datetime
from functools import cache, lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any

import fsspec
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from kochab.core import __version__
from kochab.core.arrays import Floats
from kochab.core.attitude import apart_deg
from kochab.core.errors import FrameError, KochabError, UsageError
from kochab.core.frame import Detections, Hint, Site
from kochab.core.progress import Progress, Task
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import frozen
from kochab.frames import reading
from kochab.frames.fits import read_header
from kochab.frames.readers import named_as_fits
from kochab.solver import SolveOptions
from kochab.solver.pipeline import merged_hint, solve_detections, with_doubts
from kochab.text.translation import in_english
from kochab.workflows.archive.inputs import Item, is_local
from kochab.workflows.archive.objects import COLUMNS, objects_of
from kochab.workflows.night.frame import is_calibration, measured, setup_of
from kochab.workflows.night.measure import median_of
from kochab.workflows.night.table import frame_row
from kochab.workflows.solution_json import Json, as_json
from kochab.workflows.solve_frame import read_star_list, solve_open_frame

_F, _S, _I, _B = pa.float64(), pa.string(), pa.int64(), pa.bool_()
_T = pa.timestamp("us", tz="UTC")
IDENTITY = {
    **{"url": _S, "stamp": _S, "size_bytes": _I, "table_row": _I, "width": _I, "height": _I, "content": _S},
    **{"copy": _B, "recipe": _S, "version": _S, "kind": _S, "time_utc": _T, "exposure_s": _F, "camera": _S},
    **{"setup": _S, "latitude_deg": _F, "longitude_deg": _F},
}
ANSWER = {
    **{"solved": _B, "reason": _S, "advice": _S, "error": _S, "quarantined": _B, "method": _S, "hinted": _B},
    **{"ra_deg": _F, "dec_deg": _F, "roll_deg": _F, "sigma_x_arcsec": _F, "sigma_y_arcsec": _F},
    **{"sigma_roll_arcsec": _F, "mirrored": _B, "scale_arcsec_px": _F, "fov_x_deg": _F, "fov_y_deg": _F},
    **{"log10_false_alarm": _F, "matches": _I, "stars": _I, "rms_px": _F, "rms_arcsec": _F, "projection": _S},
    **dict.fromkeys(("focal_px", "cx", "cy", "k1", "k2", "p1", "p2"), _F),
    **{f"q{axis}": _F for axis in "wxyz"},
    "warnings": pa.list_(_S),
}
_WITH_SIGMA = (
    *("fwhm_px", "elongation", "trail", "tilt_px", "curvature_px"),
    *("zero_point_mag", "sky_mag_arcsec2", "limiting_mag"),
)
MEASURES = {
    **{name: _F for one in _WITH_SIGMA for name in (one, f"{one}_sigma")},
    **{"trail_deg": _F, "softest": _S, "background": _F, "noise": _F, "altitude_deg": _F, "sun_altitude_deg": _F},
    **{"moon_altitude_deg": _F, "moon_distance_deg": _F, "moon_lit": _F},
}
COST = {
    **{"done_utc": _T, "tries": _I, "read_bytes": _I, "wall_s": _F, "cpu_s": _F},
    **{f"{stage}_ms": _F for stage in ("read", "detect", "identify", "attitude")},
}
SCHEMA = pa.schema([*(IDENTITY | ANSWER | MEASURES | COLUMNS | COST).items()])
"""The columns of the dataset."""
NAMES = frozenset(SCHEMA.names)
FORMAT = 1
"""Raised when a column changes its meaning: older rows are then made anew."""
SAME_SCALE, OF_FIELD = 0.01, 1.5
"""Frames of one session agree in scale to this, and in place to so many widths of the field."""
CALIBRATION_ROW: Json = {"kind": "calibration", "solved": False, "reason": "calibration frame"}
HEAD_BYTES, WORTH_A_LOOK_BYTES = 10 * 2880, 1_000_000
"""Of a FITS file in a storage that is not a disk the header is fetched first, if it has so many bytes."""


class UnreachableError(KochabError):
    """What is stored there may well be a frame, but nothing came of it now: the next run tries again."""


@frozen
class Recipe:
    """How frames are solved, where they were taken if headers don't say, and how often a file is asked for.

    With ``objects`` streaks, bodies of the Solar System and unlisted sources are looked for.
    """

    options: SolveOptions
    site: Site | None = None
    tries: int = 3
    objects: bool = False

    @property
    def digest(self) -> str:
        """Of options, site, catalogue and version: a row with another is not this recipe's."""
        return _digest(self)


@cache
def _digest(recipe: Recipe) -> str:
    from kochab.identification.table_cache import catalogue_checksums
    from kochab.sky.user_catalogues import chosen

    own = chosen()
    parts = [FORMAT, __version__, catalogue_checksums(), own.title if own else ""]
    parts += [asdict(recipe.options), asdict(recipe.site) if recipe.site else None, recipe.objects]
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()[:16]


@frozen
class Session:
    """What the last frame of a folder tells of the next: size, px, scale, and its place once two agreed.

    ``centre_deg`` is (RA, Dec) of the last frame, ``near`` whether the one before was there too.
    """

    size: tuple[int, int]
    camera: str
    scale_arcsec_px: float
    centre_deg: tuple[float, float]
    width_deg: float
    same_scale: bool = False
    near: bool = False

    def after(self, before: "Session | None") -> "Session":
        """The same, compared with the frame before."""
        if before is None or (before.size, before.camera) != (self.size, self.camera):
            return self
        same = abs(self.scale_arcsec_px / before.scale_arcsec_px - 1.0) < SAME_SCALE
        near = same and apart_deg(self.centre_deg, before.centre_deg) < OF_FIELD * self.width_deg
        return replace(self, same_scale=same, near=near)

    def hint(self, size: tuple[int, int], camera: str) -> Hint | None:
        """What to try first for a frame of that size and camera; it decides nothing."""
        if not self.same_scale or (size, camera) != (self.size, self.camera):
            return None
        scale = (self.scale_arcsec_px * (1.0 - SAME_SCALE), self.scale_arcsec_px * (1.0 + SAME_SCALE))
        centre = (*self.centre_deg, min(OF_FIELD * self.width_deg, 90.0)) if self.near else None
        return Hint(scale_arcsec_px=scale, centre_deg=centre, source="session")


Measured = tuple[Json, Session | None]
"""A row, and what it tells of the next frame of its session."""


def row_of(item: Item, recipe: Recipe, session: Session | None = None, known: str = "") -> Task[Measured]:
    """The row of an input, and what it tells of the next frame of its session.

    ``known`` is the content hash that a row of the same recipe has: where the content is still that, the row is
    ``{"url", "stamp", "content", "unchanged": True}``. A file that is no frame is quarantined. Raises
    `UnreachableError` where the storage fails, FrameError where the file is gone: see :func:`failed_row`.

    Parameters
    ----------
    item : Item
        The input.
    recipe : Recipe
        How it is solved.
    session : Session or None
        What the frames before it told.
    known : str
        The content hash of the row that is there, "" without one.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    yield Progress("fetch", None, item.url)
    with in_english(), _fetched(item, recipe.tries) as source:
        row: Json = asdict(item) | {"content": source.content, "read_bytes": source.size, "tries": source.tries}
        if known and source.content == known:
            return row | {"unchanged": True}, session
        row |= {"content": source.content or None, "size_bytes": item.size_bytes or source.size}
        row |= {"recipe": recipe.digest, "version": __version__, "quarantined": False}
        work = _list_row if source.stars is not None or _is_list(item) else _frame_row
        try:
            found, after = yield from work(item, source, recipe, session)
        except KochabError as error:  # of this content: it will be so again
            found, after = {"solved": False, "error": str(error), "quarantined": True}, session
    spent = {"wall_s": time.perf_counter() - wall, "cpu_s": time.process_time() - cpu, "done_utc": datetime.now(UTC)}
    return row | found | spent, after


def failed_row(item: Item, recipe: Recipe, error: str, quarantined: bool) -> Json:
    """The row of an input that gave none: quarantined it waits until its file changes, else for the next run.

    Parameters
    ----------
    item : Item
        The input.
    recipe : Recipe
        How it was to be solved.
    error : str
        One sentence.
    quarantined : bool
        Whether it is left alone from now on.
    """
    kept = {"recipe": recipe.digest, "version": __version__, "solved": False, "error": error}
    return asdict(item) | kept | {"quarantined": quarantined, "done_utc": datetime.now(UTC)}


def table_of(rows: Sequence[Json]) -> pa.Table:
    """Rows as a table of :data:`SCHEMA`; what is not a finite number is null."""
    columns = []
    for name, kind in zip(SCHEMA.names, SCHEMA.types, strict=True):
        values = [row.get(name) for row in rows]
        if kind == _F:
            values = [value if value is not None and np.isfinite(value) else None for value in values]
        columns.append(pa.array(values, kind))
    return pa.Table.from_arrays(columns, schema=SCHEMA)


# -- Fetching ----------------------------------------------------------------------------------


@frozen(eq=False)
class _Source:
    """A file here, the stars of a list, or a header alone, with the SHA-256 of its content, "" of a header."""

    path: Path
    content: str
    size: int
    tries: int
    stars: Detections | None = None
    header: Mapping[str, Any] | None = None


def _is_list(item: Item) -> bool:
    return item.width > 0 and item.height > 0 and item.url.lower().endswith((".csv", ".txt"))


@contextmanager
def _fetched(item: Item, tries: int) -> Iterator[_Source]:
    """The content of an input, local for as long as the block lasts."""
    if item.table_row >= 0:
        stars, tried = _persistently(lambda: _stars_of(item), item.source, tries)
        data = stars.xy.tobytes() + stars.flux.tobytes() + f"{stars.width}x{stars.height}".encode()
        yield _Source(Path(item.url), hashlib.sha256(data).hexdigest(), len(data), tried, stars)
        return
    fs, path = fsspec.core.url_to_fs(item.url)
    if is_local(fs):
        (content, size), tried = _persistently(lambda: _hashed(Path(path)), item.url, tries)
        yield _Source(Path(path), content, size, tried)
        return
    head, _ = _persistently(lambda: _calibration_header(fs, path, item.size_bytes), item.url, tries)
    if head:
        yield _Source(Path(path), "", HEAD_BYTES, 1, header=head)
        return
    with tempfile.TemporaryDirectory(prefix="kochab-archive-") as folder:
        here = Path(folder, path.rpartition("/")[2] or "frame")
        _, tried = _persistently(lambda: fs.get_file(path, str(here)), item.url, tries)
        content, size = _hashed(here)
        yield _Source(here, content, size, tried)


def _hashed(path: Path) -> tuple[str, int]:
    """SHA-256 and size of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest(), file.tell()


def _calibration_header(fs: Any, path: str, size_bytes: int) -> dict[str, Any]:
    """The header of a large FITS file that is a dark, a flat or a bias: the rest is not fetched; else empty."""
    if size_bytes < WORTH_A_LOOK_BYTES or not named_as_fits(path, packed=False):
        return {}
    with suppress(FrameError):  # whatever is wrong with it is told when it is read
        header = read_header(BytesIO(fs.cat_file(path, start=0, end=HEAD_BYTES)))
        if header is not None and is_calibration(header.values):
            return header.values
    return {}


def _persistently(read: Callable[[], Any], url: str, tries: int) -> tuple[Any, int]:
    """What ``read`` gives and at which try; a storage that fails is asked again after a while.

    Raises FrameError for a file that is not there or may not be read, `UnreachableError` for anything else.
    """
    for tried in range(1, tries + 1):
        try:
            return read(), tried
        except KochabError:
            raise
        except FileNotFoundError:
            raise FrameError("{url} does not exist.", url=url) from None
        except PermissionError:
            raise FrameError("Can't open {url}: permission denied.", url=url) from None
        except Exception as error:  # every storage has errors of its own
            if tried == tries:
                why = " ".join(str(error).split())[:200].rstrip(".") or type(error).__name__
                raise UnreachableError("{url} cannot be read now: {why}.", url=url, why=why) from error
            time.sleep(min(0.5 * 2**tried, 30.0))
    raise AssertionError


def _stars_of(item: Item) -> Detections:
    """The stars of one row of a table of lists."""
    starts, groups = _groups(item.source, item.stamp)
    group = int(np.searchsorted(starts, item.table_row, side="right")) - 1
    row = _group(item.source, item.stamp, groups[group]).slice(item.table_row - int(starts[group]), 1).to_pylist()[0]
    x, y, flux = row["x"] or (), row["y"] or (), row.get("flux")
    whole = 0 < len(x) == len(y) and (flux is None or len(flux) == len(x)) and item.width > 1 and item.height > 1
    xy = np.array([x, y], dtype=np.float64).T if whole else np.full((1, 2), np.nan)
    if not np.isfinite(xy).all():
        raise UsageError("{url}: x, y and the size of the frame make no list of stars.", url=item.url)
    light = None if flux is None else np.asarray(flux, dtype=np.float64)
    return Detections.from_list(xy, item.width, item.height, light)


@lru_cache(maxsize=8)
def _groups(source: str, stamp: str) -> tuple[Floats, range]:
    """At which row each group of a Parquet table begins."""
    with fsspec.open(source, "rb") as file, pq.ParquetFile(file) as table:
        counts = [table.metadata.row_group(k).num_rows for k in range(table.num_row_groups)]
    return np.concatenate([[0], np.cumsum(counts)[:-1]]), range(len(counts))


@lru_cache(maxsize=2)
def _group(source: str, stamp: str, group: int) -> pa.Table:
    """One row group: neighbours are read once."""
    with fsspec.open(source, "rb") as file, pq.ParquetFile(file) as table:
        names = [name for name in ("x", "y", "flux") if name in table.schema_arrow.names]
        return table.read_row_group(group, columns=names)


# -- Columns -----------------------------------------------------------------------------------


def _list_row(item: Item, source: _Source, recipe: Recipe, session: Session | None) -> Task[Measured]:
    stars = source.stars
    if stars is None:
        stars = read_star_list(source.path, item.width, item.height)
    hint = session.hint((stars.width, stars.height), "") if session else None
    options = replace(recipe.options, hint=merged_hint(recipe.options.hint, hint)) if hint else recipe.options
    result = with_doubts((yield from solve_detections(stars, options)), recipe.options)
    row = {"kind": "star list", "hinted": hint is not None} | _answer(result, len(stars))
    return row, _after(result, "", session)


def _frame_row(item: Item, source: _Source, recipe: Recipe, session: Session | None) -> Task[Measured]:
    if source.header is not None:
        return CALIBRATION_ROW | {"setup": setup_of(source.header)}, session
    frame = yield from reading(source.path, recipe.options.timeout_s)
    own = frame.hint
    row: Json = {
        **{"kind": "frame", "time_utc": own.taken_utc, "exposure_s": own.exposure_s, "camera": own.camera},
        **{"width": frame.width, "height": frame.height},
    }
    if is_calibration(frame.header):
        return row | CALIBRATION_ROW | {"setup": setup_of(frame.header)}, session
    hint = session.hint((frame.width, frame.height), own.camera) if session else None
    if hint:
        frame = replace(frame, hint=merged_hint(own, hint) or own)
    found = yield from solve_open_frame(frame, recipe.options)
    night = measured(found, recipe.site, small=False)
    kept = {name: value for name, value in frame_row(night).items() if name in NAMES and name not in row}
    row |= kept | {"setup": night.setup, "hinted": hint is not None, **_level(found.detections)}
    if there := night.site or recipe.site or own.site:
        row |= {"latitude_deg": there.latitude_deg, "longitude_deg": there.longitude_deg}
    if night.light is not None and (zero := median_of(night.light.excess_mag)):
        row |= {"zero_point_mag": zero.value, "zero_point_mag_sigma": zero.sigma}
    if recipe.objects:
        row |= yield from objects_of(night, found)
    result = with_doubts(found.result, recipe.options, own)
    return row | _answer(result, len(found.detections)), _after(result, own.camera, session)


def _level(detections: Detections) -> Json:
    return {"background": float(detections.background), "noise": float(detections.noise)}


def _answer(result: Solution | NoSolution, stars: int) -> Json:
    """The columns of a solution, or of why there is none."""
    solved = as_json("", result)
    times = {f"{name}_ms": value for name, value in solved["elapsed_ms"].items() if name != "total"}
    solved |= times | {"stars": stars}
    if isinstance(result, Solution):
        solved |= solved.pop("camera") | dict(zip(("qw", "qx", "qy", "qz"), solved["quaternion"], strict=True))
        solved |= dict(zip(("fov_x_deg", "fov_y_deg"), solved["fov_deg"], strict=True))
        sigmas = ("sigma_x_arcsec", "sigma_y_arcsec", "sigma_roll_arcsec")
        solved |= dict(zip(sigmas, solved["sigma_arcsec"], strict=True)) | {"width": result.camera.width}
        solved |= {"height": result.camera.height, "reason": None}
    return {name: value for name, value in solved.items() if name in NAMES}


def _after(result: Solution | NoSolution, camera: str, session: Session | None) -> Session | None:
    if not isinstance(result, Solution):
        return session
    size = (result.camera.width, result.camera.height)
    scale, place = result.camera.scale_arcsec_px, result.ra_dec_deg
    return Session(size, camera, scale, place, result.camera.fov_deg[0]).after(session)
