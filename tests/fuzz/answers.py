"""No wrong answer: noise never has a pointing; a real list or frame that was changed has its own or none."""

import io
from functools import cache
from pathlib import Path
from random import Random

import numpy as np

import kochab
from kochab.core.attitude import apart_deg
from kochab.core.errors import FrameError, UsageError
from kochab.core.solution import Solution
from kochab.solver import SolveOptions
from tests.cli.stars import ATTITUDE, CAMERA, orion_places
from tests.fuzz import mutate
from tests.fuzz.target import Target, require, told

TIMEOUT_S = 6.0


def _noise(folder: Path) -> list[bytes]:
    """Lists without truth: even, in a cluster, on a grid, on a line."""
    rng = np.random.default_rng(11)
    width, height = CAMERA.width, CAMERA.height
    grid = np.stack(np.meshgrid(np.arange(8) * 190.0 + 40, np.arange(6) * 160.0 + 40), axis=-1).reshape(-1, 2)
    along = rng.uniform(0, 900, 40)
    lists = [rng.uniform(0, 1, (n, 2)) * [width, height] for n in (12, 40, 150)]
    lists += [rng.normal((800, 500), s, (60, 2)) for s in (40, 120)]
    lists += [grid + rng.normal(0, 1.0, grid.shape), np.stack([along, along + rng.normal(0, 3.0, 40)], axis=1)]
    return [_rows(np.clip(xy, 0, [width - 1, height - 1])) for xy in lists]


def _orion(folder: Path) -> list[bytes]:
    places = orion_places()
    inside = ((places >= 0) & (places < [CAMERA.width, CAMERA.height])).all(axis=1)
    return [_rows(places[inside])]


def _rows(xy: np.ndarray) -> bytes:
    return "\n".join(f"{x:.2f},{y:.2f}" for x, y in xy).encode()


def _list_change(rng: Random, seeds: mutate.Seeds) -> bytes:
    """Stars left out, added, doubled, moved and put into another order."""
    rows = rng.choice(seeds).decode().split("\n")
    moved = rng.choice((0.0, 0.3, 1.0, 5.0))
    chance = rng.choice((0.0, 0.1, 0.4))
    new = []
    for row in rows:
        x, y = (float(v) for v in row.split(",")[:2])
        if rng.random() >= chance:
            new.append(f"{x + rng.gauss(0, moved):.2f},{y + rng.gauss(0, moved):.2f}")
    for _ in range(rng.choice((0, 0, 3, 20, 80))):
        new.insert(
            rng.randrange(len(new) + 1), f"{rng.uniform(0, CAMERA.width):.2f},{rng.uniform(0, CAMERA.height):.2f}"
        )
    if rng.random() < 0.2:
        rng.shuffle(new)
    return "\n".join(new).encode()


def _solved(data: bytes, folder: Path):
    from kochab.core.progress import run
    from kochab.workflows.solve_frame import solve_star_list

    (path := folder / "stars.csv").write_bytes(data)
    return run(solve_star_list(path, CAMERA.width, CAMERA.height, SolveOptions(timeout_s=TIMEOUT_S)))


def check_noise(data: bytes, folder: Path) -> None:
    with told(UsageError):
        found = _solved(data, folder)
        require(not isinstance(found, Solution), f"noise is at {getattr(found, 'ra_dec_deg', '')}")


def check_orion(data: bytes, folder: Path) -> None:
    with told(UsageError):
        found = _solved(data, folder)
        if isinstance(found, Solution):
            off = apart_deg(found.ra_dec_deg, ATTITUDE.ra_dec_deg)
            require(off < 0.1, f"{off:.2f} deg from where the list was made: {found.ra_dec_deg}")


# -- Real frames --------------------------------------------------------------------------------


@cache
def _samples() -> list[tuple[bytes, str, tuple[float, float]]]:
    """A quarter of two real sample frames as PNG and FITS, with their own pointings."""
    from PIL import Image

    from kochab.frames import read_frame
    from kochab.frames.fits_write import fits_bytes
    from tests.house import SAMPLES

    pixels = read_frame(SAMPLES / "orion.png").pixels
    found = kochab.solve(pixels)
    packed = io.BytesIO()
    Image.fromarray(pixels).save(packed, "PNG")
    place = found.ra_dec_deg
    return [(packed.getvalue(), "orion.png", place), (fits_bytes(kochab.core.frame.Frame(pixels)), "orion.fits", place)]


def _frames(folder: Path) -> list[bytes]:
    return [data for data, _, _ in _samples()]


def _frame_change(rng: Random, seeds: mutate.Seeds) -> bytes:
    data = rng.choice(seeds)
    if data.startswith(b"SIMPLE"):
        return mutate.fits(rng, [data])
    return mutate.png(rng, [data])


def check_frame(data: bytes, folder: Path) -> None:
    """A frame whose bytes were changed points to its own field, or nowhere."""
    name = "orion.fits" if data.startswith(b"SIMPLE") else "orion.png"
    place = _samples()[0][2]
    (path := folder / name).write_bytes(data)
    with told(FrameError):
        found = kochab.solve(path, timeout=TIMEOUT_S)
        if isinstance(found, Solution):
            off = apart_deg(found.ra_dec_deg, place)
            require(off < 9.0, f"{off:.2f} deg from its own field, 15 deg wide: {found.ra_dec_deg}")


TARGETS = [
    Target("list of noise", _noise, check_noise, _list_change, 3000, 1),
    Target("list of Orion", _orion, check_orion, _list_change, 3000, 2),
    Target("frame of Orion", _frames, check_frame, _frame_change, 1500, 1, sandboxed="orion.png"),
]
