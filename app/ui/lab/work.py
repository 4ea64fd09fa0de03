"""The Laboratory's tasks: where the stars come from, then the engine; nothing of Qt."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from app.core.detections import Detections
from app.core.errors import UsageError
from app.core.frame import Frame
from app.core.hint import Hint
from app.core.progress import Progress, Task
from app.core.solution import NoSolution, Solution
from app.sky.apparent import julian_years
from app.solve.options import UNKNOWN_YEAR
from app.workflows.laboratory import (
    Choice,
    FieldWish,
    MakeField,
    Trial,
    Truth,
    compare,
    scale_hint,
)
from app.workflows.laboratory_curves import PLACE_DEG

OPEN_FIRST = "Open a frame first, or choose a simulated field."


@dataclass(frozen=True, slots=True, eq=False)
class Stars:
    """A list of stars with all that is known of it; ``believed`` is the hint when no truth is."""

    detections: Detections
    truth: Truth | None
    believed: Hint | None = None
    year: float = UNKNOWN_YEAR

    def hint(self, scale: bool, place: bool) -> Hint | None:
        """What the methods are told."""
        if not scale:
            return None
        if self.truth is not None:
            return scale_hint(self.truth, PLACE_DEG if place else None)
        if self.believed is None or place:
            return self.believed
        return replace(self.believed, centre_deg=None)


def stars_of_frame(
    frame: Frame,
    detections: Detections | None,
    result: Solution | NoSolution | None,
    believed: Hint | None,
) -> Task[Stars]:
    """The stars of the open frame; its solution, where there is one, stands for the truth."""
    if detections is None:
        yield Progress("detect", None, "looking for stars")
        from app.detect import make_detector

        detections = make_detector().detect(frame)
    moment = frame.hint.time_utc
    truth = Truth(result.camera, result.attitude) if isinstance(result, Solution) else None
    year = UNKNOWN_YEAR if moment is None else julian_years(moment)
    return Stars(detections, truth, believed if believed is not None else frame.hint, year)


def stars_of_field(make: MakeField, wish: FieldWish, number: int) -> Task[Stars]:
    """The stars of simulated field ``number``, and the truth of it."""
    yield Progress("laboratory", None, "making a field")
    field = make(wish, (number,))
    return Stars(field.detections, Truth.of(field, wish))


def comparison(
    source: Task[Stars] | None,
    choices: list[Choice],
    scale: bool,
    place: bool,
    limit_s: float,
    tell: Callable[[Trial], None],
) -> Task[list[Trial]]:
    """Get the stars and compare the methods on them; UsageError when there are none to get."""
    if source is None:
        raise UsageError(OPEN_FIRST)
    stars = yield from source
    return (
        yield from compare(
            stars.detections, choices, stars.hint(scale, place), stars.truth, stars.year, limit_s,
            tell,
        )
    )  # fmt: skip
