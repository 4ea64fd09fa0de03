"""Small real files of every format, written by the formats' own libraries."""

import os
import signal
import time

import numpy as np

from kochab.core.frame import Frame


def sky(height=48, width=64, seed=1):
    """A uint16 frame whose every pixel differs enough to notice shifts, flips and swaps."""
    noise = np.random.default_rng(seed).normal(1000.0, 30.0, (height, width))
    noise[10, 20] = 40000.0
    return noise.astype(np.uint16)


def colours(dtype=np.uint8, height=48, width=64):
    top = np.iinfo(dtype).max if np.dtype(dtype).kind == "u" else 1.0
    values = np.random.default_rng(2).random((height, width, 3)) * top * 0.9
    return values.astype(dtype)


def dng(path, mosaic, pattern=(0, 1, 1, 2), black=64, white=4095):
    """The fewest tags LibRaw wants of an uncompressed DNG; pattern 0 red, 1 green, 2 blue."""
    import tifffile

    one = (1, 1)
    matrix = [one if i % 4 == 0 else (0, 1) for i in range(9)]
    per_colour = (black,) * 4 if isinstance(black, int) else black
    tags = [
        (50706, "B", 4, (1, 4, 0, 0), True),
        (50707, "B", 4, (1, 1, 0, 0), True),
        (50708, "s", 0, "Kochab Test", True),
        (33421, "H", 2, (2, 2), True),
        (33422, "B", 4, pattern, True),
        (50713, "H", 2, (2, 2), True),
        (50714, "H", 4, per_colour, True),
        (50717, "H", 1, white, True),
        (50721, "2i", 9, tuple(n for pair in matrix for n in pair), True),
        (50728, "2I", 3, one * 3, True),
        (50778, "H", 1, 21, True),
        (271, "s", 0, "Kochab", True),
        (272, "s", 0, "Test", True),
    ]
    tifffile.imwrite(path, mosaic, photometric=32803, extratags=tags)
    return path


def heic(path, rgb, **options):
    import pillow_heif
    from PIL import Image

    pillow_heif.from_pillow(Image.fromarray(rgb)).save(path, quality=-1, chroma=444, **options)
    return path


def one_of_each(folder):
    """Paths of a small good file in every format and variant."""
    import tifffile
    from astropy.io import fits
    from PIL import Image
    from xisf import XISF

    data, rgb = sky(), colours()
    fits.PrimaryHDU(data).writeto(folder / "a.fits")
    fits.HDUList([fits.PrimaryHDU(), fits.CompImageHDU(data)]).writeto(folder / "a.fits.fz")
    fits.PrimaryHDU(data).writeto(folder / "a.fits.gz")
    XISF.write(str(folder / "a.xisf"), data[..., None])
    XISF.write(str(folder / "z.xisf"), rgb, codec="zlib", shuffle=True)
    tifffile.imwrite(folder / "a.tif", data)
    tifffile.imwrite(folder / "z.tif", data, compression="zlib", predictor=True)
    for name in ("a.png", "a.jpg", "a.bmp", "a.gif", "a.webp"):
        Image.fromarray(rgb).save(folder / name)
    Image.fromarray(data).save(folder / "d16.png")
    heic(folder / "a.heic", rgb)
    dng(folder / "a.dng", data // 16)
    return sorted(folder.iterdir())


def faulty_reader(path):
    """What another package may register: it meets something it did not foresee."""
    return {"exposure": 1.0}["gain"]


def careless_reader(path):
    return np.zeros((4, 4))


# Readers that only a process of their own survives; each first tells who it is.


def tell_who(path):
    path.with_suffix(".pid").write_text(str(os.getpid()))


def stuck_reader(path):
    tell_who(path)
    while True:
        sum(range(10**6))


def crashing_reader(path):
    tell_who(path)
    os.kill(os.getpid(), signal.SIGKILL)


def greedy_reader(path):
    tell_who(path)
    return Frame(np.ones((20_000, 20_000)), path=str(path))


def growing_reader(path):
    """Takes 0.6 GB, then does nothing more."""
    tell_who(path)
    taken = []
    while True:
        if len(taken) < 12:
            taken.append(np.ones(50_000_000, np.uint8))
        time.sleep(0.02)


def quick_reader(path):
    tell_who(path)
    print("what a library has to say")
    return Frame(sky(), colours(), path=str(path))
