"""``kochab bench serve``: one command from its start to its end, cold, and with a worker; others on the same frames.

Whole processes in turns, so that a busy machine is busy for all; medians. The frames are rendered from the catalogue:
1.5 and 61 megapixels of 16 bits as FITS. Processor seconds of a warm command are its own and those of the worker's
child. astrometry.net is Debian's ``solve-field`` and ASTAP its ``astap_cli``, each with the file and the field's width
alone, where they and what they need are installed; cedar-solve is its own ``solve_from_image`` on the frame as PNG,
where it has patterns for such a field (10 to 30 deg). ``KOCHAB_BENCH_BEFORE`` names a checkout of an older Kochab that
takes its turns too. The worker is for Linux; elsewhere it is not measured. Batches run on idle cores, as far as others
leave them idle, and beside four busy loops of our own.
"""

import importlib.util
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.frame import Frame
from kochab.core.values import frozen
from kochab.frames import read_frame
from kochab.frames.fits_write import write_fits
from kochab.lab.bench import ALL_ROWS, BenchResult, Goal, Only, Report, Row, children_s, reported
from kochab.simulate.star_images import RenderedStar, render
from kochab.sky import open_catalogue

KOCHAB = [sys.executable, "-m", "kochab"]
SMALL, WIDE, LARGE = (1500, 1000, 8.0), (1500, 1000, 15.0), (9576, 6388, 4.0)
"""Width and height in pixels, and width in degrees."""
FRAMES = {"1.5 MP": SMALL, "1.5 MP wide": WIDE, "61 MP": LARGE}
OTHERS = ("solve-field", "astap_cli", "cedar-solve")
TURNS, QUICK_TURNS, LIMIT_S, BATCH, BATCH_TURNS, BUSY = 15, 5, 120.0, 96, 5, 4
BATCHES = {"batch": 0, "batch beside busy loops": BUSY}
COLD_RATIO, WARM_RATIO, WARM_LARGE_S, BATCH_FRAMES, BATCH_RATIO = 0.6, 0.2, 0.3, 8.0, 1.8
APART = "two programs"
"""Each solves half of a batch: the best that this machine's two cores can do."""
BEFORE = "KOCHAB_BENCH_BEFORE"
LEFT_OUT = ("PYTHONDONTWRITEBYTECODE", "OPENBLAS_NUM_THREADS")
"""Variables that commands do not inherit: what Python compiles is kept, and none has our own threads' limit."""
CEDAR = """
import math, sys
import numpy
numpy.math = math  # its 0.5.1 asks for what numpy 2 no longer lends
from PIL import Image
from tetra3 import Tetra3
found = Tetra3("default_database").solve_from_image(Image.open(sys.argv[1]), fov_estimate=float(sys.argv[2]))
sys.exit(found.get("RA") is None)
"""


@frozen
class Spent:
    """Of one command: seconds on the wall and of the processor, and whether it solved its frame."""

    wall_s: float
    cpu_s: float
    solved: bool


@contextmanager
def _usual_variables() -> Iterator[None]:
    """Let commands start as everybody's do: Python keeps what it compiles, and a command limits its own threads."""
    before = {name: os.environ.pop(name) for name in LEFT_OUT if name in os.environ}
    try:
        yield
    finally:
        os.environ.update(before)


@_usual_variables()
def run(quick: bool, report: Report, only: Only = ALL_ROWS) -> BenchResult:
    """Measure commands on both frames, and a batch."""
    turns = QUICK_TURNS if quick else TURNS
    with tempfile.TemporaryDirectory(prefix="kochab-bench-") as name:
        folder = Path(name)
        rows: list[Row] = []
        with _worker(folder) as worker:
            for label, shape in FRAMES.items():
                if not only(label):
                    continue
                report(f"{label}: {turns} turns ...")
                file = rendered(folder / f"{label}.fits", *shape)
                found = commands(file, shape[2], worker)
                if quick and shape is LARGE:
                    found = {name: command for name, command in found.items() if name not in OTHERS}
                measured = compared(label, found, turns if shape is not LARGE else min(turns, 7))
                rows += [reported(row, report) for row in measured]
        for label, busy in BATCHES.items():
            if not only(label):
                continue
            report(f"{label} ...")
            file = folder / "1.5 MP.fits"
            if not file.exists():
                rendered(file, *SMALL)
            measured = batch([file] * (BATCH // 4 if quick or busy else BATCH), busy)
            rows += [reported(row, report) for row in measured]
    return BenchResult("serve", rows, goals(rows))


def rendered(path: Path, width: int, height: int, fov_deg: float) -> Path:
    """The sky in Cassiopeia on such a sensor, written as FITS.

    Parameters
    ----------
    path : Path
        Where it is written.
    width, height : int
        Of the frame, px.
    fov_deg : float
        Its width on the sky, degrees.
    """
    camera = Camera.centred(width, height, width / 2 / np.tan(np.radians(fov_deg / 2)))
    attitude, catalogue = attitude_from(15.0, 60.5, 20.0), open_catalogue()
    stars = catalogue.brightest(attitude.boresight, np.radians(fov_deg), 4000)
    xy = camera.project(catalogue.vectors(stars) @ attitude.matrix.T)
    flux = 3e5 * 10 ** (-0.4 * (catalogue.mag(stars) - 8.0))
    write_fits(Frame(render(width, height, xy, flux, RenderedStar(3.0)).pixels), path)
    return path


@contextmanager
def _worker(folder: Path) -> Iterator[int | None]:
    """The number of a worker's process, None where there is none; its place is a folder of our own."""
    if not sys.platform.startswith("linux"):
        yield None
        return
    before = os.environ.get("XDG_RUNTIME_DIR")
    os.environ["XDG_RUNTIME_DIR"] = str(folder)
    process = subprocess.Popen([*KOCHAB, "serve"], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        process.stdout.readline()
        yield process.pid
    finally:
        process.terminate()
        process.communicate(timeout=LIMIT_S)
        if before is None:
            del os.environ["XDG_RUNTIME_DIR"]
        else:
            os.environ["XDG_RUNTIME_DIR"] = before


def commands(file: Path, fov_deg: float, worker: int | None) -> dict[str, Callable[[], Spent]]:
    """What solves the file, by name; only what is here."""
    own = [*KOCHAB, "solve", str(file), "--json"]
    found: dict[str, Callable[[], Spent]] = {"kochab cold": lambda: spent([*own, "--no-worker"])}
    if worker is not None:
        found["kochab warm"] = lambda: _with_children(worker, lambda: spent(own))
    if before := os.environ.get(BEFORE):
        paths = {**os.environ, "PYTHONPATH": str(Path(before, "app"))}
        found["kochab before"] = lambda: spent(own, environment=paths)
    base = str(file.with_suffix(""))
    if shutil.which("solve-field") and any(Path("/usr/share/astrometry").glob("index-*.fits")):
        width = ["-L", f"{fov_deg * 0.9}", "-H", f"{fov_deg * 1.1}", "-u", "degwidth"]
        asked = ["solve-field", "--no-plots", "--overwrite", "--cpulimit", "60", *width, str(file)]
        found["solve-field"] = lambda: spent(asked, Path(f"{base}.solved"))
    databases = (folder for name in ("/opt/astap", "/usr/share/astap") for folder in [Path(name)] if folder.is_dir())
    if shutil.which("astap_cli") and any(any(folder.glob("*.*0")) for folder in databases):
        found["astap_cli"] = lambda: spent(["astap_cli", "-f", str(file), "-r", "180"], Path(f"{base}.wcs"))
    if importlib.util.find_spec("tetra3") and 10.0 <= fov_deg <= 30.0:
        picture = _png(file)
        found["cedar-solve"] = lambda: spent([sys.executable, "-c", CEDAR, str(picture), str(fov_deg)])
    return found


def _png(file: Path) -> Path:
    """The frame with 8 bits, from the background to 1 % of the brightest pixels, as PNG beside it."""
    from PIL import Image

    pixels = read_frame(file).pixels
    low, high = np.percentile(pixels, (50.0, 99.0))
    shown = np.clip((pixels - low) / max(high - low, 1e-9) * 120.0 + 20.0, 0.0, 255.0)
    Image.fromarray(shown.astype(np.uint8)).save(file.with_suffix(".png"))
    return file.with_suffix(".png")


def spent(command: Sequence[str], mark: Path | None = None, environment: Mapping[str, str] | None = None) -> Spent:
    """Run a command; ``mark`` is the file that tells that it solved, None when its exit code does."""
    if mark is not None:
        mark.unlink(missing_ok=True)
    started, before, none = time.perf_counter(), children_s(), subprocess.DEVNULL
    with subprocess.Popen(command, stdout=none, stderr=none, env=environment) as process:
        limit = threading.Timer(LIMIT_S, process.kill)  # to wait with a limit looks every 50 ms, and is as late
        limit.start()
        code = process.wait()
        limit.cancel()
    wall, cpu = time.perf_counter() - started, children_s() - before
    return Spent(wall, cpu, code == 0 if mark is None else mark.exists())


def side_by_side(commands: Sequence[Sequence[str]]) -> Spent:
    """Run commands at the same time, until the last has ended."""
    with ThreadPoolExecutor() as pool:
        runs = list(pool.map(spent, commands))
    # Each counts what all processes spent meanwhile: the last to end has counted all.
    return Spent(max(run.wall_s for run in runs), max(run.cpu_s for run in runs), all(run.solved for run in runs))


def _with_children(process: int, work: Callable[[], Spent]) -> Spent:
    """The same with the processor seconds of what a process's children spent meanwhile."""
    before = _children_s(process)
    done = work()
    until = time.monotonic() + 5.0
    while (after := _children_s(process)) == before and time.monotonic() < until:
        time.sleep(0.005)  # until the worker has seen its child end
    return Spent(done.wall_s, done.cpu_s + after - before, done.solved)


def _children_s(process: int) -> float:
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[13]) + int(fields[14])) / os.sysconf("SC_CLK_TCK")


def compared(frame: str, commands: Mapping[str, Callable[[], Spent]], turns: int) -> list[dict[str, Any]]:
    """A row a command: medians over ``turns``, each in its turn after one that is not counted; others once."""
    found: dict[str, list[Spent]] = {name: [] for name in commands}
    for turn in range(turns + 1):
        for name, command in commands.items():
            if name in OTHERS and turn:  # they take seconds, astrometry.net a minute for 61 megapixels
                continue
            one = command()
            if turn or name in OTHERS:
                found[name].append(one)
    return [
        {
            "frame": frame,
            "command": name,
            "wall_s": statistics.median(one.wall_s for one in runs),
            "least_wall_s": min(one.wall_s for one in runs),
            "cpu_s": statistics.median(one.cpu_s for one in runs),
            "solved": sum(one.solved for one in runs),
            "of": len(runs),
        }
        for name, runs in found.items()
    ]


def batch(files: Sequence[Path], busy: int) -> list[dict[str, Any]]:
    """Rows for one worker, two workers and two programs solving the same files, in turns, beside busy loops."""

    def solving(some: Sequence[Path], workers: int) -> list[str]:
        return [*KOCHAB, "solve", *map(str, some), "--json", "--no-worker", "--workers", str(workers)]

    commands = {
        "--workers 1": [solving(files, 1)],
        "--workers 2": [solving(files, 2)],
        APART: [solving(files[::2], 1), solving(files[1::2], 1)],
    }
    found: dict[str, list[Spent]] = {name: [] for name in commands}
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(busy)]
    try:
        for name in [*commands] * BATCH_TURNS:
            found[name].append(side_by_side(commands[name]))
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()
    label = f"{len(files)} of 1.5 MP" + (f", {busy} busy loops" if busy else "")
    rows = []
    for command, runs in found.items():
        wall, cpu = (statistics.median(getattr(run, name) for run in runs) for name in ("wall_s", "cpu_s"))
        row = {"frame": label, "command": command, "busy": busy, "wall_s": wall, "cpu_s": cpu}
        rates = {"frames_s": len(files) / wall, "frames_cpu_s": len(files) / cpu}
        rows.append(row | rates | {"solved": sum(run.solved for run in runs), "of": len(runs)})
    return rows


def goals(rows: Sequence[Mapping[str, Any]]) -> list[Goal]:
    """What a worker saves, how fast a batch is, and what an older Kochab took."""
    found = {(row["frame"], row["command"]): row for row in rows}

    def ratio(first: tuple[str, str], second: tuple[str, str], what: str = "wall_s") -> float | None:
        one, other = found.get(first), found.get(second)
        return one[what] / other[what] if one and other and one.get(what) and other.get(what) else None

    cold, warm, before = (("1.5 MP", f"kochab {name}") for name in ("cold", "warm", "before"))
    batches = {row["frame"]: row.get("busy", 0) for row in rows if row["command"] == "--workers 1"}
    two = {busy: ratio((frame, "--workers 1"), (frame, "--workers 2")) for frame, busy in batches.items()}
    apart = {busy: ratio((frame, "--workers 1"), (frame, APART)) for frame, busy in batches.items()}
    rates = [row["frames_cpu_s"] for row in rows if row["command"] == "--workers 1" and not row.get("busy")]
    large = found.get(("61 MP", "kochab warm"))
    return [
        Goal.at_most("cold 1.5 MP, of an older Kochab's processor time", ratio(cold, before, "cpu_s"), COLD_RATIO),
        Goal.at_most("warm 1.5 MP, of an older Kochab's wall time", ratio(warm, before), WARM_RATIO),
        Goal.at_most("warm 61 MP, s on the wall", None if large is None else large["wall_s"], WARM_LARGE_S),
        Goal.at_least("frames a second of one processor, batch of 1.5 MP", rates[0] if rates else None, BATCH_FRAMES),
        Goal.at_least("two workers, times as fast as one", two.get(0), BATCH_RATIO),
        Goal.at_least(f"{APART}, times as fast as one (this machine's limit)", apart.get(0), BATCH_RATIO),
        Goal.at_least(f"the same beside {BUSY} busy loops", two.get(BUSY), 1.0),
    ]
