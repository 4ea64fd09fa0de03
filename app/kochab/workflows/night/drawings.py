"""The drawings of the page, as SVG: the night's timeline and the map of sharpness. The page's style has the colours."""

import math
from collections.abc import Sequence
from datetime import datetime, timedelta
from itertools import groupby, pairwise
from operator import itemgetter

import numpy as np

from kochab.core.arrays import Floats
from kochab.text.translation import number, tr
from kochab.workflows.night.measure import Measure
from kochab.workflows.night.sharpness import FieldOfSharpness
from kochab.workflows.night.summary import Night

WIDTH, LEFT, RIGHT = 920, 64, 14
STRIP, GAP, TOP = 104, 34, 22
LEAST_RANGE = {"lost": 0.5, "star": 0.1}
"""How much a strip spans at least, 1 if nothing is said."""
TWILIGHT_DEG = (("day", -0.8), ("civil", -6.0), ("nautical", -12.0), ("astronomical", -18.0))
"""Altitude of the Sun above which each shade applies."""


def timeline(night: Night) -> str:
    """Light lost, sky, FWHM, altitudes of field and Moon over the night; over frame numbers where times are unknown."""
    timed = all(frame.time_utc for frame in night.frames)
    at = _hours(night) if timed else np.arange(len(night.frames), dtype=float)
    span = (float(at[0]), float(at[-1])) if at[-1] > at[0] else (float(at[0]) - 0.5, float(at[0]) + 0.5)
    strips = []
    if any(night.lost):
        strips.append((tr("Light lost (mag)"), "lost", [*night.lost], True))
    if any(night.brightness):
        strips.append((tr("Sky (mag/arcsec²)"), "sky", [*night.brightness], False))
    for curve in night.light_curves:
        by_file = {point.file: point.mag for point in curve.points}
        strips.append((tr("{star} (V)", star=curve.name), "star", [by_file.get(f.file) for f in night.frames], True))
    if night.fwhm:
        widths = [f.sharp.fwhm_px if f.sharp else None for f in night.frames]
        strips.append((tr("FWHM (px)"), "fwhm", widths, False))
    parts = [_strip(k, title, kind, values, at, span, down) for k, (title, kind, values, down) in enumerate(strips)]
    rows = len(strips)
    if timed and any(frame.sky for frame in night.frames):
        parts.append(_altitudes(rows, night, at, span))
        rows += 1
    if not rows:
        return ""
    height = rows * (STRIP + GAP) + TOP
    if timed:
        first = night.frames[0].time_utc
        assert first is not None
        for event in night.events:
            x = _x((event.time_utc - first).total_seconds() / 3600.0, span)
            height_px = rows * (STRIP + GAP) - GAP + TOP
            parts.append(f'<line class="event" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{height_px}"/>')
    parts.append(_times(night.frames[0].time_utc if timed else None, span, height - GAP + 4))
    title = tr("The night over time")
    return f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{title}">{"".join(parts)}</svg>'


def _hours(night: Night) -> Floats:
    first = night.frames[0].time_utc
    assert first is not None
    return np.array([(f.time_utc - first).total_seconds() / 3600.0 for f in night.frames if f.time_utc])


def _x(at: float, span: tuple[float, float]) -> float:
    return LEFT + (WIDTH - LEFT - RIGHT) * (at - span[0]) / (span[1] - span[0])


def _strip(
    row: int, title: str, kind: str, values: Sequence[Measure | None], at: Floats, span: tuple[float, float], down: bool
) -> str:
    """One measure over time, each frame with the bar of its uncertainty.

    Parameters
    ----------
    row : int
        The strip's place from the top.
    title : str
        Name and unit.
    kind : str
        The class that gives its colour.
    values : sequence of Measure or None
        One a frame.
    at : Floats
        When (N,), in the unit of ``span``.
    span : tuple of float
        The first and the last moment drawn.
    down : bool
        Whether more is worse and is drawn downwards.
    """
    numbers = np.array([one.value for one in values if one])
    low, high = _range(numbers, LEAST_RANGE.get(kind, 1.0))
    top = TOP + row * (STRIP + GAP)

    def y(value: float) -> float:
        share = min(max((value - low) / (high - low), -0.02), 1.02)
        return top + STRIP * (share if down else 1.0 - share)

    marks = [_frame_of(top, title)]
    for value in _ticks(low, high):
        marks.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(value):.1f}" y2="{y(value):.1f}"/>')
        marks.append(f'<text class="tick" x="{LEFT - 8}" y="{y(value) + 4:.1f}">{number(value, "g")}</text>')
    for t, one in zip(at, values, strict=True):
        x = _x(float(t), span)
        if one is None:  # no number of this frame: a mark at the foot
            marks.append(f'<line class="gone" x1="{x:.1f}" x2="{x:.1f}" y1="{top + STRIP - 7}" y2="{top + STRIP}"/>')
            continue
        bar = y(one.value - one.sigma), y(one.value + one.sigma)
        marks.append(f'<line class="bar {kind}" x1="{x:.1f}" x2="{x:.1f}" y1="{bar[0]:.1f}" y2="{bar[1]:.1f}"/>')
        marks.append(f'<circle class="{kind}" cx="{x:.1f}" cy="{y(one.value):.1f}" r="2.6"/>')
    return "".join(marks)


def _altitudes(row: int, night: Night, at: Floats, span: tuple[float, float]) -> str:
    """Field and Moon from the horizon to the zenith, over the shades of twilight."""
    top = TOP + row * (STRIP + GAP)
    seen = [(float(t), frame.sky) for t, frame in zip(at, night.frames, strict=True) if frame.sky]
    marks = []
    edges = [span[0], *((a[0] + b[0]) / 2.0 for a, b in pairwise(seen)), span[1]]
    shades = [next((name for name, above in TWILIGHT_DEG if sky.sun_altitude_deg > above), "dark") for _, sky in seen]
    # one of each shade, for a seam shows between two
    for shade, alike in groupby(zip(shades, pairwise(edges), strict=True), key=itemgetter(0)):
        (_, (start, end)), *more = alike
        x0, x1 = _x(start, span), _x(more[-1][1][1] if more else end, span)
        marks.append(f'<rect class="{shade}" x="{x0:.1f}" y="{top}" width="{x1 - x0:.1f}" height="{STRIP}"/>')
    marks.append(_frame_of(top, tr("Altitude (°): field, Moon dashed")))
    for value in (0, 30, 60, 90):
        y = top + STRIP * (1.0 - value / 90.0)
        marks.append(f'<text class="tick" x="{LEFT - 8}" y="{y + 4:.1f}">{value}</text>')
    for kind, name in (("field", "altitude_deg"), ("moon", "moon_altitude_deg")):
        up = [(t, getattr(sky, name)) for t, sky in seen]
        points = " ".join(f"{_x(t, span):.1f},{top + STRIP * (1 - a / 90.0):.1f}" for t, a in up if a > 0)
        marks.append(f'<polyline class="{kind}" points="{points}"/>')
    return "".join(marks)


def _frame_of(top: float, title: str) -> str:
    box = f'<rect class="box" x="{LEFT}" y="{top}" width="{WIDTH - LEFT - RIGHT}" height="{STRIP}"/>'
    return f'{box}<text class="title" x="{LEFT}" y="{top - 7}">{title}</text>'


def _times(first: datetime | None, span: tuple[float, float], y: float) -> str:
    """Hours of UTC, or numbers of frames, below the strips."""
    if first is None:
        ticks = [(at, f"{at + 1:.0f}") for at in _ticks(*span) if at == int(at)]
        name = tr("frame")
    else:
        step = next((s for s in (1, 2, 5, 10, 15, 30, 60, 120, 180) if 60.0 * (span[1] - span[0]) / s <= 8), 240)
        day = first.replace(hour=0, minute=0, second=0, microsecond=0)
        begun = (first - day).total_seconds() / 60.0
        minutes = np.arange(math.ceil((begun + 60 * span[0]) / step) * step, begun + 60.0 * span[1] + 1e-6, step)
        ticks = [((m - begun) / 60.0, f"{day + timedelta(minutes=float(m)):%H:%M}") for m in minutes]
        name = "UTC"
    words = [
        f'<text class="time" x="{_x(at, span):.1f}" y="{y + 12}">{text}</text>'
        for at, text in ticks
        if _x(at, span) > LEFT + 20
    ]
    return "".join([*words, f'<text class="tick" x="{LEFT - 8}" y="{y + 12}">{name}</text>'])


def _range(values: Floats, least: float) -> tuple[float, float]:
    """What a strip shows: all but lone extremes, at least so much."""
    low, high = (float(one) for one in np.percentile(values, [1, 99]))
    spare = max(0.12 * (high - low), (least - (high - low)) / 2.0)
    return low - spare, high + spare


def _ticks(low: float, high: float) -> list[float]:
    """Three to six round numbers."""
    step = 10.0 ** math.floor(math.log10((high - low) / 2.0))
    step *= next(k for k in (1, 2, 5, 10) if (high - low) / (step * k) <= 5)
    return [round(k * step, 6) + 0.0 for k in range(math.ceil(low / step), math.floor(high / step) + 1)]


def sharpness_map(shape: FieldOfSharpness, size: tuple[int, int]) -> str:
    """FWHM over the frame, as the frame is recorded: softer is darker, the corners and the middle in numbers."""
    width, height = 360.0, 360.0 * size[1] / size[0]
    columns, rows = 24, max(2, round(24 * size[1] / size[0]))
    u = (np.arange(columns) + 0.5) / columns * 2.0 - 1.0
    v = (np.arange(rows) + 0.5) / rows * 2.0 - 1.0
    wide = np.array([[shape.at(a * shape.corner[0], b * shape.corner[1]).value for a in u] for b in v])
    # A difference of a third of the FWHM is the full shade, so that an even field looks even.
    share = 0.65 * np.clip((wide - wide.min()) / (0.33 * np.median(wide)), 0.0, 1.0)
    cells = [
        f'<rect class="soft" style="opacity:{share[r, c]:.2f}" x="{c * width / columns:.2f}"'
        f' y="{r * height / rows:.2f}" width="{width / columns:.2f}" height="{height / rows:.2f}"/>'
        for r in range(rows)
        for c in range(columns)
    ]
    places = [(10.0, 24.0, "start"), (width - 10.0, 24.0, "end")]
    places += [(10.0, height - 12.0, "start"), (width - 10.0, height - 12.0, "end")]
    words = [
        f'<text class="value" x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}">{one.text()}</text>'
        for (x, y, anchor), one in zip(places, shape.corners.values(), strict=True)
    ]
    at = f'x="{width / 2:.0f}" y="{height / 2 + 5:.0f}" text-anchor="middle"'
    middle = f'<text class="value" {at}>{shape.at(0, 0).text()}</text>'
    box = f'<rect class="box" x="0" y="0" width="{width:.0f}" height="{height:.0f}"/>'
    label = tr("FWHM over the frame")
    return (
        f'<svg class="map" viewBox="0 0 {width:.0f} {height:.0f}" role="img" aria-label="{label}">'
        f"{''.join(cells)}{box}{''.join(words)}{middle}</svg>"
    )
