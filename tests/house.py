"""The numbers of the house, read from the code: ``make house`` prints them and fails past a limit."""

import ast
import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from statistics import median

from tests.patterns import REPOSITORY

SOURCE = REPOSITORY / "app" / "kochab"
SAMPLES = REPOSITORY / "resources" / "samples"


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
        timeout=120,
        check=True,
    )
    line = next(line for line in done.stdout.splitlines() if line.startswith("HOUSE "))
    return list(json.loads(line.removeprefix("HOUSE ")))


def executed_by_solve() -> list[str]:
    """Files executed by ``kochab solve`` of one sample frame, as a person types it."""
    sample = min(SAMPLES.glob("*.jpg"), key=lambda path: path.stat().st_size)
    code = "from kochab.cli.main import main\nassert main(sys.argv[1:]) == 0"
    return executed(code, "solve", str(sample), "--json")


SYNCS = """
import sys
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
    files = set()

    def profile(frame, event, argument):
        files.add(frame.f_code.co_filename)

    sys.setprofile(profile)
    done = run(accept_sync(guard, offer, confirmed=True))
    sys.setprofile(None)
    assert done.synced
    assert any(b":CM" in data for way, data in bench.line.transcript)
    guard.close()
print("\\n".join(sorted(f for f in files if "/kochab/" in f.replace("\\\\", "/"))))
"""


def executed_by_sync() -> list[str]:
    """Files with a function that runs between the yes to Sync and the driver's bytes, on a simulated LX200."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(SOURCE.parent), str(REPOSITORY)])}
    done = subprocess.run(
        [sys.executable, "-c", SYNCS],
        cwd=REPOSITORY,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    return done.stdout.split()


def numbers() -> list[Number]:
    """All of them, the dearest last."""
    texts = list(sources().values())
    lengths = [len(text.splitlines()) for text in texts]
    comments = sum(line.lstrip().startswith("#") for text in texts for line in text.splitlines())
    loops, twice, arrays = circles(), classes_twice(), list(array_types_elsewhere())
    solve, sync = executed_by_solve(), executed_by_sync()
    return [
        Number("modules", len(texts), 350),
        Number("lines", sum(lengths), 55_000),
        Number("lines of a module, median", median(lengths)),
        Number("lines of the longest module", max(lengths), 500),
        Number("comment lines in a hundred", round(100 * comments / sum(lengths), 1)),
        Number("circles of imports", len(loops), 0, "\n".join(loops)),
        Number("floors of gear.mounts", floors("kochab.gear.mounts"), 5),
        Number("names of classes that stand twice", len(twice), 8, " ".join(twice)),
        Number("array types named outside core.arrays", len(arrays), 0, " ".join(arrays)),
        Number("lines the formatter must skip", sum(text.count("# fmt: skip") for text in texts), 29),
        Number("files executed by kochab solve", len(solve), 45, " ".join(solve)),
        Number("files from the yes to Sync to the bytes", len(sync), 30, " ".join(sync)),
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
