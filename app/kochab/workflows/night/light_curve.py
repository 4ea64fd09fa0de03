"""The brightness of chosen stars over a night, and the file in which the AAVSO takes it.

What is wrong with the catalogue as a whole is the same in every frame. What a single measurement is off by is told by a
check star, the catalogued one most like it, which should not change.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from kochab.core import __version__
from kochab.core.errors import UsageError
from kochab.core.robust import mad_sigma, median
from kochab.sky.apparent import JD_UNIX
from kochab.workflows.night.chosen_stars import StarInFrame
from kochab.workflows.night.frame import NightFrame
from kochab.workflows.night.measure import Measure

TELLING = 5
"""Frames from which on a check star's scatter is one."""
IN_MOST = 0.8
"""Least fraction of a star's frames in which its check star is measured too."""
LEAST_MAG = 0.003
"""No single measurement of a star through the air is better."""
CLEAR = "CV"
"""The AAVSO's name of no filter, with magnitudes brought to V."""
BANDS = {"V": "V", "TG": "TG", "G": "TG"}
"""The AAVSO's names of filters whose magnitudes are near V; others are told as `CLEAR`."""
HEAD = "NAME,DATE,MAG,MERR,FILT,TRANS,MTYPE,CNAME,CMAG,KNAME,KMAG,AMASS,GROUP,CHART,NOTES"


@dataclass(frozen=True, slots=True)
class Point:
    """One measurement: mid-exposure, V with its sigma, V of the check star in the same frame, airmass where known."""

    file: str
    time_utc: datetime
    mag: Measure
    check_mag: float | None
    airmass: float | None


@dataclass(frozen=True, slots=True)
class LightCurve:
    """A star over the night; ``check`` names the check star, "" without one.

    ``zero_mag`` is what all points may be off by together, beside their own sigmas. ``band`` is as the AAVSO calls it.
    """

    name: str
    check: str
    band: str
    zero_mag: float
    points: tuple[Point, ...]


def light_curves(frames: Sequence[NightFrame]) -> tuple[LightCurve, ...]:
    """Light curves of the chosen stars; the frames are in order of time."""
    names = dict.fromkeys(one.name for frame in frames for one in frame.chosen)
    return tuple(curve for curve in (_curve(name, frames) for name in names) if curve.points)


def _curve(name: str, frames: Sequence[NightFrame]) -> LightCurve:
    seen = [(f, f.time_utc, one) for f in frames for one in f.chosen if one.name == name and f.time_utc]
    check = _check([one for *_, one in seen])
    checked = [dict(one.checks).get(check) for *_, one in seen]
    known = np.array([mag for mag in checked if mag is not None])
    scatter = mad_sigma(known) if len(known) >= TELLING else 0.0
    points = tuple(
        Point(
            f.file,
            time,
            Measure(one.mag, math.hypot(max(scatter, one.noise_mag), LEAST_MAG)),
            mag,
            f.sky.airmass if f.sky else None,
        )
        for (f, time, one), mag in zip(seen, checked, strict=True)
    )
    filters = {f.on_sky.filter for f, *_ in seen if f.on_sky}
    band = BANDS.get(filters.pop(), CLEAR) if len(filters) == 1 else CLEAR
    return LightCurve(name, check, band, median(np.array([one.zero_mag for *_, one in seen])), points)


def _check(seen: Sequence[StarInFrame]) -> str:
    """The check star: of those in most frames the one most like the star; "" for none."""
    ranks: dict[str, list[int]] = {}
    for one in seen:
        for k, (name, _) in enumerate(one.checks):
            ranks.setdefault(name, []).append(k)
    steady = {name: at for name, at in ranks.items() if len(at) >= max(IN_MOST * len(seen), TELLING)}
    return min(steady, key=lambda name: sum(steady[name]) / len(steady[name]), default="")


def aavso_extended(curves: Sequence[LightCurve], observer: str) -> str:
    """The AAVSO's Extended File Format of light curves, for the observer of that code.

    Version 1.2, https://www.aavso.org/aavso-extended-file-format: six parameters, then rows of fifteen columns.
    Magnitudes are those of the whole field's catalogue ("ENSEMBLE"); a frame is one measurement, none is combined.
    """
    head = [
        *("#TYPE=EXTENDED", f"#OBSCODE={observer}", f"#SOFTWARE=Kochab {__version__}", "#DELIM=,", "#DATE=JD"),
        *("#OBSTYPE=CCD", f"#{HEAD}"),
    ]
    return "\n".join([*head, *(row for curve in curves for row in _aavso_rows(curve))]) + "\n"


def _aavso_rows(curve: LightCurve) -> Iterator[str]:
    name, check = curve.name.replace(",", " ").upper(), curve.check.replace(",", " ") or "na"
    for point in curve.points:
        date = f"{point.time_utc.timestamp() / 86400.0 + JD_UNIX:.5f}"
        known = point.check_mag is not None
        air = f"{point.airmass:.3f}" if point.airmass is not None else "na"
        checked = (check, f"{point.check_mag:.3f}") if known else ("na", "na")
        note = f"|ZPERR={curve.zero_mag:.3f}"
        of_star = name, date, f"{point.mag.value:.3f}", f"{point.mag.sigma:.3f}", curve.band, "NO", "STD"
        yield ",".join([*of_star, "ENSEMBLE", "na", *checked, air, "na", "na", note])


def observer_code(text: str) -> str:
    """The code of an AAVSO observer; UsageError where it cannot be one."""
    code = text.strip().upper()
    if not (code.isascii() and code.isalnum() and 2 <= len(code) <= 5):
        raise UsageError("{text} is not an AAVSO observer code, such as ABC.", text=text)
    return code
