"""What the thread of a mount's line tells the window: frozen values, nothing else passes."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from app.core.frame import Frame
from app.core.hint import Site
from app.core.mount import Ability, Epoch, MountState
from app.core.progress import Progress
from app.core.solution import Solution
from app.workflows.solve_frame import SolvedFrame


@dataclass(frozen=True, slots=True)
class Connected:
    """A mount answers; ``lacks`` is what it cannot do, each with the reason."""

    name: str
    lacks: Mapping[Ability, str]
    epoch: Epoch
    site: Site | None
    rates_deg_s: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Doubted:
    """Something of the mount's settings is not as it is taken to be."""

    sentence: str


@dataclass(frozen=True, slots=True)
class Report:
    """Where it says it points, ICRS degrees, and how it is."""

    icrs_deg: tuple[float, float]
    state: MountState
    can_undo: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """A solved frame, and where the mount said it pointed then (ICRS degrees)."""

    solution: Solution
    mount_deg: tuple[float, float]
    when: datetime


@dataclass(frozen=True, slots=True)
class Practising:
    """A simulated telescope has been started: where its mount answers, and its camera's name."""

    port: str
    camera: str


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """The camera gave a frame; it is being solved."""

    frame: Frame


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What was found in it."""

    solved: SolvedFrame
    sight: Sight | None


@dataclass(frozen=True, slots=True)
class Under:
    """An order is under way."""

    name: str
    progress: Progress


@dataclass(frozen=True, slots=True)
class Done:
    """An order came to its end with this result."""

    name: str
    result: Any


@dataclass(frozen=True, slots=True)
class Failed:
    """An order did not; ``stopped`` when a person ended it."""

    name: str
    sentence: str
    stopped: bool = False


@dataclass(frozen=True, slots=True)
class Stopped:
    """The bytes of Stop have gone to the mount."""


@dataclass(frozen=True, slots=True)
class CannotStop:
    """They could not be sent: the mount may be moving."""

    sentence: str


@dataclass(frozen=True, slots=True)
class Silent:
    """A question was not answered; the next one may be."""

    sentence: str


@dataclass(frozen=True, slots=True)
class Lost:
    """The line broke; ``again`` is what came of the last try to open it anew."""

    sentence: str
    again: str = ""


Word = (
    Connected | Doubted | Report | Practising | Shown | Seen | Under | Done | Failed | Stopped
    | CannotStop | Silent | Lost
)  # fmt: skip
