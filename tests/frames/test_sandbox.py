"""A decoder that hangs, crashes or grows costs its file one sentence, and no process stays behind."""

import ctypes
import io
import json
import os
import pickle
import platform
import runpy
import signal
import struct
import subprocess
import sys
import time
from contextlib import closing, suppress
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from kochab.cli.main import main
from kochab.core.errors import FrameError
from kochab.core.frame import Frame, Hint, Site
from kochab.frames import FORMATS, read_frame, reading, sandbox
from kochab.frames.answer import DecoderFaultError, encoded, received
from kochab.frames.confinement import filter_of, landlock_version
from kochab.frames.samples import free_bytes
from kochab.gear.cameras import folder as folder_camera
from kochab.gear.cameras import open_camera
from tests.frames.files import colours, one_of_each, sky

WHEN = datetime(2026, 3, 14, 20, 0, 0, 250_000, UTC)


def gone(pid):
    """Whether the process has ended, or ends soon."""
    if sys.platform == "win32":  # os.kill with 0 is Ctrl-C there
        kernel = ctypes.windll.kernel32
        process = kernel.OpenProcess(0x100000, False, pid)  # SYNCHRONIZE
        return not process or kernel.WaitForSingleObject(process, 10_000) == 0
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


@pytest.fixture
def started(monkeypatch):
    """The processes that are started to read, by their numbers, and none is left from before."""
    while sandbox._idle:
        sandbox._idle.pop().kill()
    pids, init = [], sandbox._Sandbox.__init__

    def noting(self):
        init(self)
        pids.append(self._process.pid)

    monkeypatch.setattr(sandbox._Sandbox, "__init__", noting)
    return pids


def begun(pid, path):
    """Whether a process has come to open this file to read it."""
    if not Path(f"/proc/{os.getpid()}/fd").is_dir():
        return True
    with suppress(OSError):
        return any(os.readlink(one) == str(path) for one in Path(f"/proc/{pid}/fd").iterdir())
    return False


def children(pid):
    return [int(n) for one in Path(f"/proc/{pid}/task").iterdir() for n in (one / "children").read_text().split()]


def test_a_decoder_that_hangs_is_killed_at_the_deadline(odd, started):
    path = odd("stuck_reader")
    with pytest.raises(FrameError, match=r"^night.odd was not read within 3 s"):
        read_frame(path, timeout_s=3.0)
    assert gone(*started)


def test_a_decoder_that_hangs_is_killed_at_a_cancel(odd, started):
    path = odd("busy_reader")
    task = reading(path, None)
    next(task)
    while not begun(started[0], path):
        next(task)
    task.close()
    assert gone(*started)


def test_the_time_limit_of_a_solve_covers_reading(odd, capsys):
    path = odd("stuck_reader")
    assert main(["solve", str(path), "--timeout", "3"]) == 2
    assert "night.odd was not read within 3 s" in capsys.readouterr().err


def test_a_decoder_that_crashes_costs_a_sentence_and_the_next_file_nothing(odd):
    with pytest.raises(FrameError, match=r"night.odd cannot be read: its decoder crashed"):
        read_frame(odd("crashing_reader"))
    np.testing.assert_array_equal(read_frame(odd("quick_reader")).pixels, sky())


@pytest.mark.skipif(sys.platform not in ("linux", "win32"), reason="macOS bounds no process's memory")
def test_a_decoder_may_not_fill_the_memory(odd, monkeypatch):
    monkeypatch.setattr(sandbox, "LEAST_BYTES", 400_000_000)
    monkeypatch.setattr(sandbox, "MOST_BYTES", 400_000_000)
    with pytest.raises(FrameError, match=r"night.odd does not fit into the 0.4 GB there is for reading it"):
        read_frame(odd("greedy_reader"))
    assert read_frame(odd("quick_reader")).pixels.shape == (48, 64)


@pytest.mark.skipif(sys.platform != "win32", reason="of a job of Windows; Linux has Landlock and seccomp")
def test_on_windows_a_decoder_starts_no_program(odd):
    with pytest.raises(FrameError, match=r"^night.odd cannot be read: "):
        read_frame(odd("starting_reader"))


@pytest.mark.skipif(sys.platform == "win32", reason="Windows limits the process's memory itself")
def test_a_decoder_that_grows_is_killed_where_nothing_bounds_it(odd, monkeypatch, started):
    """As on macOS: the process that waits for it asks how much it has, and no earlier test has bounded it."""
    monkeypatch.setattr(sandbox, "WATCHED", True)
    monkeypatch.setattr(sandbox, "LEAST_BYTES", 400_000_000)
    monkeypatch.setattr(sandbox, "MOST_BYTES", 400_000_000)
    path = odd("growing_reader")
    with pytest.raises(FrameError, match=r"^night.odd does not fit into the 0.4 GB there is for reading it.$"):
        read_frame(path)
    assert gone(*started)
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
    # of a process's memory, and of how many there are
    assert [one.BasicLimitInformation.LimitFlags for one in (first, second)] == [0x108, 0x108]
    assert [one.BasicLimitInformation.ActiveProcessLimit for one in (first, second)] == [1, 1]
    assert [one.ProcessMemoryLimit for one in (first, second)] == [1_250_000_000, 2_250_000_000]
    assert (first.JobMemoryLimit, first.BasicLimitInformation.Affinity) == (0, 0)
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


def test_one_process_reads_one_file_after_the_other(odd, started):
    first, second = odd("quick_reader", "a.odd"), odd("quick_reader", "b.odd")
    frames = [read_frame(first), read_frame(second)]
    assert len(started) == 1
    for frame in frames:
        np.testing.assert_array_equal(frame.pixels, sky())
        np.testing.assert_array_equal(frame.colour, colours())
        frame.pixels[0, 0] = 7  # the caller's own


def test_a_file_is_read_while_another_hangs(odd, started):
    slow = odd("stuck_reader", "a.odd")
    with closing(reading(slow, None)) as task:
        next(task)
        while not begun(started[0], slow):
            next(task)
        quick = odd("quick_reader", "b.odd")
        np.testing.assert_array_equal(read_frame(quick).pixels, sky())
        assert len(started) == 2


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
    odd("size_reader")
    (tmp_path / "night").mkdir()
    monkeypatch.chdir(tmp_path / "night")
    Path("here.odd").write_bytes(b"ODD1 and more")
    frame = read_frame("here.odd")
    assert (frame.path, frame.header) == ("here.odd", {"bytes": 13})


def test_no_process_to_be_had_is_a_sentence(odd, monkeypatch):
    def none(*_, **__):
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(sandbox, "_kept", lambda: None)
    monkeypatch.setattr(subprocess, "Popen", none)
    with pytest.raises(FrameError, match=r"night.odd cannot be read: no process starts to read it \(Resource temp"):
        read_frame(odd("quick_reader"))


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not show a process's limits")
def test_its_time_is_bounded_anew_for_every_file(odd, started):
    path = odd("quick_reader")
    told = []
    for timeout_s in (5.0, None, 3000.0):
        read_frame(path, timeout_s)
        limits = Path(f"/proc/{started[0]}/limits").read_text()
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
        "from kochab.frames import sandbox\nwhose = lambda: [one._process.pid for one in sandbox._idle]\n"
        "path = Path(sys.argv[1])\nread_frame(path)\nfirst = whose()\n"
        "if os.fork() == 0:\n    read_frame(path)\n    os._exit(whose() == first)\n"
        "assert os.wait()[1] == 0\nread_frame(path)\nassert whose() == first"
    )
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", code, str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not show a process's children")
def test_the_process_ends_with_its_parent(odd):
    path = odd("busy_reader")
    code = (
        "import sys\nfrom pathlib import Path\nfrom kochab.frames import FORMATS, read_frame\n"
        "FORMATS._others = {'odd': 'tests.frames.files:busy_reader'}\nread_frame(sys.argv[1])"
    )
    parent = subprocess.Popen([sys.executable, "-c", code, str(path)])
    try:
        while not any(begun(pid, path) for pid in children(parent.pid)):
            assert parent.poll() is None
            time.sleep(0.05)
        readers = children(parent.pid)
    finally:
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    assert all(map(gone, readers))


def test_a_file_that_hangs_costs_a_watched_folder_one_complaint(odd, tmp_path, monkeypatch, started):
    monkeypatch.setattr(folder_camera, "READ_LIMIT_S", 3.0)
    monkeypatch.setattr(folder_camera, "READ_AT_ONCE_S", 0.2)
    monkeypatch.setattr(folder_camera, "PATIENCE_S", 0.5)
    monkeypatch.setattr("kochab.frames.readers.suffixes", lambda: {".odd": "odd", ".png": "picture"})
    odd("stuck_reader")
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
    assert started
    assert all(map(gone, started))


# -- What that process may not do, and what is not believed of what it says -----------------------

HARMLESS = ("read a file",)


def test_a_decoder_may_read_and_nothing_else(odd):
    """Every call is tried within the process, by a decoder that was taken over."""
    if "files" not in (held := confined()) or landlock_version() < 4:
        pytest.skip(f"this kernel has Landlock {landlock_version()}: it holds {held}")
    told = read_frame(odd("told_reader")).header
    assert {name for name, outcome in told.items() if outcome == "done"} == {*HARMLESS}
    assert {told[name] for name in told if name not in HARMLESS} <= {"EACCES", "EPERM"}
    assert not any(Path(f"/tmp/kochab-{name}").exists() for name in ("written", "made", "link"))


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux's kernel confines a process")
def test_what_is_said_to_hold_is_what_the_kernel_has():
    """Without Landlock no file is denied, and nobody may believe so."""
    assert ("files" in confined()) is (landlock_version() > 0)
    assert "privileges" in confined()


def confined():
    """What holds for a process of this kernel."""
    code = "from kochab.frames.confinement import confine; print(*confine())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.skipif(platform.machine() not in ("x86_64", "aarch64"), reason="calls are named for two processors")
def test_the_filter_refuses_what_it_names_and_allows_the_rest():
    """The program is run here by the rules of classic BPF (McCanne & Jacobson 1993), as the kernel runs it."""
    mark, calls = 0xC000003E, [41, 59, 62]
    program = [struct.unpack("=HBBI", row) for row in batched(filter_of(mark, calls), 8)]

    def answer(arch, number):
        at = value = 0
        while True:
            code, yes, no, k = program[at]
            at += 1
            if code == 0x06:
                return k
            if code == 0x20:
                value = {0: number, 4: arch}[k]
            else:
                at += yes if {0x15: value == k, 0x35: value >= k}[code] else no

    refused = {n for n in range(512) if answer(mark, n) != 0x7FFF0000}
    assert refused == {*calls}
    assert answer(mark, 0x40000000 + 1) == answer(0x40000003, 1) == 0x00050001  # EPERM


def batched(data, size):
    return [data[at : at + size] for at in range(0, len(data), size)]


def answered(parts):
    return received(
        io.BytesIO(struct.pack(f"={len(parts) + 1}Q", len(parts), *map(len, parts)) + b"".join(parts)), 10**9
    )


def frame_parts(**changed):
    """An answer as it is sent, its JSON changed."""
    frame = Frame(
        sky(), colours(), hint=Hint((1.0, 2.0), (10.0, 20.0, 5.0), WHEN, 2.0, Site(1.0, 2.0, 3.0), "camera", "EXIF")
    )
    told, *arrays = map(bytes, encoded(frame))
    return [json.dumps(json.loads(told) | changed).encode(), *arrays]


def test_a_frame_is_answered_as_it_was():
    header = {"A": 1, "B": 2.5, "C": "x", "D": None, "E": True, "F": float("inf"), "G": 10**30, "H": np.float32(0.5)}
    hint = Hint((1.0, 2.0), (10.0, 20.0, 5.0), WHEN, 2.0, Site(1.0, 2.0, 3.0), "camera", "EXIF", time_of_file=True)
    for given in (
        Frame(sky(), colours(np.float32), "RGGB", 40000.0, "a\udce9.fits", hint, ("one",), header),
        Frame(sky().astype(np.float64)),
    ):
        frame, trace = answered([*map(bytes, encoded(given))])
        assert trace == ""
        np.testing.assert_array_equal(frame.pixels, given.pixels)
        assert frame.pixels.dtype == given.pixels.dtype
        assert (frame.bayer, frame.saturation, frame.path) == (given.bayer, given.saturation, given.path)
        assert (frame.hint, frame.warnings) == (given.hint, given.warnings)
    header |= {"F": "inf", "G": str(10**30)}
    assert answered([*map(bytes, encoded(Frame(sky(), header=header)))])[0].header == header


@pytest.mark.parametrize(
    ("error", "kind"),
    [(FrameError("is cut short."), FrameError), (MemoryError("all"), MemoryError), (KeyError("x"), DecoderFaultError)],
)
def test_what_a_reader_raises_is_answered_by_its_kind(error, kind):
    found, trace = answered([*map(bytes, encoded(error, "where"))])
    assert type(found) is kind
    assert str(error) in str(found)
    assert trace == "where"


@pytest.mark.parametrize(
    "parts",
    [
        [],
        [b""],
        [pickle.dumps(sky())],
        [b"[" * 100_000],
        [b"{}"],
        [b"[]"],
        [b"NaN"],
        [b"{}"] * 9,
        frame_parts(arrays=[]),
        frame_parts(arrays=[["<u2", [48, 64]]]),
        frame_parts(arrays=[["|O", [48, 64]], ["|u1", [48, 64, 3]]]),
        frame_parts(arrays=[["<u2", [48, 65]], ["|u1", [48, 64, 3]]]),
        frame_parts(arrays=[["<u2", [2**40, 2**40]], ["|u1", [48, 64, 3]]]),
        frame_parts(arrays=[["<u2", [-48, -64]], ["|u1", [48, 64, 3]]]),
        frame_parts(arrays=[[">u2", [48, 64]], ["|u1", [48, 64, 3]]]),
        frame_parts(arrays=[["<u2", [64, 48]], ["|u1", [48, 64, 3]]]),
        frame_parts(arrays=[["<u2", [48.0, 64.0]], ["|u1", [48, 64, 3]]]),
        *(
            frame_parts(frame=json.loads(frame_parts()[0])["frame"] | changed)
            for changed in (
                {"bayer": "RGBX"},
                {"saturation": "high"},
                {"saturation": [1]},
                {"hint": None},
                {"hint": {}},
                {"header": [["a", {"b": 1}]]},
                {"header": 5},
            )
        ),
    ],
)
def test_an_answer_that_is_none_is_refused(parts):
    with pytest.raises((ValueError, TypeError, LookupError, AttributeError)):
        answered(parts)


def test_an_answer_larger_than_the_memory_is_refused_before_it_is_read():
    with pytest.raises(ValueError, match="size"):
        received(io.BytesIO(struct.pack("=3Q", 2, 100, 2**50)), 10**9)
    with pytest.raises(EOFError):
        received(io.BytesIO(struct.pack("=2Q", 1, 100) + b"{}"), 10**9)


def test_a_decoder_that_answers_a_pickle_is_one_sentence(odd, tmp_path, monkeypatch):
    """What it would have run on our side is not run."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FrameError, match=r"^night.odd cannot be read: its decoder crashed"):
        read_frame(odd("pickling_reader"))
    assert not (tmp_path / "run-by-a-pickle").exists()
    assert read_frame(odd("quick_reader")).pixels.shape == (48, 64)
