"""Two hours of a stream are a few thousand turns of this loop: what it holds does not grow."""

import gc
import tracemalloc

from kochab.workflows.live.capture import Capture
from kochab.workflows.live.solve import live_solve
from kochab.workflows.live.update import LiveUpdate

from .live_sources import Clockwork, Told, refusal, solution

FRAME_BYTES = 400 * 600 * 2


def test_a_long_stream_holds_no_more_than_a_short_one() -> None:
    source = Clockwork(size=(400, 600))
    source.complaints = lambda: ("File skipped: it is broken.",)
    engine = Told(lambda n: solution(80.0 + n * 1e-6) if n % 5 else refusal())
    live = live_solve(Capture(lambda: source), engine)
    held = {}
    tracemalloc.start()
    try:
        for turn, _ in enumerate((step for step in live if isinstance(step, LiveUpdate)), 1):
            if turn in (200, 700):
                gc.collect()  # what is only waiting to be let go is not held
                held[turn] = tracemalloc.get_traced_memory()[0]
            if turn == 700:
                break
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        live.close()
        tracemalloc.stop()
    # 500 further turns leave nothing behind: at one of the two moments a frame may be on its way
    assert held[700] - held[200] < 2 * FRAME_BYTES
    assert peak < 12 * FRAME_BYTES
