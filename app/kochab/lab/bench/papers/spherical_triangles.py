"""The thesis on spherical triangles: Table 6.2, the counts of chapter 3 and the quad-tree's place.

Here the stars are today's 8,118 brightest and the methods those of the product; what the thesis' own programs give,
step by step, is judged against the tables.

Random attitudes, circular fields of 8 degrees; a result is correct when every star that it names is in the field
(section 4.1). The thesis gives its error of a place in four ways: 0.87 microradian (section 2.2.2), 87 (4.3), 87
with a factor of three in the noise (equation 4.6), and 87.2665 / 3 in its programs. All are run. The default method
sees the same directions through a square camera that it knows as well; it is correct when its centre is, and unlike
the thesis' methods it has to prove that chance did not give the answer.
"""

from itertools import combinations
from typing import Any

import numpy as np

from kochab.core.arrays import Floats, Ints
from kochab.core.attitude import attitude_from, radec_deg, unit
from kochab.core.camera import Camera
from kochab.core.frame import Detections
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.lab.bench import timed
from kochab.lab.bench.papers import options_with_scale, share_error, solve_timed
from kochab.lab.bench.papers import spherical_fields as fields
from kochab.lab.bench.papers.spherical_fields import MEASURES, TABLES
from kochab.lab.methods.angles import FigureTable, angles_of
from kochab.lab.methods.pairs import bright_stars, make_pairs
from kochab.lab.methods.spherical_triangles import make_triangles, triangles_of

READINGS: tuple[tuple[str, float, float], ...] = (
    # what, sigma of the bounds, sigma of the noise a coordinate, radians
    ("87.2665/3 urad, as its programs", fields.PROGRAMS, fields.PROGRAMS),
    ("0.87 urad, section 2.2.2", 0.87e-6, 0.87e-6),
    ("87 urad in the noise, a third in the bounds, equation 4.6", fields.PROGRAMS, 3.0 * fields.PROGRAMS),
    ("87 urad, section 4.3", 3.0 * fields.PROGRAMS, 3.0 * fields.PROGRAMS),
)
QUICK = 60
SIDE_PX = 2048
AS_MANY_ANGLES = 7075  # the brightest stars that make as many angles as the thesis has


def rows(quick: bool, seed: int) -> list[dict[str, Any]]:
    """All rows; ``quick`` runs 60 attitudes of one reading."""
    number = QUICK if quick else fields.ATTITUDES
    out = _counts() + program_rows(number, seed, 3 if quick else 5)
    for k, reading in enumerate(READINGS[: 1 if quick else None]):
        keys = [key for key in MEASURES if k == 0 or not key.startswith("of_")]
        out += _reading(reading, fields.STARS, None, keys, number if k == 0 else number // 2, seed)
    if not quick:
        out += _no_limit(number // 4, seed)
        truly = ("V <= 6.0 by today's catalogue, about six stars a field", fields.PROGRAMS, fields.PROGRAMS)
        out += _reading(truly, fields.STARS, 6.0, ["correct", "incorrect"], number // 2, seed)
    return out


def _counts() -> list[dict[str, Any]]:
    """Sections 3.3 to 3.6: what the catalogue gives, in which time, and how stars are found."""
    stars = bright_stars(fields.STARS, None, 2016.0)
    angles, of_angles = timed(lambda: make_pairs(*stars, np.radians(fields.LIMIT_DEG)))
    triangles, of_triangles = timed(lambda: make_triangles(angles, fields.LIMIT_DEG))
    even = fields.STARS * (fields.STARS - 1) / 2.0 * (1.0 - np.cos(np.radians(fields.LIMIT_DEG))) / 2.0
    nbytes = sum(a.nbytes for a in triangles.values())
    return [
        TABLES.row("angles", len(angles), even=even, other_reading=True),
        TABLES.row("triangles", len(triangles["stars"]), even=even, other_reading=True),
        TABLES.row("listing angles", of_angles),
        TABLES.row("listing triangles", of_triangles),
        TABLES.row("size of angles", 16e-6 * len(angles)),
        TABLES.row("size of triangles", 1e-6 * nbytes),
        *fields.quad_tree_rows(angles),
    ]


def _reading(
    reading: tuple[str, float, float], stars: int, mag_limit: float | None, keys: list[str], number: int, seed: int
) -> list[dict[str, Any]]:
    """Table 6.2 with one reading of the error."""
    what, bound, noise = reading
    tables = fields.tables_of(stars, mag_limit)
    default = by_default(tables["angles"].pairs.vectors, noise, number, seed)
    return [
        _row(name, key, what, tally, default, number, noise)
        for name, tally in _both(tables, bound, noise, number, seed).items()
        for key in keys
        if name in MEASURES[key]["paper"]
    ]


def _row(
    name: str, key: str, reading: str, tally: fields.FieldTally, default: fields.FieldTally, number: int, noise: float
) -> dict[str, Any]:
    measure = MEASURES[key]
    paper = measure["paper"][name]
    error = MEASURES["pivots"]["error"][name]
    if measure["unit"] == "%":
        error = share_error(paper, number, fields.ATTITUDES)
    return TABLES.row(
        "field",
        tally[key],
        default[key] if key != "pivots" else None,
        other_reading=key != "seconds" or noise != fields.PROGRAMS,  # the programs' reading is judged
        name=name,
        reading=reading,
        number=number,
        pivots=f"; over the fields solved, {tally['all_pivots']:.2f} over all" if key == "pivots" else "",
        **measure | {"paper": paper, "error": error},
    )


def _no_limit(number: int, seed: int) -> list[dict[str, Any]]:
    """Figures 6.4 and 6.8, without a limit of pivots; and what a thinner sky does to the pivots."""
    out = []
    errors = fields.PROGRAMS, fields.PROGRAMS
    for name, tally in _both(fields.tables_of(AS_MANY_ANGLES), *errors, number, seed).items():
        printed = {what: MEASURES["pivots"][what][name] for what in ("paper", "error")}
        words: dict[str, Any] = {"name": name, "stars": AS_MANY_ANGLES, "correct": tally["correct"], **printed}
        out.append(TABLES.row("thin", tally["pivots"], other_reading=True, **words))
    for name, tally in _both(fields.tables_of(fields.STARS), *errors, number, seed, pivots=1000).items():
        paper = TABLES.printed["free"]["seconds"][name]
        out.append(TABLES.row("free seconds", tally["seconds"], name=name, paper=paper))
    return out


def _both(
    tables: dict[str, Any], bound: float, noise: float, number: int, seed: int, **options: Any
) -> dict[str, fields.FieldTally]:
    return {
        name: fields.score_method(method(**options), tables[name], bound, noise, number, seed)
        for name, method in fields.METHODS.items()
    }


def by_default(sky: Floats, noise: float, number: int, seed: int) -> fields.FieldTally:
    """The default method on the first of the same fields.

    Parameters
    ----------
    sky : Floats
        ICRS unit vectors of the stars (N, 3).
    noise : float
        Error of a place, radians.
    number : int
        How many fields.
    seed : int
        Draws them.
    """
    focal = SIDE_PX / 2.0 / float(np.tan(np.radians(fields.FIELD_DEG / 2.0)))
    camera = Camera.centred(SIDE_PX, SIDE_PX, focal)
    options = options_with_scale(camera.scale_arcsec_px)

    def recognise(_: Ints, body: Floats, z: Floats) -> fields.Recognised:
        truth = attitude_from(*radec_deg(z), 0.0)
        xy = camera.project(body @ truth.matrix.T)
        listed = Detections.from_list(np.clip(xy, 0, SIDE_PX - 1), SIDE_PX, SIDE_PX)
        answer, seconds = solve_timed(listed, options)
        good = isinstance(answer, Solution) and bool(answer.centre_vector @ z > np.cos(np.radians(0.05)))
        return isinstance(answer, Solution), good, 0, seconds

    return fields.score(recognise, sky, noise, number, seed)


# -- The thesis as its own programs run: its appendix E, one step at a time -----------------------
# Its text leaves open what its programs tell: directions are drawn evenly in altitude, which favours
# the poles (E.30); a search is given up when a pivot leaves more finalists than there were, the same
# entry may stand for two figures, and all moments are bounded as the first triangle's (E.34, E.35);
# the mean of the pivots is that over all fields, whatever came out (E.13).
#
# Its star list is not published. It has 12,443 stars down to magnitude 12, so it is a selection, and less than 1 % of
# its fields hold fewer than three stars, while 1.8 % do of today's 8,118 brightest: the list is more even than the
# sky. Stars strewn at random are the most even list without a number to choose, and make the thesis' count of
# triangles. The last step is the tree of its section 3.3.3: 1,364 nodes have five levels, one too many for 6.94
# degrees, and leave out triangles between nodes that do not touch.
#
# The last step is judged. Each row's note tells what the steps before it gave, each on its own top.

Tables = dict[str, Any]
FREE = 1000  # "virtually no limit" of pivots
TREE_LEVELS = 5  # 4 + 16 + 64 + 256 + 1,024 nodes


@frozen
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


def program_rows(number: int, seed: int, lists: int) -> list[dict[str, Any]]:
    """Table 6.2, the counts and the figures without a limit; ``number`` attitudes a step.

    ``lists`` (at least two) is how many even lists of stars are strewn for the counts.
    """
    made = all_tables(seed)
    out = _count_rows(made, seed, lists)
    for name in fields.METHODS:
        tallies = [run_step(name, step, made[step], number, seed) for step in STEPS]
        free = run_step(name, STEPS[-1], made[STEPS[-1]], number, seed, pivots=FREE)
        keys = [key for key, one in MEASURES.items() if name in one["paper"] and key != "seconds"]
        out += [_program_row(name, key, tallies, number) for key in keys]
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
    """What a method makes of random fields of a step.

    Parameters
    ----------
    name : str
        The method's.
    step : ProgramStep
        Of the paper's program.
    made : Tables
        The tables by method.
    number : int
        How many fields.
    seed : int
        Draws them.
    **options : Any
        The method's own.
    """
    method = fields.METHODS[name](as_printed=step.as_printed, **options)
    return fields.score_method(method, made[name], fields.PROGRAMS, fields.PROGRAMS, number, seed, step.poles)


def _program_row(name: str, key: str, tallies: list[fields.FieldTally], number: int) -> dict[str, Any]:
    values = [tally["all_pivots" if key == "pivots" else key] for tally in tallies]
    words = {what: MEASURES[key][what] for what in ("what", "unit")}
    words["steps"] = ", ".join(f"{s.what} {v:.3g}" for s, v in zip(STEPS, values, strict=True))
    paper = MEASURES[key]["paper"][name]
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
