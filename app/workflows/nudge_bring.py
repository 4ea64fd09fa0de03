"""A person clicks a star in a solved frame: bring it here."""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.core.errors import RefusedError
from app.core.mount import Direction
from app.core.progress import Progress, Task
from app.core.solution import Solution
from app.mounts.guard import Guard
from app.sky.apparent import of_date_matrix
from app.workflows.goto_target import Wait, answered, settled
from app.workflows.nudge import nudge
from app.workflows.sync_mount import shifted

Floats = NDArray[np.float64]
POLE = np.array([0.0, 0.0, 1.0])
SLEW_FROM_DEG = 0.25  # larger turns are a goto by so much: quicker, and watched all the way
STEPS, STEP_RAD = 8, 1e-6
CLOSE_PX = 0.01


@dataclass(frozen=True, slots=True)
class Turn:
    """Axis angles in degrees, towards greater right ascension and towards the north."""

    east_deg: float
    north_deg: float


def turn_to_bring(
    matrix_of_date: Floats, solution: Solution, star_px: tuple[float, float],
    here_px: tuple[float, float],
) -> Turn:  # fmt: skip
    """How far both axes turn so that what is seen at ``star_px`` comes to ``here_px``.

    ``matrix_of_date`` (3, 3) takes ICRS to the equator the mount turns about.

    Raises
    ------
    RefusedError
        No turn of these axes does it, as beside the pole.

    """
    look = solution.attitude.matrix @ matrix_of_date.T  # of date -> camera
    star = matrix_of_date @ solution.sky_at(np.array([star_px], dtype=np.float64))[0]
    here = np.asarray(here_px, dtype=np.float64)

    def miss(turns: Floats) -> Floats:
        seen = solution.camera.project(np.atleast_2d(_turned(look, turns) @ star))[0]
        return np.asarray(seen - here)

    turns = np.zeros(2)
    for _ in range(STEPS):
        off = miss(turns)
        if np.hypot(*off) < CLOSE_PX:
            break
        slope = np.stack(
            [(miss(turns + STEP_RAD * unit) - off) / STEP_RAD for unit in np.eye(2)], axis=1
        )
        if not np.isfinite(slope).all() or abs(np.linalg.det(slope)) < 1e-9:
            break
        turns = turns - np.linalg.solve(slope, off)
    if not np.hypot(*miss(turns)) < 1.0 or np.abs(turns).max() > np.pi / 2:
        raise RefusedError(
            "This star cannot be brought there by turning the two axes: go to it instead."
        )
    return Turn(*(float(angle) for angle in np.degrees(turns)))


def bring_here(
    mount: Guard, solution: Solution, star_px: tuple[float, float],
    here_px: tuple[float, float] | None = None, wait: Wait = time.sleep,
) -> Task[Turn]:  # fmt: skip
    """Move what a frame taken just now shows at ``star_px`` to ``here_px``, or to its middle.

    Small turns are guide pulses or moves, larger ones a goto beside where the mount says it is.
    Cancelling stops the mount.
    """
    camera = solution.camera
    middle = ((camera.width - 1) / 2.0, (camera.height - 1) / 2.0)
    turn = turn_to_bring(of_date_matrix(mount.clock()), solution, star_px, here_px or middle)
    yield Progress("bring here", 0.0, f"{turn.east_deg:+.3f} deg east, {turn.north_deg:+.3f} north")
    if max(abs(turn.east_deg), abs(turn.north_deg)) >= SLEW_FROM_DEG:
        said = answered(mount.position)
        place = shifted((said.ra_deg, said.dec_deg), turn.east_deg, turn.north_deg)
        yield from mount.slew(*place)
    else:
        for angle, ways in (
            (turn.east_deg, (Direction.EAST, Direction.WEST)),
            (turn.north_deg, (Direction.NORTH, Direction.SOUTH)),
        ):
            yield from nudge(mount, ways[angle < 0.0], abs(angle) * 3600.0, wait)
    yield from settled(mount, wait)
    return turn


def _turned(look: Floats, turns: Floats) -> Floats:
    """The camera after the telescope turned by (east, north) radians; rotations only."""
    boresight = look[2]
    level = np.cross(boresight, POLE)
    north = _about(level / max(np.linalg.norm(level), 1e-12), float(turns[1]))
    return np.asarray(look @ (_about(POLE, float(turns[0])) @ north).T)


def _about(axis: Floats, angle: float) -> Floats:
    """Rotation (3, 3), right-handed, about a unit vector."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross))
