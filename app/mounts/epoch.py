"""Callers think in ICRS, mounts in the equator of date or in J2000: from one to the other.

J2000 and ICRS differ by 0.02 arcsec and are taken as one. "Of date" is the apparent place: true
equator and equinox, with nutation and annual aberration, as the makers and INDI use it.
"""

from datetime import datetime

import numpy as np

from app.core.attitude import radec_deg, unit_vectors
from app.core.mount import Epoch, Pointing
from app.sky.apparent import apparent, from_apparent


def to_mount_epoch(
    ra_deg: float, dec_deg: float, epoch: Epoch, time_utc: datetime
) -> tuple[float, float]:
    """ICRS degrees in the mount's ``epoch``."""
    if epoch is Epoch.J2000:
        return ra_deg % 360.0, dec_deg
    vector = np.atleast_2d(unit_vectors(ra_deg, dec_deg))
    return radec_deg(apparent(vector, time_utc)[0])


def from_mount_epoch(pointing: Pointing, time_utc: datetime) -> tuple[float, float]:
    """ICRS degrees of what a mount says."""
    if pointing.epoch is Epoch.J2000:
        return pointing.ra_deg % 360.0, pointing.dec_deg
    vector = np.atleast_2d(unit_vectors(pointing.ra_deg, pointing.dec_deg))
    return radec_deg(from_apparent(vector, time_utc)[0])
