"""How fast a stream is tracked: frames a second, latency, processor time, memory over two hours."""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from app.bench.live_stream import Ring, make_ring
from app.core.frame import Frame
from app.core.progress import run
from app.solve.track import Tracker, TrackUpdate

Draw = Callable[[Frame, TrackUpdate], None]
"""Shows one frame and its answer; its time counts towards the latency."""


@dataclass(slots=True)
class Pace:
    """Times of many frames, milliseconds, and how each was answered."""

    wall_ms: list[float] = field(default_factory=list)
    cpu_ms: list[float] = field(default_factory=list)
    tracked: int = 0
    solved: int = 0

    @property
    def frames_s(self) -> float:
        """Frames a second, one after another without a pause."""
        return 1e3 / float(np.mean(self.wall_ms))

    def row(self, what: str) -> dict[str, Any]:
        """One line of the table."""
        wall, cpu = np.array(self.wall_ms), np.array(self.cpu_ms)
        return {
            "what": what, "frames": len(wall), "tracked": self.tracked / len(wall),
            "frames_s": self.frames_s, "median_ms": float(np.median(wall)),
            "p95_ms": float(np.percentile(wall, 95)), "worst_ms": float(wall.max()),
            "cpu_ms": float(cpu.mean()),
        }  # fmt: skip


def measure(ring: Ring, count: int, draw: Draw | None = None, fps: float = 30.0) -> Pace:
    """Track ``count`` frames as fast as it goes, after one that is solved as a whole."""
    tracker, pace = Tracker(), Pace()
    for number, (frame, moment, _) in enumerate(ring.stream(count + 1, fps)):
        wall, cpu = time.perf_counter(), time.process_time()
        update = run(tracker.update(frame, moment))
        if draw is not None:
            draw(frame, update)
        spent = time.perf_counter() - wall, time.process_time() - cpu
        if number:
            pace.wall_ms.append(1e3 * spent[0])
            pace.cpu_ms.append(1e3 * spent[1])
            pace.tracked += update.mode == "tracking"
            pace.solved += update.solution is not None
    return pace


def paced(ring: Ring, seconds: float, fps: float) -> dict[str, Any]:
    """Track in real time at ``fps``; the share of one core that it takes."""
    tracker = Tracker()
    frames = ring.stream(max(2, round(seconds * fps)) + 1, fps)
    frame, moment, _ = next(frames)
    run(tracker.update(frame, moment))
    begin, cpu, late, count = time.perf_counter(), time.process_time(), 0, 0
    for frame, moment, _ in frames:
        due = begin + count / fps
        time.sleep(max(0.0, due - time.perf_counter()))
        run(tracker.update(frame, moment))
        count += 1
        late += time.perf_counter() > due + 1.0 / fps
    wall = time.perf_counter() - begin
    return {"what": f"{fps:g} frames a second in real time", "frames": count, "late": late,
            "cores": (time.process_time() - cpu) / wall}  # fmt: skip


def soak(count: int, report: Callable[[str], None], fps: float = 10.0) -> dict[str, Any]:
    """Memory over ``count`` frames of a stream at ``fps``, in accelerated time."""
    ring, tracker = make_ring(640, 480), Tracker()
    settled, before, tracked = min(count // 4, 2000), 0.0, 0
    for number, (frame, moment, _) in enumerate(ring.stream(count, fps)):
        update = run(tracker.update(frame, moment))
        tracked += update.mode == "tracking"
        if number == settled:
            before = resident_mb()
        if number and number % 10_000 == 0:
            report(f"  {number} frames, {resident_mb():.1f} MB")
    return {"what": f"{count / fps / 3600:.2f} h of stream at {fps:g} frames a second",
            "frames": count, "tracked": tracked / count, "memory_mb": resident_mb(),
            "growth_mb": resident_mb() - before}  # fmt: skip


def resident_mb() -> float:
    """Memory of this process now, MB; where the system does not tell, the most there ever was.

    NaN on Windows, which tells neither.
    """
    try:
        import resource
    except ImportError:
        return float("nan")
    statm = Path("/proc/self/statm")
    if statm.exists():
        return int(statm.read_text("ascii").split()[1]) * resource.getpagesize() / 1e6
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most / (1e6 if sys.platform == "darwin" else 1e3)
