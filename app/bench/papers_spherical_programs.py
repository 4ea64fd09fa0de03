"""The thesis on spherical triangles as its own programs run: its appendix E, one step at a time.

Its text leaves open what its programs tell: directions are drawn evenly in altitude, which favours
the poles (E.30); a search is given up when a pivot leaves more finalists than there were, the same
entry may stand for two figures, and all moments are bounded as the first triangle's (E.34, E.35);
the mean of the pivots is that over all fields, whatever came out (E.13).

Its star list is not published. It has 12,443 stars down to magnitude 12, so it is a selection, and
less than 1 % of its fields hold fewer than three stars, while 1.8 % do of today's 8,118 brightest:
the list is more even than the sky. Stars strewn at random are the most even list without a number
to choose, and make the thesis' count of triangles. The last step is the tree of its section 3.3.3:
1,364 nodes have five levels, one too many for 6.94 degrees, and leave out triangles between nodes
that do not touch.

The last step is judged. Each row's note tells what the steps before it gave, each on its own top.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.bench.papers_quad_tree import QuadTree, quad_tree
from app.bench.papers_row import row, share_error
from app.bench.papers_spherical_fields import (
    ATTITUDES,
    LIMIT_DEG,
    PAPER,
    PROGRAMS,
    STARS,
    Tally,
    tallied,
)
from app.identify.angles import Angles, AngleTable, angle_table, angles_of
from app.identify.kvector import LINEAR, PARABOLIC, make_kvector
from app.identify.pairs import make_pairs
from app.identify.spherical_triangles import (
    SphericalTriangles,
    TriangleTable,
    make_triangles,
    triangle_table,
    triangles_of,
    two_shared,
)

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Tables = dict[str, Any]
SHARES = {
    "correct": "correct", "inconclusive": "inconclusive", "incorrect": "incorrect",
    "of_four": "correct, of fields with 4 stars or more",
    "of_five": "correct, of fields with 5 stars or more",
}  # fmt: skip
FREE = 1000  # "virtually no limit" of pivots
TREE_LEVELS = 5  # 4 + 16 + 64 + 256 + 1,024 nodes


@dataclass(frozen=True, slots=True)
class Step:
    """A way to run the thesis' test; each differs in one thing from the one before."""

    what: str
    poles: bool = False
    as_printed: bool = False
    even: bool = False
    tree: bool = False


STEPS = (
    Step("today's 8,118 brightest"),
    Step("directions as E.30", True),
    Step("pivots as E.34 and E.35", True, True),
    Step("an even list of stars", True, True, True),
    Step("its tree of 1,364 nodes", True, True, True, True),
)


def rows(number: int, seed: int, lists: int = 5) -> list[dict[str, Any]]:
    """Table 6.2, the counts and the figures without a limit; ``number`` attitudes a step.

    ``lists`` (at least two) is how many even lists of stars are strewn for the counts.
    """
    made = all_tables(seed)
    last = made[STEPS[-1]]
    out = _count_rows(made, seed, lists)
    for name in ("angles", "spherical_triangles"):
        tallies = [run_step(name, step, made[step], number, seed) for step in STEPS]
        free = run_step(name, STEPS[-1], last, number, seed, FREE)
        keys = (
            [*SHARES, "pivots"]
            if name == "spherical_triangles"
            else ["correct", "inconclusive", "incorrect", "pivots"]
        )
        out += [_row(name, key, tallies, number) for key in keys]
        paper = PAPER[name]
        out.append(
            row("6.3, 6.7", f"{name}: mean pivots without a limit, by its programs",
                paper=paper["free_pivots"], ours=free.all_pivots, error=_mean_error(free, number),
                note=f"scatter {free.pivots_sd:.2f}"
                + (" (paper: 4.41)" if name == "angles" else ": a few fields take dozens"))
        )  # fmt: skip
    return out


def all_tables(seed: int) -> dict[Step, Tables]:
    """The angles and triangles of every step's stars."""
    today = {
        "angles": angle_table(LIMIT_DEG, STARS, None),
        "spherical_triangles": triangle_table(LIMIT_DEG, STARS, None),
    }
    even = strewn(seed)
    tree = by_tree(even)
    return {step: tree if step.tree else even if step.even else today for step in STEPS}


def strewn(seed: int) -> Tables:
    """Those of as many stars strewn evenly over the sky."""
    stars = np.random.default_rng([seed, STARS]).normal(size=(STARS, 3))
    stars /= np.linalg.norm(stars, axis=1, keepdims=True)
    pairs = make_pairs(np.arange(STARS), stars, np.zeros(STARS), np.radians(LIMIT_DEG))
    triangles = triangles_of(pairs, make_triangles(pairs, LIMIT_DEG))
    return {"angles": angles_of(pairs), "spherical_triangles": triangles}


def by_tree(made: Tables) -> Tables:
    """What the thesis' tree finds of them."""
    tree = quad_tree(TREE_LEVELS)
    return {
        "angles": angles_by_tree(made["angles"], tree),
        "spherical_triangles": triangles_by_tree(made["spherical_triangles"], tree),
    }


def angles_by_tree(table: AngleTable, tree: QuadTree) -> AngleTable:
    """The angles that the program E.11 finds: within a node or between two that touch."""
    node = tree.node_of(table.pairs.vectors)
    found = tree.shared(node[table.stars[:, 0]], node[table.stars[:, 1]]) >= 1
    return AngleTable(
        table.pairs, table.stars[found], make_kvector(table.index.values[found], LINEAR)
    )


def triangles_by_tree(table: TriangleTable, tree: QuadTree) -> TriangleTable:
    """The triangles that the program E.12 finds: of a node and any that touch it."""
    node = tree.node_of(table.pairs.vectors)[table.stars]
    near = np.stack([tree.shared(node[:, a], node[:, b]) >= 1 for a, b in ((0, 1), (1, 2), (0, 2))])
    found: Bools = near.sum(axis=0) >= 2
    stars = table.stars[found]
    index = make_kvector(table.index.values[found], PARABOLIC)
    return TriangleTable(table.pairs, stars, two_shared(stars), table.moment[found], index)


def run_step(
    name: str, step: Step, made: Tables, number: int, seed: int, pivots: int | None = None
) -> Tally:
    """What a method makes of ``number`` random fields of a step."""
    method: Angles | SphericalTriangles
    if name == "angles":
        method = Angles(as_printed=step.as_printed, pivots=pivots or 9)
    else:
        method = SphericalTriangles(as_printed=step.as_printed, pivots=pivots or 3)
    return tallied(method, made[name], PROGRAMS, PROGRAMS, number, seed, step.poles)


def _row(name: str, key: str, tallies: list[Tally], number: int) -> dict[str, Any]:
    field = "all_pivots" if key == "pivots" else key
    values = [float(getattr(tally, field)) for tally in tallies]
    paper = PAPER[name][key]
    steps = ", ".join(f"{s.what} {v:.3g}" for s, v in zip(STEPS, values, strict=True))
    if key == "pivots":
        error = _mean_error(tallies[-1], number)
        return row("6.2", f"{name}: pivots, by its programs", unit="mean", paper=paper,
                   ours=values[-1], error=error, note=f"step by step: {steps}")  # fmt: skip
    return row("6.2", f"{name}: {SHARES[key]}, by its programs", unit="%", paper=paper,
               ours=values[-1], error=share_error(paper, number, ATTITUDES),
               note=f"step by step: {steps}")  # fmt: skip


def _mean_error(tally: Tally, number: int) -> float:
    """Two sigma of the difference of two means, of ``number`` fields and of the thesis' 1,000."""
    return 2.0 * tally.pivots_sd * float(np.sqrt(1.0 / number + 1.0 / ATTITUDES))


def _count_rows(made: dict[Step, Tables], seed: int, lists: int) -> list[dict[str, Any]]:
    """Section 3.6: how many angles and triangles each list of stars makes."""
    several = [made[STEPS[-1]]] + [by_tree(strewn(seed + k)) for k in range(1, lists)]
    out = []
    for name, what, paper in (
        ("angles", "angles up to 6.94 deg", 106_308),
        ("spherical_triangles", "triangles in circles of 6.94 deg", 662_799),
    ):
        told = ", ".join(
            f"{step.what} {len(made[step][name].stars)}" for step in (STEPS[0], *STEPS[3:])
        )
        counts = np.array([len(one[name].stars) for one in several], dtype=np.float64)
        out.append(
            row("3.6", f"{what}, by its programs", paper=paper, ours=float(counts.mean()),
                error=2.0 * float(counts.std(ddof=1)) * float(np.sqrt(1.0 + 1.0 / lists)),
                note=f"mean of {lists} even lists, whose scatter gives the error; {told}; no list "
                "tried makes both of the thesis' counts: as many angles are those of the 7,075 "
                "brightest, which make 737,796 triangles")
        )  # fmt: skip
    return out
