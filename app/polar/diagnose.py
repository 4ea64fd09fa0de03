"""What is wrong, or may be, with the frames an axis was measured from; one check a function."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from app.core.attitude import angle_between
from app.polar.axis_fit import AxisFit
from app.polar.bending import TUBE_ARCSEC
from app.polar.combine import Combined, Look
from app.polar.error import PolarError
from app.polar.findings import Finding, Kind
from app.polar.movement import UNLIKELY, Movement
from app.polar.poles import Pole, pole_direction
from app.polar.rotations import ARCSEC
from app.polar.sighting import LocalAttitude

if TYPE_CHECKING:
    from app.polar.measure import Settings

SMALL_TURN_DEG = 15.0
ALIKE_DEG = 2.0
LOW_DEG = 15.0
FAR_DEG = 10.0
EQUATOR_DEG, WORTH_TELLING_ARCSEC = 15.0, 60.0
FLEXURE_ARCSEC = 30.0
"""What a sweep cannot see of flexure, and what small mounts commonly have."""

RESTLESS_ARCSEC = 10.0  # residuals that are no fault, only larger than the frames' own errors

HARDLY = 0.8
"""A droop that is still so doubtful, in what it was before, has not been seen."""

OF_BENDING = (Kind.UNSEEN_FLEXURE, Kind.FLEXURE, Kind.DROOP)

DISAGREE = 0.01
"""Sweeps whose chi-square is less probable than this do not share one axis and droop."""


def findings_of(
    sweeps: Sequence[Sequence[LocalAttitude]],
    fits: Sequence[AxisFit],
    looks: Sequence[Look],
    whole: Combined,
    movement: Movement | None,
    settings: "Settings",
) -> list[Finding]:
    """Everything worth saying of a measurement, most important first."""
    errors = [look.error for look in looks]
    attitudes = [attitude for sweep in sweeps for attitude in sweep]
    return [
        *_place_and_time(attitudes, errors[0]),
        *_movement(fits, movement),
        *_turn(fits, errors),
        *_low(attitudes),
        *_pole(errors[0], settings),
        *of_bending(looks, whole),
    ]


def _place_and_time(attitudes: Sequence[LocalAttitude], error: PolarError) -> Iterator[Finding]:
    below = min(attitudes, key=lambda a: a.altitude_deg)
    if below.altitude_deg < 0.0:
        yield Finding(
            Kind.SITE_OR_TIME,
            f"{below.label or 'A frame'} would look {-below.altitude_deg:.0f} deg below the"
            " horizon: the site, the time or the time zone is wrong.",
        )
    elif (off := error.total_arcsec / 3600.0) > FAR_DEG:
        yield Finding(
            Kind.FAR,
            f"The axis is {off:.0f} deg from the pole: was it the RA axis that turned, and are"
            " the site and the time right?",
        )


def _movement(fits: Sequence[AxisFit], movement: Movement | None) -> Iterator[Finding]:
    if movement is not None:
        size = f"{abs(movement.angle_arcsec) / 60.0:.1f}'"
        told = f"between {movement.before} and {movement.after}"
        if movement.what == "declination":
            yield Finding(
                Kind.DEC_MOVED,
                f"The declination axis moved by {size} {told}: lock it, and start again.",
            )
        else:
            yield Finding(
                Kind.CAMERA_TURNED,
                f"The camera turned by {size} in its holder {told}: tighten it, and start again.",
            )
        return
    if all(fit.freedom <= 0 for fit in fits):
        yield Finding(
            Kind.UNCHECKED,
            "Two frames share an axis whatever happened: only a third shows whether the declination"
            " or the camera moved between them.",
        )
    for fit in fits:
        if fit.chance < UNLIKELY:
            worst = float(np.abs(fit.residuals[:, :2]).max()) / ARCSEC
            if worst < RESTLESS_ARCSEC:
                yield Finding(
                    Kind.RESTLESS,
                    f'The frames are up to {worst:.0f}" apart, more than their errors: wind or'
                    " bending; the uncertainty is widened by it.",
                )
                return
            yield Finding(
                Kind.DISAGREE,
                f'The frames do not share one axis ({worst:.0f}" apart, far beyond their errors):'
                " something gave way or flexed, or the tripod was touched; start again.",
            )
            return


def _turn(fits: Sequence[AxisFit], errors: Sequence[PolarError]) -> Iterator[Finding]:
    turn = max(float(np.degrees(fit.turn_rad)) for fit in fits)
    sigma = min(error.uncertainty_arcsec for error in errors)
    if turn < ALIKE_DEG:
        yield Finding(
            Kind.ALIKE,
            f"The frames are nearly alike: only {turn:.1f} deg of turn, so the axis is known to"
            f' {sigma:.0f}" at best; turn at least 30 deg.',
        )
    elif turn < SMALL_TURN_DEG:
        yield Finding(
            Kind.SMALL_TURN,
            f'Only {turn:.0f} deg of turn: the axis is known to {sigma:.0f}"; turn further.',
        )


def _low(attitudes: Sequence[LocalAttitude]) -> Iterator[Finding]:
    lowest = min(attitudes, key=lambda a: a.altitude_deg)
    if 0.0 <= lowest.altitude_deg < LOW_DEG:
        yield Finding(
            Kind.LOW,
            f"{lowest.label or 'A frame'} is only {lowest.altitude_deg:.0f} deg high, where the"
            " air bends light by minutes of arc and not always as computed; stay above"
            f" {LOW_DEG:.0f} deg.",
        )


def _pole(error: PolarError, settings: "Settings") -> Iterator[Finding]:
    """Near the Earth's equator the air lifts the pole by far more than what is observed."""
    if settings.pole is Pole.TRUE or abs(settings.site.latitude_deg) > EQUATOR_DEG:
        return
    true = pole_direction(settings.site, Pole.TRUE, settings.air)
    lifted = angle_between(error.pole, true) / ARCSEC
    if lifted < WORTH_TELLING_ARCSEC:
        return
    yield Finding(
        Kind.POLE,
        f"So near the equator the air lifts the {settings.pole} pole by {lifted / 60.0:.1f}', and"
        " what stands high by far less: aligned to the true pole the mount tracks better.",
    )


def of_bending(looks: Sequence[Look], whole: Combined) -> Iterator[Finding]:
    """What the sweeps tell of bending together, or that they do not."""
    first, last = looks[0].error, looks[-1].error
    if whole.chance < DISAGREE:
        apart = angle_between(first.axis, last.axis) / ARCSEC
        yield Finding(
            Kind.FLEXURE,
            f'The sweeps disagree by {apart:.0f}", more than their errors and a tube that droops'
            " explain: that much at least is flexure or play, and the axis may be further off"
            " than that.",
        )
        return
    droop = whole.droop
    if droop.sigma_arcsec > HARDLY * TUBE_ARCSEC:
        yield from _unseen(whole.error, len(looks))
    elif len(looks) > 1 and abs(droop.arcsec) > 2.0 * droop.sigma_arcsec:
        way = "sinks" if droop.arcsec > 0 else "rises"
        yield Finding(
            Kind.DROOP,
            f'The tube {way} by {abs(droop.arcsec):.0f}" ± {droop.sigma_arcsec:.0f}" between'
            " zenith and horizon: that is taken out of the axis.",
        )


def _unseen(error: PolarError, sweeps: int) -> Iterator[Finding]:
    """What bending may still hide; nothing where noise is larger, or at a pole of the Earth."""
    if error.uncertainty_arcsec >= FLEXURE_ARCSEC or error.unseen_total_arcsec < 1.0:
        return
    one = "One sweep cannot" if sweeps == 1 else "Sweeps at nearly one declination cannot"
    yield Finding(
        Kind.UNSEEN_FLEXURE,
        f"{one} show flexure: a tube that bends as most do shifts the axis by"
        f' {error.unseen_total_arcsec:.0f}" (one sigma), which the ± counts; a second sweep at'
        " another declination shows it.",
    )
