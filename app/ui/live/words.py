"""What the Live view says of a stream, in words and numbers; nothing here is a widget."""

import math
from dataclasses import dataclass

from app.core.attitude import radec_deg
from app.core.capture import CaptureLimits
from app.core.solution import NoSolution
from app.ui.formats import AngleStyle, arcsec_text, dec_text, ra_text
from app.ui.live.brighten import Levels
from app.ui.live.recording import Recorded
from app.ui.live.stream import Lens
from app.workflows.live_drift import Drift
from app.workflows.live_update import LiveUpdate

NOTHING = "–"
SLEW_ARCSEC_S = 360.0  # from this rate on degrees a second are easier to read
OLD_S = 1.0  # besides three exposures: an older answer is not where it points now


@dataclass(frozen=True, slots=True)
class State:
    """The headline: ``role`` dresses it, ``text`` is one more sentence."""

    title: str
    text: str
    role: str


def waiting() -> State:
    """No frame has been looked at yet."""
    return State("Waiting for a frame", "", "heading")


def age_text(age_s: float) -> str:
    """An age as a person reads it."""
    if age_s < 10.0:
        return f"{max(age_s, 0.0):.1f} s"
    if age_s < 100.0:
        return f"{age_s:.0f} s"
    if age_s < 3600.0:
        return f"{age_s / 60.0:.0f} min"
    return f"{age_s / 3600.0:.1f} h"


def limit_s(update: LiveUpdate) -> float:
    """From which age on an answer counts as old, by the pace of the camera."""
    exposure = update.shot.frame.hint.exposure_s or 0.0
    interval = 1.0 / update.frames_hz if update.frames_hz else exposure
    return OLD_S + exposure + 3.0 * min(interval, 60.0)


def is_old(update: LiveUpdate, now_s: float) -> bool:
    """Whether the newest pointing must not be taken for where the camera points now."""
    good = update.last_good
    if good is None:
        return False
    return update.is_old or good.age_s(now_s) > limit_s(update)


def state_of(update: LiveUpdate, now_s: float, seen_s: float = float("-inf")) -> State:
    """Whether the camera's place is known, and if not why and what to do.

    ``seen_s`` is when the newest frame came, of which there may be no answer yet.
    """
    if isinstance(update.result, NoSolution):
        return State(f"Lost in space: {update.result.reason}", update.result.advice, "bad")
    if update.age_s(now_s) > limit_s(update):
        since = age_text(update.age_s(now_s))
        if now_s - seen_s < limit_s(update):
            return State("Searching", f"The newest answer is {since} old.", "bad")
        return State("No new frames", f"The last one is {since} old.", "bad")
    if update.mode == "lost":
        return State("Found", "The whole sky was searched; tracking begins.", "heading")
    found, looked_for = update.track.matched, update.track.expected
    return State("Tracking", f"{found} of {looked_for} expected stars found", "heading")


def pointing(update: LiveUpdate) -> tuple[float, float] | None:
    """RA and Dec, ICRS degrees: the filter's where this frame has an answer, else the last good."""
    centre = update.track.filtered_centre
    if centre is not None:
        return radec_deg(centre)
    return None if update.last_good is None else update.last_good.solution.ra_dec_deg


def position_texts(update: LiveUpdate, style: AngleStyle) -> tuple[str, str]:
    """RA and Dec as text."""
    at = pointing(update)
    if at is None:
        return NOTHING, NOTHING
    return ra_text(at[0], style), dec_text(at[1], style)


def sigma_text(update: LiveUpdate) -> str:
    """One-sigma errors of the pointing."""
    sigma = update.track.sigma_arcsec
    if sigma is None or not all(map(math.isfinite, sigma)):
        return NOTHING
    x, y, roll = map(arcsec_text, sigma)
    return f"± {x} along x, {y} along y, {roll} in roll"


def rates_text(update: LiveUpdate) -> str:
    """The camera's turning against the stars about its three axes."""
    rates, sigmas = update.track.rates_deg_s, update.track.rates_sigma_deg_s
    if rates is None or sigmas is None:
        return NOTHING
    quick = max(map(abs, rates)) * 3600.0 >= SLEW_ARCSEC_S
    factor, unit = (1.0, "°/s") if quick else (3600.0, "″/s")
    parts = [
        f"{name} {_signed(rate * factor)} ± {_plain(sigma * factor)}"
        for name, rate, sigma in zip("xyz", rates, sigmas, strict=True)
    ]
    return f"{',  '.join(parts)} {unit}"


def drift_texts(drift: Drift | None) -> tuple[str, str]:
    """Drift in right ascension, already times cos(Dec), and in declination."""
    if drift is None:
        return NOTHING, NOTHING
    over = f"(over {drift.span_s:.0f} s)"
    east = f"{_signed(drift.ra_arcsec_min)} ± {_plain(drift.ra_sigma)} ″/min  {over}"
    return east, f"{_signed(drift.dec_arcsec_min)} ± {_plain(drift.dec_sigma)} ″/min  {over}"


def pace_text(update: LiveUpdate, drawn_hz: float | None) -> str:
    """How many frames come, are solved and are drawn in a second."""
    solved, came = _hertz(update.solved_hz), _hertz(update.frames_hz)
    lost = f", {update.dropped:,} overtaken" if update.dropped else ""
    return f"{solved} solved, {came} frames{lost}; {_hertz(drawn_hz)} drawn"


def latency_text(update: LiveUpdate, screen_ms: float | None) -> str:
    """From the frame's arrival to its answer, and from mid-exposure to the screen."""
    text = f"{update.latency_ms:.0f} ms to solve"
    if screen_ms is None:
        return text
    return f"{text}; {_duration(screen_ms)} from mid-exposure to the screen"


def lens_text(lens: Lens, name: str) -> str:
    """What is known of camera and lens."""
    profile = lens.profile
    if profile is None or not profile.frames:
        return "Not known yet" if name else "Not known yet; without a name it is not kept"
    focal, sigma = profile.camera.focal_px, profile.sigma["focal_px"]
    text = f"focal length {focal:.1f} ± {sigma:.2g} px, {profile.frames:,} frames"
    return text if name else f"{text}; not kept without a name"


def levels_text(levels: Levels) -> str:
    """How the frame is exposed, and what to change when that is wrong."""
    text = f"Sky {levels.sky:.1%} of full, brightest {levels.top:.0%}"
    if levels.clipped > 0.002:
        return f"{text}; {levels.clipped:.1%} clipped: expose shorter"
    if levels.sky > 0.5:
        return f"{text}: expose shorter"
    if levels.top < 0.02:
        return f"{text}: expose longer"
    return text


def recorded_text(state: Recorded | None) -> str:
    """How a recording does."""
    if state is None:
        return ""
    free = f"{state.free_bytes / 1e9:.1f} GB free"
    word = "Recording" if state.going_on else "Recorded"
    tail = f"; {free}" if state.going_on and state.free_bytes else ""
    return f"{word} {state.frames:,} frames, {state.solved:,} solved{tail}: {state.folder}"


def cannot(limits: CaptureLimits) -> dict[str, str]:
    """Why some things cannot be set on a camera, by name; what can be set is not in it."""
    given = {"exposure": limits.exposure_s, "gain": limits.gain, "binning": limits.binning}
    return {
        name: f"This camera does not let its {name} be set from here."
        for name, limit in given.items()
        if limit is None or limit[0] == limit[1]
    }


def _hertz(value: float | None) -> str:
    if value is None:
        return f"{NOTHING}/s"
    return f"{value:.0f}/s" if value >= 9.95 else f"{value:.1f}/s"


def _duration(ms: float) -> str:
    return f"{ms:.0f} ms" if ms < 9_950 else f"{ms / 1e3:.0f} s"


def _signed(value: float) -> str:
    places = 0 if abs(value) >= 100 else 1 if abs(value) >= 10 else 2
    return f"{value:+.{places}f}".replace("-", "−")


def _plain(value: float) -> str:
    if not math.isfinite(value):
        return NOTHING
    places = 0 if value >= 100 else 1 if value >= 10 else 2
    return f"{value:.{places}f}"
