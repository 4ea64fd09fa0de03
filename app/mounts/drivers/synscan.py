"""Sky-Watcher's SynScan hand controls: NexStar's framing, J2000, and a sync that may be refused."""

from app.core.mount import Ability, Epoch, MountState
from app.mounts.conversation import exactly
from app.mounts.drivers.nexstar import NexStar
from app.mounts.protocols import nexstar as words

MODELS = {
    0: "EQ6", 1: "HEQ5", 2: "EQ5", 3: "EQ3", 4: "EQ8", 5: "AZ-EQ6", 6: "AZ-EQ5", 9: "EQ6-R",
    10: "Star Adventurer",
    **dict.fromkeys(range(128, 144), "AZ GoTo"), **dict.fromkeys(range(144, 160), "Dobsonian"),
    160: "AllView",
}  # fmt: skip


class SynScan(NexStar):
    """A mount behind a SynScan hand control; a sync beyond 6 to 7 deg is silently not taken."""

    name = "synscan"
    title = "Sky-Watcher SynScan hand control"
    blind_stop = b"MM"
    default_epoch = Epoch.J2000
    timeout_s = 3.0
    models = MODELS
    cancels = 2  # the first may be lost while it slews

    def start(self) -> None:
        """Its motor boards know no guide pulse through the hand control."""
        super().start()
        self._lacks[Ability.PULSE] = (
            "A SynScan hand control passes no guide pulse: use its guide port."
        )

    def identify(self) -> str:
        """Model and version."""
        return f"SynScan {super().identify()}"

    def state(self) -> MountState:
        """Without the side of the pier, which only newer versions tell."""
        reader = exactly(2, self.timeout_s)
        return MountState(
            slewing=self.talk.query(words.SLEWING, reader, words.parse_digit),
            aligned=self.talk.query(words.ALIGNED, reader, words.parse_flag),
            tracking=self.byte(words.TRACKING) != 0,
        )

    def usual_mode(self) -> int:
        """Models from 128 on stand in altitude and azimuth."""
        if self.model >= 128:
            return 1
        reader = exactly(9, self.timeout_s)
        return 3 if self.talk.query(words.SITE, reader, words.parse_south) else 2
