"""What the search palette lists, in three groups: this frame, the whole sky, and commands."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from PySide6.QtGui import QAction, QKeySequence

from kochab.core.arrays import Floats
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.parsing.places import parse_place
from kochab.sky.completion import Completion
from kochab.sky.finder import Found, spelled
from kochab.sky.horizon import Horizon
from kochab.sky.kinds import kind_in_words
from kochab.sky.names import UNSAID
from kochab.sky.solar_system import Body
from kochab.text.angle_text import angle_text
from kochab.text.translation import number, tr, tr_noop
from kochab.window.frame.search import away

FRAME, SKY, COMMANDS, MEANT = (
    tr_noop("In this frame"),
    tr_noop("In the sky"),
    tr_noop("Commands"),
    tr_noop("Did you mean"),
)
MOST = {FRAME: 6, SKY: 8, COMMANDS: 5}
SPARE = 3  # times as many are looked at: several names may be of one thing
WORDS = 3  # letters from which on a command is found by any word of its tip too


@frozen(eq=False)
class Result:
    """A line of the palette: a place of the sky, ICRS unit vector (3,), px ``xy`` in the open frame, or a command."""

    group: str
    title: str
    detail: str = ""
    side: str = ""  # at the right end
    vector: Floats | None = None
    xy: tuple[float, float] | None = None
    action: QAction | None = None


@frozen
class Surroundings:
    """What results are seen from: the open frame's solution, where the observer stands now, the bodies then."""

    solution: Solution | None = None
    horizon: Horizon | None = None
    bodies: Sequence[Body] = ()

    def pixel(self, vector: Floats) -> tuple[float, float] | None:
        """Where a place (3,) is in the open frame, px; None outside it."""
        s = self.solution
        if s is None or float(vector @ s.centre_vector) < 0.0:
            return None
        x, y = s.pixels_of(vector[None])[0].tolist()
        inside = -0.5 <= x < s.camera.width - 0.5 and -0.5 <= y < s.camera.height - 0.5
        return (x, y) if inside else None

    def side(self, vector: Floats) -> str:
        """How far from the frame, and how high it stands now."""
        words = [away(self.solution, vector)] if self.solution is not None else []
        if self.horizon is not None:
            altitude = self.horizon.altaz_deg(vector)[0]
            words.append(
                tr("below the horizon") if altitude < 0.0 else tr("alt {angle}°", angle=number(altitude, ".0f"))
            )
        return " · ".join(words)

    def result(self, found: Found, written: str = "", group: str = "") -> Result:
        """The line of something found; ``written`` is the name that it was found by."""
        xy = self.pixel(found.vector)
        title, _, common = found.name.partition(" (")
        common = common.removesuffix(")")
        also = written if spelled(written) not in spelled(found.name) else ""
        numbered = any(letter.isdigit() for letter in title)
        if common and numbered and found.kind != "position":  # as people say it, its number after it
            title, common = common, title
        elif also and title.startswith(UNSAID):
            title, also = also, title
        size = angle_text(max(found.size_arcmin) / 60.0) if found.size_arcmin else ""
        band = tr("mag") if found.band in ("", "?") else found.band
        mag = f"{band} {number(found.magnitude, '.1f')}" if math.isfinite(found.magnitude) else ""
        kind = kind_in_words(found.kind)
        detail = " · ".join(filter(None, (common, also, kind, mag, size)))
        side = self.side(found.vector) if xy is None else ""
        return Result(group or (FRAME if xy else SKY), title, detail, side, found.vector, xy)


def sky_results(text: str, names: Completion, around: Surroundings) -> list[Result]:
    """What begins as a text does, and the position that it is; those of the open frame first."""
    place, solution = parse_place(text), around.solution
    if place is not None:
        return [around.result(Found(" ".join(text.split()), "position", *place))]
    near = []
    if solution is not None:
        reach = np.radians(max(solution.camera.fov_deg))  # more than half the diagonal
        near = names.beginning(text, SPARE * MOST[FRAME], solution.centre_vector, reach)
    bodies = [b for b in around.bodies if spelled(b.name).startswith(spelled(text))]
    found = [
        Found(b.name, str(b.kind), b.ra_deg, b.dec_deg, b.magnitude, "V" if math.isfinite(b.magnitude) else "")
        for b in bodies
    ]
    lines = [around.result(one) for one in found]
    lines += (around.result(names.found(c), c.written) for c in near if around.pixel(c.vector) is not None)
    lines += (around.result(names.found(c), c.written) for c in names.beginning(text, SPARE * MOST[SKY]))
    return _first(lines)


def _first(lines: Sequence[Result]) -> list[Result]:
    """As many of each group as are shown, each thing once."""
    kept: dict[str, list[Result]] = {FRAME: [], SKY: []}
    for line in lines:
        group = kept[line.group]
        if len(group) < MOST[line.group] and not any(_same(line, other) for other in group):
            group.append(line)
    return kept[FRAME] + kept[SKY]


def _same(one: Result, other: Result) -> bool:
    """Whether two names are of one thing: within 20″, or a nickname's place and its object's with one number."""
    assert one.vector is not None
    assert other.vector is not None
    near = float(np.linalg.norm(one.vector - other.vector)) < 1e-4
    return near or (one.title == other.title and float(one.vector @ other.vector) > 0.9999)


def command_results(text: str, actions: Mapping[str, QAction]) -> list[Result]:
    """Commands with a word that begins so, those that begin so themselves first; with their keys."""
    wanted, found = text.strip().casefold(), list[tuple[int, str, Result]]()
    for name, action in actions.items():
        # A row of a menu of exports says little without the menu.
        title = action.toolTip() if name.startswith("export_") else action.text().replace("&", "").rstrip("…")
        rank = _command_rank(wanted, name, title, action.toolTip())
        if rank is not None and action.isEnabled():
            keys = action.shortcut().toString(QKeySequence.SequenceFormat.NativeText)
            on = tr("on") if action.isCheckable() and action.isChecked() else ""
            found.append((rank, title, Result(COMMANDS, title, on, keys, action=action)))
    return [line for *_, line in sorted(found, key=lambda row: row[:2])[: MOST[COMMANDS]]]


def _command_rank(wanted: str, name: str, title: str, tip: str) -> int | None:
    """How well a command suits: by its title, a later word of it, its English name, or a word of its tip."""
    if not wanted:
        return None
    title, words = title.casefold(), tip.casefold().split()
    if title.startswith(wanted):
        return 0
    if any(f" {wanted}" in f" {text}" for text in (title, name.replace("_", " "))):
        return 1
    return 2 if len(wanted) >= WORDS and any(word.startswith(wanted) for word in words) else None


def meant_results(names: Sequence[str], known: Callable[[str], Found | None], around: Surroundings) -> Iterator[Result]:
    """What nearly-so spelled names are of."""
    for name in names:
        if (found := known(name)) is not None:
            yield around.result(found, name, MEANT)
