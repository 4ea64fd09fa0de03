"""The dataset of an archive: Parquet parts that are written, then renamed; what is done, and what is left to do.

    OUT/part-SHARD-TIME-ID.parquet   rows; the newest of a URL counts
    OUT/_kochab/run-SHARD.json       how far the run of a shard is
    OUT/_kochab/status.html          the same for people

Readers of Parquet datasets (pyarrow, DuckDB, Spark, Dask) pass over names that begin with ``_``.
"""

import json
import logging
import re
import time
import uuid
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import reduce
from operator import and_, eq, ge, gt, le, lt, ne
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from kochab.core.errors import UsageError
from kochab.core.values import frozen
from kochab.parsing.text_input import TextError, parse_json
from kochab.workflows.archive.inputs import SCHEMA as INPUTS
from kochab.workflows.archive.inputs import is_local, opened
from kochab.workflows.archive.row import SCHEMA, table_of
from kochab.workflows.solution_json import Json

OWN = "_kochab"
PAGE = f"{OWN}/status.html"
SMALL_ROWS, FEW, TOGETHER = 20_000, 8, 64
"""Parts with fewer rows are joined, so many at a time, once there are more than so many."""
TRIES, PAUSE_S = 5, 0.1
"""To remove a part that is in use."""
log = logging.getLogger(__name__)
_PART = re.compile(r"part-.*\.parquet$")
_CONDITION = re.compile(r"\s*(\w+)\s*(<=|>=|!=|=|<|>)\s*(.*?)\s*$")
_SIGNS: dict[str, Callable[[Any, Any], Any]] = {"=": eq, "!=": ne, "<": lt, "<=": le, ">": gt, ">=": ge}
_INDEX = ("url", "stamp", "size_bytes", "content", "recipe", "quarantined", "error", "done_utc")


@frozen
class Condition:
    """What rows must meet, and the columns it asks for."""

    columns: tuple[str, ...]
    expression: Any


@frozen
class Dataset:
    """A dataset at a URL; ``shard`` names the parts and the state of one of several runs, "all" for the only one."""

    url: str
    fs: Any
    path: str
    shard: str = "all"

    @classmethod
    def at(cls, url: str, shard: tuple[int, int] = (0, 1)) -> "Dataset":
        """The dataset at a URL, there or not; UsageError where it cannot be."""
        fs, path = opened(url)
        return cls(url, fs, path.rstrip("/"), "all" if shard[1] == 1 else f"{shard[0] + 1}of{shard[1]}")

    # -- Parts ---------------------------------------------------------------------------------

    def make(self) -> None:
        """Make the folder; UsageError where that is not allowed, or a file is in its place."""
        try:
            self.fs.invalidate_cache()
            if self.fs.isfile(self.path):
                raise UsageError("{url} is a file: name a folder for the dataset.", url=self.url)
            self.fs.makedirs(f"{self.path}/{OWN}", exist_ok=True)
        except OSError as error:
            raise UsageError("{url} cannot be written: {why}.", url=self.url, why=error.strerror or error) from None

    def parts(self) -> list[str]:
        """The parts there are, by name."""
        self.fs.invalidate_cache()
        if not self.fs.isdir(self.path):
            return []
        return sorted(name for name in self.fs.ls(self.path, detail=False) if _PART.search(name))

    def own_parts(self) -> list[str]:
        """The parts that may have rows of this shard's inputs: all but those of its fellows."""
        fellow = re.compile(rf"part-\d+of{self.shard.partition('of')[2]}-")
        mine = f"part-{self.shard}-"
        names = ((name, name.rpartition("/")[2]) for name in self.parts())
        return [name for name, last in names if self.shard == "all" or last.startswith(mine) or not fellow.match(last)]

    def write(self, rows: Sequence[Json]) -> str:
        """A part with these rows, whole or not at all; its name."""
        return self._put(table_of(rows))

    def _put(self, table: pa.Table) -> str:
        name = f"part-{self.shard}-{datetime.now(UTC):%Y%m%dT%H%M%S}-{uuid.uuid4().hex[:8]}.parquet"
        sink = pa.BufferOutputStream()
        pq.write_table(table, sink, compression="zstd")
        draft = f"{self.path}/{OWN}/{name}.draft"
        self.fs.pipe_file(draft, sink.getvalue().to_pybytes())
        self.fs.mv(draft, f"{self.path}/{name}")
        return name

    def table(self, columns: Sequence[str], condition: Condition | None = None, own: bool = False) -> pa.Table:
        """Some columns of the newest row of every URL, those that meet a condition; and ``part``, where it lies.

        With ``own`` parts that can't have rows of this shard are left out.

        Raises UsageError when a part is damaged.
        """
        names = list(dict.fromkeys([*columns, "url", "done_utc", *(condition.columns if condition else ())]))
        try:
            found = _newest(self._read(self.own_parts() if own else self.parts(), names))
        except (pa.ArrowException, OSError) as error:
            why = str(error).splitlines()[0]
            raise UsageError("{url} has a part that cannot be read: {why}.", url=self.url, why=why) from None
        if condition is not None:
            found = found.filter(condition.expression)
        return found.select([*columns, "part"])

    def _read(self, parts: Sequence[str], columns: Sequence[str]) -> pa.Table:
        """Columns of all rows of some parts, and ``part``."""
        if not parts:
            return pa.schema([*map(SCHEMA.field, columns), pa.field("part", pa.string())]).empty_table()
        if is_local(self.fs):
            found = ds.dataset(list(parts), SCHEMA, "parquet", self.fs).to_table([*columns, "__filename"])
            return found.rename_columns([*columns, "part"])
        return pa.concat_tables(self._read_here(part, columns) for part in parts)

    def _read_here(self, part: str, columns: Sequence[str]) -> pa.Table:
        """The same of one part, in this thread: one of Arrow's that is still in a storage's Python ends the program."""
        with self.fs.open(part, "rb") as file, pq.ParquetFile(file) as whole:
            there = [name for name in columns if name in whole.schema_arrow.names]
            found = whole.read(there, use_threads=False)
        rows = found.num_rows
        kept = [found[name] if name in there else pa.nulls(rows, SCHEMA.field(name).type) for name in columns]
        named = pa.array([part] * rows, pa.string())
        return pa.Table.from_arrays([*kept, named], [*columns, "part"])

    def tidy(self) -> None:
        """Join small parts, and drop rows that newer ones have replaced; a run that ends in it loses nothing.

        The joined part is written before the old ones go, so rows may be there twice for a moment: the newest counts.
        """
        for draft in self.fs.glob(f"{self.path}/{OWN}/part-{self.shard}-*.draft"):
            self.fs.rm_file(draft)
        parts = self.parts()
        if not parts:
            return
        every = self._read(parts, ["url", "done_utc"])
        kept = _newest(every)
        rows, live = (_counts(table["part"]) for table in (every, kept))
        stale = [part for part in parts if live.get(part, 0) < rows.get(part, 0)]
        small = [part for part in parts if rows.get(part, 0) < SMALL_ROWS]
        joined = sorted({*stale, *(small if len(small) > FEW else ())})
        for at in range(0, len(joined), TOGETHER):
            self._join(joined[at : at + TOGETHER], kept)

    def _join(self, parts: Sequence[str], kept: pa.Table) -> None:
        """One part with the rows of these that are ``kept``."""
        whole = _numbered(self._read(parts, SCHEMA.names))
        keys = ["url", "part", "done_utc"]
        live = whole.select([*keys, "at"]).join(kept.select(keys), keys, join_type="left semi")
        once = live.group_by("url", use_threads=False).aggregate([("at", "min")])["at_min"]
        if len(once):
            self._put(whole.take(once).select(SCHEMA.names))
        for part in parts:
            self._drop(part)

    def _drop(self, part: str) -> None:
        """Remove a part whose rows are in another; on Windows one that a program has open is left for the next run."""
        for _ in range(TRIES):
            try:
                self.fs.rm_file(part)
                return
            except PermissionError:
                time.sleep(PAUSE_S)
        log.info("%s is in use: the next run will remove it.", part)

    # -- What is left to do --------------------------------------------------------------------

    def index(self) -> pa.Table:
        """What is needed to tell what is done, of the newest row of every URL of this shard."""
        return self.table(_INDEX, own=True)

    def old(self, contents: Sequence[str]) -> dict[str, Json]:
        """Whole rows by content."""
        found = self.table(SCHEMA.names, Condition(("content",), pc.field("content").isin(list(contents))), own=True)
        return {row["content"]: row for row in found.to_pylist()}

    # -- The state of a run --------------------------------------------------------------------

    def write_state(self, state: Json) -> None:
        """Say how far this shard's run is."""
        self.fs.pipe_file(f"{self.path}/{OWN}/run-{self.shard}.json", json.dumps(state, indent=1).encode())

    def write_page(self, page: str) -> None:
        """Put the page for people."""
        self.fs.pipe_file(f"{self.path}/{PAGE}", page.encode())

    def states(self) -> dict[str, Json]:
        """The runs by shard; what is no state is passed over."""
        self.fs.invalidate_cache()
        found: dict[str, Json] = {}
        for name in sorted(self.fs.glob(f"{self.path}/{OWN}/run-*.json")):
            try:
                state = parse_json(self.fs.cat_file(name))
            except (TextError, OSError):  # being replaced this moment
                continue
            if isinstance(state, dict):
                found[name.rpartition("/run-")[2].removesuffix(".json")] = state
        return found


def _numbered(table: pa.Table) -> pa.Table:
    return table.append_column("at", pa.array(np.arange(len(table))))


def _newest(table: pa.Table) -> pa.Table:
    """The newest row of every URL."""
    order = _numbered(table.select(["url", "done_utc"])).sort_by([("done_utc", "descending"), ("at", "ascending")])
    first = order.group_by("url", use_threads=False).aggregate([("at", "first")])["at_first"]
    return table if len(first) == len(table) else table.take(first)


def _counts(column: pa.ChunkedArray) -> dict[str, int]:
    return {pair["values"]: pair["counts"] for pair in pc.value_counts(column).to_pylist()}


def left_to_do(inputs: pa.Table, index: pa.Table, recipe: str, where: pa.Table | None = None) -> pa.Table:
    """The inputs without a row that counts, with ``known``, the content hash that a row of this recipe has.

    A row counts that has the input's stamp and the recipe, unless the storage could not be reached for it.

    Parameters
    ----------
    inputs : pa.Table
        As `inputs.listed` gives them.
    index : pa.Table
        As :meth:`Dataset.index` gives it.
    recipe : str
        Digest of options, catalogue and version.
    where : pa.Table or None
        Rows whose URLs are done anew, and no others; None for all that is not done.
    """
    mine = index.filter(pc.equal(index["recipe"], recipe))
    if where is not None:
        left = inputs.join(where.select(["url"]), "url", join_type="left semi")
        return left.append_column("known", pa.nulls(len(left), pa.string())).sort_by("url")
    failed = pc.and_(pc.is_valid(mine["error"]), pc.invert(pc.fill_null(mine["quarantined"], False)))
    done = mine.filter(pc.invert(failed)).select(["url", "stamp"])
    left = inputs.join(done, ["url", "stamp"], join_type="left anti")
    measured = mine.filter(pc.and_(pc.is_valid(mine["content"]), pc.is_null(mine["error"])))
    left = left.join(measured.select(["url", "content"]), "url", join_type="left outer")
    # A file of that name and size that is no more where it was: moved, most likely.
    moved = _named(measured.join(inputs.select(["url"]), "url", join_type="left anti"))
    moved = moved.group_by(_NAMED).aggregate([("content", "min")]).rename_columns([*_NAMED, "moved"])
    left = _named(left).join(moved, _NAMED, join_type="left outer")
    known = pc.coalesce(left["content"], left["moved"])
    return left.select(INPUTS.names).append_column("known", known).sort_by("url")


_NAMED = ["name", "size_bytes"]


def _named(table: pa.Table) -> pa.Table:
    """With ``name``, the last part of the URL."""
    return table.append_column("name", pc.replace_substring_regex(table["url"], "^.*/", ""))


def condition_of(texts: Sequence[str]) -> Condition:
    """``solved=false``, ``fwhm_px>4``, ``error!=null``: all of them hold.

    Raises UsageError for another column, sign or value.
    """
    found = []
    for text in texts:
        match = _CONDITION.match(text)
        if match is None or match[1] not in SCHEMA.names:
            columns = ", ".join(SCHEMA.names)
            raise UsageError("--where {text} is not COLUMN=VALUE; columns: {columns}.", text=text, columns=columns)
        found.append((match[1], _compared(match[1], match[2], match[3], text)))
    return Condition(tuple(name for name, _ in found), reduce(and_, (one for _, one in found)))


def _compared(name: str, sign: str, value: str, text: str) -> "pc.Expression":
    column = pc.field(name)
    if value == "null" and sign in ("=", "!="):
        return column.is_null() if sign == "=" else column.is_valid()
    try:
        return _SIGNS[sign](column, pa.scalar(value).cast(SCHEMA.field(name).type))
    except pa.ArrowException:
        raise UsageError("--where {text}: {value} is no value of {name}.", text=text, value=value, name=name) from None
