"""How well somebody has done on the practice rig."""

import math
from dataclasses import dataclass

import numpy as np

from app.core.attitude import unit_vectors
from app.simulate.rig import PracticeRig

POINTING_GOAL_ARCSEC = 60.0
AXIS_GOAL_ARCSEC = 30.0
WORST_ARCSEC = 3600.0  # where points run out for who began better than that


@dataclass(frozen=True, slots=True)
class Score:
    """``pointing_arcsec``: between where the mount believes to point and where it does.

    ``axis_arcsec``: between the axis and the refracted pole. ``points`` 0 to 100: half for each,
    full at 1 arcmin and 30 arcsec, none where they were at the beginning, by their logarithms.
    """

    elapsed_s: float
    pointing_arcsec: float
    axis_arcsec: float
    axis_altitude_arcsec: float
    axis_azimuth_arcsec: float
    points: int

    def as_text(self) -> str:
        """One line for a person."""
        return (
            f"Score {self.points} of 100 after {self.elapsed_s / 60.0:.0f} min: the mount's idea of"
            f" the sky is {_angle(self.pointing_arcsec)} off, its axis stands"
            f" {_angle(self.axis_arcsec)} from the pole (altitude"
            f" {_angle(abs(self.axis_altitude_arcsec))} too"
            f" {'high' if self.axis_altitude_arcsec > 0 else 'low'}, azimuth"
            f" {_angle(abs(self.axis_azimuth_arcsec))} too far"
            f" {'clockwise' if self.axis_azimuth_arcsec > 0 else 'anticlockwise'} from above)."
        )


def score(rig: PracticeRig, first: Score | None = None) -> Score:
    """The score now, against ``first``, which was taken at the beginning."""
    truth = rig.truth()
    away = unit_vectors(*rig.mount.believed_deg()) - unit_vectors(*truth.of_date_deg)
    chord = min(float(np.linalg.norm(away)) / 2.0, 1.0)
    pointing = math.degrees(2.0 * math.asin(chord)) * 3600.0
    error = truth.axis_error()
    began = (first.pointing_arcsec, first.axis_arcsec) if first else (0.0, 0.0)
    points = _share(pointing, began[0], POINTING_GOAL_ARCSEC)
    points += _share(error.total_arcsec, began[1], AXIS_GOAL_ARCSEC)
    return Score(
        truth.unix_s - rig.start_unix, pointing, error.total_arcsec, error.altitude_arcsec,
        error.azimuth_arcsec, round(50.0 * points),
    )  # fmt: skip


def _share(value: float, began: float, goal: float) -> float:
    worst = max(began, WORST_ARCSEC)
    left = math.log(max(value, goal) / goal) / math.log(worst / goal)
    return 1.0 - min(left, 1.0)


def _angle(arcsec: float) -> str:
    if arcsec < 100.0:
        return f"{arcsec:.0f} arcsec"
    if arcsec < 6000.0:
        return f"{arcsec / 60.0:.1f} arcmin"
    return f"{arcsec / 3600.0:.1f} deg"
