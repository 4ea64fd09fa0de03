"""What a protocol responder asks of a simulated telescope; the mechanics are behind it."""

from typing import Protocol

from app.core.mount import Direction, PierSide


class Telescope(Protocol):
    """A mount's own computer as its hand controller sees it. Safe to call from any thread.

    Coordinates are equatorial degrees of date as the mount believes them, which is not where it
    really points. Axis angles are the encoders': degrees, growing with hour angle on the first
    and with declination on the second.
    """

    aligned: bool
    parked: bool
    tracking: bool
    latitude_deg: float
    longitude_deg: float

    @property
    def slewing(self) -> bool:
        """Whether it moves faster than guiding does."""

    @property
    def pier_side(self) -> PierSide:
        """The tube's side of the pier."""

    def now_unix(self) -> float:
        """Seconds since 1970 UTC by the simulated clock."""

    def sidereal_deg(self) -> float:
        """The mount's own local sidereal time."""

    def believed_deg(self) -> tuple[float, float]:
        """RA and Dec of date where it believes to point."""

    def axes_deg(self) -> tuple[float, float]:
        """The two encoders."""

    def goto(self, ra_deg: float, dec_deg: float) -> str | None:
        """Begin a slew, or say why not: "below horizon", "parked", "limits", "moving"."""

    def sync(self, ra_deg: float, dec_deg: float) -> str | None:
        """Believe to point here, or say why not."""

    def stop(self) -> None:
        """Stop every motion but tracking."""

    def pulse(self, direction: Direction, milliseconds: float) -> None:
        """Move at the guide rate for so long."""

    def move(self, direction: Direction, rate_deg_s: float) -> None:
        """Move until :meth:`halt`, relative to tracking."""

    def halt(self, direction: Direction | None = None) -> None:
        """End a move in one direction, or in all."""

    def turn_axis(self, axis: int, rate_deg_s: float) -> None:
        """A bare motor: axis 0 or 1 at this rate against the pier, tracking not added."""

    def turn_axis_to(self, axis: int, angle_deg: float) -> None:
        """A bare motor: axis 0 or 1 to this encoder angle at the slew rate."""
