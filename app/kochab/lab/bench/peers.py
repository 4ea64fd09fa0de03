"""``kochab bench peers``: Kochab and other solvers on the same real frames and the same hostile lists, in one run.

All get the same stars, those Kochab detects in a frame, and nothing else: no scale, no place. Real frames
with their truth lie in the folder that ``KOCHAB_FRAMES`` names, or beside the checkout. astrometry.net is
Debian's ``solve-field`` with the indexes it finds; cedar-solve has its own database. Seconds are the processor's,
so that a busy machine tells the same, for astrometry.net those of the whole program.
"""

import contextlib
import io
import json
import logging
import math
import os
import shutil
import subprocess
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import apart_deg
from kochab.core.frame import Detections
from kochab.core.progress import run as drive
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.frames import read_frame
from kochab.identification.index_build import make_fine
from kochab.lab.bench import BenchResult, Goal, Report, summary, timed
from kochab.lab.bench.identify_shapes import SHAPES, shape_list
from kochab.simulate.random_fields import random_points
from kochab.solver import SolveOptions
from kochab.solver.pipeline import examine_frame, solve_detections

SEED = 20261124
FRAMES, LISTS = 1000, 36
QUICK_FRAMES, QUICK_LISTS = 4, 3
LIMIT_S = 10
"""So long the others may take for a frame or a list, processor seconds for astrometry.net."""
WIDEST_DEG = 180.0

Place = tuple[float, float]
"""RA and Dec, degrees, of the frame's centre."""
Solver = Callable[[Detections], Place | None]


@frozen(eq=False)
class Case:
    """Stars to solve; ``truth`` is the centre and the tolerance, degrees, None where there is no field."""

    name: str
    detections: Detections
    truth: tuple[Place, float] | None


def run(quick: bool, report: Report) -> BenchResult:
    """Give every solver that is installed the same cases."""
    drive(make_fine(), lambda p: report(f"patterns for small fields: {p.detail}"))
    cases = {
        "real frames": list(real_frames(QUICK_FRAMES if quick else FRAMES)),
        "lists without truth": list(hostile_lists(QUICK_LISTS if quick else LISTS)),
    }
    rows = []
    for name, solver in installed(report).items():
        for what, asked in cases.items():
            if asked:
                report(f"{name}: {len(asked)} {what} ...")
                rows.append({"solver": name, "what": what, **score(solver, asked)})
    return BenchResult("peers", rows, goals(rows))


def goals(rows: Sequence[dict[str, Any]]) -> list[Goal]:
    """None of Kochab's solutions is wrong, and nobody solves more."""
    own = [row for row in rows if row["solver"] == "kochab"]
    real = {row["solver"]: row["solved"] for row in rows if row["what"] == "real frames"}
    others = max((solved for name, solved in real.items() if name != "kochab"), default=0)
    return [
        Goal.at_most("wrong solutions", sum(row["wrong"] for row in own), 0),
        Goal.at_least("real frames solved, at least as many as the best peer", real.get("kochab"), others),
    ]


def score(solver: Solver, cases: Sequence[Case]) -> dict[str, Any]:
    """Solved rightly, wrongly, and the seconds it took."""
    kept = []
    for case in cases:
        # this program's and those of the programs it waited for
        place, seconds = timed(partial(solver, case.detections), lambda: process_time() + sum(os.times()[2:4]))
        near = place is not None and case.truth is not None and apart_deg(place, case.truth[0]) < case.truth[1]
        kept.append({"solved": near, "wrong": place is not None and not near, "s": seconds})
    counts = summary(kept, n=("s", len), solved=("solved", np.sum), wrong=("wrong", np.sum))
    return counts | summary(kept, median_s=("s", np.median), largest_s=("s", np.max))


# -- The cases ---------------------------------------------------------------------------------


def frames_folder(variable: str = "KOCHAB_FRAMES", name: str = "frames") -> Path:
    """Where real frames are looked for: the folder that a variable of the environment names, or beside the checkout."""
    checkout = Path(__file__).resolve().parents[5] / "shared" / name
    return Path(os.environ.get(variable, checkout))


def real_frames(most: int) -> Iterator[Case]:
    """The frames with a known place, as Kochab detects their stars; none when they are not there."""
    folder = frames_folder()
    if not (folder / "truth.json").exists():
        return
    frames_truth = json.loads((folder / "truth.json").read_text("utf-8"))["frames"]
    known = sorted(name for name, truth in frames_truth.items() if "ra_deg" in truth)
    for name in known[:: max(1, len(known) // most)][:most]:
        frame = read_frame(folder / name)
        seen = drive(examine_frame(frame, SolveOptions(use_header=False))).detections
        truth = frames_truth[name]
        # the tolerances are for a fit of all; a rival may be off by the lens
        tolerance = max(truth["tol_deg"], 0.02 * truth["fov_deg"][0])
        yield Case(name, seen, ((truth["ra_deg"], truth["dec_deg"]), tolerance))


def hostile_lists(count: int) -> Iterator[Case]:
    """Clusters, galaxies, nebulae and the like without any truth, and random points, in turn."""
    rng, shapes = np.random.default_rng(SEED), [*SHAPES.items(), ("random points", None)]
    for number in range(count):
        name, shape = shapes[number % len(shapes)]
        points = random_points(rng, int(rng.integers(5, 300))) if shape is None else shape_list(shape, SEED, number)
        yield Case(name, points, None)


# -- The solvers -------------------------------------------------------------------------------


def installed(report: Report) -> dict[str, Solver]:
    """Kochab and the others that are there."""
    found: dict[str, Solver] = {"kochab": kochab}
    if shutil.which("solve-field"):
        found["astrometry.net"] = astrometry_net
    else:
        report("astrometry.net is not installed: nothing to stand beside")
    try:
        found["cedar-solve"] = CedarSolve().place
    except ImportError:
        report("cedar-solve is not installed: nothing to stand beside")
    return found


def kochab(detections: Detections) -> Place | None:
    """Kochab's own place, blind."""
    answer = drive(solve_detections(detections, SolveOptions()))
    return answer.ra_dec_deg if isinstance(answer, Solution) else None


def astrometry_net(detections: Detections) -> Place | None:
    """What ``solve-field`` says of the same stars, blind."""
    from astropy.io import fits
    from astropy.wcs import WCS, FITSFixedWarning

    if len(detections) == 0:
        return None
    with tempfile.TemporaryDirectory(prefix="kochab-peers-") as folder:
        stars = Path(folder, "stars.fits")
        columns = zip("XY", detections.xy.T + 1.0, strict=True)  # its first pixel is 1
        table = [fits.Column(name=name, format="D", array=values) for name, values in columns]
        # Only the order counts: falling from 0, as the list is brightest first.
        brightness = fits.Column(name="FLUX", format="D", array=-np.arange(len(detections), dtype=np.float64))
        fits.BinTableHDU.from_columns([*table, brightness]).writeto(stars)
        size = ["--width", str(detections.width), "--height", str(detections.height)]
        names = ["--x-column", "X", "--y-column", "Y", "--sort-column", "FLUX"]
        bounds = ["--scale-units", "degwidth", "--scale-low", "0.1", "--scale-high", str(WIDEST_DEG)]
        command = ["solve-field", "--overwrite", "--no-plots", "--dir", folder, "--cpulimit", str(LIMIT_S)]
        try:
            subprocess.run(
                [*command, *size, *names, *bounds, str(stars)], capture_output=True, timeout=60 * LIMIT_S, check=False
            )
        except subprocess.TimeoutExpired:
            return None
        found = Path(folder, "stars.wcs")
        if not found.exists():
            return None
        middle = ((detections.width - 1) / 2.0, (detections.height - 1) / 2.0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FITSFixedWarning)  # there is no image in the file
            ra, dec = WCS(fits.getheader(found)).all_pix2world(*middle, 0)
        return float(ra), float(dec)


class CedarSolve:
    """The public solver of that name with its own default database; raises ImportError."""

    def __init__(self) -> None:
        # its 0.5.1 asks numpy for a module that numpy 2 no longer lends
        if not hasattr(np, "math"):
            setattr(np, "math", math)  # noqa: B010
        logging.disable(logging.INFO)
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                from tetra3 import Tetra3

                self.engine = Tetra3("default_database")
        finally:
            logging.disable(logging.NOTSET)

    def place(self, detections: Detections, parities: Sequence[bool] = (False, True)) -> Place | None:
        """What it says of the same stars; it does not know mirrored frames, so both ways are tried."""
        size = (detections.height, detections.width)
        for mirrored in parities:
            xy: Floats = detections.xy.copy()
            if mirrored:
                xy[:, 0] = detections.width - 1 - xy[:, 0]
            # its 0.5.1 raises IndexError where many points are dropped as too near: no solution
            with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(IndexError):
                answer = self.engine.solve_from_centroids(
                    xy[:, ::-1] + 0.5, size, solve_timeout=500 * LIMIT_S, return_matches=False
                )
                if answer.get("RA") is not None:
                    return float(answer["RA"]), float(answer["Dec"])
        return None
