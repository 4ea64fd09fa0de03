"""Collect sightings for a pointing model in a file, and use it for gotos until the mount's coordinates change."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from kochab.core.errors import RefusedError, UsageError
from kochab.core.frame import Site
from kochab.core.mount import Epoch, PierSide, Pointing
from kochab.frames.atomic_file import atomic_file
from kochab.gear.mounts.guard import Guard
from kochab.parsing.text_input import read_json
from kochab.pointing.disagreement import MountSighting
from kochab.pointing.pointing_model import PointingModel

LASTS = timedelta(hours=16)  # a night: a mount is seldom still aligned the same way on the next


def use_model(mount: Guard, model: PointingModel) -> None:
    """Aim gotos by the model, until the next sync, or the line is opened again; `RefusedError` where it cannot hold."""
    age = mount.clock() - model.made_utc
    if not timedelta(0) <= age + timedelta(minutes=1) <= LASTS:  # a minute for clocks that differ
        hours = age / timedelta(hours=1)
        raise RefusedError(
            "The pointing model is {hours:.0f} h old, and the mount may have been set up anew: make another.",
            hours=hours,
        )
    if model.epoch is not mount.epoch:
        raise RefusedError(
            "The pointing model is for coordinates {epoch}, the mount's are {epoch2}.",
            epoch=model.epoch,
            epoch2=mount.epoch,
        )
    if not model.helps:
        raise RefusedError("The pointing model does not help: sync the mount instead.")
    mount.supervisor.aim = model.aim


def model_json(model: PointingModel) -> dict[str, Any]:
    """The model's numbers, degrees and arcseconds."""
    return {**asdict(model), "made_utc": model.made_utc.isoformat(), "helps": model.helps}


def save_sightings(path: Path, sightings: Sequence[MountSighting]) -> None:
    """Write them whole or not at all."""
    with atomic_file(path) as part:
        part.write_text(json.dumps({"sightings": sighting_rows(sightings)}, indent=1), encoding="utf-8")


def sighting_rows(sightings: Sequence[MountSighting]) -> list[dict[str, Any]]:
    """What :func:`load_sightings` reads under ``sightings``, in a file of their own or a night's."""
    return [
        {
            "sky_deg": s.sky_deg,
            "said_deg": (s.reported.ra_deg, s.reported.dec_deg),
            "epoch": s.reported.epoch,
            "time_utc": s.time_utc.isoformat(),
            "site": None if s.site is None else asdict(s.site),
            "pier_side": s.pier_side,
            "alt_azimuth": s.alt_azimuth,
        }
        for s in sightings
    ]


def load_sightings(path: Path) -> list[MountSighting]:
    """What :func:`save_sightings` has written, none where there is no file; `UsageError` when it is something else."""
    if not path.exists():
        return []
    try:
        return [_sighting(row) for row in read_json(path)["sightings"]]
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise UsageError("{path} holds no sightings of a mount.", path=path) from error


def _sighting(row: dict[str, Any]) -> MountSighting:
    (ra, dec), (reported_ra, reported_dec) = (map(float, row[name]) for name in ("sky_deg", "said_deg"))
    reported = Pointing(reported_ra % 360.0, reported_dec, Epoch(row["epoch"]))
    time_utc = datetime.fromisoformat(row["time_utc"])

    if time_utc.tzinfo is None or not (
        math.isfinite(ra + reported_ra) and abs(dec) <= 90.0 and abs(reported_dec) <= 90.0
    ):
        raise ValueError(row)
    site = None if row["site"] is None else Site(**{name: float(value) for name, value in row["site"].items()})
    if site is not None and not (abs(site.latitude_deg) <= 90.0 and math.isfinite(site.longitude_deg + site.height_m)):
        raise ValueError(row)
    side = None if row["pier_side"] is None else PierSide(row["pier_side"])
    alt_azimuth = None if row["alt_azimuth"] is None else bool(row["alt_azimuth"])
    return MountSighting((ra % 360.0, dec), reported, time_utc, site, side, alt_azimuth=alt_azimuth)
