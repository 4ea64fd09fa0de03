"""What live solving prints: one JSON object a frame, or one line a frame for people."""

import json
from typing import Any

from kochab.cli.output import Json, as_json, radec, to_line
from kochab.core.angle_text import age_text
from kochab.core.solution import Solution
from kochab.workflows.live.session import Replayed
from kochab.workflows.live.update import Drift, GoodPointing, LiveUpdate


def live_json(update: LiveUpdate) -> Json:
    """The JSON of ``solve`` for this frame, its age, and how the stream is doing."""
    track, shot = update.track, update.shot
    now_s = update.done_s
    return {
        **as_json(shot.frame.path or f"frame {shot.number}", update.result),
        "frame": shot.number,
        "time_utc": track.time_utc.isoformat(),
        "exposure_s": shot.frame.hint.exposure_s,
        "age_s": round(update.age_s(now_s), 3),
        "latency_ms": round(update.latency_ms, 3),
        "mode": track.mode,
        "solved_hz": _rounded(update.solved_hz),
        "frames_hz": _rounded(update.frames_hz),
        "dropped": update.dropped,
        "drift_arcsec_min": _drift(update.drift),
        "rates_deg_s": _listed(track.rates_deg_s),
        "rates_sigma_deg_s": _listed(track.rates_sigma_deg_s),
        "filtered": _filtered(update),
        "last_good": _good(update.last_good, now_s),
        "warnings": list(update.warnings),
    }


def finite_json(update: LiveUpdate) -> Json:
    """The same with every number JSON cannot hold replaced by None, for a recording."""
    value: Json = json.loads(to_line(live_json(update)))
    return value


def replay_json(replayed: Replayed) -> Json:
    """The frame solved again, and how that compares with what was recorded."""
    return {
        **live_json(replayed.update),
        "frame_file": replayed.line["frame_file"],
        "intact": replayed.intact,
        "agrees": replayed.agrees,
        "apart_arcsec": replayed.apart_arcsec,
    }


def live_line(update: LiveUpdate) -> str:
    """One line: where it points and how old that is, or why not and what was known before."""
    result = update.result
    head = f"{update.shot.number:6d}  {age_text(update.age_s(update.done_s)):>8}"
    if isinstance(result, Solution):
        text = f"{head}  {radec(*result.ra_dec_deg)}  roll {result.roll_deg:8.3f}"
        text += f"  {len(result.stars):3d} stars  {update.mode:8}  {update.latency_ms:6.0f} ms"
        if drift := update.drift:
            text += f"  drift RA {drift.ra_arcsec_min:+.1f} Dec {drift.dec_arcsec_min:+.1f} arcsec/min"
        return text
    text = f"{head}  no solution: {result.reason}. {result.advice}"
    good = update.last_good
    if good is not None:
        age = age_text(good.age_s(update.done_s))
        text += f" (old, {age}: {radec(*good.solution.ra_dec_deg)})"
    return text


def replay_line(replayed: Replayed) -> str:
    """One line a frame: the same or not."""
    name = replayed.line["frame_file"]
    said = "same answer" if replayed.agrees else "ANOTHER ANSWER"
    apart = replayed.apart_arcsec
    where = "" if apart is None else f", {apart:.3f} arcsec apart"
    return f"{name}  {said}{where}" + ("" if replayed.intact else "; THE FILE WAS CHANGED")


def _drift(drift: Drift | None) -> Json | None:
    if drift is None:
        return None
    return {
        "ra": drift.ra_arcsec_min,
        "dec": drift.dec_arcsec_min,
        "sigma": [drift.ra_sigma, drift.dec_sigma],
        "span_s": drift.span_s,
        "frames": drift.frames,
    }


def _filtered(update: LiveUpdate) -> Json | None:
    """The pointing of the frame's middle after all frames so far."""
    centre = update.track.filtered_centre
    if centre is None:
        return None
    ra, dec, roll = centre.euler_deg
    return {"ra_deg": ra, "dec_deg": dec, "roll_deg": roll, "sigma_arcsec": list(centre.sigma_arcsec)}


def _good(good: GoodPointing | None, now_s: float) -> Json | None:
    if good is None:
        return None
    ra, dec = good.solution.ra_dec_deg
    return {
        "frame": good.number,
        "age_s": round(good.age_s(now_s), 3),
        "ra_deg": ra,
        "dec_deg": dec,
        "roll_deg": good.solution.roll_deg,
    }


def _listed(values: Any) -> list[float] | None:
    return None if values is None else [float(v) for v in values]


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
