"""How success, error and time change with what is wrong with a field.

The plots of the thesis "Lost in space for robotic telescopes", 2018: success against the number
of stars (figure 7.12) and the error margin (7.13), time against the number of stars (7.18); and
the same against noise, false and missing stars. Of detectors it is the stars found that count, of
estimators of the attitude the error.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from statistics import median
from typing import Any

from app.core.progress import Progress, Task
from app.workflows.laboratory import Choice, FieldWish, Trial, told_as
from app.workflows.laboratory_kinds import Kind, options_for
from app.workflows.laboratory_scene import Scene, tries_on

MakeScene = Callable[[FieldWish, Sequence[int]], Task[Scene]]
"""Makes a field, or a picture where detectors are compared."""


@dataclass(frozen=True, slots=True)
class Sweep:
    """One thing that is varied; ``option`` is that of a method, else it is one of the field's."""

    title: str
    unit: str
    values: tuple[float, ...]
    option: bool = False


SWEEPS: dict[str, Sweep] = {
    "noise_px": Sweep("Noise of a position", "px", (0.0, 0.25, 0.5, 1.0, 2.0, 4.0)),
    "false": Sweep("False stars", "", (0.0, 0.2, 0.4, 0.7, 1.0, 1.5)),
    "missing": Sweep("Missing stars", "", (0.0, 0.1, 0.2, 0.4, 0.6, 0.8)),
    "stars": Sweep("Number of stars", "", (4.0, 6.0, 8.0, 12.0, 16.0, 20.0, 30.0, 50.0)),
    "margin_px": Sweep("Error margin", "px", (0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 20.0), True),
}


def sweeps_of(kind: Kind) -> list[str]:
    """What is varied where these are compared."""
    return [name for name, sweep in SWEEPS.items() if kind is Kind.METHOD or not sweep.option]


@dataclass(frozen=True, slots=True)
class Point:
    """``right`` of ``fields`` answers were right and ``wrong`` were wrong at ``value``.

    ``found`` is the share of the true stars that a detector found; ``off_arcsec`` the median of
    how far the answers were off. Either is None where there is none. ``median_s`` is 0 where
    nothing could begin.
    """

    sweep: str
    value: float
    name: str
    fields: int
    right: int
    wrong: int
    median_s: float
    found: float | None = None
    off_arcsec: float | None = None

    @property
    def success(self) -> float:
        """Share of the fields that were answered rightly."""
        return self.right / self.fields


@dataclass(slots=True)
class _Tally:
    fields: int = 0
    right: int = 0
    wrong: int = 0
    true: int = 0
    there: int = 0
    seconds: list[float] = field(default_factory=list)
    off_arcsec: list[float] = field(default_factory=list)

    def count(self, trial: Trial) -> None:
        self.fields += 1
        self.right += bool(trial.right)
        self.wrong += trial.answered and not trial.right
        if trial.seconds > 0:
            self.seconds.append(trial.seconds)
        if trial.off_arcsec is not None:
            self.off_arcsec.append(trial.off_arcsec)
        if trial.found is not None:
            self.true += trial.found.true or 0
            self.there += trial.found.there or 0

    def point(self, sweep: str, value: float, name: str) -> Point:
        return Point(
            sweep, value, name, self.fields, self.right, self.wrong,
            median(self.seconds) if self.seconds else 0.0,
            self.true / self.there if self.there else None,
            median(self.off_arcsec) if self.off_arcsec else None,
        )  # fmt: skip


def curves(
    make_scene: MakeScene,
    wish: FieldWish,
    kind: Kind,
    choices: Sequence[Choice],
    sweeps: Sequence[str] | None = None,
    fields: int = 10,
    seed: int = 1,
    place_known: bool = False,
    limit_s: float = 10.0,
    tell: Callable[[Point], None] = lambda _: None,
) -> Task[list[Point]]:
    """Vary one thing at a time around ``wish`` and count answers; all see the same fields.

    Every round adds a field to every point, so that the curves may be looked at, and stopped, at
    any time. ``place_known`` gives the methods the place to 10 degrees besides the scale.
    """
    places = _in_turn(sweeps_of(kind) if sweeps is None else sweeps)
    tallies: dict[tuple[str, float, str], _Tally] = {}
    points: dict[tuple[str, float, str], Point] = {}
    for turn in range(fields):
        for number, (name, value) in enumerate(places):
            done = (turn + number / len(places)) / fields
            shown = f"{SWEEPS[name].title} {value:g} {SWEEPS[name].unit}".rstrip()
            yield Progress("laboratory", done, shown)
            at, varied = _varied(wish, kind, choices, name, value)
            if not varied:
                continue
            scene = yield from told_as(
                make_scene(at, (seed, turn, _place(name, value))), done, shown
            )
            making = tries_on(scene, kind, varied, scene.hint(True, place_known), limit_s)
            tries = yield from told_as(making, done, shown)
            for choice, task in zip(varied, tries, strict=True):
                key = name, value, choice.name
                trial = yield from told_as(task, done, f"{shown}: {choice.name}")
                tally = tallies.setdefault(key, _Tally())
                tally.count(trial)
                points[key] = tally.point(*key)
                tell(points[key])
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


def _varied(
    wish: FieldWish, kind: Kind, choices: Sequence[Choice], name: str, value: float
) -> tuple[FieldWish, list[Choice]]:
    """The field that is wanted and the choices for it: those without an option are left out."""
    if SWEEPS[name].option:
        having = [c for c in choices if any(o.name == name for o in options_for(kind, c.name))]
        return wish, [replace(c, options={**c.options, name: value}) for c in having]
    changed: dict[str, Any] = {name: int(value) if name == "stars" else value}
    return replace(wish, **changed), list(choices)


def _place(name: str, value: float) -> int:
    """A number of its own for each point; an option's points all see the same fields."""
    order = list(SWEEPS).index(name)
    return 100 * order + (0 if SWEEPS[name].option else SWEEPS[name].values.index(value))
