"""Beliefs about a frame that its answer contradicts: told beside it, for it never leant on them."""

from dataclasses import replace

import numpy as np

from app.core.attitude import apart_deg
from app.core.hint import Hint
from app.core.solution import NoSolution, Solution
from app.solve.options import SolveOptions
from app.solve.solver import with_field

SLACK = 1.1
"""A belief about scale is let pass when it is wrong by no more than this beyond its own range."""


def with_doubts(
    result: Solution | NoSolution, options: SolveOptions, header: Hint | None = None
) -> Solution | NoSolution:
    """``result`` with a warning for each belief it contradicts; ``header`` is the frame's own."""
    if not isinstance(result, Solution):
        return result
    believed = with_field(options, result.camera.width)
    said = contradictions(result, believed, "given")
    if options.hint is not None and believed is not options.hint:  # the field stood in for it
        said += _of_scale(result, options.hint, "given")
    if options.use_header:
        said += contradictions(result, header, "in the header")
    return replace(result, warnings=(*result.warnings, *said))


def contradictions(solution: Solution, hint: Hint | None, where: str) -> tuple[str, ...]:
    """One sentence for a wrong scale, one for a wrong place; ``where`` the belief stood."""
    if hint is None:
        return ()
    return (*_of_scale(solution, hint, where), *_of_place(solution, hint, where))


def _of_scale(solution: Solution, hint: Hint, where: str) -> tuple[str, ...]:
    if hint.scale_arcsec_px is None:
        return ()
    low, high = hint.scale_arcsec_px
    true, middle = solution.camera.scale_arcsec_px, (low * high) ** 0.5
    if low / SLACK <= true <= high * SLACK:
        return ()
    return (
        f"The scale {where}, about {middle:.3g} arcsec/px, is wrong by a factor of"
        f" {max(true / middle, middle / true):.3g}: it is {true:.4g}, a focal length of"
        f" {solution.camera.focal_px:.0f} px.",
    )


def _of_place(solution: Solution, hint: Hint, where: str) -> tuple[str, ...]:
    if hint.centre_deg is None:
        return ()
    ra, dec, radius = hint.centre_deg
    away = apart_deg((ra, dec), solution.ra_dec_deg)
    if away <= radius + float(np.hypot(*solution.camera.fov_deg)) / 2.0:
        return ()
    return (f"The frame points {away:.3g} deg away from the place {where}.",)
