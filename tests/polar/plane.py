"""An independent estimate of the axis, from boresights alone: the normal of the plane of their tips."""

import numpy as np


def axis_of_plane(boresights):
    """Unit vector (3,) normal to the plane through three or more directions (N, 3); sign undecided."""
    centred = boresights - boresights.mean(axis=0)
    return np.asarray(np.linalg.svd(centred)[2][2])


def plane_of_three_arcsec(sigma_arcsec, turn_deg):
    """Uncertainty of the plane through three boresights, evenly turned, both directions."""
    half = np.radians(turn_deg) / 2.0
    return float(
        np.hypot(sigma_arcsec / (np.sqrt(2.0) * np.sin(half)), sigma_arcsec * np.sqrt(1.5) / (1.0 - np.cos(half)))
    )


def two_attitudes_arcsec(optics, rho_deg, turn_deg):
    """Uncertainty of the axis of two attitudes, boresight ``rho_deg`` from it, both directions."""
    rho, half = np.radians([rho_deg, turn_deg / 2.0])
    across = optics.sigma_arcsec**2 * (1.0 + np.cos(rho) ** 2)
    roll = (optics.sigma_roll_arcsec * np.sin(rho)) ** 2
    return float(np.sqrt(2.0 * (across + roll)) / (2.0 * np.sin(half)))
