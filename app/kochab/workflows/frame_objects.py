"""What is in a solved frame besides stars, as JSON, a table or DS9's regions: objects, bodies of the Solar System."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kochab.core.attitude import radec_deg
from kochab.core.frame import Frame
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.frames.export import csv_text, ds9_regions
from kochab.sky.frame_bodies import body_marks
from kochab.sky.layer import DOT_PX, FAMILIES, around, in_frame
from kochab.sky.sky_tables import sky_tables
from kochab.sky.solar_system import Moving
from kochab.workflows.annotated_image import INKS
from kochab.workflows.solution_json import Json

NAN = float("nan")


@dataclass(frozen=True, slots=True)
class FrameObject:
    """An object or a body whose middle is in the frame, or an object that holds the whole frame (``larger``).

    ``x``, ``y`` px of the middle, of a larger object outside the frame too, NaN where the lens shows it nowhere; ICRS
    degrees; ``magnitude`` in ``band``: V, B, or ? where two sources contradict each other; ``size_arcmin`` largest and
    smallest diameter; ``position_angle_deg`` of the larger one from north over east. NaN is unknown.
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
    size_arcmin: tuple[float, float]
    position_angle_deg: float
    larger: bool = False
    moves: bool = False


def objects_of(frame: Frame, solution: Solution, more: Sequence[Moving] = ()) -> list[FrameObject]:
    """The bodies and deep-sky objects of the frame, the best known first, then those that are larger than it.

    Bodies need the frame's time; ``more`` are tables of them beside the shipped one's.
    """
    found = []
    for mark in in_frame(sky_tables(), solution, also=run(body_marks(frame, solution, more=more))).marks:
        x, y = map(float, mark.xy)
        if (body := mark.body) is not None:
            wide = (body.diameter_arcsec / 60.0 or NAN, NAN)
            place = (x, y, body.ra_deg, body.dec_deg)
            found.append(FrameObject(mark.short, (), mark.kind, *place, body.magnitude, "V", wide, NAN, moves=True))
        elif mark.kind != "star":
            found.append(_object(mark.row, x, y, mark.short))
    return [*found, *_larger(solution, {one.name for one in found})]


def _object(row: int, x: float, y: float, name: str, larger: bool = False) -> FrameObject:
    objects = sky_tables().objects
    ra, dec = radec_deg(objects.vector[row])
    size = (float(objects.major[row]), float(objects.minor[row]))
    bright, band = float(objects.mag[row]), str(objects.band[row])
    names, angle = tuple(objects.names(row)[1:]), float(objects.pa_deg[row])
    return FrameObject(name, names, str(objects.kind[row]), x, y, ra, dec, bright, band, size, angle, larger)


def _larger(solution: Solution, named: set[str]) -> list[FrameObject]:
    """The objects that the whole frame lies in, the smallest first."""
    tables = sky_tables()
    rows = around(tables, solution)
    objects = tables.objects
    xy = solution.pixels_of(objects.vector[rows])
    at = zip(rows, xy, strict=True)
    found = [_object(int(row), float(x), float(y), objects.designation(int(row)), True) for row, (x, y) in at]
    return [one for one in found if one.name not in named]


def objects_json(found: Sequence[FrameObject]) -> list[Json]:
    """The stable JSON form; what is not known is null."""
    return [
        {
            "name": one.name,
            "names": list(one.names),
            "kind": one.kind,
            "ra_deg": one.ra_deg,
            "dec_deg": one.dec_deg,
            "x": one.x,
            "y": one.y,
            "magnitude": one.magnitude,
            "band": one.band if np.isfinite(one.magnitude) else "",
            "size_arcmin": None if np.isnan(one.size_arcmin[0]) else [s for s in one.size_arcmin if np.isfinite(s)],
            "position_angle_deg": one.position_angle_deg,
            "where": "larger" if one.larger else "inside",
        }
        for one in found
    ]


def objects_csv(found: Sequence[FrameObject]) -> str:
    """A line an object: px, ICRS degrees, magnitude and band, sizes in arcmin, position angle in degrees."""
    head = ("name", "names", "type", "x", "y", "ra_deg", "dec_deg", "mag", "band", "major_arcmin", "minor_arcmin")
    rows: list[tuple[object, ...]] = [(*head, "pa_deg", "where")]
    for one in found:
        place = (f"{one.x:.2f}", f"{one.y:.2f}", f"{one.ra_deg:.5f}", f"{one.dec_deg:.5f}")
        values = [_number(value) for value in (one.magnitude, *one.size_arcmin, one.position_angle_deg)]
        values.insert(1, one.band if values[0] else "")
        rows.append((one.name, ";".join(one.names), one.kind, *place, *values, "larger" if one.larger else "inside"))
    return csv_text(rows)


def _number(value: float) -> str:
    return "" if np.isnan(value) else f"{value:g}"


def sky_regions(solution: Solution, found: Sequence[FrameObject]) -> str:
    """DS9's regions of the stars, and of the frame's deep-sky objects and bodies, ICRS.

    DS9 counts an ellipse's angle from west over north, 90 degrees more than the position angle.
    """
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
