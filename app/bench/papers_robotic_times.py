"""Table 7.3 and figure 7.18 of "Lost in space" for robotic telescopes: seconds a stage.

Both methods are timed from the detections' pixels to the stars' names, in a loop of nothing else:
the least time of several counts. With fewer than six stars voting names none (figure 7.12) and the
product's refuses at once: how long its votes for nothing take is told, but is no time to beat.
"""

from functools import partial
from typing import Any

import numpy as np

from app.attitude import make_estimator
from app.bench.papers_default import name
from app.bench.papers_robotic_fields import (
    MAG_LIMIT,
    MARGIN_PX,
    STARS,
    fields,
    options,
    pairs_of,
    plain,
)
from app.bench.papers_row import fastest, row, timed
from app.core.progress import run
from app.core.solution import NoSolution, Solution
from app.identify.pairs import bright_stars, make_pairs
from app.identify.refusals import table_deg
from app.identify.voting import FEWEST, recognise, verification_votes
from app.simulate.fields import Field
from app.solve.solver import solve_detections

WHOLE_S = 18.15


def rows(count: int, seed: int) -> list[dict[str, Any]]:
    """The times of the thesis, ours, and the default's on the same fields."""
    return [_row(stars, fields(count, seed, brightest=stars)) for stars in STARS] + _stages(
        fields(count, seed)
    )


def _row(stars: int, made: list[Field]) -> dict[str, Any]:
    times = 1e3 * np.array([_naming_s(field) for field in made])
    ours, theirs = np.median(times, axis=0).tolist()
    ahead = times[:, 1] - times[:, 0]
    error = float(ahead.std(ddof=1)) / len(made) ** 0.5
    named = stars >= FEWEST
    return row(
        "7.18", f"time of matching with {stars} stars", unit="ms",
        paper=1e3 * WHOLE_S if stars == 15 else None, ours=ours, default=theirs,
        paired=(float(ahead.mean()), error),
        better="less" if named else "",
        note="the thesis: its whole program" if named else "voting names no star of so few",
    )  # fmt: skip


def _naming_s(field: Field) -> tuple[float, float]:
    """Seconds by voting, and by the default."""
    told = options(field)
    return fastest(partial(_vote, field)), fastest(partial(name, field.detections, told))


def _solve(field: Field) -> Solution | NoSolution:
    return run(solve_detections(field.detections, options(field)))


def _vote(field: Field) -> tuple[Any, ...]:
    body = plain(field).unproject(field.detections.xy)
    return recognise(body, pairs_of(field), MARGIN_PX / field.camera.focal_px)


def _stages(made: list[Field]) -> list[dict[str, Any]]:
    """Table 7.3, but for centroiding and for showing the picture."""
    first = made[0]
    camera, angle = plain(first), table_deg(first.detections, first.camera.focal_px)
    stars = bright_stars(None, MAG_LIMIT, 2016.0)
    _, tables = timed(lambda: make_pairs(*stars, float(np.radians(angle))))
    voting = float(np.median([fastest(partial(_vote, field)) for field in made]))
    kept, star, _ = _vote(first)
    xy, vectors = first.detections.xy[kept], pairs_of(first).vectors[star]
    body, valid = camera.unproject(xy), np.ones(len(kept), dtype=np.bool_)
    error, triad = MARGIN_PX / camera.focal_px, make_estimator("triad")
    verifying = fastest(lambda: verification_votes(body, vectors, valid, error))
    pointing = fastest(lambda: triad.estimate(xy, vectors, camera))
    default = float(np.median([timed(partial(_solve, field))[1] for field in made]))
    return [
        row("7.3", "time, voting and verification", unit="s", paper=13.50, ours=voting,
            better="less"),
        row("7.3", "time, verification alone", unit="s", paper=1.21, ours=verifying,
            better="less"),
        row("7.3", "time, attitude", unit="s", paper=0.77, ours=pointing, better="less",
            note="TRIAD"),
        row("7.3", "time, table operations", unit="s", paper=1.81, ours=tables, better="less",
            note="the pair table is made once and kept"),
        row("7.3", "time, matching and attitude in all", unit="s", paper=16.08,
            ours=voting + tables + pointing, default=default, better="less",
            note="without centroiding and display; the default's whole solve"),
    ]  # fmt: skip
