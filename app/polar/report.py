"""The report of an alignment: one page that needs nothing else, to be kept or printed."""

from html import escape
from pathlib import Path

from app.core.errors import KochabError
from app.frames.whole_file import write_whole
from app.polar.history import Entry, History
from app.polar.plots import ellipses, error_over_time
from app.polar.words import angle_in_words

STYLE = """
body{font:16px/1.5 system-ui,sans-serif;max-width:44rem;margin:2rem auto;padding:0 1rem;
color:#111;background:#fff}h1{font-size:1.5rem}table{border-collapse:collapse;width:100%}
td,th{border-bottom:1px solid #ccc;padding:.3rem .5rem;text-align:right;vertical-align:top}
td:last-child,th:last-child{text-align:left}.big{font-size:2.4rem}svg{max-width:100%;height:auto}
.line{fill:none;stroke:#2255aa;stroke-width:1.5}.dot{fill:#2255aa}.bar{stroke:#b34700;
stroke-width:2;fill:none}.ring{fill:none;stroke:#bbb}.ellipse{fill:#2255aa22;stroke:#2255aa}
svg text{font:12px system-ui,sans-serif;fill:#333}
"""


def report_html(history: History) -> str:
    """The page as text."""
    measured = [e for e in history.entries if e.kind == "measured"]
    parts = ["<h1>Polar alignment</h1>", _summary(history, measured)]
    parts += ["<h2>Error over time</h2>", error_over_time(history.entries)]
    parts += ["<h2>Axis and its 68&nbsp;% ellipse</h2>", ellipses(history.entries)]
    parts += ["<h2>What happened</h2>", _table(history)]
    return (
        "<!doctype html><html lang='en'><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width'><title>Polar alignment</title>"
        f"<style>{STYLE}</style><body>{''.join(parts)}</body></html>\n"
    )


def write_report(path: str | Path, history: History) -> None:
    """Write the page, and beside it the same numbers as JSON.

    Raises
    ------
    KochabError
        The files cannot be written; one sentence.

    """
    page = Path(path)
    try:
        write_whole(page, report_html(history))
        write_whole(page.with_suffix(".json"), history.as_json())
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise KochabError(f"The report {path} cannot be written: {reason}.") from None


def _summary(history: History, measured: list[Entry]) -> str:
    if not measured:
        return "<p>Nothing was measured.</p>"
    first, last = measured[0], measured[-1]
    site = history.site
    where = ""
    if site is not None:
        where = (
            f" at latitude {site.latitude_deg:.3f}&deg;, longitude {site.longitude_deg:.3f}&deg;"
        )
    change = "" if first is last else f", from {_words(first.total_arcsec)} at first"
    return (
        f"<p class='big'>{_words(last.total_arcsec)} &plusmn; {_words(last.sigma_total_arcsec)}</p>"
        f"<p>from the {escape(str(history.pole))} pole{change}; {last.time_utc:%Y-%m-%d %H:%M} UTC"
        f"{where}.</p>"
        f"<p>Of the &plusmn;, {_words(last.noise_arcsec)} is the frames' noise and"
        f" {_words(last.unseen_arcsec)} bending that they cannot show.</p>"
    )


def _table(history: History) -> str:
    rows = []
    for entry in history.entries:
        if entry.kind == "live":
            continue
        cells = [
            f"{entry.time_utc:%H:%M:%S}",
            _words(entry.total_arcsec),
            f"{entry.altitude_arcsec:+.0f}&Prime; &plusmn; {entry.sigma_arcsec[0]:.0f}",
            f"{entry.azimuth_on_sky_arcsec:+.0f}&Prime; &plusmn; {entry.sigma_arcsec[1]:.0f}",
            escape(f"Measured. {entry.text}" if entry.kind == "measured" else entry.text),
        ]
        rows.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    heads = ("UTC", "Total", "Altitude", "Azimuth on the sky", "")
    top = "".join(f"<th>{head}</th>" for head in heads)
    return f"<table><tr>{top}</tr>{''.join(rows)}</table>"


def _words(arcsec: float) -> str:
    return escape(angle_in_words(arcsec))
