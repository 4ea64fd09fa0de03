"""How often lists without any truth reach a claim, beside what the claim promises: counts, and a plot of them.

``python -m tests.lab.bench.calibration count [--minutes 30] [--to-part 496] [--processes 2]`` goes on where
``calibration.json`` beside this file stops, so that a night may be done in parts, and writes it after every part.
Part p holds the lists of shape p % 8 from number p // 8 times a way's lists on (:data:`A_PART`), 202 over all the
ways, from the seeds of :mod:`kochab.lab.bench.identify_shapes`; 496 parts are 100,000 lists.
``... plot PICTURE.png`` draws the counts; the README's is ``resources/screenshots/calibration.png``.

A refused list counts with the best that was found in it. Tracking and the published methods keep that to
themselves, so their verdicts are listened to here.
"""

import argparse
import json
import math
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from multiprocessing import get_context
from pathlib import Path
from time import monotonic
from unittest import mock

import numpy as np
from scipy.stats import chi2

from kochab.identification.verification import ACCEPT_LOG10
from kochab.lab.bench.identify_hostile import WAYS, shape_answer
from kochab.lab.bench.identify_shapes import SEED, SHAPES
from kochab.lab.methods import angles, confirmation, neighbours, predict, triads, voting
from kochab.solver import track_windows

COUNTS = Path(__file__).with_suffix(".json")
A_PART = {way: round(25 * share) for way, (_, share) in WAYS.items()} | {"blind": 25}
HALF_DECADES = 20
"""Claims are counted by half decades; the last holds all that are lower still."""
LISTED_LOG10 = -3.0
"""Lists with such a claim or a lower one are kept by name."""


@contextmanager
def every_claim() -> Iterator[list[float]]:
    """The claims of all verdicts that methods and tracking make meanwhile, also of those they refuse."""
    claims: list[float] = []

    def listening(verdict, claim_of):
        def heard(*given):
            found = verdict(*given)
            if found is None:
                return None
            claims.append(claim_of(found))
            return found if claims[-1] <= ACCEPT_LOG10 else None

        return heard

    with ExitStack() as patches:
        for module in (confirmation, predict, track_windows):
            patches.enter_context(mock.patch.object(module, "ACCEPT_LOG10", 0.0))
        for module in (angles, neighbours, triads, voting):
            heard = listening(confirmation.confirm, lambda found: found.log10_false_alarm)
            patches.enter_context(mock.patch.object(module, "confirm", heard))
        patches.enter_context(mock.patch.object(predict, "_checked", listening(predict._checked, lambda f: f[3])))
        yield claims


def count_part(part: int) -> dict:
    """One part's lists, by way: how many, how many answered, claims by half decade; and those to be kept by name."""
    shape, block = list(SHAPES)[part % len(SHAPES)], part // len(SHAPES)
    ways, reached, started = {}, [], monotonic()
    for way, lists in A_PART.items():
        wrong, steps = 0, np.zeros(HALF_DECADES, dtype=np.int64)
        for number in range(block * lists, (block + 1) * lists):
            with every_claim() as claims:
                answer = shape_answer(shape, way, number)
            claim = min([0.0, answer["claim"], *claims])
            wrong += int(answer["wrong"])
            steps[min(int(-2.0 * claim), HALF_DECADES - 1)] += 1
            if claim <= LISTED_LOG10 or answer["wrong"]:
                reached.append([shape, way, number, round(claim, 2)])
        ways[way] = {"lists": lists, "wrong": wrong, "claims": steps.tolist()}
    return {"ways": ways, "reached": reached, "seconds": monotonic() - started}


def counted() -> dict:
    """The counts so far."""
    if COUNTS.exists():
        return json.loads(COUNTS.read_text("utf-8"))
    ways = {way: {"lists": 0, "wrong": 0, "claims": [0] * HALF_DECADES} for way in WAYS}
    return {"seed": SEED, "parts": 0, "lists": 0, "seconds": 0.0, "ways": ways, "reached": []}


def save(kept: dict) -> None:
    """Write the counts, one way a line."""
    ways = ",\n".join(f'  "{way}": {json.dumps(total)}' for way, total in kept["ways"].items())
    reached = ",\n".join(f"  {json.dumps(one)}" for one in kept["reached"])
    head = "".join(f' "{key}": {kept[key]},\n' for key in ("seed", "parts", "lists", "seconds"))
    fresh = COUNTS.with_suffix(".part")
    fresh.write_text(f'{{\n{head} "ways": {{\n{ways}\n }},\n "reached": [\n{reached}\n ]\n}}\n', "utf-8")
    os.replace(fresh, COUNTS)


def go_on(to_part: int, minutes: float, processes: int) -> None:
    """Count the next parts until one of the limits, saving after each."""
    kept, end = counted(), monotonic() + 60.0 * minutes
    todo = range(kept["parts"], to_part)
    with get_context("spawn").Pool(processes) as pool:
        for part, found in zip(todo, pool.imap(count_part, todo), strict=True):
            for way, more in found["ways"].items():
                total = kept["ways"][way]
                total["lists"] += more["lists"]
                total["wrong"] += more["wrong"]
                total["claims"] = [a + b for a, b in zip(total["claims"], more["claims"], strict=True)]
            kept["parts"] = part + 1
            kept["lists"] = sum(total["lists"] for total in kept["ways"].values())
            kept["seconds"] = round(kept["seconds"] + found["seconds"], 1)
            kept["reached"] += found["reached"]
            save(kept)
            print(f"part {part}: {kept['lists']} lists, {kept['seconds']:.0f} s, {kept['reached'][-3:]}", flush=True)
            if monotonic() > end:
                return


def reaching(ways: list[dict]) -> tuple[int, np.ndarray]:
    """How many lists, and how many of them claim 10 ** -(k / 2) or less, for k = 1, 2, ..."""
    steps = np.sum([way["claims"] for way in ways], axis=0)
    return sum(way["lists"] for way in ways), np.cumsum(steps[::-1])[::-1][1:]


def interval(seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The 95 % Poisson limits of the mean when so many are counted (Garwood 1936)."""
    low = np.where(seen > 0, chi2.ppf(0.025, np.maximum(2 * seen, 1)) / 2.0, 0.0)
    return low, np.asarray(chi2.ppf(0.975, 2 * seen + 2) / 2.0)


INK, FAINT = "#1f2933", "#9aa5b1"
CURVES = (
    ("all twelve ways", tuple(WAYS), "#1f6feb"),
    ("told the scale, perhaps the place", tuple(way for way in WAYS if "scale to" in way), "#1a7f37"),
    ("blind", ("blind",), "#d1242f"),
)
"""Label, ways and colour."""


def draw(kept: dict, picture: Path) -> None:
    """The plot: what is claimed against how many lists reach it, with 95 % limits."""
    import pyqtgraph as pg
    from PySide6.QtWidgets import QApplication

    from tests.window.take_screenshots import keep

    app = QApplication.instance() or QApplication([])
    pg.setConfigOptions(background="w", foreground=INK, antialias=True)
    plot = pg.PlotWidget()
    plot.resize(760, 430)
    plot.addLegend(offset=(-95, 10), labelTextColor=INK)
    plot.setLabel("bottom", "chance match claimed, at most")
    plot.setLabel("left", "share of lists that reach it")
    lists, _ = reaching(list(kept["ways"].values()))
    plot.setTitle(f"{lists:,} lists without any truth; bars: 95 %", color=INK)
    lowest = -math.log10(lists) - 0.7  # further down none is expected
    plot.plot([lowest, 0.0], [lowest, 0.0], pen=pg.mkPen(INK, width=1.5), name="as often as claimed")
    claims = -0.5 * np.arange(1, HALF_DECADES)
    for shift, (label, ways, colour) in enumerate(CURVES):
        of, seen = reaching([kept["ways"][way] for way in ways])
        low, high = (np.log10(np.maximum(limit, 1e-9) / of) for limit in interval(seen))
        shown, bars = (seen > 0) & (claims > lowest), claims > lowest
        at, pen = claims + 0.04 * (shift - 1), pg.mkPen(colour, width=2)
        low, top = np.maximum(low, lowest)[bars], np.minimum(high, 0.0)[bars]
        plot.addItem(pg.ErrorBarItem(x=at[bars], y=(low + top) / 2.0, height=top - low, beam=0.06, pen=pen))
        plot.plot(
            at[shown],
            np.log10(seen[shown] / of),
            pen=None,
            symbol="o",
            symbolSize=8,
            symbolBrush=colour,
            symbolPen=None,
            name=f"{label}, {of:,} lists",
        )
    accepted = pg.InfiniteLine(ACCEPT_LOG10, pen=pg.mkPen(FAINT, style=pg.QtCore.Qt.PenStyle.DashLine))
    plot.addItem(accepted)
    accepted_label = pg.TextItem("accepted from here on", color=INK, anchor=(0, 1), angle=-90)
    plot.addItem(accepted_label)
    accepted_label.setPos(ACCEPT_LOG10, 0.0)
    plot.setXRange(0.0, lowest, padding=0.02)
    plot.setYRange(lowest, 0.0, padding=0.02)
    plot.getPlotItem().invertX()
    for side in ("bottom", "left"):
        ticks = [(-k, f"1e-{k}" if k else "1") for k in range(int(-lowest) + 1)]
        plot.getAxis(side).setTicks([ticks])
        plot.getAxis(side).setTextPen(INK)
    plot.showGrid(x=True, y=True, alpha=0.15)
    plot.show()
    app.processEvents()
    keep(plot, picture)


def main() -> None:
    """Count, or draw what was counted."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    counting = commands.add_parser("count")
    counting.add_argument("--to-part", type=int, default=496)
    counting.add_argument("--minutes", type=float, default=math.inf)
    counting.add_argument("--processes", type=int, default=1)
    commands.add_parser("plot").add_argument("picture", type=Path)
    asked = parser.parse_args()
    if asked.command == "count":
        go_on(asked.to_part, asked.minutes, asked.processes)
    else:
        draw(counted(), asked.picture)


if __name__ == "__main__":
    main()
