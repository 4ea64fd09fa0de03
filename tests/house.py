"""What the house looks like, read from the code: ``make house`` prints sizes and walks for whoever wants to look."""

import ast
import gc
import io
import json
import os
import re
import subprocess
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from pathlib import Path
from statistics import median

from tests.patterns import REPOSITORY

SOURCE = REPOSITORY / "app" / "kochab"
SAMPLES = REPOSITORY / "resources" / "samples"


@dataclass(frozen=True)
class Number:
    """One number of the house, with the names behind it."""

    name: str
    value: float
    names: tuple[str, ...] = ()


@cache
def sources() -> dict[str, str]:
    """Every module of the package by its dotted name, with its text."""
    found = {}
    for path in sorted(SOURCE.rglob("*.py")):
        parts = path.relative_to(SOURCE.parent).with_suffix("").parts
        found[".".join(parts).removesuffix(".__init__")] = path.read_text(encoding="utf-8")
    return found


def parsed(text: str) -> ast.Module:
    """The syntax tree of a text; collecting garbage meanwhile would take three times as long as parsing."""
    collects = gc.isenabled()
    gc.disable()
    try:
        return ast.parse(text)
    finally:
        if collects:
            gc.enable()


@cache
def tree(module: str) -> ast.Module:
    """The same of a module of the package, kept for the next who asks."""
    return parsed(sources()[module])


def trees_with(*words: str) -> Iterator[tuple[str, ast.Module]]:
    """The modules whose text holds any of the words, and their trees; others need not be parsed."""
    for module, text in sources().items():
        if any(word in text for word in words):
            yield module, tree(module)


@cache
def imports(module: str) -> frozenset[str]:
    """The package's modules that ``module`` names in an import: at its top, in a function or for types."""
    known, found = sources(), set()
    for node in ast.walk(parsed(known[module])):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            inside = names & known.keys()
            found |= inside
            if len(inside) < len(names):
                found.add(node.module)
    return frozenset(found & known.keys() - {module})


def circles() -> list[str]:
    """One circle of imports each time, its edges taken away until none is left."""
    graph = {module: set(imports(module)) for module in sources()}
    found = []
    while True:
        try:
            TopologicalSorter(graph).prepare()
        except CycleError as error:
            loop = error.args[1]  # each is imported by the one after it
            found.append(" > ".join(reversed(loop)))
            for imported, importer in pairwise(loop):
                graph[importer].discard(imported)
        else:
            return found


def floors(room: str) -> int:
    """The longest chain of imports within a room, as a number of modules."""
    inside = [m for m in sources() if m.startswith(f"{room}.")]
    depth: dict[str, int] = {}
    try:
        order = TopologicalSorter({m: imports(m) & set(inside) for m in inside}).static_order()
        for module in order:
            depth[module] = 1 + max((depth[m] for m in imports(module) if m in depth), default=0)
    except CycleError:
        return len(inside)
    return max(depth.values())


def classes_twice() -> list[str]:
    """Names of classes that two modules or more define at their top."""
    count = Counter(node.name for module in sources() for node in tree(module).body if isinstance(node, ast.ClassDef))
    return sorted(name for name, times in count.items() if times > 1)


def array_types_elsewhere() -> Iterator[str]:
    """Names for types of arrays outside ``kochab.core.arrays``."""
    for module, whole in trees_with("NDArray["):
        for node in whole.body:
            plain = isinstance(node, ast.Assign) and ast.unparse(node.value).startswith("NDArray[")
            if plain and module != "kochab.core.arrays":
                yield f"{module}:{ast.unparse(node.targets[0])}"


MANY = 4
"""A public function with so many parameters says in its docstring what each of them is."""


def _public_functions(body: list[ast.stmt], prefix: str) -> Iterator[tuple[str, ast.FunctionDef]]:
    for node in body:
        name = getattr(node, "name", "_")
        if not name.startswith("_") and isinstance(node, ast.ClassDef):
            yield from _public_functions(node.body, f"{prefix}{name}.")
        elif not name.startswith("_") and isinstance(node, ast.FunctionDef):
            yield f"{prefix}{name}", node


def parameters_without_a_word(text: str) -> Iterator[str]:
    """``function: parameters`` of a module's text that no line of a NumPy "Parameters" section begins with."""
    for name, node in _public_functions(parsed(text).body, ""):
        given = node.args
        named = (*given.posonlyargs, *given.args, given.vararg, *given.kwonlyargs, given.kwarg)
        names = [arg.arg for arg in named if arg is not None and arg.arg not in ("self", "cls")]
        if len(names) >= MANY:
            section = re.search(
                r"^Parameters\n-+\n(.*?)(?=^\w[\w ]*\n-+$|\Z)", ast.get_docstring(node) or "", re.M | re.S
            )
            heads = re.findall(r"^(?=\S)([^:\n]+)", section[1] if section else "", re.M)
            told = {one.strip(" *") for head in heads for one in head.split(",")}
            if silent := [one for one in names if one not in told]:
                yield f"{name}: {', '.join(silent)}"


def executed(code: str, *arguments: str) -> list[str]:
    """The package's files that were executed when a fresh interpreter has run ``code``."""
    tail = (
        "\nimport json\n"
        "print('HOUSE', json.dumps(sorted(n for n, m in sys.modules.items()"
        " if n.split('.')[0] == 'kochab' and getattr(m, '__file__', None))))"
    )
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\nsys.path.insert(0, {str(SOURCE.parent)!r})\n{code}{tail}", *arguments],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        timeout=250,
        check=True,
    )
    line = next(line for line in done.stdout.splitlines() if line.startswith("HOUSE "))
    return list(json.loads(line.removeprefix("HOUSE ")))


def executed_by_solve() -> list[str]:
    """Files executed by ``kochab solve`` of one sample frame, as a person types it."""
    sample = min(SAMPLES.glob("*.jpg"), key=lambda path: path.stat().st_size)
    code = "from kochab.cli.main import main\nassert main(sys.argv[1:]) == 0"
    return executed(code, "solve", str(sample), "--json")


TRACER = """
import sys, threading

KEPT = ("MainThread", "kochab-capture", "kochab-live", "kochab-live-display")
walked, on = set(), False


def profile(frame, event, argument):
    if on and threading.current_thread().name in KEPT:
        walked.add(frame.f_code.co_filename)


def trace():
    threading.setprofile(profile)
    sys.setprofile(profile)
"""
"""``trace`` comes as late as it may: it costs every call, and of the threads it sees those that begin after it."""

SYNCS = """
from kochab.core.progress import run
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import SyncEvidence
from kochab.workflows.sync_mount import SyncOffer, accept_sync
from tests.gear.mounts.bench import LIMITS, SITE, simulated

with simulated("lx200") as bench:
    guard = Guard(bench.open(), SITE, LIMITS, clock=bench.clock)
    here = guard.position_icrs()
    sky = (here[0] + 0.2, here[1] + 0.1)
    evidence = SyncEvidence((sky, sky), (0.3, 0.3), (-12.0, -12.0))
    preview = guard.preview_sync(*guard.to_mount(*sky), evidence)
    offer = SyncOffer(preview, evidence, None, guard.position(), sky, "")
    trace()
    on = True
    done = run(accept_sync(guard, offer, confirmed=True))
    on = False
    assert done.synced
    assert any(b":CM" in data for way, data in bench.line.transcript)
    guard.close()
"""

LIVE = """
import tempfile
from threading import Event
from time import monotonic, sleep
from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication
from kochab.core.capture import CameraSource, CaptureLimits
from kochab.sky.sky_tables import sky_tables
from kochab.window.application import build
from kochab.window.charts.plot_area import PlotArea
from kochab.window.frame.session import WorkflowEngine
from kochab.window.settings import WindowSettings
from kochab.workflows.live import solve
from kochab.workflows.session.live_stream import StreamRequest
from tests.workflows.live_sky import sky_frame


class OnDemand(CameraSource):
    name, limits, wanted, given = "camera", CaptureLimits(), Event(), 0

    def configure(self, settings):
        return settings

    def next_frame(self, timeout_s):
        global on
        if not self.wanted.wait(timeout_s):
            return None
        self.wanted.clear()
        self.given += 1
        frame = sky_frame(seconds=float(self.given))
        on = self.given > BEFORE
        return frame


def watched(painter, view):
    global on, painted
    paint(painter, view)
    shown = live.display.shown
    if shown is not None and shown.update is not None and shown.update.shot.number == camera.given:
        if on:
            walks.append(frozenset(walked))
        on, painted = False, camera.given
        walked.clear()


BEFORE, TRACED, painted, walks = 3, 3, 0, []  # frames before those that are traced, which are tracked
app, camera = QApplication([]), OnDemand()
solve.WAIT_S = 2.0  # what is said while no frame comes is no part of a frame's way
with tempfile.TemporaryDirectory() as home:
    settings = WindowSettings(QSettings(home + "/window.ini", QSettings.Format.IniFormat))
    window, commands = build(WorkflowEngine(), settings, [])
    window.resize(1200, 800)
    window.show()
    commands.presenter.overlay.tables = sky_tables()
    commands.views.show("live")
    live = commands.views.docks["live"].view
    paint, window.workspace.view.marks = window.workspace.view.marks, watched
    trace()
    live.run(StreamRequest(lambda: camera, "a camera"))
    live._timer.stop()  # the panels beside the frame are another walk
    while any(area.isVisible() and area.plot is None for area in window.findChildren(PlotArea)):
        app.processEvents()
        sleep(0.01)  # for the thread that loads their library
    while camera.given < BEFORE + TRACED:
        asked, end = camera.given + 1, monotonic() + 60.0
        camera.wanted.set()
        while painted < asked:
            assert monotonic() < end, "no frame was painted"
            app.processEvents()
            sleep(0.002)  # for the threads that read, solve and draw
    assert paint.__self__.solution is live.display.shown.update.result
    assert live.display.shown.update.mode == "tracking"
    window.close()
walked = set.intersection(*map(set, walks))  # what ran beside one of them alone belongs to something else
"""

AXIS = """
from datetime import UTC, datetime, timedelta
import numpy as np
from kochab.cli.polar import as_text
from kochab.core.attitude import Attitude, attitude_from
from kochab.core.camera import Camera
from kochab.core.frame import Site
from kochab.core.solution import Solution
from kochab.polar.measure import MeasureSettings, measure
from kochab.workflows.polar.sources import SolvedFile, sightings_of, site_of

camera, begun, place = Camera.centred(900, 700, 8000.0), datetime(2026, 3, 14, 20, 0, tzinfo=UTC), Site(47.0, 8.0, 450.0)
files = []
for k in range(3):
    attitude = Attitude(attitude_from(90.0 + 30.0 * k, 40.0, 10.0).matrix, np.diag([1e-10, 1e-10, 1e-8]))
    files.append(SolvedFile(f"{k}.fits", Solution(camera, attitude, (), 0.2, -30.0, ""), begun + timedelta(minutes=k), place))
trace()
on = True
told = as_text(measure(sightings_of(files, [0] * 3), MeasureSettings(site_of(files))))
on = False
assert "from the refracted north pole" in told
"""


@cache
def walked(code: str) -> list[str]:
    """The package's files with a function that runs while ``code`` has ``on`` set, traced in a fresh interpreter."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(SOURCE.parent), str(REPOSITORY)])}
    done = subprocess.run(
        [sys.executable, "-c", f"{TRACER}{code}\non = False\nprint('WALKED', *sorted(walked), sep='\\n')"],
        cwd=REPOSITORY,
        env=environment | {"QT_QPA_PLATFORM": "offscreen"},
        capture_output=True,
        text=True,
        timeout=250,
        check=True,
    )
    files = map(Path, done.stdout.partition("WALKED\n")[2].splitlines())
    return [str(file.relative_to(SOURCE)) for file in files if file.is_relative_to(SOURCE)]


def commented(text: str) -> int:
    """The lines of a module that carry a comment for its readers, not for a tool."""
    read = tokenize.generate_tokens(io.StringIO(text).readline)
    comments = [token for token in read if token.type == tokenize.COMMENT]
    return sum(not re.match(r"#\s*(noqa|type:|pragma|fmt:)", token.string) for token in comments)


def numbers() -> Iterator[Number]:
    """Sizes first, then what takes an interpreter to walk."""
    texts = sources()
    lengths = {module: len(text.splitlines()) for module, text in texts.items()}
    rooms = Counter[str]()
    for module, lines in lengths.items():
        rooms[module.split(".")[1] if "." in module else "(root)"] += lines
    yield Number("modules", len(texts))
    yield Number("lines", sum(lengths.values()))
    for room, lines in sorted(rooms.items()):
        yield Number(f"  {room}", lines)
    yield Number("lines of a module, median", median(lengths.values()))
    longest = sorted(lengths, key=lengths.__getitem__)[:-6:-1]
    yield Number("lines of the longest modules", lengths[longest[0]], tuple(f"{m} {lengths[m]}" for m in longest))
    yield Number(
        "lines with a comment in a hundred", round(100 * sum(map(commented, texts.values())) / sum(lengths.values()), 1)
    )
    yield Number("floors of gear.mounts", floors("kochab.gear.mounts"))
    yield Number("circles of imports", len(circles()), tuple(circles()))
    yield Number("names of classes that stand twice", len(classes_twice()), tuple(classes_twice()))
    for name, files in (
        ("files executed by kochab solve", executed_by_solve()),
        ("files from the yes to Sync to the bytes", walked(SYNCS)),
        ("files from a live frame to the overlay", walked(LIVE)),
        ("files from solved pictures to the axis", walked(AXIS)),
    ):
        yield Number(name, len(files), tuple(files))


def main() -> None:
    """Print the numbers, and the names behind the few that have any."""
    for number in numbers():
        print(f"{number.name:42}{number.value:>10,.10g}", flush=True)
        for name in number.names:
            print(f"      {name}")


if __name__ == "__main__":
    main()
