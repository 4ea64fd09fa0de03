import gc
import weakref

from kochab.window.application import Garbage


class Ring:
    def __init__(self):
        self.me = self


def test_rings_are_collected_by_the_tick_and_by_nothing_else(qtbot):
    garbage = Garbage()
    try:
        garbage.tick()
        assert not gc.isenabled()
        ring = weakref.ref(Ring())
        many = [[i] for i in range(5000)]  # would have set off Python's own collection
        assert ring() is not None
        garbage.tick()
        assert ring() is None
        assert len(many) == 5000
    finally:
        garbage.stop()
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0
