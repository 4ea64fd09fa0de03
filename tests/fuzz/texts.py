"""Texts that other programs write: WCS headers, solved frames as JSON lines, orbital elements, guide logs, sightings."""

import json
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np

from kochab.core.errors import CatalogueError, FrameError, UsageError
from kochab.core.frame import Site
from kochab.core.progress import run
from kochab.core.solution import Solution
from tests.fuzz import mutate
from tests.fuzz.target import Target, require, told

SITE = Site(47.0, 8.0, 450.0)
WHEN = datetime(2026, 11, 16, 21, tzinfo=UTC)


# -- Frames that were solved before: ``kochab polar`` ---------------------------------------------


def _solutions() -> list[Solution]:
    from tests.workflows.test_polar_solutions import solution

    return [solution(turn_deg) for turn_deg in (0.0, 30.0, 60.0)]


def _headers(folder: Path) -> list[bytes]:
    """As Kochab writes it, a card a line, and as FITS with a date and SIP in it."""
    from astropy.io import fits

    from kochab.frames.wcs import wcs_text

    first = wcs_text(_solutions()[0])
    header = fits.Header.fromstring(first.replace("\n", " "))
    header["DATE-OBS"], header["EXPTIME"], header["SITELAT"] = "2026-11-16T21:00:00", 20.0, 47.0
    return [first.encode("ascii"), header.tostring().encode("ascii")]


def _lines(folder: Path) -> list[bytes]:
    from kochab.workflows.solution_json import as_json, to_line

    rows = [as_json(f"{k}.fits", each) | {"time_utc": f"2026-11-16T21:0{k}:00Z"} for k, each in enumerate(_solutions())]
    rows.append({"file": "3.fits", "solved": False, "reason": "too few stars"})
    return [b"\n".join(to_line(row).encode() for row in rows[:count]) for count in (1, 4)]


def check_solved(name: str, data: bytes, folder: Path) -> None:
    """Solutions that a camera can have, and an axis of them and two good ones; or one sentence."""
    from kochab.workflows.polar.solutions import FilesRequest, axis_of, solved_before
    from kochab.workflows.polar.sources import SolvedFile

    (path := folder / name).write_bytes(data)
    with told(FrameError, UsageError):
        files = solved_before(path)
        for file in files:
            if isinstance(found := file.result, Solution):
                shown = [*found.ra_dec_deg, found.roll_deg, *found.centre_attitude.sigma_arcsec, *found.camera.fov_deg]
                require(np.isfinite(shown).all() and found.camera.focal_px > 0.0, f"{shown}")
        good = [SolvedFile(f"{k}", one, WHEN.replace(minute=30 + k), SITE) for k, one in enumerate(_solutions()[1:])]
        axis = axis_of([*files[:3], *good], [0] * len([*files[:3], *good]), (), FilesRequest(SITE))
        error = getattr(axis.result, "error", None)
        require(error is None or np.isfinite(error.total_arcsec), "an axis that is nowhere")


# -- Orbital elements: ``--elements`` -------------------------------------------------------------


def _omm(folder: Path) -> list[bytes]:
    """Fields as CCSDS 502.0 names them, values of Iridium 7 as Space-Track gave them."""
    fields = {
        "OBJECT_NAME": "IRIDIUM 7", "OBJECT_ID": "1997-020B", "EPOCH": "2026-11-16T14:10:46.704000",
        "MEAN_MOTION": 14.35703110, "ECCENTRICITY": 0.0001752, "INCLINATION": 86.3948, "RA_OF_ASC_NODE": 245.0025,
        "ARG_OF_PERICENTER": 80.0972, "MEAN_ANOMALY": 280.0423, "EPHEMERIS_TYPE": 0, "CLASSIFICATION_TYPE": "U",
        "NORAD_CAT_ID": 24793, "ELEMENT_SET_NO": 999, "REV_AT_EPOCH": 44878, "BSTAR": 0.000335,
        "MEAN_MOTION_DOT": 9.86e-06, "MEAN_MOTION_DDOT": 0,
    }  # fmt: skip
    return [
        json.dumps([fields, fields | {"OBJECT_NAME": "B", "NORAD_CAT_ID": 9}]).encode(),
        json.dumps(fields).encode(),
    ]


def _satellite_lines(folder: Path) -> list[bytes]:
    lines = (Path(__file__).parents[1] / "sky" / "iridium-2025-01-05.tle").read_bytes().splitlines()
    fields = json.loads(_omm(folder)[1])
    table = ",".join(fields) + "\n" + ",".join(map(str, fields.values()))
    return [b"\n".join(lines[:9]), b"\n".join(lines[1:3]), table.encode()]


def _small_bodies(folder: Path) -> list[bytes]:
    from tests.sky.packages import CERES, COMET, FIELDS

    return [json.dumps({"fields": FIELDS, "data": [CERES, COMET]}).encode()]


def _small_body_lines(folder: Path) -> list[bytes]:
    from tests.sky.packages import CERES, COMET, FIELDS
    from tests.sky.test_small_bodies import COM, ORB

    table = "\n".join(",".join("" if cell is None else str(cell) for cell in row) for row in (FIELDS, CERES, COMET))
    return [f"PREFACE\n{'-' * 90}\n{ORB}\n{ORB}".encode(), f"{COM}\n{COM}".encode(), table.encode()]


def check_elements(name: str, data: bytes, folder: Path) -> None:
    """Bodies with places in the sky, or none; or one sentence."""
    from kochab.sky.elements import read_elements
    from kochab.sky.small_bodies import bodies_near

    (path := folder / name).write_bytes(data)
    with told(CatalogueError):
        table = read_elements(path)
        table.warning(WHEN, SITE)
        for body in run(bodies_near(WHEN, SITE, np.array([0.0, 0.0, 1.0]), np.pi, 8.0, [table], 10.0)):
            require(np.isfinite([body.ra_deg, body.dec_deg, body.sigma_arcsec]).all(), f"{body} is nowhere")


# -- Guide logs, and what is kept between sessions ------------------------------------------------


def _guide_logs(folder: Path) -> list[bytes]:
    from tests.polar.test_drift import falling, log_text

    return [log_text(falling(2.0, 4.0, 8.0), dec=15.0, seconds=8.0).encode()]


def check_guide_log(data: bytes, folder: Path) -> None:
    """A drift with an axis somewhere, or one sentence."""
    from kochab.polar.drift import measure_drift
    from kochab.polar.measure import MeasureSettings
    from kochab.workflows.polar.guide_logs import guide_log

    (path := folder / "PHD2_GuideLog.txt").write_bytes(data)
    with told(FrameError):
        found = measure_drift(guide_log(path, settings := MeasureSettings(SITE)), settings)
        error = getattr(found, "error", None)
        require(error is None or np.isfinite(error.total_arcsec), "an axis that is nowhere")


def _sightings(folder: Path) -> list[bytes]:
    from kochab.core.mount import Epoch, PierSide, Pointing
    from kochab.pointing.disagreement import MountSighting
    from kochab.workflows.pointing_model import save_sightings

    rows = [MountSighting((10.0, 20.0), Pointing(10.1, 20.1, Epoch.J2000), WHEN, SITE, PierSide.EAST, alt_azimuth=True)]
    save_sightings(path := folder / "sightings.json", [*rows, MountSighting((1.0, 2.0), rows[0].reported, WHEN, None)])
    return [path.read_bytes()]


def check_sightings(data: bytes, folder: Path) -> None:
    from kochab.workflows.pointing_model import load_sightings

    (path := folder / "sightings.json").write_bytes(data)
    with told(UsageError):
        for one in load_sightings(path):
            require(np.isfinite([*one.sky_deg, one.reported.ra_deg, one.reported.dec_deg]).all(), f"{one} is nowhere")


_ROWS = mutate.lines(mutate.raw)
TARGETS = [
    Target("WCS header", _headers, partial(check_solved, "a.wcs"), mutate.fits, 1500, 3),
    Target("solved lines", _lines, partial(check_solved, "a.jsonl"), mutate.lines(mutate.tree), 1500, 3),
    Target("elements, OMM", _omm, partial(check_elements, "a.json"), mutate.tree, 4000, 5),
    Target("elements, satellites' lines", _satellite_lines, partial(check_elements, "a.tle"), _ROWS, 4000, 5),
    Target("elements, JPL's", _small_bodies, partial(check_elements, "b.json"), mutate.tree, 4000, 5),
    Target("elements, lines", _small_body_lines, partial(check_elements, "c.csv"), _ROWS, 4000, 5),
    Target("guide log", _guide_logs, check_guide_log, _ROWS, 800, 2),
    Target("sightings of a mount", _sightings, check_sightings, mutate.tree, 4000, 5),
]
