"""The tables of stars that ``solve-field`` reads and leaves: columns and headers are those of astrometry.net 0.93.

Pixels in them count from 1. The stars "from the index" are here the catalogue's that were matched: ``.rdls``,
``-indx.xyls`` and ``.corr`` have a row for each of them, in one order. Kochab matches no single quad: the ``.match``
table has the four brightest matched stars in its place, and NaN for the code's error.
"""

import io
import math
import os
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from kochab.core.arrays import Floats, Ints
from kochab.core.errors import UsageError
from kochab.core.frame import Detections
from kochab.core.solution import Solution
from kochab.workflows.other_solvers import cd_at_centre

LARGEST_LIST_BYTES = 200_000_000
Column = tuple[str, str, str | None, Any]
"""Name, format, unit and values."""


def read_list(path: str, columns: tuple[str, str, str], size: tuple[int, int] | None, ascending: bool) -> Detections:
    """The stars of a table (``.xyls``, ``.axy``); UsageError when it has none, or no size is known.

    Parameters
    ----------
    path : str
        A FITS file whose first table has the stars.
    columns : tuple[str, str, str]
        The columns of x, y, and of what sorts the stars; the last may be empty: they are in order.
    size : tuple[int, int] or None
        Of the frame, px; None takes it from the header (``IMAGEW``, ``IMAGEH``).
    ascending : bool
        Whether the smallest values are the brightest stars', as magnitudes are.
    """
    from astropy.io import fits

    try:
        if os.path.getsize(path) > LARGEST_LIST_BYTES:
            raise UsageError(f"{path} is too large for a list of stars.")
        with fits.open(path, memmap=False) as file:
            table = next(hdu for hdu in file if isinstance(hdu, fits.BinTableHDU))
            x, y = (np.asarray(table.data[name], np.float64).ravel() for name in columns[:2])
            order = np.asarray(table.data[columns[2]], np.float64).ravel() if columns[2] else None
            heads = [table.header, file[0].header]
            found = [next((head[key] for head in heads if key in head), None) for key in ("IMAGEW", "IMAGEH")]
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or 'no FITS file'}.") from None
    except UsageError:
        raise
    except Exception:  # a damaged table fails in a hundred ways
        named = ", ".join(filter(None, columns))
        raise UsageError(f"{path} has no table of stars with the columns {named}.") from None
    width, height = size or tuple(found)
    if not (isinstance(width, int) and isinstance(height, int) and 0 < width <= 10**6 and 0 < height <= 10**6):
        raise UsageError(f"{path}: give the frame's size with --width and --height.")
    xy = np.stack([x, y], axis=1) - 1.0
    good = np.asarray(
        np.isfinite(xy).all(axis=1) & (xy > -1.5).all(axis=1) & (xy < [width + 0.5, height + 0.5]).all(axis=1)
    )
    if not good.any():
        raise UsageError(f"{path} has no stars within {width} x {height} pixels.")
    if order is not None and np.isfinite(order[good]).all():
        xy, good = xy[(by := np.argsort(order if ascending else -order, kind="stable"))], good[by]
    return Detections.from_list(xy[good], width, height)


def is_list(path: str) -> bool:
    """Whether a file's name says that it is a table of stars."""
    return Path(path).suffix.lower() in (".xyls", ".axy", ".xy")


def axy(detections: Detections, solved: bool, files: dict[str, str]) -> bytes:
    """The list of detections; ``files`` are the names of the other outputs, by their keywords."""
    head: list[tuple[str, Any]] = [("IMAGEW", detections.width), ("IMAGEH", detections.height), ("ANRUN", True)]
    head += [(key, name) for key, name in files.items() if name]
    level = np.full(len(detections), detections.background)
    columns: list[Column] = [
        *_pixels("X", "Y", "E", detections.xy, "pix"),
        ("FLUX", "1E", "unknown", detections.flux),
        ("BACKGROUND", "1E", "unknown", level),
    ]
    own: list[tuple[str, Any]] = [("EXTNAME", "SOURCES"), ("IMAGEW", detections.width), ("IMAGEH", detections.height)]
    return _file(columns, head, own)


def rdls(solution: Solution) -> bytes:
    """The matched catalogue stars on the sky, degrees (ICRS)."""
    ra, dec = _places(solution)
    return _file([("RA", "1D", "deg", ra), ("DEC", "1D", "deg", dec)], [("AN_FILE", "RDLS")])


def index_xyls(solution: Solution) -> bytes:
    """The same stars where the solution puts them on the frame."""
    return _file(_pixels("X", "Y", "D", _catalogue_px(solution)), [("AN_FILE", "XYLS")])


def corr(solution: Solution, detections: Detections) -> bytes:
    """Which detection was matched with which catalogue star, and both their places."""
    from kochab.core.attitude import radec_deg

    of = _detected(solution, detections)
    seen = np.array([radec_deg(vector) for vector in solution.sky_at(solution.stars_px)]).reshape(-1, 2)
    star_ra, star_dec = _places(solution)
    count = len(solution.stars)
    return _file(
        [
            *_pixels("field_x", "field_y", "D", solution.stars_px, "pixels"),
            ("field_ra", "1D", "degrees", seen[:, 0]),
            ("field_dec", "1D", "degrees", seen[:, 1]),
            *_pixels("index_x", "index_y", "D", _catalogue_px(solution), "pixels"),
            ("index_ra", "1D", "degrees", star_ra),
            ("index_dec", "1D", "degrees", star_dec),
            ("index_id", "1J", "none", np.arange(count)),
            ("field_id", "1J", "none", of),
            ("match_weight", "1D", "none", np.ones(count)),
            ("FLUX", "1E", "unknown", detections.flux[of]),
            ("BACKGROUND", "1E", "unknown", np.full(count, detections.background)),
        ],
        [],
    )


def match(solution: Solution, detections: Detections, name: str) -> bytes:
    """One row about the match as a whole."""
    brightest = np.argsort([star.mag for star in solution.stars], kind="stable")[:4]
    stars, of = _five(brightest), _five(_detected(solution, detections)[brightest])
    pixels, vectors = np.zeros(10), np.zeros(15)
    pixels[: 2 * len(brightest)] = (solution.stars_px[brightest] + 1.0).ravel()
    vectors[: 3 * len(brightest)] = solution.star_vectors[brightest].ravel()
    matched, found = len(solution.stars), solution.detections
    odds = -solution.log10_false_alarm * math.log(10.0)
    camera, seconds = solution.camera, solution.elapsed_ms.get("total", 0.0) / 1e3
    numbers: list[tuple[str, str, str | None, Any]] = [
        ("QUAD", "1J", None, 0),
        ("DIMQUADS", "1B", None, len(brightest)),
        ("STARS", "5J", None, stars),
        ("FIELDOBJS", "5J", None, of),
        ("IDS", "5K", None, np.zeros(5)),
        ("CODEERR", "1E", None, math.nan),
        ("QUADPDI", "10D", None, np.zeros(10)),
        ("QUADPIX", "10D", None, pixels),
        ("QUADXYZ", "15D", None, vectors),
        ("CENTERXYZ", "3D", None, solution.centre_vector),
        ("RADIUS", "1D", "DEG", math.degrees(solution.radius_rad)),
        *((key, "1J", None, value) for key, value in (("NMATCH", matched), ("NDISTRACT", found - matched))),
        *((key, "1J", None, value) for key, value in (("NCONFLICT", 0), ("NFIELD", found), ("NINDEX", matched))),
        ("NAGREE", "1J", None, 1),
        ("CRVAL", "2D", None, solution.ra_dec_deg),
        ("CRPIX", "2D", None, ((camera.width + 1) / 2.0, (camera.height + 1) / 2.0)),
        ("CD", "4D", None, np.ravel(cd_at_centre(solution))),
        ("WCS_VALID", "1L", None, True),
        *((key, "1J", None, 1) for key in ("FIELDNUM", "FIELDID")),
        *((key, "1I", None, value) for key, value in (("INDEXID", 0), ("HEALPIX", -1), ("HPNSIDE", 1))),
        ("FIELDNAME", "31A", None, name.encode("ascii", "replace").decode()[:31]),
        ("PARITY", "1L", None, not camera.mirrored),
        *((key, "1J", None, 1) for key in ("QTRIED", "QMATCHED", "QSCALEOK")),
        ("QPEERS", "1I", None, 0),
        ("NVERIFIED", "1J", None, 1),
        ("TIMEUSED", "1E", "s", seconds),
        ("LOGODDS", "1E", None, odds),
        ("WORSTLOGODDS", "1E", None, odds),
    ]
    return _file([(key, kind, unit, np.array([value])) for key, kind, unit, value in numbers], [("AN_FILE", "MATCH")])


def _five(numbers: Ints) -> Ints:
    return np.concatenate([numbers, np.full(5 - len(numbers), -1)])


def _detected(solution: Solution, detections: Detections) -> Ints:
    """The rows (M,) of the matched detections."""
    return np.array([int(np.hypot(*(detections.xy - xy).T).argmin()) for xy in solution.stars_px], dtype=np.intp)


def _places(solution: Solution) -> tuple[Floats, Floats]:
    places = np.array([(star.ra_deg, star.dec_deg) for star in solution.stars]).reshape(-1, 2)
    return places[:, 0], places[:, 1]


def _catalogue_px(solution: Solution) -> Floats:
    return solution.pixels_of(solution.star_vectors)


def _pixels(x: str, y: str, kind: str, xy: Floats, unit: str | None = None) -> list[Column]:
    """Two columns of pixels, which FITS counts from 1."""
    return [(x, f"1{kind}", unit, xy[:, 0] + 1.0), (y, f"1{kind}", unit, xy[:, 1] + 1.0)]


def _file(columns: Sequence[Column], head: Sequence[tuple[str, Any]], own: Sequence[tuple[str, Any]] = ()) -> bytes:
    """A FITS file of one table; ``head`` are cards of its first header, ``own`` of the table's."""
    from astropy.io import fits

    made = [fits.Column(name=name, format=kind, unit=unit, array=values) for name, kind, unit, values in columns]
    table = fits.BinTableHDU.from_columns(made)
    primary = fits.PrimaryHDU()
    primary.header["EXTEND"] = True
    moment = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%S")
    for header, cards in ((primary.header, [*head, ("DATE", moment)]), (table.header, own)):
        for key, value in cards:
            header[key] = value
    primary.header["CREATOR"] = "Kochab"
    out = io.BytesIO()
    fits.HDUList([primary, table]).writeto(out)
    return out.getvalue()
