"""What is in a solved frame besides stars, as JSON, a table or DS9's regions: objects, bodies of the Solar System."""

from collections.abc import Sequence
from math import isfinite, isnan
from typing import TYPE_CHECKING

import numpy as np

from kochab.core.attitude import radec_deg
from kochab.core.frame import Frame
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.sky.names import MAG_SOURCES, SkyObjects
from kochab.sky.object_index import MOST, holding, inside, object_index
from kochab.workflows.solution_json import Json

if TYPE_CHECKING:  # what follows is loaded by those who need it: a cold solve of an undated frame does not
    from kochab.sky.frame_bodies import BodyInFrame
    from kochab.sky.solar_system import Body, Moving

NAN = float("nan")


@frozen
class FrameObject:
    """An object or a body whose middle is in the frame, or an object that holds the whole frame (``larger``).

    ``x``, ``y`` px of the middle, of a larger object outside the frame too, NaN where the lens shows it nowhere; ICRS
    degrees; ``magnitude`` in ``band``: V, B, or ? where two sources contradict each other; ``source`` is whose
    magnitude it is; ``size_arcmin`` largest and smallest diameter; ``position_angle_deg`` of the larger one from north
    over east. NaN is unknown.
    """

    name: str
    names: tuple[str, ...]
    kind: str
    x: float
    y: float
    ra_deg: float
    dec_deg: float
    magnitude: float
    band: str
    source: str
    size_arcmin: tuple[float, float]
    position_angle_deg: float
    larger: bool = False
    moves: bool = False


def objects_of(frame: Frame, solution: Solution, more: "Sequence[Moving]" = ()) -> list[FrameObject]:
    """The bodies and deep-sky objects of the frame, the best known first, then those that are larger than it.

    Bodies need the frame's time; ``more`` are tables of them beside the shipped one's.
    """
    from kochab.sky.frame_bodies import body_marks

    marks = run(body_marks(frame, solution, more=more)) if frame.hint.taken_utc is not None else ()
    bodies = [_body(mark.body, *mark.xy.tolist()) for mark in marks if mark.body is not None]
    return [*bodies, *deep_sky_of(solution)[0]]


def all_of(solution: Solution, bodies: "Sequence[BodyInFrame]", most: int = MOST) -> tuple[list[FrameObject], int]:
    """The frame's bodies and at most ``most`` of its deep-sky objects; how many of these were left out."""
    found, left_out = deep_sky_of(solution, most)
    return [*(_body(one.body, one.x, one.y) for one in bodies), *found], left_out


def deep_sky_of(solution: Solution, most: int = MOST) -> tuple[list[FrameObject], int]:
    """The ``most`` best known objects in the frame and those larger than it; how many in the frame were left out."""
    index, centre = object_index(), solution.centre_vector
    rows = index.within(centre, 1.2 * solution.radius_rad)
    xy = solution.pixels_of(index.vector[rows])
    seen = np.flatnonzero(inside(solution, xy))
    seen = seen[np.argsort(index.rank[rows[seen]], kind="stable")]
    shown = seen[:most]
    around = np.setdiff1d(holding(index, centre, solution.radius_rad), rows[shown], assume_unique=True)
    around = around[np.argsort(index.major[around], kind="stable")]
    places = np.concatenate([xy[shown], solution.pixels_of(index.vector[around])])
    objects = index.read(np.concatenate([rows[shown], around]))
    held = {*holding(objects, centre, solution.radius_rad).tolist()}
    found = [_object(objects, row, x, y, row in held) for row, (x, y) in enumerate(places.tolist())]
    # the best known first, what holds the whole frame last
    return sorted(found, key=lambda one: one.larger), len(seen) - len(shown)


def _body(body: "Body", x: float, y: float) -> FrameObject:
    wide = (body.diameter_arcsec / 60.0 or NAN, NAN)
    place = (x, y, body.ra_deg, body.dec_deg)
    return FrameObject(body.name, (), str(body.kind), *place, body.magnitude, "V", "", wide, NAN, moves=True)


def _object(objects: SkyObjects, row: int, x: float, y: float, larger: bool) -> FrameObject:
    ra, dec = radec_deg(objects.vector[row])
    name, *names = objects.names(row)
    bright, band = float(objects.mag[row]), str(objects.band[row])
    source = MAG_SOURCES.get(str(objects.source[row]), "")
    size, angle = (float(objects.major[row]), float(objects.minor[row])), float(objects.pa_deg[row])
    place = (x, y, ra, dec)
    return FrameObject(name, tuple(names), str(objects.kind[row]), *place, bright, band, source, size, angle, larger)


def objects_json(found: Sequence[FrameObject]) -> list[Json]:
    """The stable JSON form; what is not known is null."""

    def known(value: float) -> float | None:
        return value if isfinite(value) else None

    return [
        {
            "name": one.name,
            "names": list(one.names),
            "kind": one.kind,
            "ra_deg": one.ra_deg,
            "dec_deg": one.dec_deg,
            "x": known(one.x),
            "y": known(one.y),
            "magnitude": known(one.magnitude),
            "band": one.band if isfinite(one.magnitude) else "",
            "magnitude_source": one.source,
            "size_arcmin": None if isnan(one.size_arcmin[0]) else [s for s in one.size_arcmin if isfinite(s)],
            "position_angle_deg": known(one.position_angle_deg),
            "where": "larger" if one.larger else "inside",
        }
        for one in found
    ]


def objects_csv(found: Sequence[FrameObject]) -> str:
    """A line an object: px, ICRS degrees, magnitude and band, sizes in arcmin, position angle in degrees."""
    from kochab.frames.export import csv_text

    head = ("name", "names", "type", "x", "y", "ra_deg", "dec_deg", "mag", "band", "source", "major_arcmin")
    rows: list[tuple[object, ...]] = [(*head, "minor_arcmin", "pa_deg", "where")]
    for one in found:
        place = (f"{one.x:.2f}", f"{one.y:.2f}", f"{one.ra_deg:.5f}", f"{one.dec_deg:.5f}")
        values = [_number(value) for value in (one.magnitude, *one.size_arcmin, one.position_angle_deg)]
        values[1:1] = [one.band if values[0] else "", one.source]
        rows.append((one.name, ";".join(one.names), one.kind, *place, *values, "larger" if one.larger else "inside"))
    return csv_text(rows)


def _number(value: float) -> str:
    return "" if np.isnan(value) else f"{value:g}"


def sky_regions(solution: Solution, found: Sequence[FrameObject]) -> str:
    """DS9's regions of the stars, and of the frame's deep-sky objects and bodies, ICRS.

    DS9 counts an ellipse's angle from west over north, 90 degrees more than the position angle.
    """
    from kochab.frames.export import ds9_regions
    from kochab.sky.kinds import FAMILIES
    from kochab.sky.layer import DOT_PX
    from kochab.workflows.annotated_image import INKS

    lines, least = [], DOT_PX * solution.camera.scale_arcsec_px
    for one in (one for one in found if not one.larger):
        major, minor = (side * 30.0 for side in one.size_arcmin)  # diameters in arcmin, radii in arcsec
        place = f"{one.ra_deg:.6f},{one.dec_deg:.6f}"
        shape = f'circle({place},{max(float(np.nan_to_num(major)), least):.2f}")'
        if not one.moves and np.isfinite([minor, one.position_angle_deg]).all():
            shape = f'ellipse({place},{major:.2f}",{minor:.2f}",{(one.position_angle_deg + 90.0) % 360.0:g})'
        ink = INKS[FAMILIES.get(one.kind, "nebula")]
        lines.append(f"{shape} # color={ink} text={{{one.name.encode('ascii', 'replace').decode()}}}\n")
    return ds9_regions(solution) + "".join(lines)
