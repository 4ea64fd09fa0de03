"""The attitude by a method of choice, in place of that of the joint fit."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.attitude import ESTIMATORS
from app.attitude.fit import Fit
from app.core.solution import Matches
from app.solve.pick import pick

Floats = NDArray[np.float64]


def with_estimate(
    matches: Matches, fit: Fit, name: str, sigma_px: Floats,
    options: Mapping[str, Any] | None = None,
) -> tuple[Fit, str]:  # fmt: skip
    """The same camera with the attitude that the estimator ``name`` gives, and what went wrong.

    M ``matches`` are handed over with the smallest ``sigma_px`` (M,) first, of equals the
    brightest. Residuals and RMS are those against the new attitude. When the estimator cannot
    work with the stars, the fit stays as it is and the sentence says so; else it is empty.
    """
    order = np.lexsort((matches.detection, sigma_px))
    try:
        attitude = pick(ESTIMATORS, name, "attitude", options).estimate(
            matches.xy[order], matches.vectors[order], fit.camera
        )
    except ValueError as error:
        return fit, f"The attitude is the fit's, not from {name}: {error}"
    seen = fit.camera.project(matches.vectors @ attitude.matrix.T)
    residuals = matches.xy - seen
    rms = float(np.sqrt(np.mean(np.sum(residuals**2, axis=1))))
    return replace(fit, attitude=attitude, residuals_px=residuals, rms_px=rms), ""
