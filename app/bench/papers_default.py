"""The default method, as the published tables are compared with it."""

from functools import partial

from app.bench.papers_row import timed
from app.core.detections import Detections
from app.core.hint import Hint
from app.core.progress import run
from app.core.solution import NoSolution, Solution
from app.identify import make_identifier
from app.sky import open_catalogue
from app.solve.few_stars import identify_few
from app.solve.options import UNKNOWN_YEAR, SolveOptions
from app.solve.solver import solve_detections, with_field

KNOWN = 1e-4
"""The published methods know their camera; so does the default, to this share of its scale."""


def solved(detections: Detections, options: SolveOptions) -> tuple[Solution | NoSolution, float]:
    """The answer, and the processor seconds of naming the stars.

    The published methods begin with directions and end with names, so that is what is compared.
    They are timed in a loop of nothing else, with all they need at hand, and the fit between two
    namings would turn that out; so the stars are named once before they are named against the
    clock, which takes as long as it does in such a loop.
    """
    name(detections, options)
    _, seconds = timed(partial(name, detections, options))
    return run(solve_detections(detections, options)), seconds


def name(detections: Detections, options: SolveOptions) -> None:
    """Name the stars as the solver does, and fail as it does."""
    method, hint = make_identifier(options.method), with_field(options, detections.width)
    found = run(method.identify(detections, hint, UNKNOWN_YEAR))
    if isinstance(found, NoSolution):
        identify_few(detections, hint, open_catalogue(), UNKNOWN_YEAR)


def knowing(scale_arcsec_px: float, share: float = KNOWN) -> SolveOptions:
    """The options of a solve through a camera whose scale is known to ``share`` of itself.

    The published methods have no other way when their camera is not what they believe; nor has the
    default here.
    """
    low, high = scale_arcsec_px / (1.0 + share), scale_arcsec_px * (1.0 + share)
    return SolveOptions(hint=Hint(scale_arcsec_px=(low, high)), blind_after_hint=False)
