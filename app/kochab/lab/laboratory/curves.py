"""How success, error and time change with what is wrong with a field; as curves and as CSV.

The plots of the thesis "Lost in space for robotic telescopes", 2018: success against the number of stars (figure
7.12) and the error margin (7.13), time against the number of stars (7.18); and the same against noise, false and
missing stars. Of detectors it is the stars found that count, of estimators of the attitude the error.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import astuple, replace
from itertools import zip_longest
from statistics import median
from typing import Any

from kochab.core.progress import Progress, Task
from kochab.core.registry import options_of
from kochab.core.values import frozen
from kochab.frames.export import csv_text
from kochab.lab.laboratory.comparison import REGISTRIES, Choice, ComparedPart, Trial, with_progress
from kochab.lab.laboratory.scene import simulated_scene, tries_on
from kochab.simulate.random_fields import FieldPlan


@frozen
class ParameterSweep:
    """One thing that is varied; ``option`` is that of a method, else it is one of the field's."""

    title: str
    unit: str
    values: tuple[float, ...]
    option: bool = False


SWEEPS: dict[str, ParameterSweep] = {
    "noise_px": ParameterSweep("Noise of a position", "px", (0.0, 0.25, 0.5, 1.0, 2.0, 4.0)),
    "false": ParameterSweep("False stars", "", (0.0, 0.2, 0.4, 0.7, 1.0, 1.5)),
    "missing": ParameterSweep("Missing stars", "", (0.0, 0.1, 0.2, 0.4, 0.6, 0.8)),
    "stars": ParameterSweep("Number of stars", "", (4.0, 6.0, 8.0, 12.0, 16.0, 20.0, 30.0, 50.0)),
    "margin_px": ParameterSweep("Error margin", "px", (0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 20.0), True),
}
PLANNED_AS = {"false": "spurious", "stars": "brightest"}  # what the simulator calls them


def sweeps_of(kind: ComparedPart) -> list[str]:
    """What is varied where these are compared."""
    return [name for name, sweep in SWEEPS.items() if kind is ComparedPart.METHOD or not sweep.option]


@frozen
class Point:
    """``right`` of ``fields`` answers were right and ``wrong`` were wrong at ``value``.

    ``found`` is the share of the true stars that a detector found; ``off_arcsec`` the median of how far the answers
    were off. Either is None where there is none. ``median_s`` is 0 where nothing could begin.
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

    @classmethod
    def of(cls, sweep: str, value: float, name: str, trials: Sequence[Trial]) -> "Point":
        """What the trials at one value come to.

        Parameters
        ----------
        sweep : str
            What is varied.
        value : float
            To what.
        name : str
            Of the method.
        trials : Sequence[Trial]
            Those at this value.
        """
        seconds = [t.seconds for t in trials if t.seconds > 0]
        off = [t.off_arcsec for t in trials if t.off_arcsec is not None]
        scores = [t.found for t in trials if t.found is not None]
        true, there = sum(s.true or 0 for s in scores), sum(s.there or 0 for s in scores)
        right, wrong = sum(bool(t.right) for t in trials), sum(t.answered and not t.right for t in trials)
        return cls(
            *(sweep, value, name, len(trials), right, wrong),
            median_s=median(seconds) if seconds else 0.0,
            found=true / there if there else None,
            off_arcsec=median(off) if off else None,
        )


def curves(
    plan: FieldPlan,
    kind: ComparedPart,
    choices: Sequence[Choice],
    sweeps: Sequence[str] | None = None,
    fields: int = 10,
    seed: int = 1,
    place_known: bool = False,
    limit_s: float = 10.0,
    tell: Callable[[Point], None] = lambda _: None,
) -> Task[list[Point]]:
    """Vary one thing at a time and count answers; all see the same fields.

    Every round adds a field to every point, so that the curves may be looked at, and stopped, at any time.

    Parameters
    ----------
    plan : FieldPlan
        The field that is varied.
    kind : ComparedPart
        Methods, detectors or estimators.
    choices : Sequence[Choice]
        Those to compare.
    sweeps : Sequence[str] or None
        What is varied; None: all that suits the kind.
    fields : int
        How many for each point.
    seed : int
        Draws them.
    place_known : bool
        Give the methods the place to 10 degrees besides the scale.
    limit_s : float
        The longest trial.
    tell : Callable[[Point], None]
        Called with every point that has grown.
    """
    chosen = sweeps_of(kind) if sweeps is None else sweeps
    columns = zip_longest(*([(name, value) for value in SWEEPS[name].values] for name in chosen))
    # the first value of every sweep, then the second ...: all curves grow at the same time
    places = [place for column in columns for place in column if place is not None]
    trials: dict[tuple[str, float, str], list[Trial]] = {}
    points: dict[tuple[str, float, str], Point] = {}
    for turn in range(fields):
        for number, (name, value) in enumerate(places):
            done = (turn + number / len(places)) / fields
            shown = f"{SWEEPS[name].title} {value:g} {SWEEPS[name].unit}".rstrip()
            yield Progress("laboratory", done, shown)
            at, varied = plan, list(choices)
            if SWEEPS[name].option:  # methods without that option are left out
                known = {c.name: options_of(REGISTRIES[kind].load(c.name)) for c in choices}
                having = [c for c in choices if name in (option.name for option in known[c.name])]
                varied = [replace(c, options={**c.options, name: value}) for c in having]
            else:
                changed: dict[str, Any] = {PLANNED_AS.get(name, name): int(value) if name == "stars" else value}
                at = replace(plan, **changed)
            if not varied:
                continue
            scene = yield from with_progress(simulated_scene(kind, at, (seed, turn, _place(name, value))), done, shown)
            making = tries_on(scene, kind, varied, scene.hint(True, place_known), limit_s)
            tries = yield from with_progress(making, done, shown)
            for choice, task in zip(varied, tries, strict=True):
                key = name, value, choice.name
                trial = yield from with_progress(task, done, f"{shown}: {choice.name}")
                trials.setdefault(key, []).append(trial)
                points[key] = Point.of(*key, trials[key])
                tell(points[key])
    return list(points.values())


def _place(name: str, value: float) -> int:
    """A number of its own for each point; an option's points all see the same fields."""
    order = list(SWEEPS).index(name)
    return 100 * order + (0 if SWEEPS[name].option else SWEEPS[name].values.index(value))


# -- What the Laboratory found, as CSV for a spreadsheet ---------------------------------------

TRIALS = (
    *("compared", "name", "answered", "right", "ra_deg", "dec_deg", "off_arcsec"),
    *("stars_found", "stars_true", "stars_there", "place_error_px", "matches", "wrong"),
    *("from_fit_arcsec", "from_fit_roll_arcsec", "time_ms", "tables_ms", "rms_px"),
    *("sigma_x_arcsec", "sigma_y_arcsec", "sigma_roll_arcsec", "log10_false_alarm"),
    *("reason", "tried", "paper"),
)
POINTS = (
    *("varied", "unit", "value", "name", "fields", "right", "wrong", "success", "found"),
    *("off_arcsec", "median_ms"),
)


def trials_csv(trials: Iterable[Trial]) -> str:
    """A line for each; what is not known is empty."""
    return _csv(TRIALS, map(_trial, trials))


def _trial(t: Trial) -> Sequence[object]:
    place = (f"{angle:.7f}" for angle in t.ra_dec_deg or ())
    found = astuple(t.found) if t.found else ("",) * 4
    times = 1e3 * t.seconds, 1e3 * t.tables_s
    start = t.kind, t.name, t.answered, t.right, *(place if t.ra_dec_deg else ("", "")), t.off_arcsec
    fit = *found, t.matches, t.wrong, *(t.from_fit_arcsec or ("", "")), *times, t.rms_px
    return *start, *fit, *(t.sigma_arcsec or ("",) * 3), t.log10_false_alarm, t.reason, t.advice, t.paper


def points_csv(points: Iterable[Point]) -> str:
    """A line for each point of each curve, in the order of the curves."""
    order = list(SWEEPS)
    rows = []
    for p in sorted(points, key=lambda p: (order.index(p.sweep), p.name, p.value)):
        counts = p.fields, p.right, p.wrong, p.success
        place = p.sweep, SWEEPS[p.sweep].unit, p.value, p.name
        rows.append((*place, *counts, p.found, p.off_arcsec, 1e3 * p.median_s))
    return _csv(POINTS, rows)


def _csv(names: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    return csv_text([names, *([_cell(value) for value in row] for row in rows)])


def _cell(value: object) -> object:
    """What stands for a value; None is left empty."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else value
