"""The base of the mounts behind a server, which holds the port and may serve other programs too."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from types import MappingProxyType
from typing import ClassVar

from kochab.core.attitude import wrapped
from kochab.core.errors import DeviceError, NoAnswerError, RefusedError, StoppedError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Epoch, Pointing
from kochab.gear.mounts.emergency_stop import Watchdog


class ServerMount:
    """The common half; a driver adds the words of its server, and ``hang_up``, which leaves it."""

    title: ClassVar[str]
    bauds: ClassVar[tuple[int, ...]] = ()  # it has no line of its own
    blind_stop: ClassVar[bytes] = b""
    ends_alone: ClassVar[bool] = False
    rates_deg_s: ClassVar[tuple[float, ...]] = ()
    lag_s: float = 1.0  # ASCOM's drivers ask their mounts about so often

    def __init__(self, epoch: Epoch, hang_up: Callable[[], None]) -> None:
        self.epoch = epoch
        self.watchdog = Watchdog()
        self.missed = 0  # answers that the server did not get from its mount, as far as it tells
        self._stops = 0
        self._hang_up = hang_up
        self._lacks: dict[Ability, str] = {}

    @property
    def lacks(self) -> Mapping[Ability, str]:
        """What it cannot do, each with the reason."""
        return MappingProxyType(self._lacks)

    def require(self, ability: Ability) -> None:
        """Raise the reason when the mount cannot do this."""
        if ability in self._lacks:
            raise RefusedError(self._lacks[ability])

    def position(self) -> Pointing:
        """Where it says it points."""
        self.watchdog.check()
        try:
            return self.read_position()
        except (NoAnswerError, RefusedError):  # the mount did not answer its server
            self.missed += 1
            raise

    def read_position(self) -> Pointing:
        """The same; `NoAnswerError` or `RefusedError` where the server got none from its mount."""
        raise NotImplementedError

    @contextmanager
    def moving(self) -> Iterator[Callable[[], None]]:
        """Within, a motion is ordered; the function given raises `StoppedError` when a Stop came meanwhile.

        A Stop that overtook the order is sent again behind it.
        """
        since = self._stops

        def check() -> None:
            if since != self._stops:
                raise StoppedError("The motion was stopped before it began.")

        yield check
        if since != self._stops:
            self.halt()
            check()

    def stop(self) -> None:
        """Stop every motion but tracking, from any thread."""
        self._stops += 1  # before the bytes, so that an order being sent right now notices it afterwards
        self.watchdog.disarm()
        self.halt()

    def park(self) -> None:
        """Begin to go to its park position."""
        raise RefusedError(self._lacks[Ability.PARK])

    def park_altitude_deg(self) -> float | None:
        """How high it points when parked, where the server tells."""
        return None

    def unpark(self) -> None:
        """Unpark it, so that it can move again."""
        raise RefusedError(self._lacks[Ability.UNPARK])

    def go_home(self) -> None:
        """Begin to go home."""
        raise RefusedError(self._lacks[Ability.HOME])

    def halt(self) -> None:
        """Send Stop and see that the server has taken it."""
        raise NotImplementedError

    def close(self) -> None:
        """Stop a bounded motion that still runs, and leave the server; the mount stays connected to it."""
        if self.watchdog.moving:
            with suppress(DeviceError):
                self.stop()
        self._hang_up()


def site_of(latitude_deg: float, longitude_deg: float, height_m: float) -> Site:
    """A site that a server reports; NoAnswerError when it is not on the Earth."""
    if not (abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 360.0 and abs(height_m) < 1e5):
        raise NoAnswerError(
            "The mount reports no valid site: {latitude:g}°, {longitude:g}°, {height:g} m.",
            latitude=latitude_deg,
            longitude=longitude_deg,
            height=height_m,
        )
    return Site(latitude_deg, wrapped(longitude_deg), height_m)
