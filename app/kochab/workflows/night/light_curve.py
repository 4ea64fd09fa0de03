"""The brightness of chosen stars over a night, and the file in which the AAVSO takes it.

What is wrong with the catalogue as a whole is the same in every frame. What a single measurement is off by, beside the
noise of the sky, is fitted to the night: catalogued stars like it should not change, so that what they scatter by is
what flat, air, pixels, photons and neighbours do to a star of that brightness (as Honeycutt 1992, PASP 104, 435, takes
ensembles). A frame in which all scatter more has a larger sigma. One of them, the most alike, is the check star that is
written beside.
"""

import math
from collections.abc import Iterator, Sequence
from datetime import datetime

import numpy as np

from kochab.core import __version__
from kochab.core.arrays import Floats, Ints
from kochab.core.errors import UsageError
from kochab.core.robust import mad_sigma, median
from kochab.core.values import frozen
from kochab.sky.apparent import JD_UNIX
from kochab.workflows.night.chosen_stars import StarInFrame
from kochab.workflows.night.frame import NightFrame
from kochab.workflows.night.measure import Measure

TELLING = 5
"""Frames from which on a check star is one, and stars from which on a frame's scatter is told."""
ENSEMBLE, UNTOLD_MAG = 20, 0.03
"""Measurements of stars like it from which on their scatter is known; what is added where it is not."""
UNLIKE = 3.0
"""Times the usual scatter, from which on a star is no comparison."""
POOR_FRAME = 1.5
"""Times the usual scatter of a frame, from which on one is poorer than the others, not by chance."""
WITHIN_TWO = 0.9545
IN_MOST = 0.8
"""Least fraction of a star's frames in which its check star is measured too."""
LEAST_MAG = 0.003
"""No single measurement of a star through the air is better."""
CLEAR = "CV"
"""The AAVSO's name of no filter, with magnitudes brought to V."""
BANDS = {"V": "V", "TG": "TG", "G": "TG"}
"""The AAVSO's names of filters whose magnitudes are near V; others are told as `CLEAR`."""
HEAD = "NAME,DATE,MAG,MERR,FILT,TRANS,MTYPE,CNAME,CMAG,KNAME,KMAG,AMASS,GROUP,CHART,NOTES"


@frozen
class Point:
    """One measurement: mid-exposure, V with its sigma, V of the check star in the same frame, airmass where known."""

    file: str
    time_utc: datetime
    mag: Measure
    check_mag: float | None
    airmass: float | None


@frozen
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
    sigmas = _sigmas([one for *_, one in seen])
    points = tuple(
        Point(f.file, time, Measure(one.mag, sigma), dict(one.checks).get(check), f.sky.airmass if f.sky else None)
        for (f, time, one), sigma in zip(seen, sigmas, strict=True)
    )
    filters = {f.on_sky.filter for f, *_ in seen if f.on_sky}
    band = BANDS.get(filters.pop(), CLEAR) if len(filters) == 1 else CLEAR
    return LightCurve(name, check, band, median(np.array([one.zero_mag for *_, one in seen])), points)


def _sigmas(seen: Sequence[StarInFrame]) -> list[float]:
    """Of each frame's measurement, magnitudes: the sky's noise, and what stars like it scatter by in this night."""
    own = np.array([one.noise_mag for one in seen])
    left, noise, frame = _left_of_checks(seen)
    if len(left) < ENSEMBLE:
        return [math.hypot(value, LEAST_MAG, UNTOLD_MAG) for value in own.tolist()]
    of_frame = [left[frame == k] for k in range(len(seen))]
    spread = np.array([mad_sigma(one) if len(one) >= TELLING else np.nan for one in of_frame])
    factor = np.nan_to_num(spread / np.nanmedian(spread), nan=1.0) if np.isfinite(spread).any() else np.ones(len(seen))
    factor = np.where(factor > POOR_FRAME, factor, 1.0)
    more = _scatter_beside(left / factor[frame], noise)
    return [
        math.hypot(value, more, LEAST_MAG) * times for value, times in zip(own.tolist(), factor.tolist(), strict=True)
    ]


def _left_of_checks(seen: Sequence[StarInFrame]) -> tuple[Floats, Floats, Ints]:
    """What stars like one are off their own means by, their noise by the sky, and in which frame, each (N,).

    Those that scatter far more than the others, variables and such as have a neighbour, are left out.
    """
    by_star: dict[str, list[tuple[int, float]]] = {}
    for k, one in enumerate(seen):
        for name, mag in one.checks:
            by_star.setdefault(name, []).append((k, mag))
    stars = [(np.array([k for k, _ in at]), np.array([m for _, m in at])) for at in by_star.values() if len(at) >= 3]
    # of so few values the mean takes a share of the scatter with it
    parts = [((mag - mag.mean()) * math.sqrt(len(mag) / (len(mag) - 1)), at, mag) for at, mag in stars]
    usual = median(np.array([float(np.std(off)) for off, *_ in parts])) if parts else 0.0
    parts = [part for part in parts if float(np.std(part[0])) <= UNLIKE * usual]
    if not parts:
        return np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64)
    left, of_check = (np.concatenate([part[k] for part in parts]) for k in (0, 2))
    at = np.concatenate([part[1] for part in parts])
    own, mags = np.array([one.noise_mag for one in seen]), np.array([one.mag for one in seen])
    return left, own[at] * 10.0 ** (0.4 * (of_check - mags[at])), at


def _scatter_beside(left: Floats, noise: Floats) -> float:
    """What is added to noise (N,) so that 95.45 % of what is left (N,) lie within two sigma; 0 for nothing."""
    beyond = np.maximum((0.5 * left) ** 2 - noise**2, 0.0)  # what each asks for to lie at two sigma
    return math.sqrt(float(np.quantile(beyond, WITHIN_TWO)))


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
