"""All that the window knows of its mount, kept true by the words of its line; nothing of Qt."""

from dataclasses import dataclass

from app.core.progress import Progress
from app.ui.mount.words import (
    CannotStop,
    Connected,
    Done,
    Failed,
    Lost,
    Practising,
    Report,
    Seen,
    Sight,
    Silent,
    Under,
    Word,
)

POLAR = "polar"
MOVING = ("goto", "centre", "nudge", "bring", POLAR)
MAY_MOVE = (*MOVING, "accept")  # a sync that is refused becomes a slew
QUIET = ("site", "camera", "meridian")  # over in a moment: nobody need wait for these
TITLES = {
    "goto": "going there", "centre": "centring", "nudge": "nudging", "bring": "bringing the star",
    "take": "taking a frame", "offer": "looking at the sky twice", "accept": "syncing",
    "undo": "taking the sync back", "track": "switching the tracking",
    "why": "looking for the cause", POLAR: "polar alignment (F4), which turns the RA axis",
}  # fmt: skip


@dataclass(slots=True)
class MountKnown:
    """All that is known; ``moved_since`` says that the sight is from before the last motion.

    ``busy`` is the name of the order under way, ``doing`` its newest progress.
    """

    phase: str = "off"
    port: str = ""
    connected: Connected | None = None
    report: Report | None = None
    sight: Sight | None = None
    moved_since: bool = False
    busy: str = ""
    doing: Progress | None = None
    practice: bool = False
    trouble: str = ""

    @property
    def user(self) -> str:
        """What uses the mount now, in words; empty when nothing does."""
        return TITLES.get(self.busy, self.busy)

    @property
    def slewing(self) -> bool:
        """Whether it said so last."""
        return self.report is not None and bool(self.report.state.slewing)

    @property
    def at_rest(self) -> bool:
        """Whether it says that it stands or tracks, and no order moves it at this moment."""
        if self.phase == "lost" or self.slewing:
            return False
        if self.busy == POLAR:  # while the bolts are turned the mount stands
            return self.doing is not None and self.doing.stage not in (POLAR, "turn")
        return self.busy not in MAY_MOVE

    def hear(self, word: Word) -> None:
        """What a word of the line changes."""
        match word:
            case Practising():
                self.port = word.port
            case Seen() if word.sight is not None:
                self.sight, self.moved_since = word.sight, False
            case Connected():
                self.phase, self.connected, self.trouble = "on", word, ""
            case Report():
                self.report, self.trouble = word, ""
                if word.state.slewing:
                    self.has_moved()
            case Under() if word.name not in QUIET:
                self.busy, self.doing = word.name, word.progress
            case Done() | Failed() if word.name not in QUIET:
                self.busy, self.doing = "", None
                if word.name in MOVING:
                    self.has_moved()
            case Lost():
                self.phase = "lost"
            case Silent() | CannotStop():
                self.trouble = word.sentence

    def has_moved(self) -> None:
        """What was seen last is of another place."""
        self.moved_since = self.sight is not None

    def has_synced(self) -> None:
        """After a sync the mount says something else of the place of the last frame."""
        if self.sight is not None and self.report is not None:
            self.sight = Sight(self.sight.solution, self.report.icrs_deg, self.sight.when)
            self.moved_since = False
