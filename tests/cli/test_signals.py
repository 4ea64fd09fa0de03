"""A polite kill and a terminal that closes end a command as Ctrl-C does."""

import os
import signal
import threading
import time

import pytest

from kochab.cli.process import POLITE, ended_by_signals

THERE = [getattr(signal, name) for name in POLITE if hasattr(signal, name)]
pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows ends a process without asking")


@pytest.mark.parametrize("number", THERE)
def test_it_ends_like_ctrl_c_and_only_meanwhile(number) -> None:
    before = signal.signal(number, signal.SIG_DFL)  # under nohup the tests inherit it ignored

    def work() -> None:
        with ended_by_signals():
            os.kill(os.getpid(), number)
            time.sleep(5.0)

    try:
        with pytest.raises(KeyboardInterrupt):
            work()
        assert signal.getsignal(number) is signal.SIG_DFL
    finally:
        signal.signal(number, before)


def test_what_nohup_ignores_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with ended_by_signals():
            os.kill(os.getpid(), signal.SIGHUP)
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_another_thread_can_run_a_command() -> None:
    done = []

    def work() -> None:
        with ended_by_signals():
            done.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [signal.getsignal(signal.SIGTERM)]
