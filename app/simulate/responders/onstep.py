"""OnStep and OnStepX: the LX200 language with digits for reasons and flags for the state."""

from app.core.earth import SIDEREAL_DEG_S
from app.core.mount import PierSide
from app.simulate.responders.lx200 import Autostar
from app.simulate.responders.sexagesimal import degrees, hours
from app.simulate.telescope import Telescope

RATES = tuple(k * SIDEREAL_DEG_S for k in (0.25, 0.5, 1, 2, 4, 8, 20, 48, 240, 480))
UNSPECIFIED = 9
REASONS = {"below horizon": 1, "overhead": 2, "parked": 4, "limits": 6, "moving": 8}


class OnStep(Autostar):
    """Precise from the start; an unknown command is answered by a bare ``0``."""

    mark = b"*"
    rates_deg_s = {
        b"G": RATES[2], b"C": RATES[5], b"M": RATES[6], b"F": RATES[7], b"S": RATES[8],
    } | {b"%d" % k: rate for k, rate in enumerate(RATES)}  # fmt: skip

    def __init__(self, telescope: Telescope) -> None:
        super().__init__(telescope)
        for meade in (b"GW", b"GVF"):
            del self.plain[meade]
        self.plain |= {
            b"GVP": lambda: b"On-Step#", b"GVN": lambda: b"10.24i#",
            b"GVD": lambda: b"Jan 01 2025#", b"GVT": lambda: b"00:00:00#",
            b"GU": self.flags, b"Gm": self.side, b"GE": lambda: b"00#",
            b"GRa": lambda: hours(telescope.believed_deg()[0], True, 4) + b"#",
            b"GRH": lambda: hours(telescope.believed_deg()[0], True, 4) + b"#",
            b"GDe": lambda: degrees(telescope.believed_deg()[1], True, decimals=3) + b"#",
            b"GDH": lambda: degrees(telescope.believed_deg()[1], True, decimals=3) + b"#",
            b"GT": lambda: b"60.16427#" if telescope.tracking else b"0#",
            b"GtH": lambda: degrees(self.site.settings.latitude_deg, True, decimals=3) + b"#",
            b"GX98": lambda: b"N#", b"%BD": lambda: b"0#", b"%BR": lambda: b"0#",
            b"Gh": lambda: b"-10*#", b"Go": lambda: b"85*#",
            b"CS": self.silent_sync, b"hR": self.unpark, b"hP": self.park,
            b"Te": lambda: self.track(True), b"Td": lambda: self.track(False),
            b"TQ": lambda: b"", b"TS": lambda: b"", b"TL": lambda: b"", b"TK": lambda: b"",
        }  # fmt: skip

    def _answer(self, command: bytes) -> bytes:
        known = command in self.plain or self.site.answer(command) is not None
        known = known or command[:1] in (b"Q", b"M", b"R") or command[:2] in (b"Sr", b"Sd")
        return super()._answer(command) if known else b"0"

    def slew(self) -> bytes:
        """One digit, without text and without #."""
        return b"%d" % self._code(self._goto(*self.target_deg))

    def sync(self) -> bytes:
        """``N/A#`` when done, ``E1#`` to ``E9#`` when not."""
        code = self._code(self._sync(*self.target_deg))
        return b"E%d#" % code if code else b"N/A#"

    def silent_sync(self) -> bytes:
        """``:CS#`` fails without a word."""
        self._sync(*self.target_deg)
        return b""

    def _goto(self, ra_deg: float, dec_deg: float) -> str | None:
        return "in goto" if self.telescope.slewing else super()._goto(ra_deg, dec_deg)

    def _code(self, reason: str | None) -> int:
        if reason is None:
            return 0
        return 5 if reason == "in goto" else REASONS.get(reason, UNSPECIFIED)

    def flags(self) -> bytes:
        """``:GU#``: what is not so has a letter too."""
        t = self.telescope
        out = (b"" if t.tracking else b"n") + (b"" if t.slewing else b"N")
        out += (b"P" if t.parked else b"p") + b"E"
        return out + (b"T" if t.pier_side is PierSide.EAST else b"W") + b"120#"

    def side(self) -> bytes:
        """``E#`` or ``W#``."""
        return b"E#" if self.telescope.pier_side is PierSide.EAST else b"W#"

    def track(self, on: bool) -> bytes:
        """``1``, or ``0`` when parked."""
        if self.telescope.parked:
            return b"0"
        self.telescope.tracking = on
        return b"1"

    def park(self) -> bytes:
        """``1``."""
        super().park()
        return b"1"

    def unpark(self) -> bytes:
        """``1``."""
        self.telescope.parked = False
        self.telescope.tracking = True
        return b"1"
