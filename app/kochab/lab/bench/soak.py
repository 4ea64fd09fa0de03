"""``kochab bench soak``: 20,000 solves and eight simulated hours of Live with faults; memory stays as it is.

A turn solves lists blind, with a scale and of random points, a rendered frame and a file, which may be broken,
and lets Live look at a few frames of a simulated telescope under passing clouds: frames get lost, come
black, of noise or of another size, and the camera is unplugged now and then.
"""

import ctypes
import math
import tempfile
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from threading import Semaphore
from typing import Any

import numpy as np

from kochab.core.capture import CaptureSettings
from kochab.core.errors import FrameError, LineLostError
from kochab.core.frame import Frame, Hint
from kochab.core.progress import run as drive
from kochab.core.solution import Solution
from kochab.core.values import mutable
from kochab.frames import read_frame
from kochab.frames.fits_write import fits_bytes
from kochab.identification.index_build import make_fine
from kochab.lab.bench import BenchResult, Goal, Report
from kochab.lab.bench.live import resident_mb
from kochab.simulate.camera import CameraConfig
from kochab.simulate.camera_source import SimulatedCamera
from kochab.simulate.night_sky import WeatherConfig, midnight_unix
from kochab.simulate.random_fields import FieldPlan, random_field, random_picture, random_points
from kochab.simulate.rig import PracticeRig, RigConfig
from kochab.sky import open_catalogue
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_detections, solve_frame
from kochab.workflows.live.capture import Capture
from kochab.workflows.live.solve import WARNING, Live, ProfiledTracker, live_solve
from kochab.workflows.live.update import LiveUpdate

SEED = 20261123
TURNS, QUICK_TURNS = 500, 8
LISTS_A_TURN, LIVE_A_TURN = 34, 4
SOLVES_A_TURN = LISTS_A_TURN + LIVE_A_TURN + 2
HOURS = 8.0
PACED_HOURS = 8.2  # the frames on which the camera is unplugged take no time
EXPOSURE_S = 2.0
FIELDS_DEG = (0.8, 1.5, 3.0, 6.0, 12.0, 25.0, 50.0)
WARM = 0.1
"""After this share of the turns everything is imported, and what is kept on purpose is there."""
GROWTH = 0.05


def run(quick: bool, report: Report) -> BenchResult:
    """Solve, and watch the memory."""
    drive(make_fine(), lambda p: report(f"patterns for small fields: {p.detail}"))
    turns = QUICK_TURNS if quick else TURNS
    with tempfile.TemporaryDirectory(prefix="kochab-soak-") as folder:
        row = soak(turns, Path(folder), report)
    return BenchResult("soak", [row], goals(row))


def soak(turns: int, folder: Path, report: Report) -> dict[str, Any]:
    """So many turns; what they gave, and the memory after a tenth of them and at the end."""
    work, warm = Work(np.random.default_rng(SEED), folder, Counter()), max(1, math.ceil(WARM * turns))
    few = max(1, warm // 5)  # turns whose median counts: a frame may be on its way at any one
    camera = FaultyCamera(night_rig(), PACED_HOURS * 3600.0 / (turns * LIVE_A_TURN))
    live, memory = live_solve(Capture(lambda: camera, reconnect=True), ProfiledTracker()), []
    try:
        for turn in range(turns):
            work.lists()
            work.picture(turn)
            watch(live, camera, work.counts)
            if any(end - few <= turn < end for end in (warm, turns)):
                return_free_memory()
            memory.append((resident_mb("RssAnon"), resident_mb()))
            if (turn + 1) % max(1, turns // 20) == 0:
                report(f"  {(turn + 1) * SOLVES_A_TURN} solves, {memory[-1][0]:.1f} MB own, {memory[-1][1]:.1f} in all")
    finally:
        live.close()
    seen = np.array(memory)
    own_before, own_after = (float(np.median(seen[end - few : end, 0])) for end in (warm, turns))
    before = [slice(max(0, end - 2 * few), max(1, end - few)) for end in (warm, turns)]
    all_before, all_after = (float(np.median(seen[rows, 1])) for rows in before)
    hours = (camera.rig.clock.now_unix() - camera.rig.start_unix) / 3600.0
    return {
        "solves": turns * SOLVES_A_TURN,
        **{name: work.counts[name] for name in COUNTED},
        "live_hours": hours,
        "own_mb_warm": own_before,
        "own_mb": own_after,
        "resident_mb_warm": all_before,
        "resident_mb": all_after,
        "own_growth": own_after / own_before - 1.0,
        "resident_growth": all_after / all_before - 1.0,
    }


def return_free_memory() -> None:
    """Let the C library give back what is free between blocks in use (glibc): what is left is in use."""
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)


COUNTED = ("solved", "refused", "bad files", "live solved", "live not solved", "warnings")


def goals(row: dict[str, Any]) -> list[Goal]:
    """What the issue asks for; a short soak leaves the numbers of solves and hours unmeasured."""
    whole = row["solves"] >= TURNS * SOLVES_A_TURN
    return [
        Goal.at_most("growth of the resident memory, a tenth to the end", row["resident_growth"], GROWTH),
        Goal.at_most("the same of what is in use, without mapped files", row["own_growth"], GROWTH),
        Goal.at_least("solves for that", row["solves"] if whole else None, 20_000),
        Goal.at_least("simulated hours of Live with faults for that", row["live_hours"] if whole else None, HOURS),
    ]


@mutable
class Work:
    """The solves of a turn that are not Live's."""

    rng: np.random.Generator
    folder: Path
    counts: Counter[str]

    def lists(self) -> None:
        """Fields of all sizes, blind and with a scale, and now and then no field at all."""
        for number in range(LISTS_A_TURN):
            if number == 7:  # a refusal costs as much as thirty solutions
                self._count(drive(solve_detections(random_points(self.rng, int(self.rng.integers(5, 300))))))
                continue
            field = random_field(open_catalogue(), self.rng, FieldPlan(float(self.rng.choice(FIELDS_DEG))))
            scale = field.camera.scale_arcsec_px
            hint = Hint(scale_arcsec_px=(scale / 1.1, scale * 1.1)) if number % 2 else None
            self._count(drive(solve_detections(field.detections, SolveOptions(hint=hint))))

    def picture(self, turn: int) -> None:
        """A rendered frame, and the same from a file; every third of these is cut or garbled."""
        plan = FieldPlan(float(self.rng.choice(FIELDS_DEG[1:])), size_px=512)
        frame = random_picture(open_catalogue(), self.rng, plan).frame
        self._count(drive(solve_frame(frame, SolveOptions())))
        content = bytearray(fits_bytes(frame))
        if turn % 3 == 1:
            del content[int(self.rng.integers(1, len(content))) :]
        elif turn % 3 == 2:
            # The first block of a FITS file, 2,880 bytes, is all of a short header.
            content[:2880] = self.rng.bytes(2880)
        path = self.folder / "frame.fits"
        path.write_bytes(content)
        try:
            self._count(drive(solve_frame(read_frame(path), SolveOptions())))
        except FrameError:
            self.counts["bad files"] += 1

    def _count(self, answer: object) -> None:
        self.counts["solved" if isinstance(answer, Solution) else "refused"] += 1


def watch(live: Live, camera: "FaultyCamera", counts: Counter[str]) -> None:
    """Let Live look at a few frames more."""
    for _ in range(LIVE_A_TURN):
        camera.ask()
        for step in live:
            if isinstance(step, LiveUpdate):
                counts["live solved" if step.track.solution else "live not solved"] += 1
                counts["warnings"] += len(step.warnings)
                break
            counts["warnings"] += step.stage == WARNING  # told while the next frame is waited for


def night_rig() -> PracticeRig:
    """A telescope that follows the sky through a night of patchy cloud and a few solid banks."""
    config = RigConfig(seed=SEED, start_deg=(-60.0, 35.0))
    start = midnight_unix(config.date_unix, config.site) - HOURS / 2.0 * 3600.0
    banks = tuple((3600.0 * h, 3600.0 * h + 600.0, 9.0) for h in (1.0, 3.5, 6.0))
    return PracticeRig(
        replace(
            config,
            start_unix=start,
            camera=CameraConfig(640, 480, fov_deg=4.0, cheap=True),
            weather=WeatherConfig(cloud_cover=0.3, banks=banks, wind_arcsec=1.0),
        )
    )


class FaultyCamera(SimulatedCamera):
    """The rig's camera; a frame for each :meth:`ask`, and every so often none or a bad one.

    Between two frames ``every_s`` of simulated time pass. It may be opened again and again.
    """

    name = "faulty"

    def __init__(self, rig: PracticeRig, every_s: float) -> None:
        super().__init__(rig)
        self.every_s = every_s
        self.number = 0
        self._asked = Semaphore(0)
        self._rng = np.random.default_rng([SEED, 2])

    def configure(self, settings: CaptureSettings) -> CaptureSettings:
        """As the rig's camera does; the exposure stays."""
        return super().configure(replace(settings, exposure_s=EXPOSURE_S))

    def ask(self) -> None:
        """Want one frame more."""
        self._asked.release()

    def next_frame(self, timeout_s: float) -> Frame | None:
        """The frame that was asked for, or what became of it."""
        if not self._asked.acquire(timeout=timeout_s):
            return None
        self.number += 1
        fault = FAULTS.get(self.number % CYCLE)
        if fault is None:
            self.rig.clock.sleep(self.every_s)  # its exposures pass meanwhile
            return super().next_frame(timeout_s)
        if self.number % (CYCLE * 10) == UNPLUGGED:
            self.ask()  # the frame comes when the camera is back
            raise LineLostError("The camera was unplugged.")
        self.rig.clock.sleep(self.every_s)
        return fault(self._rng, self.rig.config.camera)

    def complaints(self) -> tuple[str, ...]:
        """A broken file, as a watched folder would report it."""
        return ("File skipped: it is broken.",) if self.number % CYCLE == 5 else ()

    def close(self) -> None:
        """It is opened again."""


def _black(_: np.random.Generator, camera: CameraConfig) -> Frame:
    return Frame(np.zeros((camera.height, camera.width), dtype=np.uint16))


def _noise(rng: np.random.Generator, camera: CameraConfig) -> Frame:
    return Frame(rng.integers(0, 65536, (camera.height, camera.width), dtype=np.uint16))


def _small(rng: np.random.Generator, _: CameraConfig) -> Frame:
    return Frame(rng.integers(90, 110, (60, 80), dtype=np.uint16))


CYCLE, UNPLUGGED = 40, 39
FAULTS: dict[int, Callable[[np.random.Generator, CameraConfig], Frame]] = {
    7: _black,
    17: _noise,
    27: _small,
    UNPLUGGED: _black,
}
"""What comes in place of a frame, by its number in the cycle."""
