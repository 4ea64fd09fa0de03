"""Meade's Autostar, for which Kochab has no driver: INDI's own drives it to try the family's far end."""

from kochab.simulate.responders.lx200 import Lx200Responder, OnStepResponder


class AutostarResponder(Lx200Responder):
    """Precise from the start, with a product name, guide pulses and a short ``:D#``."""

    precise = True

    def __init__(self, telescope) -> None:
        super().__init__(telescope)
        self.words |= {
            b"GVP": lambda: b"Autostar#",
            b"GVN": lambda: b"43Eg#",
            b"GVD": lambda: b"Jan 01 2010#",
            b"GVT": lambda: b"00:00:00#",
            b"GVF": lambda: b"ETX Autostar|A|43Eg|Jan 01 2010@00:00:00#",
            b"GW": self.how,
            b"hP": self.park,
            rb"Mg([nsew])(\d{1,5})": self.pulse,
        }

    distance_bars = OnStepResponder.distance_bars
    pulse = OnStepResponder.pulse

    def sync(self) -> bytes:
        """The name of an object of no consequence."""
        self._sync(*self.target_deg)
        return b" M31 EX GAL MAG 3.5 SZ178.0'#"

    def how(self) -> bytes:
        """``:GW#``: the mounting, tracking or not, and on how many stars it is aligned."""
        tracks = b"T" if self.telescope.tracking else b"N"
        return b"P" + tracks + (b"2#" if self.telescope.aligned else b"0#")

    def park(self) -> None:
        """Nothing is answered; it does not move again until it is switched off and on."""
        self.telescope.stop()
        self.telescope.tracking, self.telescope.parked = False, True
