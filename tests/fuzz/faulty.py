"""Checks that do what none may, for the tests of the runner."""

import os
import signal
import time


def raises(data, folder):
    raise KeyError("gain")


def crashes(data, folder):
    os.kill(os.getpid(), signal.SIGKILL)


def hangs(data, folder):
    while True:
        pass


def grows(data, folder):
    return b"x" * 1_100_000_000


def waits(data, folder):
    time.sleep(2.0)
