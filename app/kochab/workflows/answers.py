"""What is said of a frame, of detections and of what was looked up, as JSON: for the command line and for servers."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from kochab.core.progress import Task
from kochab.core.values import frozen
from kochab.workflows.solution_json import Json, as_json, bodies_json

if TYPE_CHECKING:  # they load numpy, which --help has no need of
    from kochab.core.frame import Detections, Hint, Site
    from kochab.core.solution import NoSolution, Solution
    from kochab.sky.finder import Found, NotFound
    from kochab.sky.solar_system import Moving
    from kochab.solver import SolveOptions
    from kochab.workflows.frame_objects import FrameObject
    from kochab.workflows.solve_frame import SolvedFrame

LISTED = 200
"""Of a frame's deep-sky objects the best known that its JSON has, where nobody asks for all."""


@frozen
class Answer:
    """The JSON of a frame; what of it is drawn and written elsewhere is there when it was solved."""

    outcome: Json
    solution: "Solution | None" = None
    hint: "Hint | None" = None
    objects: "Sequence[FrameObject]" = ()


def answer_of(
    file: str,
    found: "SolvedFrame | Solution | NoSolution",
    options: "SolveOptions",
    bound: tuple[float, float, float] | None = None,
    more: "Sequence[Moving]" = (),
    site: "Site | None" = None,
    most: int = LISTED,
) -> Task[Answer]:
    """What is said of a frame that was solved, or of a list of stars, with what is in it.

    Parameters
    ----------
    file : str
        What the answer calls it.
    found : SolvedFrame, Solution or NoSolution
        A frame with its result; the result alone for a list of stars.
    options : SolveOptions
        With what it was solved.
    bound : (RA, Dec, radius) or None
        Degrees, beyond which a solution is refused; None for the whole sky.
    more : Sequence[Moving]
        Tables of bodies that are looked for beside the shipped ones.
    site : Site or None
        Where the frame was taken; None to take it from the header.
    most : int
        Deep-sky objects in the answer at most, the best known.
    """
    from kochab.core.solution import Solution
    from kochab.sky import open_catalogue
    from kochab.sky.frame_bodies import BodyInFrame, bodies_in_frame
    from kochab.solver.pipeline import with_doubts, within_radius
    from kochab.workflows.frame_objects import all_of, objects_json
    from kochab.workflows.solve_frame import SolvedFrame

    solved = found if isinstance(found, SolvedFrame) else None
    header = solved.frame.hint if solved is not None else None
    result = within_radius(found.result if isinstance(found, SolvedFrame) else found, bound)
    outcome = as_json(file, with_doubts(result, options, header))
    hint = header if options.hint is None or options.hint.time_utc is None else options.hint
    if not isinstance(result, Solution):
        return Answer(outcome)
    bodies: Sequence[BodyInFrame] = ()
    if solved is not None:
        own = solved.frame.hint
        taken, place = hint.taken_utc if hint else None, site or (hint and hint.site) or own.site
        exposure_s = (hint and hint.exposure_s) or own.exposure_s or 0.0
        others = yield from bodies_in_frame(result, solved.detections, taken, place, open_catalogue(), more, exposure_s)
        outcome |= bodies_json(others, dated=taken is not None)
        outcome["warnings"] += [text for table in more if taken and (text := table.warning(taken, place))]
        bodies = others.bodies
    objects, left_out = all_of(result, bodies, most)
    outcome |= {"objects": objects_json(objects), "objects_left_out": left_out}
    return Answer(outcome, result, hint, objects)


def detections_json(detections: "Detections") -> dict[str, Any]:
    """The stable JSON form of a list of stars."""
    return {
        "width": detections.width,
        "height": detections.height,
        "background": _number(detections.background),
        "noise": _number(detections.noise),
        "detections": len(detections),
        "stars": [
            {
                "x": round(float(detections.xy[i, 0]), 4),
                "y": round(float(detections.xy[i, 1]), 4),
                **{name: _number(getattr(detections, name)[i]) for name in ("flux", "snr", "fwhm_px", "elongation")},
                "angle_deg": _number(detections.angle_rad[i] * 57.29577951308232),
                "saturated": bool(detections.saturated[i]),
                "blended": bool(detections.blended[i]),
            }
            for i in range(len(detections))
        ],
    }


def _number(value: Any) -> float | None:
    number = float(value)
    return round(number, 5) if abs(number) < float("inf") else None


def found_json(query: str, found: "Found | NotFound") -> dict[str, Any]:
    """The stable form of what was looked up; ``name`` is null where nothing is called so."""
    from kochab.sky.finder import NotFound

    if isinstance(found, NotFound):
        return {"query": query, "name": None, "suggestions": list(found.suggestions)}
    return {
        "query": query,
        "name": found.name,
        "kind": found.kind,
        "ra_deg": found.ra_deg,
        "dec_deg": found.dec_deg,
        "magnitude": found.magnitude,
        "band": found.band if math.isfinite(found.magnitude) else "",
        "size_arcmin": found.size_arcmin and list(found.size_arcmin),
        "position_angle_deg": found.position_angle_deg,
        "constellation": found.constellation,
        "sure": found.sure,
        "alternatives": list(found.alternatives),
    }
