"""Mutants in a process that is watched: what raises, hangs, crashes or grows becomes a file of the corpus.

A mutant is told by its target, the seed of the run and its number alone, so that the one that was under
way when the process had to be killed is made again by its parent.
"""

import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from tests.fuzz.target import Target
from tests.patterns import REPOSITORY

CORPUS = Path(__file__).parent / "corpus"
HANG_S, GROWTH_KB, FENCE_BYTES = 10.0, 1_000_000, 6_000_000_000
GREW = 77
EXTRA = ""  # "module:check" of one more target, "extra"


def targets(*names: str) -> dict[str, Target]:
    """All of them by name, the dearest last; where only "extra" is named, nothing is imported for the others."""
    found = {}
    if set(names) != {"extra"}:
        from tests.fuzz import answers, devices, files, texts

        found = {target.name: target for module in (files, texts, devices, answers) for target in module.TARGETS}
    if EXTRA:
        module, _, name = EXTRA.partition(":")
        found["extra"] = Target("extra", lambda folder: [b"seed"], getattr(import_module(module), name))
    return found


def mutant(target: Target, seeds: list[bytes], seed: int, number: int) -> bytes:
    """The input of that number."""
    return target.mutate(Random(f"{target.name}/{seed}/{number}"), seeds)


def environment() -> dict[str, str]:
    """For processes that find the package and the tests."""
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(REPOSITORY / "app"), str(REPOSITORY)])}


def seeds_of(target: Target) -> list[bytes]:
    with TemporaryDirectory() as folder:
        return target.seeds(Path(folder))


def attempt(target: Target, data: bytes, folder: Path) -> str:
    """Empty, or the traceback of what must not be."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            target.check(data, folder)
    except Exception:
        return traceback.format_exc()
    finally:
        for path in folder.iterdir():
            if path.is_file():
                path.unlink()
    return ""


# -- In the process that may die ----------------------------------------------------------------


def work(report: int, jobs: list[tuple[str, int, int, float]], seed: int) -> None:
    """Run ``jobs`` (name, first, count, seconds); a line of JSON before each mutant that began a second ago."""
    from kochab.frames import sandbox

    sandbox._inside = True  # decoders work here: we are watched ourselves
    _quiet()
    known = targets(*(job for job, *_ in jobs))
    with os.fdopen(report, "w", buffering=1) as out, TemporaryDirectory() as name:

        def say(**facts: object) -> None:
            out.write(json.dumps(facts) + "\n")

        for job, first, count, seconds in jobs:
            target, started = known[job], time.monotonic()
            seeds = seeds_of(target)
            began = used = peak_kb()
            for number in range(first, count):
                say(kind="at", job=job, number=number)
                text = attempt(target, mutant(target, seeds, seed, number), Path(name))
                used = peak_kb()
                if text:
                    say(kind="fault", job=job, number=number, text=text)
                if used - began > GROWTH_KB:
                    say(kind="fault", job=job, number=number, text=f"grew by {(used - began) / 1e6:.1f} GB")
                    os._exit(GREW)  # the mark of the highest does not come down again
                if time.monotonic() - started > seconds:
                    break
            say(kind="done", job=job, number=number + 1 if count > first else first, kb=used - began)


def peak_kb() -> int:
    """The most memory this program has had; what rusage tells is also its parent's."""
    with open("/proc/self/status", encoding="ascii", errors="replace") as file:
        return next(int(row.split()[1]) for row in file if row.startswith("VmHWM"))


def _quiet() -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (FENCE_BYTES, resource.RLIM_INFINITY))


# -- Outside of it ------------------------------------------------------------------------------


@dataclass(slots=True)
class Tally:
    """What became of a target's mutants; ``contained`` only the sandbox survived."""

    name: str
    mutants: int = 0
    seconds: float = 0.0
    contained: int = 0
    faults: list[tuple[int, str]] = field(default_factory=list)


def run(jobs: list[tuple[str, int, float]], seed: int, keep: bool = True) -> Iterator[Tally]:
    """Run ``jobs`` (name, count, seconds), restarting the process after each that had to be killed."""
    left = [(name, 0, count, seconds) for name, count, seconds in jobs]
    tallies = {name: Tally(name) for name, _, _ in jobs}
    known = targets(*tallies)
    while left:
        tally = tallies[left[0][0]]
        began, ended, last, gone = time.monotonic(), False, left[0][1], ""
        for facts in _watched(left, seed):
            name, number = facts.get("job", tally.name), facts.get("number", last)
            if facts["kind"] == "at":
                last = number
            elif facts["kind"] == "fault":
                _note(tally, known[name], number, facts["text"], seed, keep)
            elif facts["kind"] == "done":
                tally.mutants, ended = number, True
                tally.seconds += time.monotonic() - began
                yield tally
                left.pop(0)
                if left:
                    began, ended, last, tally = time.monotonic(), False, left[0][1], tallies[left[0][0]]
            else:
                gone = facts["text"]
        if left and not ended:  # the process did not live to tell
            tally.seconds += time.monotonic() - began
            name, _, count, seconds = left[0]
            if gone != "grew":
                data = mutant(known[name], seeds_of(known[name]), seed, last)
                if survives(known[name], data):
                    tally.contained += 1
                elif not ends(name, data):
                    _note(tally, known[name], last, gone, seed, keep)
            left[0] = (name, last + 1, count, max(0.0, seconds - tally.seconds))
            tally.mutants = last + 1


def _watched(jobs: list[tuple[str, int, int, float]], seed: int) -> Iterator[dict]:
    """What the process reports; a last one of kind "gone" says why it ended early."""
    read, write = os.pipe()
    code = (
        "import json, sys; from tests.fuzz import runner; runner.EXTRA = sys.argv[4]\n"
        "runner.work(int(sys.argv[1]), json.loads(sys.argv[2]), int(sys.argv[3]))"
    )
    command = [sys.executable, "-W", "ignore", "-c", code, str(write), json.dumps(jobs), str(seed), EXTRA]
    process = subprocess.Popen(command, pass_fds=[write], env=environment())
    os.close(write)
    os.set_blocking(read, False)
    buffer, heard, working = b"", time.monotonic(), False
    try:
        while True:
            try:
                piece = os.read(read, 1 << 16)
                if not piece:
                    break
                *rows, buffer = (buffer + piece).split(b"\n")
                for row in rows:
                    facts = json.loads(row)
                    working = facts["kind"] != "done"
                    yield facts
                heard = time.monotonic()
            except BlockingIOError:
                # Imports and seeds of the first job take their time on a busy machine.
                if time.monotonic() - heard > (HANG_S if working else 60.0):
                    process.kill()
                    yield {"kind": "gone", "text": f"hung for more than {HANG_S:g} s"}
                    return
                time.sleep(0.02)
        code_of_end = process.wait()
        if code_of_end == GREW:
            yield {"kind": "gone", "text": "grew"}
        elif code_of_end:
            yield {
                "kind": "gone",
                "text": f"crashed: {signal.Signals(-code_of_end).name if code_of_end < 0 else code_of_end}",
            }
    finally:
        process.kill()
        process.wait()
        os.close(read)


def ends(name: str, data: bytes) -> bool:
    """Whether the check comes to an end within its time of the processor after all: the machine was busy."""
    code = (
        "import resource, sys, time; from pathlib import Path; from tests.fuzz import runner\n"
        "runner.EXTRA = sys.argv[3]; target = runner.targets(sys.argv[1])[sys.argv[1]]; runner.seeds_of(target)\n"
        "from kochab.frames import sandbox; sandbox._inside = True\n"
        "limit = int(time.process_time() + float(sys.argv[4])) + 1\n"
        "resource.setrlimit(resource.RLIMIT_CPU, (limit, limit)); print('begun', flush=True)\n"
        "sys.exit(bool(runner.attempt(target, sys.stdin.buffer.read(), Path(sys.argv[2]))))"
    )
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-W", "ignore", "-c", code, name, folder, EXTRA, str(HANG_S)]
        process = subprocess.Popen(command, env=environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert process.stdin is not None
        assert process.stdout is not None
        with process, process.stdin, process.stdout:
            process.stdout.readline()  # its imports are done
            try:
                process.communicate(data, timeout=4.0 * HANG_S)
            except subprocess.TimeoutExpired:
                process.kill()
    return process.returncode == 0


def survives(target: Target, data: bytes) -> bool:
    """Whether the sandbox makes one sentence of what a decoder did not survive."""
    if not target.sandboxed:
        return False
    code = (
        "import sys; from kochab.frames import read_frame\n"
        "from kochab.core.errors import FrameError\n"
        "try: read_frame(sys.argv[1], 5.0)\nexcept FrameError as error: assert str(error).endswith('.')"
    )
    with TemporaryDirectory() as folder:
        (path := Path(folder, target.sandboxed)).write_bytes(data)
        try:
            done = subprocess.run([sys.executable, "-c", code, str(path)], env=environment(), timeout=120, check=False)
        except subprocess.TimeoutExpired:
            return False
    return done.returncode == 0


def cause(text: str) -> str:
    """What faults with the same cause have in common: the exception and the last line of the package's own."""
    rows = text.strip().splitlines()
    own = [row.strip() for row in rows if "/kochab/" in row or ("tests/fuzz/" in row and "runner" not in row)]
    return re.sub(r"'.*'|\"[^/]*\"|[\d.]+", "_", f"{rows[-1][:60]} | {own[-1] if own else ''}")


def _note(tally: Tally, target: Target, number: int, text: str, seed: int, keep: bool) -> None:
    """Count a fault; keep its input unless one of the same cause is there."""
    first = cause(text) not in map(cause, (t for _, t in tally.faults))
    tally.faults.append((number, text))
    if keep and first and number >= 0:
        CORPUS.mkdir(exist_ok=True)
        (CORPUS / f"{slug(target)}.{seed}.{number}").write_bytes(mutant(target, seeds_of(target), seed, number))


def slug(target: Target) -> str:
    """Its name in names of files."""
    return re.sub(r"[^A-Za-z0-9]+", "-", target.name).strip("-")
