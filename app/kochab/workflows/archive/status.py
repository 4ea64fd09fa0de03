"""How far an archive is: numbers from its parts and from what its runs tell, and the same as a page."""

from collections import Counter
from datetime import UTC, datetime
from html import escape
from typing import Any

import pyarrow.compute as pc

from kochab.text.duration_text import duration_text
from kochab.text.translation import number, tr, tr_n, tr_noop
from kochab.workflows.archive.dataset import Dataset
from kochab.workflows.night.page import STYLE
from kochab.workflows.solution_json import Json

FRESH_S = 300.0
"""A run that has told nothing for so long has ended without saying so."""
STATES = {
    "running": tr_noop("running"),
    "stopped": tr_noop("stopped"),
    "done": tr_noop("done"),
    "lost": tr_noop("ended without saying so"),
}
REFRESH_S = 10
LISTED = 50
_COLUMNS = ("url", "solved", "reason", "error", "quarantined", "copy", "kind", "cpu_s", "read_bytes", "wall_s")
MORE_STYLE = """
.progress { height: 14px; background: var(--tile); border: 1px solid var(--line); border-radius: 8px; overflow: hidden;
 margin: 24px 0 16px; } .progress i { display: block; height: 100%; background: var(--accent); }
td.number, th.number { text-align: right; } td.file { overflow-wrap: anywhere; }
"""


def is_fresh(state: Json) -> bool:
    """Whether a run has told of itself lately."""
    try:
        updated = datetime.fromisoformat(str(state["updated_utc"]))
    except (KeyError, ValueError):
        return False
    return abs((datetime.now(UTC) - updated).total_seconds()) < FRESH_S


def summary_of(dataset: Dataset) -> Json:
    """What the rows and the runs of a dataset say together."""
    table = dataset.table(_COLUMNS)
    solved = table.filter(pc.fill_null(table["solved"], False))
    calibration = pc.fill_null(pc.equal(table["kind"], "calibration"), False)
    lights = table.filter(pc.invert(calibration))
    unsolved = Counter(reason for reason in lights["reason"].to_pylist() if reason)
    broken = table.filter(pc.is_valid(table["error"]))
    poison = broken.filter(pc.fill_null(broken["quarantined"], False))
    runs = {name: _run(state) for name, state in dataset.states().items()}
    cost = {name: pc.mean(table[name]).as_py() for name in ("cpu_s", "wall_s", "read_bytes")}
    return {
        "rows": len(table),
        "solved": len(solved),
        "calibration": len(table) - len(lights),
        "copies": pc.sum(pc.fill_null(table["copy"], False)).as_py() or 0,
        "unsolved": dict(unsolved.most_common()),
        "to_retry": len(broken) - len(poison),
        "quarantined": len(poison),
        "quarantine": poison.slice(0, LISTED).select(["url", "error"]).to_pylist(),
        "mean_cpu_s": cost["cpu_s"],
        "mean_wall_s": cost["wall_s"],
        "mean_read_bytes": cost["read_bytes"],
        "runs": runs,
        "to_do": sum(run["to_do"] - run["done"] for run in runs.values() if run["state"] == "running"),
        "rate_s": sum(run["rate_s"] for run in runs.values() if run["state"] == "running"),
    }


def _run(state: Json) -> Json:
    """A run's state, numbers where numbers belong; one that fell silent is "lost"."""
    kept: Json = {name: _number(state.get(name)) for name in ("inputs", "to_do", "done", "solved", "failed", "rate_s")}
    word = str(state.get("state"))
    kept |= {"state": "lost" if word == "running" and not is_fresh(state) else word}
    return kept | {name: str(state.get(name, "")) for name in ("workers", "host", "started_utc", "updated_utc")}


def _number(value: Any) -> float:
    return value if isinstance(value, int | float) and not isinstance(value, bool) else 0


def page_of(summary: Json, url: str) -> str:
    """The page: it needs no network, and reloads itself while a run is under way."""
    running = any(run["state"] == "running" for run in summary["runs"].values())
    done, left = summary["rows"], summary["to_do"]
    share = done / max(done + left, 1)
    again = f'<meta http-equiv="refresh" content="{REFRESH_S}">' if running else ""
    title = escape(tr("Archive {url}", url=url))
    parts = [f"<h1>{title}</h1>", f'<p class="sub">{escape(_headline(summary, running))}</p>']
    parts.append(f'<div class="progress"><i style="width: {100 * share:.2f}%"></i></div>')
    parts.append(f'<div class="tiles">{"".join(_tiles(summary))}</div>')
    if summary["unsolved"]:
        rows = [(escape(tr(reason)), str(count)) for reason, count in summary["unsolved"].items()]
        parts.append(_table(tr("Not solved"), (tr("Reason"), tr("Frames")), rows))
    if summary["quarantine"]:
        rows = [
            (f'{escape(o["error"])}<br><span class="note">{escape(o["url"])}</span>', "") for o in summary["quarantine"]
        ]
        more = summary["quarantined"] - len(rows)
        parts.append(_table(tr("Quarantined files"), (tr("Why"), ""), rows))
        if more > 0:
            text = tr("and {n} more", n=more)
            parts.append(f'<p class="note">{escape(text)}</p>')
    if summary["runs"]:
        rows = []
        for name, run in summary["runs"].items():
            word = tr(STATES.get(run["state"], run["state"]))
            ended = tr(
                "{shard}: {state}, workers: {workers}, from {host}",
                shard=name,
                state=word,
                workers=run["workers"],
                host=run["host"],
            )
            rows.append((escape(ended), f"{run['done']} / {run['to_do']}"))
        parts.append(_table(tr("Runs"), (tr("Shard"), tr("Done")), rows))
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">{again}'
        f"<title>{title}</title><style>{STYLE}{MORE_STYLE}</style></head>\n<body>\n"
        + "\n".join(parts)
        + "\n</body></html>\n"
    )


def _headline(summary: Json, running: bool) -> str:
    done, left, rate = summary["rows"], summary["to_do"], summary["rate_s"]
    text = tr("{done} of {all} frames done", done=done, all=done + left)
    if running and rate > 0:
        text += " · " + tr("{rate} a second, {time} left", rate=number(rate, ".3g"), time=duration_text(left / rate))
    elif running:
        text += " · " + tr("starting")
    return text + f" · {datetime.now(UTC):%Y-%m-%d %H:%M} UTC"


def _tiles(summary: Json) -> list[str]:
    rows = max(summary["rows"] - summary["calibration"], 1)
    share = tr("{share} % of the light frames", share=number(100 * summary["solved"] / rows, ".1f"))
    tiles = [(tr("Solved"), str(summary["solved"]), share)]
    besides = (
        tr_n("and {n} calibration frame", "and {n} calibration frames", summary["calibration"])
        if summary["calibration"]
        else ""
    )
    tiles.append((tr("Not solved"), str(sum(summary["unsolved"].values())), besides))
    tiles.append((tr("Quarantined"), str(summary["quarantined"]), tr("tried again when the file changes")))
    if summary["to_retry"]:
        tiles.append((tr("Not reached"), str(summary["to_retry"]), tr("the next run tries again")))
    if summary["mean_cpu_s"] is not None:
        size = (summary["mean_read_bytes"] or 0.0) / 1e6
        cost = tr("processor, {size} MB read", size=number(size, ".1f"))
        tiles.append((tr("Cost of a frame"), f"{number(1e3 * summary['mean_cpu_s'], '.0f')} ms", cost))
    return [
        f'<div class="tile">{escape(name)}<b>{escape(value)}</b><span>{escape(under)}</span></div>'
        for name, value, under in tiles
    ]


def _table(heading: str, head: tuple[str, str], rows: list[tuple[str, str]]) -> str:
    """Two columns, the second of numbers; the cells are HTML."""
    top = f'<tr><th>{escape(head[0])}</th><th class="number">{escape(head[1])}</th></tr>'
    lines = "".join(f'<tr><td class="file">{one}</td><td class="number">{other}</td></tr>' for one, other in rows)
    return f"<section><h2>{escape(heading)}</h2><table>{top}{lines}</table></section>"
