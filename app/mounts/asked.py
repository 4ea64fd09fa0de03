"""What a guarded mount is only asked: its name, where it is, how it is and what it believes."""

from collections.abc import Callable, Mapping
from datetime import datetime

from app.core.hint import Site
from app.core.mount import Ability, Epoch, Mount, MountState, Pointing
from app.mounts.beliefs import Beliefs
from app.mounts.epoch import from_mount_epoch, to_mount_epoch
from app.mounts.epoch_told import epoch_told
from app.mounts.limits import Limits
from app.mounts.motion import Motion


class Asked:
    """The questions of a :class:`~app.mounts.guard.Guard`, passed on to the driver behind it."""

    def __init__(
        self, mount: Mount, site: Site | None, limits: Limits, clock: Callable[[], datetime]
    ) -> None:
        self.site = site
        self.limits = limits
        self.clock = clock
        self._motion = Motion(mount)

    @property
    def mount(self) -> Mount:
        """The driver behind the guard; only to ask it."""
        return self._motion.mount

    @property
    def name(self) -> str:
        """The driver's."""
        return self.mount.name

    @property
    def epoch(self) -> Epoch:
        """Of every coordinate of the :class:`~app.core.mount.Mount` calls."""
        return self.mount.epoch

    @property
    def lacks(self) -> Mapping[Ability, str]:
        """What the mount cannot do, each with the reason."""
        return self.mount.lacks

    def identify(self) -> str:
        """The mount's own name and version."""
        return self.mount.identify()

    def position(self) -> Pointing:
        """Where it says it points."""
        return self.mount.position()

    def position_icrs(self) -> tuple[float, float]:
        """Where it says it points, ICRS degrees."""
        return from_mount_epoch(self.position(), self.clock())

    def state(self) -> MountState:
        """How it is; a slew that was begun without being watched is then known to have ended."""
        state = self.mount.state()
        if state.slewing is False and self._motion.endless:
            self._motion.end()
        return state

    def beliefs(self) -> Beliefs:
        """What the mount believes of its place and time; empty when its driver cannot ask."""
        ask: Callable[[], Beliefs] = getattr(self.mount, "beliefs", Beliefs)
        return ask()

    def epoch_doubt(self) -> str:
        """One sentence when the mount's own altitude and azimuth speak for the other epoch."""
        told = epoch_told(self.mount)
        if told is None or told is self.epoch:
            return ""
        option = "J2000" if told is Epoch.J2000 else "date"
        return (
            f"By its own altitude and azimuth the mount's coordinates are {told}, "
            f"they are taken as {self.epoch}: choose the epoch {option} (--epoch {option})."
        )

    def to_mount(self, ra_deg: float, dec_deg: float) -> tuple[float, float]:
        """ICRS degrees in the mount's epoch, now."""
        return to_mount_epoch(ra_deg, dec_deg, self.epoch, self.clock())

    def rate_deg_s(self, wished_deg_s: float) -> float:
        """The rate the mount would really use, when its driver tells its rates."""
        rates: tuple[float, ...] = getattr(self.mount, "rates_deg_s", ())
        return min(rates, key=lambda r: abs(r - wished_deg_s)) if rates else wished_deg_s
