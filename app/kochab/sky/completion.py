"""What begins as a person types: names of stars, objects and constellations from the first letter on.

:mod:`kochab.sky.finder` answers what a whole text means; this lists, at every key, what it may become.
"""

from bisect import bisect_left
from collections.abc import Iterator
from functools import cache

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg, unit_vectors
from kochab.core.values import frozen
from kochab.sky.finder import CATALOGUES, Entry, Finder, Found, finder, numbered, spelled
from kochab.sky.names import GREEK

PROPER = 4.0  # magnitudes by which a star with a name of its own is better known than one with a letter
INSIDE = 2.0  # by which a name that begins with another word comes later
TAIL = 3  # letters that the end of a name has at least
CONSTELLATION = -3.0  # as well known as a bright Messier object
LAST = "\U0010ffff"  # sorts behind every letter


@frozen
class Candidate:
    """Something whose name begins as the text does; ``written`` is that name, empty of a catalogue's number."""

    entry: Entry
    written: str
    vector: Floats


class Completion:
    """The names of a finder, sorted, with what each is a name of.

    ``_keys`` are sorted spellings; ``_of`` (K,) the index of each one's entry, ``_rank`` (K,) how well known that is
    under this name, as a magnitude; ``_vectors`` (N, 3) where the entries stand, ICRS at J2000.
    """

    def __init__(self, index: Finder) -> None:
        self._finder = index
        self._entries: list[Entry] = []
        self._names = list(index.constellations.values())
        known: dict[tuple[str, int], int] = {}
        rows: list[tuple[str, int, float, str]] = []
        for key, entry, written, later in self._spellings():
            at = known.setdefault(entry[:2], len(self._entries))
            if at == len(self._entries):
                self._entries.append(entry)
            rows.append((key, at, entry.rank + later, written))
        rows.sort()
        self._keys = [key for key, *_ in rows]
        self._of = np.array([at for _, at, *_ in rows])
        self._rank = np.array([rank for _, _, rank, _ in rows])
        self._written = [written for *_, written in rows]
        self._vectors = self._places()

    def _spellings(self) -> Iterator[tuple[str, Entry, str, float]]:
        """Every spelling: its entry, the name as written, and by how much less known it is under this name."""
        for key, entry, written in self._finder.named():
            yield key, entry, written, 0.0
            words = written.split()
            for k in range(1, len(words)):  # Orion Nebula of Great Orion Nebula, but not A of Taurus A
                if len(tail := spelled(" ".join(words[k:]))) >= TAIL:
                    yield tail, entry, written, INSIDE
        stars = self._finder.stars
        numbers, mags = stars.bright.column("hip"), stars.bright.column("mag")
        first = np.searchsorted(numbers, np.array([*stars.table], dtype=numbers.dtype))
        for row, (name, designation, also) in zip(first.tolist(), stars.table.values(), strict=True):
            mag = int(mags[row]) * 1e-3
            entry = Entry("star", row, mag - PROPER * bool(name))
            for written in filter(None, (name, designation, *also.split(";"))):
                yield spelled(written), entry, written, 0.0
                letter = GREEK.get(written[0])
                if letter:
                    yield spelled(letter + written[1:]), entry, written, 0.0
        for row, (spelling, (full, _)) in enumerate(self._finder.constellations.items()):
            yield spelling, Entry("constellation", self._first(full, row), CONSTELLATION), full, 0.0

    def _first(self, full: str, row: int) -> int:
        """A constellation has three spellings, and is one entry."""
        return next(k for k in range(row + 1) if self._names[k][0] == full)

    def _places(self) -> Floats:
        """Where the entries stand (N, 3)."""
        column = self._finder.stars.bright.column
        found = np.zeros((len(self._entries), 3))
        for k, entry in enumerate(self._entries):
            if entry.table == "object":
                found[k] = self._finder.objects.vector[entry.row]
            elif entry.table == "constellation":
                found[k] = self._names[entry.row][1]
            elif entry.table == "nickname":
                found[k] = self._finder.entry(entry).vector
        rows = np.array([entry.row if entry.table == "star" else -1 for entry in self._entries])
        stars, turn = rows >= 0, 360.0 / 2**32
        at = rows[stars]
        found[stars] = unit_vectors(column("ra")[at] * turn, column("dec")[at] * turn)
        return found

    def beginning(self, text: str, most: int, centre: Floats | None = None, radius_rad: float = 0.0) -> list[Candidate]:
        """What has a name that begins so, the best known first; a whole name goes before those that it begins.

        Parameters
        ----------
        text : str
            What was typed so far.
        most : int
            How many at most.
        centre : Floats or None
            ICRS unit vector (3,), where only what stands around it is wanted; None: the whole sky.
        radius_rad : float
            How far around it.
        """
        wanted = _typed(text)
        if not wanted:
            return []
        begin = bisect_left(self._keys, wanted)
        end = bisect_left(self._keys, wanted + LAST)
        whole = bisect_left(self._keys, wanted + "\0")
        at = np.arange(begin, end)
        if centre is not None:
            at = at[self._vectors[self._of[at]] @ centre > np.cos(radius_rad)]
        order = np.lexsort((self._rank[at], at >= whole))
        return [
            Candidate(self._entries[n], self._written[k], self._vectors[n])
            for n, k in _once(self._of[at[order]], at[order], most)
        ]

    def found(self, candidate: Candidate, year: float = 2000.0) -> Found:
        """All that is known of it."""
        entry = candidate.entry
        if entry.table != "constellation":
            return self._finder.entry(entry, year)
        return Found(self._names[entry.row][0], "constellation", *radec_deg(candidate.vector))


def _typed(text: str) -> str:
    """The beginning of a name as names are spelled; ``Messier 4`` begins M 42, and ``sh 2`` begins Sh 2-155."""
    plain = " ".join(text.split())
    key = numbered(plain) or spelled(plain)
    return CATALOGUES[key] if len(key) > 3 and key in CATALOGUES else key


def _once(of: NDArray[np.int_], at: NDArray[np.int_], most: int) -> Iterator[tuple[int, int]]:
    """The first ``most`` different entries of sorted names (K,), each with its name's place."""
    seen: set[int] = set()
    for n, k in zip(of.tolist(), at.tolist(), strict=True):
        if n not in seen:
            if len(seen) == most:
                return
            seen.add(n)
            yield n, k


@cache
def completion() -> Completion:
    """That of the shipped tables, made once in a process: a second of work beside the finder's own."""
    return Completion(finder())
