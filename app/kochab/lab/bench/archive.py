"""``kochab bench archive``: what a frame costs in an archive, on one worker and on two, and when workers are killed.

Whole commands, their rows read by pyarrow. Star lists are 33 stars with errors of 0.1 px at random places, frames 1.5
megapixels of 16 bits as FITS, rendered from the catalogue. The rate of a run is that of the inputs between the first
and the last tenth, without its start; processor time is a median, which the first frame of a worker leaves alone.
Workers are killed with SIGKILL at random times, from the first rows on. S3 is moto's server, where moto and s3fs are
installed; its log counts the requests. Whether two workers are twice as fast as one is only told when nothing else uses
the machine all the while; by processor time it is always. Two programs that share nothing, each with half of the
inputs, say what the machine itself gives: two processors of a virtual machine may be one core.
"""

import json
import os
import random
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.errors import UsageError
from kochab.core.values import frozen
from kochab.lab.bench import ALL_ROWS, BenchResult, Goal, Only, Report, Row, children_s
from kochab.lab.bench.serve import KOCHAB, SMALL, rendered
from kochab.sky import open_catalogue

LISTS, FEW_LISTS, QUICK_LISTS = 100_000, 6_000, 2_000
FRAMES, QUICK_FRAMES, S3_FRAMES = 400, 60, 40
KILLS, KILL_S, QUICK_KILL_S = 20, (2.0, 20.0), (0.3, 1.5)
"""How many workers are killed, and the pause before each, s."""
LIST_PX, LIST_FOCAL_PX, NOISE_PX = (1600, 1000), 7600.0, 0.1
TWICE, TURNS = 1.8, 2
OF_MACHINE, MAIN_PERCENT = 0.95, 5.0
"""Two workers reach so much of two programs' rate; the process that gathers takes so much of all processor time."""
APART = "1 + 1"
"""The workers of two programs."""
AGAIN, KILLED, ON_S3 = "frames that are done", "killed workers, star lists", "S3, 1.5 MP frames"
QUIET_PERCENT = 10.0
"""The share of the processor that other programs may use while wall-clock speed is measured."""
SAMPLE_S = 1.0
"""Memory and processor time are looked at so often: ten times a second that took a quarter of a core."""
NEEDED = ("distributed", "pyarrow", "fsspec", "psutil")


@frozen
class Ran:
    """One command: seconds on the wall and of all its processes, their peak of memory together, and its rows.

    ``busy`` is the share of the processors that others used meanwhile, percent; ``kills`` how many workers ended;
    ``spent`` are moments (seconds since 1970) with the processor time of what was started and of all below it, s.
    """

    wall_s: float
    cpu_s: float
    peak_mb: float
    rows: Any
    busy: float
    kills: int = 0
    spent: Sequence[tuple[float, float, float]] = ()


def run(quick: bool, report: Report, only: Only = ALL_ROWS) -> BenchResult:
    """Measure star lists and frames, lose workers, and count requests.

    ``--only "star lists"`` and ``--only "1.5 MP frames"`` measure one and two workers alone, in turns: with ``--quick``
    some minutes of an idle machine.
    """
    if missing := [name for name in NEEDED if find_spec(name) is None]:
        raise UsageError(f"bench archive needs {', '.join(missing)}: pip install 'kochab-astro[archive]'.")
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory(prefix="kochab-bench-") as name:
        folder = Path(name)
        frames = QUICK_FRAMES if quick else FRAMES
        if only("star lists"):
            few = QUICK_LISTS if quick else FEW_LISTS
            write_lists(folder / "few.parquet", few)
            rows += one_and_two(folder, "few.parquet", "star lists", few, report)
        if only(AGAIN) or only("1.5 MP frames"):
            write_frames(folder / "frames", frames)
            rows += one_and_two(folder, "frames", "1.5 MP frames", frames, report)
        if only(AGAIN):
            report(f"the {frames} frames again ...")
            rows.append(row(AGAIN, 2, frames, archived(folder / "frames", folder / "2-0-frames", 2)))
        if only(KILLED):
            many = QUICK_LISTS if quick else LISTS
            report(f"{many} star lists, {KILLS} workers killed ...")
            write_lists(folder / "many.parquet", many)
            pauses = QUICK_KILL_S if quick else KILL_S
            rows.append(row(KILLED, 2, many, killed(folder / "many.parquet", folder / "many", pauses)))
        if only(ON_S3) and find_spec("moto") and find_spec("s3fs"):
            report(f"{S3_FRAMES} frames on S3 ...")
            write_frames(folder / "s3", S3_FRAMES)
            rows.append(on_s3(folder))
    return BenchResult("archive", rows, goals(rows))


def one_and_two(folder: Path, given: str, what: str, count: int, report: Report) -> list[dict[str, Any]]:
    """One worker, two, and two programs, `TURNS` times in turns, so that what else goes on meets all.

    Parameters
    ----------
    folder : Path
        Where the input is, and the datasets go.
    given : str
        The input's name there.
    what : str
        The row's name.
    count : int
        Inputs in it.
    report : callable
        Called with a line of progress.
    """
    found = []
    for turn in range(TURNS):
        for workers in (1, 2, APART):
            report(f"{count} {what}, {workers} workers, turn {turn + 1} of {TURNS} ...")
            out = folder / f"{workers}-{turn}-{given}".replace(" ", "")
            found.append(row(what, workers, count, archived(folder / given, out, workers)))
    return found


# -- What is put in ----------------------------------------------------------------------------


def write_lists(path: Path, count: int) -> None:
    """A Parquet table of so many star lists at random places."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    chance, catalogue = np.random.default_rng(7), open_catalogue()
    camera = Camera.centred(*LIST_PX, LIST_FOCAL_PX)
    lists = []
    for _ in range(count):
        dec = float(np.degrees(np.arcsin(chance.uniform(-1.0, 1.0))))
        attitude = attitude_from(float(chance.uniform(0.0, 360.0)), dec, float(chance.uniform(0.0, 360.0)))
        stars = catalogue.brightest(attitude.boresight, np.radians(7.2), 60)
        xy = camera.project(catalogue.vectors(stars, 2016.0) @ attitude.matrix.T)
        inside = ((xy > 0.0) & (xy < np.array(LIST_PX) - 1.0)).all(axis=1)
        lists.append(np.clip(xy[inside] + chance.normal(0.0, NOISE_PX, (int(inside.sum()), 2)), 0.0, None))
    sizes = {name: [size] * count for name, size in zip(("width", "height"), LIST_PX, strict=True)}
    places = {name: [xy[:, k].tolist() for xy in lists] for k, name in enumerate("xy")}
    pq.write_table(pa.table(places | sizes), path, row_group_size=1000)


def write_frames(folder: Path, count: int) -> None:
    """One frame so many times, each with another pixel changed."""
    folder.mkdir()
    content = bytearray(rendered(folder / "00000.fits", *SMALL).read_bytes())
    for k in range(1, count):
        content[len(content) // 2 + 2 * k] ^= 1
        (folder / f"{k:05d}.fits").write_bytes(content)


# -- Commands ----------------------------------------------------------------------------------


def archived(given: Path | str, out: Path | str, workers: int | str, storage: Mapping[str, Any] | None = None) -> Ran:
    """The command from its start to its end; two that share the inputs for the workers `APART`.

    Parameters
    ----------
    given, out : Path or str
        Its input and its dataset.
    workers : int or str
        Processes.
    storage : Mapping or None
        ``environment`` of the command and ``filesystem`` for pyarrow; None for files here.
    """
    return _watched(given, out, workers, lambda process: 0, storage or {})


def killed(given: Path, out: Path, pauses: tuple[float, float]) -> Ran:
    """The same on two workers, one of which is killed now and then once the first rows are there."""
    import psutil

    chance = random.Random(11)
    state = out / "_kochab" / "run-all.json"
    due = [0.0]

    def kill(process: Any) -> int:
        if time.monotonic() < due[0] or not (state.exists() and json.loads(state.read_text() or "{}").get("done")):
            return 0
        below = [child for child in process.children(recursive=True) if "spawn_main" in " ".join(child.cmdline())]
        due[0] = time.monotonic() + chance.uniform(*pauses)
        if not below:
            return 0
        try:
            chance.choice(below).kill()
        except psutil.Error:
            return 0
        return 1

    return _watched(given, out, 2, kill, {})


def _watched(
    given: Path | str, out: Path | str, workers: int | str, often: Callable[[Any], int], storage: Mapping[str, Any]
) -> Ran:
    """Run a command, or two; ``often`` is called ten times a second until it has returned `KILLS` in sum."""
    import psutil
    import pyarrow.parquet as pq

    started, before, others = time.perf_counter(), os.times(), _used_s(psutil.cpu_times())
    children = children_s()
    peak, kills, due = 0.0, 0, 0.0
    spent: list[tuple[float, float, float]] = []
    shares = [["1", "--shard", f"{k}/2"] for k in (1, 2)] if workers == APART else [[str(workers)]]
    command = [*KOCHAB, "archive", str(given), "--out", str(out), "--json", "--workers"]
    environment = {**os.environ, **storage.get("environment", {})}
    with ExitStack() as running:
        quiet: Any = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
        programs = [running.enter_context(subprocess.Popen([*command, *share], **quiet)) for share in shares]
        seen = [psutil.Process(program.pid) for program in programs]
        while any(program.poll() is None for program in programs):
            try:
                kills += often(seen[0]) if kills < KILLS else 0
                if time.monotonic() >= due:
                    due = time.monotonic() + SAMPLE_S
                    below = [child for one in seen for child in one.children(recursive=True)]
                    spent.append((time.time(), _cpu_s(seen), _cpu_s(below)))
                    peak = max(peak, _memory_mb([*seen, *below]))
            except (psutil.Error, OSError, json.JSONDecodeError):  # one ended, or the state is being replaced
                pass
            time.sleep(0.1)
    wall, after = time.perf_counter() - started, os.times()
    cpu = children_s() - children
    own = after.user + after.system - before.user - before.system
    others = _used_s(psutil.cpu_times()) - others - cpu - own
    table = pq.read_table(str(out).removeprefix("s3://"), filesystem=storage.get("filesystem"))
    return Ran(wall, cpu, peak, table, 100.0 * max(others, 0.0) / (wall * psutil.cpu_count()), kills, spent)


def _used_s(times: Any) -> float:
    """Processor time that was not idle since the computer began, what the host of a virtual machine took included."""
    named = times._asdict()  # guests are counted among users too
    return float(sum(value for name, value in named.items() if name not in ("idle", "iowait", "guest", "guest_nice")))


def _cpu_s(processes: Sequence[Any]) -> float:
    return float(sum(times.user + times.system for times in (process.cpu_times() for process in processes)))


def _memory_mb(processes: Sequence[Any]) -> float:
    """What processes have written (private dirty pages); a catalogue that is mapped the system may drop at will."""
    if not sys.platform.startswith("linux"):
        return float(sum(process.memory_full_info().uss for process in processes)) / 1e6
    return sum(_dirty_kb(Path(f"/proc/{process.pid}/smaps_rollup").read_text()) for process in processes) / 1e3


def _dirty_kb(rollup: str) -> float:
    """What Linux says of a process in sum."""
    return next((1.024 * int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Private_Dirty")), 0.0)


@contextmanager
def _s3(log: Path) -> Iterator[dict[str, Any]]:
    """Moto's server: what a command and pyarrow need to know of it."""
    import pyarrow.fs

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    keys = {"AWS_ACCESS_KEY_ID": "nobody", "AWS_SECRET_ACCESS_KEY": "nothing", "AWS_DEFAULT_REGION": "us-east-1"}
    with log.open("wb") as output:
        server = subprocess.Popen([sys.executable, "-m", "moto.server", "-p", str(port)], stdout=output, stderr=output)
        try:
            until = time.monotonic() + 60.0
            while time.monotonic() < until:
                with socket.socket() as line:
                    if line.connect_ex(("127.0.0.1", port)) == 0:
                        break
                time.sleep(0.05)
            there = pyarrow.fs.S3FileSystem(
                access_key="nobody",
                secret_key="nothing",
                endpoint_override=f"127.0.0.1:{port}",
                scheme="http",
                allow_bucket_creation=True,
            )
            yield {"environment": keys | {"AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}"}, "filesystem": there}
        finally:
            server.terminate()
            server.wait(30)


def on_s3(folder: Path) -> dict[str, Any]:
    """Frames in one bucket, the table in another; with the requests a frame."""
    log = folder / "moto.log"
    with _s3(log) as storage:
        for bucket in ("frames", "tables"):
            storage["filesystem"].create_dir(bucket)
        for file in sorted((folder / "s3").iterdir()):
            with storage["filesystem"].open_output_stream(f"frames/{file.name}") as out:
                out.write(file.read_bytes())
        before = _requests(log)
        ran = archived("s3://frames", "s3://tables/a", 1, storage)
        after = _requests(log)
    return row(ON_S3, 1, S3_FRAMES, ran) | {"requests": (after - before) / S3_FRAMES}


def _requests(log: Path) -> int:
    return log.read_text("utf-8", "replace").count(" HTTP/1.1")


# -- What comes out ----------------------------------------------------------------------------


def row(what: str, workers: int | str, inputs: int, ran: Ran) -> dict[str, Any]:
    """One command's numbers; processor milliseconds are of an input, ``all_ms`` with what starts and gathers.

    ``mid_ms`` is of an input and of all processes while the rate is measured, ``main_percent`` the gathering process's
    share of that, None without workers.

    Parameters
    ----------
    what : str
        What was put in.
    workers : int or str
        Processes.
    inputs : int
        How many were put in.
    ran : Ran
        What came of it.
    """
    urls = ran.rows["url"].to_pylist()
    ended = np.sort(np.array([when.timestamp() for when in ran.rows["done_utc"].to_pylist()]))
    first, last = len(ended) // 10, len(ended) - 1 - len(ended) // 10
    main_ms, below_ms = _middle_ms(ran.spent, ended[first : last + 1])
    return {
        "inputs": what,
        "workers": workers,
        "count": inputs,
        "astray": abs(inputs - len(set(urls))) + len(urls) - len(set(urls)),
        "solved": sum(ran.rows["solved"].to_pylist()),
        "kills": ran.kills,
        "wall_s": ran.wall_s,
        "rate_s": (last - first) / max(ended[last] - ended[first], 1e-9),
        "cpu_ms": 1e3 * float(np.median(ran.rows["cpu_s"].to_pylist())),
        "all_ms": 1e3 * ran.cpu_s / inputs,
        "mid_ms": main_ms + below_ms,
        "main_percent": 100.0 * main_ms / (main_ms + below_ms) if workers == 2 else None,
        "peak_mb": ran.peak_mb,
        "read_kb": float(np.mean(ran.rows["read_bytes"].to_pylist())) / 1e3,
        "busy": ran.busy,
    }


def _middle_ms(spent: Sequence[tuple[float, float, float]], ended: Floats) -> tuple[float, float]:
    """Processor time an input of what was started and of all below it, while inputs ``ended`` (N,), sorted, s.

    Not a number where too few moments were seen, or a worker was lost meanwhile.
    """
    within = [one for one in spent if ended[0] <= one[0] <= ended[-1]]
    if len(within) < 2 or any(later[2] < one[2] for one, later in pairwise(within)):
        return np.nan, np.nan
    _, main, below = np.subtract(within[-1], within[0])
    inputs = max(int(np.searchsorted(ended, within[-1][0]) - np.searchsorted(ended, within[0][0])), 1)
    return 1e3 * float(main) / inputs, 1e3 * float(below) / inputs


def goals(rows: Sequence[Row]) -> list[Goal]:
    """Every input one row, whatever happens; and two workers nearly twice as fast as one."""
    by_name = {one["inputs"]: one for one in rows}

    def of(what: str, name: str) -> float | None:
        return float(by_name[what][name]) if what in by_name else None

    out = [
        Goal.at_least("workers killed at random times", of(KILLED, "kills"), KILLS),
        Goal.at_least("star lists put in meanwhile", of(KILLED, "count"), LISTS),
        Goal.at_most("of these without exactly one row", of(KILLED, "astray"), 0),
        Goal.at_most("frames on S3 without exactly one row", of(ON_S3, "astray"), 0),
    ]
    for what in ("star lists", "1.5 MP frames"):
        ones, twos, apart = (
            [one for one in rows if (one["inputs"], one["workers"]) == (what, n)] for n in (1, 2, APART)
        )
        if not ones or not twos:
            continue
        # the fastest turn of each is the one that was disturbed least
        quiet = max(one["busy"] for one in (*ones, *twos, *apart)) <= QUIET_PERCENT
        one, two, both = (max((each["rate_s"] for each in each_of), default=0.0) for each_of in (ones, twos, apart))
        cpu = min(each["cpu_ms"] for each in ones) / min(each["cpu_ms"] for each in twos)
        all_apart, all_two = (_least([each["mid_ms"] for each in each_of]) for each_of in (apart, twos))
        out.append(Goal.at_least(f"{what}: two workers, times as fast as one", two / one if quiet else None, TWICE))
        out.append(Goal.at_least(f"{what}: the same by processor time", 2.0 * cpu, TWICE))
        machine = both / one if quiet and both else None
        out.append(Goal.at_least(f"{what}: two programs, times as fast as one (this machine's limit)", machine, TWICE))
        share = two / both if quiet and both else None
        out.append(Goal.at_least(f"{what}: two workers, times as fast as two programs", share, OF_MACHINE))
        share = all_apart / all_two if all_apart and all_two else None
        out.append(Goal.at_least(f"{what}: the same by processor time of all processes", share, OF_MACHINE))
        gathers = f"{what}: processor of the process that gathers, percent"
        out.append(Goal.at_most(gathers, _least([each["main_percent"] for each in twos]), MAIN_PERCENT))
    return out


def _least(values: Sequence[float | None]) -> float | None:
    """Of those that were measured."""
    return min((value for value in values if value is not None and np.isfinite(value)), default=None)
