"""Where the camera should point at the next frame, and which stars are expected there.

Mostly that is where the filter says. When nothing is there, or when after one frame or a long
exposure the filter knows so little of the velocity that the stars may be outside any window, two
more motions are tried that cameras have at night: none against the stars (a mount that tracks), and
none against the ground, which is the Earth's rotation about the celestial pole. Neither needs a
site.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kochab.attitude.filter import RATE_SIGMA_RAD_S, FilterState, predicted
from kochab.core.arrays import Floats, Ints
from kochab.core.attitude import Attitude, rotation_vector
from kochab.core.camera import Camera
from kochab.core.mount import SIDEREAL_RAD_S
from kochab.core.values import frozen
from kochab.identification.predictional_estimate import expected_px
from kochab.solver.matches import catalogue_sigma_rad, field_centre

if TYPE_CHECKING:
    from kochab.sky import Catalogue


SMALLEST_PX, USUAL_PX = 8, 32  # half a window's side at least, and at most
FAR_PX = 64  # at most where the prediction is less certain than that
APART_PX = 8.0  # places nearer to each other are one


@frozen(eq=False)
class Prediction:
    """A prediction, and half the side of the windows around the stars it expects, px.

    ``roll_px`` is what one sigma of roll moves a star at the frame's corner.
    """

    ahead: FilterState
    half: int
    roll_px: float


def predicted_attitudes(state: FilterState, time_s: float, camera: Camera, fwhm_px: float) -> Iterator[Prediction]:
    """Where to look, the likeliest first.

    Parameters
    ----------
    state : FilterState
        Attitude and velocity as filtered so far.
    time_s : float
        When the new frame was taken, on the filter's clock.
    camera : Camera
        Turns angles into pixels.
    fwhm_px : float
        Width of a star's image.
    """
    wide: list[Floats] = []  # looked at in windows that are not small
    least = SMALLEST_PX
    for rates in (state.rates_rad_s, np.zeros(3), SIDEREAL_RAD_S * state.matrix[:, 2]):
        ahead = predicted(_moving(state, rates), time_s)
        turns = [rotation_vector(ahead.matrix @ other.T) for other in wide]
        if any(
            np.hypot(camera.focal_px * np.hypot(x, y), _corner_px(camera) * roll) < APART_PX for x, y, roll in turns
        ):
            continue
        error_px, roll_px = _error_px(ahead, camera), _roll_px(ahead, camera)
        most = USUAL_PX if error_px <= USUAL_PX else FAR_PX
        half = int(np.clip(np.ceil(error_px + 2.0 * fwhm_px + 2.0), least, most))
        yield Prediction(ahead, half, min(roll_px, float(most)))
        least = USUAL_PX  # what was believed of the motion was wrong
        if half >= USUAL_PX:
            wide.append(ahead.matrix)


def _moving(state: FilterState, rates: Floats) -> FilterState:
    """The same pointing with another velocity (3,), rad/s, which is as little known as at first."""
    if np.array_equal(rates, state.rates_rad_s):
        return state
    covariance = state.covariance.copy()
    # the error of the pointing says nothing of a velocity that is only supposed
    covariance[3:, :] = covariance[:, 3:] = 0.0
    covariance[3:, 3:] = np.eye(3) * RATE_SIGMA_RAD_S**2
    return replace(state, rates_rad_s=rates, covariance=covariance)


def _error_px(ahead: FilterState, camera: Camera) -> float:
    """Four sigma of where a star is expected, px."""
    tilt = float(np.sqrt(np.linalg.eigvalsh(ahead.covariance[:2, :2])[-1]))
    return 4.0 * float(np.hypot(camera.focal_px * tilt, _roll_px(ahead, camera)))


def _roll_px(ahead: FilterState, camera: Camera) -> float:
    return _corner_px(camera) * float(np.sqrt(ahead.covariance[2, 2]))


def _corner_px(camera: Camera) -> float:
    return float(np.hypot(camera.width, camera.height)) / 2.0


# The stars expected in the next frame: a neighbourhood of the sky kept from frame to frame.

MARGIN = 1.5  # the neighbourhood's radius over the field's
DEEPER = 1.5  # magnitudes below the limit that still disturb a neighbour
MOST = 4000


@frozen(eq=False)
class Expected:
    """E stars that should be in a frame, brightest first: numbers in the pool and places (E, 2)."""

    number: Ints
    xy: Floats


class Neighbourhood:
    """Stars around a pointing, brightest first, of which a frame shows some.

    ``rows`` (N,), ``vectors`` (N, 3) at ``year``, good to ``sigma_rad`` (N,) a coordinate, and
    ``mag`` (N,); ``alone`` (N,) are those whose image no neighbour disturbs.
    """

    def __init__(
        self, catalogue: "Catalogue", camera: Camera, attitude: Attitude, year: float, faintest: float, blend_px: float
    ) -> None:
        centre, radius = field_centre(camera, attitude)
        self.centre, self.field_rad, self.camera = centre, radius, camera
        # rad: what is a quarter turn away is on no plane before the camera
        self.radius = min(MARGIN * radius, 1.5)
        self.catalogue, self.faintest = catalogue, faintest
        rows = catalogue.cone(centre, self.radius, faintest + DEEPER, year)[:MOST]
        self.rows = rows.astype(np.int64)
        self.vectors = catalogue.vectors(rows, year)
        self.mag = catalogue.mag(rows)
        self.sigma_rad = catalogue_sigma_rad(self.mag, year)
        self.alone = _alone(self.vectors, self.mag, blend_px / camera.focal_px)
        self._labels: dict[int, tuple[str, str]] = {}

    def covers(self, camera: Camera, attitude: Attitude) -> bool:
        """Whether it holds all stars of a frame taken so."""
        if abs(np.log(camera.focal_px / self.camera.focal_px)) > 0.05:
            return False
        centre, _ = field_centre(camera, attitude)
        off = 2.0 * np.arcsin(min(1.0, float(np.linalg.norm(centre - self.centre)) / 2.0))
        return bool(off + self.field_rad <= self.radius)

    def expected(self, camera: Camera, matrix: Floats, count: int, inset_px: float) -> Expected:
        """The brightest undisturbed stars within the frame.

        Parameters
        ----------
        camera : Camera
            Its model.
        matrix : Floats
            Rotation (3, 3), ICRS to camera axes.
        count : int
            How many at most.
        inset_px : float
            Least distance from the frame's edge.
        """
        usable = np.flatnonzero(self.alone & (self.mag <= self.faintest))
        xy = expected_px(camera, matrix, self.vectors[usable])
        size = np.array([camera.width - 1.0, camera.height - 1.0])
        inside = np.all((xy >= inset_px) & (xy <= size - inset_px), axis=1)
        chosen = np.flatnonzero(inside)[:count]
        return Expected(usable[chosen].astype(np.int64), xy[chosen])

    def label(self, number: int) -> tuple[str, str]:
        """Identifier and name of a star, looked up once."""
        if number not in self._labels:
            self._labels[number] = self.catalogue.label(int(self.rows[number]))
        return self._labels[number]


def _alone(vectors: Floats, mag: Floats, blend_rad: float) -> NDArray[np.bool_]:
    """Which stars have no neighbour within the blend that is brighter or hardly fainter."""
    alone = np.ones(len(vectors), dtype=np.bool_)
    if len(vectors) < 2:
        return alone
    from scipy.spatial import cKDTree  # not needed to show the window

    pairs = cKDTree(vectors).query_pairs(2.0 * np.sin(blend_rad / 2.0), output_type="ndarray")
    for mine, other in (pairs.T, pairs.T[::-1]):
        alone[mine[mag[other] < mag[mine] + 2.5]] = False
    return alone
