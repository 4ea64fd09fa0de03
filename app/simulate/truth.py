"""What a simulated telescope really does, for scoring those who find out."""

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import Attitude, separation_deg
from app.simulate.local_sky import LocalSky, altitude_deg, azimuth_deg

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class AxisError:
    """The polar axis against a pole, arcsec.

    Altitude positive too high, azimuth raw as the knob turns and positive clockwise as seen from
    above, total as the angle on the sky.
    """

    altitude_arcsec: float
    azimuth_arcsec: float
    total_arcsec: float


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """One moment. ``attitude`` takes ICRS catalogue vectors to camera axes near the boresight.

    ``of_date_deg`` is the boresight's geocentric apparent RA and Dec, what a mount should say.
    ``enu_to_camera`` (3, 3) takes observed directions; ``axis_enu`` (3,) is the visible end of
    the polar axis.
    """

    unix_s: float
    attitude: Attitude
    of_date_deg: tuple[float, float]
    altitude_deg: float
    azimuth_deg: float
    enu_to_camera: Floats
    axis_enu: Floats
    sky: LocalSky

    @property
    def time_utc(self) -> datetime:
        """The moment as an aware time."""
        return datetime.fromtimestamp(self.unix_s, UTC)

    @property
    def ra_dec_deg(self) -> tuple[float, float]:
        """ICRS of the frame's principal point."""
        return self.attitude.ra_dec_deg

    def axis_error(self, refracted: bool = True) -> AxisError:
        """The axis against the pole as seen through the air, or without it."""
        return axis_error(self.axis_enu, self.sky.pole_enu(refracted))


def truth_of(sky: LocalSky, unix_s: float, look: Floats, axis_enu: Floats) -> Truth:
    """The truth of a camera whose ``look`` (3, 3) takes observed directions to camera axes."""
    boresight = sky.from_enu(look[2])
    # The air squeezes the field, so that right and down turn a little differently: take the mean,
    # as a fit over the whole frame does.
    right, down = (_towards(sky, boresight, look[2] + 1e-3 * look[k]) for k in (0, 1))
    x = right + np.cross(down, boresight)
    x /= np.linalg.norm(x)
    matrix = np.stack([x, np.cross(boresight, x), boresight])
    return Truth(
        unix_s, Attitude(matrix), sky.of_date(boresight), float(altitude_deg(look[2])),
        float(azimuth_deg(look[2])), look, axis_enu, sky,
    )  # fmt: skip


def _towards(sky: LocalSky, boresight: Floats, direction: Floats) -> Floats:
    """Unit tangent (3,) at the boresight, ICRS, towards an observed direction (3,)."""
    away = sky.from_enu(direction) - boresight
    away -= (away @ boresight) * boresight
    return np.asarray(away / np.linalg.norm(away))


def axis_error(axis: Floats, pole: Floats) -> AxisError:
    """How an axis (3,) stands against a pole (3,), both east, north, up."""
    high = float(altitude_deg(axis) - altitude_deg(pole))
    turned = float((azimuth_deg(axis) - azimuth_deg(pole) + 180.0) % 360.0 - 180.0)
    return AxisError(high * 3600.0, turned * 3600.0, separation_deg(axis, pole) * 3600.0)
