"""Pictures of random pointings of the real catalogue, each as noisy as its places shall be."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import Attitude
from app.core.camera import Camera
from app.core.frame import Frame
from app.simulate.fields import FieldPlan, random_field
from app.simulate.stars import FWHM_PER_SIGMA, Sensor, Sky, StarImage, render
from app.sky.catalogue import Catalogue

Floats = NDArray[np.float64]
FWHM_PX = 3.5
SKY_E = 400.0
SNR = (3.0, 300.0)
"""Of the faintest star: below there is nothing to be found, above no noise to be seen."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A frame and its truth; ``places`` (N, 2) px are those of its stars."""

    frame: Frame
    places: Floats
    camera: Camera
    attitude: Attitude


def random_picture(catalogue: Catalogue, rng: np.random.Generator, plan: FieldPlan) -> Picture:
    """A picture at a random place, roll and parity, with the stars of a field of ``plan``.

    The faintest star is so bright that noise moves the best possible centroid by the plan's
    ``noise_px``; false stars are single hot pixels.
    """
    field = random_field(catalogue, rng, replace(plan, noise_px=0.0, spurious=0.0))
    stars = field.detections
    flux = (
        stars.flux * (_faintest_e(plan.noise_px) / stars.flux.min()) if len(stars) else stars.flux
    )
    hot = round(plan.spurious * len(stars))
    sky = Sky(SKY_E, hot_per_mp=hot / (plan.size_px**2 / 1e6))
    frame = render(
        plan.size_px, plan.size_px, stars.xy, flux, StarImage(FWHM_PX), sky, Sensor(),
        int(rng.integers(2**31)),
    )  # fmt: skip
    return Picture(frame, stars.xy, field.camera, field.attitude)


def _faintest_e(noise_px: float) -> float:
    """Electrons of a Gaussian star whose centroid is uncertain by ``noise_px`` along an axis.

    Where the sky's noise is all there is, the least variance of a place is ``2 s^2 / SNR^2`` with
    the star's sigma s, and SNR that of the best weighting, ``F / (2 s sqrt(pi) noise)``.
    """
    s = FWHM_PX / FWHM_PER_SIGMA
    snr = float(np.clip(np.sqrt(2.0) * s / max(noise_px, 1e-9), *SNR))
    noise_e = np.sqrt(SKY_E + Sensor().read_noise_e ** 2)
    return float(snr * noise_e * 2.0 * np.sqrt(np.pi) * s)
