"""Motorised adjusters on a pseudo-terminal: the driver beside a board that was written from the firmware's sources."""

import math
import time

import numpy as np
import pytest

from kochab.core.errors import LineLostError, NoAnswerError, RefusedError
from kochab.core.progress import run
from kochab.gear.adjusters import AdjusterAxis, Adjusters
from kochab.lab.bench.polar_rig import ALIGN, make_rig
from kochab.workflows.polar.align import align
from tests.gear.adjuster_board import AdjusterBoard, BoardOnPty

X, Y = AdjusterAxis.AZIMUTH, AdjusterAxis.ALTITUDE


def quick(**wishes):
    return AdjusterBoard(**{"steps_a_second": 3000.0, "acceleration": math.inf} | wishes)


@pytest.mark.parametrize("version", ["1.0.0", "1.2.0", "1.2.3"])
def test_each_motor_goes_as_far_as_it_is_asked(version):
    with BoardOnPty(quick(version=version)) as served:
        adjusters = Adjusters(served.port)
        steps = []
        run(adjusters.move(X, 400), steps.append)
        run(adjusters.move(Y, -250.4))
        run(adjusters.move(X, -100))
        assert served.board.position == {"X": 300, "Y": -250}
        assert {step.stage for step in steps} == {"turn"}
        assert max(step.fraction for step in steps) <= 1.0
        orders = [line for line in served.received if line not in (b"?",)]
        assert orders == [b"$J=G91G21X400.000F1000", b"$J=G91G21Y-250.400F1000", b"$J=G91G21X-100.000F1000"]
        adjusters.close()


def test_grbl_itself_moves_in_its_own_units():
    with BoardOnPty(quick(grbl=True)) as served:
        adjusters = Adjusters(served.port)
        run(adjusters.move(Y, 2.0))
        assert served.board.position == {"X": 0, "Y": 500}
        adjusters.close()


@pytest.mark.parametrize("grbl", [False, True])
def test_a_motion_that_is_given_up_is_stopped_and_the_next_one_goes(grbl):
    with BoardOnPty(AdjusterBoard(grbl=grbl, steps_a_second=1000.0)) as served:
        adjusters = Adjusters(served.port)
        far = 100.0 if grbl else 20_000.0
        task = adjusters.move(X, far)
        while not served.board.position["X"] > 50:
            next(task)
        task.close()
        stopped = served.board.position["X"]
        time.sleep(0.3)
        assert served.board.position["X"] == stopped < 15_000
        assert (b"\x85" if grbl else b"!") in served.received
        run(adjusters.move(Y, 1.0 if grbl else 100.0))
        assert served.board.position["Y"] == (250 if grbl else 100)
        adjusters.close()


def stopped_and_told(board, knob, units, sentence):
    with BoardOnPty(board) as served:
        adjusters = Adjusters(served.port)
        with pytest.raises(RefusedError, match=sentence):
            run(adjusters.move(knob, units))
        assert b"!" in served.received
        adjusters.close()


def test_a_motor_that_stands_still_is_told_and_stopped():
    board = quick()
    board.stalled = {"Y"}
    stopped_and_told(board, Y, 500, "altitude motor moved 0 of 500 units")


class LateBoard(AdjusterBoard):
    """Answers ok; its motor begins to turn ``late_s`` later."""

    late_s, due = 0.5, None

    def _jog(self, *order):
        self.due = self.now() + self.late_s, order
        return b"ok\r\n"

    def advance(self):
        if self.due and self.now() > self.due[0]:
            order, self.due = self.due[1], None
            super()._jog(*order)
        super().advance()


def test_a_motor_that_begins_late_is_not_given_up():
    with BoardOnPty(LateBoard(steps_a_second=3000.0, acceleration=math.inf)) as served:
        adjusters = Adjusters(served.port)
        run(adjusters.move(X, 400))
        assert served.board.position["X"] == 400
        run(adjusters.move(X, 0))
        assert b"!" not in served.received
        adjusters.close()


def test_a_motor_that_never_begins_is_stopped_before_that_is_told():
    board = LateBoard()
    board.late_s = math.inf
    stopped_and_told(board, X, 400, "azimuth motor moved 0 of 400 units")


def test_a_line_without_adjusters_is_told(monkeypatch):
    monkeypatch.setattr("kochab.gear.adjusters.HELLO_S", 0.1)
    board = quick()
    board.mute = True
    with BoardOnPty(board) as served, pytest.raises(NoAnswerError, match="No motorised adjusters answer"):
        Adjusters(served.port)


@pytest.mark.parametrize("lost", ["mute", "pulled"])
def test_a_board_that_is_lost_on_the_way_is_told(monkeypatch, lost):
    monkeypatch.setattr("kochab.gear.adjusters.ANSWER_S", 0.2)
    with BoardOnPty(AdjusterBoard(steps_a_second=500.0)) as served:
        adjusters = Adjusters(served.port)
        task = adjusters.move(X, 5000)
        next(task)
        next(task)
        if lost == "mute":
            served.board.mute = True
        else:
            served.pull()
        with pytest.raises(NoAnswerError if lost == "mute" else LineLostError):
            run(task)
        adjusters.close()


@pytest.mark.parametrize("arcmin_a_step", [(0.01, -0.004)])
def test_a_board_brings_a_rig_to_the_pole(arcmin_a_step):
    """From pictures of a rig, over the line, through the firmware, to the bolts."""
    sky = make_rig(np.random.default_rng([1, 3]), 45.0)
    sky.point(-40.0, 50.0)
    azimuth, altitude = arcmin_a_step

    def moved(across, up):
        sky.rig.mount.turn_bolts(up * altitude, across * azimuth)

    with BoardOnPty(quick(moved=moved)) as served:
        adjusters = Adjusters(served.port)
        done = run(align(sky, sky, sky.settings, ALIGN, motors=adjusters))
        adjusters.close()
    assert done.good
    assert sky.true_total_arcsec() < 30.0
