"""Small real files of every format, written by the formats' own libraries."""

import errno
import os
import pickle
import socket
import struct
import subprocess
import sys
import threading
import time
from contextlib import suppress
from functools import partial

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


TICKS_1970 = 621_355_968_000_000_000  # .NET's, of 100 ns since the year 1


def ser(path, frames, depth=16, colour=0, flag=0, order="<", seconds=()):
    """A SER video as its description has it; ``seconds`` since 1970 are the frames' times, ``flag`` the header's."""
    height, width = frames[0].shape[:2]
    texts = (text.ljust(40).encode() for text in ("Ann", "ZWO ASI290MM", "fps=80.00gain=30exp=0.38"))
    numbers = (0, colour, flag, width, height, depth, len(frames))
    started = TICKS_1970 + 1_700_000_000 * 10**7
    head = struct.pack("<14s7i40s40s40s2q", b"LUCAM-RECORDER", *numbers, *texts, started + 36_000_000_000, started)
    kind = "u1" if depth <= 8 else f"{order}u2"
    body = b"".join(np.asarray(frame, dtype=kind).tobytes() for frame in frames)
    trailer = b"".join(struct.pack("<q", TICKS_1970 + round(s * 10**7)) for s in seconds)
    path.write_bytes(head + body + trailer)
    return path


def avi(path, frames, codec="rawvideo", stored="bgr24"):
    """An AVI video of grey (H, W) or colour (H, W, 3) frames as FFmpeg writes it, ``stored`` in this pixel format."""
    import av

    with av.open(str(path), "w", format="avi") as video:
        stream = video.add_stream(codec, rate=10)
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = stored
        for frame in frames:
            own = "rgb24" if frame.ndim == 3 else "gray16le" if frame.dtype == np.uint16 else "gray"
            for packet in stream.encode(av.VideoFrame.from_ndarray(frame, format=own).reformat(format=stored)):
                video.mux(packet)
        for packet in stream.encode():
            video.mux(packet)
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
    ser(folder / "a.ser", [data, data + 1], seconds=(1.7e9, 1.7e9 + 1.0))
    avi(folder / "a.avi", [rgb, rgb // 2])
    return sorted(folder.iterdir())


def faulty_reader(path):
    """What another package may register: it meets something it did not foresee."""
    return {"exposure": 1.0}["gain"]


def careless_reader(path):
    return np.zeros((4, 4))


# Readers that only a process of their own survives; each first opens its file, so that a test sees it begin.

_opened = []


def begin(path):
    _opened[:] = [open(path, "rb")]  # noqa: SIM115


def stuck_reader(path):
    begin(path)
    time.sleep(3600.0)


def busy_reader(path):
    begin(path)
    while True:
        sum(range(10**6))


def crashing_reader(path):
    os.abort()


def greedy_reader(path):
    return Frame(np.ones((20_000, 20_000)), path=str(path))


def growing_reader(path):
    """Takes 0.6 GB, then does nothing more."""
    taken = []
    while True:
        if len(taken) < 12:
            taken.append(np.ones(50_000_000, np.uint8))
        time.sleep(0.02)


def quick_reader(path):
    print("what a library has to say")
    return Frame(sky(), colours(), path=str(path))


class _Run:
    def __reduce__(self):
        return open, ("run-by-a-pickle", "w")


def pickling_reader(path):
    """Taken over, it writes to its parent what would run there if it were unpickled."""
    body = pickle.dumps(_Run())
    for pipe in range(3, 64):  # whichever leads to the parent
        with suppress(OSError):
            os.write(pipe, struct.pack("=QQ", 1, len(body)) + body)
    os._exit(0)


def size_reader(path):
    return Frame(sky(), path=str(path), header={"bytes": path.stat().st_size})


def told_reader(path):
    """What a process may do that reads, as the header of its frame: each thing by its name, or why not."""
    return Frame(sky(), path=str(path), header={name: _tried(partial(*thing)) for name, thing in FORBIDDEN.items()})


def _tried(thing):
    try:
        thing()
    except OSError as error:
        return errno.errorcode[error.errno]
    return "done"


def starting_reader(path):
    """Starts a program, which a job of Windows with room for one process does not let it."""
    done = subprocess.run([sys.executable, "-c", "print('started')"], capture_output=True, text=True)
    return Frame(sky(), path=str(path), header={"answered": done.stdout, "code": done.returncode})


def _thread_writes():
    """A thread may do no more."""
    told = []
    thread = threading.Thread(target=lambda: told.append(_tried(partial(open, "/tmp/kochab-written", "w"))))
    thread.start()
    thread.join()
    raise OSError(getattr(errno, told[0], 0), "")


FORBIDDEN = {
    "read a file": (open, "/etc/hostname"),
    "write a file": (open, "/tmp/kochab-written", "w"),
    "append to what was read": (open, __file__, "a"),
    "make a folder": (os.mkdir, "/tmp/kochab-made"),
    "remove a file": (os.unlink, __file__),
    "rename a file": (os.rename, __file__, __file__ + ".moved"),
    "make a link": (os.symlink, "/etc", "/tmp/kochab-link"),
    "write in a thread": (_thread_writes,),
    "start a program": (os.execv, "/bin/true", ["true"]),
    "start a program in a child": (subprocess.run, ["/bin/true"]),
    "open a connection": (socket.create_connection, ("127.0.0.1", 9)),
    "open a port": (socket.create_server, ("127.0.0.1", 0)),
    "send a datagram": (socket.socket, socket.AF_INET, socket.SOCK_DGRAM),
    "talk to this computer's services": (socket.socket, getattr(socket, "AF_UNIX", 1)),
    "end another process": (os.kill, os.getppid(), 0),
}
