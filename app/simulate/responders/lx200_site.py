"""Place and time in the LX200 language: longitudes grow westward, so do the hours of the zone."""

from app.simulate.responders.local import LocalSettings
from app.simulate.responders.sexagesimal import degrees, hours, parse
from app.simulate.telescope import Telescope

DATE_TEXT = b"1Updating Planetary Data#" + b" " * 30 + b"#"


class SiteAndTime:
    """Answers to ``:Gt#`` ``:Gg#`` ``:GG#`` ``:GL#`` ``:GC#`` ``:GS#`` and what sets them."""

    def __init__(self, telescope: Telescope, mark: bytes, decimals: int = 0) -> None:
        self.settings = LocalSettings.of(telescope)
        self._mark, self._decimals = mark, decimals
        self._getters = {
            b"Gt": self._latitude, b"Gg": self._longitude, b"GG": self._zone,
            b"GL": self._time, b"GC": self._date, b"GS": self._sidereal, b"Gc": self._clock,
        }  # fmt: skip
        self._setters = {
            b"St": self._set_latitude, b"Sg": self._set_longitude, b"SG": self._set_zone,
            b"SL": self._set_time, b"SC": self._set_date,
        }  # fmt: skip

    def answer(self, command: bytes) -> bytes | None:
        """The reply to a command of this group, None to any other."""
        if (get := self._getters.get(command)) is not None:
            return get() + b"#"
        if (put := self._setters.get(command[:2])) is None:
            return None
        good = put(command[2:].strip())
        return DATE_TEXT if good and command[:2] == b"SC" else b"1" if good else b"0"

    def _latitude(self) -> bytes:
        return degrees(self.settings.latitude_deg, False, self._mark)

    def _longitude(self) -> bytes:
        west = -self.settings.longitude_deg % 360.0
        return degrees(west, False, self._mark, width=3, signed=False)

    def _zone(self) -> bytes:
        west = -self.settings.utc_offset_h
        return b"%+03d" % west if west == int(west) else b"%+05.1f" % west

    def _time(self) -> bytes:
        return self.settings.local().strftime("%H:%M:%S").encode()

    def _date(self) -> bytes:
        return self.settings.local().strftime("%m/%d/%y").encode()

    def _clock(self) -> bytes:
        return b"24"

    def _sidereal(self) -> bytes:
        return hours(self.settings.telescope.sidereal_deg(), True, self._decimals)

    def _set_latitude(self, text: bytes) -> bool:
        if (value := parse(text, 90.0)) is not None:
            self.settings.latitude_deg = value
        return value is not None

    def _set_longitude(self, text: bytes) -> bool:
        if (west := parse(text, 360.0)) is not None:
            self.settings.longitude_deg = (180.0 - west) % 360.0 - 180.0
        return west is not None

    def _set_zone(self, text: bytes) -> bool:
        try:
            west = float(text) if b":" not in text else parse(text, 14.0)
        except ValueError:
            return False
        if west is None or not abs(west) <= 14.0:
            return False
        self.settings.utc_offset_h = -west
        return True

    def _set_time(self, text: bytes) -> bool:
        parts = _three_numbers(text, b":")
        return parts is not None and self.settings.set_local(
            hour=parts[0], minute=parts[1], second=parts[2]
        )

    def _set_date(self, text: bytes) -> bool:
        parts = _three_numbers(text, b"/")
        return parts is not None and self.settings.set_local(
            month=parts[0], day=parts[1], year=2000 + parts[2]
        )


def _three_numbers(text: bytes, mark: bytes) -> tuple[int, int, int] | None:
    parts = text.split(mark)
    if len(parts) != 3 or not all(len(p) in (1, 2) and p.isdigit() for p in parts):
        return None
    return int(parts[0]), int(parts[1]), int(parts[2])
