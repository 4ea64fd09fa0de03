"""The numbers of the house, read from the code: ``make house`` prints them and fails past a limit."""

import ast
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
LINES = 55_000
"""The most there may be for what the program could do on the day the house was redrawn (54,957 then)."""
ADDED = {
    "mounts behind INDI and Alpaca servers": 620,
    "park, home and tracking rates": 450,
    "limits while tracking, a horizon of one's own, power cycles of a motor board": 210,
    "a mount that was switched off and on where it stands": 36,
    "the mount's clock and site compared and set": 300,
    "the meridian flip asked and watched": 100,
    "the horizon drawn in the window, and limits set there": 225,
    "home by the sensors of a motor board": 60,
    "a nudge that ends by itself, a quick stop over the network, a park position below the limit": 110,
    "an iOptron's park position, geometry by Alpaca, a nudge by gotos in steps": 26,
    "a computer that sleeps while the mount moves": 13,
    "stops and mute mounts in the mount bench": 112,
    "the detective, evenings, conformance and every make in the mount bench": 33,
    "a mount bench whose night does not run ahead of a busy computer": 15,
    "a mount nudged with a game controller": 132,
    "a Celestron's AUX bus, by Wi-Fi and USB": 384,
    "one model of what is wrong with a mount": 140,
    "a pointing model for gotos, a spiral search, why a mount stopped": 460,
    "frames out of focus known by their discs": 125,
    "memory of decoders bounded on Windows and macOS": 60,
    "decoders of a frozen program in a process of their own": 17,
    "a window around the image, a film strip that solves many files": 680,
    "equipment in the bar, and the Preferences": 344,
    "a help book, what is new, a tour": 212,
    "eight makes' dialects of LX200, StarSense, iOptron's present models": 400,
    "a lens's axis that no star shows in the uncertainty, rings measured about their middle": 31,
    "the catalogue and the camera in a tracked frame's error": 40,
    "the profile in Live, a picture cleared before the next, an end without waiting": 60,
    "a polar bench of rendered frames, through a ray-traced atmosphere": 240,
    "one camera for all frames of an alignment": 90,
    "an axis that knows what moved, no bolt advice from a spoilt measurement": 94,
    "what a field is called: object, constellation, height": 136,
    "deep-sky objects of two sources with axes, outlines and boundaries": 450,
    "the sky layer: names, outlines and lines over a solved frame": 390,
    "the Sun, the Moon, planets, asteroids, comets; files of elements": 870,
    "bodies of the Solar System and unknown sources of a dated frame": 172,
    "annotated pictures with the sky layer, in full size and their own colours": 95,
    "the moons of Jupiter": 92,
    "the moons of Saturn": 212,
    "a bench of the Solar System beside skyfield, ERFA and Stellarium": 135,
    "what is under the cursor, and its card": 147,
    "a search for stars, objects, coordinates and commands": 130,
    "bodies of the Solar System found wherever they are": 44,
    "exports with the frame's date and site, the person's elements, and regions of objects": 49,
    "pictures that carry their place on the sky, a .wcs by astrometry.net's name": 96,
    "satellites of two-line elements, with their trails": 309,
    "comets with a sigma that grows, none whose place nobody knows": 43,
    "files of elements that are dropped on the window": 55,
    "bodies in the table of a frame's objects": 11,
    "closed outlines with names beside them, fields called by named nebulae": 6,
    "bodies of the Solar System in the sky layer and on their cards": 79,
    "the sky layer and names beside a second source in a bench": 105,
    "a grid of altitude and azimuth, the circles of the sky with their names": 81,
    "amounts and colours of layers, and exports that show the same": 264,
    "go to, centre, copy and search from the image": 145,
    "the companion of a double star on its card": 13,
    "layers chosen for the annotated pictures of kochab solve": 31,
    "variable stars: type, magnitudes, period": 72,
    "a tripod that sinks, a camera that creeps, a bearing that wobbles": 88,
    "creep that frames can't show in the ellipse, a bench of mounts that give way": 270,
    "good enough? for the frames that a person wants to take": 80,
    "a polar axis from .wcs, JSON and SharpCap's times; doubts about zone and longitude": 250,
    "the axis by drift: frames that nobody turned, PHD2 guide logs, recorded live sessions": 626,
    "what a solver left in a FITS header, and a camera that stood still": 47,
    "what was measured of a polar axis at a place on another night": 91,
    "the axis of files by drift, their clock, and another night in the window's Polar mode": 300,
    "a last frame where a sweep began, and the clocks of camera, mount and computer compared": 99,
    "a frame without a solution left out of an alignment's many, what many frames share told once": 32,
    "an answer far outside the field that a capture program gives": 25,
    "types of Qt made by the window before a thread loads the plots": 14,
    "modes and layers that a screen reader's Toggle opens": 24,
    "a move that is ordered after its time, a place and a picture from before": 36,
    "texts, plurals and numbers of the window and the rooms below through Qt's translation": 1105,
    "a change of the window taken back: lists, hints, the film strip, Preferences, a profile": 224,
    "a language chosen in the Preferences or by an option": 25,
    "a build of the small-field index that goes on where it stopped": 52,
    "the report, the phone page, the help pages and mounts' reasons in a person's language": 30,
    "libraries loaded after the window's first paint, half a small window for the image": 23,
    "a script that lays an image over Stellarium's sky": 53,
    "a sky atlas: a chart with the frame on it, framing, the panels of a mosaic": 425,
    "the Solar System in the atlas, satellites and elements of one's own found by name": 100,
    "the axis by drift of a running camera, and of files while they grow": 159,
    "one long turn by hand, and no more frames than the numbers ask for": 55,
    "a bolt's own move as a witness against clock and zone": 40,
    "motorised adjusters: their protocol, found out by small moves, stopped by Esc": 245,
    "four frames at each stop of a hand, wedges, platforms and tripod heads": 30,
    "a mode made, styled and shown in three turns, a line that outlives a sleep": 32,
    "the planets from a spline while comets are carried": 9,
    "a Stop that ends moves of a line that broke, slews that begin late, a position that was lost": 79,
    "fields that the wheel leaves alone, limits and alarms that outlive a Stop, a press of Done for its own turn": 78,
    "few stars under a wrong place, the stars' weights under aberration": 29,
    "a killed worker that costs one file, a camera that two views open once": 9,
}
"""What it has learned since, and how many lines more that may take; every other change must fit below."""
COMMENTS = 551
"""The comments that stood in lines of their own under the limit above: they are told apart, for more are wanted."""


@dataclass(frozen=True)
class Number:
    """One number of the house, and the most it may be (None: only told)."""

    name: str
    value: float
    limit: float | None = None
    where: str = ""

    @property
    def met(self) -> bool:
        return self.limit is None or self.value <= self.limit


@cache
def sources() -> dict[str, str]:
    """Every module of the package by its dotted name, with its text."""
    found = {}
    for path in sorted(SOURCE.rglob("*.py")):
        parts = path.relative_to(SOURCE.parent).with_suffix("").parts
        found[".".join(parts).removesuffix(".__init__")] = path.read_text(encoding="utf-8")
    return found


@cache
def imports(module: str) -> frozenset[str]:
    """The package's modules that ``module`` names in an import: at its top, in a function or for types."""
    known, found = sources(), set()
    for node in ast.walk(ast.parse(known[module])):
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
    count = Counter(
        node.name for text in sources().values() for node in ast.parse(text).body if isinstance(node, ast.ClassDef)
    )
    return sorted(name for name, times in count.items() if times > 1)


def array_types_elsewhere() -> Iterator[str]:
    """Names for types of arrays outside ``kochab.core.arrays``."""
    for module, text in sources().items():
        for node in ast.parse(text).body:
            plain = isinstance(node, ast.Assign) and ast.unparse(node.value).startswith("NDArray[")
            if plain and module != "kochab.core.arrays":
                yield f"{module}:{ast.unparse(node.targets[0])}"


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


threading.setprofile(profile)
sys.setprofile(profile)
"""

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
from kochab.window.session import WorkflowEngine
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


def numbers() -> list[Number]:
    """All of them, the dearest last."""
    texts = list(sources().values())
    lengths = [len(text.splitlines()) for text in texts]
    alone = sum(line.lstrip().startswith("#") for text in texts for line in text.splitlines())
    loops, twice, arrays = circles(), classes_twice(), list(array_types_elsewhere())
    solve, sync, live, axis = executed_by_solve(), walked(SYNCS), walked(LIVE), walked(AXIS)
    return [
        Number("modules", len(texts), 350),
        Number("lines", sum(lengths)),
        Number("lines but for comments", sum(lengths) - alone, LINES + sum(ADDED.values()) - COMMENTS),
        Number("lines of a module, median", median(lengths)),
        Number("lines of the longest module", max(lengths), 500),
        Number("lines with a comment in a hundred", round(100 * sum(map(commented, texts)) / sum(lengths), 1)),
        Number("circles of imports", len(loops), 0, "\n".join(loops)),
        Number("floors of gear.mounts", floors("kochab.gear.mounts"), 5),
        Number("names of classes that stand twice", len(twice), 8, " ".join(twice)),
        Number("array types named outside core.arrays", len(arrays), 0, " ".join(arrays)),
        Number("lines the formatter must skip", sum(text.count("# fmt: skip") for text in texts), 29),
        Number("files executed by kochab solve", len(solve), 45, " ".join(solve)),
        Number("files from the yes to Sync to the bytes", len(sync), 30, " ".join(sync)),
        Number("files from a live frame to the overlay", len(live), 42, " ".join(live)),
        Number("files from solved pictures to the axis", len(axis), 18, " ".join(axis)),
    ]


def main() -> int:
    """Print the numbers; 1 when one of them is past its limit."""
    found = numbers()
    for number in found:
        limit = "" if number.limit is None else f"at most {number.limit:,.0f}"
        print(f"{number.name:42}{number.value:>10,.10g}  {limit:18}{'' if number.met else 'TOO MANY'}".rstrip())
        if not number.met and number.where:
            print("    " + number.where.replace("\n", "\n    "))
    return int(not all(number.met for number in found))


if __name__ == "__main__":
    sys.exit(main())
