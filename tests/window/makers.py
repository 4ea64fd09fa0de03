"""What a process may do in place of making the patterns for small fields; it finds these functions by name."""

import os
import time

from kochab.core.progress import Progress


def a_quarter(steps):
    steps.send(Progress("patterns", 0.25))
    time.sleep(0.7)
    steps.send("")


def full_disk(steps):
    steps.send("The disk is full.")


def dead(steps):
    os._exit(3)


def endless(steps):
    time.sleep(60)
