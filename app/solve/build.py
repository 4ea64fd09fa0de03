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
    residuals = np.hypot(*fit.residuals_px.T)
    stars = []
    for i in np.argsort(mags, kind="stable"):
        identifier, name = catalogue.label(int(matches.star[i]))
        ra, dec = radec_deg(matches.vectors[i])
        x, y = (float(c) for c in matches.xy[i])
        star = NamedStar(x, y, identifier, name, float(mags[i]), ra, dec, float(residuals[i]))
        stars.append(star)
    return Solution(
        fit.camera,
        fit.attitude,
        tuple(stars),
        fit.rms_px,
        found.log10_false_alarm,
        found.method,
    )
