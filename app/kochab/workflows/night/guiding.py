"""How well the night was guided, by the guide logs that lie beside its frames (PHD2, KStars, ASIAIR)."""

import math
from collections.abc import Iterable, Iterator
from datetime import datetime
from pathlib import Path

import numpy as np

from kochab.core.arrays import Bools, Floats, Ints
from kochab.core.errors import FrameError
from kochab.core.values import frozen
from kochab.workflows.night.backlash import told_backlash
from kochab.workflows.night.measure import Measure
from kochab.workflows.polar.guide_logs import GuidedRun, guided_runs, is_guide_log, response_of

SETTLING_S = 15.0
"""Time for the star to settle after a dither, seconds; if the log says when it has settled, that is used instead."""
LEAST_FRAMES = 20
ALIKE_MOST = 0.95
"""Neighbours are never taken to be more alike than that."""


@frozen
class Guiding:
    """One run: when by the log's own clock, how long, frames without those that settle, dithers, and RMS in arcsec.

    An RMS is that about the star's mean place between two dithers, as PHD2 tells it. ``backlash_arcsec`` is what Dec's
    gear swallows when a pulse turns it back; None where the pulses do not show it.
    """

    begun: datetime
    hours: float
    frames: int
    dithers: int
    ra_arcsec: Measure
    dec_arcsec: Measure
    backlash_arcsec: Measure | None = None

    @property
    def total_arcsec(self) -> Measure:
        """Of both axes together."""
        ra, dec = self.ra_arcsec, self.dec_arcsec
        total = math.hypot(ra.value, dec.value)
        return Measure(total, math.hypot(ra.value * ra.sigma, dec.value * dec.sigma) / total if total else 0.0)


def guiding_of(folders: Iterable[Path]) -> tuple[Guiding, ...]:
    """The runs of the guide logs in folders, in order of time; logs that cannot be read are left out."""
    runs = [one for folder in folders for path in _logs(folder) for one in _read(path)]
    found = [one for one in map(_guiding, runs) if one]
    return tuple(sorted(found, key=lambda one: one.begun))


def _logs(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.iterdir() if path.is_file() and is_guide_log(path))
    except OSError:
        return []


def _read(path: Path) -> list[GuidedRun]:
    try:
        return guided_runs(path)
    except FrameError:
        return []


def _guiding(run: GuidedRun) -> Guiding | None:
    """None for a run of unknown scale, and for one too short to tell."""
    if not run.scale > 0.0 or len(run.rows) < LEAST_FRAMES:
        return None
    time, ra, dec, _, _, dither = np.array(run.rows).T
    parts = list(_settled(time, dither, np.array(run.settling)))
    frames = sum(len(part) for part in parts)
    if frames < LEAST_FRAMES:
        return None
    hours = float(np.ptp(time)) / 3600.0
    ra_arcsec, dec_arcsec = (_rms([run.scale * axis[part] for part in parts]) for axis in (ra, dec))
    return Guiding(run.begun, hours, frames, len(np.unique(dither)) - 1, ra_arcsec, dec_arcsec, _backlash(run))


def _backlash(run: GuidedRun) -> Measure | None:
    found = response_of(run)
    if found is None or not math.isfinite(found.backlash):
        return None
    return told_backlash(run.scale * found.backlash, run.scale * found.backlash_sigma)


def _settled(time: Floats, dither: Floats, settling: Bools) -> Iterator[Ints]:
    """Frame indices of each stretch between dithers, without the frames taken while the guider settled."""
    for k, number in enumerate(np.unique(dither)):
        part = np.flatnonzero(dither == number)
        if k and not settling[part].any():
            kept = part[time[part] > time[part[0]] + SETTLING_S]
        else:
            kept = part[~settling[part]]
        if len(kept) >= 3:
            yield kept


def _rms(parts: list[Floats]) -> Measure:
    """About the mean of each part, with its uncertainty, wider where neighbours err alike."""
    left = [part - part.mean() for part in parts]
    n = sum(map(len, left)) - len(left)
    power = sum(float(part @ part) for part in left)
    alike = sum(float(part[1:] @ part[:-1]) for part in left) / power if power else 0.0
    alike = min(max(alike, 0.0), ALIKE_MOST)
    rms = math.sqrt(power / n)
    return Measure(rms, rms / math.sqrt(2.0 * n) * math.sqrt((1.0 + alike**2) / (1.0 - alike**2)))
