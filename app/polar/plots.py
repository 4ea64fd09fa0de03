"""Drawings of an alignment as SVG: the error over time, and the ellipses shrinking to the pole."""

from collections.abc import Sequence
from math import degrees, log10

from app.polar.history import Entry

WIDTH, HEIGHT, MARGIN = 640.0, 280.0, 48.0
RINGS_ARCSEC = (30.0, 60.0, 300.0, 1800.0, 7200.0, 36000.0)
FLOOR_ARCSEC = 1.0
PANEL = 320.0


def error_over_time(entries: Sequence[Entry]) -> str:
    """Total error, logarithmic, with one-sigma bars for measurements; minutes from the first."""
    shown = [e for e in entries if e.kind != "told"]
    if not shown:
        return ""
    start = shown[0].time_utc
    minutes = [(e.time_utc - start).total_seconds() / 60.0 for e in shown]
    across = max(*minutes, 1.0) if len(minutes) > 1 else 1.0
    totals = [max(e.total_arcsec, FLOOR_ARCSEC) for e in shown]
    low, high = 0.0, max(log10(max(totals)) + 0.1, 2.0)

    def place(minute: float, arcsec: float) -> tuple[float, float]:
        x = MARGIN + (WIDTH - 2 * MARGIN) * minute / across
        share = (log10(max(arcsec, FLOOR_ARCSEC)) - low) / (high - low)
        return x, HEIGHT - MARGIN - (HEIGHT - 2 * MARGIN) * share

    parts = [_grid(place, across, 10.0**high)]
    line = " ".join(
        "{:.1f},{:.1f}".format(*place(m, t)) for m, t in zip(minutes, totals, strict=True)
    )
    parts.append(f'<polyline class="line" points="{line}"/>')
    for entry, minute in zip(shown, minutes, strict=True):
        if entry.kind != "measured":
            continue
        x, y = place(minute, entry.total_arcsec)
        sigma = entry.sigma_total_arcsec
        top, bottom = (place(minute, entry.total_arcsec + s * sigma)[1] for s in (1.0, -1.0))
        parts.append(
            f'<line class="bar" x1="{x:.1f}" x2="{x:.1f}" y1="{top:.1f}" y2="{bottom:.1f}"/>'
        )
        parts.append(f'<circle class="dot" cx="{x:.1f}" cy="{y:.1f}" r="5"/>')
    return _svg(WIDTH, HEIGHT, parts, "Error from the pole over time")


def ellipses(entries: Sequence[Entry]) -> str:
    """The measured axes around the pole, 68 % ellipses: all of them, and the last one close by."""
    measured = [e for e in entries if e.kind == "measured"]
    if not measured:
        return ""
    last = measured[-1]
    widest = max(e.total_arcsec + e.ellipse_arcsec[0] for e in measured)
    closest = max(last.total_arcsec + last.ellipse_arcsec[0], RINGS_ARCSEC[0]) * 1.15
    panels = [_around_pole(measured, max(widest * 1.1, closest), 0.0)]
    if widest > 2.0 * closest:
        panels.append(_around_pole(measured, closest, PANEL))
    return _svg(PANEL * len(panels), PANEL, panels, "Measured axes around the pole")


def _around_pole(measured: Sequence[Entry], reach_arcsec: float, left: float) -> str:
    """One panel: rings, pole, numbered ellipses; altitude up, clockwise azimuth to the right."""
    half = PANEL / 2.0
    scale = half / reach_arcsec
    parts = [f'<g transform="translate({left + half:.0f},{half:.0f})">']
    for ring in RINGS_ARCSEC:
        if 14.0 < ring * scale < half:
            parts.append(f'<circle class="ring" r="{ring * scale:.2f}"/>')
            parts.append(f'<text x="3" y="{-ring * scale - 3:.1f}">{_short(ring)}</text>')
    parts.append('<path class="bar" d="M-6,0H6M0,-6V6"/>')
    for number, entry in enumerate(measured, 1):
        long, short, angle = entry.ellipse_arcsec
        x, y = entry.azimuth_on_sky_arcsec * scale, -entry.altitude_arcsec * scale
        if abs(x) > half or abs(y) > half:
            continue
        parts.append(
            f'<ellipse class="ellipse" rx="{max(long * scale, 1.5):.2f}"'
            f' ry="{max(short * scale, 1.5):.2f}"'
            f' transform="translate({x:.2f},{y:.2f}) rotate({-degrees(angle):.2f})"/>'
        )
        parts.append(f'<text x="{x + 6:.1f}" y="{y - 6:.1f}">{number}</text>')
    return "".join([*parts, "</g>"])


def _grid(place: object, across: float, most: float) -> str:
    assert callable(place)
    parts = []
    for arcsec in (1.0, 10.0, 30.0, 60.0, 300.0, 1800.0, 7200.0, 36000.0):
        if arcsec > most:
            break
        x0, y = place(0.0, arcsec)
        x1, _ = place(across, arcsec)
        parts.append(f'<line class="ring" x1="{x0:.0f}" x2="{x1:.0f}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text x="4" y="{y + 4:.1f}">{_short(arcsec)}</text>')
    x1, _ = place(across, 1.0)
    parts.append(f'<text x="{x1 - 30:.0f}" y="{HEIGHT - 14:.0f}">{across:.0f} min</text>')
    return "".join(parts)


def _short(arcsec: float) -> str:
    if arcsec < 60.0:
        return f"{arcsec:.0f}″"
    return f"{arcsec / 60.0:.0f}′" if arcsec < 3600.0 else f"{arcsec / 3600.0:.0f}°"


def _svg(width: float, height: float, parts: Sequence[str], title: str) -> str:
    return (
        f'<svg viewBox="0 0 {width:.0f} {height:.0f}" role="img" aria-label="{title}"'
        f' width="{width:.0f}">{"".join(parts)}</svg>'
    )
