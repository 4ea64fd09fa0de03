"""How far a telescope's tube droops, from where it points against where the mount's axes have it.

A tube that droops by ``f cos(altitude)`` is the term TF of a pointing model (Wallace, TPOINT). Refraction, ``A tan z``,
looks much like it and has the other sign of what a droop does to the altitude that is seen; some mounts take it out of
what they report and most do not. Both are tried, and weighed by how well they fit. An axis that is not square
(TPOINT's NP) is fitted besides, or it would pass for a droop on one side of the pier.
"""

from collections.abc import Sequence

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import cross_product, unit_vectors
from kochab.pointing.disagreement import MountSighting, Seen, residuals
from kochab.pointing.pointing_model import PointingModel, free_causes
from kochab.sky.horizon import NO_AIR, Horizon

SQUARE_DEG = 0.1
"""One sigma of how far the axes of a mount are off the square."""
AIR = 0.06
"""The same of refraction: 15 degrees and 25 hPa of weather that nobody told."""
FIRST_ARCSEC, LEAST_ARCSEC = 5.0, 1.0
"""The scatter of what a mount reports, before it is seen and at least."""
DROOP_DEG = 120.0 / 3600.0
"""One sigma of the droop before anything is known: few tubes sag by more."""


def tube_droop(sightings: Sequence[MountSighting], model: PointingModel) -> tuple[float, float] | None:
    """How much further a tube droops at the horizon than at the zenith, and one sigma, arcsec; positive is down.

    None where the sightings are too few for its eight terms.

    Parameters
    ----------
    sightings : sequence of MountSighting
        Of one equatorial mount, its site known, all over the sky.
    model : PointingModel
        As `fit_model` makes it of them.
    """
    seen = Seen(sightings)
    cause = free_causes(model.alt_azimuth)[model.reverses]
    terms = np.asarray(model.terms_deg)
    there, reported, side, ways = cause.geometry(seen)
    left, slopes = residuals(terms, there, reported, side, ways)
    cone_rad = np.radians(terms[4])  # its square lowers declination by some arcsec, which the model leaves out
    left[:, 1] -= np.degrees(0.5 * cone_rad**2) * there[:, 2] / np.hypot(there[:, 0], there[:, 1])
    east = np.stack([-there[:, 1], there[:, 0], 0.0 * there[:, 0]], axis=1)
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    across = np.stack([east, cross_product(there, east)], axis=1)  # (N, 2, 3)
    zenith = unit_vectors(0.0, model.site.latitude_deg)
    droop = across @ zenith  # cos(altitude) upwards, by which the axes stand above what is seen
    leans = np.stack([side * there[:, 2], 0.0 * side], axis=1)
    lifted = droop / np.linalg.norm(droop, axis=1, keepdims=True) * _lifted_deg(sightings)[:, None]
    rows = np.stack([*np.moveaxis(slopes, 2, 0), leans, lifted, droop], axis=2).reshape(-1, 8)
    known = np.array([*cause.scales().max(axis=0), SQUARE_DEG, AIR, DROOP_DEG])
    freedom = len(rows) - len(known)
    if freedom < 1:
        return None
    values = left.reshape(-1) + slopes.reshape(-1, 5) @ terms
    found = [_fitted(rows, aim, known, freedom) for aim in (values, values - lifted.reshape(-1))]
    return _weighed(found, freedom)


def _lifted_deg(sightings: Sequence[MountSighting]) -> Floats:
    """By how much the air lifts each (N,), degrees."""
    out = []
    for one in sightings:
        assert one.site is not None
        horizons = Horizon(one.site, one.time_utc), Horizon(one.site, one.time_utc, NO_AIR)
        seen, airless = (np.arcsin(h.observed(unit_vectors(*one.sky_deg)[None])[0, 2]) for h in horizons)
        out.append(float(np.degrees(seen - airless)))
    return np.array(out)


def _fitted(rows: Floats, values: Floats, known: Floats, freedom: int) -> tuple[float, float, float]:
    """The last of the terms and its variance, degrees, and the sum of squares that is left, no less than noise makes.

    Parameters
    ----------
    rows : Floats
        Slopes (M, T).
    values : Floats
        Measured (M,), degrees.
    known : Floats
        One sigma (T,) of each term before.
    freedom : int
        Values less terms.
    """
    noise = FIRST_ARCSEC / 3600.0
    for _ in range(3):  # the scatter says how large the noise is, and that how much the priors count
        normal = rows.T @ rows / noise**2 + np.diag(known**-2.0)
        answer = np.linalg.solve(normal, rows.T @ values / noise**2)
        power = max(float(((values - rows @ answer) ** 2).sum()), freedom * (LEAST_ARCSEC / 3600.0) ** 2)
        noise = (power / freedom) ** 0.5
    return float(answer[-1]), float(np.linalg.inv(normal)[-1, -1]), power


def _weighed(found: Sequence[tuple[float, float, float]], freedom: int) -> tuple[float, float]:
    """Mean and sigma, arcsec, of two fits, each as likely as what it leaves makes it where the noise is not known."""
    from scipy.special import stdtrit

    values, variances, power = np.array(found).T
    odds = (power / power.min()) ** (-0.5 * freedom)
    share = odds / odds.sum()
    value = float(share @ values)
    wide = float(stdtrit(freedom, 0.8413447460685429)) ** 2
    return 3600.0 * value, 3600.0 * float(np.sqrt(share @ (wide * variances + (values - value) ** 2)))
