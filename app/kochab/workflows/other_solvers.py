"""A solution, and what is believed of a frame, in the words of other solvers: for their command lines and web API."""

import math
from collections.abc import Callable

import numpy as np

from kochab.core.attitude import cross_product, east_north
from kochab.core.errors import UsageError
from kochab.core.solution import NoSolution, Reason, Solution

Cd = tuple[tuple[float, float], tuple[float, float]]


def cd_at_centre(solution: Solution) -> Cd:
    """Degrees of (east, north) a pixel of (x, y), by a step of a pixel each way."""
    camera = solution.camera
    east, north = east_north(solution.centre_vector)
    middle = np.array([camera.width - 1.0, camera.height - 1.0]) / 2.0
    # Differences over two pixels: the lens' distortion at the centre is in them, which a formula for TAN leaves out.
    steps = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]])
    rays = camera.unproject(middle + steps) @ solution.attitude.matrix
    ahead = rays @ cross_product(east, north)
    plane = np.degrees(np.stack([rays @ east, rays @ north]) / ahead)
    x, y = (plane[:, 1] - plane[:, 0]) / 2.0, (plane[:, 3] - plane[:, 2]) / 2.0
    return (float(x[0]), float(y[0])), (float(x[1]), float(y[1]))


def up_deg(solution: Solution) -> float:
    """astrometry.net's ``orientation``: "up is so many degrees east of north", of an image whose first row is below."""
    (a, b), (c, d) = cd_at_centre(solution)
    side = parity(solution)
    return -math.degrees(math.atan2(side * c - b, side * a + d))


def parity(solution: Solution) -> int:
    """The sign of the plane's determinant: 1 ("neg" on its command line) for a frame that is not mirrored, else -1."""
    (a, b), (c, d) = cd_at_centre(solution)
    return 1 if a * d - b * c >= 0.0 else -1


def arcsec_px(units: str) -> Callable[[float, int], float]:
    """What turns a scale in astrometry.net's units, of a frame so many pixels wide, into arcsec a pixel; UsageError."""
    if units in ("degwidth", "degw", "dw"):
        return lambda value, width: value * 3600.0 / width
    if units in ("arcminwidth", "amw", "aw"):
        return lambda value, width: value * 60.0 / width
    if units in ("arcsecperpix", "app"):
        return lambda value, width: value
    if units == "focalmm":  # of a frame 36 mm wide
        return lambda value, width: math.degrees(36.0 / value) * 3600.0 / width
    raise UsageError(f"{units[:40]} is none of the units degwidth, arcminwidth, arcsecperpix, focalmm.")


def scale_between(
    low: float | None, high: float | None, to_scale: Callable[[float, int], float], width: int
) -> tuple[float, float] | None:
    """Both ends of the pixel scale, arcsec/px, the smaller first; None without bounds.

    Parameters
    ----------
    low, high : float or None
        Bounds in the caller's units; one alone leaves three orders of magnitude to the other side.
    to_scale : Callable
        What turns them into arcsec/px, as :func:`arcsec_px` gives it.
    width : int
        Of the frame, px.
    """
    if low is None and high is None:
        return None
    one, other = sorted(to_scale(v, width) for v in (low or (high or 0.0) / 1e3, high or (low or 0.0) * 1e3))
    return one, other


def within_scale(result: Solution | NoSolution, scale: tuple[float, float] | None) -> Solution | NoSolution:
    """``result``, or no solution when its pixel scale, arcsec/px, is not within both ends; None bounds nothing."""
    from kochab.solver.pipeline import refused

    if scale is None or not isinstance(result, Solution):
        return result
    found = result.camera.scale_arcsec_px
    # A thousandth of play: bounds come rounded, and the width is believed on the sky or on the plane.
    if scale[0] * 0.999 <= found <= scale[1] * 1.001:
        return result
    note = f" and {found:.5g} arcsec/px, outside {scale[0]:.5g} to {scale[1]:.5g}."
    return refused(result, Reason.ANOTHER_FIELD, note, scale_arcsec_px=found)
