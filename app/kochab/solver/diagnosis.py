"""Why a frame did not solve: what was measured, and one thing to do next."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from kochab.core.attitude import unit_vectors
from kochab.core.frame import Detections, Frame, Hint
from kochab.core.solution import NoSolution, Reason
from kochab.core.values import mutable
from kochab.solver import FEWEST_STARS
from kochab.solver.frame_quality import (
    LENGTH,
    FrameLevels,
    Trails,
    binned,
    clipping_level,
    covered,
    doubled,
    half_flux_diameter_px,
    in_few_lines,
    measure_discs,
    measure_light,
    measure_trails,
)
from kochab.text.translation import tr, tr_n

FEWEST_CATALOGUE_STARS = 10
CLEAR_SNR = 8.0
"""Fainter detections may be noise when there is nothing else."""
TRAILED_ASPECT = 2.2
SHORTEST_ARC_PX = 10.0
"""Patches that point in all directions are trails, around a pole, only when they are so long."""
TRAILED_ELONGATION = 1.8
PARALLEL, PARALLEL_IN_ARCS, ALL_OVER = 0.4, 0.7, 0.6
"""So many patches of a trailed frame are alike, neighbours agree so well on arcs, and so much of the frame has trails:
letters and lit windows stand in a part of it, and lines cross."""
CHANCE_ALIGNED = 0.005
BAR_PER_FWHM = math.sqrt(12.0) / 2.3548
"""Length of a uniform trail divided by the FWHM of a Gaussian of the same variance."""
DAY_SHARE = 0.45
WHITE_SHARE = 0.8
FLAT_CONTRAST = 4.0
GLARE_SHARE, LARGE_GLARE_SHARE = 0.002, 0.01
FEW_BESIDE_GLARE = 20
OUT_OF_FOCUS_PX = 12.0
ROUND = 1.35
AS_WIDE, MOST = 1.3, 0.7
"""So many stars out of focus are as wide as each other, within this factor of their median."""
WIDEST_PX = 30.0
"""Wider stars have an edge, and are looked for as discs. Wider yet is measured as 30 to 40 px, so alike."""
FEWEST_DISCS = 3
"""Or as many as there are clear stars, of which sharp ones would be many more."""
FISHEYE_DEG = 100.0
SKY_DEG2 = 41253.0
LARGE_DEG2 = 25.0
"""Above this area the mean over the sky will do for the stars expected."""

Finding = tuple[Reason, str]


@mutable(eq=False)
class Evidence:
    """What a diagnosis is made from, and what was measured of it so far.

    ``frame`` is None for a bare list of stars. ``dust``: what looks like stars out of focus are specks, which a flat of
    another night left bright.
    """

    detections: Detections
    hint: Hint | None = None
    frame: Frame | None = None
    measured: dict[str, float] = field(default_factory=dict)
    light: FrameLevels | None = None
    trails: Trails | None = None
    dust: bool = False


def diagnose(evidence: Evidence, refusal: NoSolution | None, elapsed_ms: Mapping[str, float]) -> NoSolution:
    """Why the search ended without an answer: the first finding that the numbers support.

    ``refusal`` is the identifier's own; it stands when the frame looks healthy, and when time ran out.
    """
    _measure(evidence)
    if refusal is not None and "log10_false_alarm" in refusal.measured:
        evidence.measured["log10_false_alarm"] = refusal.measured["log10_false_alarm"]  # of the best pointing
    stated = (refusal.reason, refusal.advice) if refusal else (Reason.NO_PATTERN_AGREED, "")
    if stated[0] is Reason.TIMED_OUT:
        reason, advice = stated
    else:
        lacking = refusal is not None and not refusal.searched
        reason, advice = next(_findings(evidence), stated if lacking else _no_visible_fault(evidence, stated))
    frame = evidence.frame
    return NoSolution(
        reason,
        advice,
        tried=refusal.tried if refusal else "",
        detections=len(evidence.detections),
        elapsed_ms=elapsed_ms,
        measured=evidence.measured,
        warnings=frame.warnings if frame else (),
    )


def _measure(evidence: Evidence) -> None:
    """Measure everything that can be measured."""
    d, out = evidence.detections, evidence.measured
    out["stars_found"] = float(len(d))
    _note(out, "fwhm_px", _median(d.fwhm_px))
    _note(out, "elongation", _median(d.elongation))
    if len(d):
        out["saturated_stars"] = float(np.count_nonzero(d.saturated))
    if evidence.frame is not None:
        bins = binned(evidence.frame)
        evidence.light = measure_light(evidence.frame, bins)
        evidence.trails = measure_trails(bins)
        _note(out, "half_flux_diameter_px", half_flux_diameter_px(evidence.frame, d))
        out["background_share"] = evidence.light.background_share
        out["saturated_share"] = evidence.light.saturated_share
        out["contrast_sigma"] = evidence.light.contrast
        discs = measure_discs(bins, clipping_level(evidence.frame))
        clear = int(np.count_nonzero(_clear(d)))
        width = out.get("half_flux_diameter_px", discs.diameter_px)  # two thirds of an even disc's
        least = max(min(FEWEST_DISCS, clear), clear / 8) if clear else FEWEST_DISCS  # a cloud may look like one or two
        if discs.count >= least and width > discs.diameter_px / 3.0:
            evidence.dust = discs.dust
            if not discs.dust:
                out["disc_diameter_px"] = discs.diameter_px
    field_deg = implied_field_deg(evidence)
    if field_deg is not None:
        out["field_deg"] = field_deg
        out["stars_expected"] = _expected(evidence, field_deg)


def _findings(case: Evidence) -> Iterator[Finding]:
    """Every finding the numbers support, the most telling first."""
    yield from _no_stars(case)
    yield from _trailing(case)
    yield from _daylight(case)
    yield from _discs(case)
    yield from _glare(case, LARGE_GLARE_SHARE)
    yield from _focus(case)
    yield from _glare(case, GLARE_SHARE)  # no larger than a star out of focus
    yield from _field(case)
    clear = int(np.count_nonzero(_clear(case.detections)))
    if clear < FEWEST_STARS:
        if clear == len(case.detections):
            found = tr_n("Only {n} star found", "Only {n} stars found", clear)
        else:
            found = tr_n("Only {n} star stands out from the noise", "Only {n} stars stand out from the noise", clear)
        needed = tr("{found}, {fewest} or more are needed: expose longer or use a wider field.")
        yield Reason.TOO_FEW_STARS, needed.format(found=found, fewest=FEWEST_STARS)


def _no_stars(case: Evidence) -> Iterator[Finding]:
    light = case.light
    if light is None:
        return
    clear = int(np.count_nonzero(_clear(case.detections)))
    # beside three clear stars another fault goes first, unless the frame is nearly white
    if light.background_share > (DAY_SHARE if clear < 3 else WHITE_SHARE):
        yield from _daylight(case)
    # noise bumps that the detector took for stars do not make a sky
    if clear < 3 and light.contrast < FLAT_CONTRAST:
        yield from _discs(case)  # they hardly stand out
        yield (
            Reason.CLOUDED_OR_DARK,
            tr("No stars above the background: check for clouds, a closed cover or dew, then expose longer."),
        )


def _daylight(case: Evidence) -> Iterator[Finding]:
    light = case.light
    if light is not None and light.background_share > DAY_SHARE:
        yield (
            Reason.CLOUDED_OR_DARK,
            tr(
                "Too bright: daylight, cloud or overexposed (background {background:.0f} % of full scale). Wait for a "
                "dark sky or expose much shorter.",
                background=100 * light.background_share,
            ),
        )


def _trailing(case: Evidence) -> Iterator[Finding]:
    trails, d = case.trails, case.detections
    across_px = _median(d.fwhm_px / np.sqrt(d.elongation))  # shorter than that it is no trail
    least_px = across_px if math.isfinite(across_px) else 0.0
    if trails is not None and not math.isfinite(trails.angle_deg):
        least_px = max(least_px, SHORTEST_ARC_PX)
    long = trails is not None and trails.count >= 8 and trails.aspect > TRAILED_ASPECT and trails.length_px > least_px
    if trails is not None and long and _parallel(trails):
        yield _trail(case, trails.length_px, trails.angle_deg)
    for stars in (d, d.take(np.flatnonzero(_clear(d)))):  # noise has no direction
        bright = stars.take(slice(0, 50))
        if _median(bright.elongation) > TRAILED_ELONGATION:
            longer = _median(bright.elongation)  # whose width is the mean of both axes
            length = _median(bright.fwhm_px) * math.sqrt(longer - 1.0 / longer) * BAR_PER_FWHM
            twice = doubled(bright.angle_rad[np.isfinite(bright.angle_rad)])
            angle_deg = float(np.degrees(np.angle(twice.mean())) / 2 % 180.0)
            if _aligned(twice) and _all_over(stars, bright) and not _lined_up(stars, bright, angle_deg):
                yield _trail(case, length, angle_deg)


def _parallel(trails: Trails) -> bool:
    least = PARALLEL if math.isfinite(trails.angle_deg) else PARALLEL_IN_ARCS
    return trails.alike >= least and trails.cover >= ALL_OVER and not trails.lined_up


def _all_over(stars: Detections, bright: Detections) -> bool:
    """Whether long images, alike in length, are wherever there are stars."""
    long = bright.take(np.flatnonzero(bright.elongation > TRAILED_ELONGATION))
    length = long.fwhm_px * np.sqrt(long.elongation)
    alike = float(np.mean(np.abs(np.log(length / _median(length))) < math.log(LENGTH)))
    return alike >= PARALLEL and covered(long.xy, stars.xy, (stars.width, stars.height)) >= ALL_OVER


def _lined_up(stars: Detections, bright: Detections, angle_deg: float) -> bool:
    """Whether the long images are parts of few lines: letters, satellites, branches."""
    long = bright.xy[bright.elongation > TRAILED_ELONGATION]
    return in_few_lines(long, math.radians(angle_deg), (stars.width, stars.height))


def _aligned(twice: NDArray[np.complex128]) -> bool:
    """Whether directions agree by more than chance, by Rayleigh's test (Zar 1999, equation 27.4)."""
    count, length = len(twice), abs(twice.sum())
    # few directions must agree the better
    log_chance = math.sqrt(1.0 + 4.0 * count + 4.0 * (count**2 - length**2)) - (1.0 + 2.0 * count)
    return bool(length > 0.6 * count) and log_chance < math.log(CHANCE_ALIGNED)


def _trail(case: Evidence, length_px: float, angle_deg: float) -> Finding:
    case.measured["trail_px"] = length_px
    _note(case.measured, "trail_angle_deg", angle_deg)
    at = tr("at {angle_deg:.0f} deg", angle_deg=angle_deg) if math.isfinite(angle_deg) else tr("in arcs")
    exposure = case.hint.exposure_s if case.hint else None
    advice = tr("wait 5 s after the slew, then expose again; expose shorter if the mount does not track.")
    if exposure is not None and exposure > 20.0:
        advice = tr("track the sky, or expose shorter than {exposure:g} s.", exposure=exposure)
    return Reason.TRAILED, tr("Stars trail {length:.0f} px {at}: {advice}", length=length_px, at=at, advice=advice)


def _discs(case: Evidence) -> Iterator[Finding]:
    yield from _wide(case.measured.get("disc_diameter_px", 0.0))


def _focus(case: Evidence) -> Iterator[Finding]:
    """Stars that are wide, all round and clear: bumps of noise, glow and vignetting are wide as well, and long."""
    fwhm, stars = case.measured.get("fwhm_px", 0.0), case.detections.take(np.flatnonzero(_clear(case.detections)))
    # ghosts of a lamp are as wide as each other
    lamp = case.light is not None and case.light.glare_share > GLARE_SHARE
    if len(stars) < FEWEST_STARS and not _as_wide(stars, 1.0 if lamp else MOST):
        return  # the core of a cluster and what is brightest in it
    if len(stars) >= 3 and not _median(stars.elongation) > ROUND and fwhm < WIDEST_PX and not case.dust:
        yield from _wide(min(case.measured.get("half_flux_diameter_px", fwhm), fwhm))


def _as_wide(stars: Detections, share: float) -> bool:
    """Whether so many stars are as wide as each other, as those out of focus are."""
    widths = stars.fwhm_px[np.isfinite(stars.fwhm_px)]
    return len(widths) > 0 and float(np.mean(np.abs(np.log(widths / _median(widths))) < math.log(AS_WIDE))) >= share


def _wide(width_px: float) -> Iterator[Finding]:
    if width_px > OUT_OF_FOCUS_PX:
        yield (
            Reason.OUT_OF_FOCUS,
            tr("Stars are {width:.0f} px wide: focus until they are under 5 px, then expose again.", width=width_px),
        )


def _clear(stars: Detections) -> NDArray[np.bool_]:
    return np.asarray(~(stars.snr < CLEAR_SNR))  # in a bare list it is not known


def _field(case: Evidence) -> Iterator[Finding]:
    deg = case.measured.get("field_deg")
    if deg is None:
        return
    expected = case.measured["stars_expected"]
    if expected < FEWEST_CATALOGUE_STARS and deg < 2.0:
        yield (
            Reason.FIELD_TOO_SMALL,
            tr(
                "The field is {deg:.2f} deg wide and the catalogue has about {expected:.0f} stars there: use "
                "a shorter focal length or a reducer.",
                deg=deg,
                expected=expected,
            ),
        )
    if deg > FISHEYE_DEG and len(case.detections) >= 20:
        yield (
            Reason.DISTORTION_TOO_STRONG,
            tr("A field of {deg:.0f} deg is too distorted: crop the central 60 deg and solve that.", deg=deg),
        )


def _glare(case: Evidence, least: float) -> Iterator[Finding]:
    """Something bright, where few stars are left: a cluster, a nebula or Polaris hides none."""
    light, stars = case.light, len(case.detections)
    if light is None or light.background_share > DAY_SHARE or stars >= FEW_BESIDE_GLARE:
        return
    if least < light.glare_share < 0.4 and light.glare_aspect < 2.0:
        case.measured["glare_share"] = light.glare_share
        yield (
            Reason.TOO_FEW_STARS,
            tr(
                "Only {stars} stars found: a bright patch (the Moon, a lamp, one very bright object) covers "
                "{glare:.1f} % of the frame. Point away from it.",
                stars=stars,
                glare=100 * light.glare_share,
            ),
        )


def _no_visible_fault(case: Evidence, stated: Finding) -> Finding:
    """Nothing is visibly wrong with the frame."""
    reason, advice = stated
    if reason is not Reason.NO_PATTERN_AGREED:
        return stated
    if case.frame is None:
        return (reason, tr("Check the frame's size, that y runs down, and that the brightest star comes first."))
    scale = case.hint is not None and case.hint.scale_arcsec_px is not None
    if not scale:
        return (reason, tr("Give the field of view if you know it, and check that the image shows stars."))
    return reason, advice or tr("Check that the image shows stars, not lights or noise.")


def implied_field_deg(evidence: Evidence) -> float | None:
    """Width of the frame that a hinted scale implies, degrees; None without a hint."""
    focal_px = evidence.hint.focal_px if evidence.hint else None
    if focal_px is None:
        return None
    # the geometric middle of the range, as scales are ratios
    return math.degrees(2.0 * math.atan(evidence.detections.width / 2.0 / math.sqrt(math.prod(focal_px))))


def _expected(evidence: Evidence, field_deg: float) -> float:
    """Catalogue stars in a field so wide: at the hinted place, else the mean over the sky."""
    from kochab.sky import open_catalogue

    d, hint, catalogue = evidence.detections, evidence.hint, open_catalogue()
    area_deg2 = min(field_deg**2 * d.height / max(d.width, 1), SKY_DEG2)
    if hint is None or hint.centre_deg is None or area_deg2 > LARGE_DEG2:
        return float(len(catalogue) * area_deg2 / SKY_DEG2)
    # a circle as large as the frame
    centre = unit_vectors(*hint.centre_deg[:2])
    return float(len(catalogue.cone(centre, math.radians(math.sqrt(area_deg2 / math.pi)))))


def _median(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else math.nan


def _note(measured: dict[str, float], name: str, value: float) -> None:
    if math.isfinite(value):
        measured[name] = value
