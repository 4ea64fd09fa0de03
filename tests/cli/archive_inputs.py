"""What an archive is tested on: a rendered night, and lists of stars that astropy's tangent plane has placed."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from astropy.wcs import WCS

from kochab.cli.main import main
from kochab.core.attitude import unit_vectors
from kochab.sky import open_catalogue

SIZE, SCALE = (1000, 800), 40.0
CENTRES = ((84.0, -2.0), (201.0, 55.0), (310.0, 41.0), (15.0, 60.5), (120.0, -30.0), (250.0, 10.0))


@cache
def stars_of(centre) -> np.ndarray:
    """Pixels (N, 2) of the brightest stars about a place, brightest first."""
    wcs = WCS(naxis=2)
    wcs.wcs.ctype = ["RA---TAN", "DEC--TAN"]
    wcs.wcs.crval, wcs.wcs.crpix = centre, [(SIZE[0] + 1) / 2, (SIZE[1] + 1) / 2]
    wcs.wcs.cd = np.array([[-1.0, 0.0], [0.0, -1.0]]) * SCALE / 3600
    catalogue = open_catalogue()
    rows = catalogue.brightest(unit_vectors(*centre), np.radians(8.0), 400)
    vectors = catalogue.vectors(rows, 2016.0)
    ra, dec = np.degrees(np.arctan2(vectors[:, 1], vectors[:, 0])), np.degrees(np.arcsin(vectors[:, 2]))
    xy = np.stack(wcs.all_world2pix(ra, dec, 0), axis=1)
    return xy[((xy > 0) & (xy < np.array(SIZE) - 1)).all(axis=1)][:40]


def write_lists(path: Path, centres=CENTRES, group: int = 4) -> None:
    """A Parquet table, a row a list."""
    lists = [stars_of(centre) for centre in centres]
    columns = {
        "x": [xy[:, 0].tolist() for xy in lists],
        "y": [xy[:, 1].tolist() for xy in lists],
        "width": [SIZE[0]] * len(lists),
        "height": [SIZE[1]] * len(lists),
    }
    pq.write_table(pa.table(columns), path, row_group_size=group)


def archive(capsys, *arguments, code=0) -> dict:
    """What the command says as JSON."""
    assert main(["archive", *map(str, arguments), "--json"]) == code
    return json.loads(capsys.readouterr().out)


def rows_of(out: Path | str, **options) -> dict[str, dict]:
    """The rows of a dataset by the last part of their URL, as pyarrow reads it for anyone; none is there twice."""
    rows = pq.read_table(str(out), **options).to_pylist()
    found = {row["url"].rpartition("/")[2]: row for row in rows}
    assert len(found) == len(rows)
    return found
