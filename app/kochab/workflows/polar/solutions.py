"""Frames that were solved before: WCS headers (``.wcs``, solved FITS) and the JSON of ``kochab solve``."""

import json
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from kochab.attitude.fit import refine
from kochab.core.attitude import Attitude, unit_vectors
from kochab.core.camera import Camera
from kochab.core.errors import FrameError, KochabError
from kochab.core.frame import Hint
from kochab.core.solution import Matches, NamedStar, NoSolution, Solution
from kochab.polar.rotations import ARCSEC, best_rotation
from kochab.workflows.polar.sources import SolvedFile

SIGMA_PX = 0.2  # what a WCS is believed across the frame; its roll to this over a quarter of the width
GRID = (15, 11)
LARGEST_BYTES = 50_000_000
SOLVED = (".wcs", ".json")
"""Suffixes of files that hold solutions and no picture."""


def solved_before(path: str | Path) -> list[SolvedFile]:
    """What a ``.wcs`` or JSON file says, with time and site of the picture it belongs to.

    The picture is the one that the JSON names, or the one beside the ``.wcs`` with the same name; a header with
    DATE-OBS needs none.

    Raises FrameError when it holds no solution; one sentence.
    """
    path = Path(path)
    try:
        data = path.read_bytes() if path.stat().st_size < LARGEST_BYTES else b""
    except OSError as error:
        raise FrameError(f"{path} cannot be read: {error.strerror}.") from None
    if path.suffix.lower() == ".json":
        return [_of_json(path, row) for row in _rows(path, data)]
    solution, hint = of_header(path, data)
    if hint.time_utc is None:
        hint = _beside(path)
    return [SolvedFile(str(path), solution, hint.time_utc, hint.site)]


def of_header(path: Path, data: bytes) -> tuple[Solution, Hint]:
    """The solution and the hints of a FITS header, cards or lines of text, with a celestial WCS.

    Raises FrameError when there is none.
    """
    from astropy.io.fits import Header
    from astropy.wcs import WCS

    from kochab.frames.hints import hint_from_keywords

    text = data.decode("latin-1")
    cards = text.splitlines() if "\n" in text[:100] else [text[at : at + 80] for at in range(0, len(text), 80)]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            end = next((k for k, card in enumerate(cards) if card.rstrip() == "END"), len(cards))
            header = Header.fromstring("".join(card[:80].ljust(80) for card in cards[:end]))
            shape = tuple(int(header.get(f"IMAGE{a}") or header.get(f"NAXIS{n}") or 0) for a, n in (("W", 1), ("H", 2)))
            wcs = WCS(header)
            if not wcs.has_celestial or min(shape) < 2:
                raise FrameError(f"{path} has no WCS, or not the size of its frame (IMAGEW, IMAGEH).")
            solution = _of_map(lambda x, y: wcs.all_pix2world(x, y, 0), *shape)
        values = {key: value for key, value in header.items() if key not in ("COMMENT", "HISTORY", "")}
    except (ValueError, KeyError, TypeError, OSError) as error:
        raise FrameError(f"{path} has no usable WCS ({type(error).__name__}).") from None
    hint, _ = hint_from_keywords(values, {}, shape[::-1])
    return solution, hint


def _of_map(sky_deg: Any, width: int, height: int) -> Solution:
    """The solution whose camera and attitude are nearest to a map from pixels to RA and Dec, degrees."""
    x, y = (np.linspace(0.0, side - 1.0, count) for side, count in zip((width, height), GRID, strict=True))
    pixels = np.stack([c.ravel() for c in np.meshgrid(x, y)], axis=-1)
    sky = unit_vectors(*sky_deg(*pixels.T))
    middle = np.array([width, height])[:, None] / 2.0 + [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    here, right, below = unit_vectors(*sky_deg(*middle))
    scale = float(np.sqrt(np.linalg.norm(np.cross(right - here, below - here))))
    camera = Camera.centred(width, height, 1.0 / scale, bool(np.cross(right - here, below - here) @ here < 0.0))
    number = np.arange(len(pixels))
    start = Attitude(best_rotation(sky, camera.unproject(pixels)))
    fit = refine(Matches(number, number, pixels, sky), camera, start)
    sigma = SIGMA_PX * np.array([scale, scale, 4.0 / width])
    attitude = Attitude(fit.attitude.matrix, np.diag(sigma**2))
    return Solution(fit.camera, attitude, (), 0.0, 0.0, "WCS")


def _rows(path: Path, data: bytes) -> Iterator[Mapping[str, Any]]:
    try:
        rows = [json.loads(line) for line in data.decode("utf-8").splitlines() if line.strip()]
    except ValueError:
        rows = []
    if not rows or not all(isinstance(row, dict) and "solved" in row for row in rows):
        raise FrameError(f"{path} is not what kochab solve --json prints, an object a line.")
    yield from rows


def _of_json(path: Path, row: Mapping[str, Any]) -> SolvedFile:
    """One line of ``kochab solve --json``, its attitude brought from the frame's middle to the optical axis."""
    try:
        name = str(row["file"])
        if not row["solved"]:
            return SolvedFile(name, NoSolution(row["reason"], "", ""), None, None)
        sides = 2.0 * row["camera"]["focal_px"] * np.tan(np.radians(np.array(row["fov_deg"]) / 2.0))
        width, height = (round(float(side)) for side in sides)
        camera = Camera(width, height, **row["camera"], mirrored=bool(row["mirrored"]))
        across, along, roll = (float(s) * ARCSEC for s in row["sigma_arcsec"])
        stars = tuple(NamedStar(**star) for star in row["stars"])
        plain = Solution(
            camera, Attitude(np.eye(3)), stars, float(row["rms_px"]), row["log10_false_alarm"], row["method"]
        )
        matrix = plain.centre_attitude.matrix.T @ np.array(row["dcm"], dtype=np.float64).reshape(3, 3)
        attitude = Attitude(matrix, np.diag(np.square([along, across, roll])))
    except (KeyError, TypeError, ValueError) as error:
        raise FrameError(f"{path} is not what kochab solve --json prints ({error}).") from None
    solution = Solution(camera, attitude, stars, plain.rms_px, plain.log10_false_alarm, plain.method)
    picture = next((p for p in (Path(name), path.parent / name, path.parent / Path(name).name) if p.is_file()), None)
    hint = _hint_of(picture) if picture else Hint()
    return SolvedFile(name, solution, hint.time_utc, hint.site)


def _beside(path: Path) -> Hint:
    """Of the picture with the same name as a ``.wcs``."""
    from kochab.frames import SUFFIXES

    pictures = (p for p in sorted(path.parent.glob(f"{path.stem}.*")) if p.suffix.lower() in SUFFIXES)
    return next((hint for p in pictures if (hint := _hint_of(p)).time_utc is not None), Hint())


def _hint_of(picture: Path) -> Hint:
    from kochab.frames import read_frame

    try:
        return read_frame(picture).hint
    except KochabError:
        return Hint()
