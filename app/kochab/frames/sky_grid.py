"""The lines of RA and Dec, or of azimuth and altitude, on a solved frame or on the part of it that is seen."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg, unit_vectors, wrapped
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.text.translation import tr, tr_noop

DEC_STEPS_DEG = (30.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 1 / 3, 1 / 6, 1 / 12, 1 / 30, 1 / 60, 1 / 120, 1 / 360)
_PARTS_OF_AN_HOUR = (1, 2, 3, 6, 12, 30, 60, 120, 180, 360, 720, 1800, 3600)
RA_STEPS_DEG = (90.0, 45.0, 30.0, *(15.0 / part for part in _PARTS_OF_AN_HOUR))
AZIMUTH_STEPS_DEG = (90.0, 45.0, *DEC_STEPS_DEG)
POINTS = 65
WANTED = 6  # lines across the view, about
FAR_PX = 1e5
NORTH_EAST_UP = [1, 0, 2]  # of east, north, up, and back: azimuth runs from north through east


NAMED = {"ecliptic": tr_noop("Ecliptic"), "galactic": tr_noop("Galactic equator")}


@frozen(eq=False)
class GridLine:
    """One line: ``xy`` (N, 2) image px with NaN where it is out of sight, and its value."""

    kind: str  # "ra" or "dec", "az" or "alt", or a name of NAMED, which has no value
    value_deg: float
    step_deg: float
    xy: Floats

    @property
    def text(self) -> str:
        """Its value, as fine as its step needs, or its name."""
        if self.kind in NAMED:
            return tr(NAMED[self.kind])
        units, whole_deg, turn = ("hms", 15.0, 24) if self.kind == "ra" else ("°′″", 1.0, 360)
        minutes, s = divmod(seconds := round(abs(self.value_deg) / whole_deg * 3600.0), 60)
        sign = "" if self.kind in ("ra", "az") or not seconds else "−" if self.value_deg < 0 else "+"
        whole, m = divmod(minutes, 60)
        places = 3 if s or self.step_deg < whole_deg / 60.0 else 2 if m or self.step_deg < whole_deg else 1
        value = " ".join((f"{sign}{whole % turn}{units[0]}", f"{m:02d}{units[1]}", f"{s:02d}{units[2]}")[:places])
        if self.kind in ("ra", "dec"):
            return value
        return tr("az {angle}", angle=value) if self.kind == "az" else tr("alt {angle}", angle=value)

    def spot(self, xy: Floats, x0: float, y0: float, x1: float, y1: float) -> tuple[float, float] | None:
        """Where its text belongs in a box: low for meridians, far left for the others; None when the line is not in it.

        Parameters
        ----------
        xy : Floats
            The line (N, 2), in the box's coordinates, px.
        x0, y0 : float
            The box's corner with the smallest coordinates.
        x1, y1 : float
            The box's corner with the largest.
        """
        x, y = xy[:, 0], xy[:, 1]
        with np.errstate(invalid="ignore"):
            inside = (x > x0) & (x < x1) & (y > y0) & (y < y1)
        if not inside.any():
            return None
        best = int(np.where(inside, y if self.kind in ("ra", "az") else -x, -np.inf).argmax())
        return float(x[best]), float(y[best])


def named_lines(lines: Mapping[str, Sequence[Floats]], on: Mapping[str, bool]) -> dict[str, list[GridLine]]:
    """Of the lines (N, 2) of each kind in a frame that is :data:`NAMED` and on, the longest: one name is enough."""
    drawn = {kind: lines[kind] for kind in NAMED if on[kind] and lines[kind]}
    return {kind: [GridLine(kind, 0.0, 1.0, max(parts, key=len))] for kind, parts in drawn.items()}


class SiteSky(Protocol):
    """A site's horizon at a moment: both ways between ICRS and east, north, up, unit vectors (N, 3)."""

    def observed(self, vectors: Floats) -> Floats:
        """East, north, up of ICRS."""

    def catalogue(self, directions: Floats) -> Floats:
        """ICRS of east, north, up."""


def grid_lines(
    solution: Solution, x0: float, y0: float, x1: float, y1: float, horizon: SiteSky | None = None
) -> list[GridLine]:
    """The lines that cross a part of the frame.

    Parameters
    ----------
    solution : Solution
        Where the frame points.
    x0, y0 : float
        The part's corner with the smallest coordinates, image px.
    x1, y1 : float
        The part's corner with the largest.
    horizon : SiteSky or None
        Sky above a site, for lines of altitude and azimuth; None for RA and Dec.
    """
    camera = solution.camera
    x0, y0 = max(x0, -0.5), max(y0, -0.5)
    x1, y1 = min(x1, camera.width - 0.5), min(y1, camera.height - 0.5)
    if x1 <= x0 or y1 <= y0:
        return []
    gx, gy = np.meshgrid(np.linspace(x0, x1, 17), np.linspace(y0, y1, 17))
    sky = solution.sky_at(np.column_stack([gx.ravel(), gy.ravel()]))
    middle = sky[len(sky) // 2]
    reach = float(np.arccos(np.clip((sky @ middle).min(), -1.0, 1.0)))
    across, along, steps = ("ra", "dec", RA_STEPS_DEG) if horizon is None else ("az", "alt", AZIMUTH_STEPS_DEG)
    own = sky if horizon is None else horizon.observed(sky)[:, NORTH_EAST_UP]
    dec0, dec1, ra0, ra1 = _bounds(own, own[len(own) // 2], reach)
    size = min(np.degrees(reach) * 1.4, 180.0)
    dec_step = _step(DEC_STEPS_DEG, size / WANTED)
    shrink = max(float(np.cos(np.radians((dec0 + dec1) / 2.0))), 0.01)
    # Near a pole meridians crowd: the step leaves at most a dozen lines over the view.
    ra_step = _step(steps, max(size / WANTED / shrink, (ra1 - ra0) / 12.0))
    near = np.cos(min(reach * 1.15 + 1e-6, np.pi))
    lines: list[GridLine] = []
    for value in _multiples(dec0, dec1, dec_step):
        ra = np.linspace(ra0, ra1, POINTS if ra1 - ra0 < 180 else 4 * POINTS)
        lines.append(_line(along, value, dec_step, ra, value))
    for value in _multiples(ra0, ra1, ra_step):
        # 0° and 360° are one meridian.
        if ra1 - ra0 >= 360.0 and value >= ra0 + 360.0 - 1e-9:
            continue
        # Meridians stop half a step short of the pole, where they would run into one blot.
        top = min(90.0 - dec_step / 2, dec1) if dec1 > 90.0 - 1e-6 else dec1
        low = max(-90.0 + dec_step / 2, dec0) if dec0 < -90.0 + 1e-6 else dec0
        lines.append(_line(across, value % 360.0, ra_step, value, np.linspace(low, top, POINTS)))
    drawn = _projected(solution, lines, middle, near, horizon)
    return [line for line in drawn if np.isfinite(line.xy).all(axis=1).sum() > 1]


def _bounds(sky: Floats, middle: Floats, reach: float) -> tuple[float, float, float, float]:
    """(dec0, dec1, ra0, ra1), degrees, that hold the view; all RA when a pole is in it."""
    dec = np.degrees(np.arctan2(sky[:, 2], np.hypot(sky[:, 0], sky[:, 1])))
    dec0, dec1 = float(dec.min()), float(dec.max())
    middle_dec = math.radians(radec_deg(middle)[1])
    if abs(middle_dec) + reach >= np.pi / 2:
        if middle_dec > 0:
            dec1 = 90.0
        else:
            dec0 = -90.0
        return dec0, dec1, 0.0, 360.0
    ra_mid = np.degrees(np.arctan2(middle[1], middle[0]))
    ra = np.degrees(np.arctan2(sky[:, 1], sky[:, 0]))
    away = wrapped(ra - ra_mid)
    return dec0, dec1, float(ra_mid + away.min()), float(ra_mid + away.max())


def _step(steps: tuple[float, ...], wanted: float) -> float:
    return min(steps, key=lambda s: abs(np.log(s / max(wanted, 1e-6))))


def _multiples(low: float, high: float, step: float) -> list[float]:
    first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
    return [i * step for i in range(first, min(last, first + 200) + 1) if abs(i * step) <= 720.0]


def _line(kind: str, value: float, step: float, ra: Floats | float, dec: Floats | float) -> GridLine:
    """One line whose ``xy`` are still (RA, Dec) or (azimuth, altitude), degrees."""
    return GridLine(kind, value, step, np.stack(np.broadcast_arrays(ra, dec), axis=-1))


def _projected(
    solution: Solution, lines: list[GridLine], middle: Floats, near: float, horizon: SiteSky | None
) -> list[GridLine]:
    """The lines in image px, all at once: a live camera wants them several times a second."""
    if not lines:
        return []
    ra, dec = np.concatenate([line.xy for line in lines]).T
    vectors = unit_vectors(ra, dec)
    if horizon is not None:
        vectors = horizon.catalogue(vectors[:, NORTH_EAST_UP])
    xy = solution.pixels_of(vectors)
    # A distortion polynomial folds far outside the frame; a wide lens shows what is beside it almost anywhere.
    xy[(vectors @ middle < near) | ~(np.abs(xy) < FAR_PX).all(axis=1)] = np.nan
    ends = np.cumsum([len(line.xy) for line in lines])[:-1]
    return [replace(line, xy=part) for line, part in zip(lines, np.split(xy, ends), strict=True)]


def pieces(xy: Floats) -> list[Floats]:
    """The parts in sight of a line (N, 2), each of two places or more."""
    ends = np.flatnonzero(np.diff(np.isfinite(xy[:, 0]), prepend=False, append=False))
    return [xy[first:last] for first, last in zip(ends[::2], ends[1::2], strict=True) if last - first > 1]
