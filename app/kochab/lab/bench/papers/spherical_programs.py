"""The thesis on spherical triangles as its own programs run: its appendix E, one step at a time.

Its text leaves open what its programs tell: directions are drawn evenly in altitude, which favours
the poles (E.30); a search is given up when a pivot leaves more finalists than there were, the same
entry may stand for two figures, and all moments are bounded as the first triangle's (E.34, E.35);
the mean of the pivots is that over all fields, whatever came out (E.13).

Its star list is not published. It has 12,443 stars down to magnitude 12, so it is a selection, and less than 1 % of
its fields hold fewer than three stars, while 1.8 % do of today's 8,118 brightest: the list is more even than the
sky. Stars strewn at random are the most even list without a number to choose, and make the thesis' count of
triangles. The last step is the tree of its section 3.3.3: 1,364 nodes have five levels, one too many for 6.94
degrees, and leave out triangles between nodes that do not touch.

The last step is judged. Each row's note tells what the steps before it gave, each on its own top.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from kochab.core.attitude import unit
from kochab.lab.bench.papers import share_error
from kochab.lab.bench.papers import spherical_fields as fields
from kochab.lab.bench.papers.spherical_fields import TABLES
from kochab.lab.methods.angles import FigureTable, angles_of
from kochab.lab.methods.pairs import make_pairs
from kochab.lab.methods.spherical_triangles import make_triangles, triangles_of

Tables = dict[str, Any]
FREE = 1000  # "virtually no limit" of pivots
TREE_LEVELS = 5  # 4 + 16 + 64 + 256 + 1,024 nodes


@dataclass(frozen=True, slots=True)
class ProgramStep:
    """A way to run the thesis' test; each differs in one thing from the one before."""

    what: str
    poles: bool = False
    as_printed: bool = False
    even: bool = False
    tree: bool = False


STEPS = (
    ProgramStep("today's 8,118 brightest"),
    ProgramStep("directions as E.30", True),
    ProgramStep("pivots as E.34 and E.35", True, True),
    ProgramStep("an even list of stars", True, True, True),
    ProgramStep("its tree of 1,364 nodes", True, True, True, True),
)


def rows(number: int, seed: int, lists: int = 5) -> list[dict[str, Any]]:
    """Table 6.2, the counts and the figures without a limit; ``number`` attitudes a step.

    ``lists`` (at least two) is how many even lists of stars are strewn for the counts.
    """
    made = all_tables(seed)
    out = _count_rows(made, seed, lists)
    for name in fields.METHODS:
        tallies = [run_step(name, step, made[step], number, seed) for step in STEPS]
        free = run_step(name, STEPS[-1], made[STEPS[-1]], number, seed, pivots=FREE)
        keys = [key for key, one in fields.MEASURES.items() if name in one["paper"] and key != "seconds"]
        out += [_row(name, key, tallies, number) for key in keys]
        why = " (paper: 4.41)" if name == "angles" else ": a few fields take dozens"
        scatter, paper = f"{free['pivots_sd']:.2f}{why}", TABLES.printed["free"]["pivots"][name]
        error = _mean_error(free, number)
        out.append(TABLES.row("free pivots", free["all_pivots"], name=name, scatter=scatter, paper=paper, error=error))
    return out


def all_tables(seed: int) -> dict[ProgramStep, Tables]:
    """The angles and triangles of every step's stars."""
    today, even = fields.tables_of(fields.STARS), random_tables(seed)
    tree = tables_by_tree(even)
    return {step: tree if step.tree else even if step.even else today for step in STEPS}


def random_tables(seed: int) -> Tables:
    """Those of as many stars strewn evenly over the sky."""
    stars = unit(np.random.default_rng([seed, fields.STARS]).normal(size=(fields.STARS, 3)))
    pairs = make_pairs(np.arange(fields.STARS), stars, np.radians(fields.LIMIT_DEG))
    triangles = triangles_of(pairs, make_triangles(pairs, fields.LIMIT_DEG))
    return {"angles": angles_of(pairs), "spherical_triangles": triangles}


def tables_by_tree(made: Tables) -> Tables:
    """What the thesis' tree finds of them."""
    tree = fields.quad_tree(TREE_LEVELS)
    return {name: by_tree(table, tree) for name, table in made.items()}


def by_tree(table: FigureTable, tree: fields.QuadTree) -> FigureTable:
    """The figures that the programs E.11 and E.12 find: within a node, or of one and any that touch it."""
    node = tree.node_of(table.pairs.vectors)[table.stars]
    corners = node.shape[1]
    touching = [tree.shared(node[:, a], node[:, b]) >= 1 for a, b in combinations(range(corners), 2)]
    return table.take(np.sum(touching, axis=0) >= corners - 1)


def run_step(name: str, step: ProgramStep, made: Tables, number: int, seed: int, **options: Any) -> fields.FieldTally:
    """What a method makes of ``number`` random fields of a step."""
    method = fields.METHODS[name](as_printed=step.as_printed, **options)
    return fields.score_method(method, made[name], fields.PROGRAMS, fields.PROGRAMS, number, seed, step.poles)


def _row(name: str, key: str, tallies: list[fields.FieldTally], number: int) -> dict[str, Any]:
    values = [tally["all_pivots" if key == "pivots" else key] for tally in tallies]
    words = {what: fields.MEASURES[key][what] for what in ("what", "unit")}
    words["steps"] = ", ".join(f"{s.what} {v:.3g}" for s, v in zip(STEPS, values, strict=True))
    paper = fields.MEASURES[key]["paper"][name]
    error = share_error(paper, number, fields.ATTITUDES) if key != "pivots" else _mean_error(tallies[-1], number)
    return TABLES.row("by its programs", values[-1], name=name, paper=paper, error=error, **words)


def _mean_error(tally: fields.FieldTally, number: int) -> float:
    """Two sigma of the difference of two means, of ``number`` fields and of the thesis' 1,000."""
    return 2.0 * tally["pivots_sd"] * float(np.sqrt(1.0 / number + 1.0 / fields.ATTITUDES))


def _count_rows(made: dict[ProgramStep, Tables], seed: int, lists: int) -> list[dict[str, Any]]:
    """Section 3.6: how many angles and triangles each list of stars makes."""
    several = [made[STEPS[-1]]] + [tables_by_tree(random_tables(seed + k)) for k in range(1, lists)]
    out = []
    for name, what, paper in (
        ("angles", "angles up to 6.94 deg", 106_308),
        ("spherical_triangles", "triangles in circles of 6.94 deg", 662_799),
    ):
        listed = ", ".join(f"{step.what} {len(made[step][name].stars)}" for step in (STEPS[0], *STEPS[3:]))
        counts = np.array([len(one[name].stars) for one in several], dtype=np.float64)
        error = 2.0 * float(counts.std(ddof=1)) * float(np.sqrt(1.0 + 1.0 / lists))
        words: dict[str, Any] = {"what": what, "lists": lists, "counts": listed}
        out.append(TABLES.row("count of programs", float(counts.mean()), paper=paper, error=error, **words))
    return out
