"""OnStep and OnStepX: LX200 with a status word, refusals by number, and tracking on and off."""

from app.core.earth import SIDEREAL_DEG_S
from app.core.errors import NoAnswerError, RefusedError
from app.core.mount import MountState
from app.mounts.conversation import exactly, until
from app.mounts.drivers.lx200 import Dialect, Lx200
from app.mounts.protocols import lx200 as words

ON_STEP = Dialect("OnStep", track=(b":Td#", b":Te#"))


class OnStep(Lx200):
    """A mount with Howard Dutton's OnStep."""

    name = "onstep"
    title = "OnStep and OnStepX"
    bauds = (9600, 115200)
    rates_deg_s = (SIDEREAL_DEG_S, 8 * SIDEREAL_DEG_S, 20 * SIDEREAL_DEG_S, 48 * SIDEREAL_DEG_S)
    rate_words = (b":RG#", b":RC#", b":RM#", b":R7#")

    def find_dialect(self) -> Dialect:
        """It names itself ``On-Step`` or ``OnStepX``."""
        if "onstep" not in self.product.lower().replace("-", ""):
            said = f"calls itself {self.product}" if self.product else "does not give its name"
            raise NoAnswerError(
                f"The device on {self.talk.link.port} {said}: it is no OnStep, or the baud rate "
                "is another."
            )
        return ON_STEP

    def state(self) -> MountState:
        """Everything from ``:GU#``."""
        return self.talk.query(words.STATUS, until(b"#", 40, self.timeout_s), words.parse_flags)

    def track(self, on: bool) -> None:
        """``:Te#`` or ``:Td#``, answered by 1 or 0."""
        assert self.dialect.track is not None
        reader = exactly(1, self.timeout_s)
        if not self.talk.ask(self.dialect.track[on], reader, words.parse_accepted):
            raise RefusedError("The mount refuses to change its tracking; is it parked?")
