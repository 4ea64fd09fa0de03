"""The far ends of the LX200 dialects, written from the makers' documents as INDI's drivers and other programs read them.

They share nothing with the table of :mod:`kochab.gear.mounts.drivers.lx200_dialects`; INDI's own drivers try them too.
"""

import re

from kochab.core.mount import SIDEREAL_DEG_S, PierSide, TrackingRate
from kochab.simulate.responders import HOME_DEG, horizontal_deg, open_responder
from kochab.simulate.responders.lx200 import OnStepResponder, degrees, hours
from kochab.simulate.responders.nexstar import NexStarResponder
from tests.simulate.celestron_aux import CelestronAuxResponder

NAMES = {PierSide.EAST: b"East", PierSide.WEST: b"West"}


def at_home(telescope) -> bool:
    """Weights down, and the tube at the pole."""
    return not telescope.tracking and max(map(abs, telescope.from_home_deg())) < HOME_DEG


SET_RATES = {b"G": SIDEREAL_DEG_S, b"C": 20 * SIDEREAL_DEG_S, b"M": 1.0, b"S": 2.0}
CODES = {"below horizon": 5, "in goto": 3, "parked": 3}


class Am5Responder(OnStepResponder):
    """ZWO, protocol 2.1: refuses by ``e`` and a number, and tells its state by the last digit of its flags."""

    unknown = b""

    def __init__(self, telescope) -> None:
        super().__init__(telescope)
        rates = (0.25, 0.5, 1, 2, 4, 8, 20, 60, 720, 1440)
        self.rates_deg_s = {b"%d" % k: rate * SIDEREAL_DEG_S for k, rate in enumerate(rates)}
        for word in (b"GVN", b"GRa", b"GRH", b"CS", b"hR", b"hP", b"GE", b"T([QSLK])"):
            self.words.pop(word, None)
        self.words |= {
            b"GVP": lambda: b"AM5#",
            b"GV": lambda: b"1.8.8#",
            b"GT": lambda: b"0#",
            b"GAT": lambda: b"%d#" % telescope.tracking,
            b"Ggr": lambda: b"0.50#",
            b"GBu": lambda: b"2#",
            b"T([QSL])": self.set_tracking_rate,
            rb"Mg([nsew])([0-3]\d{3})": self.pulse,
        }

    def flags(self) -> bytes:
        t = self.telescope
        state = 2 if t.slewing else int(t.tracking)
        return (
            (b"" if t.tracking else b"n")
            + (b"" if t.slewing else b"N")
            + (b"H" if at_home(t) else b"")
            + b"GM01100021%d#" % state
        )

    def slew(self) -> bytes:
        reason = self._goto(*self.target_deg)
        return b"0" if reason is None else b"e%d#" % CODES.get(reason, 1)

    def sync(self) -> bytes:
        reason = self._sync(*self.target_deg)
        return b"N/A#" if reason is None else b"e%d#" % CODES.get(reason, 1)


class NyxResponder(OnStepResponder):
    """Pegasus, protocol 1.0: as OnStepX, with rates of its own that are also answered."""

    def __init__(self, telescope) -> None:
        super().__init__(telescope)
        rates = (0.25, 0.5, 1, 2, 8, 20, 64, 128)
        self.rates_deg_s = {b"%d" % k: rate * SIDEREAL_DEG_S for k, rate in enumerate(rates)}
        self.words |= {b"GVP": lambda: b"NYX-101#", b"GVN": lambda: b"1.32.1#", b"T([QSLK])": self.answered_rate}

    def answered_rate(self, letter: bytes) -> bytes:
        self.set_tracking_rate(letter)
        return b"1"


class TeenAstroResponder(OnStepResponder):
    """TeenAstro 1.5: its state is a word of sixteen places."""

    def __init__(self, telescope) -> None:
        super().__init__(telescope)
        for word in (b"GR[aH]", b"GD[eH]"):
            self.words.pop(word)
        self.words |= {
            b"GVP": lambda: b"TeenAstro#",
            b"GVN": lambda: b"1.5.7#",
            b"GXI": self.word,
            b"GU": self.old_word,
            b"hC": self.answered_home,
            b"W\\?": lambda: b"0",
            b"SX90:.*": lambda: b"1",
        }
        self.rates_deg_s = SET_RATES

    def slew(self) -> bytes:
        """Tracking goes on where it ends."""
        digit = super().slew()
        self.telescope.tracking |= digit == b"0"
        return digit

    def word(self) -> bytes:
        t = self.telescope
        self.parking &= t.slewing
        motion = b"2" if t.slewing else b"%d" % t.tracking
        park = b"I" if self.parking else b"P" if t.parked else b"p"
        side = b"E" if t.pier_side is PierSide.EAST else b"W"
        return motion + b"0" + park + (b"H" if at_home(t) else b" ") + b"3" + b"        " + side + b"00A#"

    def old_word(self) -> bytes:
        return b"nN" + (b"P" if self.telescope.parked else b"p") + b"H4#"

    def answered_home(self) -> bytes:
        self.go_home()
        return b"1"


class TenMicronResponder(OnStepResponder):
    """10micron, protocol 2.14: imprecise until it is told otherwise."""

    precise = False
    decimals = 0
    mark = b"\xdf"
    unknown = b""

    def __init__(self, telescope) -> None:
        super().__init__(telescope)
        for word in (
            b"GR[aH]",
            b"GD[eH]",
            b"GU",
            b"Gm",
            b"GE",
            b"CS",
            b"hR",
            b"hP",
            b"hC",
            b"Te",
            b"Td",
            b"Gc",
            b"GXI",
        ):
            self.words.pop(word, None)
        self.words |= {
            b"GVP": lambda: b"10micron GM1000HPS#",
            b"GVN": lambda: b"2.15.14#",
            b"GVD": lambda: b"Mar 19 2018#",
            b"GVT": lambda: b"15:56:53#",
            b"GVZ": lambda: b"Q-TYPE2012#",
            b"GT": lambda: b"60.2#",
            b"U([012])": self.set_precision,
            b"Gstat": lambda: b"%d#" % self.status(),
            b"Ginfo": self.info,
            b"pS": lambda: NAMES[telescope.pier_side] + b"#",
            b"GRTMP": lambda: b"+010.0#",
            b"GRPRS": lambda: b"1013.0#",
            b"modelcnt": lambda: b"000#",
            b"getalst": lambda: b"0#",
            b"Guaf": lambda: b"0#",
            b"KA": lambda: self.park() and None,
            b"PO": lambda: self.unpark() and None,
            b"AL": lambda: self.track(False) and None,
            b"AP": lambda: self.track(True) and None,
            b"TSOLAR": lambda: self.set_tracking_rate(b"S"),
            b"GC": self.date,
        }
        rates = {b"G2": 1, b"C0": 16, b"C1": 64, b"C2": 600, b"C3": 1200}
        self.rates_deg_s = {name: rate * SIDEREAL_DEG_S for name, rate in rates.items()}

    def set_precision(self, digit: bytes) -> None:
        self.precise, self.decimals = digit != b"0", 2 if digit == b"2" else 0
        self.mark = b":" if digit == b"2" else b"\xdf"

    def written_dec(self, dec_deg: float) -> bytes:
        return degrees(dec_deg, self.precise, self.mark, decimals=1 if self.decimals else 0) + b"#"

    def date(self) -> bytes:
        return self.settings.local().strftime("%Y-%m-%d#" if self.decimals else "%m/%d/%y#").encode()

    def status(self) -> int:
        t = self.telescope
        self.parking &= t.slewing
        return 2 if self.parking else 6 if t.slewing else 5 if t.parked else 0 if t.tracking else 7

    def info(self) -> bytes:
        ra, dec = self.telescope.believed_deg()
        altitude, azimuth = horizontal_deg(self.telescope, self.settings.latitude_deg)
        side = NAMES[self.telescope.pier_side][:1].decode()
        text = f"{ra / 15.0:08.5f},{dec:+08.4f},{side},{azimuth:08.4f},{altitude:+08.4f},2461000.0,{self.status():d},0#"
        return text.encode()

    def slew(self) -> bytes:
        reason = self._goto(*self.target_deg)
        told = {"below horizon": b"1Object Below Horizon        #", "parked": b"4Mount Parked                #"}
        return b"0" if reason is None else told.get(reason, b"3Cannot Perform Slew         #")

    def sync(self) -> bytes:
        refused = self._sync(*self.target_deg)
        return b"Match fail: dist. too large#" if refused else b"Coordinates     matched        #"


class AstroPhysicsResponder(TenMicronResponder):
    """A GTOCP4: no product's name, no bars, and a goto below the horizon that is not answered."""

    mark = b"*"

    def __init__(self, telescope) -> None:
        super().__init__(telescope)
        kept = {
            b"GR",
            b"GD",
            b"GA",
            b"GZ",
            b"Q",
            b"Gt",
            b"Gg",
            b"GL",
            b"GS",
            b"Sr(.*)",
            b"Sd(.*)",
            b"St(.*)",
            b"Sg(.*)",
        }
        kept |= {b"MS", b"M([nsew])", b"Q([nsew])", b"SL(.*)", b"CM", b"KA", b"PO", b"pS", b"SG(.*)"}
        self.words = {word: method for word, method in self.words.items() if word in kept}
        self.rate = TrackingRate.SIDEREAL
        rates = (12, 64, 600, 1200)
        self.rates_deg_s = {b"C%d" % k: rate * SIDEREAL_DEG_S for k, rate in enumerate(rates)}
        self.words |= {
            b"V": lambda: b"VCP4-P02-15#",
            b"U": self.lengthen,
            b"GG": self.west,
            b"GC": lambda: self.settings.local().strftime("%m:%d:%y#").encode(),
            b"CMR": self.sync,
            b"GOS": self.state_word,
            b"RT([0129])": self.set_rate_number,
            b"R([CGS]\\d?)": self.set_rate,
            rb"M([nsew])(\d{3})": self.pulse,
            b"B[rd] .*": lambda: b"1",
            b"SC(.*)": lambda text: b" " * 32 + b"#" + b" " * 32 + b"#",
        }

    def lengthen(self) -> None:
        """One way."""
        self.precise, self.decimals = True, 1

    def written_dec(self, dec_deg: float) -> bytes:
        return degrees(dec_deg, self.precise, self.mark) + b"#"

    def west(self) -> bytes:
        return b"00:00:00.0#"

    def pulse(self, direction: bytes, milliseconds: bytes) -> None:
        if milliseconds == b"000":
            self.move(direction)  # until it is stopped
        else:
            super().pulse(direction, milliseconds)

    def set_rate_number(self, digit: bytes) -> None:
        rates = {b"0": TrackingRate.LUNAR, b"1": TrackingRate.SOLAR, b"2": TrackingRate.SIDEREAL}
        self.tracking_rate = rates.get(digit, TrackingRate.SIDEREAL)
        self.track(digit != b"9")

    def state_word(self) -> bytes:
        t = self.telescope
        self.parking &= t.slewing
        digit = {TrackingRate.LUNAR: b"0", TrackingRate.SOLAR: b"1"}.get(self.tracking_rate, b"2")
        return b"".join(
            [
                b"P" if t.parked else b"0",
                digit if t.tracking else b"9",
                b"9",
                b"S" if t.slewing else b"0",
                b"0011000000#",
            ]
        )

    def slew(self) -> bytes:
        return b"0" if self._goto(*self.target_deg) is None else b"1Object is below horizon        #"

    def sync(self) -> bytes:
        self._sync(*self.target_deg)
        return b"Coordinates     matched.        #"


class GeminiResponder(OnStepResponder):
    """Level 5: single letters for its state, and settings in a language of their own."""

    command = re.compile(rb"\x06|([<>][^#]*)#|:+([^#]*)#")
    begins = b"\x06:<>"
    mark = b":"
    unknown = b""

    def __init__(self, telescope) -> None:
        super().__init__(telescope)
        for word in (b"GR[aH]", b"GD[eH]", b"GU", b"GE", b"CS", b"hR", b"hC", b"Te", b"Td", b"T([QSLK])", b"D"):
            self.words.pop(word)
        self.rates_deg_s = SET_RATES
        self.words |= {
            b"\x06": lambda: b"G#",
            b"GVP": lambda: b"Losmandy Gemini#",
            b"GVN": lambda: b"5.21#",
            b"Gv": self.letter,
            b"h\\?": lambda: b"2" if self.parking and telescope.slewing else b"%d" % telescope.parked,
            b"hP": lambda: self.park() and None,
            b"hW": lambda: self.unpark() and None,
            b"hN": lambda: self.track(False) and None,
            b"<(\\d+):(.)": lambda number, check: b"1" + check + b"#",
            b">(\\d+):(.*)(.)": self.set_native,
        }

    def letter(self) -> bytes:
        t = self.telescope
        return b"S" if t.slewing else b"T" if t.tracking else b"N"

    def set_native(self, number: bytes, value: bytes, check: bytes) -> None:
        total = 0
        for byte in b">" + number + b":" + value:
            total ^= byte
        if bytes([total % 128 + 64]) != check:
            return
        rates = {b"131": b"Q", b"132": b"K", b"133": b"L", b"134": b"S"}
        asked = value if number == b"130" else number
        if asked in rates:
            self.set_tracking_rate(rates[asked])
        elif asked in (b"191", b"192"):
            self.track(asked == b"192")

    def slew(self) -> bytes:
        reason = self._goto(*self.target_deg)
        told = {"below horizon": b"1Object below horizon.#", "parked": b"7Rejected - Mount is parked!#"}
        return b"0" if reason is None else told.get(reason, b"4Position unreachable.#")

    def sync(self) -> bytes:
        return b"No object!#" if self._sync(*self.target_deg) else b"target#"


class RainbowResponder(OnStepResponder):
    """RainbowAstro 190905: an answer begins with its question, and a slew is not answered."""

    unknown = b""

    def __init__(self, telescope) -> None:
        super().__init__(telescope)
        told = (b"GR", b"GD", b"GA", b"GZ", b"Gt", b"Gg", b"GG", b"GL", b"GC")
        asked = {word: (lambda w=word, m=self.words[word]: b":" + w + m()) for word in told}
        kept = (b"Sr(.*)", b"Sd(.*)", b"M([nsew])", b"Q", b"R(.*)", b"St(.*)", b"Sg(.*)")
        self.words = asked | {word: self.words[word] for word in kept}
        self.rates_deg_s = SET_RATES
        self.words |= {
            b"AV": lambda: b":AV190905#",
            b"AT": lambda: b":AT%d#" % telescope.tracking,
            b"CL": lambda: b":CL%d#" % telescope.slewing,
            b"CU0": lambda: b":CU0=0.5#",
            b"Ct([AL])": lambda letter: self.track(letter == b"A") and None,
            b"Ct([RSM])": lambda letter: self.set_tracking_rate({b"R": b"Q", b"S": b"S", b"M": b"L"}[letter]),
            rb"Ck(\d{3}\.\d{3})([+-]\d\d\.\d{3})": lambda ra, dec: self._sync(float(ra), float(dec)) and None,
            b"MS": lambda: self._goto(*self.target_deg) and None,
        }

    def written_ra(self, ra_deg: float) -> bytes:
        return hours(ra_deg, True, 1) + b"#"

    def written_dec(self, dec_deg: float) -> bytes:
        return degrees(dec_deg, True, b"*", decimals=1) + b"#"


class StarSenseResponder(NexStarResponder):
    """Version 1.18 on a 6SE: its versions are counted anew."""

    version = (1, 18)
    model = 12

    def __init__(self, telescope) -> None:
        super().__init__(telescope)
        self.words[b"v"] = lambda: b"\x13#"

    def sync(self, text: bytes, digits: int) -> None:
        """``#``."""
        self.version = (4, 21)
        try:
            return super().sync(text, digits)
        finally:
            self.version = type(self).version


DIALECT_RESPONDERS = {
    "celestronaux": CelestronAuxResponder,
    "10micron": TenMicronResponder,
    "am5": Am5Responder,
    "nyx": NyxResponder,
    "teenastro": TeenAstroResponder,
    "astrophysics": AstroPhysicsResponder,
    "gemini": GeminiResponder,
    "rainbow": RainbowResponder,
    "starsense": StarSenseResponder,
}


def open_any(driver: str, telescope):
    """The far end of any driver."""
    made = DIALECT_RESPONDERS.get(driver)
    return made(telescope) if made else open_responder(driver, telescope)
