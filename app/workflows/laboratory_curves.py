"""How success and time of the methods change with what is wrong with a field.

The plots of the thesis "Lost in space for robotic telescopes", 2018: success against the number
of stars (figure 7.12) and the error margin (7.13), time against the number of stars (7.18); and,
for every method, success against noise, false and missing stars.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from statistics import median
from typing import Any

from app.core.progress import Progress, Task
from app.workflows.laboratory import (
    Choice,
    FieldWish,
    MakeField,
    TrueField,
    Truth,
    scale_hint,
    told_as,
)
from app.workflows.laboratory_kinds import Kind, options_for
from app.workflows.laboratory_methods import try_method

PLACE_DEG = 10.0


@dataclass(frozen=True, slots=True)
class Sweep:
    """One thing that is varied; ``option`` is that of a method, else it is one of the field's."""

    title: str
    unit: str
    values: tuple[float, ...]
    option: bool = False


SWEEPS: dict[str, Sweep] = {
    "noise_px": Sweep("Noise of a position", "px", (0.0, 0.25, 0.5, 1.0, 2.0, 4.0)),
    "false": Sweep("False stars, of the real ones", "", (0.0, 0.2, 0.4, 0.7, 1.0, 1.5)),
    "missing": Sweep("Missing stars", "", (0.0, 0.1, 0.2, 0.4, 0.6, 0.8)),
    "stars": Sweep("Number of stars", "", (4.0, 6.0, 8.0, 12.0, 16.0, 20.0, 30.0, 50.0)),
    "margin_px": Sweep("Error margin", "px", (0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 20.0), True),
}


@dataclass(frozen=True, slots=True)
class Point:
    """``right`` of ``fields`` answers were right and ``wrong`` were wrong at ``value``."""

    sweep: str
    value: float
    method: str
    fields: int
    right: int
    wrong: int
    median_s: float

    @property
    def success(self) -> float:
        """Share of the fields that were answered rightly."""
        return self.right / self.fields


@dataclass(slots=True)
class _Tally:
    right: int = 0
    wrong: int = 0
    seconds: list[float] = field(default_factory=list)

    def point(self, sweep: str, value: float, method: str) -> Point:
        middle = median(self.seconds)
        return Point(sweep, value, method, len(self.seconds), self.right, self.wrong, middle)


def curves(
    make_field: MakeField,
    wish: FieldWish,
    choices: Sequence[Choice],
    sweeps: Sequence[str] = tuple(SWEEPS),
    fields: int = 10,
    seed: int = 1,
    place_known: bool = False,
    limit_s: float = 10.0,
    tell: Callable[[Point], None] = lambda _: None,
) -> Task[list[Point]]:
    """Vary one thing at a time around ``wish`` and count answers; all methods see the same fields.

    Every round adds a field to every point, so that the curves may be looked at, and stopped, at
    any time. ``place_known`` gives the methods the place to 10 degrees besides the scale.
    """
    jobs = [
        (name, value, choice)
        for name, value in _in_turn(sweeps)
        for choice in choices
        if not SWEEPS[name].option or _has(choice, name)
    ]
    tallies = {(name, value, choice.name): _Tally() for name, value, choice in jobs}
    points: dict[tuple[str, float, str], Point] = {}
    made: tuple[object, TrueField] | None = None
    for turn in range(fields):
        for number, (name, value, choice) in enumerate(jobs):
            done = (turn + number / len(jobs)) / fields
            shown = f"{SWEEPS[name].title} {value:g} {SWEEPS[name].unit}".rstrip()
            yield Progress("laboratory", done, f"{shown}: {choice.name}")
            at, varied = _varied(wish, choice, name, value)
            seeds = (seed, turn, _place(name, value))
            if made is None or made[0] != (at, seeds):
                made = ((at, seeds), make_field(at, seeds))
            one = made[1]
            truth = Truth.of(one, at)
            hint = scale_hint(truth, PLACE_DEG if place_known else None)
            task = try_method(one.detections, varied, hint, truth, limit_s=limit_s)
            trial = yield from told_as(task, done, shown)
            tally = tallies[name, value, choice.name]
            tally.right += bool(trial.right)
            tally.wrong += trial.answered and not trial.right
            tally.seconds.append(trial.seconds)
            point = tally.point(name, value, choice.name)
            points[name, value, choice.name] = point
            tell(point)
    return list(points.values())


def _in_turn(sweeps: Sequence[str]) -> list[tuple[str, float]]:
    """The first value of every sweep, then the second ...: all curves grow at the same time."""
    longest = max((len(SWEEPS[name].values) for name in sweeps), default=0)
    return [
        (name, SWEEPS[name].values[k])
        for k in range(longest)
        for name in sweeps
        if k < len(SWEEPS[name].values)
    ]


def _has(choice: Choice, option: str) -> bool:
    return any(known.name == option for known in options_for(Kind.METHOD, choice.name))


def _varied(wish: FieldWish, choice: Choice, name: str, value: float) -> tuple[FieldWish, Choice]:
    if SWEEPS[name].option:
        return wish, Choice(choice.name, {**choice.options, name: value})
    if name == "stars":
        return replace(wish, stars=int(value)), choice
    changed: dict[str, Any] = {name: value}
    return replace(wish, **changed), choice


def _place(name: str, value: float) -> int:
    """A number of its own for each point; an option's points all see the same fields."""
    order = list(SWEEPS).index(name)
    return 100 * order + (0 if SWEEPS[name].option else SWEEPS[name].values.index(value))
