"""Settings against what a camera allows, before it is asked."""

from app.core.capture import CaptureLimits, CaptureSettings
from app.core.errors import RefusedError

Bounds = tuple[float, float] | tuple[int, int] | None


def check_within(settings: CaptureSettings, limits: CaptureLimits) -> None:
    """Raise RefusedError with the range when a wish is outside it or cannot be had."""
    _within("exposure", settings.exposure_s, limits.exposure_s, "s")
    _within("gain", settings.gain, limits.gain, "")
    _within("binning", settings.binning, limits.binning, "")


def _within(what: str, value: float | None, bounds: Bounds, unit: str) -> None:
    if value is None:
        return
    if bounds is None:
        raise RefusedError(f"The {what} of this camera cannot be set.")
    if not bounds[0] <= value <= bounds[1]:
        span = f"{bounds[0]:g} to {bounds[1]:g} {unit}".strip()
        raise RefusedError(f"A {what} of {value:g} {unit}".strip() + f" is not within {span}.")
