"""The night's alignment: its history, its plots, and a report to keep or print."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, field
from datetime import datetime
from html import escape
from math import degrees, log10
from pathlib import Path
from typing import Any

from kochab.core.errors import KochabError
from kochab.core.frame import Site
from kochab.core.values import frozen, mutable
from kochab.frames.atomic_file import write_atomically
from kochab.polar.drift import Drift
from kochab.polar.error import PolarError, angle_in_words
from kochab.polar.measure import Measurement
from kochab.polar.pole import Pole
from kochab.text.angle_text import round_angle_text
from kochab.text.translation import number, tr

SPARSE_S = 2.0  # live errors are kept this far apart


@frozen
class Entry:
    """One moment: ``kind`` is "measured", "live" or "instruction"; angles in arcsec.

    ``sigma_arcsec`` (altitude, azimuth on the sky), ``sigma_total_arcsec`` and ``ellipse_arcsec``
    (long, short, angle in radians from azimuth to altitude; 68 %) include flexure; ``noise_arcsec``
    is the frames' share in the total's sigma, ``flexure_arcsec`` that of flexure.
    """

    time_utc: datetime
    kind: str
    altitude_arcsec: float
    azimuth_arcsec: float
    azimuth_on_sky_arcsec: float
    total_arcsec: float
    sigma_arcsec: tuple[float, float]
    ellipse_arcsec: tuple[float, float, float]
    text: str = ""
    sigma_total_arcsec: float = 0.0
    noise_arcsec: float = 0.0
    flexure_arcsec: float = 0.0

    @classmethod
    def of(cls, time_utc: datetime, kind: str, error: PolarError, text: str = "") -> "Entry":
        """What an error says at a moment.

        Parameters
        ----------
        time_utc : datetime
            The moment.
        kind : str
            ``measured``, ``live`` or ``instruction``.
        error : PolarError
            The polar error then.
        text : str
            What the person is told of it.
        """
        whole = error.with_systematics
        place = (error.altitude_arcsec, error.azimuth_arcsec, error.azimuth_on_sky_arcsec, error.total_arcsec)
        of_total = (whole.sigma_total_arcsec, error.sigma_total_arcsec, error.flexure_along_arcsec)
        return cls(time_utc, kind, *place, whole.sigma_arcsec, whole.ellipse_arcsec(), text, *of_total)


@mutable
class History:
    """Grows while one alignment lasts."""

    site: Site | None = None
    pole: Pole = Pole.REFRACTED
    entries: list[Entry] = field(default_factory=list)

    def measured(self, measurement: Measurement | Drift) -> None:
        """Keep a measurement, with its findings."""
        self.site, self.pole = measurement.settings.site, measurement.settings.pole
        text = " ".join(finding.text for finding in measurement.findings)
        self.entries.append(Entry.of(measurement.time_utc, "measured", measurement.error, text))

    def live(self, time_utc: datetime, error: PolarError) -> None:
        """Keep an error seen while adjusting, when the last one kept is old enough."""
        last = next((e for e in reversed(self.entries) if e.kind == "live"), None)
        if last is None or abs((time_utc - last.time_utc).total_seconds()) >= SPARSE_S:
            self.entries.append(Entry.of(time_utc, "live", error))

    def instruction(self, time_utc: datetime, error: PolarError, text: str) -> None:
        """Keep an instruction."""
        self.entries.append(Entry.of(time_utc, "instruction", error, text))

    def as_json(self) -> str:
        """All of it, to be kept or compared."""
        whole: dict[str, Any] = {
            "site": None if self.site is None else asdict(self.site),
            "pole": str(self.pole),
            "entries": [asdict(entry) | {"time_utc": entry.time_utc.isoformat()} for entry in self.entries],
        }
        return json.dumps(whole, indent=1)


# -- Drawings as SVG: the error over time, and the ellipses shrinking to the pole ---------------

WIDTH, HEIGHT, MARGIN = 640.0, 280.0, 48.0
RINGS_ARCSEC = (30.0, 60.0, 300.0, 1800.0, 7200.0, 36000.0)
FLOOR_ARCSEC = 1.0  # the lowest of a logarithmic scale
PANEL = 320.0


def error_over_time(entries: Sequence[Entry]) -> str:
    """Total error, logarithmic, with one-sigma bars for measurements, over minutes."""
    shown = [e for e in entries if e.kind != "instruction"]
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
    line = " ".join("{:.1f},{:.1f}".format(*place(m, t)) for m, t in zip(minutes, totals, strict=True))
    parts.append(f'<polyline class="line" points="{line}"/>')
    for entry, minute in zip(shown, minutes, strict=True):
        if entry.kind != "measured":
            continue
        x, y = place(minute, entry.total_arcsec)
        sigma = entry.sigma_total_arcsec
        top, bottom = (place(minute, entry.total_arcsec + s * sigma)[1] for s in (1.0, -1.0))
        parts.append(f'<line class="bar" x1="{x:.1f}" x2="{x:.1f}" y1="{top:.1f}" y2="{bottom:.1f}"/>')
        parts.append(f'<circle class="dot" cx="{x:.1f}" cy="{y:.1f}" r="5"/>')
    return _svg(WIDTH, HEIGHT, parts, tr("Error from the pole over time"))


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
    return _svg(PANEL * len(panels), PANEL, panels, tr("Measured axes around the pole"))


def _around_pole(measured: Sequence[Entry], reach_arcsec: float, left: float) -> str:
    """One panel: rings, pole, numbered ellipses; altitude up, clockwise azimuth to the right."""
    half = PANEL / 2.0
    scale = half / reach_arcsec
    parts = [f'<g transform="translate({left + half:.0f},{half:.0f})">']
    for ring in RINGS_ARCSEC:
        if 14.0 < ring * scale < half:
            parts.append(f'<circle class="ring" r="{ring * scale:.2f}"/>')
            parts.append(f'<text x="3" y="{-ring * scale - 3:.1f}">{round_angle_text(ring)}</text>')
    parts.append('<path class="bar" d="M-6,0H6M0,-6V6"/>')
    for at, entry in enumerate(measured, 1):
        long, short, angle = entry.ellipse_arcsec
        x, y = entry.azimuth_on_sky_arcsec * scale, -entry.altitude_arcsec * scale
        if abs(x) > half or abs(y) > half:
            continue
        parts.append(
            f'<ellipse class="ellipse" rx="{max(long * scale, 1.5):.2f}"'
            f' ry="{max(short * scale, 1.5):.2f}"'
            # SVG counts clockwise, for its y runs down
            f' transform="translate({x:.2f},{y:.2f}) rotate({-degrees(angle):.2f})"/>'
        )
        parts.append(f'<text x="{x + 6:.1f}" y="{y - 6:.1f}">{at}</text>')
    return "".join([*parts, "</g>"])


def _grid(place: Callable[[float, float], tuple[float, float]], across: float, most: float) -> str:
    parts = []
    for arcsec in (1.0, 10.0, 30.0, 60.0, 300.0, 1800.0, 7200.0, 36000.0):
        if arcsec > most:
            break
        x0, y = place(0.0, arcsec)
        x1, _ = place(across, arcsec)
        parts.append(f'<line class="ring" x1="{x0:.0f}" x2="{x1:.0f}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text x="4" y="{y + 4:.1f}">{round_angle_text(arcsec)}</text>')
    x1, _ = place(across, 1.0)
    parts.append(f'<text x="{x1 - 30:.0f}" y="{HEIGHT - 14:.0f}">{across:.0f} min</text>')
    return "".join(parts)


# Opacities stand apart: Qt, which draws the PDF, takes a colour such as #2255aa22 for black.
DRAWN = """
.line{fill:none;stroke:#2255aa;stroke-width:1.5}.dot{fill:#2255aa}.bar{stroke:#b34700;
stroke-width:2;fill:none}.ring{fill:none;stroke:#bbb}.ellipse{fill:#2255aa;fill-opacity:.13;stroke:#2255aa}
text{font:12px system-ui,sans-serif;fill:#333}
"""


def _svg(width: float, height: float, parts: Sequence[str], title: str) -> str:
    return (
        f'<svg viewBox="0 0 {width:.0f} {height:.0f}" role="img" aria-label="{escape(title)}"'
        f' width="{width:.0f}"><style>{DRAWN}</style>{"".join(parts)}</svg>'
    )


STYLE = """
body{font:16px/1.5 system-ui,sans-serif;max-width:44rem;margin:2rem auto;padding:0 1rem;
color:#111;background:#fff}h1{font-size:1.5rem}table{border-collapse:collapse;width:100%}
td,th{border-bottom:1px solid #ccc;padding:.3rem .5rem;text-align:right;vertical-align:top}
td:last-child,th:last-child{text-align:left}.big{font-size:2.4rem}svg{max-width:100%;height:auto}
"""


def report_html(history: History) -> str:
    """The page as text."""
    measured = [e for e in history.entries if e.kind == "measured"]
    title, language = escape(tr("Polar alignment")), escape(tr("en", "the language's code, as a web page gives it"))
    parts = [f"<h1>{title}</h1>", _summary(history, measured)]
    for head, shown in (
        (tr("Error over time"), error_over_time(history.entries)),
        (tr("Axis and its 68 % ellipse"), ellipses(history.entries)),
        (tr("Log"), _table(history)),
    ):
        parts += [f"<h2>{escape(head)}</h2>", shown]
    return (
        f"<!doctype html><html lang='{language}'><meta charset='utf-8'>"
        f"<meta name='viewport' content='width=device-width'><title>{title}</title>"
        f"<style>{STYLE}</style><body>{''.join(parts)}</body></html>\n"
    )


def write_report(path: str | Path, history: History) -> None:
    """Write the page, and beside it the same numbers as JSON.

    Raises `KochabError` when the files cannot be written; one sentence.
    """
    page = Path(path)
    try:
        write_atomically(page, report_html(history))
        write_atomically(page.with_suffix(".json"), history.as_json())
    except OSError as error:
        raise KochabError(
            "Can't write the report {path}: {strerror}.", path=path, strerror=error.strerror or type(error).__name__
        ) from None


def _summary(history: History, measured: list[Entry]) -> str:
    if not measured:
        return "<p>" + escape(tr("No measurement.")) + "</p>"
    first, last, site = measured[0], measured[-1], history.site
    when = f"{last.time_utc:%Y-%m-%d %H:%M}"
    sentences = [tr("From the {pole} pole, {time} UTC.", pole=tr(str(history.pole)), time=when)]
    if first is not last:
        sentences.append(tr("At first {angle}.", angle=angle_in_words(first.total_arcsec)))
    if site is not None:
        place = (number(site.latitude_deg, ".3f"), number(site.longitude_deg, ".3f"))
        sentences.append(tr("Latitude {latitude}°, longitude {longitude}°.", latitude=place[0], longitude=place[1]))
    noise, flexure = angle_in_words(last.noise_arcsec), angle_in_words(last.flexure_arcsec)
    share = tr("Uncertainty: {noise} measurement, {flexure} possible flexure.", noise=noise, flexure=flexure)
    return (
        f"<p class='big'>{_words(last.total_arcsec)} &plusmn; {_words(last.sigma_total_arcsec)}</p>"
        f"<p>{escape(' '.join(sentences))}</p><p>{escape(share)}</p>"
    )


def _table(history: History) -> str:
    rows = []
    for entry in history.entries:
        if entry.kind == "live":
            continue
        cells = [
            f"{entry.time_utc:%H:%M:%S}",
            _words(entry.total_arcsec),
            _signed(entry.altitude_arcsec, entry.sigma_arcsec[0]),
            _signed(entry.azimuth_on_sky_arcsec, entry.sigma_arcsec[1]),
            escape(" ".join((tr("Measured."), entry.text)) if entry.kind == "measured" else entry.text),
        ]
        rows.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    heads = ("UTC", tr("Total"), tr("Altitude"), tr("Azimuth on the sky"), "")
    top = "".join(f"<th>{escape(head)}</th>" for head in heads)
    return f"<table><tr>{top}</tr>{''.join(rows)}</table>"


def _signed(arcsec: float, sigma_arcsec: float) -> str:
    return f"{arcsec:+.0f}&Prime; &plusmn; {sigma_arcsec:.0f}"


def _words(arcsec: float) -> str:
    return escape(angle_in_words(arcsec))
