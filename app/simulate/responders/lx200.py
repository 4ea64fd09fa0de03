"""A Meade: the LX200 classic, and the Autostar that followed it."""

from collections.abc import Callable

from app.core.earth import SIDEREAL_DEG_S
from app.core.mount import Direction
from app.simulate.responders.base import Controller
from app.simulate.responders.horizontal import horizontal_deg
from app.simulate.responders.lx200_site import SiteAndTime
from app.simulate.responders.sexagesimal import degrees, hours, parse
from app.simulate.telescope import Telescope

DIRECTIONS = {
    b"n": Direction.NORTH, b"s": Direction.SOUTH, b"e": Direction.EAST, b"w": Direction.WEST,
}  # fmt: skip
ACKNOWLEDGE = b"\x06"


class Lx200(Controller):
    """The classic: imprecise when switched on, silent to guide pulses and to product names.

    What a Meade does not know it does not answer, and ``:CM#`` has no word for a refusal.
    """

    mark = b"\xdf"
    decimals = 0
    starts_precise = False
    rates_deg_s = {  # noqa: RUF012
        b"G": 2 * SIDEREAL_DEG_S, b"C": 32 * SIDEREAL_DEG_S, b"M": 2.0, b"S": 6.0,
    }  # fmt: skip

    def __init__(self, telescope: Telescope) -> None:
        super().__init__(telescope)
        self.precise = self.starts_precise
        self.rate_deg_s = self.rates_deg_s[b"S"]
        self.target_deg = [0.0, 0.0]
        self.site = SiteAndTime(telescope, self.mark, self.decimals)
        self.plain: dict[bytes, Callable[[], bytes]] = {
            ACKNOWLEDGE: self.alignment, b"GR": self.ra, b"GD": self.dec, b"D": self.distance_bars,
            b"GA": lambda: self.level()[0], b"GZ": lambda: self.level()[1],
            b"Gr": lambda: self.written_ra(self.target_deg[0]),
            b"Gd": lambda: self.written_dec(self.target_deg[1]),
            b"MS": self.slew, b"CM": self.sync, b"U": self.toggle_precision,
            b"Q": self.stop, b"GT": lambda: b"60.1#",
            b"GM": lambda: b"SITE 1#", b"GN": lambda: b"SITE 2#",
            b"GO": lambda: b"SITE 3#", b"GP": lambda: b"SITE 4#",
        }  # fmt: skip
        self.prefixed: dict[bytes, Callable[[bytes], bytes]] = {
            b"Sr": self.set_ra, b"Sd": self.set_dec, b"M": self.move, b"Q": self.halt,
            b"R": self.set_rate,
        }  # fmt: skip

    def _take(self) -> bytes | None:
        """``:...#`` or the lone 0x06; what is neither is lost, as on the real line."""
        pending = self._pending
        while pending:
            if pending[0] == ACKNOWLEDGE[0]:
                del pending[0]
                return ACKNOWLEDGE
            end = pending.find(b"#") if pending[0] == ord(":") else 0
            if end > 0:
                command = bytes(pending[:end]).lstrip(b":")
                del pending[: end + 1]
                return command
            if end < 0 and len(pending) <= self.longest:
                return None
            del pending[0]
        return None

    def _answer(self, command: bytes) -> bytes:
        if command in self.plain:
            return self.plain[command]()
        if (reply := self.site.answer(command)) is not None:
            return reply
        for length in (2, 1):
            method = self.prefixed.get(command[:length])
            if method is not None:
                return method(command[length:])
        return b""

    def alignment(self) -> bytes:
        """``P`` aligned on an equatorial wedge, ``L`` not aligned: a land scope. No #."""
        return b"P" if self.telescope.aligned else b"L"

    def written_ra(self, ra_deg: float) -> bytes:
        """With its #."""
        return hours(ra_deg, self.precise, self.decimals) + b"#"

    def written_dec(self, dec_deg: float) -> bytes:
        """With its #."""
        return degrees(dec_deg, self.precise, self.mark) + b"#"

    def ra(self) -> bytes:
        """Where it believes to be."""
        return self.written_ra(self.telescope.believed_deg()[0])

    def dec(self) -> bytes:
        """Where it believes to be."""
        return self.written_dec(self.telescope.believed_deg()[1])

    def level(self) -> tuple[bytes, bytes]:
        """Altitude, and azimuth from north."""
        altitude, azimuth = horizontal_deg(self.telescope, self.site.settings.latitude_deg)
        return (
            degrees(altitude, self.precise, self.mark) + b"#",
            degrees(azimuth, self.precise, self.mark, width=3, signed=False) + b"#",
        )

    def distance_bars(self) -> bytes:
        """The two rows of the hand controller's display: 32 places, full while it slews."""
        return (b"\x7f" if self.telescope.slewing else b" ") * 32 + b"#"

    def set_ra(self, text: bytes) -> bytes:
        """``1`` or ``0``, without #."""
        value = parse(text, 24.0)
        if value is None or value < 0:
            return b"0"
        self.target_deg[0] = value * 15.0 % 360.0
        return b"1"

    def set_dec(self, text: bytes) -> bytes:
        """``1`` or ``0``, without #."""
        value = parse(text, 90.0)
        if value is None:
            return b"0"
        self.target_deg[1] = value
        return b"1"

    def slew(self) -> bytes:
        """``0``, or the reason: 1 is the horizon, 2 any other, its text ended by #."""
        reason = self._goto(*self.target_deg)
        if reason is None:
            return b"0"
        code, text = (b"1", "object below horizon") if "horizon" in reason else (b"2", reason)
        return code + text.capitalize().encode("ascii", "replace") + b".#"

    def sync(self) -> bytes:
        """The same words whether it did or not."""
        self._sync(*self.target_deg)
        return b"Coordinates     matched.        #"

    def toggle_precision(self) -> bytes:
        """Long and short in turns; nothing tells which, but the next position."""
        self.precise = not self.precise
        return b""

    def move(self, text: bytes) -> bytes:
        """``:Mn#``: nothing is answered."""
        if text in DIRECTIONS:
            self.telescope.move(DIRECTIONS[text], self.rate_deg_s)
        return b""

    def halt(self, text: bytes) -> bytes:
        """``:Qn#``."""
        if text in DIRECTIONS:
            self.telescope.halt(DIRECTIONS[text])
        return b""

    def stop(self) -> bytes:
        """``:Q#``: the goto and every move."""
        self.telescope.stop()
        return b""

    def set_rate(self, text: bytes) -> bytes:
        """``:RG#`` ``:RC#`` ``:RM#`` ``:RS#``."""
        self.rate_deg_s = self.rates_deg_s.get(text, self.rate_deg_s)
        return b""


class Autostar(Lx200):
    """Precise from the start, with a product name, guide pulses and a short ``:D#``."""

    starts_precise = True

    def __init__(self, telescope: Telescope) -> None:
        super().__init__(telescope)
        self.plain |= {
            b"GVP": lambda: b"Autostar#", b"GVN": lambda: b"43Eg#",
            b"GVD": lambda: b"Jan 01 2010#", b"GVT": lambda: b"00:00:00#",
            b"GVF": lambda: b"ETX Autostar|A|43Eg|Jan 01 2010@00:00:00#",
            b"GW": self.how, b"hP": self.park,
        }  # fmt: skip
        self.prefixed[b"Mg"] = self.pulse

    def level(self) -> tuple[bytes, bytes]:
        """Altitude, and azimuth from north."""
        altitude, azimuth = horizontal_deg(self.telescope, self.site.settings.latitude_deg)
        return (
            degrees(altitude, self.precise, self.mark) + b"#",
            degrees(azimuth, self.precise, self.mark, width=3, signed=False) + b"#",
        )

    def distance_bars(self) -> bytes:
        """One bar while it slews."""
        return b"\x7f#" if self.telescope.slewing else b"#"

    def sync(self) -> bytes:
        """The name of an object of no consequence."""
        self._sync(*self.target_deg)
        return b" M31 EX GAL MAG 3.5 SZ178.0'#"

    def how(self) -> bytes:
        """``:GW#``: the mounting, tracking or not, and on how many stars it is aligned."""
        tracks = b"T" if self.telescope.tracking else b"N"
        return b"P" + tracks + (b"2#" if self.telescope.aligned else b"0#")

    def park(self) -> bytes:
        """Nothing is answered; it does not move again until it is switched off and on."""
        self.telescope.stop()
        self.telescope.tracking, self.telescope.parked = False, True
        return b""

    def pulse(self, text: bytes) -> bytes:
        """``:Mgn0500#`` in milliseconds; nothing is answered."""
        if text[:1] in DIRECTIONS and text[1:].isdigit() and len(text) <= 6:
            self.telescope.pulse(DIRECTIONS[text[:1]], float(text[1:]))
        return b""
