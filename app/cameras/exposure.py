"""An exposure under way on a camera that begins the next one when its picture has arrived."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from time import monotonic

from app.core.errors import LineLostError

DOWNLOAD_S = 30.0
"""How long after an exposure a picture may be under way before the line counts as lost."""


@dataclass(frozen=True, slots=True)
class Exposure:
    """``begun_s`` on :func:`time.monotonic`, the same in UTC, and how long it is."""

    begun_s: float
    begun_utc: datetime
    seconds: float

    @classmethod
    def now(cls, seconds: float) -> "Exposure":
        """One that has just begun."""
        return cls(monotonic(), datetime.now(UTC), seconds)

    @property
    def middle_utc(self) -> datetime:
        """Mid-exposure by this computer's clock."""
        return self.begun_utc + timedelta(seconds=self.seconds / 2.0)

    def check_overdue(self, camera: str) -> None:
        """Raise LineLostError when its picture should have been here long ago."""
        if monotonic() > self.begun_s + self.seconds + DOWNLOAD_S:
            raise LineLostError(f"{camera} began an exposure and no picture came of it.")
