"""Whether a solution is off by as much as it says: on rendered fields, and on crops of real frames.

By construction a rendered field's noise is that of its pixels, its lens has one term of distortion and its axis beside
the middle, as real ones have, and its stars are where the catalogue has them; only the centroids, the matches and the
fit are put to the test. A crop about the middle of a real frame has the lens, the sky and the mistakes of a real one:
what it says of its centre is held against the whole frame. Both share the stars of the middle, a sixth or a quarter
of the frame: the more they share the smaller is their difference, and at three quarters of a side it proves too much.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.errors import KochabError
from kochab.core.frame import Frame, Hint
from kochab.core.progress import run as drive
from kochab.core.solution import Solution
from kochab.frames import read_frame
from kochab.lab.bench import Goal, Report, Row
from kochab.simulate.random_fields import FieldPlan, random_picture
from kochab.sky import open_catalogue
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_frame

SEED = 20260402
FIELDS_DEG = (1.0, 3.0, 10.0, 30.0)
RENDERED = FieldPlan(0, noise_px=0.15, axis_off=0.01)
BESIDE, BESIDE_DEG = "rendered, many stars", (12.0,)
WITHIN = {"within_68": (1.0, 0.6827), "within_95": (1.959964, 0.95)}
POINTS = 3.0
CROPS = (0.4, 0.5)
J2000 = datetime(2000, 1, 1, 12, tzinfo=UTC)
"""The date of rendered fields: undated ones are solved for another, and their stars move together."""
REAL = Path(__file__).resolve().parents[5] / "shared" / "frames"
"""Real photographs beside a checkout; without them there is no row."""


def sigma_rows(quick: bool, report: Report) -> list[dict[str, Any]]:
    """A row each for rendered fields and, where there are any, crops of real frames."""
    report("uncertainties of rendered fields ...")
    rows = _rows("rendered", _rendered(6 if quick else 250))
    denser = replace(RENDERED, brightest=500)
    rows += _rows(BESIDE, _rendered(10 if quick else 400, BESIDE_DEG, denser))
    if REAL.is_dir():
        report("uncertainties of crops of real frames ...")
        rows += _rows("crops of real frames", _crops(8 if quick else None))
    return rows


def sigma_goals(rows: Sequence[Row]) -> list[Goal]:
    """How far the shares are from 68 and 95 %, in points, beyond two sampling errors."""
    goals = []
    for name in ("rendered", BESIDE, "crops of real frames"):
        mine = [r for r in rows if r["fields"] == name and "within_68" in r]
        off = [_points_off(r[key], share, r["n"]) for r in mine for key, (_, share) in WITHIN.items()]
        goals.append(Goal.at_most(f"points off 68 and 95 %, {name}", max(off) if off else None, POINTS))
    return goals


def _points_off(share: float, promised: float, n: int) -> float:
    return 100.0 * max(0.0, abs(share - promised) - 2.0 * math.sqrt(promised * (1.0 - promised) / n))


def _rows(name: str, scaled: Floats) -> list[dict[str, Any]]:
    """Shares of errors (N, 3) in sigmas, along x, y and of roll, that are within one and two."""
    rows = []
    for mode, errors in (("centre", np.abs(scaled[:, :2]).ravel()), ("rotation", np.abs(scaled[:, 2]))):
        shares = {key: float((errors < limit).mean()) for key, (limit, _) in WITHIN.items()}
        rows.append({"fields": name, "mode": mode, "n": len(errors), "wrong": 0, **shares})
    return rows


def in_sigmas(answer: Solution, truth: Solution, middle: Floats, more: Floats | float = 0.0) -> Floats:
    """Errors (3,) of an answer's centre along x and y and of its roll, over the stated ones.

    ``middle`` (2,) is the answer's centre in the truth's pixels; ``more`` (3,) arcsec are the truth's own errors.

    Parameters
    ----------
    answer : Solution
        A solution and its uncertainties.
    truth : Solution
        The same frame's pointing.
    middle : Floats
        The answer's centre (2,) in the truth's pixels.
    more : Floats or float
        The truth's own errors (3,), arcsec.
    """
    above, centre, below = truth.sky_at(middle + np.array([[0.0, -0.5], [0.0, 0.0], [0.0, 0.5]]))
    matrix = answer.centre_attitude.matrix
    x, y, _ = matrix @ centre
    down = matrix @ (below - above)
    off = np.degrees([x, y, math.atan2(-down[0], down[1])]) * 3600.0
    return np.asarray(off / np.hypot(answer.centre_attitude.sigma_arcsec, more))


def _rendered(count: int, fields_deg: Sequence[float] = FIELDS_DEG, plan: FieldPlan = RENDERED) -> Floats:
    rng, found = np.random.default_rng(SEED), []
    dated = SolveOptions(hint=Hint(time_utc=J2000))
    for fov in fields_deg:
        half = math.tan(math.radians(fov) / 2.0)
        for _ in range(count):
            corner = rng.uniform(-0.02, 0.02) if fov > FIELDS_DEG[1] else 0.0
            image = random_picture(open_catalogue(), rng, replace(plan, fov_deg=fov, k1=corner / (2.0 * half**2)))
            answer = drive(solve_frame(image.frame, dated))
            if isinstance(answer, Solution):
                truth = Solution(image.camera, image.attitude, (), 0.0, 0.0, "truth")
                middle = np.array([image.camera.width - 1.0, image.camera.height - 1.0]) / 2.0
                found.append(in_sigmas(answer, truth, middle))
    return np.array(found)


def _crops(most: int | None) -> Floats:
    found = []
    for path in sorted(REAL.iterdir())[:: 1 if most is None else 10][:most]:
        try:
            frame = read_frame(path)
        except KochabError:  # the truth lies beside them
            continue
        whole = drive(solve_frame(frame, SolveOptions()))
        if not isinstance(whole, Solution):
            continue
        scale = whole.camera.scale_arcsec_px
        for part in CROPS:
            # Even sizes and offsets keep a mosaic's pattern in phase.
            h, w = (int(side * part) // 2 * 2 for side in frame.pixels.shape[:2])
            y, x = ((side - mine) // 4 * 2 for side, mine in zip(frame.pixels.shape[:2], (h, w), strict=True))
            hint = Hint(scale_arcsec_px=(scale / 1.1, scale * 1.1))
            crop = Frame(np.ascontiguousarray(frame.pixels[y : y + h, x : x + w]), bayer=frame.bayer, hint=hint)
            answer = drive(solve_frame(crop, SolveOptions()))
            if isinstance(answer, Solution):
                middle = np.array([x + (w - 1) / 2.0, y + (h - 1) / 2.0])
                found.append(in_sigmas(answer, whole, middle, np.array(whole.centre_attitude.sigma_arcsec)))
    return np.array(found).reshape(-1, 3)
