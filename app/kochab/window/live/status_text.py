"""The status of a live stream as text; no widgets."""

import math

from PySide6.QtCore import QDateTime, QLocale

from kochab.attitude.filter import RATE_SIGMA_RAD_S
from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg
from kochab.core.capture import CaptureLimits
from kochab.core.solution import NoSolution
from kochab.core.values import frozen
from kochab.text.angle_text import AngleStyle, age_text, arcsec_text, dec_text, milliseconds_text, ra_text
from kochab.text.translation import number, tr, tr_n, tr_noop
from kochab.window.live.rendering import Levels
from kochab.workflows.live.session import Recorder
from kochab.workflows.live.update import TONIGHT_S, Drift, LiveUpdate
from kochab.workflows.session.live_stream import Lens
from kochab.workflows.solution_text import reason_text

NOTHING = "–"
SLEW_ARCSEC_S = 360.0  # faster rates are shown in degrees per second
MEASURED_DEG_S = 0.1 * math.degrees(RATE_SIGMA_RAD_S)  # a rate better known than before any frame
OLD_S = 1.0  # added to three frame intervals: an older solution may no longer be true


@frozen
class StreamStatus:
    """The headline with its style sheet ``role``; ``text`` is one more sentence."""

    title: str
    text: str
    role: str


def limit_s(update: LiveUpdate) -> float:
    """The age, in seconds, from which a solution counts as old at this frame rate."""
    exposure = update.shot.frame.hint.exposure_s or 0.0
    interval = 1.0 / update.frames_hz if update.frames_hz else exposure
    # Bounded, or a camera that has nearly stopped would never be old.
    return OLD_S + exposure + 3.0 * min(interval, 60.0)


def is_old(update: LiveUpdate, now_s: float) -> bool:
    """Whether the camera may point elsewhere by now."""
    good = update.last_good
    return good is not None and (update.is_old or update.shown_age_s(now_s) > limit_s(update))


def old_text(age_s: float) -> str:
    """How old the last pointing is, where the current one is unknown."""
    if age_s < TONIGHT_S:
        return tr("Last solved {age} ago. The telescope may have moved since.", age=age_text(age_s))
    date = QLocale().toString(QDateTime.currentDateTime().addSecs(-round(age_s)).date(), QLocale.FormatType.LongFormat)
    return tr("Taken {date}: not tonight’s pointing.", date=date)


def stream_status(update: LiveUpdate, now_s: float, seen_s: float = float("-inf")) -> StreamStatus:
    """Whether the pointing is known, and if not why and what to do.

    ``seen_s`` is the arrival of the newest frame, which may not be solved yet.
    """
    if isinstance(update.result, NoSolution):
        return StreamStatus(tr("No solution: {reason}", reason=reason_text(update.result)), update.result.advice, "bad")
    if update.shown_age_s(now_s) > limit_s(update):
        since = age_text(update.shown_age_s(now_s))
        # Frames come, and none of them is solved.
        if now_s - seen_s < limit_s(update):
            return StreamStatus(tr("Searching"), tr("Last solution {since} ago.", since=since), "bad")
        return StreamStatus(tr("No new frames"), tr("Last frame {since} ago.", since=since), "bad")
    if update.mode == "lost":
        return StreamStatus(tr("Solved"), tr("Solved blind; tracking starts."), "heading")
    found, expected = update.track.matched, update.track.expected
    matched = tr("{found} of {expected} expected stars matched", found=found, expected=expected)
    return StreamStatus(tr("Tracking"), matched, "heading")


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
    return tr("± {x} in x, {y} in y, {roll} in rotation", x=x, y=y, roll=roll)


def rates_text(update: LiveUpdate) -> str:
    """Rotation rates about those of the camera's three axes where they are measured by now."""
    rates, sigmas = update.track.rates_deg_s, update.track.rates_sigma_deg_s
    if rates is None or sigmas is None:
        return NOTHING
    fastest = max(map(abs, rates))
    quick = fastest * 3600.0 >= SLEW_ARCSEC_S
    factor, unit = (1.0, "°/s") if quick else (3600.0, "″/s")
    parts = [
        f"{name} {_figures(rate * factor, '+')} ± {_figures(sigma * factor)}"
        for name, rate, sigma in zip("xyz", rates, sigmas, strict=True)
        if sigma < max(MEASURED_DEG_S, 0.3 * fastest)
    ]
    return f"{',  '.join(parts)} {unit}" if parts else NOTHING


def drift_texts(drift: Drift | None) -> tuple[str, str]:
    """Drift in right ascension, already times cos(Dec), and in declination."""
    if drift is None:
        return NOTHING, NOTHING
    east, north = ((drift.ra_arcsec_min, drift.ra_sigma), (drift.dec_arcsec_min, drift.dec_sigma))
    text = tr("{rate} ± {sigma} ″/min  (over {span} s)")
    span = number(drift.span_s, ".0f")
    ra, dec = (text.format(rate=_figures(r, "+"), sigma=_figures(sigma), span=span) for r, sigma in (east, north))
    return ra, dec


def frame_rate_text(update: LiveUpdate) -> str:
    """Frames per second, and how many frames were dropped."""
    fps = _fps(update.frames_hz)
    return tr("{fps}, {dropped:,} dropped", fps=fps, dropped=update.dropped) if update.dropped else fps


def frame_rate_tip(update: LiveUpdate, drawn_hz: float | None) -> str:
    """Frames solved and drawn per second."""
    return tr("Solved: {solved}, drawn: {drawn}", solved=_fps(update.solved_hz), drawn=_fps(drawn_hz))


def latency_text(update: LiveUpdate, screen_ms: float | None) -> str:
    """From the frame's arrival to its solution, and from mid-exposure to the screen."""
    if screen_ms is None or screen_ms > TONIGHT_S * 1000.0:  # of a recording
        return tr("{ms:.0f} ms to solve", ms=update.latency_ms)
    screen = milliseconds_text(screen_ms)
    return tr("{ms:.0f} ms to solve, {screen} to the screen", ms=update.latency_ms, screen=screen)


def lens_text(lens: Lens) -> str:
    """The calibration of camera and lens."""
    profile = lens.profile
    if profile is None or not profile.frames:
        return tr("Not measured yet")
    focal, sigma = profile.camera.focal_px, profile.sigma["focal_px"]
    return tr_n(
        "Focal length {focal:.1f} ± {sigma:.2g} px, {n:,} frame",
        "Focal length {focal:.1f} ± {sigma:.2g} px, {n:,} frames",
        profile.frames,
        focal=focal,
        sigma=sigma,
    )


def levels_text(levels: Levels) -> str:
    """Sky and peak level, and whether to change the exposure."""
    text = tr("Sky {sky:.1%}, peak {top:.0%} of full scale", sky=levels.sky, top=levels.top)
    if levels.clipped > 0.002:
        return tr("{text}. {clipped:.1%} of pixels clipped: reduce the exposure.", text=text, clipped=levels.clipped)
    if levels.sky > 0.5:
        return tr("{text}. Reduce the exposure.", text=text)
    return tr("{text}. Increase the exposure.", text=text) if levels.top < 0.02 else text


def recorded_text(recorder: Recorder) -> str:
    """Frames recorded, free disk space and the folder."""
    text = (
        tr("Recording {frames} frames, {solved} solved; {free} GB free: {folder}")
        if recorder.recording
        else tr("Recorded {frames} frames, {solved} solved: {folder}")
    )
    frames, solved, free = (number(recorder.frames, ","), number(recorder.solved, ","), recorder.free_bytes / 1e9)
    return text.format(frames=frames, solved=solved, free=number(free, ".1f"), folder=recorder.folder)


FIXED = {
    "exposure": tr_noop("This camera’s exposure cannot be set from here."),
    "gain": tr_noop("This camera’s gain cannot be set from here."),
    "binning": tr_noop("This camera’s binning cannot be set from here."),
}


def fixed_settings(limits: CaptureLimits) -> dict[str, str]:
    """Setting -> why it cannot be changed on this camera."""
    given = {"exposure": limits.exposure_s, "gain": limits.gain, "binning": limits.binning}
    return {name: tr(FIXED[name]) for name, limit in given.items() if limit is None or limit[0] == limit[1]}


def _fps(value: float | None) -> str:
    if value is None:
        return tr("{rate} fps", rate=NOTHING)
    return tr("{rate} fps", rate=number(value, ".0f" if value >= 9.95 else ".1f"))


def _figures(value: float, sign: str = "") -> str:
    """About three figures; with the ``sign`` "+" that is always written."""
    if not math.isfinite(value):
        return NOTHING
    places = 0 if abs(value) >= 100 else 1 if abs(value) >= 10 else 2
    return number(value, f"{sign}.{places}f").replace("-", "−")
