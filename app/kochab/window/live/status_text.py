"""The status of a live stream as text; no widgets."""

import math
from dataclasses import dataclass

from kochab.core.angle_text import AngleStyle, age_text, arcsec_text, dec_text, milliseconds_text, ra_text
from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg
from kochab.core.capture import CaptureLimits
from kochab.core.solution import NoSolution
from kochab.window.live.rendering import Levels
from kochab.workflows.live.session import Recorder
from kochab.workflows.live.update import Drift, LiveUpdate
from kochab.workflows.session.live_stream import Lens

NOTHING = "–"
SLEW_ARCSEC_S = 360.0  # faster rates are shown in degrees per second
OLD_S = 1.0  # added to three frame intervals: an older solution may no longer be true


@dataclass(frozen=True, slots=True)
class StreamStatus:
    """The headline with its style sheet ``role``; ``text`` is one more sentence."""

    title: str
    text: str
    role: str


def limit_s(update: LiveUpdate) -> float:
    """The age, in seconds, from which a solution counts as old at this frame rate."""
    exposure = update.shot.frame.hint.exposure_s or 0.0
    interval = 1.0 / update.frames_hz if update.frames_hz else exposure
    return OLD_S + exposure + 3.0 * min(interval, 60.0)


def is_old(update: LiveUpdate, now_s: float) -> bool:
    """Whether the camera may point elsewhere by now."""
    good = update.last_good
    return good is not None and (update.is_old or good.age_s(now_s) > limit_s(update))


def stream_status(update: LiveUpdate, now_s: float, seen_s: float = float("-inf")) -> StreamStatus:
    """Whether the pointing is known, and if not why and what to do.

    ``seen_s`` is the arrival of the newest frame, which may not be solved yet.
    """
    if isinstance(update.result, NoSolution):
        return StreamStatus(f"No solution: {update.result.reason}", update.result.advice, "bad")
    if update.age_s(now_s) > limit_s(update):
        since = age_text(update.age_s(now_s))
        if now_s - seen_s < limit_s(update):
            return StreamStatus("Searching", f"Last solution {since} ago.", "bad")
        return StreamStatus("No new frames", f"Last frame {since} ago.", "bad")
    if update.mode == "lost":
        return StreamStatus("Solved", "Solved blind; tracking starts.", "heading")
    found, expected = update.track.matched, update.track.expected
    return StreamStatus("Tracking", f"{found} of {expected} expected stars matched", "heading")


def pointing_vector(update: LiveUpdate) -> Floats | None:
    """Boresight, ICRS unit vector (3,): the filter's if this frame is solved, else the last good one."""
    centre = update.track.filtered_centre
    if centre is None and update.last_good is not None:
        centre = update.last_good.solution.centre_attitude
    return None if centre is None else centre.boresight


def position_texts(update: LiveUpdate, style: AngleStyle) -> tuple[str, str]:
    """RA and Dec as text."""
    centre = pointing_vector(update)
    if centre is None:
        return NOTHING, NOTHING
    ra, dec = radec_deg(centre)
    return ra_text(ra, style), dec_text(dec, style)


def sigma_text(update: LiveUpdate) -> str:
    """Uncertainty (1σ) of the pointing."""
    sigma = update.track.sigma_arcsec
    if sigma is None or not all(map(math.isfinite, sigma)):
        return NOTHING
    x, y, roll = map(arcsec_text, sigma)
    return f"± {x} in x, {y} in y, {roll} in rotation"


def rates_text(update: LiveUpdate) -> str:
    """Rotation rates about the camera's three axes."""
    rates, sigmas = update.track.rates_deg_s, update.track.rates_sigma_deg_s
    if rates is None or sigmas is None:
        return NOTHING
    quick = max(map(abs, rates)) * 3600.0 >= SLEW_ARCSEC_S
    factor, unit = (1.0, "°/s") if quick else (3600.0, "″/s")
    parts = [
        f"{name} {_figures(rate * factor, '+')} ± {_figures(sigma * factor)}"
        for name, rate, sigma in zip("xyz", rates, sigmas, strict=True)
    ]
    return f"{',  '.join(parts)} {unit}"


def drift_texts(drift: Drift | None) -> tuple[str, str]:
    """Drift in right ascension, already times cos(Dec), and in declination."""
    if drift is None:
        return NOTHING, NOTHING
    over = f"(over {drift.span_s:.0f} s)"
    east = f"{_figures(drift.ra_arcsec_min, '+')} ± {_figures(drift.ra_sigma)} ″/min  {over}"
    return east, f"{_figures(drift.dec_arcsec_min, '+')} ± {_figures(drift.dec_sigma)} ″/min  {over}"


def frame_rate_text(update: LiveUpdate) -> str:
    """Frames per second, and how many frames were dropped."""
    dropped = f", {update.dropped:,} dropped" if update.dropped else ""
    return f"{_fps(update.frames_hz)}{dropped}"


def frame_rate_tip(update: LiveUpdate, drawn_hz: float | None) -> str:
    """Frames solved and drawn per second."""
    return f"Solved: {_fps(update.solved_hz)}, drawn: {_fps(drawn_hz)}"


def latency_text(update: LiveUpdate, screen_ms: float | None) -> str:
    """From the frame's arrival to its solution, and from mid-exposure to the screen."""
    text = f"{update.latency_ms:.0f} ms to solve"
    return text if screen_ms is None else f"{text}, {milliseconds_text(screen_ms)} to the screen"


def lens_text(lens: Lens, name: str) -> str:
    """The calibration of camera and lens."""
    profile = lens.profile
    if profile is None or not profile.frames:
        return "Not measured yet" if name else "Not measured yet; name the lens to save it"
    focal, sigma = profile.camera.focal_px, profile.sigma["focal_px"]
    text = f"focal length {focal:.1f} ± {sigma:.2g} px, {profile.frames:,} frame{'s' * (profile.frames != 1)}"
    return text if name else f"{text}; name the lens to save it"


def levels_text(levels: Levels) -> str:
    """Sky and peak level, and whether to change the exposure."""
    text = f"Sky {levels.sky:.1%}, peak {levels.top:.0%} of full scale"
    if levels.clipped > 0.002:
        return f"{text}. {levels.clipped:.1%} of pixels clipped: reduce the exposure."
    if levels.sky > 0.5:
        return f"{text}. Reduce the exposure."
    return f"{text}. Increase the exposure." if levels.top < 0.02 else text


def recorded_text(recorder: Recorder) -> str:
    """Frames recorded, free disk space and the folder."""
    word = "Recording" if recorder.recording else "Recorded"
    tail = f"; {recorder.free_bytes / 1e9:.1f} GB free" if recorder.recording else ""
    return f"{word} {recorder.frames:,} frames, {recorder.solved:,} solved{tail}: {recorder.folder}"


def fixed_settings(limits: CaptureLimits) -> dict[str, str]:
    """Setting -> why it cannot be changed on this camera."""
    given = {"exposure": limits.exposure_s, "gain": limits.gain, "binning": limits.binning}
    return {
        name: f"This camera’s {name} cannot be set from here."
        for name, limit in given.items()
        if limit is None or limit[0] == limit[1]
    }


def _fps(value: float | None) -> str:
    if value is None:
        return f"{NOTHING} fps"
    return f"{value:.0f} fps" if value >= 9.95 else f"{value:.1f} fps"


def _figures(value: float, sign: str = "") -> str:
    """About three figures; with the ``sign`` "+" that is always written."""
    if not math.isfinite(value):
        return NOTHING
    places = 0 if abs(value) >= 100 else 1 if abs(value) >= 10 else 2
    return f"{value:{sign}.{places}f}".replace("-", "−")
