"""From sightings to the axis, its error and everything worth saying: what the callers use."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from enum import StrEnum
from itertools import pairwise

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, angle_between, rotation_vector
from kochab.core.camera import Camera
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_RAD_S
from kochab.core.values import frozen
from kochab.polar.axis_fit import (
    UNLIKELY,
    AxisFit,
    Movement,
    average_over_fault_models,
    find_movement,
    fit_axis,
    merge_frames_of_one_place,
    undetected_creep_covariance,
)
from kochab.polar.error import CHI2_95, PolarError, angle_in_words
from kochab.polar.flexure import TUBE_ARCSEC, UNKNOWN, CombinedSweeps, Droop, SweepResult, combine_sweeps
from kochab.polar.pole import Pole, pole_direction, tracking_rad_s
from kochab.polar.rotations import about
from kochab.polar.seen_axis import Cause
from kochab.polar.sighting import LocalAttitude, Sighting, cropped, same_optics, to_local, with_one_camera
from kochab.sky.horizon import STANDARD_REFRACTION, Refraction
from kochab.text.translation import tr, tr_noop


class PolarFindingKind(StrEnum):
    """What a finding is about."""

    SMALL_TURN = "small turn"
    TURN_TOO_SMALL = "turn too small"
    LOW = "frame too low"
    DEC_MOVED = "declination moved"
    CAMERA_TURNED = "camera turned in its holder"
    MOUNT_MOVED = "tripod or bolt moved"
    ONE_FRAME = "one frame off the others' axis"
    DISAGREE = "frames do not share one axis"
    SCATTER_TOO_LARGE = "scatter larger than noise"
    UNCHECKED = "two frames only"
    SLIPPING = "clutch slips"
    FLEXURE = "flexure"
    FLEXURE_NOT_MEASURED = "flexure not measured"
    DROOP = "tube sags"
    SITE_OR_TIME = "site or time implausible"
    FAR = "far from the pole"
    POLE = "which pole"
    DONE = "error below its uncertainty"
    REMEASURE = "measure again"
    TWO_CAMERAS = "two cameras"
    CROPPED = "cropped among whole frames"
    NIGHTS = "different nights"
    CLOCK = "time zone or clock"
    ON_TRUST = "site and clock as they were said"
    LONGITUDE_SIGN = "longitude without a sign"
    FIXED_TRIPOD = "fixed tripod"
    TOO_FEW = "too few frames"
    GUIDED = "guided"
    UNSEEN = "not seen by drift"
    DEC_SIGN = "direction of Dec unknown"


@frozen
class PolarFinding:
    """One sentence for the person, and what it is about; no bolt is to be turned after one that ``spoils``.

    ``unsettled`` says that the axis rests on two frames alone, or on a word of somebody's that nothing bears out.
    """

    kind: PolarFindingKind
    text: str
    spoils: bool = False
    unsettled: bool = False


SMALL_TURN_DEG = 15.0  # the uncertainty goes as 1 / sin(turn / 2)
USEFUL_TURN_DEG = 2.0
LOW_DEG = 15.0
FAR_DEG = 10.0
NIGHT_HOURS = 8.0
EQUATOR_DEG, POLES_APART_ARCSEC = 15.0, 60.0
FLEXURE_ARCSEC = 30.0  # what a sweep cannot see of flexure, and what small mounts commonly have
SCATTER_ARCSEC = 60.0  # residuals below this are no fault, only larger than the frames' own errors
HARDLY = 0.8  # a droop whose sigma is still above this share of the usual one has not been measured

FLEXURE_KINDS = (PolarFindingKind.FLEXURE_NOT_MEASURED, PolarFindingKind.FLEXURE, PolarFindingKind.DROOP)

DISAGREE = 0.01  # sweeps whose chi-square is less probable than this do not share one axis and droop
CLUTCH_DEG, CLUTCH_SHARE = 1.5, 0.1  # a mount counts its motor's steps to a part in a thousand: more is its clutch


def findings_of(
    sweeps: Sequence[Sequence[LocalAttitude]],
    fits: Sequence[AxisFit],
    combined: CombinedSweeps,
    results: Sequence[SweepResult],
    movement: Movement | None,
    settings: "MeasureSettings",
) -> list[PolarFinding]:
    """Everything a person should know about a measurement, most important first.

    Parameters
    ----------
    sweeps : Sequence[Sequence[LocalAttitude]]
        The attitudes of each sweep.
    fits : Sequence[AxisFit]
        The axis fitted to each.
    combined : CombinedSweeps
        All sweeps together.
    results : Sequence[SweepResult]
        What each sweep says of the polar error.
    movement : Movement or None
        How Dec or the camera moved between frames; None: not seen.
    settings : MeasureSettings
        Site, pole and refraction of the measurement.
    """
    errors = [result.error for result in results]
    lowest = min((a for sweep in sweeps for a in sweep), key=lambda a: a.altitude_deg)
    return [
        *_one_night(sweeps),
        *_place_and_time(lowest, errors[0]),
        *_movement(fits, movement),
        *_turn(fits, errors),
        *_low(lowest),
        *_pole(errors[0], settings),
        *flexure_findings(results, combined),
    ]


def _one_night(sweeps: Sequence[Sequence[LocalAttitude]]) -> Iterator[PolarFinding]:
    """Frames of two cameras, or of two nights, share no axis."""
    for sweep in sweeps:
        for one, other in pairwise(sorted(sweep, key=lambda frame: frame.time_utc)):
            names = {"one": one.label or tr("A frame"), "other": other.label or tr("another")}
            hours = (other.time_utc - one.time_utc).total_seconds() / 3600.0
            if hours > NIGHT_HOURS:
                text = tr(
                    "{one} and {other} are {hours:.0f} h apart. Use frames of one night, and leave the tripod alone.",
                    hours=hours,
                    **names,
                )
                yield PolarFinding(PolarFindingKind.NIGHTS, text, spoils=True)
                return
            if one.camera is None or other.camera is None or same_optics(one.camera, other.camera):
                continue
            if cropped(one.camera, other.camera):
                small = min(
                    (one, other), key=lambda frame: frame.camera.width * frame.camera.height if frame.camera else 0
                )
                text = tr("{frame} is cropped, the others are larger. Use full frames only.", frame=_name(small))
                yield PolarFinding(PolarFindingKind.CROPPED, text, spoils=True)
                return
            text = tr("{one} and {other} are of different cameras or focal lengths. Use frames of one.", **names)
            yield PolarFinding(PolarFindingKind.TWO_CAMERAS, text, spoils=True)
            return


BELOW = tr_noop("{frame} would be {low:.0f}° below the horizon. Check the site, the time and the time zone.")


def _name(frame: LocalAttitude) -> str:
    return frame.label or tr("A frame")


def _place_and_time(lowest: LocalAttitude, error: PolarError) -> Iterator[PolarFinding]:
    if lowest.altitude_deg < 0.0:
        yield PolarFinding(
            PolarFindingKind.SITE_OR_TIME, tr(BELOW, frame=_name(lowest), low=-lowest.altitude_deg), spoils=True
        )
    elif (off := error.total_arcsec / 3600.0) > FAR_DEG:
        yield PolarFinding(
            PolarFindingKind.FAR,
            tr("The axis is {off:.0f}° from the pole. Check the site and the time, and that only RA turned.", off=off),
            spoils=True,
        )


ALLOWED_FOR = {
    Cause.DECLINATION: tr_noop(
        "Declination moved by {angle} between {before} and {after}. Lock it; the axis allows for it."
    ),
    Cause.CAMERA: tr_noop(
        "The camera rotated in its holder by {angle} between {before} and {after}. Tighten it; the axis allows for it."
    ),
    Cause.TUBE: tr_noop(
        "The camera or its tube was knocked by {angle} between {before} and {after}. Tighten it; the axis allows for"
        " it."
    ),
}
MOVED = {
    Cause.DECLINATION: tr_noop("Declination moved by {angle} between {before} and {after}. Lock it and start again."),
    Cause.CAMERA: tr_noop(
        "The camera rotated in its holder by {angle} between {before} and {after}. Tighten it and start again."
    ),
    Cause.TUBE: tr_noop(
        "The camera or its tube was knocked by {angle} between {before} and {after}. Tighten it and start again."
    ),
    Cause.MOUNT: tr_noop(
        "The tripod or a bolt moved by {angle} between {before} and {after}. Leave both alone and start again."
    ),
    Cause.FRAME: tr_noop(
        "{before} is {angle} off the axis of the others: its time is wrong, or the mount still moved. Leave it out."
    ),
}
LEFT_OPEN = tr_noop(
    "Declination, the tripod or a bolt moved by about {angle} between {before} and {after}. Lock it, leave the bolts"
    " alone and start again."
)
LEFT_OPEN_CAMERA = tr_noop(
    "Declination, the camera, the tripod or a bolt moved by about {angle} between {before} and {after}. Lock both,"
    " leave the bolts alone and start again."
)
TURNED = {
    True: tr_noop(
        "The mount flipped, or declination or the camera was turned, by {angle} between {before} and {after}. The axis"
        " allows for it."
    ),
    False: tr_noop(
        "The mount flipped, or declination or the camera was turned, by {angle} between {before} and {after}. Rotate RA"
        " alone and start again."
    ),
}
"""By whether the axis allows for it."""

KIND_OF = {
    Cause.DECLINATION: PolarFindingKind.DEC_MOVED,
    Cause.CAMERA: PolarFindingKind.CAMERA_TURNED,
    Cause.TUBE: PolarFindingKind.CAMERA_TURNED,
    Cause.MOUNT: PolarFindingKind.MOUNT_MOVED,
    Cause.FRAME: PolarFindingKind.ONE_FRAME,
}


def _moved_in_words(movement: Movement) -> str:
    """What the frames can tell of a movement, and no more."""
    if movement.turned:
        return TURNED[movement.explains]
    if movement.explains:
        return ALLOWED_FOR[movement.what]
    if movement.causes == (movement.what,):
        return MOVED[movement.what]
    return LEFT_OPEN_CAMERA if {Cause.CAMERA, Cause.TUBE} & set(movement.causes) else LEFT_OPEN


def _movement(fits: Sequence[AxisFit], movement: Movement | None) -> Iterator[PolarFinding]:
    if movement is not None:
        angle, of_them = angle_in_words(movement.angle_arcsec), {"before": movement.before, "after": movement.after}
        text = tr(_moved_in_words(movement), angle=angle, **of_them)
        yield PolarFinding(KIND_OF[movement.what], text, spoils=not movement.explains)
        return
    if all(fit.freedom <= 0 for fit in fits):
        yield PolarFinding(
            PolarFindingKind.UNCHECKED,
            tr(
                "Two frames can't show whether only RA moved, or whether both times are right. Keep Dec locked."
                " Take a third before you turn a bolt."
            ),
            unsettled=True,
        )
    for fit in fits:
        if fit.chance < UNLIKELY:
            worst = float(np.abs(fit.residuals[:, :2]).max()) / ARCSEC
            if worst < SCATTER_ARCSEC:
                yield PolarFinding(
                    PolarFindingKind.SCATTER_TOO_LARGE,
                    tr(
                        "The frames scatter by up to {worst:.0f}″: wind or flexure. The uncertainty includes it.",
                        worst=worst,
                    ),
                )
            else:
                yield PolarFinding(
                    PolarFindingKind.DISAGREE,
                    tr(
                        "The frames do not share one axis ({angle} apart). Something slipped or flexed, or the tripod"
                        " moved: start again.",
                        angle=angle_in_words(worst),
                    ),
                    spoils=True,
                )
            return


def _turn(fits: Sequence[AxisFit], errors: Sequence[PolarError]) -> Iterator[PolarFinding]:
    turn = max(float(np.degrees(fit.turn_rad)) for fit in fits)
    sigma = angle_in_words(min(error.uncertainty_arcsec for error in errors))
    if turn < USEFUL_TURN_DEG:
        yield PolarFinding(
            PolarFindingKind.TURN_TOO_SMALL,
            tr("RA rotated by only {turn:.1f}°: ± {sigma} at best. Rotate by at least 30°.", turn=turn, sigma=sigma),
            spoils=True,
        )
    elif turn < SMALL_TURN_DEG:
        yield PolarFinding(
            PolarFindingKind.SMALL_TURN,
            tr("RA rotated by only {turn:.0f}°: the uncertainty is {sigma}. Rotate further.", turn=turn, sigma=sigma),
        )


TOO_LOW = tr_noop(
    "{frame} is only {high:.0f}° above the horizon, where refraction is large and hard to predict."
    " Stay above {least:.0f}°."
)


def _low(lowest: LocalAttitude) -> Iterator[PolarFinding]:
    if 0.0 <= lowest.altitude_deg < LOW_DEG:
        yield PolarFinding(
            PolarFindingKind.LOW, tr(TOO_LOW, frame=_name(lowest), high=lowest.altitude_deg, least=LOW_DEG)
        )


def _pole(error: PolarError, settings: "MeasureSettings") -> Iterator[PolarFinding]:
    """Near the Earth's equator refraction lifts the pole by far more than what is observed."""
    if settings.pole is Pole.TRUE or abs(settings.site.latitude_deg) > EQUATOR_DEG:
        return
    true = pole_direction(settings.site, Pole.TRUE, settings.refraction)
    lifted = angle_between(error.pole, true) / ARCSEC
    if lifted >= POLES_APART_ARCSEC:
        yield PolarFinding(
            PolarFindingKind.POLE,
            tr(
                "This close to the equator, refraction lifts the pole by {angle}, but stars higher up by far"
                " less. Align to the true pole for better tracking.",
                angle=angle_in_words(lifted),
            ),
        )


def flexure_findings(results: Sequence[SweepResult], combined: CombinedSweeps) -> Iterator[PolarFinding]:
    """What the sweeps show of flexure together, or that they do not."""
    droop, error = combined.droop, combined.error
    if combined.chance < DISAGREE:
        apart = angle_between(results[0].error.axis, results[-1].error.axis) / ARCSEC
        yield PolarFinding(
            PolarFindingKind.FLEXURE,
            tr(
                "The sweeps disagree by {angle}, more than their errors and a sagging tube explain: flexure or"
                " backlash. The axis may be off by more than that.",
                angle=angle_in_words(apart),
            ),
        )
    elif droop.sigma_arcsec > HARDLY * TUBE_ARCSEC:
        # Nothing to say where noise is larger anyway, or at a pole of the Earth.
        if error.uncertainty_arcsec >= FLEXURE_ARCSEC or error.flexure_total_arcsec < 1.0:
            return
        text = (
            tr("Flexure not measured (±{flexure:.0f}″ assumed). Sweep again at another declination to measure it.")
            if len(results) == 1
            else tr(
                "Flexure not measured (±{flexure:.0f}″ assumed; the sweeps are too close in declination)."
                " Sweep again at another declination to measure it."
            )
        )
        text = text.format(flexure=error.flexure_total_arcsec)
        yield PolarFinding(PolarFindingKind.FLEXURE_NOT_MEASURED, text)
    elif len(results) > 1 and abs(droop.arcsec) > 2.0 * droop.sigma_arcsec:
        text = (
            tr("The tube sags by {by:.0f}″ ± {sigma:.0f}″ from zenith to horizon. The axis is corrected for it.")
            if droop.arcsec > 0
            else tr("The tube rises by {by:.0f}″ ± {sigma:.0f}″ from zenith to horizon. The axis is corrected for it.")
        )
        yield PolarFinding(PolarFindingKind.DROOP, text.format(by=abs(droop.arcsec), sigma=droop.sigma_arcsec))


def slipping(asked_deg: float, turned_deg: float) -> PolarFinding | None:
    """A finding when the turn that the mount reports and the one the frames show differ."""
    if abs(abs(asked_deg) - abs(turned_deg)) <= CLUTCH_DEG + CLUTCH_SHARE * abs(asked_deg):
        return None
    return PolarFinding(
        PolarFindingKind.SLIPPING,
        tr(
            "The mount reports a turn of {asked:.0f}°, the frames show {turned:.0f}°: the RA clutch slips, or its gears"
            " are not engaged.",
            asked=abs(asked_deg),
            turned=abs(turned_deg),
        ),
    )


LEAST_TURN_RAD = np.radians(0.25)  # below this no axis is given at all
STILL_SHARE, SEEN_SIGMAS = 0.1, 3.0  # of the sky's own turn, and how well that has to be seen, for a camera at rest
TOO_LARGE = 0.02  # residuals less probable than this by their stated errors alone widen the covariance


@frozen
class MeasureSettings:
    """The site, the pole to align to, and the atmosphere."""

    site: Site
    pole: Pole = Pole.REFRACTED
    refraction: Refraction = STANDARD_REFRACTION


@frozen(eq=False)
class Measurement:
    """An axis measured from one sweep, or from several with different declinations.

    ``fit`` is that of the last sweep; ``error`` combines all. ``results`` are the errors of the single sweeps,
    ``before`` what was known of the tube's droop before them and ``droop`` what is now. ``last_of_fit`` is the last
    attitude of the fitted sweep, ``time_utc`` that of the last frame. ``camera`` is what all frames share.
    """

    error: PolarError
    fit: AxisFit
    attitudes: tuple[LocalAttitude, ...]
    last_of_fit: LocalAttitude
    settings: MeasureSettings
    time_utc: datetime
    findings: tuple[PolarFinding, ...] = ()
    movement: Movement | None = None
    results: tuple[SweepResult, ...] = ()
    before: Droop = UNKNOWN
    droop: Droop = UNKNOWN
    camera: Camera | None = None

    @property
    def spoilt(self) -> bool:
        """Whether no bolt is to be turned after it."""
        return any(finding.spoils for finding in self.findings)

    @property
    def unsettled(self) -> bool:
        """Whether it is good, but rests on what nothing bears out."""
        return not self.spoilt and any(finding.unsettled for finding in self.findings)

    @property
    def checked(self) -> bool:
        """Whether the frames could have shown that something moved: two alone fit an axis whatever moved."""
        return all(finding.kind is not PolarFindingKind.UNCHECKED for finding in self.findings)

    @property
    def turn_deg(self) -> float:
        """How far the axis turned from the first to the furthest frame."""
        return float(np.degrees(self.fit.turn_rad))

    @property
    def rho_deg(self) -> float:
        """Angle between boresight and axis."""
        return float(np.degrees(_rho_rad(self.fit)))


def axis_shift_arcsec(error: PolarError, site: Site, sky_deg: float, within: float = CHI2_95) -> float:
    """How far the axis would be from where it is said to be, under a turned sky; 0 within its ellipse.

    Parameters
    ----------
    error : PolarError
        The polar error as measured.
    site : Site
        Where the mount stands.
    sky_deg : float
        By how much the sky is turned about its pole, degrees.
    within : float
        The ellipse's size as a squared distance in sigmas.
    """
    axis = about(pole_direction(site, Pole.TRUE), np.radians(sky_deg)) @ error.axis
    inside = error.with_systematics.distance2(axis) <= within
    return 0.0 if inside else angle_between(axis, error.axis) / ARCSEC


@frozen
class NoAxis:
    """No axis can be had from these frames: why, and one thing to do next."""

    reason: str
    advice: str
    kind: PolarFindingKind = PolarFindingKind.TOO_FEW

    @property
    def sentence(self) -> str:
        """Both, for a person."""
        return f"{self.reason[0].upper()}{self.reason[1:]}. {self.advice}"


def measure(sightings: Sequence[Sighting], settings: MeasureSettings) -> Measurement | NoAxis:
    """The axis of two or more sightings, with its error from the pole and findings."""
    return measure_local([to_local(s, settings.site, settings.refraction) for s in sightings], settings)


def measure_local(
    attitudes: Sequence[LocalAttitude], settings: MeasureSettings, before: Droop = UNKNOWN
) -> Measurement | NoAxis:
    """The same from attitudes already in E, N, U.

    ``before`` is what earlier sweeps with this tube have shown of its droop.
    """
    towards = pole_direction(settings.site, settings.pole, settings.refraction)
    attitudes, camera = with_one_camera(attitudes)
    # by_place means attitudes, which have to be of one camera for that.
    attitudes = merge_frames_of_one_place(attitudes, towards, tracking_rad_s(settings.site))
    sweeps = _sweeps(attitudes)
    if not sweeps:
        return NoAxis(tr("an axis needs at least two frames of one sweep"), tr("Rotate RA and take another frame."))
    if refusal := _too_alike(sweeps):
        return refusal
    fits = [fit_axis(sweep, towards) for sweep in sweeps]
    movements = [find_movement(s, f, towards) for s, f in zip(sweeps, fits, strict=True)]
    movement = next((m for m in movements if m is not None), None)
    used = [_used(*each, towards) for each in zip(sweeps, fits, movements, strict=True)]
    results = [SweepResult(replace(_error(fit, towards), creep=creep), _rho_rad(fit)) for fit, creep in used]
    fits = [fit for fit, _ in used]
    combined = combine_sweeps(results, before)
    return Measurement(
        error=combined.error,
        fit=fits[-1],
        attitudes=tuple(attitudes),
        last_of_fit=sweeps[-1][-1],
        settings=settings,
        time_utc=max(a.time_utc for a in attitudes),
        findings=tuple(findings_of(sweeps, fits, combined, results, movement, settings)),
        movement=movement,
        results=tuple(results),
        before=before,
        droop=combined.droop,
        camera=camera,
    )


def _used(
    sweep: Sequence[LocalAttitude], fit: AxisFit, movement: Movement | None, towards: Floats
) -> tuple[AxisFit, Floats]:
    """The fit to go by, one that knows what moved where frames share no axis, and creep (2, 2) that doesn't show."""
    if movement is not None and movement.explains:
        return movement.fit, np.zeros((2, 2))  # its covariance counts what moved
    if fit.chance < UNLIKELY:
        return average_over_fault_models(sweep, fit, towards), np.zeros((2, 2))
    return fit, undetected_creep_covariance(sweep, fit)


def _sweeps(attitudes: Sequence[LocalAttitude]) -> list[list[LocalAttitude]]:
    numbers = sorted({a.sweep for a in attitudes})
    groups = ([a for a in attitudes if a.sweep == n] for n in numbers)
    return [group for group in groups if len(group) >= 2]


def _too_alike(sweeps: Sequence[Sequence[LocalAttitude]]) -> NoAxis | None:
    advice = tr("Rotate RA by at least 30° between the first and the last frame.")
    for sweep in sweeps:
        turned = _turned_rad(sweep)
        if turned < LEAST_TURN_RAD:
            reason = tr("RA rotated by only {turned:.2f}° between the frames", turned=np.degrees(turned))
            return stood_still(sweep) or NoAxis(reason, advice, PolarFindingKind.TURN_TOO_SMALL)
    return None


def stood_still(attitudes: Sequence[LocalAttitude]) -> NoAxis | None:
    """A finding that the camera stood on the ground, neither tracking nor turned, while the sky went on."""
    times = [a.time_utc for a in attitudes]
    sky = SIDEREAL_RAD_S * (max(times) - min(times)).total_seconds()
    sigma = float(np.sqrt(max(np.trace(a.covariance) for a in attitudes)))
    noise = SEEN_SIGMAS * sigma
    if _turned_rad(attitudes) > STILL_SHARE * sky + noise or sky < noise:
        return None
    return NoAxis(
        tr(
            "The camera stood still while the sky turned by {sky:.2f}° about the pole: a fixed tripod, or a mount that"
            " did not track",
            sky=np.degrees(sky),
        ),
        tr("To measure a mount, rotate its RA axis by at least 30°."),
        PolarFindingKind.FIXED_TRIPOD,
    )


def _turned_rad(attitudes: Sequence[LocalAttitude]) -> float:
    first = attitudes[0].matrix
    return max(float(np.linalg.norm(rotation_vector(a.matrix @ first.T))) for a in attitudes)


def _error(fit: AxisFit, pole: Floats) -> PolarError:
    """The error of one fit; residuals too large for noise widen its covariance, where what moved has not done so."""
    wider = UNLIKELY <= fit.chance < TOO_LARGE
    return PolarError(fit.axis, pole, fit.covariance * (fit.chi2 / fit.freedom if wider else 1.0))


def _rho_rad(fit: AxisFit) -> float:
    return angle_between(fit.axis, fit.reference[:, 2])


def combine_measurements(first: Measurement, again: Measurement) -> Measurement:
    """The second of two measurements, with the error of both: the bolts were left alone between.

    Findings about the frames are kept from both; those about flexure are made anew.
    """
    results = (*first.results, *again.results)
    combined = combine_sweeps(results, first.before)
    about_frames = {f.kind: f for f in (*again.findings, *first.findings) if f.kind not in FLEXURE_KINDS}
    return replace(
        again,
        error=combined.error,
        results=results,
        before=first.before,
        droop=combined.droop,
        findings=(*about_frames.values(), *flexure_findings(results, combined)),
    )
