"""The answer in the words of ``core``: named stars, pointing, evidence."""

import numpy as np

from app.attitude.fit import Fit
from app.core.attitude import radec_deg
from app.core.solution import Identification, Matches, NamedStar, Solution
from app.solve.extend import Stars


def build_solution(matches: Matches, fit: Fit, found: Identification, catalogue: Stars) -> Solution:
    """A solution from M agreeing ``matches`` and their ``fit``, its stars brightest first.

    Positions are those at the frame's date, proper motion included.
    """
    mags = np.asarray(catalogue.mag(matches.star), dtype=np.float64)
    order = np.argsort(mags, kind="stable")
    columns = zip(
        matches.xy[order].tolist(), catalogue.labels(matches.star[order]), mags[order].tolist(),
        matches.vectors[order], np.hypot(*fit.residuals_px[order].T).tolist(), strict=True,
    )  # fmt: skip
    stars = tuple(
        NamedStar(x, y, *label, mag, *radec_deg(vector), residual_px)
        for (x, y), label, mag, vector, residual_px in columns
    )
    return Solution(
        fit.camera,
        fit.attitude,
        stars,
        fit.rms_px,
        found.log10_false_alarm,
        found.method,
    )
