"""The worker: the same answers as without it, for its owner alone, and nothing lost when it goes."""

import contextlib
import json
import os
import re
import shutil
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest

from kochab.server import hand_over
from kochab.server.hand_over import DONE, MAGIC, OTHER_VERSION, WRITTEN

if not sys.platform.startswith("linux"):
    pytest.skip("the worker is for Linux", allow_module_level=True)
KOCHAB = [sys.executable, "-m", "kochab"]
SAMPLES = Path(__file__).resolve().parents[2] / "resources" / "samples"
TIMES = re.compile(rb'"elapsed_ms": \{[^}]*\}|\d+ ms\b')


@pytest.fixture
def runtime(monkeypatch):
    """A runtime folder of our own, short enough for a socket's name."""
    folder = tempfile.mkdtemp(prefix="kochab-")
    monkeypatch.setenv("XDG_RUNTIME_DIR", folder)
    monkeypatch.delenv("KOCHAB_CONFIG", raising=False)
    yield Path(folder)
    shutil.rmtree(folder)


@contextlib.contextmanager
def served(environment=None):
    """A worker's process, started as a person starts it."""
    process = subprocess.Popen([*KOCHAB, "serve"], stdout=subprocess.PIPE, text=True, env=environment)
    assert "ready" in process.stdout.readline()
    yield process
    process.terminate()
    process.wait(20)
    process.stdout.close()


@pytest.fixture
def worker(runtime):
    """A worker of this test alone."""
    with served() as process:
        yield process


@pytest.fixture(scope="module")
def lasting():
    """A worker that outlives a test, and its runtime folder: each start costs 0.7 s of processor."""
    with tempfile.TemporaryDirectory(prefix="kochab-") as folder:
        others = {name: value for name, value in os.environ.items() if name != "KOCHAB_CONFIG"}
        with served(others | {"XDG_RUNTIME_DIR": folder}) as process:
            yield process, folder


@pytest.fixture
def shared_worker(lasting, monkeypatch):
    """The shared worker, for tests that leave it unchanged."""
    process, folder = lasting
    monkeypatch.setenv("XDG_RUNTIME_DIR", folder)
    monkeypatch.delenv("KOCHAB_CONFIG", raising=False)
    yield process
    assert process.poll() is None


def command(*arguments, **more):
    """What a command writes and its exit code, times taken out."""
    done = subprocess.run([*KOCHAB, *map(str, arguments)], capture_output=True, timeout=250, **more)
    said = b"".join(line for line in done.stderr.splitlines(True) if not line.endswith(b" ...\n"))  # busy machines
    return TIMES.sub(b"", done.stdout), said, done.returncode


def children(process) -> list[int]:
    return [int(n) for n in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]


def until(what, seconds=30.0):
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end
        time.sleep(0.02)


def ready_ahead(worker) -> int:
    """The child that stands by, once it has done its frame and waits: asleep, and no time spent meanwhile."""
    until(lambda: len(children(worker)) == 1)
    (child,) = children(worker)

    def seen() -> list[str]:
        fields = Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()
        return [fields[0], *fields[11:13]]

    def waits() -> bool:
        before = seen()
        time.sleep(0.5)
        return before == seen() and before[0] == "S" and before[1] != "0"

    until(waits, 60)
    return child


class Listener:
    """Something else at the worker's place: accepts one connection, reads, says ``reply``, and goes."""

    def __init__(self, reply: bytes) -> None:
        path = hand_over.place().path
        os.makedirs(os.path.dirname(path), mode=0o700)
        self.socket, self.heard = socket.socket(socket.AF_UNIX), b""
        self.socket.bind(path)
        self.socket.listen(1)
        self.thread = threading.Thread(target=self._answer, args=(reply,), daemon=True)
        self.thread.start()

    def _answer(self, reply: bytes) -> None:
        try:
            connection = self.socket.accept()[0]
        except OSError:
            return
        self.socket.close()
        with connection:
            # All of it: whoever closes with bytes unread resets the line, and the reply is lost.
            with connection.makefile("rb") as request:
                head = request.read(len(MAGIC) + 4)
                self.heard = head + request.read(int.from_bytes(head[len(MAGIC) :], "big"))
            connection.send(reply)

    def close(self) -> bytes:
        with contextlib.suppress(OSError):  # nobody came
            self.socket.shutdown(socket.SHUT_RDWR)
        self.thread.join(10)
        self.socket.close()
        return self.heard


@pytest.mark.timeout(600)
@pytest.mark.parametrize("arguments", [["--json"], [], ["--json", "--workers", "2"]])
def test_real_frames_give_the_same_bytes_and_code(shared_worker, shared_frames, arguments):
    asked = ["solve", "gran__test01.jpg", "pan__tiny.fits", "syn_gradient.png", "cedar__orion2.jpg", *arguments]
    with_worker = command(*asked, cwd=shared_frames)
    assert len(with_worker[0]) > 1000
    assert with_worker == command(*asked, "--no-worker", cwd=shared_frames)


@pytest.mark.parametrize(
    ("asked", "code"),
    [
        (["solve", "missing.fits", "--json"], 2),
        (["solve", "--fov", "much", "a.fits"], 2),
        (["solve", "--help"], 0),
        (["detect", SAMPLES / "orion.png"], 0),
        (["-f", "missing.fits"], 16),
        (["solve", SAMPLES / "orion.png", "--timeout", "0.000001"], 1),
    ],
)
def test_other_ends_are_the_same_too(shared_worker, tmp_path, asked, code):
    done = command(*asked, cwd=tmp_path)
    assert done[2] == code
    assert done == command(*asked, "--no-worker", cwd=tmp_path)


def test_a_command_is_done_by_the_worker_and_as_its_own_process_would(shared_worker, tmp_path, monkeypatch):
    """Its folder, umask, variables and input are the command's, not the worker's."""
    shutil.copy(SAMPLES / "orion.png", tmp_path / "a.png")
    monkeypatch.setenv("COLUMNS", "50")
    old = os.umask(0o027)
    try:
        done = command("solve", "a.png", "--wcs", "--json", cwd=tmp_path)
    finally:
        os.umask(old)
    assert done[2] == 0
    assert stat.S_IMODE((tmp_path / "a.png.wcs").stat().st_mode) == 0o640
    wide = command("solve", "--help")
    assert max(map(len, wide[0].splitlines())) <= 50


def test_the_command_itself_loads_nothing_heavy(shared_worker):
    """That is the whole point: the libraries are the worker's."""
    code = (
        "import os, sys; before = set(sys.modules)\n"  # what this environment's own start has loaded
        "from kochab.__main__ import run_process\n"
        "heavy = {'numpy', 'argparse', 'json', 'logging', 'pathlib', 'typing', 're', 'socket', 'signal'}\n"
        "heavy |= {'collections', 'contextlib', 'struct', 'zlib'}\n"
        "loaded = lambda: sorted(heavy & (set(sys.modules) - before))\n"
        "os._exit = lambda code: print('LOADED', code, loaded(), file=sys.stderr)\n"
        "run_process()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "solve", str(SAMPLES / "orion.png")], capture_output=True, text=True
    )
    assert done.stderr.strip() == "LOADED 0 []"
    assert "centre" in done.stdout


def test_its_place_is_closed_to_others(shared_worker):
    path = Path(hand_over.place().path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700


def test_a_socket_that_nobody_listens_at_is_passed_by_and_replaced(runtime):
    path = hand_over.place().path
    os.makedirs(os.path.dirname(path), mode=0o700)
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(path)
    assert command("solve", SAMPLES / "orion.png")[2] == 0
    started = command("serve", "--background")
    try:
        assert b"ready" in started[0]
        assert b"runs already" in command("serve", "--background")[0]
    finally:
        assert command("serve", "--stop")[2] == 0
    assert not os.path.exists(path)
    assert command("serve", "--stop")[2] == 1


@pytest.mark.parametrize("whose", ["open to others", "another user's folder", "another user's socket"])
def test_what_another_user_may_have_put_there_is_not_spoken_to(runtime, whose):
    listener = Listener(DONE + bytes(4))
    path = Path(hand_over.place().path)
    if whose == "open to others":
        path.parent.chmod(0o755)
    elif os.geteuid() == 0:
        os.chown(path.parent if "folder" in whose else path, 12345, -1)
    else:
        pytest.skip("only root can give a file to another user")
    out, _, code = command("solve", SAMPLES / "orion.png")
    assert listener.close() == b""
    assert (code, b"centre" in out) == (0, True)


def test_a_worker_that_is_killed_before_it_answers_costs_nothing(runtime):
    listener = Listener(b"")
    out, err, code = command("solve", SAMPLES / "orion.png")
    assert listener.close().startswith(MAGIC)
    assert (code, err, b"centre" in out) == (0, b"", True)


def test_one_that_is_killed_in_mid_answer_is_told_of_in_a_sentence(runtime):
    listener = Listener(WRITTEN)
    out, err, code = command("solve", SAMPLES / "orion.png")
    listener.close()
    assert (out, code) == (b"", 2)
    assert err == b"kochab: The worker was ended from outside in mid-command.\n"


def test_the_command_goes_on_when_the_worker_is_killed(worker, tmp_path):
    """Whoever does the command is a process of its own."""
    many = [SAMPLES / "orion.png"] * 20
    asked = subprocess.Popen([*KOCHAB, "solve", "--json", *map(str, many)], stdout=subprocess.PIPE)
    first = asked.stdout.readline()
    worker.kill()
    rest = asked.communicate(timeout=100)[0].splitlines()
    assert [json.loads(line)["solved"] for line in (first, *rest)] == [True] * 20
    assert asked.returncode == 0


@pytest.mark.parametrize("garbage", [b"GET / HTTP/1.1\r\n\r\n", bytes(200), MAGIC + b"\xff\xff\xff\xff", MAGIC])
def test_garbage_harms_nobody(shared_worker, garbage):
    path = hand_over.place().path
    with socket.socket(socket.AF_UNIX) as rude:
        rude.connect(path)
        rude.send(garbage)
        rude.shutdown(socket.SHUT_WR)
        rude.settimeout(20)
        with contextlib.suppress(ConnectionResetError):  # not all of it was read
            assert rude.recv(100) == b""
    with socket.socket(socket.AF_UNIX) as rude:  # and the right streams with fields that are none
        rude.connect(path)
        body = hand_over.place().identity + b"\0x\0y\0z"
        socket.send_fds(rude, [MAGIC + len(body).to_bytes(4, "big") + body], [0, 1, 2, 0])
        rude.settimeout(20)
        assert rude.recv(100) == b""
    assert shared_worker.poll() is None
    assert command("solve", SAMPLES / "orion.png")[2] == 0


def test_another_version_ends_the_worker_and_starts_its_own(worker, runtime, monkeypatch):
    started = []
    monkeypatch.setattr(hand_over, "_version", lambda: "99.0 0")
    monkeypatch.setattr(hand_over, "_restart", lambda: started.append(1))
    assert hand_over.hand_over(["solve", "a.png"]) is None
    assert started == [1]
    assert worker.wait(60.0) == 0
    assert not os.path.exists(hand_over.place().path)


def test_a_worker_of_another_version_is_replaced(runtime):
    listener = Listener(OTHER_VERSION)
    out, _, code = command("solve", SAMPLES / "orion.png")
    listener.close()
    assert (code, b"centre" in out) == (0, True)
    until(lambda: command("serve", "--stop")[2] == 0)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_cancels_what_the_worker_does(worker, number):
    ready_ahead(worker)
    asked = subprocess.Popen([*KOCHAB, "solve", "--json", *[str(SAMPLES / "orion.png")] * 2000], stdout=subprocess.PIPE)
    asked.stdout.readline()
    working = children(worker)
    asked.send_signal(number)
    asked.stdout.read()
    assert asked.wait(60.0) == 130
    until(lambda: working[0] not in children(worker))
    assert worker.poll() is None
    asked.stdout.close()


def test_the_death_of_the_command_cancels_its_work(worker):
    ready_ahead(worker)
    asked = subprocess.Popen([*KOCHAB, "solve", "--json", *[str(SAMPLES / "orion.png")] * 2000], stdout=subprocess.PIPE)
    asked.stdout.readline()
    working = children(worker)
    asked.kill()
    asked.wait(20)
    until(lambda: working[0] not in children(worker))
    assert worker.poll() is None
    asked.stdout.close()


def test_it_ends_when_idle(runtime):
    done = command("serve", "--idle", "0.005")
    assert done[2] == 0
    assert b"ready" in done[0]
    assert not os.path.exists(hand_over.place().path)


def test_a_command_without_input_does_its_work_itself(worker):
    """A closed stream cannot be handed over."""
    code = f"exec {sys.executable} -m kochab solve {SAMPLES / 'orion.png'} <&-"
    assert subprocess.run(["sh", "-c", code], capture_output=True).returncode == 0


def test_other_variables_have_another_worker(runtime, monkeypatch):
    here = hand_over.place()
    monkeypatch.setenv("UNRELATED", "1")
    assert hand_over.place() == here
    monkeypatch.setenv("KOCHAB_CACHE", "/elsewhere")
    assert hand_over.place().path != here.path


def test_a_signal_that_comes_while_it_forks_ends_it(worker):
    """--stop asks it who it is, for which it forks, and sends the signal at that moment."""
    path = hand_over.place().path
    for _ in range(20):
        with socket.socket(socket.AF_UNIX) as line:
            line.connect(path)
    worker.terminate()
    assert worker.wait(60.0) == 130
    assert not os.path.exists(path)


def test_a_child_that_was_forked_ahead_does_the_command(worker):
    child = ready_ahead(worker)
    asked = subprocess.Popen([*KOCHAB, "solve", "--json", *[str(SAMPLES / "orion.png")] * 2000], stdout=subprocess.PIPE)
    asked.stdout.readline()
    assert children(worker) == [child]  # and none is forked ahead meanwhile
    asked.kill()
    asked.communicate()
    until(lambda: children(worker) not in ([child], []))  # the next one
    assert worker.poll() is None


@pytest.mark.skipif("glibc" not in (os.confstr("CS_GNU_LIBC_VERSION") or ""), reason="another library's memory")
def test_memory_that_was_taken_ahead_is_not_asked_from_the_system_again():
    code = """
import resource
from kochab.server.worker import make_room
make_room()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
parts = [bytearray(size << 10) for size in (3000, 3000, 800, 200, 100, 1500, 1500)]
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 100  # of 2500 pages


def test_one_that_is_killed_costs_nothing(worker):
    child = ready_ahead(worker)
    os.kill(child, signal.SIGKILL)
    assert command("solve", SAMPLES / "orion.png")[2] == 0
    until(lambda: child not in children(worker))
    assert worker.poll() is None


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_it_ends_with_the_worker(worker, number):
    child = ready_ahead(worker)
    worker.send_signal(number)
    worker.wait(20)
    until(lambda: not Path(f"/proc/{child}").exists() or "Z" in Path(f"/proc/{child}/stat").read_text().split()[2])


class Noting(socket.socket):
    """A socket that notes how long it is told to wait."""

    def settimeout(self, value) -> None:
        self.__dict__.setdefault("waits_s", []).append(value)
        super().settimeout(value)


@pytest.mark.parametrize(("size", "answer"), [(8_000_000, OTHER_VERSION), (8_000_001, None)])
def test_a_request_of_more_than_eight_megabytes_is_none_and_nobody_is_waited_for_longer_than_five_seconds(
    monkeypatch, size, answer
) -> None:
    """Sent whole by another version, which is told that it is one where the request is read."""
    from kochab.server import worker

    came, recv_fds = [], socket.recv_fds

    def received(*arguments):
        found = recv_fds(*arguments)
        came.extend(found[1])
        return found

    monkeypatch.setattr(socket, "recv_fds", received)
    ours, theirs = socket.socketpair(socket.AF_UNIX)

    def send() -> None:
        with contextlib.suppress(OSError):  # it is closed unread
            socket.send_fds(ours, [MAGIC + size.to_bytes(4, "big")], [0, 1, 2, 0])
            ours.sendall(b"older\nworld\0".ljust(size, b"x"))

    sender = threading.Thread(target=send)
    sender.start()
    with Noting(fileno=theirs.detach()) as line:
        assert worker._received(line, b"newer\nworld") == answer
        assert line.waits_s == [5.0, None]
    sender.join()
    ours.close()
    for descriptor in came:
        os.close(descriptor)


@pytest.mark.parametrize(("at_work", "served"), [(63, True), (64, False)])
def test_sixty_four_commands_are_at_work_at_once_and_no_more(runtime, monkeypatch, at_work, served) -> None:
    from kochab.server import worker

    mine = worker.Worker(hand_over.place(), lambda arguments: 0, 60.0)
    mine._children = set(range(at_work))
    forked = []
    monkeypatch.setattr(os, "fork", lambda: forked.append(1) or 4_000_000)
    with contextlib.closing(hand_over.connected(hand_over.place().path)):
        mine._take()
    mine.close()
    assert bool(forked) is served
