"""The thesis on spherical triangles: Table 6.2, the counts of chapter 3 and the quad-tree's place.

Here the stars are today's 8,118 brightest and the methods those of the product; what the thesis' own programs give,
step by step, is in :mod:`kochab.lab.bench.papers.spherical_programs`, and that is judged against the tables.

Random attitudes, circular fields of 8 degrees; a result is correct when every star that it names is in the field
(section 4.1). The thesis gives its error of a place in four ways: 0.87 microradian (section 2.2.2), 87 (4.3), 87
with a factor of three in the noise (equation 4.6), and 87.2665 / 3 in its programs. All are run. The default method
sees the same directions through a square camera that it knows as well; it is correct when its centre is, and unlike
the thesis' methods it has to prove that chance did not give the answer.
"""

from typing import Any

import numpy as np

from kochab.core.arrays import Floats, Ints
from kochab.core.attitude import attitude_from, radec_deg
from kochab.core.camera import Camera
from kochab.core.frame import Detections
from kochab.core.solution import Solution
from kochab.lab.bench import timed
from kochab.lab.bench.papers import options_with_scale, share_error, solve_timed, spherical_programs
from kochab.lab.bench.papers import spherical_fields as fields
from kochab.lab.bench.papers.spherical_fields import MEASURES, TABLES
from kochab.lab.methods.pairs import bright_stars, make_pairs
from kochab.lab.methods.spherical_triangles import make_triangles

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
    out = _counts() + spherical_programs.rows(number, seed, 3 if quick else 5)
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
    """The default method on the first ``number`` of the same fields."""
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
