"""The rig's camera behind the interface of real ones."""

import time
from datetime import datetime
from weakref import WeakValueDictionary

from kochab.core.capture import CameraDevice, CameraSource, CaptureLimits, CaptureSettings
from kochab.core.errors import LineLostError, PortError
from kochab.core.frame import Frame
from kochab.simulate.rig import PracticeRig
from kochab.text.translation import tr

EXPOSURE_S = (0.001, 60.0)
GAIN = (0.1, 100.0)
LOOK_S = 0.02  # of real time, between looks at the clock

RUNNING: "WeakValueDictionary[str, PracticeRig]" = WeakValueDictionary()
"""The rigs of this program that can be opened, by name."""


def announce(rig: PracticeRig) -> str:
    """Let the rig's camera be opened by the name that is returned, for as long as the rig lives."""
    number = 1
    while f"rig {number}" in RUNNING:
        number += 1
    RUNNING[f"rig {number}"] = rig
    return f"rig {number}"


def withdraw(name: str) -> None:
    """Let nobody open the camera of that name any more; who has it keeps it."""
    RUNNING.pop(name, None)


class SimulatedCamera(CameraSource):
    """Exposes one after the other; frames that nobody fetched are never made.

    Gain is units an electron. On a clock that stands still each call makes one exposure pass.
    """

    name = "simulated"

    def __init__(self, rig: PracticeRig, settings: CaptureSettings | None = None) -> None:
        self.rig = rig
        self._open = True
        self._settings = CaptureSettings(1.0, 1.0 / rig.config.camera.sensor.gain_e, 1)
        self.configure(settings or CaptureSettings())

    @classmethod
    def devices(cls, address: str = "") -> list[CameraDevice]:
        """The camera of every rig that runs in this program, and one on a rig of its own."""
        running = [
            CameraDevice(cls.name, name, tr("the camera of the practice telescope, {name}", name=name))
            for name in sorted(RUNNING)
        ]
        return [*running, CameraDevice(cls.name, "new", tr("a camera on a new simulated telescope"))]

    @classmethod
    def open(cls, address: str, settings: CaptureSettings) -> "SimulatedCamera":
        """The camera of a running rig; ``new``, or nothing while none runs, starts one."""
        names = sorted(RUNNING)
        if address == "new" or (not address and not names):
            from kochab.simulate.rig import tonight

            return cls(PracticeRig(tonight()), settings)
        rig = RUNNING.get(address or names[-1])
        if rig is None:
            raise PortError(
                "No practice telescope is called '{address}' here; choose one of {value}.",
                address=address,
                value=", ".join([*names, "new"]),
            )
        return cls(rig, settings)

    @property
    def limits(self) -> CaptureLimits:
        """Exposure in simulated seconds; no binning."""
        return CaptureLimits(exposure_s=EXPOSURE_S, gain=GAIN, binning=(1, 1))

    def configure(self, settings: CaptureSettings) -> CaptureSettings:
        """Apply what can be applied, beginning a new exposure, and return what is in force."""
        exposure, gain = self._settings.exposure_s, self._settings.gain
        if settings.exposure_s is not None:
            exposure = min(max(settings.exposure_s, EXPOSURE_S[0]), EXPOSURE_S[1])
        if settings.gain is not None:
            gain = min(max(settings.gain, GAIN[0]), GAIN[1])
        self._settings = CaptureSettings(exposure, gain, 1)
        self._began = self.rig.clock.now_unix()
        self._given = 0
        return self._settings

    def next_frame(self, timeout_s: float) -> Frame | None:
        """The newest exposure that is over and not yet given, or None within real ``timeout_s``."""
        until = time.monotonic() + timeout_s
        exposure = float(self._settings.exposure_s or EXPOSURE_S[0])
        while True:
            if not self._open:
                raise LineLostError("The simulated camera has been closed.")
            done = int((self.rig.clock.now_unix() - self._began) / exposure)
            if done > self._given:
                self._given = done
                # the newest whole exposure; those missed before it are dropped, as a camera that is polled late does
                start = self._began + (done - 1) * exposure
                return self.rig.frame_since(start, exposure, 1.0 / (self._settings.gain or 1.0))
            if not self._wait(self._began + (done + 1) * exposure, until):
                return None

    def now_utc(self) -> datetime:
        """The rig's time, which dates the frames and tells their age."""
        return self.rig.clock.now_utc()

    def close(self) -> None:
        """Give the camera back; never raises."""
        self._open = False

    def _wait(self, moment: float, until: float) -> bool:
        """Wait a little for a simulated moment; False when the patience is over."""
        clock = self.rig.clock
        if clock.rate == 0.0:
            clock.step(max(0.0, moment - clock.now_unix()) + 1e-6)
            return True
        left = (moment - clock.now_unix()) / clock.rate
        patience = until - time.monotonic()
        if patience <= 0.0 and left > 0.0:
            return False
        time.sleep(max(0.0, min(left + 1e-4, patience, LOOK_S)))
        return True
