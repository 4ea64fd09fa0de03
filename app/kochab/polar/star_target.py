"""Where a star of the live frame belongs: what a person drags it to by turning the bolts.

The bolts turn the mount and its camera, azimuth about the vertical and altitude about the level line across it. A star
stays where it is meanwhile, so that in the frame it goes the other way.
"""

from typing import NamedTuple

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.solution import Solution
from kochab.polar.error import PolarError
from kochab.polar.rotations import about, alt_az

MARGIN = 0.06  # of the frame's smaller side: what is nearer to an edge is not to be seen well
BRIGHTEST = 12  # stars to choose from
LIKED = (0.64, 0.66)  # of the frame's width and height: below and beside the cards that lie over it


class StarTarget(NamedTuple):
    """A star by its name in the catalogue, its pixel, where it belongs, px, and whether that is inside the frame."""

    star: str
    at: tuple[float, float]
    belongs: tuple[float, float]
    inside: bool


def to_pole(error: PolarError) -> Floats:
    """The rotation (3, 3) of E, N, U by which both bolts bring the axis to its pole."""
    (alt, az), (pole_alt, pole_az) = alt_az(error.axis), alt_az(error.pole)
    lift = about(np.array([np.cos(az), -np.sin(az), 0.0]), pole_alt - alt)
    return np.asarray(about(np.array([0.0, 0.0, 1.0]), az - pole_az) @ lift)


def belongs_at(rays: Floats, matrix: Floats, error: PolarError) -> Floats:
    """Where stars are seen with the axis at its pole.

    Parameters
    ----------
    rays : Floats
        Their directions now (N, 3), in camera axes.
    matrix : Floats
        Camera axes to E, N, U now (3, 3).
    error : PolarError
        Of the axis now.

    Returns
    -------
    Floats
        Directions (N, 3) in camera axes.
    """
    return np.asarray(rays @ (matrix.T @ to_pole(error) @ matrix))


def star_target(solution: Solution, matrix: Floats, error: PolarError, before: str | None = None) -> StarTarget | None:
    """The star to look at in a solved frame: the same as ``before`` while it will do, None without stars.

    Parameters
    ----------
    solution : Solution
        Of the frame.
    matrix : Floats
        Camera axes to E, N, U (3, 3).
    error : PolarError
        Of the axis.
    before : str or None
        Of the star that was shown last.
    """
    if not solution.stars:
        return None
    camera, at = solution.camera, solution.stars_px
    moved = belongs_at(camera.unproject(at), matrix, error)
    ahead = moved[:, 2] > 0.0
    to = np.where(ahead[:, None], camera.project(moved), np.nan)
    size = np.array([camera.width, camera.height], dtype=float)
    margin = MARGIN * float(size.min())
    inside = np.all((to > margin) & (to < size - margin) & (at > margin) & (at < size - margin), axis=1)
    names = [star.id for star in solution.stars]
    if before in names and inside[names.index(before)]:
        chosen = names.index(before)
    elif inside.any():
        bright = np.argsort([star.mag for star in solution.stars], kind="stable")
        good = bright[inside[bright]][:BRIGHTEST]
        middle = np.hypot(*((at[good] + to[good]) / 2.0 - size * LIKED).T)
        chosen = int(good[np.argmin(middle)])
    elif ahead.any():
        chosen = int(np.argmin(np.where(ahead, np.hypot(*(at - size / 2.0).T), np.inf)))
    else:
        return None
    (x, y), (tx, ty) = at[chosen], to[chosen]
    return StarTarget(names[chosen], (float(x), float(y)), (float(tx), float(ty)), bool(inside[chosen]))
