"""The page of a night: HTML that needs no network and prints on two sheets."""

from base64 import b64encode
from collections import Counter
from collections.abc import Sequence
from html import escape
from pathlib import Path

from kochab.text.angle_text import AngleStyle, angle_text, false_alarm_text, radec_text
from kochab.text.duration_text import duration_text
from kochab.text.translation import number, tr, tr_n
from kochab.workflows.night.backlash import words_of
from kochab.workflows.night.drawings import sharpness_map, timeline
from kochab.workflows.night.earlier import QUANTITIES, Compared
from kochab.workflows.night.guiding import Guiding
from kochab.workflows.night.measure import Measure
from kochab.workflows.night.summary import CLOUD_MAG, NO_TILT, SHOWN, Night, advice_of
from kochab.workflows.night.tracking import Tracking

STYLE = """
:root { --ink: #1c2430; --soft: #5c6877; --line: #d6dce3; --paper: #fff; --tile: #f5f7f9; --accent: #1f5fa8;
 --lost: #1f5fa8; --sky: #2b6e54; --fwhm: #9a5b13; --field: #1c2430; --moon: #b58a1b; --blur: #9a5b13;
 --night: #eceff4; }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e9ef; --soft: #9aa6b4; --line: #36404d; --paper: #12171e;
 --tile: #1a212a; --accent: #7fb2ec; --lost: #7fb2ec; --sky: #7cc7a6; --fwhm: #e0a45c; --field: #e4e9ef;
 --moon: #e7c35a; --blur: #e0a45c; --night: #0b0f15; } }
@media print { :root { --ink: #000; --soft: #444; --line: #bbb; --paper: #fff; --tile: #f5f5f5; --accent: #1f5fa8;
 --lost: #1f5fa8; --sky: #2b6e54; --fwhm: #9a5b13; --field: #000; --moon: #b58a1b; --blur: #9a5b13;
 --night: #eceff4; }
 section, figure, .tile { break-inside: avoid; }
 body { font-size: 13px !important; padding: 0 !important; } h2 { margin: 20px 0 8px !important; }
 .beside { grid-template-columns: 240px 1fr !important; } }
* { box-sizing: border-box; }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); margin: 0 auto;
 padding: 32px 24px 48px; max-width: 968px; }
h1 { font-size: 28px; font-weight: 600; margin: 0; } h2 { font-size: 18px; font-weight: 600; margin: 40px 0 12px; }
p { margin: 0 0 8px; } .sub, .note, figcaption, th { color: var(--soft); }
.advice { font-size: 19px; border-left: 4px solid var(--accent); padding: 6px 0 6px 16px; margin: 24px 0; }
.stopped { background: var(--tile); border: 1px solid var(--line); border-radius: 6px; padding: 8px 14px; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(176px, 1fr)); gap: 12px; }
.tile { background: var(--tile); border-radius: 8px; padding: 12px 14px; }
.tile b { display: block; font-size: 19px; font-weight: 600; white-space: nowrap; }
.tile span { color: var(--soft); font-size: 14px; display: block; }
svg { width: 100%; height: auto; display: block; } svg.map { max-width: 420px; }
svg text { font: 13px system-ui, sans-serif; fill: var(--soft); } svg text.value { fill: var(--ink); }
svg .tick { text-anchor: end; } svg .time { text-anchor: middle; }
.box { fill: none; stroke: var(--line); } .grid { stroke: var(--line); stroke-dasharray: 2 4; }
.lost { fill: var(--lost); stroke: var(--lost); } .fwhm { fill: var(--fwhm); stroke: var(--fwhm); }
.sky, .star { fill: var(--sky); stroke: var(--sky); }
.bar { opacity: .5; } circle { stroke: none; } .gone { stroke: #c0392b; stroke-width: 2; }
polyline { fill: none; stroke-width: 2; }
polyline.field { stroke: var(--field); } polyline.moon { stroke: var(--moon); stroke-dasharray: 6 4; }
.soft { fill: var(--blur); shape-rendering: crispEdges; } .dark { fill: var(--night); }
.astronomical { fill: #7d8fb0; opacity: .3; } .nautical { fill: #7d9fd0; opacity: .45; }
.dark, .astronomical, .nautical, .civil, .day { shape-rendering: crispEdges; }
.civil { fill: #9cc0ee; opacity: .6; } .day { fill: #cfe3fb; opacity: .8; }
table { border-collapse: collapse; width: 100%; } th { text-align: left; font-weight: 500; }
td, th { padding: 6px 12px 6px 0; border-bottom: 1px solid var(--line); font-variant-numeric: tabular-nums; }
.wide { font-size: 14px; }
.other td { font-weight: 600; color: var(--accent); }
.event { stroke: #c0392b; stroke-dasharray: 3 3; } .events td:first-child { width: 96px; color: var(--soft); }
.frames { display: grid; grid-template-columns: repeat(3, 1fr); gap: 14px; } figure { margin: 0; }
figure img { width: 100%; border-radius: 6px; display: block; background: #000; }
figcaption { font-size: 14px; overflow-wrap: anywhere; padding-top: 4px; }
.beside { display: grid; grid-template-columns: minmax(0, 420px) 1fr; gap: 24px; align-items: start; }
@media (max-width: 640px) { .beside, .frames { grid-template-columns: 1fr; } }
"""


def night_page(night: Night, name: str, earlier: Sequence[Compared] = ()) -> str:
    """The page of a night whose frames lie in a folder of that name, beside earlier ones of the same equipment."""
    body = "\n".join(night_parts(night, name, earlier))
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(_title(night, name))}</title><style>{STYLE}</style></head>\n<body>\n{body}\n</body></html>\n"
    )


def night_parts(night: Night, name: str, earlier: Sequence[Compared] = (), columns: int = 0) -> list[str]:
    """The body of the page, part by part.

    Parameters
    ----------
    night : Night
        What was measured.
    name : str
        Of the folder.
    earlier : sequence of Compared
        Tonight beside earlier nights.
    columns : int
        Tiles and pictures stand in tables so many columns wide, for what knows no CSS grid; 0: in grids.
    """
    parts = [f"<h1>{escape(_title(night, name))}</h1>", f'<p class="sub">{escape(_under(night, name))}</p>']
    if len(night.frames) < night.asked:
        text = tr("Stopped early: {done} of {all} frames measured.", done=len(night.frames), all=night.asked)
        parts.append(f'<p class="stopped">{escape(text)}</p>')
    parts.append(f'<p class="advice">{escape(advice_of(night))}</p>')
    parts.append(_side_by_side("tiles", _tiles(night), columns))
    if earlier:
        parts.append(_earlier(earlier))
    if drawn := timeline(night):
        heading = tr("Through the night")
        parts.append(f"<section><h2>{escape(heading)}</h2>{drawn}</section>")
    if night.events:
        parts.append(_events(night))
    if night.crossings:
        parts.append(_crossings(night))
    if night.strangers:
        parts.append(_strangers(night))
    if night.shape and night.fwhm:
        parts.append(_field(night))
    if night.tracking:
        parts.append(_mount(night.tracking))
    if model := night.pointing.model:
        table = _table((tr("Pointing model"), tr("This night")), model.rows())
        words = "".join(f"<p>{escape(text)}</p>" for text in (model.worth(), night.pointing.flexure_words))
        parts.append(f"<section>{table}{words}</section>")
    if night.guiding:
        parts.append(_guiding(night.guiding))
    for heading, rows in ((tr("Best frames"), night.best), (tr("Worst frames"), night.worst)):
        if rows:
            shown = _side_by_side("frames", [_figure(night, k) for k in rows], min(columns, SHOWN))
            parts.append(f"<section><h2>{escape(heading)}</h2>{shown}</section>")
    notes = "".join(f'<p class="note">{escape(text)}</p>' for text in _notes(night))
    heading = tr("How to read this")
    parts.append(f"<section><h2>{escape(heading)}</h2>{notes}</section>")
    return [part.replace(" ± ", _whole(" ± ")) for part in parts]


def _whole(text: str) -> str:
    """The same, not to be broken over two lines."""
    return text.replace(" ", "\u00a0")


def _side_by_side(kind: str, cells: list[str], columns: int) -> str:
    """Cells in a grid of their class, or in a table so many columns wide."""
    if not columns:
        return f'<div class="{kind}">{"".join(cells)}</div>'
    # What knows no grid knows no blocks either.
    lines = [cell.replace("<b>", "<br><b>").replace("</b>", "</b><br>") for cell in cells]
    lines = [line.replace("<figcaption>", "<br><figcaption>") for line in lines]
    rows = [lines[k : k + columns] for k in range(0, len(lines), columns)]
    filled = [row + [""] * (columns - len(row)) for row in rows]
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in filled)
    return f'<table class="{kind}" width="100%" cellpadding="8">{body}</table>'


def _title(night: Night, name: str) -> str:
    first = next((frame.time_utc for frame in night.frames if frame.time_utc), None)
    return tr("Night of {date}", date=f"{first:%Y-%m-%d}") if first else tr("Frames of {name}", name=name)


def _under(night: Night, name: str) -> str:
    solved = len(night.frames) - len(night.unsolved)
    parts = [name, tr("{solved} of {total} frames solved", solved=solved, total=len(night.frames))]
    if night.hours:
        parts.append(duration_text(3600.0 * night.hours))
    parts += [camera for camera, _ in Counter(f.camera for f in night.frames if f.camera).most_common(1)]
    return " · ".join(parts)


def _tiles(night: Night) -> list[str]:
    tiles = []
    scales = sorted(f.scale_arcsec_px for f in night.frames if f.solved)
    if night.fwhm:
        if scales:
            scale = scales[len(scales) // 2]
            seconds = Measure(night.fwhm.value * scale, night.fwhm.sigma * scale)
            tiles.append(_tile("FWHM", f"{seconds.text()}″", f"{night.fwhm.text()} px"))
        else:
            tiles.append(_tile("FWHM", f"{night.fwhm.text()} px", ""))
    if night.elongation:
        tiles.append(_tile(tr("Elongation"), night.elongation.text(), tr("1 is round")))
    if night.focus and night.fwhm and night.focus.tells(night.fwhm.value):
        tiles.append(_tile(tr("Focus trend (px/h)"), night.focus.text("+"), tr("change of FWHM")))
    if night.tracking:
        most = max(night.tracking, key=lambda one: len(one.frames))
        if any(most.drifts):
            ra, dec = (one.text("+") if one else tr("unknown") for one in most.drifts)
            tiles.append(_tile(tr("Drift (″/h)"), f"{tr('RA')} {ra}", f"{tr('Dec')} {dec}"))
        else:
            short = tr("{time} is too short", time=duration_text(3600.0 * most.hours))
            tiles.append(_tile(tr("Drift (″/h)"), tr("unknown"), short))
        if worm := most.periodic:
            below = tr("amplitude; period {period} s", period=worm.period_s.text())
            tiles.append(_tile(tr("Periodic error"), f"{worm.amplitudes[0].text()}″", below))
    if night.polar:
        tiles.append(_tile(tr("Polar axis off by"), night.polar.words, night.polar.where))
    if sky := night.usual(night.brightness):
        tiles.append(_tile(tr("Sky (mag/arcsec²)"), sky.text(), tr("V, at the colour of a night sky")))
    if faintest := night.usual(night.faintest):
        tiles.append(_tile(tr("Limiting magnitude"), faintest.text(), tr("V, at a signal-to-noise ratio of 5")))
    if any(night.lost):
        text = tr("lost more than {mag} mag", mag=number(CLOUD_MAG, ".1f"))
        tiles.append(_tile(tr("Cloud"), tr_n("{n} frame", "{n} frames", len(night.clouded)), text))
    return tiles


def _tile(name: str, value: str, below: str) -> str:
    return f'<div class="tile"><span>{escape(name)}</span><b>{escape(value)}</b><span>{escape(below)}</span></div>'


def _earlier(compared: Sequence[Compared]) -> str:
    """Tonight among the last nights, a row each."""
    heads = (tr("Against earlier nights"), tr("This night"), tr("Usual"), tr("Nights"))
    rows = [(tr(QUANTITIES[one.name]), one.tonight.text(), one.usual.text(), str(one.nights)) for one in compared]
    return f"<section>{_table(heads, rows, marked=[one.unusual for one in compared])}</section>"


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]], kind: str = "", marked: Sequence[bool] = ()) -> str:
    """A table of plain text.

    Parameters
    ----------
    heads : sequence of str
        Of the columns.
    rows : sequence of sequences of str
        The cells.
    kind : str
        The table's class in the style sheet.
    marked : sequence of bool
        Which rows stand out; empty for none.
    """
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    marks = [" class='other'" if mark else "" for mark in marked] or [""] * len(rows)
    body = "".join(
        f"<tr{mark}>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>"
        for mark, row in zip(marks, rows, strict=True)
    )
    named = f' class="{kind}"' if kind else ""
    return f"<table{named}><tr>{head}</tr>{body}</table>"


def _events(night: Night) -> str:
    """What happened, a row each, with its time."""
    rows = (f"<tr><td>{one.time_utc:%H:%M:%S}</td><td>{escape(one.text)}</td></tr>" for one in night.events)
    heading = tr("What happened (UTC)")
    return f'<section><h2>{escape(heading)}</h2><table class="events">{"".join(rows)}</table></section>'


def _crossings(night: Night) -> str:
    """What left a streak: where it began and ended, a row each."""
    heads = (tr("Frame"), tr("What"), tr("From, to: RA, Dec (J2000)"), tr("Length"), tr("Beside its line"))
    rows = []
    for k, one in night.crossings:
        ends = " – ".join(radec_text(*place, AngleStyle.SEXAGESIMAL) for place in one.ends_deg)
        sure = f"± {number(one.sigma_arcsec, '.1f')}″"
        name = Path(night.frames[k].file).name
        rows.append((name, one.name or tr(one.kind), ends, angle_text(one.length_deg), sure))
    heading = tr("What crossed the field")
    return f"<section><h2>{escape(heading)}</h2>{_table(heads, rows, 'wide')}</section>"


def _strangers(night: Night) -> str:
    """Bodies, and what no catalogue has, a row each."""
    heads = (tr("What"), tr("V"), tr("RA, Dec (J2000), first seen"), tr("Moves (″/h)"), tr("Frames"), tr("Sure"))
    rows = []
    for one in night.strangers:
        place = radec_text(one.sights[0].ra_deg, one.sights[0].dec_deg, AngleStyle.SEXAGESIMAL)
        rates = ", ".join(rate.text("+") for rate in one.rate_arcsec_h) if one.rate_arcsec_h[0].sigma < 1e6 else "–"
        if one.off_arcsec:
            sure = tr("{off}″ from its elements", off=one.off_arcsec.text())
        else:
            sure = tr("by chance: {odds}", odds=false_alarm_text(one.log10_chance))
        what = one.name or tr(one.kind)
        at = f"{place} ± {number(one.sigma_arcsec, '.1f')}″"
        rows.append((what, one.mag.text(), at, rates, str(len(one.frames)), sure))
    heading = tr("Among the stars")
    return f"<section><h2>{escape(heading)}</h2>{_table(heads, rows, 'wide')}</section>"


def _field(night: Night) -> str:
    heading = escape(tr("Sharpness over the field"))
    if (shape := night.field) is None:
        text = tr("Stars are trailed, by more where declination is lower: tilt can't be told.")
        return f"<section><h2>{heading}</h2><p>{escape(text)}</p></section>"
    usual = Counter(f.size for f in night.frames if f.sharp).most_common(1)[0][0]
    tilt, curved = shape.tilt, shape.curvature
    if shape.tilt_chance < NO_TILT:
        where = tr(shape.softest)
        verdict = tr("Softest towards the {corner}: {tilt} px wider than opposite.", corner=where, tilt=tilt.text())
    elif shape.tilt_chance < 0.01:
        verdict = tr("Tilt is not sure: {tilt} px from side to side.", tilt=tilt.text())
    else:
        verdict = tr("No tilt: {tilt} px from side to side.", tilt=tilt.text())
    corners = tr("Corners against the middle, tilt apart: {curved} px.", curved=curved.text("+"))
    seen = tr("As the frame is recorded, FWHM in px. Tilt in micrometres can't be told at one focus position.")
    texts = "".join(f"<p>{escape(text)}</p>" for text in (verdict, corners))
    words = f'<div>{texts}<p class="note">{escape(seen)}</p></div>'
    return f'<section><h2>{heading}</h2><div class="beside">{sharpness_map(shape, usual)}{words}</div></section>'


def _mount(tracking: tuple[Tracking, ...]) -> str:
    heads = (
        tr("Frames"),
        tr("Time"),
        tr("RA (″/h)"),
        tr("Dec (″/h)"),
        tr("Wander RA, Dec (″)"),
        tr("Dithers"),
        tr("Rate (″/s)"),
        tr("Backlash in Dec (″)"),
    )
    rows = [
        (
            str(len(one.frames)),
            _whole(duration_text(3600.0 * one.hours)),
            *(drift.text("+") if drift else tr("unknown") for drift in one.drifts),
            ", ".join(wander.text() if wander.sigmas > 1.0 else tr("unknown") for wander in one.wander_arcsec),
            str(one.dithers),
            one.rate.text() if one.rate else "–",
            one.backlash_arcsec.text() if isinstance(one.backlash_arcsec, Measure) else "–",
        )
        for one in tracking
    ]
    why = words_of([one.backlash_arcsec for one in tracking])
    note = f'<p class="note">{escape(why)}</p>' if why else ""
    return f"<section><h2>{escape(tr('Tracking'))}</h2>{_table(heads, rows)}{note}</section>"


def _guiding(runs: tuple[Guiding, ...]) -> str:
    """What the guider saw, a row a run."""
    heads = (
        *(tr("Began (log's clock)"), tr("Time"), tr("RA (″)"), tr("Dec (″)"), tr("Both (″)"), tr("Dithers")),
        tr("Backlash in Dec (″)"),
    )
    rows = [
        (
            f"{one.begun:%Y-%m-%d %H:%M}",
            _whole(duration_text(3600.0 * one.hours)),
            *(axis.text() for axis in (one.ra_arcsec, one.dec_arcsec, one.total_arcsec)),
            str(one.dithers),
            one.backlash_arcsec.text() if one.backlash_arcsec else "–",
        )
        for one in runs
    ]
    heading = tr("Guiding, RMS")
    return f"<section><h2>{escape(heading)}</h2>{_table(heads, rows)}</section>"


def _figure(night: Night, k: int) -> str:
    frame, lost = night.frames[k], night.lost[k]
    parts = [Path(frame.file).name]
    if frame.time_utc:
        parts.append(f"{frame.time_utc:%H:%M} UTC")
    if frame.sharp:
        parts.append(tr("FWHM {fwhm} px", fwhm=frame.sharp.fwhm_px.text()))
    if lost and lost.sigma > 0.0:
        parts.append(tr("{mag} mag lost", mag=lost.text()))
    if not frame.solved:
        parts.append(frame.error or tr(frame.reason))
    text = escape(" · ".join(parts))
    picture = b64encode(frame.thumbnail).decode()
    image = f'<img alt="{escape(Path(frame.file).name)}" src="data:image/jpeg;base64,{picture}">' if picture else ""
    return f"<figure>{image}<figcaption>{text}</figcaption></figure>"


def _notes(night: Night) -> list[str]:
    notes = [tr("± is one standard uncertainty, from the scatter. FWHM and elongation are medians of clear stars.")]
    notes.append(tr("Programs define FWHM in their own ways: compare it from night to night, not between programs."))
    if any(night.lost):
        notes.append(tr("Light lost is measured on the same stars, against the clearest frames of this night."))
        notes.append(tr("A red mark below is a frame without that number."))
    elif any(frame.solved for frame in night.frames):
        notes.append(tr("Transparency is not measured: it needs two solved frames of linear data."))
    if any(night.brightness):
        notes.append(tr("Sky brightness (V) is measured beside each star: vignetting cancels. Black is subtracted."))
    else:
        notes.append(tr("Sky brightness is not measured: the black level is unknown. Add darks of the same exposure."))
    if night.tracking:
        text = tr("Drift is that of the frame centres in RA and Dec (J2000); dithers are taken out.")
        notes.append(text)
        text = tr("Rate is that of the RA axis about the refracted pole; its ± counts what the polar axis may be off.")
        notes.append(text)
    elif not all(frame.time_utc for frame in night.frames):
        notes.append(tr("Drift is not measured: the frames do not say when they were taken."))
    if night.tracking and night.guiding:
        notes.append(tr("Drift while guiding is flexure between guide camera and telescope, or field rotation."))
    if night.pointing.useful_sightings:
        command = "kochab mount goto TARGET --model NIGHT.json"
        notes.append(tr("Until the next sync this model aims gotos: {how}", how=command))
    elif not night.pointing.model:
        notes += night.pointing.lines()
    if n := sum(frame.sky.altitude_deg < 0.0 for frame in night.frames if frame.sky):
        one = tr_n("{n} frame is below the horizon.", "{n} frames are below the horizon.", n)
        notes.append(one + " " + tr("Check site and clock."))
    if not any(frame.sky for frame in night.frames):
        notes.append(tr("Altitude, Moon and twilight need a site and times: add --site."))
    return notes
