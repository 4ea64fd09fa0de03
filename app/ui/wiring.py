"""What ``app/__main__.py`` hands to the window, because the window's room may not know it.

The simulated sky and the command line are such: the window is given callables, or None.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from app.core.solution import Solution
from app.workflows.laboratory import MakeField, MakePicture
from app.workflows.live_update import LiveUpdate

ToJson = Callable[[str, Solution], str]
ToRecord = Callable[[LiveUpdate], dict[str, Any]]


class Practice(Protocol):
    """A practice night under way: a mount that answers at ``port``, and a camera on it."""

    @property
    def port(self) -> str:
        """Where its mount answers: a device path or ``socket://host:port``."""
        ...

    @property
    def driver(self) -> str:
        """The protocol its mount speaks, a name of :data:`app.mounts.DRIVERS`."""
        ...

    @property
    def camera(self) -> str:
        """The name by which the camera source "simulated" opens its camera."""
        ...

    @property
    def rig(self) -> Any:
        """The rig itself (``app.simulate.rig``): its clock, weather, bolts and truth."""
        ...

    def do(self, line: str) -> str:
        """What hands do at the mount, as one typed line, and what came of it."""
        ...

    def score(self) -> Any:
        """How far belief and axis are off now (``app.simulate.score``)."""
        ...

    def stop(self) -> None:
        """End it and give the port back."""
        ...


StartPractice = Callable[..., Practice]


@dataclass(frozen=True, slots=True)
class Wiring:
    """Callables from outside; a view that is not given what it needs says so and offers less.

    ``to_json`` writes a solution in the form of the command line. ``practice`` starts a practice
    night, with the keywords of ``app.simulate.practice.practise``; call it in a job. ``fields``
    makes the simulated star fields of the Laboratory (:data:`app.workflows.laboratory.MakeField`),
    ``pictures`` the same to look for stars in (:data:`app.workflows.laboratory.MakePicture`).
    ``to_record`` is the line of a live frame in a recording.
    """

    to_json: ToJson | None = None
    practice: StartPractice | None = None
    fields: MakeField | None = None
    to_record: ToRecord | None = None
    pictures: MakePicture | None = None
