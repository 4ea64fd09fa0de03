"""One run over an archive: chunks of what is left, rows as they come, parts of the dataset, and how far it is."""

import math
import os
import platform
import time
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import field
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from kochab.core import __version__
from kochab.core.arrays import Array
from kochab.core.errors import UsageError
from kochab.core.progress import Progress
from kochab.core.values import frozen, mutable
from kochab.text.duration_text import duration_text
from kochab.workflows.archive.dataset import Dataset
from kochab.workflows.archive.inputs import Item, items_of
from kochab.workflows.archive.row import Recipe, Session
from kochab.workflows.archive.status import is_fresh, page_of, summary_of
from kochab.workflows.solution_json import Json

PART_ROWS, PART_S, STATE_S, PAGE_S = 10_000, 60.0, 5.0, 30.0
PAGE_SHARE = 0.02
"""At most this fraction of the time is spent on the page. It reads all rows: 2 to 4 s for a million."""
CHUNK_S, MOST_ITEMS = 5.0, 500
"""A chunk takes so long: what a worker that is lost has to do again."""
SHARE = 4
"""Of what is left a worker is given so small a part at a time, so that all end together (two chunks wait for each)."""
SESSIONS = 1000
"""Folders whose last frame is remembered."""


@frozen
class Chunk:
    """Inputs of one folder for one worker; ``known`` are the hashes that their rows have, "" without."""

    items: tuple[Item, ...]
    known: tuple[str, ...]
    recipe: Recipe
    session: Session | None = None

    def alone(self) -> "list[Chunk]":
        """A chunk an input."""
        pairs = zip(self.items, self.known, strict=True)
        return [Chunk((item,), (known,), self.recipe, self.session) for item, known in pairs]


@frozen
class Outcome:
    """The rows of a chunk, and what its last frame tells of the next."""

    folder: str
    rows: list[Json]
    session: Session | None = None


@mutable
class Run:
    """What of ``total`` inputs is left to do, ``left`` as `dataset.left_to_do` gives it, and what came of it.

    ``index`` are the rows that are there; ``workers`` is told in the state, ``hands`` how many work at once.
    """

    dataset: Dataset
    recipe: Recipe
    total: int
    left: pa.Table
    index: pa.Table
    workers: str = "1"
    most_items: int = MOST_ITEMS
    hands: int = 1
    done: int = 0
    solved: int = 0
    failed: int = 0
    cpu_s: float = 0.0
    read_bytes: int = 0
    _rows: list[Json] = field(default_factory=list)
    _unchanged: list[Json] = field(default_factory=list)
    _sessions: "OrderedDict[str, Session]" = field(default_factory=OrderedDict)
    _there: Array = field(init=False)
    _new: set[int] = field(default_factory=set)
    _started: float = field(default_factory=time.monotonic)
    _since: datetime = field(default_factory=lambda: datetime.now(UTC))
    _mean_s: float = 0.5
    _told: dict[str, float] = field(default_factory=lambda: {"page": -math.inf})  # the first page is written at once
    _page_s: float = 0.0

    def __post_init__(self) -> None:
        others = self.index.filter(pc.is_valid(self.index["content"])).select(["url", "content"])
        others = others.join(self.left.select(["url"]), "url", join_type="left anti")
        self._there = np.sort(np.array([_short(c) for c in others["content"].to_pylist()], dtype=np.uint64))

    # -- What goes out -------------------------------------------------------------------------

    def chunks(self) -> Iterator[Chunk]:
        """What is left, folder by folder; each chunk is made when it is asked for, with what is known by then."""
        waiting: list[tuple[Item, str]] = []
        given = 0
        known = (value or "" for batch in self.left.to_batches(50_000) for value in batch["known"].to_pylist())
        for pair in zip(items_of(self.left), known, strict=True):
            if waiting and (waiting[0][0].folder != pair[0].folder or len(waiting) >= self._chunk_items(given)):
                yield self._chunk(waiting)
                given += len(waiting)
                waiting = []
            waiting.append(pair)
        if waiting:
            yield self._chunk(waiting)

    def _chunk_items(self, given: int) -> int:
        """How many inputs the next chunk has at most, after so many were given out (guided self-scheduling)."""
        share = -(-(len(self.left) - given) // (SHARE * self.hands))
        return int(np.clip(CHUNK_S / max(self._mean_s, 1e-4), 1, min(self.most_items, share)))

    def _chunk(self, pairs: list[tuple[Item, str]]) -> Chunk:
        items, known = zip(*pairs, strict=True)
        return Chunk(items, known, self.recipe, self._sessions.get(items[0].folder))

    # -- What comes back -----------------------------------------------------------------------

    def take(self, outcome: Outcome) -> None:
        """Keep the rows of a chunk; those gathered become a part now and then."""
        if outcome.session is not None:
            self._sessions[outcome.folder] = outcome.session
            self._sessions.move_to_end(outcome.folder)
            if len(self._sessions) > SESSIONS:
                self._sessions.popitem(last=False)
        for row in outcome.rows:
            self.done += 1
            if row.get("unchanged"):
                self._unchanged.append(row)
                continue
            if row["recipe"] != self.recipe.digest:
                raise UsageError(
                    "A worker has another version or star catalogue than this computer: have the same everywhere."
                )
            self.solved += bool(row["solved"])
            self.failed += row.get("error") is not None
            self.cpu_s += row.get("cpu_s") or 0.0
            self.read_bytes += row.get("read_bytes") or 0
            if wall := row.get("wall_s"):
                self._mean_s += 0.05 * (wall - self._mean_s)
            row["copy"] = self._is_copy(row.get("content"))
            self._rows.append(row)
        if len(self._rows) + len(self._unchanged) >= PART_ROWS or self._due("part", PART_S):
            self.flush()
        if self._due("state", STATE_S):
            self.tell("running")

    def _is_copy(self, content: str | None) -> bool:
        """Whether another file of the dataset has this content; 64 bits of it are compared."""
        if content is None:
            return False
        value = _short(content)
        at = int(np.searchsorted(self._there, np.uint64(value)))
        there = value in self._new or (at < len(self._there) and int(self._there[at]) == value)
        self._new.add(value)
        return there

    def flush(self) -> None:
        """Write what is gathered as a part."""
        if self._unchanged:
            old = self.dataset.old([row["content"] for row in self._unchanged])
            for row in self._unchanged:
                fresh = {name: row[name] for name in ("url", "stamp", "table_row", "width", "height")}
                fresh = {name: value for name, value in fresh.items() if value or name not in ("width", "height")}
                there = old[row["content"]]
                fresh |= {"done_utc": datetime.now(UTC), "copy": there["copy"] or there["url"] != row["url"]}
                self._rows.append(there | fresh)
        if self._rows:
            self.dataset.write(self._rows)
        self._rows, self._unchanged = [], []

    def _due(self, what: str, every_s: float) -> bool:
        """Whether ``every_s`` have passed since this was last due, or since the run began."""
        now = time.monotonic()
        if now - self._told.setdefault(what, self._started) < every_s:
            return False
        self._told[what] = now
        return True

    # -- How far it is -------------------------------------------------------------------------

    @property
    def progress(self) -> Progress:
        """For a line on the terminal."""
        left = len(self.left)
        text = f"{self.done} of {left}, {self.solved} solved"
        text += f", {self.failed} failed" if self.failed else ""
        if self.done:
            text += f", {self.rate:.3g} a second, {duration_text((left - self.done) / self.rate)} left"
        return Progress("solve", self.done / max(left, 1), text)

    @property
    def rate(self) -> float:
        """Inputs a second since the beginning."""
        return self.done / max(time.monotonic() - self._started, 1e-3)

    def state(self, word: str) -> Json:
        """What `Dataset.write_state` keeps; ``word`` is running, stopped or done."""
        return {
            **{"state": word, "host": platform.node(), "pid": os.getpid(), "version": __version__},
            **{"started_utc": self._since.isoformat(), "updated_utc": datetime.now(UTC).isoformat()},
            **{"inputs": self.total, "to_do": len(self.left), "done": self.done, "solved": self.solved},
            **{"failed": self.failed, "rate_s": self.rate, "workers": self.workers, "recipe": self.recipe.digest},
            **{"cpu_s": self.cpu_s, "read_bytes": self.read_bytes},
        }

    def tell(self, word: str) -> None:
        """Write the state, and now and then, or at the end, the page."""
        self.dataset.write_state(self.state(word))
        if word != "running" or self._due("page", max(PAGE_S, self._page_s / PAGE_SHARE)):
            began = time.monotonic()
            self.dataset.write_page(page_of(summary_of(self.dataset), self.dataset.url))
            self._page_s = time.monotonic() - began


def other_run(dataset: Dataset) -> Json | None:
    """A run of the same shard that is under way, by another process that still lives as far as we can tell."""
    state = dataset.states().get(dataset.shard)
    if state is None or state.get("state") != "running" or not is_fresh(state):
        return None
    if state.get("host") == platform.node() and not _lives(state.get("pid")):
        return None
    return state


def _lives(pid: Any) -> bool:
    """Whether a process is there; without its number it is taken to be."""
    from psutil import pid_exists

    return not isinstance(pid, int) or bool(pid_exists(pid))


def _short(content: str) -> int:
    return int(content[:16], 16)
