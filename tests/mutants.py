"""Deliberate bugs, and whether the tests notice: ``make mutants`` (``python -m tests.mutants --help``).

One place of one module is changed at a time, in a copy; the test files that import that module are run
against the copy. A change that every test survives is printed: either a test is missing, or the change means
nothing. The choice is random with a seed, so that a run can be repeated.
"""

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path
from time import monotonic

from tests.house import SOURCE, imports, sources
from tests.patterns import REPOSITORY, choose_folder

ROOMS = ("kochab.gear.mounts", "kochab.attitude", "kochab.solver", "kochab.polar")
MOST_SURVIVING = 0.15
LONGEST_S = 150.0  # a bug that makes the tests hang has been noticed

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
    """A module's whole text with one change; ``line`` and ``change`` say which."""

    module: str
    line: int
    change: str
    text: str


def _changes(node: ast.AST) -> Iterator[ast.AST]:
    """What may stand in the place of ``node``."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPS:
        new = deepcopy(node)
        new.ops[0] = SWAPS[type(node.ops[0])]()
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
    elif isinstance(node, ast.Return) and node.value is not None:
        yield ast.Return(ast.Constant(None))
    elif (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)) or isinstance(node, ast.Raise):
        yield ast.Pass()


def _skipped(tree: ast.Module) -> set[int]:
    """Nodes whose change no test could notice: annotations, Protocols, ``__all__``, imports."""
    found: set[int] = set()
    for node in ast.walk(tree):
        parts: list[ast.AST | None] = []
        if isinstance(node, ast.arg | ast.AnnAssign):
            parts.append(node.annotation)
        if isinstance(node, ast.FunctionDef):
            parts.append(node.returns)
        if isinstance(node, ast.ClassDef) and any("Protocol" in ast.unparse(b) for b in node.bases):
            parts.append(node)
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("dataclass", "suppress", "TypeVar"):
            parts.append(node)
        found |= {id(n) for part in parts if part is not None for n in ast.walk(part)}
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
    text = ast.unparse(ast.fix_missing_locations(_Replace(node, new).visit(tree)))
    return Mutant(module, line, change, text)


@cache
def test_texts() -> dict[Path, str]:
    """Every test file with its text, read once for all mutants."""
    return {path: path.read_text(encoding="utf-8") for path in sorted(REPOSITORY.glob("tests/**/test_*.py"))}


def tests_of(module: str) -> list[str]:
    """The test files that import ``module``, those of its own room first; else its room's."""
    room = module.split(".")[1:]
    folders = [REPOSITORY.joinpath("tests", *room[:k]) for k in range(len(room), 0, -1)]
    own = next(folder for folder in folders if folder.is_dir())
    inside = {path: text for path, text in test_texts().items() if own in path.parents}
    package, _, stem = module.rpartition(".")
    direct = (f"from {module} ", f"{module}.", f"import {module}")
    named = {path for path, text in test_texts().items() if any(words in text for words in direct)}
    named |= {path for path, text in inside.items() if f"from {package} import" in text and stem in text}
    if not named:
        users = [user for user in sources() if module in imports(user)]
        named = {path for path, text in inside.items() if any(user in text for user in users)}
    return [str(p) for p in sorted(named or inside, key=lambda p: (own not in p.parents, p.stat().st_size))]


class Copy:
    """A copy of the program in which one module at a time is changed."""

    def __init__(self, folder: Path) -> None:
        self.app = folder / "app"
        shutil.copytree(SOURCE, self.app / "kochab", ignore=shutil.ignore_patterns("__pycache__"))
        for name in ("catalogs", "resources"):
            (folder / name).symlink_to(REPOSITORY / name)

    def file(self, module: str) -> Path:
        place = self.app.joinpath(*module.split("."))
        return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")

    def survives(self, tests: list[str]) -> bool:
        """Whether all tests pass."""
        environment = os.environ | {
            "PYTHONPATH": os.pathsep.join([str(self.app), str(REPOSITORY)]),
            "QT_QPA_PLATFORM": "offscreen",
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider"]
        command += ["-o", f"pythonpath={self.app} {REPOSITORY}", *tests]
        try:
            done = subprocess.run(command, cwd=REPOSITORY, env=environment, capture_output=True, timeout=LONGEST_S)
        except subprocess.TimeoutExpired:
            return False
        return done.returncode == 0


def main() -> int:
    """Try mutants until their number or the time is used up; 1 when too many survive."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("modules", nargs="*", help="rooms or modules; the default is what matters most")
    parser.add_argument("--count", type=int, default=100, help="mutants to try (100)")
    parser.add_argument("--minutes", type=float, default=30.0, help="stop after this time (30)")
    parser.add_argument("--seed", type=int, default=1)
    wanted = parser.parse_args()
    choose_folder()
    chosen = [m for m in sources() if m.startswith(tuple(wanted.modules or ROOMS))]
    pool = [place for module in chosen for place in places(module)]
    random.Random(wanted.seed).shuffle(pool)
    end = monotonic() + 60.0 * wanted.minutes
    survivors, tried = [], 0
    with tempfile.TemporaryDirectory(prefix="kochab-mutants-") as folder:
        copy = Copy(Path(folder))
        for place in pool[: wanted.count]:
            if monotonic() > end:
                break
            bug = mutant(*place)
            file = copy.file(bug.module)
            before = file.read_text(encoding="utf-8")
            file.write_text(bug.text, encoding="utf-8")
            try:
                survived = copy.survives(tests_of(bug.module))
            finally:
                file.write_text(before, encoding="utf-8")
            tried += 1
            if survived:
                survivors.append(bug)
                print(f"SURVIVED {bug.module}:{bug.line}: {bug.change}", flush=True)
    share = len(survivors) / max(1, tried)
    print(f"{tried} of {len(pool)} mutants tried, {len(survivors)} survived: {100 * share:.0f} %", end=" ")
    print(f"(at most {100 * MOST_SURVIVING:.0f} %)")
    return int(share > MOST_SURVIVING)


if __name__ == "__main__":
    sys.exit(main())
