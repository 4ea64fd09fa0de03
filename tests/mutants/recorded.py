"""Which tests execute which lines, in a copy of the program; kept between two runs."""

import ast
import compileall
import hashlib
import json
import multiprocessing
import os
import re
import resource
import shutil
import signal
import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import monotonic, process_time
from typing import Any

import coverage
import pytest

from tests.house import SOURCE, imports, sources, tree
from tests.mutants.changes import Mutant
from tests.patterns import REPOSITORY

KEPT = REPOSITORY / ".pytest_cache" / "mutants"
PRELOADED = ("-W", "ignore::pytest.PytestAssertRewriteWarning")
LONGEST_TEST_S, LONGEST_FILE_S = 6.0, 60.0
"""Processor time of a test, above which it judges no change; and of the tests of one file that are recorded."""
PATIENCE_S = 60.0  # for one test, on the clock of a busy machine
MOST_FILES = 24  # of one group, the smallest
FAR = ("window", "lab/bench")  # tests that look at other rooms from far above


# -- A copy in which a module is changed -------------------------------------------------------


@dataclass(frozen=True)
class Ended:
    """How tests ended against a copy: pytest's code, None after the limit on the clock; and the processor's time."""

    code: int | None
    processor_s: float


class Copy:
    """A copy of the program in which one module at a time is changed.

    It holds the bytecode of all others: compiling them took longer than most tests.
    """

    def __init__(self, folder: Path) -> None:
        self.app = folder / "app"
        compileall.compile_dir(SOURCE, quiet=2)
        shutil.copytree(SOURCE, self.app / "kochab")
        for name in ("catalogs", "resources"):
            (folder / name).symlink_to(REPOSITORY / name)

    @contextmanager
    def changed(self, module: str, text: str) -> Iterator[None]:
        """Change a module's text for a while; then it is as before, its time of modification included."""
        file = self.app / path_of(module)
        before, at = file.read_bytes(), file.stat()
        file.write_text(text, encoding="utf-8")
        try:
            yield
        finally:
            file.write_bytes(before)
            os.utime(file, ns=(at.st_atime_ns, at.st_mtime_ns))

    def pytest(self, tests: list[str], processor_s: float, limit_s: float, *options: str) -> Ended:
        """Run tests against the copy in their order, in a process forked from this one, which has the libraries.

        A change after which they never end is told by the processor's time: a busy machine does not use it up.
        """
        arguments = ["-q", "-n", "0", "-p", "no:cacheprovider", "--hypothesis-seed=0", *PRELOADED, *options, *tests]
        process = multiprocessing.get_context("fork").Process(
            target=_pytest, args=(self.app, processor_s, arguments, tests)
        )
        before = children_s()
        process.start()
        process.join(limit_s)
        late = process.is_alive()
        if late and process.pid is not None:
            os.killpg(process.pid, signal.SIGKILL)  # with what the tests have started
            process.join()
        return Ended(None if late else process.exitcode or 0, children_s() - before)


def children_s() -> float:
    """Processor time of all children that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


class InOrder:
    """A plugin of pytest: the tests in the order in which they were asked for."""

    def __init__(self, tests: list[str]) -> None:
        self.place = {test: k for k, test in enumerate(tests)}

    @pytest.hookimpl(wrapper=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> Iterator[None]:
        """Sort them once everyone else has."""
        yield
        items.sort(key=lambda item: self.place.get(item.nodeid, -1))


def _pytest(app: Path, processor_s: float, arguments: list[str], tests: list[str]) -> None:
    os.setsid()
    resource.setrlimit(resource.RLIMIT_CPU, (round(processor_s), round(processor_s) + 5))
    paths = [str(app), str(REPOSITORY)]
    os.environ |= {"PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": "1", "QT_QPA_PLATFORM": "offscreen"}
    sys.dont_write_bytecode = True
    sys.path[:0] = paths
    os.chdir(REPOSITORY)
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    os._exit(pytest.main(["-o", f"pythonpath={app} {REPOSITORY}", *arguments], plugins=[InOrder(tests)]))


def path_of(module: str) -> Path:
    """A module's file, from the folder that holds the package."""
    place = Path(*module.split("."))
    return place / "__init__.py" if (SOURCE.parent / place).is_dir() else place.with_suffix(".py")


# -- What a run of the tests records -----------------------------------------------------------


class TooLong(BaseException):
    """A test takes longer than a judge may; neither a test nor Hypothesis catches it."""


class Recorder:
    """A plugin of pytest: of every test that passes, how long it takes and which lines it executes."""

    def __init__(self, app: Path, output: Path) -> None:
        self.app, self.output = app, output
        self.end = process_time() + LONGEST_FILE_S
        self.measured = coverage.Coverage(data_file=None, config_file=False, source=[str(app)], messages=False)
        self.durations_s: dict[str, tuple[float, float]] = {}
        self.out: set[str] = set()
        self.failed: set[str] = set()
        signal.signal(signal.SIGPROF, self._stop)
        self.measured.start()

    def _stop(self, *_: object) -> None:
        raise TooLong

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Everything so far was imports."""
        self.measured.switch_context("imports")

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Measure one test with its fixtures."""
        start, used = monotonic(), process_time()
        self.measured.switch_context(item.nodeid)
        result = yield
        self.measured.switch_context("between")
        self.durations_s[item.nodeid] = monotonic() - start, process_time() - used
        return result

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """What a fixture of the module does, it does for all of them."""
        if process_time() > self.end:
            pytest.skip("no time is left")
        self.measured.switch_context("fixtures")

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        """The test itself, while it takes no longer than it may."""
        self.measured.switch_context(item.nodeid)
        signal.setitimer(signal.ITIMER_PROF, LONGEST_TEST_S)
        try:
            return (yield)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)

    def pytest_exception_interact(self, call: pytest.CallInfo[None], report: object) -> None:
        """Tell what failed from what was too long."""
        slow = call.excinfo is not None and call.excinfo.errisinstance(TooLong)
        if isinstance(report, pytest.TestReport) and not slow:
            self.failed.add(report.nodeid)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Leave out what fails or is skipped without any change."""
        if not report.passed:
            self.out.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        """Write what was recorded."""
        self.measured.stop()
        data = self.measured.get_data()
        passed = {test: seconds for test, seconds in self.durations_s.items() if test not in self.out}
        lines: dict[str, dict[str, list[int]]] = {test: defaultdict(list) for test in passed}
        for module in sources():
            found = data.contexts_by_lineno(str(self.app / path_of(module)))
            executable = inside_functions(module) if found else frozenset()
            for number, contexts in found.items():
                if number in executable:
                    for test in passed if "fixtures" in contexts else set(contexts) & passed.keys():
                        lines[test][module].append(number)
        tests = {
            test: {"duration_s": duration, "processor_s": used, "lines": lines[test]}
            for test, (duration, used) in passed.items()
            if lines[test]
        }
        self.output.write_text(json.dumps({"tests": tests, "failed": sorted(self.failed)}), encoding="utf-8")


@cache
def inside_functions(module: str) -> frozenset[int]:
    """The lines that an import of the module does not execute."""
    found: set[int] = set()
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            body = node.body if isinstance(node.body, list) else [node.body]
            found |= set(range(body[0].lineno, (node.end_lineno or node.lineno) + 1))
    return frozenset(found)


def pytest_configure(config: pytest.Config) -> None:
    """Record when this module is a plugin of a run that :class:`Recordings` starts."""
    if wanted := os.environ.get("KOCHAB_RECORD_LINES"):
        app, output = json.loads(wanted)
        config.pluginmanager.register(Recorder(Path(app), Path(output)))


# -- The tests that may notice a change --------------------------------------------------------


@cache
def test_texts() -> dict[Path, str]:
    """Every test file with its text, read once for all mutants."""
    return {path: path.read_text(encoding="utf-8") for path in sorted(REPOSITORY.glob("tests/**/test_*.py"))}


@cache
def _names() -> dict[str, set[Path]]:
    """The package's modules and what is in them -> the test files that name it."""
    found: dict[str, set[Path]] = defaultdict(set)
    for path, text in test_texts().items():
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom) and node.module:
                for name in (node.module, *(f"{node.module}.{alias.name}" for alias in node.names)):
                    found[name].add(path)
        for name in re.findall(r"kochab(?:\.\w+)+", text):  # such as what is patched
            for parent in (name, name.rpartition(".")[0]):
                found[parent].add(path)
    return found


@cache
def _named(module: str) -> frozenset[Path]:
    return frozenset(_names().get(module, ()))


@cache
def _mirror(module: str) -> set[Path]:
    """The files of tests that bear the module's name, in its room's folder or one above."""
    *rooms, name = module.split(".")[1:] or ["start"]
    folders = [REPOSITORY.joinpath("tests", *rooms[:k]) for k in range(len(rooms), -1, -1)]
    return {path for path in test_texts() if path.parent in folders and path.stem.startswith(f"test_{name}")}


@cache
def tests_of(module: str) -> list[list[Path]]:
    """The test files that judge a module, in the order in which they are asked.

    Those that mirror it or name it in its own room; those of its room that name what imports it; those elsewhere that
    name it, and the mirrors of what imports it. Mirrors far above come later, and only where nothing
    else is; last what uses the library as other programs do.
    """
    room = module.split(".")[1:]
    folders = [REPOSITORY.joinpath("tests", *room[:k]) for k in range(len(room), 0, -1)]
    own = next((folder for folder in folders if folder.is_dir()), REPOSITORY / "tests")
    inside = {path for path in test_texts() if own in path.parents}
    named = _named(module)
    first = _mirror(module) | (named & inside)
    above = [other for other in sources() if module in imports(other)]
    inside = inside & set().union(first, *(_named(other) for other in above)) or inside
    elsewhere = set().union(*(_mirror(other) for other in above), named)
    far = {path for path in elsewhere if any(REPOSITORY / "tests" / folder in path.parents for folder in FAR)}
    far -= inside | named
    groups: list[list[Path]] = []
    face = {REPOSITORY / "tests" / "test_library.py"}
    for group in (first, inside, elsewhere - far, far if not (first or elsewhere - far) else set(), face):
        before = {path for earlier in groups for path in earlier}
        groups.append(sorted(group - before, key=lambda path: len(test_texts()[path]))[:MOST_FILES])
    return [group for group in groups if group]


@dataclass(frozen=True)
class Recorded:
    """What is known of one test: its time on the clock and of the processor, and the lines of modules it executes."""

    duration_s: float
    processor_s: float
    lines: dict[str, frozenset[int]]


class Recordings:
    """What the tests of a file execute, recorded when first asked for.

    It is kept until the file, what it takes from the other tests, or the module that is judged has changed.
    """

    def __init__(self, copy: Copy, folder: Path, end: float) -> None:
        self.copy, self.output, self.end, self.processor_s = copy, folder / "lines.json", end, 0.0
        self._known: dict[Path, tuple[dict[str, str], dict[str, Recorded]]] = {}

    def has(self, path: Path, module: str) -> bool:
        """Whether what the tests of a file execute of a module is recorded already."""
        kept = KEPT / f"{_mark(path)}.json"
        if path not in self._known and kept.exists():
            self._keep(path, json.loads(kept.read_text(encoding="utf-8")))
        return path in self._known and self._known[path][0].get(module, _digest(module)) == _digest(module)

    def of(self, path: Path, module: str) -> dict[str, Recorded] | None:
        """The recording of a file of tests; None when no time is left to make it."""
        if not self.has(path, module):
            if monotonic() > self.end:
                return None
            self._keep(path, self._record(path, KEPT / f"{_mark(path)}.json"))
        return self._known[path][1]

    def _keep(self, path: Path, found: dict[str, Any]) -> None:
        tests = {
            test: Recorded(one["duration_s"], one["processor_s"], {m: frozenset(n) for m, n in one["lines"].items()})
            for test, one in found["tests"].items()
        }
        self._known[path] = found["modules"], tests
        for test in found["failed"]:
            print(f"left out, it does not pass without a change: {test}", flush=True)

    def _record(self, path: Path, kept: Path) -> dict[str, Any]:
        self.output.unlink(missing_ok=True)
        os.environ["KOCHAB_RECORD_LINES"] = json.dumps([str(self.copy.app), str(self.output)])
        options = ("-p", "tests.mutants.recorded", "-o", f"timeout={PATIENCE_S:.0f}")
        file = str(path.relative_to(REPOSITORY))
        self.processor_s += self.copy.pytest([file], 2.0 * LONGEST_FILE_S, 4.0 * PATIENCE_S, *options).processor_s
        del os.environ["KOCHAB_RECORD_LINES"]
        nothing = {"tests": {}, "failed": [f"{path.relative_to(REPOSITORY)} (did not end)"]}
        found: dict[str, Any] = json.loads(self.output.read_text("utf-8")) if self.output.exists() else nothing
        modules = {module for one in found["tests"].values() for module in one["lines"]}
        found["modules"] = {module: _digest(module) for module in sorted(modules)}
        KEPT.mkdir(parents=True, exist_ok=True)
        new = kept.with_suffix(f".{os.getpid()}")
        new.write_text(json.dumps(found), encoding="utf-8")
        new.replace(kept)  # rooms are tried at once
        return found


@cache
def _digest(module: str) -> str:
    return hashlib.sha256(sources().get(module, "").encode()).hexdigest()[:16]


@cache
def _mark(path: Path) -> str:
    """What changes with a test file and with what it takes from the other tests."""
    files, new = {path}, [path, *(folder / "conftest.py" for folder in path.parents if REPOSITORY in folder.parents)]
    while new:
        file = new.pop()
        if not file.exists():
            continue
        files.add(file)
        names = re.findall(r"from (tests[\w.]*) import ([\w, ()]*)", file.read_text(encoding="utf-8"))
        modules = {
            part for module, inside in names for part in (module, *(f"{module}.{n}" for n in inside.split(", ")))
        }
        new += {REPOSITORY.joinpath(*module.split(".")).with_suffix(".py") for module in modules} - files
    text = "\0".join(f"{file.relative_to(REPOSITORY)}\0{file.read_text(encoding='utf-8')}" for file in sorted(files))
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def wanted_lines(bug: Mutant) -> dict[str, frozenset[int]]:
    """The lines that have to be executed for a change to be noticed."""
    if not bug.name:
        return {bug.module: bug.lines}
    names = _carried_on(bug.module, frozenset(bug.name.split("|")))
    word, found = re.compile(rf"\b({'|'.join(map(re.escape, sorted(names)))})\b"), {bug.module: bug.lines}
    for module, text in sources().items():
        numbers = frozenset(n for n, line in enumerate(text.splitlines(), start=1) if word.search(line))
        if numbers and (module == bug.module or bug.module in imports(module)):
            found[module] = numbers | found.get(module, frozenset())
    return found


def _carried_on(module: str, names: frozenset[str]) -> frozenset[str]:
    """These names and those that a module gives, outside of functions, to what holds one of them: a row of a table."""
    found = set(names)
    for node in tree(module).body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            inside = {part.id for part in ast.walk(node.value) if isinstance(part, ast.Name)}
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            if inside & found:
                found |= {part.id for part in ast.walk(target) if isinstance(part, ast.Name)}
    return frozenset(found)
