"""Random pointings of the real catalogue, as star lists or as rendered frames."""

from dataclasses import replace

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import Attitude, attitude_from, radec_deg, unit
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Frame
from kochab.core.values import frozen
from kochab.simulate.star_images import FWHM_PER_SIGMA, RenderedStar, Sensor, Sky, render
from kochab.sky import Catalogue


@frozen
class FieldPlan:
    """What one simulated field is like; ``size_px`` is the side of its square frame.

    ``missing`` is the share of catalogue stars that are not detected, ``spurious`` the number of false ones as a
    share of the detected, each as bright as one of them. ``brightest`` caps the list. The lens's axis lies
    ``axis_off`` sides (one sigma along x and y) beside the middle.
    """

    fov_deg: float
    size_px: int = 1024
    noise_px: float = 0.3
    missing: float = 0.2
    spurious: float = 0.2
    magnitude_scatter: float = 0.3
    brightest: int = 60
    k1: float = 0.0
    axis_off: float = 0.0


@frozen(eq=False)
class RandomField:
    """A list of stars and its truth; ``stars`` is how many the catalogue has in the frame."""

    detections: Detections
    camera: Camera
    attitude: Attitude
    stars: int


def random_direction(rng: np.random.Generator) -> Floats:
    """A unit vector (3,), evenly over the sphere."""
    return unit(rng.normal(size=3))


def random_attitude(rng: np.random.Generator) -> Attitude:
    """A boresight evenly over the sky with any roll."""
    return attitude_from(*radec_deg(random_direction(rng)), float(rng.uniform(-180.0, 180.0)))


def random_field(catalogue: Catalogue, rng: np.random.Generator, plan: FieldPlan) -> RandomField:
    """One field at a random place, roll and parity."""
    attitude = random_attitude(rng)
    n = plan.size_px
    focal = n / 2.0 / np.tan(np.radians(plan.fov_deg) / 2.0)
    camera = replace(Camera.centred(n, n, float(focal), bool(rng.integers(2))), k1=plan.k1)
    if plan.axis_off:
        cx, cy = (n - 1) / 2.0 + plan.axis_off * n * rng.normal(size=2)
        camera = replace(camera, cx=float(cx), cy=float(cy))
    radius = float(np.arctan(np.sqrt(2.0) * n / 2.0 / focal))
    # the circle is wider than the square, and some of its stars go missing
    rows = catalogue.brightest(attitude.boresight, radius, 6 * plan.brightest)
    xy = camera.project(catalogue.vectors(rows) @ attitude.matrix.T)
    with np.errstate(invalid="ignore"):
        inside = ((xy > -0.5) & (xy < n - 0.5)).all(axis=1)
    xy, mag = xy[inside], catalogue.mag(rows)[inside]
    stars = len(xy)
    seen = rng.random(stars) >= plan.missing
    xy = xy[seen] + rng.normal(0.0, plan.noise_px, (int(seen.sum()), 2))
    mag = mag[seen] + rng.normal(0.0, plan.magnitude_scatter, len(xy))
    false = round(plan.spurious * len(xy))
    if false:
        xy = np.concatenate([xy, rng.uniform(0, n - 1, (false, 2))])
        mag = np.concatenate([mag, rng.choice(mag, false)])
    order = np.argsort(mag)[: plan.brightest]
    flux = 10.0 ** (-0.4 * mag[order])
    return RandomField(Detections.from_list(xy[order], n, n, flux), camera, attitude, stars)


def random_points(rng: np.random.Generator, count: int, size_px: int = 1024) -> Detections:
    """Points that are no stars: a list that must be refused."""
    return Detections.from_list(rng.uniform(0, size_px - 1, (count, 2)), size_px, size_px)


FWHM_PX = 3.5
SKY_E = 400.0
SNR = (3.0, 300.0)
"""Of the faintest star: below there is nothing to be found, above no noise to be seen."""


@frozen(eq=False)
class RandomImage:
    """A frame and its truth; ``places`` (N, 2) px are those of its stars."""

    frame: Frame
    places: Floats
    camera: Camera
    attitude: Attitude


def random_picture(catalogue: Catalogue, rng: np.random.Generator, plan: FieldPlan) -> RandomImage:
    """A picture at a random place, roll and parity, with the stars of a field of ``plan``.

    The faintest star is so bright that noise moves the best possible centroid by the plan's
    ``noise_px``; false stars are single hot pixels.
    """
    field = random_field(catalogue, rng, replace(plan, noise_px=0.0, spurious=0.0))
    stars = field.detections
    flux = stars.flux * (_faintest_e(plan.noise_px) / stars.flux.min()) if len(stars) else stars.flux
    hot = round(plan.spurious * len(stars))
    sky = Sky(SKY_E, hot_per_mp=hot / (plan.size_px**2 / 1e6))
    n, star, seed = plan.size_px, RenderedStar(FWHM_PX), int(rng.integers(2**31))
    frame = render(n, n, stars.xy, flux, star, sky, Sensor(), seed)
    return RandomImage(frame, stars.xy, field.camera, field.attitude)


def _faintest_e(noise_px: float) -> float:
    """Electrons of a Gaussian star whose centroid is uncertain by ``noise_px`` along an axis.

    Where the sky's noise is all there is, the least variance of a place is ``2 s^2 / SNR^2`` with
    the star's sigma s, and SNR that of the best weighting, ``F / (2 s sqrt(pi) noise)``.
    """
    s = FWHM_PX / FWHM_PER_SIGMA
    snr = float(np.clip(np.sqrt(2.0) * s / max(noise_px, 1e-9), *SNR))
    noise_e = np.sqrt(SKY_E + Sensor().read_noise_e ** 2)
    return float(snr * noise_e * 2.0 * np.sqrt(np.pi) * s)
