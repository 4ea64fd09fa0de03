"""One frame, or one list of stars, to a ``Solution`` or a ``NoSolution``."""

import logging
import math
from collections.abc import Iterator, Mapping
from dataclasses import field, fields, replace
from datetime import UTC, datetime
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from kochab.attitude import ESTIMATORS
from kochab.attitude.fit import Fit, FocalPrior, refine
from kochab.core.arrays import Floats
from kochab.core.attitude import apart_deg
from kochab.core.frame import Detections, Frame, Hint
from kochab.core.progress import Progress, Stopwatch, Task, TimedOut
from kochab.core.solution import Identification, Matches, NamedStar, NoSolution, Reason, Solution, StarCatalogue
from kochab.core.values import frozen
from kochab.identification.verification import ACCEPT_LOG10
from kochab.solver import DEFAULT_METHOD, FEWEST_STARS, UNKNOWN_YEAR, UNKNOWN_YEAR_SIGMA, SolveOptions
from kochab.solver.matches import PRINCIPAL_POINT_SIGMA, named_stars
from kochab.text.translation import tr

if TYPE_CHECKING:
    from kochab.detection.auto import AutoDetector
    from kochab.sky import Catalogue
    from kochab.solver.cone_search import Narrow


logger = logging.getLogger(__name__)
FEWEST_FOR_PARTS, MORE = 30, 1.1
"""So many stars are worth a look at parts of the frame, and so many times as many in them another search."""
FEWEST_TO_TRY = 3
"""With fewer stars than a triangle no method has anything to look for."""


@frozen(eq=False)
class Examined:
    """The answer together with the detections it was made from."""

    detections: Detections
    result: Solution | NoSolution


@frozen(eq=False)
class _Request:
    """One list of stars to solve: how, by which clock, and the ``frame`` it is of, None for a list alone.

    ``n_star_lists`` counts the lists of the same frame tried so far, this one included; ``unreadable`` has what is
    wrong with the user's catalogue.
    """

    detections: Detections
    options: SolveOptions
    clock: Stopwatch
    frame: Frame | None = None
    n_star_lists: int = 1
    unreadable: list[str] = field(default_factory=list)

    @property
    def year(self) -> float:
        """The Julian year in which stars are placed."""
        return year_of(self.options.hint.time_utc if self.options.hint else None)


def solve_frame(frame: Frame, options: SolveOptions | None = None) -> Task[Solution | NoSolution]:
    """Detect the stars of ``frame``, identify them and refine the pointing.

    Raises
    ------
    UsageError
        The options name a method or detector that does not exist.

    """
    return (yield from examine_frame(frame, options)).result


def examine_frame(frame: Frame, options: SolveOptions | None = None, *, read_ms: float = 0.0) -> Task[Examined]:
    """As :func:`solve_frame`, and also hand back the detections, for who wants to draw them."""
    from kochab.detection import DETECTORS
    from kochab.detection.auto import AutoDetector

    options = options or SolveOptions()
    clock = Stopwatch(options.timeout_s, read_ms)
    detector = DETECTORS.make(options.detector, **options.detector_options)
    yield Progress("detect", 0.1)
    with clock.stage("detect"):
        detections = detector.detect(frame)
    hint = merged_hint(with_field(options, frame.width), frame.hint if options.use_header else None)
    request = _Request(detections, replace(options, hint=hint), clock, frame)
    answer, refusal = yield from _answered(request, _searches(request))
    timed_out = refusal is not None and refusal.reason is Reason.TIMED_OUT
    if not isinstance(answer, Solution) and isinstance(detector, AutoDetector) and not timed_out:
        for again, searches in _second_lists(request, detector):
            second, _ = yield from _answered(again, searches)
            if isinstance(second, Solution):
                detections, answer = again.detections, second
    result = answer or (yield from _diagnosed(request, refusal))
    _log(result)
    return Examined(detections, result)


def _second_lists(
    request: _Request, detector: "AutoDetector"
) -> Iterator[tuple[_Request, Iterator[Task[Identification | NoSolution]]]]:
    """Another list of the same frame's stars and the searches to make in it, where the first may not have been all."""
    from kochab.detection.auto import single_pixels
    from kochab.detection.tiles import detect_in_tiles

    count = len(request.detections)
    assert request.frame is not None
    if count < FEWEST_STARS:
        # stars of a sharp lens may be single pixels, which the detector takes for hot ones
        points = replace(request, detections=single_pixels(request.frame, detector), n_star_lists=2)
        if len(points.detections) >= FEWEST_STARS:
            yield points, _searches(points)
    elif count >= FEWEST_FOR_PARTS and _may_climb(request):
        with request.clock.stage("detect"):
            parts = replace(request, detections=detect_in_tiles(request.frame, detector), n_star_lists=2)
        if len(parts.detections) > MORE * count:
            yield parts, iter([_climb(parts)])


def solve_detections(
    detections: Detections, options: SolveOptions | None = None, *, read_ms: float = 0.0
) -> Task[Solution | NoSolution]:
    """Identify a list of stars and refine the pointing; there is no frame to look at.

    Raises
    ------
    UsageError
        The options name a method that does not exist.

    """
    options = options or SolveOptions()
    if options.fov_deg is not None:
        options = replace(options, hint=with_field(options, detections.width))
    request = _Request(detections, options, Stopwatch(options.timeout_s, read_ms))
    answer, refusal = yield from _answered(request, _searches(request))
    result = answer or (yield from _diagnosed(request, refusal))
    _log(result)
    return result


def _log(result: Solution | NoSolution) -> None:
    """One line for the journal."""
    total_ms = result.elapsed_ms.get("total", 0.0)
    if isinstance(result, NoSolution):
        logger.debug("no solution in %.0f ms: %s", total_ms, result.reason)
        return
    ra, dec = result.ra_dec_deg
    pointing = f"RA {ra:.5f} Dec {dec:+.5f}, {len(result.stars)} stars, RMS {result.rms_px:.2f} px"
    logger.debug("solved in %.0f ms by %s: %s", total_ms, result.method, pointing)


def merged_hint(given: Hint | None, header: Hint | None) -> Hint | None:
    """What the person gave, and the header's values for the rest."""
    if given is None or header is None:
        return given or header
    values = {f.name: getattr(given, f.name) for f in fields(given)}
    # what the person left as it is, the header may fill
    return replace(header, **{k: v for k, v in values.items() if v != getattr(Hint(), k)})


def with_field(options: SolveOptions, width: int) -> Hint | None:
    """The person's hint, with the scale that the given field width means."""
    if options.fov_deg is None:
        return options.hint
    focal_px = width / 2.0 / math.tan(math.radians(options.fov_deg) / 2.0)
    scale = math.degrees(1.0 / focal_px) * 3600.0
    return replace(options.hint or Hint(source="person"), scale_arcsec_px=(scale / 1.1, scale * 1.1))


def year_of(moment: datetime | None) -> float:
    """Julian year of an aware time; a middling recent year when unknown."""
    if moment is None:
        return UNKNOWN_YEAR
    return 2000.0 + (moment - datetime(2000, 1, 1, 12, tzinfo=UTC)).total_seconds() / 31557600.0


def _answered(
    request: _Request, searches_to_make: Iterator[Task[Identification | NoSolution]]
) -> Task[tuple[Solution | NoSolution | None, NoSolution | None]]:
    """Identify the stars by one search after another and refine the pointing.

    The answer is None where no search has one; then a refusal, if any search gave one, waits for its diagnosis.
    """
    from kochab.identification import IDENTIFIERS

    # a wrong name is told before the search, not after it
    options = request.options
    IDENTIFIERS.check(options.method)
    if options.attitude is not None:
        ESTIMATORS.check(options.attitude)
    refusal: NoSolution | None = None
    searches = 0
    try:
        for search in searches_to_make:
            found = yield from search
            # one that lacked what it needs looked at nothing, and had no chance of error
            searches += isinstance(found, Identification) or found.searched
            if isinstance(found, Identification):
                # each search may be lucky: the second's bound is that of two
                alarm = min(0.0, found.log10_false_alarm + math.log10(request.n_star_lists * searches))
                if alarm <= ACCEPT_LOG10:
                    yield Progress("attitude", 0.8)
                    return _finished(request, replace(found, log10_false_alarm=alarm)), None
            elif refusal is None or found.searched:  # without the hint it may lack what it needs
                refusal = found
    except TimedOut:
        advice = tr("Give the field of view or the pixel scale, or allow more time.")
        refusal = NoSolution(
            Reason.TIMED_OUT, advice, tr("searched for {timeout_s:g} s", timeout_s=options.timeout_s or 0.0)
        )
    return None, refusal


def _diagnosed(request: _Request, refusal: NoSolution | None) -> Task[NoSolution]:
    """Why there is no answer, once every list of the frame's stars was tried: the frame is measured for it."""
    from kochab.solver.diagnosis import Evidence, diagnose

    yield Progress("diagnose", 0.9)
    evidence = Evidence(request.detections, request.options.hint, request.frame)
    result = diagnose(evidence, refusal, request.clock.elapsed_ms())
    return replace(result, warnings=result.warnings + _problems(request))


def _problems(request: _Request) -> tuple[str, ...]:
    """What is wrong with the user's catalogue, once."""
    return tuple(dict.fromkeys(request.unreadable))


def _finished(request: _Request, found: Identification) -> Solution | NoSolution:
    with request.clock.stage("attitude"):
        result = _conclude(request, found)
    warnings = (request.frame.warnings if request.frame else ()) + result.warnings + _problems(request)
    elapsed_ms = request.clock.elapsed_ms()
    return replace(result, detections=len(request.detections), elapsed_ms=elapsed_ms, warnings=warnings)


def _searches(request: _Request) -> Iterator[Task[Identification | NoSolution]]:
    """The searches to make in order: by the hint, blind, and the last resort when stars are few."""
    detections, options = request.detections, request.options
    hint = options.hint if options.hint and options.hint.helps else None
    near = _narrow(request, hint) if len(detections) >= FEWEST_TO_TRY else None
    if len(detections) >= FEWEST_TO_TRY:
        if near is not None and hint is not None and near.first:
            yield _in_cone(request, hint, near)
        if near is None or not (near.first and near.whole):
            yield _identify(request, hint)
        if near is not None and hint is not None and not near.first:
            yield _in_cone(request, hint, near)
        if hint is not None and options.blind_after_hint:
            from kochab.identification.patterns import MOST_FOR_TRIANGLES

            # A few stars name themselves where the scale is right, however wrong the place is.
            if hint.centre_deg and hint.scale_arcsec_px and len(detections) <= MOST_FOR_TRIANGLES:
                yield _identify(request, replace(hint, centre_deg=None))
            yield _identify(request, None)
        if _may_climb(request) or hint is None or hint.centre_deg is None:
            yield from _in_own_index(request, hint)
    if options.method == DEFAULT_METHOD:
        yield _identify_few(request)
    if _may_climb(request):
        yield _climb(request)
        if len(detections) >= FEWEST_STARS:
            yield _stretched_back(request)


def _may_climb(request: _Request) -> bool:
    """Whether windows of the frame may be asked, which believe no hint."""
    options = request.options
    blind = options.hint is None or not options.hint.helps or options.blind_after_hint
    return options.method == DEFAULT_METHOD and blind


def _narrow(request: _Request, hint: Hint | None) -> "Narrow | None":
    """What is known of a narrow frame with a hint; None for another frame or method."""
    if hint is None or hint.centre_deg is None or request.options.method != DEFAULT_METHOD:
        return None
    from kochab.solver.cone_search import narrow

    return narrow(request.detections, hint)


def _in_cone(request: _Request, hint: Hint, near: "Narrow") -> Task[Identification | NoSolution]:
    from kochab.solver.cone_search import search_cone

    with request.clock.stage("identify"):
        return (
            yield from request.clock.watch(
                search_cone(request.detections, hint, near, request.year, request.unreadable)
            )
        )


def _in_own_index(request: _Request, hint: Hint | None) -> Iterator[Task[Identification | NoSolution]]:
    """The search in the index of the user's stars, where that has been made."""
    from kochab.solver.own_index import own_volumes, search_own

    volumes = own_volumes() if request.options.method == DEFAULT_METHOD else ()
    if not volumes:
        return
    # a place that was wrong says nothing of the scale
    wanted = hint if hint is not None and hint.centre_deg is None else None
    with request.clock.stage("identify"):
        yield request.clock.watch(search_own(request.detections, wanted, volumes, request.year, request.unreadable))


def _identify_few(request: _Request) -> Task[Identification | NoSolution]:
    from kochab.solver.few_stars import identify_few

    yield Progress("identify", 0.7)
    with request.clock.stage("identify"):
        found = identify_few(request.detections, request.options.hint, _catalogue(), request.year)
    # as one that tried nothing, so that the refusal of the search before stands
    return found or NoSolution(Reason.NO_PATTERN_AGREED, "", "nothing")


def _climb(request: _Request) -> Task[Identification | NoSolution]:
    from kochab.solver.window_ladder import climb

    with request.clock.stage("identify"):
        return (yield from request.clock.watch(climb(request.detections, request.year)))


def _stretched_back(request: _Request) -> Task[Identification | NoSolution]:
    from kochab.solver.aspect import search_stretched

    with request.clock.stage("identify"):
        return (yield from request.clock.watch(search_stretched(request.detections, request.year)))


@cache
def _catalogue() -> "Catalogue":
    """One catalogue a process: its table of names is read once."""
    from kochab.sky import open_catalogue

    return open_catalogue()


def _identify(request: _Request, hint: Hint | None) -> Task[Identification | NoSolution]:
    from kochab.identification import IDENTIFIERS

    yield Progress("identify", 0.3, tr("with a hint") if hint else tr("blind"))
    options, clock = request.options, request.clock
    with clock.stage("identify"):
        identifier = IDENTIFIERS.make(options.method, **options.method_options)
        return (yield from clock.watch(identifier.identify(request.detections, hint, request.year)))


def _conclude(request: _Request, found: Identification) -> Solution | NoSolution:
    from kochab.solver.aspect import fitted
    from kochab.solver.matches import (
        behind_its_lens,
        centroid_sigma,
        extend,
        match_errors,
        with_catalogue_error,
        with_unknown_date,
    )

    catalogue, options, year = found.catalogue or _catalogue(), request.options, request.year
    usable = request.detections.take(slice(0, options.max_stars))
    scale = options.hint.focal_px if options.hint else None
    focal = FocalPrior.of_range(*scale) if scale else None  # the fit drops it if the stars contradict it
    more = partial(
        extend, catalogue=catalogue, year=year, distortion=options.distortion, focal=focal, worst_px=options.worst_px
    )

    def grow(stars: Detections, start: Identification) -> tuple[Matches, Fit]:
        return behind_its_lens(partial(more, stars), start)

    matches, fit, stretched = fitted(grow, usable, found, catalogue, year)
    if stretched is not None:  # the stars are right even so, but the pointing may be turned by degrees
        return NoSolution(
            Reason.DISTORTION_TOO_STRONG,
            tr(
                "The image is stretched by {stretched:.1f} % in one direction, its pixels are not square: "
                "resize it back, then solve again.",
                stretched=100.0 * stretched.share,
            ),
            tried=tr("{matches} stars matched in a part of the frame", matches=len(matches)),
            measured={"stretch_share": stretched.share},
        )
    warnings = _stretched_text(fit.camera.aspect)
    elsewhere: tuple[NamedStar, ...] = ()
    if request.frame is not None:
        from kochab.solver.bright_stars import stars_at_their_places

        elsewhere = stars_at_their_places(request.frame, request.detections, matches, fit, catalogue, year)
    seen = matches
    if options.aberration:
        moment = options.hint.taken_utc if options.hint else None
        if moment is None:
            warnings += (tr("Aberration is not corrected: the frame has no date."),)
        else:
            errors = match_errors(centroid_sigma(usable), matches, fit.camera.focal_px, catalogue, year)
            seen, fit = geometric_fit(matches, fit, moment, *errors, focal, options.worst_px)
    if options.attitude is not None:
        sigma = centroid_sigma(usable)[seen.detection]
        fit, doubt = with_estimate(seen, fit, options.attitude, sigma, options.attitude_options)
        warnings += (doubt,) if doubt else ()
    attitude = with_catalogue_error(fit.attitude, year)
    if options.hint is None or options.hint.taken_utc is None:
        attitude = with_unknown_date(attitude, matches, catalogue.vectors(matches.star, year + UNKNOWN_YEAR_SIGMA))
    fit = replace(fit, attitude=attitude)
    return replace(build_solution(matches, fit, found, catalogue), warnings=warnings, seen=elsewhere)


def _stretched_text(aspect: float) -> tuple[str, ...]:
    """What a camera's aspect ratio means for a person."""
    if aspect == 1.0:
        return ()
    share = 100.0 * (max(aspect, 1.0 / aspect) - 1.0)
    if aspect > 1.0:
        return (
            tr("The image is stretched by {share:.1f} % along its width; the solution allows for it.", share=share),
        )
    return (tr("The image is stretched by {share:.1f} % along its height; the solution allows for it.", share=share),)


def geometric_fit(
    matches: Matches,
    fit: Fit,
    moment: datetime,
    sigma_px: Floats,
    floor_px: float,
    focal: FocalPrior | None = None,
    worst_px: float | None = None,
) -> tuple[Matches, Fit]:
    """The stars where the moving Earth sees them, and the same fit against those.

    Its attitude says where the camera points geometrically, up to 20.5 arcsec from where the stars of the plate are in
    ICRS.

    Parameters
    ----------
    matches : Matches
        M of them.
    fit : Fit
        Against their places in ICRS.
    moment : datetime
        When the frame was taken, UTC.
    sigma_px : Floats
        Errors (M,), px a coordinate.
    floor_px : float
        What the places are no better than.
    focal : FocalPrior or None
        What is known of the focal length; None: nothing.
    worst_px : float or None
        Largest centroid error to accept; None: the stars show it.
    """
    from kochab.sky.apparent import with_aberration

    seen = replace(matches, vectors=with_aberration(matches.vectors, moment))
    again = partial(refine, seen, fit.camera, fit.attitude, sigma_px, focal=focal, worst_px=worst_px)
    # beyond the rotation and the focal length only a frame that had terms may have some again
    return seen, again(distortion=bool(fit.terms[4:]), floor_px=floor_px, principal_point_sigma=PRINCIPAL_POINT_SIGMA)


def build_solution(matches: Matches, fit: Fit, found: Identification, catalogue: StarCatalogue) -> Solution:
    """A solution from matches and their fit, its stars brightest first.

    Positions are those at the frame's date, proper motion included.

    Parameters
    ----------
    matches : Matches
        M that agree.
    fit : Fit
        Theirs.
    found : Identification
        How they were identified.
    catalogue : StarCatalogue
        Names and magnitudes.
    """
    order = np.argsort(catalogue.mag(matches.star), kind="stable")
    seen, mags = matches.take(order), np.asarray(catalogue.mag(matches.star[order]), dtype=np.float64)
    stars = named_stars(seen.xy, catalogue.labels(seen.star), mags, seen.vectors, fit.residuals_px[order])
    return Solution(fit.camera, fit.attitude, stars, fit.rms_px, found.log10_false_alarm, found.method)


def with_estimate(
    matches: Matches, fit: Fit, name: str, sigma_px: Floats, options: Mapping[str, Any] | None = None
) -> tuple[Fit, str]:
    """The same camera with the attitude of a chosen estimator, and what went wrong.

    Residuals and RMS are those against the new attitude. When the estimator cannot work with the stars, the fit stays
    as it is and the sentence says so; else it is empty.

    Parameters
    ----------
    matches : Matches
        M, handed over with the smallest error first, of equals the brightest.
    fit : Fit
        The camera, and the attitude that is replaced.
    name : str
        The estimator's.
    sigma_px : Floats
        Errors (M,), px a coordinate.
    options : Mapping[str, Any] or None
        The estimator's own; None: its defaults.
    """
    # for methods that start from the first stars or take only a few
    order = np.lexsort((matches.detection, sigma_px))
    try:
        attitude = ESTIMATORS.make(name, **(options or {})).estimate(
            matches.xy[order], matches.vectors[order], fit.camera
        )
    except ValueError as error:
        return fit, tr("{name}: {error} Used the least-squares fit instead.", name=name, error=error)
    seen = fit.camera.project(matches.vectors @ attitude.matrix.T)
    residuals = matches.xy - seen
    rms = float(np.sqrt(np.mean(np.sum(residuals**2, axis=1))))
    return replace(fit, attitude=attitude, residuals_px=residuals, rms_px=rms), ""


# -- What the person or the header gave and the solution contradicts ---------------------------

SLACK = 1.1
"""A given scale passes when it is off by no more than this factor beyond its own range."""


def with_doubts(
    result: Solution | NoSolution, options: SolveOptions, header: Hint | None = None
) -> Solution | NoSolution:
    """``result`` with a warning for each hint it contradicts; ``header`` is the frame's own."""
    if not isinstance(result, Solution):
        return result
    given = with_field(options, result.camera.width)
    doubts = contradictions(result, given, tr("given"))
    if options.hint is not None and given is not options.hint:  # the field replaced its scale
        doubts += _scale_doubt(result, options.hint, tr("given"))
    if options.use_header:
        doubts += contradictions(result, header, tr("in the header"))
    return replace(result, warnings=(*result.warnings, *doubts))


def within_radius(
    result: Solution | NoSolution, centre_deg: tuple[float, float, float] | None
) -> Solution | NoSolution:
    """``result``, or no solution when the frame's centre lies outside the radius.

    Parameters
    ----------
    result
        What was found without regard to the bound.
    centre_deg
        (RA, Dec, radius) in ICRS degrees, as in `Hint`; None bounds nothing.

    Returns
    -------
    Solution or NoSolution
        The refusal says what was found and how far away, in ``measured`` too.

    """
    if centre_deg is None or not isinstance(result, Solution):
        return result
    away = apart_deg(centre_deg[:2], result.ra_dec_deg)
    if away <= centre_deg[2]:
        return result
    contradiction = tr(
        ", {away:.4g} deg from the search position; the search radius is {centre:g} deg.",
        away=away,
        centre=centre_deg[2],
    )
    return refused(result, Reason.OUTSIDE_RADIUS, contradiction, away_deg=away)


def refused(result: Solution, reason: Reason, contradiction: str, **measured: float) -> NoSolution:
    """No solution in place of one that the caller does not allow: where that was, and what it contradicts.

    Parameters
    ----------
    result : Solution
        The solution.
    reason : Reason
        Why it is not allowed.
    contradiction : str
        The end of the sentence that says where it was.
    **measured : float
        Numbers that the caller adds.
    """
    ra, dec = result.ra_dec_deg
    return NoSolution(
        reason,
        tr(
            "Solved with {stars} stars at RA {ra:.4f}, Dec {dec:+.4f} deg{contradiction}",
            stars=len(result.stars),
            ra=ra,
            dec=dec,
            contradiction=contradiction,
        ),
        detections=result.detections,
        elapsed_ms=result.elapsed_ms,
        measured={"ra_deg": ra, "dec_deg": dec, **measured},
        warnings=result.warnings,
    )


def contradictions(solution: Solution, hint: Hint | None, where: str) -> tuple[str, ...]:
    """One sentence for a wrong scale, one for a wrong place; ``where`` the hint came from."""
    if hint is None:
        return ()
    doubts = _scale_doubt(solution, hint, where)
    if hint.centre_deg is None:
        return doubts
    ra, dec, radius = hint.centre_deg
    away = apart_deg((ra, dec), solution.ra_dec_deg)
    if away <= radius + float(np.hypot(*solution.camera.fov_deg)) / 2.0:
        return doubts
    return (*doubts, tr("The frame is {away:.3g} deg away from the position {where}.", away=away, where=where))


def _scale_doubt(solution: Solution, hint: Hint, where: str) -> tuple[str, ...]:
    if hint.scale_arcsec_px is None:
        return ()
    low, high = hint.scale_arcsec_px
    true, middle = solution.camera.scale_arcsec_px, (low * high) ** 0.5
    if low / SLACK <= true <= high * SLACK:
        return ()
    return (
        tr(
            "The pixel scale {where}, about {middle:.3g} arcsec/px, is wrong by a factor of {true:.3g}: "
            "measured {true2:.4g} arcsec/px, a focal length of {focal:.0f} px.",
            where=where,
            middle=middle,
            true=max(true / middle, middle / true),
            true2=true,
            focal=solution.camera.focal_px,
        ),
    )
