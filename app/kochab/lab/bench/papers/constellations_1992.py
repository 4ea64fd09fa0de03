"""The tables of the 1992 paper: Initial Estimate, Predictional Estimate, database and averages.

Liebe, "Pattern recognition of star constellations for spacecraft applications", IEEE Aerosp.
Electron. Syst. Mag. 7(6), 34: figures 2 and 18, tables 2, 3 and 4. The pictures are those of
:mod:`kochab.lab.bench.papers.fields_1992`; the default method solves the very same ones.

Readings. The paper gives the worst error of a star's place, 3 arcmin, but not how errors lie within
it: with three sigma of a normal law there, and the accuracy of an estimate taken as the RMS of its
two coordinates, averaged over the pictures, its 14.6 arcsec come out. Rows tell what the other
readings give: the RMS over all pictures, and errors spread evenly over the circle. A star "outside
the limits" is off by one to two times the worst error here; the paper does not say. In table 3
both know scale and lens, and that no star is off by more than 3 arcmin.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from kochab.attitude import small_rotation
from kochab.core.arrays import Floats
from kochab.core.frame import Hint
from kochab.core.progress import run
from kochab.core.solution import Identification, NoSolution, Solution
from kochab.identification.predictional_estimate import predictional_estimate
from kochab.lab.bench import timed
from kochab.lab.bench.papers import Published, options_with_scale, share_error
from kochab.lab.bench.papers import fields_1992 as fields
from kochab.lab.estimators import Averages
from kochab.lab.methods.neighbours import Neighbours
from kochab.simulate.random_fields import RandomField
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_detections

TABLES = Published("""
entries | table 4 | entries in the database | | 185000 | 111000
per star | figure 11 | entries a star, average | | 180 | 18 | | over all stars that may be seen
right | table 2 | right answers: {situation} | % | | | more |
stars | figure 2 | stars in a picture, average | | 18.9 | 0.9 | |
wrong | table 2 | wrong answers, all situations | % | | | | every answer has to pass the false-alarm bound
first time | table 4 | Initial Estimate, time | ms | 2000 | | less |
  paper: 386/387 at 33 MHz; default: all of it
first axis | table 4 | Initial Estimate, accuracy | deg | 0.1 | | less | the names are fitted by least squares
second time | table 4 | Predictional Estimate, time | ms | 500 | | less | paper: 386/387, 33 MHz
axis | table 3 | accuracy of the axis: {situation} | arcsec | | | less |
  Predictional Estimate answered {second:.1f} % (paper: 100 %),
  the default, knowing scale and lens as well, {knowing:.1f} %
pooled | table 3 | other reading: RMS over all pictures | arcsec | | | | sparse fields weigh more in it
disc | table 3 | other reading: errors even over the circle | arcsec | | | |
  not the paper's 14.6: the normal law is
averages | table 4 | accuracy after averages of {frames} | arcsec | | | less |
  sigma predicted from the covariance: {promised:.2f}
""")
PAPER_RUNS = 500
RIGHT_DEG = 0.5
COARSE_DEG = 0.1  # the mean error of the attitude a Predictional Estimate begins with (table 4)
ARCSEC_RAD = float(np.degrees(3600.0))


@dataclass(slots=True)
class _SuccessTally:
    """Answers of one method to many pictures: off the axis (2,) in arcsec, None for no answer."""

    off: list[Floats | None] = field(default_factory=list)
    stars: list[int] = field(default_factory=list)
    seconds: float = 0.0

    def add(self, one: RandomField, work: Callable[[RandomField], Floats | None]) -> None:
        """Let ``work`` find the camera's axis (3,) in ICRS."""
        axis, spent = timed(lambda: work(one))
        self.off.append(None if axis is None else _off_arcsec(one, axis))
        self.stars.append(one.stars)
        self.seconds += spent

    def share(self, right: bool) -> float:
        """Per cent of the pictures answered right, or answered wrong."""
        return 100.0 * sum(_right(o) == right for o in self.off if o is not None) / len(self.off)

    def accuracy(self, both: "_SuccessTally | None" = None, power: float = 1.0) -> float:
        """RMS of an answer's two coordinates, averaged over those that ``both`` answered right.

        ``power`` 2 gives the RMS over all of them instead.
        """
        others = self.off if both is None else both.off
        used = [_size(o) ** power for o, other in zip(self.off, others, strict=True) if _right(o) and _right(other)]
        return float(np.mean(used) ** (1.0 / power)) if used else float("nan")

    def ahead(self, other: "_SuccessTally") -> tuple[float, float]:
        """Mean of its errors minus ``other``'s, picture by picture, and that mean's own error."""
        gap = np.array(
            [_size(a) - _size(b) for a, b in zip(self.off, other.off, strict=True) if _right(a) and _right(b)]
        )
        if len(gap) < 2:
            return float("nan"), float("nan")
        return float(gap.mean()), float(gap.std(ddof=1) / np.sqrt(len(gap)))

    @property
    def milliseconds(self) -> float:
        """Processor time a picture."""
        return 1e3 * self.seconds / max(1, len(self.off))


def _right(off: Floats | None) -> bool:
    return off is not None and bool(np.hypot(*off) < 3600.0 * RIGHT_DEG)


def _size(off: Floats | None) -> float:
    """RMS of an answer's two coordinates."""
    return float("nan") if off is None else float(np.sqrt(np.mean(off**2)))


def _off_arcsec(one: RandomField, axis: Floats) -> Floats:
    """How far (2,) an axis is off along the camera's x and y, arcsec."""
    x, y, z = one.attitude.matrix @ axis
    return np.array([x, y]) / max(float(z), 1e-3) * ARCSEC_RAD


@dataclass(frozen=True, slots=True)
class _AxisCase:
    """One situation and what Initial Estimate, Predictional Estimate and default make of it.

    ``knowing`` is the default that knows its camera as the Predictional Estimate does.
    """

    situation: fields.CameraError
    first: _SuccessTally
    second: _SuccessTally
    default: _SuccessTally
    knowing: _SuccessTally


def rows(quick: bool, seed: int) -> list[dict[str, Any]]:
    """Every row: the paper's figure, ours, and the default method's on the same pictures."""
    count = 50 if quick else PAPER_RUNS
    out = _database_rows()
    everything: list[_AxisCase] = []
    for number, situation in enumerate(fields.SITUATIONS):
        rng = np.random.default_rng([seed, 1992, number])
        first, second, default, known = _SuccessTally(), _SuccessTally(), _SuccessTally(), _SuccessTally()
        for _ in range(count):
            one = fields.picture(rng, situation)
            first.add(one, initial_axis)
            second.add(one, lambda p, r=rng: predicted_axis(p, r))  # type: ignore[misc]
            default.add(one, default_axis)
            known.add(one, knowing_axis)
        everything.append(_AxisCase(situation, first, second, default, known))
    for case in everything:
        right, what = case.first.share(True), case.situation
        paper, error = what.paper_percent, share_error(what.paper_percent, count, PAPER_RUNS)
        theirs = case.default.share(True)
        out.append(TABLES.row("right", right, theirs, situation=what.name, paper=paper, error=error))
    out += _wrong_and_time_rows(everything)
    out += [_accuracy_row(case, count) for case in everything]
    pooled = [tally.accuracy(power=2.0) for tally in (everything[0].second, everything[0].knowing)]
    out.append(TABLES.row("pooled", pooled[0], pooled[1]))
    rng, even = np.random.default_rng([seed, 1992, 99]), _SuccessTally()
    for _ in range(count):
        even.add(fields.picture(rng, fields.SITUATIONS[0], "disc"), lambda p: predicted_axis(p, rng))
    out.append(TABLES.row("disc", even.accuracy()))
    return out + _average_rows(seed, 10 if quick else 100)


def initial_axis(one: RandomField) -> Floats | None:
    """The axis by the Initial Estimate."""
    found = run(Neighbours(circle=True).identify(one.detections, _scale()))
    return found.attitude.boresight if isinstance(found, Identification) else None


def predicted_axis(one: RandomField, rng: np.random.Generator) -> Floats | None:
    """The axis by the Predictional Estimate, from a prediction as coarse as the paper's."""
    coarse = small_rotation(rng.normal(0.0, np.radians(COARSE_DEG) / 1.25, 3))
    worst = _worst_px(one)
    found = predictional_estimate(
        one.camera, coarse @ one.attitude.matrix, one.detections.xy, _near(one), 8.0, closest_px=worst, worst_px=worst
    )
    return None if found is None else found.attitude.boresight


def _worst_px(one: RandomField) -> float:
    return float(np.radians(fields.WORST_ARCMIN / 60.0)) * one.camera.focal_px


def default_axis(one: RandomField) -> Floats | None:
    """The axis as the default method solves the same list of stars."""
    return _solved_axis(one, SolveOptions(hint=_scale(), blind_after_hint=False))


def knowing_axis(one: RandomField) -> Floats | None:
    """The same by the default with what the Predictional Estimate knows of its camera.

    That is its scale, that it does not distort, and how far off a star may be at worst.
    """
    known = replace(options_with_scale(fields.camera().scale_arcsec_px), distortion=False, worst_px=_worst_px(one))
    return _solved_axis(one, known)


def _solved_axis(one: RandomField, options: SolveOptions) -> Floats | None:
    found: Solution | NoSolution = run(solve_detections(one.detections, options))
    return found.centre_vector if isinstance(found, Solution) else None


def _near(one: RandomField) -> Floats:
    """The expected constellation: unit vectors (N, 3) of the stars in and around the picture."""
    vectors = fields.sky().vectors
    near = vectors @ one.attitude.boresight > np.cos(np.radians(fields.HALF_DEG + 1.0))
    return np.asarray(vectors[near])


def _scale() -> Hint:
    scale = fields.camera().scale_arcsec_px
    return Hint(scale_arcsec_px=(scale / 1.05, scale * 1.05))


def _database_rows() -> list[dict[str, Any]]:
    table, doubled = Neighbours().table(), Neighbours(angle_errors=2.0).table()
    merged = Neighbours(double_deg=0.0, exchange=0.0).table()
    note = (
        f"{len(table.rows)} stars (paper 1539); angle's error as in figure 11: {len(doubled)};"
        f" without doubles and exchange: {len(merged)}; {table.nbytes / 1e6:.1f} MB"
    )
    return [TABLES.row("entries", len(table), note=note), TABLES.row("per star", table.per_star)]


def _wrong_and_time_rows(everything: Sequence[_AxisCase]) -> list[dict[str, Any]]:
    tallies = [[c.first for c in everything], [c.second for c in everything], [c.default for c in everything]]
    wrong = [float(np.mean([t.share(False) for t in tallies[k]])) for k in (0, 2)]
    spent = [float(np.mean([t.milliseconds for t in some])) for some in tallies]
    axis = float(np.mean([t.accuracy() for t in tallies[0]])) / 3600.0
    theirs = float(np.mean([t.accuracy() for t in tallies[2]])) / 3600.0
    stars = float(np.mean(everything[0].first.stars))
    better = "less" if max(wrong) > 0 else ""
    return [
        TABLES.row("stars", stars),
        TABLES.row("wrong", wrong[0], wrong[1], better=better),
        TABLES.row("first time", spent[0], spent[2]),
        TABLES.row("first axis", axis, theirs),
        TABLES.row("second time", spent[1]),
    ]


def _accuracy_row(case: _AxisCase, count: int) -> dict[str, Any]:
    what = case.situation
    return TABLES.row(
        "axis",
        case.second.accuracy(case.knowing),
        case.knowing.accuracy(case.second),
        situation=what.name,
        second=case.second.share(True),
        knowing=case.knowing.share(True),
        paper=what.paper_arcsec,
        paired=case.knowing.ahead(case.second),
        error=2.0 * what.paper_arcsec / np.sqrt(2.0 * min(count, PAPER_RUNS)),
    )


def _average_rows(seed: int, trials: int) -> list[dict[str, Any]]:
    """Averages of N estimates of one field; what is left against sigma over the root of N."""
    out = []
    for frames, paper in ((60, 2.0), (225, 1.0)):
        left, promised = averaged(seed, frames, trials)
        error = 2.0 * paper / np.sqrt(4.0 * trials)
        out.append(TABLES.row("averages", left, frames=frames, promised=promised, paper=paper, error=error))
    return out


def averaged(seed: int, frames: int, trials: int) -> tuple[float, float]:
    """Accuracy of averages of ``frames`` estimates, arcsec, and the sigma they promise."""
    rng = np.random.default_rng([seed, 1992, frames])
    left, promised = [], []
    for _ in range(trials):
        total, near = Averages(), None
        for one in fields.repeated(rng, frames):
            near = _near(one) if near is None else near
            found = predictional_estimate(
                one.camera, one.attitude.matrix, one.detections.xy, near, 2.0, closest_px=1.0, worst_px=1.0
            )
            if found is not None:
                total.add(found.attitude)
        mean = total.mean()
        left.append(_off_arcsec(one, mean.boresight))
        promised.append(mean.sigma_arcsec[:2])
    each = np.sqrt(np.mean(np.square(left), axis=1))
    return float(each.mean()), float(np.sqrt(np.mean(np.square(promised))))
