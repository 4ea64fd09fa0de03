"""What is changed: one operator, comparison, constant, return or call of one module at a time."""

import ast
import re
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from itertools import islice
from typing import TypeGuard

from tests.house import sources
from tests.mutants.equivalent import EQUIVALENT

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
    when it is no statement of an ordinary function, else empty; several are separated by ``|``.
    """

    module: str
    line: int
    change: str
    text: str
    lines: frozenset[int]
    name: str

    @property
    def equivalent(self) -> bool:
        """Whether the change is known to mean the same."""
        here = sources()[self.module].splitlines()[self.line - 1]
        return any(
            (module, change) == (self.module, self.change) and all(part in here for part in parts)
            for module, change, *parts in EQUIVALENT
        )


IDLE = {"erfa.sp00": (1,), "erfa.apco": (1,), "erfa.apio": (0, 1, 2)}
"""Function -> places of arguments that change no digit: a day, of what changes in a century or moves stars that have no
motion of their own; a turn about the pole, of the place of the pole."""
NOT_TRIED = ("dataclass", "suppress", "TypeVar", "lru_cache", "Progress", "SearchStage")
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
    node = node.operand if isinstance(node, ast.UnaryOp) else node
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

    Annotations, Protocols, what a dataclass, a cache or a progress report is given; how hard a stage of a search tries,
    which the bench has tuned over thousands of fields; how far JSON is indented; asserts and ``strict=`` of a zip, which
    only check the code itself; numbers within the sentence of an error; ``axis=-1``, which is 1 of a table; a millionth and
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
    if isinstance(node, ast.Call) and ast.unparse(node.func) == "np.float32":
        node = node.args[0]
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


def _words(node: ast.AST, new: ast.AST) -> str:
    return f"{ast.unparse(node)}  ->  {ast.unparse(ast.fix_missing_locations(new))}".replace("\n", " ")[:150]


def mutant(module: str, number: int, which: int) -> Mutant:
    """The change of one place."""
    tree = ast.parse(sources()[module])
    node = next(islice(ast.walk(tree), number, None))
    new = ast.fix_missing_locations(next(islice(_changes(node), which, None)))
    change = _words(node, new)
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
        name = ast.unparse(last.targets[0] if isinstance(last, ast.Assign) else last.target)
        # a field's default is taken wherever the class is made without it
        return lines, "|".join([name, *(node.name for node in statements if isinstance(node, ast.ClassDef))])
    return lines, getattr(last, "name", "import")
