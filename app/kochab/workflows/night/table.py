"""The night as a table: CSV for spreadsheets, JSON for programs. Each number has its uncertainty beside it."""

import csv
import io
import json
import math
from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Any

from kochab.polar.drift import Drift
from kochab.polar.error import Knob
from kochab.text.translation import in_english
from kochab.workflows.night.earlier import Compared
from kochab.workflows.night.frame import NightFrame
from kochab.workflows.night.light_curve import LightCurve
from kochab.workflows.night.measure import Measure
from kochab.workflows.night.sky_brightness import faintest_of, stated_brightness
from kochab.workflows.night.summary import Night, advice_of
from kochab.workflows.night.tracking import Tracking
from kochab.workflows.pointing_model import model_json, sighting_rows


def frame_rows(night: Night) -> Iterator[dict[str, Any]]:
    """A row a frame, in order of time; None for what is not known."""
    of_trails = ("tilt_px", "tilt_px_sigma", "softest", "curvature_px", "curvature_px_sigma")
    trailed = dict.fromkeys(of_trails) if night.untracked else {}
    for frame, lost, cloud, sky in zip(night.frames, night.lost, night.cloud, night.brightness, strict=True):
        together = _pair("lost_mag", lost) | _pair("cloud_mag", cloud) | _pair("sky_mag_arcsec2", sky)
        yield frame_row(frame) | together | trailed


def frame_row(frame: NightFrame) -> dict[str, Any]:
    """What one frame says by itself; None for what is not known."""
    sharp, sky, stars = frame.sharp, frame.sky, frame.on_sky
    field = sharp.field if sharp else None
    return {
        "file": frame.file,
        "time_utc": frame.time_utc.isoformat() if frame.time_utc else None,
        "exposure_s": frame.exposure_s,
        "solved": frame.solved,
        "reason": frame.error or frame.reason or None,
        "ra_deg": _known(frame.ra_deg),
        "dec_deg": _known(frame.dec_deg),
        "roll_deg": _known(frame.roll_deg),
        "scale_arcsec_px": _known(frame.scale_arcsec_px),
        "stars": frame.detections,
        **_pair("fwhm_px", sharp.fwhm_px if sharp else None),
        **_pair("elongation", sharp.elongation if sharp else None),
        **_pair("trail", sharp.trail if sharp else None),
        "trail_deg": sharp.trail_deg if sharp else None,
        **_pair("tilt_px", field.tilt if field else None),
        "softest": field.softest if field else None,
        **_pair("curvature_px", field.curvature if field else None),
        **dict.fromkeys(("lost_mag", "lost_mag_sigma", "cloud_mag", "cloud_mag_sigma")),  # of a night's frames together
        **_pair("sky_mag_arcsec2", stated_brightness(stars, sky.airmass if sky else None) if stars else None),
        **_pair("limiting_mag", faintest_of(stars) if stars else None),
        "altitude_deg": sky.altitude_deg if sky else None,
        "sun_altitude_deg": sky.sun_altitude_deg if sky else None,
        "moon_altitude_deg": sky.moon_altitude_deg if sky else None,
        "moon_distance_deg": sky.moon_distance_deg if sky else None,
        "moon_lit": sky.moon_lit if sky else None,
    }


def night_json(night: Night, earlier: Sequence[Compared] = ()) -> dict[str, Any]:
    """The stable form of the whole, beside earlier nights of the same equipment."""
    shape = night.field
    with in_english():
        return {
            "frames": list(frame_rows(night)),
            "asked": night.asked,
            "solved": len(night.frames) - len(night.unsolved),
            "hours": night.hours,
            **_pair("fwhm_px", night.fwhm),
            **_pair("elongation", night.elongation),
            **_pair("focus_px_h", night.focus),
            **_pair("sky_mag_arcsec2", night.usual(night.brightness)),
            **_pair("limiting_mag", night.usual(night.faintest)),
            "field": {
                **_pair("tilt_px", shape.tilt),
                "tilt_chance": shape.tilt_chance,
                "softest": shape.softest,
                **_pair("curvature_px", shape.curvature),
                "corners_px": {name: [one.value, one.sigma] for name, one in shape.corners.items()},
            }
            if shape
            else None,
            "events": [
                {"time_utc": one.time_utc.isoformat(), "kind": one.kind, "text": one.text} for one in night.events
            ],
            "crossings": [
                {
                    "file": night.frames[k].file,
                    "time_utc": _time(night.frames[k].time_utc),
                    "kind": str(one.kind),
                    "name": one.name or None,
                    "from_deg": list(one.ends_deg[0]),
                    "to_deg": list(one.ends_deg[1]),
                    "from_px": list(one.ends_px[0]),
                    "to_px": list(one.ends_px[1]),
                    "length_deg": one.length_deg,
                    "sigma_arcsec": one.sigma_arcsec,
                    "snr": one.snr,
                    "whole": one.whole,
                    "off_arcsec": _known(one.off_arcsec),
                    "chance": _known(one.chance),
                }
                for k, one in night.crossings
            ],
            "strangers": [
                {
                    "kind": str(one.kind),
                    "name": one.name or None,
                    "frames": len(one.frames),
                    "first_utc": _time(night.frames[one.frames[0]].time_utc),
                    "ra_deg": one.sights[0].ra_deg,
                    "dec_deg": one.sights[0].dec_deg,
                    "sigma_arcsec": one.sigma_arcsec,
                    **_pair("ra_arcsec_h", one.rate_arcsec_h[0]),
                    **_pair("dec_arcsec_h", one.rate_arcsec_h[1]),
                    **_pair("mag", one.mag),
                    **_pair("off_arcsec", one.off_arcsec),
                    "log10_chance": _known(one.log10_chance),
                }
                for one in night.strangers
            ],
            "stars": [_light_curve(one) for one in night.light_curves],
            "guiding": [
                {
                    "begun": one.begun.replace(tzinfo=None).isoformat(),
                    "hours": one.hours,
                    "frames": one.frames,
                    "dithers": one.dithers,
                    **_pair("ra_arcsec", one.ra_arcsec),
                    **_pair("dec_arcsec", one.dec_arcsec),
                    **_pair("total_arcsec", one.total_arcsec),
                    **_pair("backlash_dec_arcsec", one.backlash_arcsec),
                }
                for one in night.guiding
            ],
            "tracking": [_tracking(one) for one in night.tracking],
            "polar": _polar(night.polar) if night.polar else None,
            "pointing_model": model_json(night.pointing.model) if night.pointing.model else None,
            "pointing_model_unknown": night.pointing.why or None,
            **_pair("tube_flexure_arcsec", night.pointing.flexure),
            "tube_flexure_unknown": None if night.pointing.flexure else night.pointing.flexure_words,
            "sightings": sighting_rows(night.pointing.useful_sightings),
            "earlier": [
                {
                    "quantity": one.name,
                    **_pair("tonight", one.tonight),
                    **_pair("usual", one.usual),
                    "nights": one.nights,
                    "unusual": one.unusual,
                }
                for one in earlier
            ],
            "clouded": [night.frames[k].file for k in night.clouded],
            "best": [night.frames[k].file for k in night.best],
            "worst": [night.frames[k].file for k in night.worst],
            "advice": advice_of(night),
        }


def night_json_text(night: Night, earlier: Sequence[Compared] = ()) -> str:
    """The same as it is written into a file."""
    return json.dumps(night_json(night, earlier), indent=1) + "\n"


def night_csv(night: Night) -> str:
    """The rows of the frames with a header; empty where nothing is known."""
    rows = list(frame_rows(night))
    into = io.StringIO()
    writer = csv.DictWriter(into, list(rows[0]) if rows else ["file"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return into.getvalue()


def _light_curve(one: LightCurve) -> dict[str, Any]:
    return {
        "name": one.name,
        "check": one.check or None,
        "band": one.band,
        "zero_mag": one.zero_mag,
        "points": [
            {
                "file": point.file,
                "time_utc": point.time_utc.isoformat(),
                **_pair("mag", point.mag),
                "check_mag": point.check_mag,
                "airmass": point.airmass,
            }
            for point in one.points
        ],
    }


def _tracking(one: Tracking) -> dict[str, Any]:
    return {
        "frames": len(one.frames),
        "hours": one.hours,
        "dithers": one.dithers,
        **_pair("ra_arcsec_h", one.ra_arcsec_h),
        **_pair("dec_arcsec_h", one.dec_arcsec_h),
        **_pair("rate_arcsec_s", one.rate_arcsec_s),
        **_pair("backlash_dec_arcsec", one.backlash_arcsec if isinstance(one.backlash_arcsec, Measure) else None),
        "backlash_unknown": one.backlash_arcsec if isinstance(one.backlash_arcsec, str) else None,
        "periodic": {
            "amplitudes_arcsec": [[a.value, a.sigma] for a in one.periodic.amplitudes],
            **_pair("peak_to_peak_arcsec", one.periodic.peak_to_peak),
            **_pair("period_s", one.periodic.period_s),
            "chance": one.periodic.chance,
        }
        if one.periodic
        else None,
        "wander_arcsec": [wander.value for wander in one.wander_arcsec],
        "wander_arcsec_sigma": [wander.sigma for wander in one.wander_arcsec],
        "jumps": [
            {
                "kind": str(jump.kind),
                "time_utc": jump.time_utc.isoformat(),
                **_pair("ra_arcsec", jump.ra_arcsec),
                **_pair("dec_arcsec", jump.dec_arcsec),
            }
            for jump in one.jumps
        ],
    }


def _polar(drift: Drift) -> dict[str, Any]:
    """As ``kochab polar`` names them; a bolt that the drift can't tell yet is null."""
    error, whole = drift.error, drift.error.with_systematics
    return {
        "altitude_arcsec": error.altitude_arcsec if drift.tells(Knob.ALTITUDE) else None,
        "altitude_arcsec_sigma": whole.knob_sigma_arcsec(Knob.ALTITUDE),
        "azimuth_arcsec": error.azimuth_arcsec if drift.tells(Knob.AZIMUTH) else None,
        "azimuth_arcsec_sigma": whole.knob_sigma_arcsec(Knob.AZIMUTH),
        "text": drift.words,
    }


def _pair(name: str, one: Measure | None) -> dict[str, float | None]:
    return {name: _known(one.value) if one else None, f"{name}_sigma": _known(one.sigma) if one else None}


def _time(time: datetime | None) -> str | None:
    return time.isoformat() if time else None


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
