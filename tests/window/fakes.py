"""An engine that knows the answer, for tests of the window."""

import threading
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from kochab.core.attitude import attitude_from, radec_deg
from kochab.core.camera import Camera
from kochab.core.errors import FrameError
from kochab.core.frame import Detections, Frame
from kochab.core.progress import Progress, Task
from kochab.core.solution import NamedStar, NoSolution, Reason, Solution
from kochab.solver import SolveOptions
from kochab.window.shell.commands import Parts

NAMES = ("Betelgeuse", "Rigel", "Bellatrix", "Mintaka", "Alnilam", "Alnitak", "Saiph", "Meissa")


@dataclass(frozen=True)
class FakeSolved:
    frame: Frame
    detections: Detections
    result: Solution | NoSolution


def star_field(width: int = 600, height: int = 400, stars: int = 40, seed: int = 1) -> Frame:
    """A uint16 frame of round stars on noise."""
    return Frame(pixels=_pixels(width, height, stars, seed), path="fake.fits")


@cache
def _pixels(width: int, height: int, stars: int, seed: int) -> np.ndarray:
    """Drawn once for all windows, and not to be written to."""
    rng = np.random.default_rng(seed)
    image = rng.normal(1000.0, 20.0, (height, width))
    yy, xx = np.mgrid[-6:7, -6:7]
    blob = np.exp(-(xx**2 + yy**2) / (2 * 1.6**2))
    for x, y, f in zip(
        rng.integers(8, width - 8, stars),
        rng.integers(8, height - 8, stars),
        10 ** rng.uniform(2.3, 4.6, stars),
        strict=True,
    ):
        image[y - 6 : y + 7, x - 6 : x + 7] += f * blob
    pixels = np.clip(image, 0, 65535).astype(np.uint16)
    pixels.setflags(write=False)
    return pixels


def fake_solution(width: int, height: int, fov_deg: float = 12.0, stars: int = 24) -> Solution:
    """A solution near Orion's belt whose stars agree with its own camera."""
    focal = width / 2 / np.tan(np.radians(fov_deg) / 2)
    camera = Camera.centred(width, height, float(focal))
    attitude = attitude_from(84.05, -1.2, 27.0)
    rng = np.random.default_rng(2)
    xy = rng.uniform((10, 10), (width - 10, height - 10), (stars, 2))
    attitude = type(attitude)(attitude.matrix, np.diag([1e-12, 1e-12, 1e-9]))
    bare = Solution(camera, attitude, (), 0.21, -14.3, "patterns")
    named = []
    for i, ((x, y), v) in enumerate(zip(xy, bare.sky_at(xy), strict=True)):
        ra, dec = radec_deg(v)
        name = NAMES[i] if i < len(NAMES) else ""
        named.append(NamedStar(float(x), float(y), f"HIP {25000 + 37 * i}", name, 1.0 + 0.3 * i, ra, dec, 0.1))
    times = {"read": 7.5, "detect": 21.0, "identify": 5.2, "attitude": 3.1, "total": 36.8}
    return Solution(camera, attitude, tuple(named), 0.21, -14.3, "patterns", detections=stars + 12, elapsed_ms=times)


def no_solution() -> NoSolution:
    return NoSolution(
        Reason.TRAILED,
        "Wait 5 s after the slew, then expose again.",
        tried="no hint, both parities",
        detections=31,
        elapsed_ms={"detect": 20.0, "total": 410.0},
        measured={"trail_px": 12.3, "trail_angle_deg": 37.0, "background": 812.0},
    )


@dataclass
class FakeEngine:
    """Answers at once, unless ``gate`` is given: then it yields until the gate opens."""

    frame: Frame = field(default_factory=star_field)
    result: Solution | NoSolution | None = None
    preparing: int = 0
    gate: threading.Event | None = None
    asked: list[SolveOptions] = field(default_factory=list)
    stopped: threading.Event = field(default_factory=threading.Event)

    def read(self, path: Path) -> Task[Frame]:
        yield Progress("read")
        if not path.exists():
            raise FrameError(f"There is no file {path.name}.")
        return self.frame

    def prepare(self) -> Task[None]:
        for i in range(self.preparing):
            yield Progress("patterns", i / self.preparing)
            while self.gate is not None and not self.gate.wait(0.005):
                yield Progress("patterns", 0.42)

    def solve(self, frame: Frame, options: SolveOptions, read_ms: float) -> Task[FakeSolved]:
        self.asked.append(options)
        try:
            while self.gate is not None and not self.gate.wait(0.005):
                yield Progress("identify", 0.4, "patterns")
        except GeneratorExit:
            self.stopped.set()
            raise
        yield Progress("attitude", 0.9)
        result = self.result or fake_solution(frame.width, frame.height)
        stars = result.stars if isinstance(result, Solution) else ()
        xy = np.array([(s.x, s.y) for s in stars]).reshape(-1, 2)
        extra = np.random.default_rng(5).uniform((0, 0), (frame.width, frame.height), (12, 2))
        found = Detections.from_list(np.vstack([xy, extra]), frame.width, frame.height)
        return FakeSolved(frame, found, result)


def brightness(picture, stretch, shift=0.0):
    """Look-up table from stored values of an opened frame, ``shift`` too high, to brightness."""
    levels = 256 if picture.mono[0].dtype == np.uint8 else 65536
    return stretch.table(levels, picture.low + shift, picture.high + shift)


def close_windows(*made: Parts) -> None:
    """Close windows, by their parts, and wait for their jobs.

    No thread of theirs runs on; the one that loads the plotting library does it for the process.
    """
    for parts in made:
        parts.window.close()
        assert parts.session.jobs.join(60.0)
    for thread in threading.enumerate():
        if thread.name == "kochab-plots":
            thread.join(30.0)
    left = [t.name for t in threading.enumerate() if t.name.startswith(("kochab-", "polar-"))]
    assert not left, f"threads left behind: {left}"
