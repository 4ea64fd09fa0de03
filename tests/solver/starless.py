"""Frames without a star, as covers, clouds, flats and electronics make them: vignetting and one thing or more of it.

Written from what cameras do (sensor makers' sheets of amp glow and hot pixels, dust shadows of converging light, JPEG's
own blocks, clouds as fractal noise), not from the rules of the diagnosis.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterator
from io import BytesIO

import numpy as np
from PIL import Image
from scipy import ndimage

from kochab.core.frame import Frame
from kochab.core.progress import run
from kochab.core.solution import NoSolution
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_frame

Picture = np.ndarray
Random = np.random.Generator
HEIGHT, WIDTH = 800, 1200


def _places(shape: tuple[int, int]) -> tuple[Picture, Picture]:
    """Across and down, from -1 to 1 over the longer side."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    half = max(shape) / 2.0
    return (x - shape[1] / 2.0) / half, (y - shape[0] / 2.0) / half


def vignetted(rng: Random, level: float, fast: float = 0.6, shape: tuple[int, int] = (HEIGHT, WIDTH)) -> Picture:
    """An even sky through a lens: cos^4 of the angle, the optical axis not quite in the middle."""
    x, y = _places(shape)
    off = rng.normal(0.0, 0.05, 2)
    return level / (1.0 + fast**2 * ((x - off[0]) ** 2 + (y - off[1]) ** 2)) ** 2


def amp_glow(picture: Picture, rng: Random, strength: float) -> Picture:
    """Warm electronics at an edge, or in two corners, falling off within a tenth of the frame."""
    x, y = _places(picture.shape)
    for _ in range(int(rng.integers(1, 4))):
        at = rng.choice([-1.0, 1.0]) * 1.02, rng.uniform(-0.7, 0.7)
        picture = picture + strength * np.exp(-np.hypot(x - at[0], 1.5 * (y - at[1])) / rng.uniform(0.05, 0.2))
    return picture


def dust(picture: Picture, rng: Random, count: int, depth: float, radius_px: float = 0.0) -> Picture:
    """Shadows of specks, rings as wide as the light's cone there; a flat of another night makes them bright."""
    picture = picture.copy()
    height, width = picture.shape
    for _ in range(count):
        outer = radius_px or rng.choice([11.0, 24.0, 60.0]) * rng.uniform(0.95, 1.05)
        hole = 0.35 * outer
        across, down = rng.uniform(0, width), rng.uniform(0, height)
        around = tuple(slice(max(int(c - outer) - 1, 0), int(c + outer) + 3) for c in (down, across))
        y, x = np.mgrid[around[0].start : min(around[0].stop, height), around[1].start : min(around[1].stop, width)]
        r = np.hypot(x - across, y - down)
        ring = np.clip(outer + 0.5 - r, 0.0, 1.0) * np.clip(r - hole + 0.5, 0.0, 1.0)
        picture[around] *= 1.0 - depth * rng.uniform(0.5, 1.0) * ring
    return picture


def gradient(picture: Picture, rng: Random, share: float) -> Picture:
    """A town or the Moon on one side."""
    x, y = _places(picture.shape)
    angle = rng.uniform(0, 2 * np.pi)
    return picture * (1.0 + share * (np.cos(angle) * x + np.sin(angle) * y))


def clouds(picture: Picture, rng: Random, share: float, slope: float = 1.7) -> Picture:
    """Moonlit cloud: noise whose amplitude falls as a power of the frequency."""
    fy, fx = np.fft.fftfreq(picture.shape[0])[:, None], np.fft.rfftfreq(picture.shape[1])[None]
    amplitude = (np.hypot(fy, fx * picture.shape[1] / picture.shape[0]) + 1e-3) ** -slope
    turn = 2.0 * np.pi * rng.random(amplitude.shape)
    noise = np.fft.irfft2(amplitude * (np.cos(turn) + 1j * np.sin(turn)), picture.shape)  # Wine has no complex exp
    return picture * (1.0 + share * noise / np.abs(noise).max())


def hot_pixels(picture: Picture, rng: Random, share: float, height: float) -> Picture:
    """Pixels that are too warm, some far more than others."""
    warm = rng.random(picture.shape) < share
    return picture + warm * rng.exponential(height, picture.shape)


def banded(picture: Picture, rng: Random, adu: float) -> Picture:
    """Rows read with an offset each, and two bad columns."""
    picture = picture + rng.normal(0.0, adu, picture.shape[0])[:, None]
    columns = rng.integers(0, picture.shape[1], 2)
    picture[:, columns] += 20.0 * adu
    return picture


def drops(picture: Picture, rng: Random, share: float) -> Picture:
    """Dew on the front lens: soft bright blobs, none as wide as the next."""
    y, x = np.mgrid[: picture.shape[0], : picture.shape[1]]
    for _ in range(12):
        size = rng.uniform(15.0, 90.0)
        r2 = (x - rng.uniform(0, picture.shape[1])) ** 2 + (y - rng.uniform(0, picture.shape[0])) ** 2
        picture = picture * (1.0 + share * np.exp(-r2 / 2.0 / size**2))
    return picture


def read_out(picture: Picture, rng: Random, gain: float = 1.5, noise: float = 8.0) -> Picture:
    """Photons and read noise, on a pedestal."""
    return rng.poisson(np.clip(picture, 0.0, None) * gain) / gain + rng.normal(300.0, noise, picture.shape)


def sixteen(picture: Picture) -> Frame:
    return Frame(np.clip(np.round(picture), 0, 65535).astype(np.uint16), saturation=65535.0)


def eight(picture: Picture, black: float, white: float, gamma: float = 1.0) -> Frame:
    """As a program stretches it for the screen."""
    level = np.clip((picture - black) / (white - black), 0.0, 1.0) ** gamma
    return Frame(np.round(255.0 * level).astype(np.uint8), saturation=255.0)


def jpeg(frame: Frame, quality: int) -> Frame:
    """The same through JPEG."""
    buffer = BytesIO()
    Image.fromarray(frame.pixels).save(buffer, "JPEG", quality=quality)
    return Frame(np.asarray(Image.open(buffer).convert("L")), saturation=255.0)


def flat_divided(picture: Picture, rng: Random, wrong: float) -> Picture:
    """Divided by a flat whose vignetting is too strong, its dust a little aside."""
    flat = dust(vignetted(rng, 1.0, 0.6 * (1.0 + wrong)), rng, 8, 0.06, 22.0)
    return 0.5 * picture / flat


def stretched(picture: Picture, shrink: float = 0.02) -> tuple[float, float]:
    """Black and white point, as an automatic stretch has them."""
    low, high = np.quantile(picture, (shrink, 1.0 - shrink / 10.0))
    return float(low), float(high + 0.2 * (high - low))


WAYS: list[tuple[str, Callable[[Random], Picture]]] = [
    ("plain", lambda r: vignetted(r, 3000.0)),
    ("dark, cover on", lambda r: vignetted(r, 5.0)),
    ("strong", lambda r: vignetted(r, 12000.0, 1.4)),
    ("amp glow", lambda r: amp_glow(vignetted(r, 400.0), r, 4000.0)),
    ("amp glow, bright", lambda r: amp_glow(vignetted(r, 2000.0), r, 30000.0)),
    ("dust", lambda r: dust(vignetted(r, 8000.0), r, 15, 0.08)),
    ("dust, one size", lambda r: dust(vignetted(r, 8000.0), r, 15, 0.1, 22.0)),
    ("dust, bright", lambda r: dust(vignetted(r, 8000.0), r, 15, -0.08)),
    ("dust, bright, one size", lambda r: dust(vignetted(r, 8000.0), r, 15, -0.06, 22.0)),
    ("dust, bright, small", lambda r: dust(vignetted(r, 8000.0), r, 25, -0.1, 11.0)),
    ("flat of another night", lambda r: flat_divided(dust(vignetted(r, 9000.0), r, 8, 0.06, 22.0), r, 0.2)),
    ("gradient", lambda r: gradient(vignetted(r, 3000.0), r, 0.6)),
    ("hot pixels", lambda r: hot_pixels(vignetted(r, 1000.0), r, 0.003, 800.0)),
    ("many hot pixels", lambda r: hot_pixels(vignetted(r, 300.0), r, 0.03, 2000.0)),
    ("hot pixels, smoothed", lambda r: ndimage.gaussian_filter(hot_pixels(vignetted(r, 500.0), r, 0.001, 9e3), 1.2)),
    (
        "hot pixels, resized",
        lambda r: ndimage.zoom(hot_pixels(vignetted(r, 500.0), r, 1e-3, 9e3)[::4, ::4], 4, order=1),
    ),
    ("clouds", lambda r: clouds(vignetted(r, 5000.0), r, 0.4)),
    ("clouds, rough", lambda r: clouds(vignetted(r, 5000.0), r, 0.5, 1.2)),
    ("clouds, soft", lambda r: clouds(vignetted(r, 15000.0), r, 0.5, 2.4)),
    ("clouds and gradient", lambda r: gradient(clouds(vignetted(r, 4000.0), r, 0.3), r, 0.5)),
    ("bands", lambda r: banded(vignetted(r, 600.0), r, 15.0)),
    ("dew", lambda r: drops(vignetted(r, 4000.0), r, 0.3)),
    ("dew, amp glow", lambda r: amp_glow(drops(vignetted(r, 1500.0), r, 0.2), r, 3000.0)),
    ("twilight", lambda r: gradient(vignetted(r, 26000.0), r, 0.3)),
]

"""By name, on a 16-bit sky background."""
AS_JPEG, AS_EIGHT_BIT = (0, 3, 5, 6, 8, 10, 11, 13, 16, 17, 18, 21), (1, 6, 12, 17)
"""Of which there is a JPEG, and a frame of 8 bit, as well."""


def starless(chosen: Collection[str] = ()) -> Iterator[tuple[str, Frame]]:
    """Forty frames, each with its name, or those that are chosen."""
    for seed, numbers, kind in (
        (2911, range(len(WAYS)), ""),
        (2912, AS_JPEG, ", JPEG"),
        (2913, AS_EIGHT_BIT, ", 8 bit"),
    ):
        for number in numbers:
            name, way = WAYS[number]
            if chosen and name + kind not in chosen:
                continue
            rng = np.random.default_rng([seed, number])
            picture = read_out(way(rng), rng)
            if not kind:
                yield name, sixteen(picture)
            elif kind == ", 8 bit":
                yield name + kind, eight(picture, *stretched(picture), gamma=0.45)
            else:
                yield name + kind, jpeg(eight(picture, *stretched(picture)), int(rng.choice([35, 60, 85, 95])))


def main() -> None:
    """``python -m tests.solver.starless``: what the doctor says of all."""
    said: Counter[str] = Counter()
    for name, frame in starless():
        found = run(solve_frame(frame, SolveOptions(timeout_s=20.0)))
        reason = str(found.reason) if isinstance(found, NoSolution) else "solved"
        said[reason] += 1
        print(f"{name:32} {reason}", flush=True)
    print(dict(said))


if __name__ == "__main__":
    main()
