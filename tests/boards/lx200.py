"""What boards of the LX200 family share: framing, sexagesimal numbers, clock and site."""

import re
from datetime import UTC, datetime, timedelta
from types import MappingProxyType

from .board import Board

ACK = b"\x06"


class Lx200Board(Board):
    """Commands are found by their longest known beginning; a command's method returns what is sent."""

    commands = MappingProxyType({})  # the beginning of a command -> the name of its method, which gets what follows
    unknown = b""

    def __init__(self, **settings):
        super().__init__(**settings)
        self.target_text = ["00:00:00", "+00*00:00"]
        self._set = {"date", "time"}

    def wake(self, was):
        super().wake(was)
        if not self.keeps_clock:
            self._set = set()

    # -- framing -------------------------------------------------------------------------------------

    def next_command(self, buffer):
        start = re.search(rb"[:\x06]", buffer)
        if start is None:
            return None
        rest = buffer[start.start() :]
        if rest[:1] == ACK:
            return ACK, rest[1:]
        text, end, after = rest.partition(b"#")
        # A colon begins a command anew where the last one was cut; times and angles have theirs between digits.
        fresh = re.search(rb"(?<![0-9]):(?=[A-Za-z])", text[1:])
        if fresh is not None:
            return self.next_command(rest[1 + fresh.start() :])
        return (text + end, after) if end else None

    def is_stop(self, command):
        return command.startswith(b":Q")

    def answer(self, command):
        if command == ACK:
            return self.ack()
        text = command[1:-1].decode("latin1")
        for length in range(len(text), 0, -1):
            if method := self.commands.get(text[:length]):
                return getattr(self, method)(text[length:].strip())
        return self.unknown

    def ack(self):
        """Of an equatorial mount."""
        return b"P"

    # -- numbers -------------------------------------------------------------------------------------

    @staticmethod
    def number(text):
        """Of a sexagesimal text, or None."""
        found = re.fullmatch(r"([+-]?)(\d{1,3})[*:'\xdf](\d{1,2}(?:\.\d+)?)(?:[:'](\d{1,2}(?:\.\d+)?))?", text)
        if found is None:
            return None
        size = float(found[2]) + float(found[3]) / 60.0 + float(found[4] or 0.0) / 3600.0
        return -size if found[1] == "-" else size

    @staticmethod
    def sexagesimal(value, width=2, sign=False, marks="::", places=0, turn=None):
        """As a board prints it; ``turn`` is where it begins again."""
        units = round(abs(value) * 3600.0 * 10**places)
        if turn:
            units %= turn * 3600 * 10**places
        seconds, fraction = divmod(units, 10**places)
        minutes, second = divmod(seconds, 60)
        whole, minute = divmod(minutes, 60)
        head = ("-" if value < 0.0 else "+") if sign else ""
        tail = f".{fraction:0{places}d}" if places else ""
        return f"{head}{whole:0{width}d}{marks[0]}{minute:02d}{marks[1]}{second:02d}{tail}"

    def hours(self, degrees_, places=0):
        """RA or sidereal time."""
        return self.sexagesimal(degrees_ % 360.0 / 15.0, places=places, turn=24)

    # -- pointing ------------------------------------------------------------------------------------

    def ra(self, _):
        return f"{self.hours(self.believed_deg()[0])}#".encode()

    def dec(self, _):
        return f"{self.sexagesimal(self.believed_deg()[1], sign=True, marks=self.marks)}#".encode()

    def altitude(self, _):
        return f"{self.sexagesimal(self.believed_altaz_deg()[0], sign=True, marks=self.marks)}#".encode()

    def azimuth(self, _):
        return f"{self.sexagesimal(self.believed_altaz_deg()[1], 3, marks=self.marks, turn=360)}#".encode()

    def sidereal(self, _):
        return f"{self.hours(self.sidereal_deg())}#".encode()

    def set_ra(self, text):
        value = self.number(text)
        if value is None or not 0.0 <= value <= 24.0:
            return b"0"
        self.target_deg[0], self.target_text[0] = 15.0 * value, text
        return b"1"

    def set_dec(self, text):
        value = self.number(text)
        if value is None or abs(value) > 90.0:
            return b"0"
        self.target_deg[1], self.target_text[1] = value, text
        return b"1"

    def target_ra(self, _):
        return f"{self.hours(self.target_deg[0])}#".encode()

    def target_dec(self, _):
        return f"{self.sexagesimal(self.target_deg[1], sign=True, marks=self.marks)}#".encode()

    marks = "*:"

    # -- clock and site ------------------------------------------------------------------------------

    def _local(self):
        return datetime.fromtimestamp(self.believed_unix(), UTC) + timedelta(hours=self.zone_h)

    def _set_local(self, what, **fields):
        try:
            local = self._local().replace(**fields)
        except ValueError:
            return b"0"
        self.clock_error_s = (local - timedelta(hours=self.zone_h)).timestamp() - self.clock.unix()
        self._set.add(what)
        self.clock_set = {"date", "time"} <= self._set
        return b"1"

    def date(self, _):
        return f"{self._local():%m/%d/%y}#".encode()

    def time(self, _):
        return f"{self._local():%H:%M:%S}#".encode()

    def set_date(self, text):
        found = re.fullmatch(r"(\d\d)/(\d\d)/(?:20)?(\d\d)", text)
        if found is None:
            return b"0"
        month, day, year = map(int, found.groups())
        return self._set_local("date", year=2000 + year, month=month, day=day)

    def set_time(self, text):
        found = re.fullmatch(r"(\d\d):(\d\d):(\d\d)(?:\.\d+)?", text)
        if found is None:
            return b"0"
        hour, minute, second = map(int, found.groups())
        return self._set_local("time", hour=hour, minute=minute, second=second, microsecond=0)

    def zone(self, _):
        """What to add to local time for UTC."""
        return f"{self.sexagesimal(-self.zone_h, sign=True)[:6]}#".encode()

    def set_zone(self, text):
        value = self.number(text if ":" in text else f"{text}:00")
        if value is None:
            return b"0"
        # The local time is kept, so what it takes for UTC jumps.
        self.clock_error_s += 3600.0 * (self.zone_h + value)
        self.zone_h = -value
        return b"1"

    def latitude(self, _):
        return f"{self.sexagesimal(self.site_deg[0], sign=True, marks='*:')}#".encode()

    def longitude(self, _):
        """West is positive."""
        return f"{self.sexagesimal(-self.site_deg[1], 3, sign=True, marks='*:')}#".encode()

    def set_latitude(self, text):
        value = self.number(text)
        if value is None:
            return b"0"
        self.site_deg = (value, self.site_deg[1])
        return b"1"

    def set_longitude(self, text):
        value = self.number(text)
        if value is None:
            return b"0"
        west = value - 360.0 if value > 180.0 else value
        self.site_deg = (self.site_deg[0], -west)
        return b"1"

    # -- motion --------------------------------------------------------------------------------------

    directions = MappingProxyType({"n": (1, 1.0), "s": (1, -1.0), "e": (0, -1.0), "w": (0, 1.0)})
    """The axis, and the sign of its turning, by which the tube goes there while it is not beyond the pole."""

    def signed(self, direction):
        """The axis and its sign, north being towards the pole on either side of the pier."""
        axis, sign = self.directions[direction]
        return axis, -sign if axis == 1 and self.beyond() else sign

    def quit(self, text):
        self.stop({"": (0, 1), "n": (1,), "s": (1,), "e": (0,), "w": (0,)}.get(text[:1], (0, 1)))
        return b""

    def silent(self, _):
        return b""

    def yes(self, _):
        return b"1"
