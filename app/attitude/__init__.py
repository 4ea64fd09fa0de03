"""From matched stars to the camera's attitude and optics; one estimator a file, by name."""

from importlib import import_module
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import Attitude
from app.core.camera import Camera
from app.core.errors import UsageError

DEFAULT_ESTIMATOR = "quest"
ESTIMATORS: dict[str, str] = {
    "quest": "app.attitude.quest:Quest",
    "triad": "app.attitude.triad:Triad",
    "plate_constants": "app.attitude.plate_constants:PlateConstants",
}


class Estimator(Protocol):
    """Anything that turns matched stars into an attitude without a first guess."""

    def estimate(
        self, xy_px: NDArray[np.float64], vectors: NDArray[np.float64], camera: Camera
    ) -> Attitude:
        """The attitude of a ``camera`` that records stars at ``xy_px`` (M, 2).

        Their ICRS unit vectors are ``vectors`` (M, 3). The most trustworthy star, as a rule the
        brightest, comes first. ValueError when the stars are too few or lie too badly.
        """
        ...


def make_estimator(name: str = DEFAULT_ESTIMATOR, **options: Any) -> Estimator:
    """An estimator by its name in ``ESTIMATORS``, with its options; UsageError when unknown."""
    if name not in ESTIMATORS:
        raise UsageError(f"There is no attitude '{name}'; choose one of {', '.join(ESTIMATORS)}.")
    module, _, kind = ESTIMATORS[name].partition(":")
    estimator: Estimator = getattr(import_module(module), kind)(**options)
    return estimator
