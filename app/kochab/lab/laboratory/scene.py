"""What a comparison looks at: a frame or a simulated field, and all that is known of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.errors import UsageError
from kochab.core.frame import Detections, Frame, Hint
from kochab.core.progress import Progress, Task
from kochab.core.solution import NoSolution, Solution
from kochab.detection import DETECTORS
from kochab.lab.laboratory.comparison import (
    PLACE_DEG,
    Choice,
    ComparedPart,
    FieldTruth,
    Trial,
    compare,
    scale_hint,
    try_detector,
)
from kochab.lab.laboratory.trials import name_stars, try_attitude, try_method
from kochab.simulate.random_fields import FieldPlan, random_field, random_picture
from kochab.sky import open_catalogue
from kochab.sky.apparent import julian_years
from kochab.solver import UNKNOWN_YEAR

LARGEST_PX = 8192
"""Side of a simulated picture; a larger one takes gigabytes."""
OPEN_FIRST = "Open a frame first, or choose a simulated field."


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A ``frame``, or the ``detections`` of one, or both.

    ``places`` (N, 2) px are all stars of a simulated picture. ``believed`` is the hint when no truth is known.
    """

    detections: Detections | None = None
    frame: Frame | None = None
    truth: FieldTruth | None = None
    places: Floats | None = None
    believed: Hint | None = None

    @property
    def time_utc(self) -> datetime | None:
        """When the frame was taken."""
        return None if self.frame is None else self.frame.hint.time_utc

    @property
    def year(self) -> float:
        """The Julian year of it, or the one taken for frames that do not say."""
        return UNKNOWN_YEAR if self.time_utc is None else julian_years(self.time_utc)

    def hint(self, scale: bool, place: bool) -> Hint | None:
        """What the methods know beforehand."""
        if not scale:
            return None
        if self.truth is not None:
            return scale_hint(self.truth, PLACE_DEG if place else None)
        if self.believed is None or place:
            return self.believed
        return replace(self.believed, centre_deg=None)


def scene_of_frame(
    frame: Frame, detections: Detections | None, result: Solution | NoSolution | None, believed: Hint | None
) -> Task[Scene]:
    """The open frame; its solution, where there is one, stands for the truth."""
    yield Progress("laboratory", None, "taking the open frame")
    truth = FieldTruth(result.camera, result.attitude) if isinstance(result, Solution) else None
    return Scene(detections, frame, truth, believed=believed if believed is not None else frame.hint)


def simulated_scene(kind: ComparedPart, plan: FieldPlan, seeds: Sequence[int]) -> Task[Scene]:
    """The stars of a field at a random place, the same for the same seeds, and the truth of it.

    Detectors are compared on its picture, whose faintest star is as bright as the noise of a position asks.
    """
    rng = np.random.default_rng(list(seeds))
    if kind is not ComparedPart.DETECTOR:
        yield Progress("laboratory", None, "making a field")
        field = random_field(open_catalogue(), rng, plan)
        return Scene(field.detections, truth=FieldTruth.of(field, plan))
    if plan.size_px > LARGEST_PX:
        raise UsageError(f"A simulated image is {LARGEST_PX} px wide at most.")
    yield Progress("laboratory", None, "making a picture")
    picture = random_picture(open_catalogue(), rng, plan)
    return Scene(frame=picture.frame, truth=FieldTruth.of(picture, plan), places=picture.places)


def comparison(
    source: Task[Scene] | None,
    kind: ComparedPart,
    choices: Sequence[Choice],
    scale: bool,
    place: bool,
    limit_s: float,
    tell: Callable[[Trial], None],
) -> Task[list[Trial]]:
    """Get the stars and run the choices on them; UsageError when there are none to get.

    ``scale`` and ``place`` say what the methods know beforehand.
    """
    if source is None:
        raise UsageError(OPEN_FIRST)
    scene = yield from source
    tries = yield from tries_on(scene, kind, choices, scene.hint(scale, place), limit_s)
    names = [choice.name for choice in choices]
    return (yield from compare(list(zip(names, tries, strict=True)), tell))


def tries_on(
    scene: Scene, kind: ComparedPart, choices: Sequence[Choice], hint: Hint | None, limit_s: float
) -> Task[list[Task[Trial]]]:
    """A task for each choice, none of them begun; what all of them need is made here."""
    if kind is ComparedPart.DETECTOR:
        if (frame := scene.frame) is None:
            raise UsageError("A star list has no image to detect stars in.")
        known, truth = replace(hint or Hint(), time_utc=scene.time_utc), scene.truth
        return [try_detector(frame, choice, known, truth, scene.places, limit_s) for choice in choices]
    stars = scene.detections
    if stars is None:
        assert scene.frame is not None, "a scene without stars is a frame"
        yield Progress("detect", None, "detecting stars")
        stars = DETECTORS.make().detect(scene.frame)
    if kind is ComparedPart.ATTITUDE:
        named = yield from name_stars(stars, hint, scene.year, limit_s)
        return [try_attitude(named, choice, scene.truth) for choice in choices]
    return [try_method(stars, choice, hint, scene.truth, scene.year, limit_s) for choice in choices]
