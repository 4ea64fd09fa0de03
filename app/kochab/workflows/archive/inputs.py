"""What an archive is made of: folders, globs and URLs of frames, tables of URLs, star lists.

Every input is a row with its URL and a stamp, what the storage says of its content without reading it: the size, and
the ETag or the time of the last change. An input with the stamp that its row in the dataset has is not read again.
"""

import csv
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import fsspec
import pyarrow as pa
import pyarrow.parquet as pq

from kochab.core.errors import UsageError
from kochab.core.progress import Progress, Task
from kochab.core.values import frozen
from kochab.frames import named_as_frame
from kochab.parsing.text_input import LARGEST_BYTES, decoded

SCHEMA = pa.schema(
    [
        ("url", pa.string()),
        ("stamp", pa.string()),
        ("size_bytes", pa.int64()),
        ("table_row", pa.int64()),
        ("width", pa.int32()),
        ("height", pa.int32()),
    ]
)
TABLES = (".csv", ".tsv", ".txt", ".parquet")
BATCH = 50_000
LIST_COLUMNS = ("x", "y", "width", "height")
"""Of a Parquet table that holds star lists: x and y are lists, px; ``flux`` may be there."""


@frozen
class Item:
    """One input: a frame, or a list of stars of a frame of ``width`` and ``height`` px (0 for frames).

    ``table_row`` is the row of the list in the Parquet table at the URL before ``#``; -1 for files of their own.
    """

    url: str
    stamp: str
    size_bytes: int
    table_row: int = -1
    width: int = 0
    height: int = 0

    @property
    def file(self) -> str:
        """What sentences call it."""
        return self.url

    @property
    def source(self) -> str:
        """The URL that is opened."""
        return self.url.rpartition("#")[0] if self.table_row >= 0 else self.url

    @property
    def folder(self) -> str:
        """Where its session lies: its folder, or its table."""
        return self.source if self.table_row >= 0 else self.url.rpartition("/")[0]


def opened(url: str) -> tuple[Any, str]:
    """The file system of a URL, and its path there; UsageError where a package or a protocol is missing."""
    try:
        fs, path = fsspec.core.url_to_fs(url)
    except ImportError as error:  # "Install s3fs to access S3"
        raise UsageError("{url}: {why}.", url=url, why=str(error).rstrip(".")) from None
    except ValueError as error:
        raise UsageError("{url} cannot be used: {why}.", url=url, why=str(error).rstrip(".")) from None
    return fs, path


def is_local(fs: Any) -> bool:
    """Whether a file system is this computer's."""
    return "file" in (fs.protocol if isinstance(fs.protocol, tuple) else (fs.protocol,))


def listed(given: Sequence[str], size: tuple[int, int] | None, shard: tuple[int, int] = (0, 1)) -> Task[pa.Table]:
    """All inputs as a table of :data:`SCHEMA`, sorted by URL, each once.

    Raises UsageError for an input that is not there, or has nothing in it.

    Parameters
    ----------
    given : Sequence[str]
        Files, folders, globs and URLs of frames; tables of URLs (a column ``url``) or of star lists.
    size : (width, height) or None
        Of the frames of star lists, px; with it every CSV is a star list, without it a table of URLs.
    shard : (k, n)
        The k-th of n parts, k from 0, told by the URL alone.
    """
    batches: list[pa.RecordBatch] = []
    rows: list[tuple[Any, ...]] = []
    for text in given:
        count = 0
        for item in _items(text, size):
            count += 1
            if zlib.crc32(item.url.encode()) % shard[1] == shard[0]:
                rows.append((item.url, item.stamp, item.size_bytes, item.table_row, item.width, item.height))
            if count % 1000 == 0:
                yield Progress("list", None, f"{count} in {text}")
            if len(rows) >= BATCH:
                batches.append(_batch(rows))
                rows.clear()
        if not count:
            raise UsageError("{text} has no frames.", text=text)
    batches.append(_batch(rows))
    once = pa.Table.from_batches(batches, SCHEMA).group_by("url", use_threads=False)
    table = once.aggregate([(name, "first") for name in SCHEMA.names[1:]]).rename_columns(SCHEMA.names)
    return table.sort_by("url")


def items_of(table: pa.Table) -> Iterator[Item]:
    """The inputs of a table of :data:`SCHEMA`."""
    for batch in table.select(SCHEMA.names).to_batches(BATCH):
        yield from (Item(**row) for row in batch.to_pylist())


def _batch(rows: Iterable[tuple[Any, ...]]) -> pa.RecordBatch:
    columns = list(zip(*rows, strict=True)) or [()] * len(SCHEMA)
    return pa.RecordBatch.from_arrays(
        [pa.array(column, kind) for column, kind in zip(columns, SCHEMA.types, strict=True)], schema=SCHEMA
    )


def _items(text: str, size: tuple[int, int] | None) -> Iterator[Item]:
    """The inputs that one argument names."""
    fs, path = opened(text)
    try:
        if fs.isdir(path):
            found = fs.find(path, detail=True)
            yield from (_item(fs, info, size) for _, info in sorted(found.items()) if _is_input(info["name"], size))
        elif fs.exists(path):  # before a pattern: a file may really be called M42[1].fits
            yield from _file(fs, fs.info(path), text, size)
        elif set(text) & set("*?["):
            found = fs.glob(path, detail=True)
            for name, info in sorted(found.items()):
                if info.get("type") == "file" and _is_input(name, size):
                    yield _item(fs, info, size)
        else:
            raise UsageError("{text} does not exist.", text=text)
    except OSError as error:
        raise UsageError("{text} cannot be read: {why}.", text=text, why=error.strerror or error) from None


def _is_input(name: str, size: tuple[int, int] | None) -> bool:
    """Whether a file in a folder is a frame by its name, or, with ``size``, a star list."""
    return named_as_frame(name) or (size is not None and name.lower().endswith(".csv"))


def _item(fs: Any, info: Mapping[str, Any], size: tuple[int, int] | None) -> Item:
    width, height = size if size and str(info["name"]).lower().endswith(".csv") else (0, 0)
    return Item(str(fs.unstrip_protocol(info["name"])), stamp_of(info), int(info.get("size") or 0), -1, width, height)


def stamp_of(info: Mapping[str, Any]) -> str:
    """What a storage says of a file's content without reading it."""
    names = ("ETag", "etag", "mtime", "LastModified", "last_modified", "created")
    changed = next((info[name] for name in names if info.get(name)), "")
    return f"{info.get('size')}-{changed}".replace('"', "")


def _file(fs: Any, info: Mapping[str, Any], text: str, size: tuple[int, int] | None) -> Iterator[Item]:
    """One file: a frame, a star list, or a table of either."""
    name = str(info["name"])
    ending = f".{name.lower().rpartition('.')[2]}"
    if ending == ".parquet":
        yield from _parquet(fs, info, text, size)
    elif ending in TABLES and not (size and ending == ".csv"):
        yield from _of_urls(_csv_rows(fs, info, text), text, size)
    else:
        yield _item(fs, info, size)


def _csv_rows(fs: Any, info: Mapping[str, Any], text: str) -> Iterator[Mapping[str, Any]]:
    """The rows of a table of URLs; a table without a header is one URL a line."""
    if (info.get("size") or 0) > 40 * LARGEST_BYTES:
        raise UsageError("{text} is too large for a text table: write it as Parquet.", text=text)
    lines = decoded(fs.cat_file(info["name"]), text).splitlines()
    first = lines[0] if lines else ""
    comma = "\t" if "\t" in first else ","
    if "url" in [cell.strip().lower() for cell in first.split(comma)]:
        reader = csv.DictReader(lines, delimiter=comma)
        reader.fieldnames = [name.strip().lower() for name in reader.fieldnames or ()]
        yield from reader
    else:
        yield from ({"url": line.strip()} for line in lines if line.strip() and not line.startswith("#"))


def _parquet(fs: Any, info: Mapping[str, Any], text: str, size: tuple[int, int] | None) -> Iterator[Item]:
    """A table of star lists where it has x and y, else of URLs."""
    try:
        with fs.open(info["name"], "rb") as file, pq.ParquetFile(file) as table:
            names = set(table.schema_arrow.names)
            if set(LIST_COLUMNS) <= names:
                url, stamp, at = str(fs.unstrip_protocol(info["name"])), stamp_of(info), 0
                for batch in table.iter_batches(BATCH, columns=["width", "height"]):
                    for width, height in zip(*(column.to_pylist() for column in batch.columns), strict=True):
                        yield Item(f"{url}#{at:09d}", stamp, 0, at, int(width or 0), int(height or 0))
                        at += 1
            elif "url" in names:
                wanted = [name for name in ("url", "width", "height") if name in names]
                for batch in table.iter_batches(BATCH, columns=wanted):
                    yield from _of_urls(batch.to_pylist(), text, size)
            else:
                raise UsageError("{text} has neither a column url nor x, y, width and height.", text=text)
    except pa.ArrowException as error:
        raise UsageError("{text} is a damaged table: {why}.", text=text, why=str(error).splitlines()[0]) from None


def _of_urls(rows: Iterable[Mapping[str, Any]], text: str, size: tuple[int, int] | None) -> Iterator[Item]:
    """The inputs that a table names; they are not asked for their dates, so that a million costs no request."""
    for number, row in enumerate(rows, 1):
        url = str(row.get("url") or "").strip()
        if not url:
            raise UsageError("{text}: row {number} has no URL.", text=text, number=number)
        width, height = (_pixels(row.get(name), text, number) for name in ("width", "height"))
        if size and not (width and height) and url.lower().endswith(".csv"):
            width, height = size
        if "://" not in url:
            fs, path = opened(url)
            url = str(fs.unstrip_protocol(path))
        yield Item(url, "", 0, -1, width, height)


def _pixels(value: Any, text: str, number: int) -> int:
    try:
        return int(value or 0)
    except (TypeError, ValueError):
        raise UsageError(
            "{text}: row {number} has a size that is no number of pixels.", text=text, number=number
        ) from None
