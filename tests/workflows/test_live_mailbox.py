"""One slot, latest wins: nothing grows however unlike the two sides' speeds are."""

import threading
import tracemalloc

import numpy as np

from kochab.workflows.live.capture import Mailbox


def test_the_newest_is_next_and_the_rest_is_counted() -> None:
    box: Mailbox[int] = Mailbox()
    assert box.take() is None
    for k in range(5):
        box.put(k)
    assert box.take() == 4
    assert box.take() is None
    assert (box.put_count, box.taken, box.dropped) == (5, 1, 4)


def test_closing_leaves_the_last_item_and_wakes_who_waits() -> None:
    box: Mailbox[int] = Mailbox()
    got = []
    waiter = threading.Thread(target=lambda: got.append(box.take(60.0)))
    waiter.start()
    box.close()
    waiter.join(10)
    assert got == [None]
    other: Mailbox[int] = Mailbox()
    other.put(1)
    other.close()
    other.put(2)
    assert other.take() == 1
    assert other.take(60.0) is None
    assert (other.put_count, other.taken, other.dropped) == (2, 1, 1)


def test_order_is_kept_and_every_item_is_taken_or_dropped() -> None:
    box: Mailbox[int] = Mailbox()
    turns = 20000

    def fill() -> None:
        for k in range(turns):
            box.put(k)
        box.close()

    writer = threading.Thread(target=fill)
    writer.start()
    seen = []
    while (last := box.take(10.0)) is not None:
        seen.append(last)
    writer.join(10)
    assert seen == sorted(seen)
    assert box.taken + box.dropped == box.put_count == turns


def test_memory_does_not_grow_over_thousands_of_turns() -> None:
    box: Mailbox[np.ndarray] = Mailbox()
    frame_bytes = 200_000
    tracemalloc.start()
    try:
        for turn in range(3000):
            box.put(np.empty(frame_bytes, np.uint8))
            if turn % 7 == 0:
                box.take()
        now, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert now < 2 * frame_bytes
    assert peak < 4 * frame_bytes
