"""From sightings to the axis, its error and everything worth saying: what the callers use."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import angle_between
from app.core.hint import Site
from app.polar.axis_fit import AxisFit, fit_axis
from app.polar.bending import UNKNOWN, Droop
from app.polar.combine import Look, combined
from app.polar.diagnose import OF_BENDING, findings_of, of_bending
from app.polar.error import PolarError
from app.polar.findings import Finding
from app.polar.horizon import STANDARD_AIR, Air
from app.polar.movement import Movement, find_movement
from app.polar.poles import Pole, pole_direction
from app.polar.rotations import rotation_vector
from app.polar.sighting import LocalAttitude, Sighting, to_local

Floats = NDArray[np.float64]

LEAST_TURN_RAD = np.radians(0.25)
"""Below this no axis is given at all."""

TOO_LARGE = 0.02
"""Residuals less probable than this by their stated errors alone widen the covariance."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Where and how the alignment is judged."""

    site: Site
    pole: Pole = Pole.REFRACTED
    air: Air = STANDARD_AIR


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """An axis measured from one sweep, or from several with different declinations.

    ``fit`` is that of the last sweep; ``error`` combines all. ``looks`` are the errors of the
    single sweeps, ``before`` what was known of the tube's droop before them and ``droop`` what is
    now. ``last_of_fit`` is the last attitude of the fitted sweep, ``time_utc`` that of the last
    frame.
    """

    error: PolarError
    fit: AxisFit
    attitudes: tuple[LocalAttitude, ...]
    last_of_fit: LocalAttitude
    settings: Settings
    time_utc: datetime
    findings: tuple[Finding, ...] = ()
    movement: Movement | None = None
    looks: tuple[Look, ...] = ()
    before: Droop = UNKNOWN
    droop: Droop = UNKNOWN

    @property
    def turn_deg(self) -> float:
        """How far the axis turned from the first to the furthest frame."""
        return float(np.degrees(self.fit.turn_rad))

    @property
    def rho_deg(self) -> float:
        """Angle between boresight and axis."""
        return float(np.degrees(_rho_rad(self.fit)))


@dataclass(frozen=True, slots=True)
class NoAxis:
    """No axis can be had from these frames: why, and one thing to do next."""

    reason: str
    advice: str


def measure(sightings: Sequence[Sighting], settings: Settings) -> Measurement | NoAxis:
    """The axis of two or more sightings, with its error from the pole and what is to be said."""
    return measure_local([to_local(s, settings.site, settings.air) for s in sightings], settings)


def measure_local(
    attitudes: Sequence[LocalAttitude], settings: Settings, before: Droop = UNKNOWN
) -> Measurement | NoAxis:
    """The same from attitudes already among the things on the ground.

    ``before`` is what earlier sweeps with this tube have told of its droop.
    """
    towards = pole_direction(settings.site, settings.pole, settings.air)
    sweeps = _sweeps(attitudes)
    if not sweeps:
        return NoAxis(
            "an axis needs two frames or more of one sweep",
            "Turn the mount about its RA axis and take another frame.",
        )
    if refusal := _too_alike(sweeps):
        return refusal
    fits = [fit_axis(sweep, towards) for sweep in sweeps]
    movement = _first_movement(sweeps, fits, towards)
    looks = [Look(_error(fit, towards), _rho_rad(fit)) for fit in fits]
    whole = combined(looks, before)
    return Measurement(
        error=whole.error,
        fit=fits[-1],
        attitudes=tuple(attitudes),
        last_of_fit=sweeps[-1][-1],
        settings=settings,
        time_utc=max(a.time_utc for a in attitudes),
        findings=tuple(findings_of(sweeps, fits, looks, whole, movement, settings)),
        movement=movement,
        looks=tuple(looks),
        before=before,
        droop=whole.droop,
    )


def _sweeps(attitudes: Sequence[LocalAttitude]) -> list[list[LocalAttitude]]:
    numbers = sorted({a.sweep for a in attitudes})
    groups = [[a for a in attitudes if a.sweep == n] for n in numbers]
    return [group for group in groups if len(group) >= 2]


def _first_movement(
    sweeps: Sequence[Sequence[LocalAttitude]], fits: Sequence[AxisFit], towards: Floats
) -> Movement | None:
    found = (find_movement(s, f, towards) for s, f in zip(sweeps, fits, strict=True))
    return next((movement for movement in found if movement is not None), None)


def _too_alike(sweeps: Sequence[Sequence[LocalAttitude]]) -> NoAxis | None:
    for sweep in sweeps:
        first = sweep[0].matrix
        turned = max(float(np.linalg.norm(rotation_vector(a.matrix @ first.T))) for a in sweep)
        if turned < LEAST_TURN_RAD:
            return NoAxis(
                f"the frames are too alike: only {np.degrees(turned):.2f} deg between them",
                "Turn the RA axis by 30 deg or more between the first and the last frame.",
            )
    return None


def _error(fit: AxisFit, pole: Floats) -> PolarError:
    """The error of one fit; residuals too large for noise widen its covariance."""
    widen = fit.chi2 / fit.freedom if fit.chance < TOO_LARGE else 1.0
    return PolarError(fit.axis, pole, fit.covariance * widen)


def _rho_rad(fit: AxisFit) -> float:
    return angle_between(fit.axis, fit.reference[:, 2])


def together(first: Measurement, again: Measurement) -> Measurement:
    """The second of two measurements, with the error of both: the bolts were left alone between.

    What one of them had to say of its frames is said of both; what is said of bending is new.
    """
    looks = (*first.looks, *again.looks)
    whole = combined(looks, first.before)
    said = {f.kind: f for f in (*again.findings, *first.findings) if f.kind not in OF_BENDING}
    return replace(
        again, error=whole.error, looks=looks, before=first.before, droop=whole.droop,
        findings=(*said.values(), *of_bending(looks, whole)),
    )  # fmt: skip
