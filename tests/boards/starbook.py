"""A Vixen StarBook: commands as the paths of HTTP requests, answers in the comment of a page.

Written from INDI's indi-starbook and INDIGO's mount_starbook. It reports tenths of a minute of RA and minutes of
declination. Without power it forgets its alignment and is at INIT, where it takes neither gotos nor syncs, until somebody
presses OK at its screen or sends ``/START``; then it believes that the tube looks at the horizon in the west.
"""

import re
from datetime import UTC, datetime, timedelta
from math import trunc

from .board import Board
from .sky import SIDEREAL_DEG_S

WEST_DEG = (90.0, 0.0)  # how its owner puts the tube before it is switched on
RATES = (1.0, 2.0, 5.0, 10.0, 30.0, 100.0, 300.0)  # of `/SETSPEED` 1 to 7, in sidereal; 8 is the fastest
ILLEGAL, FORMAT, LOW = "ERROR:ILLEGAL STATE", "ERROR:FORMAT", "ERROR:BELOW HORIZONE"
KEYS = {"NORTH": (1, 1.0), "SOUTH": (1, -1.0), "EAST": (0, -1.0), "WEST": (0, 1.0)}


class StarBook(Board):
    """Serve it with ``tcp=True``. ``starts``: somebody presses OK as soon as it wakes, wherever the tube is."""

    boot_s = 5.0

    def __init__(self, starts=False, **settings):
        super().__init__(**settings)
        self.starts, self.started = starts, True
        self.select = 5

    def wake(self, was):
        super().wake(was)
        self.set_counters(WEST_DEG)
        self.at_home = False
        self.started = self.starts
        self.track(self.starts)

    def align(self, *place, **how):
        self.started = True
        return super().align(*place, **how)

    # -- framing -------------------------------------------------------------------------------------

    def next_command(self, buffer):
        head, end, rest = buffer.partition(b"\r\n\r\n")
        return (head, rest) if end else None

    def is_stop(self, command):
        return command.startswith(b"GET /STOP")

    def answer(self, command):
        path = command.split(b" ")[1].decode("latin1")
        name, _, query = path.lstrip("/").partition("?")
        given = dict(part.split("=", 1) for part in query.upper().split("&") if "=" in part)
        method = self._methods().get(name)
        told = FORMAT if method is None else method(given)
        page = f"<HTML><HEAD><TITLE>StarBook</TITLE></HEAD><BODY><!--{told}--></BODY></HTML>\r\n".encode()
        return b"HTTP/1.0 200 OK\r\nContent-Type: text/html\r\nContent-Length: %d\r\n\r\n" % len(page) + page

    def _methods(self):
        return {
            "VERSION": lambda _: "version=2.7B26",
            "GETSTATUS": self._status,
            "GETPLACE": self._place,
            "SETPLACE": self._set_place,
            "GETTIME": self._time,
            "SETTIME": self._set_time,
            "START": self._start,
            "GOTORADEC": self._goto,
            "ALIGN": self._align,
            "STOP": self._halt,
            "GOHOME": self._home,
            "MOVE": self._move,
            "SETSPEED": self._speed,
            "GETROUND": lambda _: "ROUND=8640000",
        }

    # -- numbers -------------------------------------------------------------------------------------

    @staticmethod
    def _number(text):
        """Of `05+30.7` or `-012+15`, or None."""
        found = re.fullmatch(r"([+-]?)(\d+)\+(\d+(?:\.\d+)?)", text)
        if found is None:
            return None
        size = int(found[2]) + float(found[3]) / 60.0
        return -size if found[1] == "-" else size

    def _take(self, given):
        ra, dec = self._number(given.get("RA", "")), self._number(given.get("DEC", ""))
        if ra is None or dec is None or not (0.0 <= ra < 24.0 and abs(dec) <= 90.0):
            return False
        self.target_deg = [15.0 * ra, dec]
        return True

    # -- questions -----------------------------------------------------------------------------------

    def _status(self, _):
        ra, dec = self.believed_deg()
        tenths, minutes = trunc(ra / 15.0 * 600.0), trunc(abs(dec) * 60.0)
        ra_text = f"{tenths // 600:02d}+{tenths % 600 / 10.0:04.1f}"
        dec_text = f"{'-' if dec < 0.0 else ''}{minutes // 60:03d}+{minutes % 60:02d}"
        state = "SCOPE" if self.started else "INIT"
        return f"RA={ra_text}&DEC={dec_text}&GOTO={int(bool(self.going))}&STATE={state}"

    def _place(self, _):
        parts = []
        for degrees, names in zip(self.site_deg[::-1], ("EW", "NS"), strict=True):
            minutes = round(abs(degrees) * 60.0)
            parts.append(f"{names[degrees < 0.0]}{minutes // 60:03d}+{minutes % 60:02d}")
        return f"LONGITUDE={parts[0]}&LATITUDE={parts[1]}&TIMEZONE={self.zone_h:.0f}"

    def _time(self, _):
        local = datetime.fromtimestamp(self.believed_unix(), UTC) + timedelta(hours=self.zone_h)
        return f"TIME={local:%Y+%m+%d+%H+%M+%S}"

    # -- orders --------------------------------------------------------------------------------------

    def _set_place(self, given):
        """INDI 0.8 forgets a ``&`` between longitude and latitude, which is no format."""
        if self.started:
            return ILLEGAL
        found = [re.fullmatch(r"([EWNS])(\d+)\+(\d+)", given.get(name, "")) for name in ("LATITUDE", "LONGITUDE")]
        if None in found:
            return FORMAT
        size = [int(one[2]) + int(one[3]) / 60.0 for one in found]
        self.site_deg = tuple(-s if one[1] in "WS" else s for s, one in zip(size, found, strict=True))
        self.zone_h = float(given.get("TIMEZONE", 0))
        return "OK"

    def _set_time(self, given):
        if self.started:
            return ILLEGAL
        found = [int(part) for part in given.get("TIME", "").split("+") if part.isdigit()]
        if len(found) != 6:
            return FORMAT
        local = datetime(*found, tzinfo=UTC)
        self.clock_error_s = (local - timedelta(hours=self.zone_h)).timestamp() - self.clock.unix()
        self.clock_set = True
        return "OK"

    def _start(self, _):
        if self.started:
            return ILLEGAL
        self.started = True
        self.track(True)
        return "OK"

    def _goto(self, given):
        if not self.started or self.by_hand:
            return ILLEGAL
        if not self._take(given):
            return FORMAT
        if self.target_altitude_deg() < 0.0:
            return LOW
        self.goto()
        return "OK"

    def _align(self, given):
        if not self.started or self.going:
            return ILLEGAL
        if not self._take(given):
            return FORMAT
        self.sync()
        return "OK"

    def _halt(self, _):
        self.stop()
        return "OK"

    def _home(self, given):
        if given.get("HOME") != "0":
            return FORMAT
        if not self.started:
            return ILLEGAL
        self._write("home", None)
        self.track(False)
        self._run_to("home", WEST_DEG)
        return "OK"

    def _move(self, given):
        if not self.started or self.going:
            return ILLEGAL
        for axis in {KEYS[name][0] for name in given if name in KEYS}:
            held = [KEYS[name][1] for name in given if name in KEYS and KEYS[name][0] == axis and given[name] == "1"]
            if not held:
                self.stop((axis,))
                continue
            sign = -held[0] if axis == 1 and self.beyond() else held[0]
            top = self.tube.axes[axis].top_deg_s
            rates = [*(rate * SIDEREAL_DEG_S for rate in RATES), top]
            self.move(axis, sign * min(top, rates[max(1, self.select) - 1]))
        return "OK"

    def _speed(self, given):
        if not given.get("SPEED", "").isdigit() or not 0 <= int(given["SPEED"]) <= 8:
            return FORMAT
        self.select = int(given["SPEED"])
        return "OK"
