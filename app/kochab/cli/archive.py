"""``kochab archive INPUT... --out URL``: frames by the million as one Parquet table, a row a frame."""

import argparse
import signal
from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from kochab.cli.batch import attempt
from kochab.cli.options import SEARCH, add_options, options_of, whole
from kochab.cli.output import ProgressLine, tell, with_progress
from kochab.cli.process import say, signals_handled, signals_kept
from kochab.core.errors import UsageError, printable
from kochab.core.progress import Progress
from kochab.core.progress import run as finished
from kochab.core.threads import processors
from kochab.workflows.solution_json import Json

if TYPE_CHECKING:  # they load pyarrow, which the base installation has not
    from kochab.workflows.archive.inputs import Item
    from kochab.workflows.archive.row import Recipe, Session
    from kochab.workflows.archive.run import Chunk, Outcome, Run

NEEDED = ("dask", "distributed", "pyarrow", "fsspec")
HERE_ALONE = "memory://"
PIXELS = (2, 1_000_000, "size in pixels")


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``archive`` to the command line."""
    parser = subparsers.add_parser(
        "archive",
        description="Solves and measures every frame into a Parquet dataset, a row a frame, on Dask. Run it again to"
        " go on where it ended: what has a row is not read again. `kochab archive status URL` tells how far it is."
        " Exit code: 0 done, 1 nothing solved, 2 unusable input, 130 stopped.",
    )
    parser.add_argument(
        "inputs",
        nargs="+",
        metavar="INPUT",
        help="frames, folders, globs, URLs (s3://, https://, ...); tables with a column url, or of star lists;"
        " or: status URL",
    )
    parser.add_argument("--out", metavar="URL", help="folder or URL of the dataset")
    parser.add_argument(
        "--where",
        action="append",
        default=[],
        metavar="COLUMN=VALUE",
        help="do these rows again and nothing else: solved=false, fwhm_px>5, error!=null; may be repeated",
    )
    about = "look for streaks, Solar System bodies and unlisted sources too: about twice the time"
    parser.add_argument("--objects", action="store_true", help=about)
    parser.add_argument("--dask", metavar="ADDRESS", help="Dask scheduler tcp://HOST:PORT, or its scheduler file")
    parser.add_argument("--shard", type=_shard, default=(0, 1), metavar="I/N", help="the I-th of N parts, for cron")
    parser.add_argument("--width", type=whole(*PIXELS), metavar="W", help="frame of star lists x,y[,flux], px")
    parser.add_argument("--height", type=whole(*PIXELS), metavar="H", help="the same, px")
    parser.add_argument(
        "--retries",
        type=whole(0, 20),
        default=2,
        metavar="N",
        help="times a storage that fails is asked again (default: %(default)s)",
    )
    add_options(
        parser, "--workers", default=None, help="processes on this computer; 1 works without Dask (default: one a core)"
    )
    add_options(parser, "--json", "--site", *SEARCH, "--profile", "--detector")
    parser.set_defaults(run=run)


def _shard(text: str) -> tuple[int, int]:
    part, slash, parts = text.partition("/")
    if not (slash and part.isdecimal() and parts.isdecimal() and 1 <= int(part) <= int(parts) <= 100_000):
        raise argparse.ArgumentTypeError(f"{text} is not I/N, as 3/8")
    return int(part) - 1, int(parts)


def run(args: argparse.Namespace) -> int:
    """Do what is left, or tell how far it is."""
    if any(find_spec(name) is None for name in NEEDED):
        raise UsageError("kochab archive needs more packages: pip install 'kochab-astro[archive]'.")
    if args.inputs[0] == "status" and args.out is None:
        return _status(args)
    if args.out is None:
        raise UsageError("Name the dataset with --out FOLDER or URL.")
    if (args.width is None) != (args.height is None):
        raise UsageError("--width and --height come together.")
    this = _prepared(args)
    if not len(this.left):
        this.tell("done")
        return _told(args, this, 0)
    try:
        _work(args, this)
    except KeyboardInterrupt:
        with signals_handled([signal.SIGINT], signal.SIG_IGN):  # pressed twice it ends all the same
            _end(this, "stopped")
            return _told(args, this, 130)
    except BaseException:
        _end(this, "stopped")  # what is solved stays, whatever went wrong
        raise
    _end(this, "done")
    return _told(args, this, int(not this.solved))


def _prepared(args: argparse.Namespace) -> "Run":
    """The run with what is left to do; UsageError before anything is written that could be in the way."""
    from kochab.workflows.archive.dataset import Dataset, condition_of, left_to_do
    from kochab.workflows.archive.inputs import listed
    from kochab.workflows.archive.row import Recipe
    from kochab.workflows.archive.run import Run, other_run

    recipe = Recipe(options_of(args, args.detector), args.site, args.retries + 1, args.objects)
    condition = condition_of(args.where) if args.where else None
    dataset = Dataset.at(args.out, args.shard)
    size = (args.width, args.height) if args.width else None
    inputs = with_progress("archive", listed(args.inputs, size, args.shard))
    dataset.make()
    if (other := other_run(dataset)) is not None:
        raise UsageError(
            "Another run writes {url} (process {pid} on {host}): wait for it, or part the work with --shard.",
            url=args.out,
            pid=other.get("pid"),
            host=other.get("host"),
        )
    index = dataset.index()
    where = dataset.table(("url",), condition, own=True) if condition is not None else None
    left = left_to_do(inputs, index, recipe.digest, where)
    workers = _workers(args)
    return Run(dataset, recipe, len(inputs), left, index, args.dask or f"{workers} here", 1 if workers == 1 else 500)


def _workers(args: argparse.Namespace) -> int:
    """Processes on this computer; 0 where a cluster is named."""
    if args.dask:
        return 0
    if any(str(text).startswith(HERE_ALONE) for text in (args.out, *args.inputs)):
        return 1  # no other process has this one's memory
    if args.workers is None:
        return processors()
    return int(args.workers)


def _work(args: argparse.Namespace, this: "Run") -> None:
    """Take the outcomes of everything that is left."""
    line = ProgressLine("archive")
    this.tell("running")
    line(Progress("start", None, f"{len(this.left)} of {this.total} inputs to do"))
    try:
        with _outcomes(args, this) as outcomes:
            try:
                for outcome in outcomes:
                    with signals_kept():  # a part is written, and its rows forgotten
                        this.take(outcome)
                    line(this.progress)
            finally:
                with signals_kept():
                    this.flush()  # before workers are waited for
    finally:
        line.clear()


@contextmanager
def _outcomes(args: argparse.Namespace, this: "Run") -> "Iterator[Generator[Outcome, None, None]]":
    """What comes of the chunks, from this process or from a cluster."""
    workers = _workers(args)
    if workers == 1:
        with closing(chunk_rows(chunk) for chunk in this.chunks()) as outcomes:
            yield outcomes
        return
    from kochab.cli.cluster import cluster, on_cluster

    with (
        cluster(args.dask, workers) as client,
        closing(on_cluster(client, this.chunks(), chunk_rows, lost_rows)) as got,
    ):
        this.hands = max(client.threads, 1)
        yield got


def chunk_rows(chunk: "Chunk") -> "Outcome":
    """The rows of a chunk, where a worker runs; what goes wrong with an input is in its row."""
    from kochab.workflows.archive.row import failed_row
    from kochab.workflows.archive.run import Outcome

    rows: list[Json] = []
    session = chunk.session
    for item, known in zip(chunk.items, chunk.known, strict=True):
        row = attempt(item.url, partial(_one_row, item, chunk.recipe, session, known))
        session = row.pop("session", session)
        is_row = "recipe" in row or "unchanged" in row
        rows.append(row if is_row else failed_row(item, chunk.recipe, row["error"], quarantined=True))
    return Outcome(chunk.items[0].folder, rows, session)


def _one_row(item: "Item", recipe: "Recipe", session: "Session | None", known: str) -> Json:
    """An input's row, and under ``"session"`` what the next ones of the chunk may start from."""
    from kochab.workflows.archive.row import UnreachableError, failed_row, row_of

    try:
        row, after = finished(row_of(item, recipe, session, known))
    except UnreachableError as error:
        return failed_row(item, recipe, str(error), quarantined=False)
    return {**row, "session": after}


def lost_rows(chunk: "Chunk") -> "Outcome":
    """What is said of an input that ended its worker each time."""
    from kochab.cli.cluster import KILLED
    from kochab.workflows.archive.row import failed_row
    from kochab.workflows.archive.run import Outcome

    return Outcome(chunk.items[0].folder, [failed_row(item, chunk.recipe, KILLED, True) for item in chunk.items])


def _end(this: "Run", word: str) -> None:
    """Write what is gathered, and leave the dataset tidy where no other run is under way."""
    this.flush()
    this.tell(word)
    others = [name for name, state in this.dataset.states().items() if state.get("state") == "running"]
    if this.dataset.shard == "all" and not others and word == "done":
        this.dataset.tidy()


def _told(args: argparse.Namespace, this: "Run", code: int) -> int:
    from kochab.workflows.archive.dataset import PAGE

    before = this.total - len(this.left)
    fields: Json = {
        **{"out": args.out, "inputs": this.total, "before": before, "done": this.done, "solved": this.solved},
        **{"failed": this.failed, "stopped": code == 130, "page": f"{args.out.rstrip('/')}/{PAGE}"},
    }
    lines = [args.out, f"{this.done} of {this.total} inputs done now, {this.solved} solved"]
    lines += [f"{before} were done before"] if before else []
    lines += [f"{this.failed} failed: kochab archive status {args.out}"] if this.failed else []
    lines += ["stopped: the same command goes on from here"] if code == 130 else []
    tell(fields, "\n  ".join(map(printable, lines)), args.json)
    return code


# -- ``kochab archive status URL`` -------------------------------------------------------------


def _status(args: argparse.Namespace) -> int:
    """How far the dataset is; 1 when it has no row yet."""
    from kochab.workflows.archive.dataset import Dataset
    from kochab.workflows.archive.status import page_of, summary_of

    if len(args.inputs) != 2:
        raise UsageError("kochab archive status URL: name one dataset.")
    url = args.inputs[1]
    dataset = Dataset.at(url)
    if not dataset.parts() and not dataset.states():
        raise UsageError("{url} is no archive.", url=url)
    summary = summary_of(dataset)
    try:
        dataset.write_page(page_of(summary, url))
    except OSError as error:  # who may only read it is told all the same
        say(f"The page cannot be written: {error.strerror or error}.")
    tell({"url": url, **summary}, _status_text(url, summary), args.json)
    return int(not summary["rows"])


def _status_text(url: str, summary: Json) -> str:
    from kochab.workflows.archive.dataset import PAGE

    lines = [url, f"{summary['rows']} rows, {summary['solved']} solved"]
    lines += [f"{count} {reason}" for reason, count in summary["unsolved"].items()]
    lines += [f"{summary['calibration']} darks, flats and biases"] * bool(summary["calibration"])
    lines += [f"{summary['quarantined']} quarantined"] * bool(summary["quarantined"])
    lines += [f"  {one['error']}" for one in summary["quarantine"][:5]]
    lines += [f"{summary['to_retry']} could not be reached; the next run tries again"] * bool(summary["to_retry"])
    if summary["mean_cpu_s"] is not None:
        read = (summary["mean_read_bytes"] or 0) / 1e6
        lines.append(f"{1e3 * summary['mean_cpu_s']:.0f} ms of processor and {read:.1f} MB read a frame")
    for name, one in summary["runs"].items():
        lines.append(f"run {name}: {one['state']}, {one['done']} of {one['to_do']}, {one['rate_s']:.3g} a second")
    return "\n  ".join(map(printable, [*lines, f"page: {url.rstrip('/')}/{PAGE}"]))
