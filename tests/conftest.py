"""What every test may lean on: a screenless Qt, settings of its own, and the real frames."""

import gc
import logging
import os
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from tests import workers
from tests.patterns import REPOSITORY, choose_folder, make
from tests.windows.lacking import skip_what_wine_lacks


def folders_of_its_own() -> tempfile.TemporaryDirectory[str]:
    """Folders for the settings of this process alone."""
    home = tempfile.TemporaryDirectory(prefix="kochab-tests-")
    for name in ("CONFIG", "CACHE", "DATA", "STATE"):
        folder = Path(home.name, name.lower())
        folder.mkdir()
        os.environ[f"XDG_{name}_HOME"] = str(folder)
    # Windows has one folder for all of these; platformdirs from 4.9 on takes it from here.
    os.environ["WIN_PD_OVERRIDE_LOCAL_APPDATA"] = str(Path(home.name, "config"))
    return home


# Before anything imports Qt or asks where settings live.
_home = folders_of_its_own()
_owner = os.getpid()

choose_folder()

# As the program itself has it: our matrices are small, and threads of the linear algebra take a tenth more of the processor.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A shell lets what it runs in the background ignore Ctrl-C, and so would every child of a test.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# A machine that is busy must not fail a test; the machine that judges repeats its examples.
settings.register_profile("house", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.register_profile("smoke", deadline=None, max_examples=10)
settings.load_profile("ci" if os.environ.get("CI") else "house")


@pytest.fixture(scope="session", autouse=True)
def _searches_have_time():
    """The half minute that a search has where nobody says otherwise is too short beside other tests on a slow machine."""
    from kochab.core.progress import Stopwatch
    from kochab.solver import SolveOptions

    begin = Stopwatch.__init__

    def patient(self, timeout_s=None, read_ms=0.0):
        begin(self, None if timeout_s == SolveOptions().timeout_s else timeout_s, read_ms)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Stopwatch, "__init__", patient)
        yield


@pytest.fixture(autouse=True)
def _no_mount_is_remembered():
    """The next test's mount may answer at the same port."""
    yield
    for folder, kept in (("config", "needs-sync"), ("state", "last-seen"), ("config", "last-seen")):
        for path in Path(_home.name, folder, "kochab", "mounts").glob(f"*-{kept}.json"):
            path.unlink()


@pytest.fixture(autouse=True)
def _no_journal_stays_open():
    """The next test's faults may have no journal, or one of its own."""
    logger = logging.getLogger("kochab")
    before = list(logger.handlers)
    yield
    for handler in set(logger.handlers) - set(before):
        logger.removeHandler(handler)
        if isinstance(handler, logging.FileHandler):  # not logging's own handler of last resort
            handler.close()


def pytest_configure() -> None:
    """Let astropy, the truth of many tests, fetch no tables, and use its own however old they are."""
    global _home, _owner
    from astropy.utils import iers

    if _owner != os.getpid():  # a fork of the process that imported the tests, whose folders stay its own
        _home._finalizer.detach()
        _home, _owner = folders_of_its_own(), os.getpid()
    gc.disable()  # while tests are collected: 26 times 0.1 to 0.26 s, for nothing
    iers.conf.auto_download = False
    iers.conf.auto_max_age = None


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Eight processes more than there are cores, as far as the memory goes.

    All tests compute for 1,150 s on a machine where 1,700 s were needed before they were made lighter, and wait for about
    4,500 s: for lines, exposures, screens and INDI's drivers. With six more than its two cores a run took 13:45, with ten
    12:24, but those compete: each test then takes a third longer, and on a slow machine waits overrun. Each costs a second
    of processor before its first test, and up to 0.7 GB.
    """
    import psutil

    from kochab.core.threads import processors

    return max(1, min(processors() + 8, int(psutil.virtual_memory().available / 0.7e9)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes(config: pytest.Config, specs: list[Any]) -> None:
    """Let the processes be forks of one that has imported the tests, where that is safe."""
    if sys.platform != "linux" or len(specs) < 3:
        return
    stack = ExitStack()
    config.add_cleanup(stack.close)
    command = stack.enter_context(workers.forking(config.args))
    for spec in specs:
        spec.python = command


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What Wine lacks is no fault of Kochab's; what takes longest begins first."""
    skip_what_wine_lacks(items)
    items[:] = longest_first(items, int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")))


LONGEST = (
    "tests/boards/test_evenings.py::test_an_evening_by_the_computers_clock",
    "tests/boards/test_through_indi.py",
    "tests/cli/test_mount_centre.py::test_disagree_judges",
    "tests/fuzz/test_fuzz.py::test_a_few_mutants",
    "tests/gear/mounts/test_clock_and_site.py::test_nothing_is_set",
    "tests/gear/mounts/test_flip.py::test_indis_simulator",
    "tests/gear/mounts/test_indi.py",
    "tests/gear/mounts/test_killed.py::test_a_computer_that_slept",
    "tests/gear/mounts/test_probe.py::test_a_line_that_speaks_unasked",
    "tests/gear/mounts/test_skywatcher_home.py::test_axes_nudged",
    "tests/gear/mounts/test_udp.py::test_a_slew_arrives",
    "tests/lab/bench/test_night.py",
    "tests/polar/test_indi.py",
    "tests/simulate/test_eqmod_axes.py",
    "tests/window/mount/test_screen.py",
    "tests/window/polar/test_view.py::test_a_second_sweep",
    "tests/window/polar/test_view.py::test_a_whole_alignment",
    "tests/window/polar/test_view.py::test_motors_turn",
    "tests/workflows/test_encoder_aid.py",
    "tests/workflows/test_gyro_aid.py",
    "tests/workflows/test_night_on_indi.py",
)
"""Tests of 15 s and more, most of them in real time: the last to begin would be waited for by every other process."""


def longest_first(items: list[pytest.Item], workers: int) -> list[pytest.Item]:
    """The long ones spread over the beginnings of what pytest-xdist's ``worksteal`` gives each process at first."""
    first = [item for item in items if item.nodeid.startswith(LONGEST)]
    others = iter([item for item in items if not item.nodeid.startswith(LONGEST)])
    order: list[pytest.Item] = []
    for worker in range(workers):
        share, mine = (len(items) - len(order)) // (workers - worker), first[worker::workers]
        order += mine
        order += islice(others, max(share - len(mine), 0))
    return order


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """A short name for a test of a long text: Windows holds 32,767 letters in the variable that tells it."""
    return argname if isinstance(val, str | bytes) and len(val) > 500 else None


# A session of so many tests needs the patterns of small fields, and makes them on no test's time:
# on a busy machine they take longer than a test may.
MANY = 1000


def pytest_collection_finish(session: pytest.Session) -> None:
    """The patterns, unless ``make test`` has made them beside its checks.

    What seven thousand tests have imported is not looked through again whenever garbage is collected:
    that took a quarter of a second, in which no simulated mount answered.

    An address in a test's name differs between processes, and pytest-xdist runs nothing then.
    """
    assert not [item.nodeid for item in session.items if " at 0x" in item.nodeid]
    gc.freeze()
    gc.enable()
    if len(session.items) < MANY or session.config.option.collectonly:
        return
    make()


@pytest.fixture(scope="session", autouse=True)
def no_thread_spins() -> Iterator[None]:
    """No test leaves a thread behind that spins: one in a simulated server took a third of a core to the end."""
    yield
    tasks = Path("/proc/self/task")
    if not tasks.is_dir():
        return

    def ticks() -> dict[int, int]:
        """Processor time of each thread but this one, in hundredths of a second on Linux."""
        found = {}
        for thread in threading.enumerate():
            with suppress(OSError):
                fields = (tasks / str(thread.native_id) / "stat").read_text().rpartition(")")[2].split()
                found[thread.native_id or 0] = int(fields[11]) + int(fields[12])
        return found

    before = ticks()
    time.sleep(0.5)
    after = ticks()
    own, names = threading.get_native_id(), {thread.native_id: thread.name for thread in threading.enumerate()}
    assert not [names.get(one) for one in after if one != own and after[one] - before.get(one, after[one]) > 5]


@pytest.fixture(scope="session")
def repository() -> Path:
    """The checkout these tests belong to."""
    return REPOSITORY


@pytest.fixture(scope="session")
def shared_frames() -> Path:
    """Real photographs with their truth, beside the checkout; the test is skipped without."""
    folder = REPOSITORY.parent / "shared" / "frames"
    if not folder.is_dir():
        pytest.skip("the real frames (../shared/frames) are not beside this checkout")
    return folder


@pytest.fixture(scope="session")
def frames_reach() -> Path:
    """Real pictures that are hard to solve, with what is known of them; the test is skipped without."""
    folder = REPOSITORY.parent / "shared" / "frames-reach"
    if not folder.is_dir():
        pytest.skip("the hard frames (../shared/frames-reach) are not beside this checkout")
    return folder


@pytest.fixture(scope="session")
def shared_series() -> Path:
    """Real series of frames with their truths, beside the checkout; the test is skipped without."""
    folder = REPOSITORY.parent / "shared" / "series"
    if not folder.is_dir():
        pytest.skip("the real series (../shared/series) are not beside this checkout")
    return folder
