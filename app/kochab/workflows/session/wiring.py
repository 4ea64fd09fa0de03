"""What ``kochab/__main__.py`` hands to the window from rooms the window may not import.

The simulated sky and the command line are such: the window is given callables, or None.
"""

from collections.abc import Callable
from typing import Any, Protocol

from kochab.core.values import frozen
from kochab.gear.session import StartPractice
from kochab.workflows.live.update import LiveUpdate
from kochab.workflows.session.alignment_state import AlignmentState
from kochab.workflows.telescope.offered import OfferedTelescope
from kochab.workflows.telescope.push_to import PushTo


class TelescopePorts(Protocol):
    """The ports where planetarium programs find the telescope."""

    @property
    def lines(self) -> list[str]:
        """Where programs find it, a line a protocol."""

    def stop(self) -> None:
        """Close every port."""


OfferTelescope = Callable[[OfferedTelescope, bool, str | None], TelescopePorts]
"""Listens, on the local network too when that is True, and turns Stellarium's view at the address, unless None.

PortError when a port cannot be had, UsageError for an address that is none.
"""

ToRecord = Callable[[LiveUpdate], dict[str, Any]]


PageState = AlignmentState | PushTo


class PolarPage(Protocol):
    """A page with the polar error, or the way to a target, that phones on the local network can open."""

    @property
    def url(self) -> str:
        """What a phone opens; empty while switched off."""

    def start(self, host: str | None = None) -> str:
        """Serve it, and return the URL; PortError when the address cannot be used."""

    def stop(self) -> None:
        """Switch off."""

    def show(self, state: PageState) -> None:
        """Replace what phones see; its age is told when they ask."""


@frozen
class Wiring:
    """Callables from outside; a view that is not given what it needs says so and offers less.

    ``practice`` starts a practice night, with the keywords of ``kochab.simulate.practice.practise``; call it in a job.

    ``to_record`` is the line of a live frame in a recording. ``phone_page`` makes the page of the
    polar error for phones. ``offer_telescope`` listens for planetarium programs; call it in a job.
    """

    practice: StartPractice | None = None
    to_record: ToRecord | None = None
    phone_page: Callable[[], PolarPage] | None = None
    offer_telescope: OfferTelescope | None = None
