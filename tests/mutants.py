"""Deliberate bugs, and whether the tests notice: ``make mutants`` (``python -m tests.mutants --help``).

One place of one module is changed at a time, in a copy. A first run of the tests, without any change, records
which lines each test executes and how long it takes; a change is then tried with the tests that execute its
line, quickest first, until one fails. A change that every test survives is printed: either a test is missing,
or the change means nothing. The choice is random with a seed, so that a run can be repeated.
"""

import argparse
import ast
import hashlib
import json
import math
import multiprocessing
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import threading
from collections import defaultdict
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from itertools import islice
from pathlib import Path
from time import monotonic
from types import FrameType
from typing import Any, TypeGuard

import pytest

from tests.house import SOURCE, sources
from tests.patterns import REPOSITORY, choose_folder

ROOMS = ("kochab.gear.mounts", "kochab.attitude", "kochab.solver", "kochab.polar")
MOST_SURVIVING = 0.15
MOST_TESTS_S = 60.0  # of tests for one change: the quickest come first
SLOW = ("window", "lab/bench")  # tests that look at a room from far above
LIBRARIES = (
    *("astropy.wcs", "erfa", "PySide6.QtWidgets", "scipy.optimize", "scipy.spatial.transform", "scipy.special"),
    *("hypothesis.strategies", "pytestqt.plugin", "xdist.plugin"),  # plugins, which pytest would rewrite each time
)
KEPT = REPOSITORY / ".pytest_cache" / "mutants"  # what tests execute, between two runs
PRELOADED = ("-W", "ignore::pytest.PytestAssertRewriteWarning")
START_S = 60.0  # on a busy machine, until the first test runs
SLOWER = 4.0  # than when recorded: a change after which the tests take longer has been noticed

SWAPS: dict[type, type] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
}


@dataclass(frozen=True)
class Mutant:
    """A module's whole text with one change; ``line`` and ``change`` say which.

    ``lines`` are those of its statement; ``name`` is the constant, field or cached function whose value changes
    when it is no statement of an ordinary function, else empty.
    """

    module: str
    line: int
    change: str
    text: str
    lines: frozenset[int]
    name: str


IDLE = {"erfa.sp00": (1,), "erfa.apco": (1,), "erfa.apio": (0, 1, 2)}
"""Function -> places of arguments that change no digit: a day, of what changes in a century or moves stars that have no
motion of their own; a turn about the pole, of the place of the pole."""
NOT_TRIED = ("dataclass", "suppress", "TypeVar", "lru_cache", "Progress")
GUARD = 1e-6
TURNED_ROUND: dict[type, type] = {ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt}
UNITS = re.compile(r"(^|_)(deg|rad|arcsec|arcmin|px2?|s|ms|turns|share|sigma|sigmas)$|^(sigma|chi2|angle|length)$")


@cache
def _float_constants() -> frozenset[str]:
    """The package's constants that are no whole numbers."""
    found = set()
    for text in sources().values():
        for node in ast.parse(text).body:
            if isinstance(node, ast.Assign) and any(_is_float(part) for part in ast.walk(node.value)):
                found |= {part.id for part in ast.walk(node.targets[0]) if isinstance(part, ast.Name)}
    return frozenset(name for name in found if name.isupper())


def _is_float(node: ast.AST) -> TypeGuard[ast.Constant]:
    return isinstance(node, ast.Constant) and isinstance(node.value, float)


def _measured(node: ast.AST) -> bool:
    """Whether a term is a measured number, by its unit, its constant or its literal."""
    name = node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""
    inside = any(_is_float(n) or (isinstance(n, ast.Name) and n.id in _float_constants()) for n in ast.walk(node))
    divided = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div)
    squared = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow) and _measured(node.left)
    return inside or divided or squared or UNITS.search(name) is not None


def _changes(node: ast.AST) -> Iterator[ast.AST]:
    """What may stand in the place of ``node``.

    Two measured numbers are never quite equal, so that ``<`` and ``<=`` are the same there: such a
    comparison is turned round.
    """
    if isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPS:
        new, swap = deepcopy(node), SWAPS
        if type(node.ops[0]) in TURNED_ROUND and any(_measured(term) for term in (node.left, *node.comparators)):
            swap = TURNED_ROUND
        new.ops[0] = swap[type(node.ops[0])]()
        yield new
    elif isinstance(node, ast.BoolOp | ast.BinOp) and type(node.op) in SWAPS:
        new = deepcopy(node)
        new.op = SWAPS[type(node.op)]()
        yield new
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        yield node.operand
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield ast.Constant(not node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        yield ast.Constant(node.value * 2 if node.value else 1)
    elif isinstance(node, ast.Return) and ast.unparse(node) not in ("return", "return None"):
        yield ast.Return(ast.Constant(None))
    elif (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)) or isinstance(node, ast.Raise):
        yield ast.Pass()


def _skipped(tree: ast.Module) -> set[int]:
    """Nodes whose change no test could notice, or should.

    Annotations, Protocols, what a dataclass, a cache or a progress report is given; how far JSON is indented; asserts and ``strict=`` of a zip, which only check
    the code itself; numbers within the sentence of an error; ``axis=-1``, which is 1 of a table; a millionth and
    less, which twice as large, or with the other sign, guards a division or ends an iteration as well.
    """
    found: set[int] = set()
    for node in ast.walk(tree):
        parts: list[ast.AST | None] = []
        if isinstance(node, ast.arg | ast.AnnAssign):
            parts.append(node.annotation)
        if isinstance(node, ast.FunctionDef):
            parts.append(node.returns)
        if isinstance(node, ast.ClassDef) and any("Protocol" in ast.unparse(b) for b in node.bases):
            parts.append(node)
        if isinstance(node, ast.Call) and ast.unparse(node.func) in NOT_TRIED:
            parts.append(node)
        if isinstance(node, ast.Call):
            parts += _idle_arguments(node)
        if isinstance(node, ast.Raise):
            parts.append(node.exc)
        if isinstance(node, ast.Assert):
            parts.append(node)
        if isinstance(node, ast.keyword) and (node.arg in ("strict", "indent") or ast.unparse(node) == "axis=-1"):
            parts.append(node)
        if _guards(node):
            parts.append(node)
        found |= {id(n) for part in parts if part is not None for n in ast.walk(part)}
        if isinstance(node, ast.BinOp) and any(_guards(term) for term in (node.left, node.right)):
            found.add(id(node))
    return found | _without_effect(tree)


def _idle_arguments(call: ast.Call) -> list[ast.AST | None]:
    """Numbers that no result depends on: of :data:`IDLE`, the limits of a sine, which rounding alone passes, and -1 of
    ``reshape``, which takes any negative number for the length that is left."""
    name = ast.unparse(call.func)
    found: list[ast.AST | None] = [call.args[k] for k in IDLE.get(name, ())]
    if name.endswith("reshape"):
        found += [arg.operand for arg in call.args if ast.unparse(arg) == "-1" and isinstance(arg, ast.UnaryOp)]
    if name == "np.clip" and [ast.unparse(arg) for arg in call.args[1:]] == ["-1.0", "1.0"]:
        found += call.args[1:]
    if name == "np.arcsin" and (limit := call.args[0]) and ast.unparse(limit).startswith("min(1.0, "):
        found.append(limit.args[0] if isinstance(limit, ast.Call) else None)
    return found


def _guards(node: ast.AST) -> bool:
    return _is_float(node) and 0.0 < float(str(node.value)) <= GUARD


def _without_effect(tree: ast.Module) -> set[int]:
    """Whole numbers that no result depends on, doubled.

    The most rounds of a calculation that ends by itself (tries at a device, which may fail, count), the nodes of a
    quadrature that has more than it needs, and the 1 of ``max(len(x), 1)``, which guards a division.
    """
    found, limits = set(), set()
    for node in ast.walk(tree):
        inside = {type(inner) for inner in ast.walk(node)}
        ends = isinstance(node, ast.For) and ast.Break in inside and ast.Try not in inside
        if ends and (most := re.fullmatch(r"range\((\w+)\)", ast.unparse(node.iter))):
            limits.add(most[1])
            found |= {id(part) for part in ast.walk(node.iter)}
        if isinstance(node, ast.Call) and re.fullmatch(r".*laggauss\(\d+\)|max\(len\(\w+\), 1\)", ast.unparse(node)):
            found |= {id(argument) for argument in node.args}
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) in limits:
            found.add(id(node.value))
    return found


class _Replace(ast.NodeTransformer):
    def __init__(self, old: ast.AST, new: ast.AST) -> None:
        self.old, self.new = old, new

    def visit(self, node: ast.AST) -> ast.AST:
        return self.new if node is self.old else self.generic_visit(node)


def places(module: str) -> Iterator[tuple[str, int, int]]:
    """Where a module can be changed: its name, the number of a node, and which change of that node."""
    tree = ast.parse(sources()[module])
    skipped = _skipped(tree)
    for number, node in enumerate(ast.walk(tree)):
        if id(node) not in skipped:
            yield from ((module, number, k) for k, _ in enumerate(_changes(node)))


def mutant(module: str, number: int, which: int) -> Mutant:
    """The change of one place."""
    tree = ast.parse(sources()[module])
    node = next(islice(ast.walk(tree), number, None))
    new = ast.fix_missing_locations(next(islice(_changes(node), which, None)))
    change = f"{ast.unparse(node)}  ->  {ast.unparse(new)}".replace("\n", " ")[:150]
    line = getattr(node, "lineno", 0)
    lines, name = _statement(tree, node)
    text = ast.unparse(ast.fix_missing_locations(_Replace(node, new).visit(tree)))
    return Mutant(module, line, change, text, lines, name)


def _statement(tree: ast.Module, wanted: ast.AST) -> tuple[frozenset[int], str]:
    """The lines of the statement that holds a node, and the name that it gives a value outside of functions."""
    chain: list[ast.AST] = [tree]
    while chain[-1] is not wanted:
        chain.append(next(c for c in ast.iter_child_nodes(chain[-1]) if any(n is wanted for n in ast.walk(c))))
    statements = [node for node in chain if isinstance(node, ast.stmt)]
    last = statements[-1]
    part: ast.stmt | ast.expr = last  # of a statement with others inside only what stands in its head
    if isinstance(getattr(last, "body", None), list):
        part = next((node for node in chain[chain.index(last) + 1 :] if isinstance(node, ast.expr)), last)
    lines = frozenset({last.lineno, *range(part.lineno, (part.end_lineno or part.lineno) + 1)})
    functions = [node for node in statements if isinstance(node, ast.FunctionDef)]
    if functions and functions[-1] is not last:
        kept = [f.name for f in functions if any("cache" in ast.unparse(d) for d in f.decorator_list)]
        return lines, kept[0] if kept else ""
    if isinstance(last, ast.Assign | ast.AnnAssign):
        return lines, ast.unparse(last.targets[0] if isinstance(last, ast.Assign) else last.target)
    return lines, getattr(last, "name", "import")


@cache
def test_texts() -> dict[Path, str]:
    """Every test file with its text, read once for all mutants."""
    return {path: path.read_text(encoding="utf-8") for path in sorted(REPOSITORY.glob("tests/**/test_*.py"))}


def tests_of(module: str) -> list[Path]:
    """The test files of the module's own room; those elsewhere that name it only when none of the room does."""
    room = module.split(".")[1:]
    folders = [REPOSITORY.joinpath("tests", *room[:k]) for k in range(len(room), 0, -1)]
    own = next(folder for folder in folders if folder.is_dir())
    direct = (f"from {module} ", f"{module}.", f"import {module}")
    named = {path for path, text in test_texts().items() if any(words in text for words in direct)}
    inside = {path for path in test_texts() if own in path.parents}
    slow = {path for path in named if any(REPOSITORY / "tests" / folder in path.parents for folder in SLOW)}
    return sorted(inside if named & inside else inside | (named - slow))


class Copy:
    """A copy of the program in which one module at a time is changed."""

    def __init__(self, folder: Path) -> None:
        self.app = folder / "app"
        shutil.copytree(SOURCE, self.app / "kochab", ignore=shutil.ignore_patterns("__pycache__"))
        for name in ("catalogs", "resources"):
            (folder / name).symlink_to(REPOSITORY / name)

    def pytest(self, tests: list[str], timeout_s: float | None, *options: str) -> int:
        """Run tests against the copy; what pytest returns, or -1 when they did not end in time."""
        arguments = ["-q", "-n", "0", "-p", "no:cacheprovider", "--hypothesis-seed=0", *PRELOADED, *options, *tests]
        process = multiprocessing.get_context("fork").Process(target=_pytest, args=(self.app, arguments))
        process.start()
        process.join(timeout_s)
        if process.is_alive() and process.pid is not None:
            os.killpg(process.pid, signal.SIGKILL)  # with what the tests have started
            process.join()
            return -1
        return process.exitcode or 0


def _pytest(app: Path, arguments: list[str]) -> None:
    """In a process of its own, which has the libraries already: they take longer than most tests."""
    os.setsid()
    paths = [str(app), str(REPOSITORY)]
    os.environ |= {"PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": "1", "QT_QPA_PLATFORM": "offscreen"}
    sys.dont_write_bytecode = True
    sys.path[:0] = paths
    os.chdir(REPOSITORY)
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    os._exit(pytest.main(["-o", f"pythonpath={app} {REPOSITORY}", *arguments]))


# -- Which tests execute which lines -----------------------------------------------------------


class Recorder:
    """A plugin of pytest: of every test that passes, how long it takes and which lines it executes."""

    def __init__(self, app: Path, modules: list[str], output: Path) -> None:
        self.output = output
        self.modules = {str(app / _path(module)): module for module in modules}
        self.lines: dict[str, set[int]] = defaultdict(set)
        self.passed: dict[str, dict[str, Any]] = {}
        self.failed: set[str] = set()
        self.skipped: set[str] = set()

    def _trace(self, frame: FrameType, _event: str, _argument: object) -> Any:
        found = self.modules.get(frame.f_code.co_filename)
        if found is None or frame.f_code.co_name == "<module>":
            return None
        add = self.lines[found].add

        def local(frame: FrameType, event: str, _argument: object) -> Any:
            if event == "line":
                add(frame.f_lineno)
            return local

        return local

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Trace one test with its fixtures."""
        self.lines = defaultdict(set)
        start = monotonic()
        threading.settrace(self._trace)
        sys.settrace(self._trace)
        try:
            result = yield
        finally:
            sys.settrace(None)
            threading.settrace(None)  # type: ignore[arg-type]
        lines = {module: sorted(numbers) for module, numbers in self.lines.items()}
        self.passed[item.nodeid] = {"duration_s": monotonic() - start, "lines": lines}
        return result

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Leave out what fails or is skipped without any change."""
        if not report.passed:
            (self.failed if report.failed else self.skipped).add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        """Write what was recorded."""
        out = self.failed | self.skipped
        kept = {test: found for test, found in self.passed.items() if test not in out and found["lines"]}
        self.output.write_text(json.dumps({"tests": kept, "failed": sorted(self.failed)}), encoding="utf-8")


def pytest_configure(config: pytest.Config) -> None:
    """Record when this module is a plugin of a run that :func:`recorded` starts."""
    if wish := os.environ.get("KOCHAB_RECORD_LINES"):
        app, output, *modules = json.loads(wish)
        config.pluginmanager.register(Recorder(Path(app), modules, Path(output)))


def _path(module: str) -> Path:
    place = Path(*module.split("."))
    return place / "__init__.py" if (SOURCE.parent / place).is_dir() else place.with_suffix(".py")


def _mark(path: Path, modules: list[str]) -> str:
    """What changes with a test file, with what the tests share, and with the modules."""
    others = sorted(set(REPOSITORY.glob("tests/**/*.py")) - test_texts().keys() - {Path(__file__)})
    texts = [
        path.relative_to(REPOSITORY).as_posix(),
        path.read_text(encoding="utf-8"),
        *(other.read_text(encoding="utf-8") for other in others),
    ]
    return hashlib.sha256("\0".join([*texts, *(sources()[module] for module in modules)]).encode()).hexdigest()[:24]


class Coverage:
    """The tests of some modules, each with its duration and the lines that it executes.

    What was recorded is kept, a test file at a time, until that file, what it shares with others or the modules change.
    """

    def __init__(self, copy: Copy, modules: list[str], folder: Path) -> None:
        files = sorted({path for module in modules for path in tests_of(module)})
        kept = {path: KEPT / f"{_mark(path, modules)}.json" for path in files}
        if missing := [path for path in files if not kept[path].exists()]:
            self._record(
                copy,
                modules,
                folder / "lines.json",
                {str(path.relative_to(REPOSITORY)): kept[path] for path in missing},
            )
        found = [json.loads(kept[path].read_text(encoding="utf-8")) for path in files]
        self.failed = [test for one in found for test in one["failed"]]
        tests = {test: one for file in found for test, one in file["tests"].items()}
        self.durations_s = {test: one["duration_s"] for test, one in tests.items()}
        self.lines = {t: {m: set(n) for m, n in one["lines"].items()} for t, one in tests.items()}

    def _record(self, copy: Copy, modules: list[str], output: Path, kept: dict[str, Path]) -> None:
        """Run test files once and keep what each of them executes."""
        os.environ["KOCHAB_RECORD_LINES"] = json.dumps([str(copy.app), str(output), *modules])
        copy.pytest([str(REPOSITORY / name) for name in kept], None, "-p", "tests.mutants")
        del os.environ["KOCHAB_RECORD_LINES"]
        found = json.loads(output.read_text(encoding="utf-8"))
        KEPT.mkdir(parents=True, exist_ok=True)
        for name, path in kept.items():
            tests = {test: one for test, one in found["tests"].items() if test.startswith(f"{name}::")}
            failed = [test for test in found["failed"] if test.startswith(f"{name}::")]
            path.write_text(json.dumps({"tests": tests, "failed": failed}), encoding="utf-8")

    def tests(self, bug: Mutant) -> list[str]:
        """The tests that may notice a change, quickest first, as many as there is time for."""
        wanted = {bug.module: bug.lines}
        if bug.name:
            word = re.compile(rf"\b{re.escape(bug.name)}\b")
            for module in {module for found in self.lines.values() for module in found}:
                numbered = enumerate(sources()[module].splitlines(), start=1)
                wanted[module] = frozenset(number for number, line in numbered if word.search(line))
        exact = {t for t, found in self.lines.items() if any(found.get(m, set()) & n for m, n in wanted.items())}
        # What uses a constant may hide behind another name: then all tests of the module come last.
        near = {t for t, found in self.lines.items() if bug.module in found} if bug.name else set()
        chosen, left_s = [], MOST_TESTS_S
        for test in sorted(exact | near, key=lambda t: (t not in exact, self.durations_s[t])):
            left_s -= self.durations_s[test]
            if left_s < 0.0 and chosen:
                break
            chosen.append(test)
        return chosen

    def survives(self, copy: Copy, bug: Mutant) -> bool:
        """Whether all tests pass with the change."""
        tests = self.tests(bug)
        if not tests:
            return True
        limit_s = START_S + SLOWER * sum(self.durations_s[test] for test in tests)
        file = copy.app / _path(bug.module)
        before = file.read_text(encoding="utf-8")
        file.write_text(bug.text, encoding="utf-8")
        try:
            return copy.pytest(tests, limit_s, "-x") == 0
        finally:
            file.write_text(before, encoding="utf-8")


def interval(part: int, whole: int) -> tuple[float, float]:
    """The 95 % interval of a share (Wilson 1927, J. Am. Stat. Assoc. 22, 209)."""
    z, n, p = 1.96, max(1, whole), part / max(1, whole)
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return max(0.0, middle - half), min(1.0, middle + half)


def try_room(room: str, count: int, seed: int, end: float) -> tuple[int, int]:
    """How many changes of a room or module were tried, and how many survived; each survivor is printed."""
    chosen = [m for m in sources() if f"{m}.".startswith(f"{room}.")]
    pool = [place for module in chosen for place in places(module)]
    random.Random(seed).shuffle(pool)
    survived = tried = 0
    with tempfile.TemporaryDirectory(prefix="kochab-mutants-") as folder:
        copy = Copy(Path(folder))
        whole = next((name for name in ROOMS if f"{room}.".startswith(f"{name}.")), room)
        coverage = Coverage(copy, [m for m in sources() if f"{m}.".startswith(f"{whole}.")], Path(folder))
        for test in coverage.failed:
            print(f"left out, it does not pass without a change: {test}", flush=True)
        for place in pool[:count]:
            if monotonic() > end:
                break
            bug = mutant(*place)
            tried += 1
            if coverage.survives(copy, bug):
                survived += 1
                tests = len(coverage.tests(bug))
                print(f"{tried}: SURVIVED {bug.module}:{bug.line}: {bug.change} ({tests} tests)", flush=True)
    low, high = interval(survived, tried)
    print(f"{room}: {tried} of {len(pool)} mutants tried, {tried - survived} killed, {survived} survived:", end=" ")
    print(f"{100 * survived / max(1, tried):.0f} % (95 %: {100 * low:.0f} to {100 * high:.0f} %)", flush=True)
    return tried, survived


def main() -> int:
    """Try mutants until their number or the time is used up; 1 when too many survive."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("rooms", nargs="*", help="rooms or modules; the default is what matters most")
    parser.add_argument("--count", type=int, default=25, help="mutants of each room to try (25)")
    parser.add_argument("--minutes", type=float, default=30.0, help="stop after this time (30)")
    parser.add_argument("--seed", type=int, default=1)
    wanted = parser.parse_args()
    choose_folder()
    for library in LIBRARIES:
        import_module(library)
    rooms = wanted.rooms or ROOMS
    start, share_s = monotonic(), 60.0 * wanted.minutes / len(rooms)
    results = [try_room(room, wanted.count, wanted.seed, start + share_s * k) for k, room in enumerate(rooms, start=1)]
    tried, survived = (sum(column) for column in zip(*results, strict=True))
    share = survived / max(1, tried)
    print(f"{tried} mutants, {survived} survived: {100 * share:.0f} % (at most {100 * MOST_SURVIVING:.0f} %)")
    return int(share > MOST_SURVIVING)


if __name__ == "__main__":
    sys.exit(main())
