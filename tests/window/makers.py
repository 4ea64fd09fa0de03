"""What a process may do in place of making the patterns for small fields; it finds these functions by name."""

import os
import signal
import time

from kochab.core.progress import Progress
from kochab.identification import index_build
from kochab.identification.index import fine_folder
from kochab.identification.index_build import acquire
from kochab.workflows.fine_patterns import make_here

BRIGHT = 60_000


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


def deaf(steps):
    """Half made, and in a sort that hears no signal."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    folder = fine_folder()
    folder.parent.mkdir(parents=True, exist_ok=True)
    acquire(folder.with_suffix(".lock"))
    folder.with_suffix(".part").mkdir()
    steps.send(Progress("patterns", 0.5))
    time.sleep(60)


def of_bright_stars(steps):
    """Real patterns, of the brightest stars alone, and half made for as long as it takes."""
    all_stars, build = index_build.by_brightness, index_build.build_volume

    def half(*arguments, **more):
        for step in build(*arguments, **more):
            yield step
            if step.fraction:
                time.sleep(60)

    index_build.by_brightness = lambda: tuple(each[:BRIGHT] for each in all_stars())
    index_build.build_volume = half
    make_here(steps)


def within_a_step(steps, folder):
    """Ended while a step is under way, as SciPy's threads search."""

    def make():
        try:
            yield Progress("patterns", 0.5)
            time.sleep(60)
        finally:
            (folder / "closed").touch()

    index_build.make_fine = make
    make_here(steps)
