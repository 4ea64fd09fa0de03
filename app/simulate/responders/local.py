"""What a controller has been told of its place and time, which need not be so."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from app.simulate.telescope import Telescope


@dataclass(slots=True)
class LocalSettings:
    """Site and clock as set on the controller; east longitudes and zones east are positive.

    Telling it another time moves only what it reports, by ``clock_error``.
    """

    telescope: Telescope
    latitude_deg: float
    longitude_deg: float
    utc_offset_h: float = 0.0
    clock_error: timedelta = timedelta()

    @classmethod
    def of(cls, telescope: Telescope) -> "LocalSettings":
        """Set right, in universal time."""
        return cls(telescope, telescope.latitude_deg, telescope.longitude_deg)

    def utc(self) -> datetime:
        """Its idea of universal time."""
        return datetime.fromtimestamp(self.telescope.now_unix(), UTC) + self.clock_error

    def local(self) -> datetime:
        """Its idea of the clock on the wall."""
        return self.utc() + timedelta(hours=self.utc_offset_h)

    def set_local(self, **parts: int) -> bool:
        """Replace year, month, day, hour, minute or second; False when there is no such time."""
        try:
            wanted = self.local().replace(microsecond=0, **parts)
            self.clock_error += wanted - self.local()
        except (ValueError, OverflowError):
            return False
        return True
