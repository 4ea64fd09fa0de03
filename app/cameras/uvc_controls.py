"""Exposure and gain of a video camera, where its driver offers them: V4L2 through linuxpy."""

import sys
from collections.abc import Mapping
from importlib.util import find_spec
from typing import Any

from app.core.capture import CaptureLimits, CaptureSettings
from app.core.errors import RefusedError

UNIT_S = 1e-4  # of V4L2_CID_EXPOSURE_ABSOLUTE
MANUAL = 1  # V4L2_EXPOSURE_MANUAL
GAINS = ("GAIN", "ANALOGUE_GAIN")


class Controls:
    """What can be set, from a driver's controls by the names of V4L2's constants.

    Each control has ``value``, ``minimum`` and ``maximum``.
    """

    def __init__(self, controls: Mapping[str, Any]) -> None:
        self._automatic = controls.get("EXPOSURE_AUTO")
        self._exposure = controls.get("EXPOSURE_ABSOLUTE")
        self._gain = next((controls[name] for name in GAINS if name in controls), None)
        self.exposure_s: float | None = None

    @property
    def limits(self) -> CaptureLimits:
        """The driver's ranges."""
        exposure = _range(self._exposure)
        return CaptureLimits(
            exposure and (exposure[0] * UNIT_S, exposure[1] * UNIT_S), _range(self._gain)
        )

    def apply(self, settings: CaptureSettings) -> CaptureSettings:
        """Set what is told and return what is in force; RefusedError when the driver says no."""
        try:
            if settings.exposure_s is not None and self._exposure is not None:
                if self._automatic is not None:
                    self._automatic.value = MANUAL
                self._exposure.value = max(1, round(settings.exposure_s / UNIT_S))
                self.exposure_s = self._exposure.value * UNIT_S
            if settings.gain is not None and self._gain is not None:
                self._gain.value = round(settings.gain)
            gain = None if self._gain is None else float(self._gain.value)
        except (OSError, ValueError, AttributeError) as error:
            raise RefusedError(f"The camera does not take this setting: {error}.") from None
        return CaptureSettings(self.exposure_s, gain)


def controls_of(device: str) -> Controls:
    """The controls of a device file; none where there is no such thing to ask."""
    if not device.startswith("/dev/") or sys.platform != "linux" or find_spec("linuxpy") is None:
        return Controls({})
    from linuxpy.video.device import Device, V4L2Error

    found: dict[str, Any] = {}
    try:
        driver = Device(device)
        driver.open()
        for control in driver.controls.values():
            if control.standard is not None:
                found[control.standard.name] = control
    except (OSError, V4L2Error):
        return Controls({})
    return Controls(found)


def _range(control: Any) -> tuple[float, float] | None:
    return None if control is None else (float(control.minimum), float(control.maximum))
