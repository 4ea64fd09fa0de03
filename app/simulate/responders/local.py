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

    def set_local(
        self, year: int | None = None, month: int | None = None, day: int | None = None,
        hour: int | None = None, minute: int | None = None, second: int | None = None,
    ) -> bool:  # fmt: skip
        """Replace parts of the clock; False when there is no such time."""
        at = self.local()
        parts = (at.year, at.month, at.day, at.hour, at.minute, at.second)
        told = (year, month, day, hour, minute, second)
        wanted = [p if t is None else t for p, t in zip(parts, told, strict=True)]
        year, month, day, hour, minute, second = wanted
        try:
            self.clock_error += datetime(year, month, day, hour, minute, second, tzinfo=UTC) - at
        except ValueError:
            return False
        return True
