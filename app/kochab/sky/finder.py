"""Find a star, an object, a body, a constellation or a position by what a person types.

The order is: coordinates; designations as catalogues and people spell them (``alf Ori``, ``Caldwell 14``,
``NGC-1976``); names; nicknames of ``catalogs/nicknames.tsv``; constellations; bodies of the Solar System tonight; names
without their last word (``Horsehead``). What is only like a name is suggested, never taken.
"""

import csv
import difflib
import math
import re
import unicodedata
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg, unit, unit_vectors
from kochab.core.errors import CatalogueError
from kochab.core.frame import Site
from kochab.core.progress import Task
from kochab.core.values import frozen
from kochab.parsing.places import parse_place
from kochab.sky.apparent import JD_UNIX, from_apparent, julian_date_tt, julian_years
from kochab.sky.catalogue import Catalogue, open_catalogue, shipped_folder
from kochab.sky.kinds import kind_in_words
from kochab.sky.landmarks import constellation_at, constellation_names
from kochab.sky.names import GENITIVES, GREEK, SkyObjects, StarNames, read_objects
from kochab.sky.solar_system import Body, Moving
from kochab.text.translation import tr

SUGGESTIONS = 5
NUMBER_AND_NAME = re.compile(r"([^()]+) \([^()]+\)")
ALTERNATIVES = 4


@frozen
class Found:
    """What a text means: ICRS degrees at J2000, of a body at the time that was asked for.

    ``kind`` is ``star``, ``position``, ``constellation``, ``place``, a body's kind or an object's as in
    ``catalogs/objects.tsv``. ``magnitude`` is NaN and ``size_arcmin`` None where it is unknown. ``sure`` is False where
    the text is not a name of it but a short form that others share, or a bare number: say what was taken.
    ``alternatives`` are others that the text may mean.
    """

    name: str
    kind: str
    ra_deg: float
    dec_deg: float
    magnitude: float = math.nan
    band: str = ""
    size_arcmin: tuple[float, float] | None = None
    position_angle_deg: float = math.nan
    sure: bool = True
    alternatives: tuple[str, ...] = ()

    @property
    def vector(self) -> Floats:
        """ICRS unit vector (3,)."""
        return unit_vectors(self.ra_deg, self.dec_deg)

    @property
    def constellation(self) -> str:
        """The constellation that it stands in."""
        return constellation_at(self.vector)


@frozen
class NotFound:
    """Nothing is called so; names that are like it, the likest first."""

    query: str
    suggestions: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """That nothing is called so, and what is called nearly so."""
        if self.suggestions:
            like = ", ".join(self.suggestions)
            return tr("Nothing is called {name}. Did you mean {like}?", name=self.query, like=like)
        if spelled(self.query) == "zenith":
            return tr("The zenith is another at each place: set the site.")
        return tr("Nothing in the catalogue is called {name}.", name=self.query)


class Entry(NamedTuple):
    """A row of the bright list, of the objects or of the nicknames; those of lower ``rank`` are better known."""

    table: str
    row: int
    rank: float


# -- How a name is spelled -----------------------------------------------------------------------

LETTERS = {name.casefold(): letter for letter, name in GREEK.items()}
LETTERS |= {name.casefold()[:3]: letter for letter, name in GREEK.items()}
LETTERS |= {"alf": "α", "tet": "θ", "the": "θ", "th": "θ", "ksi": "ξ", "mu.": "μ", "nu.": "ν", "xi.": "ξ", "pi.": "π"}
CATALOGUES = {
    **{
        name: name
        for name in ("ngc", "ic", "m", "c", "b", "sh2", "vdb", "rcw", "ldn", "lbn", "cr", "mel", "pgc", "ugc")
    },
    **{
        name: name
        for name in ("ced", "arp", "vv", "dwb", "tr", "stock", "ru", "pk", "abell", "hcg", "eso", "vdbh", "png")
    },
    "messier": "m",
    "n": "ngc",
    "caldwell": "c",
    "barnard": "b",
    "sharpless": "sh2",
    "sh": "sh2",
    "collinder": "cr",
    "col": "cr",
    "melotte": "mel",
    "trumpler": "tr",
    "ruprecht": "ru",
    "cederblad": "ced",
    "hickson": "hcg",
    "aco": "abell",
    "leda": "pgc",
    "lynds": "ldn",
    "snrg": "snrg",
}
"""Catalogues as people write them, and the one spelling of each."""
_NUMBERED = re.compile(r"([a-z][a-z ]*?[a-z]|[a-z])[\s.\-]*(?:2[\s\-]+(?=\d))?0*(\d[\d.+\-]*[a-z]?)")
_KINDS = frozenset(
    ("nebula", "galaxy", "cluster", "globular", "open", "planetary", "star", "region", "complex", "cloud")
)
_KINDS |= {"group", "pair", "remnant", "supernova", "snr"}


def spelled(text: str) -> str:
    """One spelling of a name: without case, accents, apostrophes, hyphens and spaces."""
    plain = text.replace("_", " ").casefold()
    if not plain.isascii():
        plain = unicodedata.normalize("NFKD", plain)
        plain = "".join(letter for letter in plain if not unicodedata.combining(letter))
    return re.sub(r"^the\b", "", re.sub(r"['’`´]", "", plain).strip()).translate(_SEPARATORS)


_SEPARATORS = str.maketrans("", "", " -.,\t")


def numbered(text: str) -> str:
    """``sh2155`` for Sharpless 155, Sh 2-155 and SH2-155; nothing where it is no catalogue's number."""
    if not any(letter.isdigit() for letter in text):
        return ""
    plain = unicodedata.normalize("NFKC", text.replace("_", " ")).casefold().strip()
    plain = re.sub(r"^sh[\s\-]*2[\s\-]*(?=\d)", "sh2 ", plain)
    if plain.startswith("sh2 "):
        return f"sh2{plain[4:].lstrip('0')}"
    found = _NUMBERED.fullmatch(plain)
    prefix = CATALOGUES.get(found[1].replace(" ", "")) if found is not None else None
    # ESO 097-013 is ESO 97-13
    return "" if prefix is None or found is None else prefix + re.sub(r"\s|(?<=-)0+(?=\d)", "", found[2])


def short_of(name: str) -> str:
    """A name without the words that say what it is: ``horsehead`` of Horsehead Nebula; nothing where none is left."""
    words = [word for word in re.split(r"\s+", name.casefold()) if word not in ("the", "great")]
    while words and words[-1] in _KINDS:
        words.pop()
    return spelled(" ".join(words))


# -- The index -----------------------------------------------------------------------------------


class Finder:
    """Every name of the shipped tables, read once."""

    def __init__(self, catalogue: Catalogue) -> None:
        self.catalogue = catalogue
        self.stars: StarNames = catalogue.names
        self.objects: SkyObjects = read_objects(shipped_folder() / "objects.tsv")

    @cached_property
    def nicknames(self) -> list[dict[str, str]]:
        """The rows of ``nicknames.tsv``."""
        path = shipped_folder() / "nicknames.tsv"
        try:
            with path.open(encoding="utf-8", newline="") as file:
                return [dict(row) for row in csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE)]
        except (OSError, ValueError):
            raise CatalogueError("The table of nicknames {path} is missing or damaged.", path=path) from None

    @cached_property
    def _keys(self) -> tuple[dict[str, list[Entry]], dict[str, list[Entry]], dict[str, str]]:
        """Entries by their names and by short forms, the best first; how each name is written."""
        names: dict[str, list[Entry]] = defaultdict(list)
        short: dict[str, list[Entry]] = defaultdict(list)
        written: dict[str, str] = {}
        for entry, texts, shown in self._entries():
            for text in texts:
                key = numbered(text) or spelled(text)
                if key and all(entry[:2] != other[:2] for other in names[key]):
                    names[key].append(entry)
                if shown and not any(letter.isdigit() for letter in text):
                    written.setdefault(key, text)
                    brief = short_of(text)
                    if brief and brief != key and all(entry[:2] != other[:2] for other in short[brief]):
                        short[brief].append(entry)
        for table in (names, short):
            for found in table.values():
                found.sort(key=lambda entry: (entry.table != "nickname", entry.rank))
        return names, short, written

    def _entries(self) -> Iterator[tuple[Entry, Sequence[str], bool]]:
        """Every entry with its names, and whether these are names that people say."""
        for row, nickname in enumerate(self.nicknames):
            yield Entry("nickname", row, float(nickname["mag"] or 0.0)), nickname["names"].split(";"), True
        objects = self.objects
        for row in range(len(objects.name)):
            mag = float(objects.mag[row])
            rank = (
                (mag if math.isfinite(mag) else 15.0)
                - 5.0 * bool(objects.messier[row])
                - 3.0 * bool(objects.common[row])
            )
            entry = Entry("object", row, rank)
            yield entry, (str(objects.name[row]), objects.designation(row)), False
            if also := str(objects.also[row]):
                yield entry, also.split(","), any(not re.search(r"\d", word) for word in also.split(","))
            if common := str(objects.common[row]):
                yield entry, common.split(","), True

    @cached_property
    def _star_names(self) -> dict[str, str]:
        """Proper names of stars as written, by their spelling."""
        return {spelled(name): name for name, _, _ in self.stars.table.values() if name}

    @cached_property
    def constellations(self) -> dict[str, tuple[str, Floats]]:
        """Name and middle, a unit vector (3,), by name, genitive and abbreviation as spelled."""
        inside: dict[str, list[Floats]] = defaultdict(list)
        full = constellation_names()
        figures = (shipped_folder() / "lines.tsv").read_text("utf-8").splitlines()[1:]
        numbers = self.stars.bright.column("hip")
        for line in figures:
            short, _, hips = line.partition("\t")
            rows = np.searchsorted(numbers, np.array([int(n) for n in hips.split()], dtype=numbers.dtype))
            turn = 360.0 / 2**32
            column = self.stars.bright.column
            inside[short.split()[0]].append(unit_vectors(column("ra")[rows] * turn, column("dec")[rows] * turn))
        found = {}
        for short, chains in inside.items():
            if short in full:
                middle = unit(np.concatenate(chains).mean(axis=0))
                for text in (full[short], GENITIVES.get(short, short), short):
                    found[spelled(text)] = (full[short], middle)
        return found

    # -- Looking up ------------------------------------------------------------------------------

    def still(self, text: str, year: float = 2000.0, whole: bool = False) -> Found | None:
        """What stands among the stars and is called so, at that Julian year; None when nothing is.

        With ``whole`` names without their last word (``Saturn`` for the Saturn Nebula) do not count.
        """
        place = parse_place(text)
        if place is not None:
            return Found(" ".join(text.split()), "position", *place)
        key = numbered(text) or spelled(text)
        if not key:
            return None
        names, short, _ = self._keys
        entries = list(names.get(key, ()))
        star = self._star(text)
        # A name that the table of stars has exactly is the star's, unless a nickname says otherwise.
        if star is not None and not (entries and entries[0].table == "nickname"):
            entries.insert(0, Entry("star", star, -9.0))
        if not entries and (constellation := self.constellations.get(spelled(text))) is not None:
            return Found(constellation[0], "constellation", *radec_deg(constellation[1]))
        sure = bool(entries)
        entries = entries or list(() if whole else short.get(spelled(text), ()))
        if not entries:  # as suggestions are written, M 31 (Andromeda Galaxy)
            written = NUMBER_AND_NAME.fullmatch(text.strip())
            return None if written is None else self.still(written[1], year, whole)
        others = self._described(entries[1 : 1 + ALTERNATIVES], entries[0])
        found = self.entry(entries[0], year)
        return replace(found, sure=sure or not others, alternatives=others)

    def _described(self, entries: Sequence[Entry], first: Entry) -> tuple[str, ...]:
        """The names of entries that stand elsewhere than the first."""
        here = self.entry(first)
        found = (self.entry(entry) for entry in entries)
        away = (one for one in found if float(one.vector @ here.vector) < math.cos(math.radians(0.5)))
        return tuple(dict.fromkeys(f"{one.name} ({kind_in_words(one.kind)})" for one in away))

    def _star(self, text: str) -> int | None:
        """The row of the bright list; of ``alf Ori``, ``th1 Ori``, ``61 Cygni`` as well."""
        words = text.casefold().replace("_", " ").split()
        if len(words) > 1 and (found := re.fullmatch(r"([a-z]{2,7}\.?)[-\s]?0?(\d?)", words[0])) is not None:
            letter = LETTERS.get(found[1]) or LETTERS.get(found[1].rstrip("."))
            if letter is not None:
                text = " ".join([letter + found[2], *text.split()[1:]])
        return self.stars.row_called(text)

    def entry(self, entry: Entry, year: float = 2000.0) -> Found:
        """All that is known of an entry."""
        if entry.table == "star":
            return self.star(entry.row, year)
        if entry.table == "object":
            return self.object(entry.row)
        nickname = self.nicknames[entry.row]
        name = nickname["names"].split(";")[0]
        if nickname["means"]:
            return self._meant(name, nickname["means"], year)
        place = float(nickname["ra_deg"]), float(nickname["dec_deg"])
        kind = {"*": "star"}.get(nickname["kind"], nickname["kind"])
        size = float(nickname["size_arcmin"] or "nan")
        extent = (size, size) if math.isfinite(size) else None
        return Found(name, kind, *place, float(nickname["mag"] or "nan"), "V" if nickname["mag"] else "", extent)

    def _meant(self, name: str, means: str, year: float) -> Found:
        """What the nickname ``name`` stands for: ``means`` is a designation, or ``constellation`` and its name."""
        if means.startswith("constellation "):
            full, middle = self.constellations[spelled(means.partition(" ")[2])]
            return Found(full, "constellation", *radec_deg(middle))
        star = self._star(means)
        objects = [entry for entry in self._keys[0].get(numbered(means), ()) if entry.table == "object"]
        if star is None and not objects:
            raise CatalogueError("The nickname {name} means nothing in the catalogue.", name=name)
        target = self.star(star, year) if star is not None else self.object(objects[0].row)
        plain = target.name.partition(" (")[0]
        return replace(target, name=f"{plain} ({name})" if spelled(name) not in spelled(target.name) else target.name)

    def star(self, row: int, year: float = 2000.0) -> Found:
        """A star of the bright list, its proper motion applied."""
        identifier, name = self.stars.label(row)
        vector = self.catalogue.vectors([self.catalogue.deep_row(row)], year)[0]
        mag = int(self.stars.bright.column("mag")[row]) * 1e-3
        return Found(name or identifier, "star", *radec_deg(vector), mag, "V")

    def object(self, row: int) -> Found:
        """A deep-sky object."""
        objects = self.objects
        major, minor = float(objects.major[row]), float(objects.minor[row])
        size = (major, minor if math.isfinite(minor) else major) if math.isfinite(major) else None
        name, mag = objects.title(row), float(objects.mag[row])
        place = radec_deg(objects.vector[row])
        return Found(
            name, str(objects.kind[row]), *place, mag, str(objects.band[row]), size, float(objects.pa_deg[row])
        )

    def like(self, text: str) -> tuple[str, ...]:
        """Names that are spelled nearly so."""
        wanted = spelled(text)
        grams = _grams(wanted)
        count: dict[str, int] = defaultdict(int)
        for gram in grams:
            for key in self._by_gram.get(gram, ()):
                count[key] += 1
        near = sorted(count, key=lambda key: count[key] / (len(grams) + len(key)), reverse=True)[:40]
        close = difflib.get_close_matches(wanted, near, SUGGESTIONS, 0.7)
        return tuple(dict.fromkeys(written for key in close for written in self._writings(key)))

    def named(self) -> Iterator[tuple[str, Entry, str]]:
        """Every spelling of an object's or a nickname's names, what it is a name of, and how it is written."""
        names, _, written = self._keys
        for key, entries in names.items():
            for entry in entries:
                yield key, entry, written.get(key, "")

    def _written(self, key: str) -> str:
        _, short, written = self._keys
        if key in short and key not in written:
            return self.entry(short[key][0]).name
        return written.get(key) or self._star_names.get(key) or key

    def _writings(self, key: str) -> Iterator[str]:
        """A constellation and an object may share a name: Andromeda."""
        if (constellation := self.constellations.get(key)) is not None:
            yield constellation[0]
        if constellation is None or key in self._keys[1] or key in self._keys[2]:
            yield self._written(key)

    @cached_property
    def _by_gram(self) -> dict[str, list[str]]:
        """Names that people say by each three letters in them."""
        found: dict[str, list[str]] = defaultdict(list)
        constellations = {spelled(name) for name, _ in self.constellations.values()}
        for key in {*self._keys[1], *self._keys[2], *self._star_names, *constellations}:
            for gram in _grams(key):
                found[gram].append(key)
        return found


def _grams(key: str) -> set[str]:
    return {key[at : at + 3] for at in range(max(1, len(key) - 2))}


@cache
def finder() -> Finder:
    """The shipped tables' index, made once in a process: most of a second of work."""
    index = Finder(open_catalogue())
    index.still("M 42")
    return index


# -- With the Solar System -----------------------------------------------------------------------

_OF_PLANET = {
    "phobos": "Mars",
    "deimos": "Mars",
    "miranda": "Uranus",
    "ariel": "Uranus",
    "umbriel": "Uranus",
    "titania": "Uranus",
    "oberon": "Uranus",
    "triton": "Neptune",
    "charon": "Pluto",
}
"""Moons that have no orbit here: they stand beside their planet, within half an arcminute."""
_NICKNAMED = {
    "halleyscomet": "1P/Halley",
    "halley": "1P/Halley",
    "cometencke": "2P/Encke",
    "neowise": "C/2020 F3 (NEOWISE)",
    "themoon": "Moon",
    "thesun": "Sun",
    "luna": "Moon",
    "chury": "67P/Churyumov-Gerasimenko",
    "devilcomet": "12P/Pons-Brooks",
}
_ARTICLES = re.compile(r"^(the|comet|asteroid)\s+", re.IGNORECASE)


def find(
    text: str, time_utc: datetime | None = None, site: Site | None = None, more: Sequence[Moving] = ()
) -> Task[Found | NotFound]:
    """What ``text`` means: a place of the sky, or what was meant instead.

    Parameters
    ----------
    text : str
        A name, number or position as a person types it.
    time_utc : datetime or None
        When bodies of the Solar System and the zenith are looked for; None: they are not.
    site : Site or None
        Where the observer stands; None: bodies are seen from the Earth's centre.
    more : Sequence[Moving]
        Tables of bodies besides the shipped ones, such as a person's own files of elements.
    """
    index = finder()
    clean = " ".join(text.split())
    year = 2000.0 if time_utc is None else julian_years(time_utc)
    if spelled(clean) == "zenith" and time_utc is not None and site is not None:
        return zenith(time_utc, site)
    still = index.still(clean, year, whole=True)
    if still is not None:
        return still
    body = None if time_utc is None else (yield from body_typed(clean, time_utc, site, more))
    return body or index.still(clean, year) or NotFound(clean, index.like(clean))


def zenith(time_utc: datetime, site: Site) -> Found:
    """The point overhead, to some arcseconds: UT1 is taken for UTC."""
    import erfa

    jd_utc = JD_UNIX + time_utc.timestamp() / 86400.0
    sidereal_deg = math.degrees(erfa.gst06a(jd_utc, 0.0, julian_date_tt(time_utc), 0.0)) + site.longitude_deg
    overhead = unit_vectors(sidereal_deg % 360.0, site.latitude_deg)
    return Found("Zenith", "place", *radec_deg(from_apparent(overhead[None], time_utc)[0]))


def body_typed(text: str, time_utc: datetime, site: Site | None, more: Sequence[Moving]) -> Task[Found | None]:
    """A body by its name, number or nickname: ``(1) Ceres``, ``433``, ``67P``, ``Halley's Comet``, ``the Moon``.

    Parameters
    ----------
    text : str
        What was typed, single blanks between its words.
    time_utc : datetime
        When it is looked for.
    site : Site or None
        Where the observer stands; None: the Earth's centre.
    more : Sequence[Moving]
        Tables of bodies besides the shipped ones.
    """
    from kochab.sky.small_bodies import body_called

    number = re.fullmatch(r"\(?(\d+)\)?\s*([^\d\s].*)?", text)
    host, called = _OF_PLANET.get(spelled(text), ""), _NICKNAMED.get(spelled(text), "")
    tries = [host or called] if host or called else [text, _ARTICLES.sub("", text)]
    if number is not None:
        tries += [f"{number[1]} {number[2]}", number[2]] if number[2] else [number[1]]
    for name in dict.fromkeys(tries):
        body: Body | None = yield from body_called(name, time_utc, site, more)
        if body is not None and host:
            return Found(f"{text.title()}, beside {body.name}", "moon of a planet", body.ra_deg, body.dec_deg)
        if body is not None:
            sure = number is None or bool(number[2]) or text.startswith("(")
            return Found(body.name, str(body.kind), body.ra_deg, body.dec_deg, body.magnitude, "V", sure=sure)
    return None
