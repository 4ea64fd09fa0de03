"""What an alignment is given by the window, and how its steps come there; nothing of Qt."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from app.core.progress import Progress, Task
from app.polar.history import History
from app.ui.mount.eye import OpenCamera
from app.ui.wiring import Practice, StartPractice
from app.workflows.polar_update import PolarControls

T = TypeVar("T")
Tell = Callable[[Progress], None]


@dataclass(frozen=True, slots=True)
class Tools:
    """``tell`` and the others run in the alignment's thread.

    ``practice`` starts a practice night; ``practising`` hears of the one that is used. ``there``
    gives the one that is under way already, if any: it goes on when the alignment is over.
    ``open_camera`` opens a camera that other views may use too.
    """

    controls: PolarControls
    tell: Tell
    keep: Callable[[History], None]
    practising: Callable[[Practice], None] = lambda practice: None
    practice: StartPractice | None = None
    there: Callable[[], Practice | None] = lambda: None
    open_camera: OpenCamera | None = None


def told(task: Task[T], tell: Tell) -> Task[T]:
    """The same task, every step of which is told: a job passes on only the newest."""
    while True:
        try:
            step = next(task)
        except StopIteration as end:
            result: T = end.value
            return result
        tell(step)
        yield step
