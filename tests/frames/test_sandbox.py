"""A decoder that hangs, crashes or grows costs its file one sentence, and no process stays behind."""

import ctypes
import os
import runpy
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from kochab.cli.main import main
from kochab.core.errors import FrameError
from kochab.frames import FORMATS, read_frame, reading, sandbox
from kochab.frames.samples import free_bytes
from kochab.gear.cameras import folder as folder_camera
from kochab.gear.cameras import open_camera
from tests.frames.files import colours, one_of_each, sky


def gone(pid):
    """Whether the process has ended, or ends soon."""
    for _ in range(200):
        try:
            os.kill(pid, 0)
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            return True
        if state == "Z":  # nobody has asked how it ended
            return True
        time.sleep(0.05)
    return False


@pytest.fixture
def odd(tmp_path, monkeypatch):
    """A file whose reader is the one that is named."""

    def named(reader, name="night.odd"):
        monkeypatch.setattr(FORMATS, "_others", {"odd": f"tests.frames.files:{reader}"})
        (path := tmp_path / name).write_bytes(b"ODD1")
        return path

    return named


def reader_of(path):
    return int(path.with_suffix(".pid").read_text())


def test_a_decoder_that_hangs_is_killed_at_the_deadline(odd):
    path = odd("stuck_reader")
    with pytest.raises(FrameError, match=r"^night.odd was not read within 3 s"):
        read_frame(path, timeout_s=3.0)
    assert gone(reader_of(path))


def test_a_decoder_that_hangs_is_killed_at_a_cancel(odd):
    path = odd("stuck_reader")
    task = reading(path, None)
    while not path.with_suffix(".pid").exists() or not path.with_suffix(".pid").read_text():
        next(task)
    task.close()
    assert gone(reader_of(path))


def test_the_time_limit_of_a_solve_covers_reading(odd, capsys):
    path = odd("stuck_reader")
    assert main(["solve", str(path), "--timeout", "3"]) == 2
    assert "night.odd was not read within 3 s" in capsys.readouterr().err


def test_a_decoder_that_crashes_costs_a_sentence_and_the_next_file_nothing(odd):
    with pytest.raises(FrameError, match=r"night.odd cannot be read: its decoder crashed"):
        read_frame(odd("crashing_reader"))
    np.testing.assert_array_equal(read_frame(odd("quick_reader")).pixels, sky())


@pytest.mark.skipif(sys.platform != "linux", reason="macOS bounds no process's memory")
def test_a_decoder_may_not_fill_the_memory(odd, monkeypatch):
    monkeypatch.setattr(sandbox, "LEAST_BYTES", 400_000_000)
    monkeypatch.setattr(sandbox, "MOST_BYTES", 400_000_000)
    with pytest.raises(FrameError, match=r"night.odd does not fit into the 0.4 GB there is for reading it"):
        read_frame(odd("greedy_reader"))
    assert read_frame(odd("quick_reader")).pixels.shape == (48, 64)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows limits the process's memory itself")
def test_a_decoder_that_grows_is_killed_where_nothing_bounds_it(odd, monkeypatch):
    """As on macOS: the process that waits for it asks how much it has, and no earlier test has bounded it."""
    sandbox._kill_idle()
    monkeypatch.setattr(sandbox, "WATCHED", True)
    monkeypatch.setattr(sandbox, "LEAST_BYTES", 400_000_000)
    monkeypatch.setattr(sandbox, "MOST_BYTES", 400_000_000)
    path = odd("growing_reader")
    with pytest.raises(FrameError, match=r"^night.odd does not fit into the 0.4 GB there is for reading it.$"):
        read_frame(path)
    assert gone(reader_of(path))
    assert read_frame(odd("quick_reader")).pixels.shape == (48, 64)


@pytest.mark.parametrize(
    ("system", "watched"), [("linux", False), ("win32", False), ("darwin", True), ("freebsd14", True)]
)
def test_a_decoder_is_watched_where_the_system_does_not_bound_it(monkeypatch, system, watched):
    monkeypatch.setattr(sys, "platform", system)
    assert runpy.run_path(sandbox.__file__)["WATCHED"] is watched


FROZEN = """#!{python}
import sys
from pathlib import Path
sys.frozen, sys.executable = True, str(Path(__file__).resolve())
sys.path[:0] = {path}
if sys.argv[1:2] != ["read-in-a-process-of-its-own"]:
    from kochab.frames import FORMATS, sandbox
    FORMATS._others = {{"odd": "tests.frames.files:" + sys.argv.pop()}}
    sandbox.LEAST_BYTES = sandbox.MOST_BYTES = 400_000_000
elif {windowed}:
    sys.stdin = None
from kochab.__main__ import main
sys.exit(main())
"""
"""As a program made of Kochab by PyInstaller is: its executable takes no options of Python's."""


@pytest.mark.skipif(sys.platform != "linux", reason="a script that is an executable, under a limit of Linux")
@pytest.mark.parametrize(
    ("reader", "said"),
    [
        ("greedy_reader", "night.odd does not fit into the 0.4 GB there is for reading it"),
        ("stuck_reader", "night.odd was not read within 5 s"),
        ("crashing_reader", "night.odd cannot be read: its decoder crashed"),
    ],
)
@pytest.mark.parametrize("windowed", [False, True])
def test_a_frozen_program_starts_itself_to_read(tmp_path, reader, said, windowed):
    path, program = tmp_path / "night.odd", tmp_path / "kochab"
    path.write_bytes(b"ODD1")
    program.write_text(FROZEN.format(python=sys.executable, path=sys.path, windowed=windowed))
    program.chmod(0o755)
    done = subprocess.run(
        [program, "solve", path, "--timeout", "5" if reader == "stuck_reader" else "60", reader],
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr


def test_another_s_frozen_program_is_not_started_to_read(monkeypatch):
    """Which might open its window: only Kochab's own knows what is wanted."""
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    monkeypatch.setattr(sandbox, "_own_program", False)  # and so again afterwards
    sandbox.leave_to_sandbox()
    sandbox.support_frozen(["solve"])
    with pytest.raises(sandbox.Outside):
        sandbox.leave_to_sandbox()


class BasicLimits(ctypes.Structure):
    """``JOBOBJECT_BASIC_LIMIT_INFORMATION`` (Microsoft's winnt.h)."""

    _fields_ = (
        ("PerProcessUserTimeLimit", ctypes.c_int64),
        ("PerJobUserTimeLimit", ctypes.c_int64),
        ("LimitFlags", ctypes.c_uint32),
        ("MinimumWorkingSetSize", ctypes.c_size_t),
        ("MaximumWorkingSetSize", ctypes.c_size_t),
        ("ActiveProcessLimit", ctypes.c_uint32),
        ("Affinity", ctypes.c_size_t),
        ("PriorityClass", ctypes.c_uint32),
        ("SchedulingClass", ctypes.c_uint32),
    )


class ExtendedLimits(ctypes.Structure):
    """``JOBOBJECT_EXTENDED_LIMIT_INFORMATION``; its ``IoInfo`` are six counters."""

    _fields_ = (
        ("BasicLimitInformation", BasicLimits),
        ("IoInfo", ctypes.c_uint64 * 6),
        ("ProcessMemoryLimit", ctypes.c_size_t),
        ("JobMemoryLimit", ctypes.c_size_t),
        ("PeakProcessMemoryUsed", ctypes.c_size_t),
        ("PeakJobMemoryUsed", ctypes.c_size_t),
    )


class Counters(ctypes.Structure):
    """``PROCESS_MEMORY_COUNTERS`` (psapi.h)."""

    _fields_ = (
        ("cb", ctypes.c_uint32),
        ("PageFaultCount", ctypes.c_uint32),
        ("PeakWorkingSetSize", ctypes.c_size_t),
        ("WorkingSetSize", ctypes.c_size_t),
        ("QuotaPeakPagedPoolUsage", ctypes.c_size_t),
        ("QuotaPagedPoolUsage", ctypes.c_size_t),
        ("QuotaPeakNonPagedPoolUsage", ctypes.c_size_t),
        ("QuotaNonPagedPoolUsage", ctypes.c_size_t),
        ("PagefileUsage", ctypes.c_size_t),
        ("PeakPagefileUsage", ctypes.c_size_t),
    )


class MemoryStatus(ctypes.Structure):
    """``MEMORYSTATUSEX`` (sysinfoapi.h)."""

    _fields_ = (
        ("dwLength", ctypes.c_uint32),
        ("dwMemoryLoad", ctypes.c_uint32),
        ("ullTotalPhys", ctypes.c_uint64),
        ("ullAvailPhys", ctypes.c_uint64),
        ("ullTotalPageFile", ctypes.c_uint64),
        ("ullAvailPageFile", ctypes.c_uint64),
        ("ullTotalVirtual", ctypes.c_uint64),
        ("ullAvailVirtual", ctypes.c_uint64),
        ("ullAvailExtendedVirtual", ctypes.c_uint64),
    )


def windows(monkeypatch, limits):
    """A kernel32 that holds the program to be a process of 0.25 GB, and keeps what limits it is given."""

    def counted(process, told, size):
        assert (process.value, size) == (ctypes.c_void_p(-1).value, ctypes.sizeof(Counters))
        counters = Counters.from_buffer(told)
        assert counters.cb == size
        counters.PagefileUsage, counters.WorkingSetSize = 250_000_000, 99
        return 1

    def limited(job, kind, told, size):
        assert (job.value, kind, size) == (77, 9, ctypes.sizeof(ExtendedLimits))  # JobObjectExtendedLimitInformation
        limits.append(ExtendedLimits.from_buffer_copy(told))
        return 1

    def put(job, process):
        limits.append((job.value, process.value))
        return 1

    def status(told):
        assert MemoryStatus.from_buffer(told).dwLength == ctypes.sizeof(MemoryStatus)
        MemoryStatus.from_buffer(told).ullAvailPhys = 3_000_000_000
        return 1

    kernel = SimpleNamespace(
        GetCurrentProcess=lambda: -1,
        K32GetProcessMemoryInfo=counted,
        CreateJobObjectW=Mock(return_value=77),
        SetInformationJobObject=limited,
        AssignProcessToJobObject=put,
        GlobalMemoryStatusEx=status,
    )
    monkeypatch.setattr(ctypes, "windll", SimpleNamespace(kernel32=kernel), raising=False)
    monkeypatch.setattr(sys, "platform", "win32")
    return kernel


@pytest.mark.skipif(ctypes.sizeof(ctypes.c_void_p) != 8, reason="Kochab's packages are for 64 bits")
def test_windows_itself_bounds_what_a_decoder_may_commit(monkeypatch):
    limits = []
    kernel = windows(monkeypatch, limits)
    monkeypatch.setattr(sandbox, "_job", None)
    monkeypatch.setattr(sandbox, "_limit_bytes", None)
    sandbox._bound(1_000_000_000, 5.0)
    sandbox._bound(2_000_000_000, 5.0)
    first, joined, second = limits  # one job for all files
    assert joined == (77, ctypes.c_void_p(-1).value)
    assert kernel.CreateJobObjectW.call_count == 1
    assert [one.BasicLimitInformation.LimitFlags for one in (first, second)] == [0x100, 0x100]  # of a process's memory
    assert [one.ProcessMemoryLimit for one in (first, second)] == [1_250_000_000, 2_250_000_000]
    assert (first.JobMemoryLimit, first.BasicLimitInformation.ActiveProcessLimit) == (0, 0)
    assert sandbox.memory_text() == "2.0 GB"
    kernel.SetInformationJobObject = lambda *told: 0
    monkeypatch.setattr(sandbox, "_limit_bytes", None)
    sandbox._bound(1_000_000_000, 5.0)
    assert sandbox.memory_text() == "3.0 GB"  # what is free, where no limit was set


def test_free_memory_is_half_of_all_where_the_system_does_not_tell(monkeypatch):
    """As on macOS; Linux and Windows tell."""
    told = free_bytes()
    monkeypatch.setattr("builtins.open", Mock(side_effect=FileNotFoundError))
    half = free_bytes()
    monkeypatch.undo()
    if hasattr(os, "sysconf"):
        assert half == os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2
        assert 0 < told < 2 * half + 1e6
    windows(monkeypatch, [])
    assert free_bytes() == 3_000_000_000


def test_one_process_reads_one_file_after_the_other(odd):
    first, second = odd("quick_reader", "a.odd"), odd("quick_reader", "b.odd")
    frames = [read_frame(first), read_frame(second)]
    assert reader_of(first) == reader_of(second) != os.getpid()
    for frame in frames:
        np.testing.assert_array_equal(frame.pixels, sky())
        np.testing.assert_array_equal(frame.colour, colours())
        frame.pixels[0, 0] = 7  # the caller's own


def test_a_file_is_read_while_another_hangs(odd):
    slow = odd("stuck_reader", "a.odd")
    with closing(reading(slow, None)) as task:
        while not slow.with_suffix(".pid").exists() or not slow.with_suffix(".pid").read_text():
            next(task)
        quick = odd("quick_reader", "b.odd")
        np.testing.assert_array_equal(read_frame(quick).pixels, sky())
        assert reader_of(slow) != reader_of(quick)


def test_what_is_safe_is_read_at_once(tmp_path, monkeypatch):
    def started():
        raise AssertionError("a process was started")

    files = [p for p in one_of_each(tmp_path) if p.name in ("a.fits", "a.png", "d16.png", "a.jpg", "a.bmp")]
    monkeypatch.setattr(sandbox, "_kept", started)
    for path in files:
        with pytest.raises(StopIteration):
            next(reading(path))
    assert len(files) == 5


def test_a_name_is_told_from_the_folder_one_is_in(odd, tmp_path, monkeypatch):
    read_frame(odd("quick_reader"))
    (tmp_path / "night").mkdir()
    (tmp_path / "night" / "here.odd").write_bytes(b"ODD1")
    monkeypatch.chdir(tmp_path / "night")
    assert read_frame("here.odd").path == "here.odd"
    assert (tmp_path / "night" / "here.pid").exists()


def test_no_process_to_be_had_is_a_sentence(odd, monkeypatch):
    def none(*_, **__):
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(sandbox, "_kept", lambda: None)
    monkeypatch.setattr(subprocess, "Popen", none)
    with pytest.raises(FrameError, match=r"night.odd cannot be read: no process starts to read it \(Resource temp"):
        read_frame(odd("quick_reader"))


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not show a process's limits")
def test_its_time_is_bounded_anew_for_every_file(odd):
    path = odd("quick_reader")
    told = []
    for timeout_s in (5.0, None, 3000.0):
        read_frame(path, timeout_s)
        limits = Path(f"/proc/{reader_of(path)}/limits").read_text()
        told.append(next(line.split()[3] for line in limits.splitlines() if line.startswith("Max cpu time")))
    assert int(told[0]) < 1000
    assert told[1] == "unlimited"
    assert int(told[2]) > 12_000


@pytest.mark.skipif(not hasattr(os, "fork"), reason="Windows cannot fork")
def test_a_forked_process_has_one_of_its_own(odd):
    path = odd("quick_reader")
    code = (
        "import os, sys\nfrom pathlib import Path\nfrom kochab.frames import FORMATS, read_frame\n"
        "FORMATS._others = {'odd': 'tests.frames.files:quick_reader'}\n"
        "path = Path(sys.argv[1])\ntold = path.with_suffix('.pid')\nread_frame(path)\nfirst = told.read_text()\n"
        "if os.fork() == 0:\n    read_frame(path)\n    os._exit(told.read_text() == first)\n"
        "assert os.wait()[1] == 0\nread_frame(path)\nassert told.read_text() == first"
    )
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", code, str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_process_ends_with_its_parent(odd):
    path = odd("stuck_reader")
    code = (
        "import sys\nfrom pathlib import Path\nfrom kochab.frames import FORMATS, read_frame\n"
        "FORMATS._others = {'odd': 'tests.frames.files:stuck_reader'}\nread_frame(sys.argv[1])"
    )
    parent = subprocess.Popen([sys.executable, "-c", code, str(path)])
    try:
        while not (path.with_suffix(".pid").exists() and path.with_suffix(".pid").read_text()):
            assert parent.poll() is None
            time.sleep(0.05)
    finally:
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    assert gone(reader_of(path))


def test_a_file_that_hangs_costs_a_watched_folder_one_complaint(odd, tmp_path, monkeypatch):
    monkeypatch.setattr(folder_camera, "READ_LIMIT_S", 3.0)
    monkeypatch.setattr(folder_camera, "READ_AT_ONCE_S", 0.2)
    monkeypatch.setattr(folder_camera, "PATIENCE_S", 0.5)
    monkeypatch.setattr("kochab.frames.SUFFIXES", {".odd": "odd", ".png": "picture"})
    path = odd("stuck_reader")
    with closing(open_camera("folder", str(tmp_path))) as camera:
        while not camera._reading:
            assert camera.next_frame(0.1) is None
        one_of_each(tmp_path)
        while (frame := camera.next_frame(0.5)) is None:
            pass
        assert frame.path.endswith(".png")
        while camera.next_frame(0.5) is not None:
            pass
        assert [c for c in camera.complaints() if "night.odd" in c] == [
            "File skipped: night.odd was not read within 3 s. Is it damaged? Else allow more time."
        ]
    assert gone(reader_of(path))
