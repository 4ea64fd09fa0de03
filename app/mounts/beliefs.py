"""What a mount believes of its place and time; read only, never sent."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from app.core.hint import Site


@dataclass(frozen=True, slots=True)
class Beliefs:
    """None where the mount does not tell. ``utc_offset_h`` is east positive, summer included."""

    site: Site | None = None
    time_utc: datetime | None = None
    utc_offset_h: float | None = None


def utc_of(
    year: int, month: int, day: int, hour: int, minute: int, second: int, utc_offset_h: float
) -> datetime:
    """Universal time of a clock on the wall; `ValueError` when there is no such time."""
    wall = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
    return wall - timedelta(hours=utc_offset_h)
