"""From sightings to the axis, its error and everything worth saying: what the callers use."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from app.core.hint import Site
from app.polar.axis_fit import AxisFit, fit_axis
from app.polar.diagnose import findings_of
from app.polar.error import PolarError
from app.polar.findings import Finding
from app.polar.horizon import STANDARD_AIR, Air
from app.polar.movement import UNLIKELY, Movement, find_movement
from app.polar.poles import Pole, pole_direction
from app.polar.rotations import angle_between, rotation_vector, tangents
from app.polar.sighting import LocalAttitude, Sighting, to_local

Floats = NDArray[np.float64]

LEAST_TURN_RAD = np.radians(0.25)
"""Below this no axis is given at all."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Where and how the alignment is judged."""

    site: Site
    pole: Pole = Pole.REFRACTED
    air: Air = STANDARD_AIR


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """An axis measured from one sweep, or from several with different declinations.

    ``fit`` is that of the last sweep; ``error`` combines all. ``repeats`` are the errors of the
    single sweeps when there are several. ``last_of_fit`` is the last attitude of the fitted
    sweep, ``time_utc`` that of the last frame.
    """

    error: PolarError
    fit: AxisFit
    attitudes: tuple[LocalAttitude, ...]
    last_of_fit: LocalAttitude
    settings: Settings
    time_utc: datetime
    findings: tuple[Finding, ...] = ()
    movement: Movement | None = None
    repeats: tuple[PolarError, ...] = ()

    @property
    def turn_deg(self) -> float:
        """How far the axis turned from the first to the furthest frame."""
        return float(np.degrees(self.fit.turn_rad))

    @property
    def rho_deg(self) -> float:
        """Angle between boresight and axis."""
        return float(np.degrees(angle_between(self.fit.axis, self.fit.reference[:, 2])))


@dataclass(frozen=True, slots=True)
class NoAxis:
    """No axis can be had from these frames: why, and one thing to do next."""

    reason: str
    advice: str


def measure(sightings: Sequence[Sighting], settings: Settings) -> Measurement | NoAxis:
    """The axis of two or more sightings, with its error from the pole and what is to be said."""
    return measure_local([to_local(s, settings.site, settings.air) for s in sightings], settings)


def measure_local(attitudes: Sequence[LocalAttitude], settings: Settings) -> Measurement | NoAxis:
    """The same from attitudes already among the things on the ground."""
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
    errors = [_error(fit, towards) for fit in fits]
    return Measurement(
        error=combined(errors, towards),
        fit=fits[-1],
        attitudes=tuple(attitudes),
        last_of_fit=sweeps[-1][-1],
        settings=settings,
        time_utc=max(a.time_utc for a in attitudes),
        findings=tuple(findings_of(sweeps, fits, errors, movement)),
        movement=movement,
        repeats=tuple(errors) if len(errors) > 1 else (),
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
    widen = fit.chi2 / fit.freedom if fit.chance < UNLIKELY else 1.0
    return PolarError(fit.axis, pole, fit.covariance * widen)


def together(first: Measurement, again: Measurement) -> Measurement:
    """The second of two measurements, with the error of both: nothing was moved between them."""
    error = combined([first.error, again.error], again.error.pole)
    return replace(again, error=error)


def combined(errors: Sequence[PolarError], pole: Floats) -> PolarError:
    """Several errors of one axis as one, each weighted with the inverse of its covariance."""
    if len(errors) == 1:
        return errors[0]
    weights = [np.linalg.inv(e.covariance) for e in errors]
    covariance = np.linalg.inv(np.sum(weights, axis=0))
    base = errors[0].axis
    upward, clockwise = tangents(base)
    gaps = [np.array([e.axis @ upward, e.axis @ clockwise]) for e in errors]
    mean = covariance @ np.sum([w @ g for w, g in zip(weights, gaps, strict=True)], axis=0)
    axis = base + mean[0] * upward + mean[1] * clockwise
    spread = sum(float(g @ w @ g) for w, g in zip(weights, gaps - mean, strict=True))
    widen = max(1.0, spread / (2 * (len(errors) - 1)))
    return PolarError(axis / np.linalg.norm(axis), pole, covariance * widen)
