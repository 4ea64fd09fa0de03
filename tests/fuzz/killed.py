"""``make killed``: everything that writes, ended at any moment, on a full disk and in a folder it may not write to.

Afterwards each file is the old one or a whole new one, and what cannot be written costs one sentence. A trial
is a fork of this process with all its modules read; it is ended at a random moment, before its nth change
of a file, or in the middle of a write (the system kills a program whose file outgrows its limit).
"""

import argparse
import contextlib
import ctypes
import io
import json
import os
import random
import re
import resource
import select
import shutil
import signal
import sys
import threading
import time
import traceback
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

WAYS = ("moment", "change", "byte")
LONGEST_S = 120.0
OLD = "of last night\n"
SAID = re.compile(r"(annot|an't|stopped|too large|denied|no permission).*[.?!]$")


@dataclass(frozen=True, slots=True)
class Case:
    """Something that writes into a folder; ``before`` are old files there, which it replaces or leaves."""

    name: str
    run: Callable[[Path], int]
    before: tuple[str, ...] = ()
    dear: bool = False
    tells: bool = True  # a person, when it cannot write


def kochab(*words: str) -> Callable[[Path], int]:
    """A command, with ``{}`` for the folder."""

    def run(folder: Path) -> int:
        from kochab.__main__ import main

        return main([word.replace("{}", str(folder)) for word in words])

    return run


@contextlib.contextmanager
def fed(folder: Path) -> Iterator[None]:
    """New frames meanwhile where a case watches for them."""
    over = threading.Event()

    def feed() -> None:
        for k in range(1000):
            if over.wait(0.5):
                return
            with contextlib.suppress(OSError):
                shutil.copy(folder / "night.fits", folder / "watched" / f"{k}.fits")

    if (folder / "watched").exists():
        threading.Thread(target=feed, daemon=True).start()
    try:
        yield
    finally:
        over.set()


def _live(folder: Path) -> int:
    where = ("--address", "{}/watched", "--record", "{}/recorded", "--profile", "lens")
    return kochab("live", *where, "--fov", "12", "--frames", "2")(folder)


def _settings(folder: Path) -> int:
    from PySide6.QtCore import QSettings

    from kochab.window.settings import WindowSettings

    settings = WindowSettings(QSettings(str(folder / "window.ini"), QSettings.Format.IniFormat))
    for k in range(20):
        settings.keep("theme", f"{k}" * 500)
        settings.write()
    return 0


def _report(folder: Path) -> int:
    from kochab.gear.journal import save_report

    return _saved(lambda: save_report(folder / "report.zip", {"theme": "dark"}, folder / "state"))


def _exports(folder: Path) -> int:
    from dataclasses import replace

    from kochab.core.errors import FrameError
    from kochab.core.solution import NamedStar
    from kochab.frames import read_frame
    from kochab.window.frame.exports import EXPORTS
    from tests.fuzz.files import SOLUTION

    stars = tuple(NamedStar(k, k, f"HIP {k}", "Star", 3.0, 84.0, -2.0, 0.1) for k in range(500))
    solution, frame = replace(SOLUTION, stars=stars), read_frame(folder / "night.fits")

    def write() -> None:
        for kind in EXPORTS:
            kind.write(frame, solution, folder / f"a{kind.ending}")

    return _saved(write, (OSError, FrameError))


def _catalogue(folder: Path) -> int:
    from kochab.core.attitude import unit_vectors
    from kochab.core.errors import CatalogueError
    from kochab.sky.catalogue_file import StarList, write_deep, write_manifest

    rng = np.random.default_rng(2)
    stars = StarList.of(unit_vectors(rng.uniform(0, 360, 3000), rng.uniform(-80, 80, 3000)), rng.uniform(2, 12, 3000))

    def write() -> None:
        write_deep(folder / "deep.kcat", stars)
        write_manifest(folder, {"counts": {"stars": 3000}})

    return _saved(write, CatalogueError)


def _table(folder: Path) -> int:
    from kochab.identification import table_cache

    os.environ["KOCHAB_CACHE"] = str(folder / "cache")
    table_cache.WORTH_S = 0.0
    table_cache.cached_table("pairs", {"n": random.random()}, lambda: {"a": np.arange(30_000)})
    return 0


def _patterns(folder: Path) -> int:
    from kochab.core.attitude import unit_vectors
    from kochab.core.errors import CatalogueError
    from kochab.core.progress import run
    from kochab.identification import index_build

    os.environ["KOCHAB_CACHE"] = str(folder / "cache")
    rng = np.random.default_rng(4)
    sky = unit_vectors(rng.uniform(0, 360, 1500), np.degrees(np.arcsin(rng.uniform(-1, 1, 1500))))

    def build(into: Path, *plan: object):
        yield from index_build.build_volume(into, sky, np.arange(1500), range(9, 13), neighbours=[(5, 6)] * 4, steps=16)

    index_build._build = build
    return _saved(lambda: run(index_build.make_fine()), CatalogueError)


def _saved(write: Callable[[], object], kind: type[Exception] | tuple[type[Exception], ...] = OSError) -> int:
    try:
        write()
    except kind as error:
        print(f"It cannot be written: {getattr(error, 'strerror', '') or error}.", file=sys.stderr)
        return 2
    return 0


CASES = (
    Case("profile save", kochab("profile", "save", "lens", "--exposure", "3"), ("config/equipment/lens-PROFILE",)),
    Case("solve --wcs --annotate", kochab("solve", "{}/night.fits", "--wcs", "--annotate", "{}/a.png", "--overwrite"),
         ("night.fits.wcs", "a.png")),
    Case("-f -update", kochab("-f", "{}/night.fits", "-wcs", "-update", "-annotate"), ("night.ini", "night.wcs")),
    Case("-f -update, gzipped", kochab("-f", "{}/night.fits.gz", "-update"), ("night.fits.gz",)),
    Case("camera take", kochab("camera", "take", "--source", "folder", "--address", "{}/frames", "-o", "{}/take.fits",
                               "--overwrite", "--wait", "20"), ("take.fits",), dear=True),
    Case("polar --report", kochab("polar", "{}/sweep-0.fits", "{}/sweep-1.fits", "--fov", "6", "--report", "{}/tonight.html",
                                  "--overwrite"), ("tonight.html", "tonight.json")),
    Case("live --record --profile", _live, dear=True),
    Case("settings", _settings, ("window.ini",), tells=False),
    Case("report", _report, ("report.zip",)),
    Case("exports", _exports, ("a-stars.csv", "a-objects.csv", "a.reg", "a.wcs", "a-solved.fits", "a-annotated.png", "a-stellarium.ssc")),
    Case("catalogue", _catalogue, ("deep.kcat", "manifest.json")),
    Case("table", _table, tells=False),
    Case("patterns", _patterns),
)  # fmt: skip


def night(folder: Path) -> None:
    """Frames to work on."""
    import gzip

    from kochab.core.frame import Site
    from kochab.frames.fits_write import write_fits
    from kochab.simulate.camera import CameraConfig
    from kochab.simulate.mechanics.geometry import MountConfig
    from kochab.simulate.rig import PracticeRig, RigConfig
    from tests.workflows.live_sky import sky_frame

    write_fits(sky_frame(), folder / "night.fits")
    (folder / "night.fits.gz").write_bytes(gzip.compress((folder / "night.fits").read_bytes(), 1))
    rig = PracticeRig(
        RigConfig(
            seed=3,
            site=Site(47.0, 8.0, 450.0),
            start_deg=(-65.0, 40.0),
            mount=MountConfig(misalignment_arcmin=(22.0, -35.0), german=False),
            camera=CameraConfig(width=900, height=700, fov_deg=6.0),
        )
    )
    for k in range(2):
        if k:
            ra, dec = rig.mount.believed_deg()
            rig.mount.goto((ra - 30.0) % 360.0, dec)
            rig.wait_until_still(2.0)
        write_fits(rig.frame(2.0), folder / f"sweep-{k}.fits")


# -- Whether a file is whole ----------------------------------------------------------------------


def whole(path: Path) -> bool:
    """Whether a file ends where its kind ends."""
    data = path.read_bytes()
    match path.suffix:
        case ".json":
            return bool(json.loads(data))
        case ".jsonl":  # the last line may be cut off, which reading it knows
            return all(json.loads(line) for line in data.split(b"\n")[:-1])
        case ".fits" | ".gz" | ".png" | ".jpg":
            from kochab.frames import read_frame

            return read_frame(path).width > 0
        case ".wcs":
            return data.startswith(b"SIMPLE") and b"\nEND" in data and len(data) % 2880 == 0
        case ".ini":
            return data.endswith(b"\n") and (b"PLTSOLVD" in data or data.count(b"theme=") == 1)
        case ".html":
            return data.rstrip().endswith(b"</html>")
        case ".zip":
            return zipfile.ZipFile(io.BytesIO(data)).testzip() is None
        case ".csv" | ".reg":  # stars, objects, stars and objects
            count = 27 if "objects" in path.name else 501 if path.suffix == ".csv" else 528
            return data.count(b"\n") == count and data.endswith(b"\n")
        case ".pdf":
            return data.startswith(b"%PDF-") and data.endswith(b"%%EOF\n")
        case ".ssc":
            return data.startswith(b"// Name: ") and data.endswith(b", 1);\n")
        case ".kcat":
            from kochab.sky import open_catalogue

            return len(open_catalogue(path)) == 3000
        case ".table":
            from kochab.identification.table_cache import unpacked

            return unpacked(data) is not None
    return False


def faults(folder: Path, before: dict[str, bytes]) -> list[str]:
    """What is neither as it was nor whole."""
    found = [f"{name} is gone" for name in before if not (folder / name).exists()]
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        volume = any(part.startswith("patterns-") for part in Path(name).parts)
        hidden = path.name.startswith(".") or path.suffix in (".part", ".lock") or "state/" in name or ".part/" in name
        if path.is_file() and not hidden and not volume and before.get(name) != path.read_bytes():
            try:
                good = whole(path)
            except Exception as error:
                found.append(f"{name} is neither as it was nor whole: {type(error).__name__}: {error}")
            else:
                if not good:
                    found.append(
                        f"{name} is neither as it was nor whole ({path.stat().st_size} bytes, {len(path.read_bytes().splitlines())} lines)"
                    )
    return found + _volume(folder)


def _volume(folder: Path) -> list[str]:
    """A pattern volume that is there under its name is whole."""
    from kochab.identification.index import open_volume

    found = []
    for index in (folder / "cache").glob("patterns-*/index.json"):
        if index.parent.suffix != ".part":
            try:
                open_volume(index.parent)
            except Exception as error:
                found.append(f"{index.parent.name} is not whole: {error}")
    return found


# -- A trial ----------------------------------------------------------------------------------------


@dataclass(slots=True)
class Trial:
    """How it ended: the exit code, or minus the signal; what it told; changes of files it made."""

    code: int
    told: str
    changes: int
    seconds: float


CHANGES = (
    "os.rename",
    "os.remove",
    "os.mkdir",
    "os.rmdir",
    "os.truncate",
    "os.chmod",
    "os.chown",
    "os.utime",
    "os.link",
)


def trial(case: Case, folder: Path, prepare: Callable[[], None] = lambda: None, kill_after_s: float = LONGEST_S,
          kill_at: int = 0) -> Trial:  # fmt: skip
    """Run the case in a fork of this process; it kills itself before the change number ``kill_at``."""
    read, write = os.pipe()
    begun = time.monotonic()
    child = os.fork()
    if not child:
        os.close(read)
        code = 99
        try:
            code = _child(case, folder, prepare, write, kill_at)
        except BaseException:
            os.write(write, traceback.format_exc().encode())
        finally:
            os._exit(code)
    os.close(write)
    told, status, changes = b"", None, 0
    with fed(folder):
        while status is None:
            left = kill_after_s - (time.monotonic() - begun)
            if left <= 0:
                os.kill(child, signal.SIGKILL)
            if select.select([read], [], [], min(max(left, 0.01), 0.05))[0]:
                told += os.read(read, 1 << 16)
            ended, code = os.waitpid(child, os.WNOHANG)
            status = code if ended else None
    while piece := os.read(read, 1 << 16):
        told += piece
    os.close(read)
    text = told.decode("utf-8", "replace")
    if "\0" in text:
        text, _, count = text.rpartition("\0")
        changes = int(count)
    return Trial(os.waitstatus_to_exitcode(status), text, changes, time.monotonic() - begun)


def _child(case: Case, folder: Path, prepare: Callable[[], None], told: int, kill_at: int) -> int:
    from kochab.frames import sandbox

    sandbox._idle.clear()  # they are our parent's
    os.dup2(told, 1)
    os.dup2(told, 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for name in ("CONFIG", "CACHE", "DATA"):
        os.environ[f"XDG_{name}_HOME"] = str(folder / name.lower())
    os.environ["KOCHAB_CONFIG"] = str(folder / "config")
    os.environ["XDG_STATE_HOME"] = "/dev/null"  # the journal is appended to; here it would only be in the way
    seen = 0

    def changed(event: str, details: tuple[object, ...]) -> None:
        nonlocal seen
        opened = event == "open" and isinstance(details[2], int) and details[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
        if (opened or event in CHANGES) and str(folder) in str(details[0]):
            seen += 1
            if seen == kill_at:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(changed)
    with (
        contextlib.redirect_stdout(open(1, "w", closefd=False)),
        contextlib.redirect_stderr(open(2, "w", closefd=False)),
    ):
        prepare()
        code = case.run(folder)
        sys.stdout.flush()
        sys.stderr.flush()
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    os.write(2, f"\0{seen}".encode())
    return code


def outgrown(most_bytes: int, kills: bool) -> Callable[[], None]:
    """No file may be longer: writing on kills, or fails as on a full disk."""

    def prepare() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL if kills else signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, resource.RLIM_INFINITY))

    return prepare


def without_rights() -> None:
    """Let even root be bound by what files and folders allow, but for reading: the checkout may stand in a closed home."""
    if os.geteuid() == 0:
        header, read_search = (ctypes.c_uint32 * 2)(0x20080522, 0), 1 << 2  # `capabilities(7)`, `capset(2)`
        if ctypes.CDLL(None).capset(header, (ctypes.c_uint32 * 6)(read_search, read_search)):
            raise OSError("the rights of root cannot be given up")


class Killed:
    """The night's frames, and for each case what was there before and what a whole run makes of it."""

    def __init__(self, home: Path, seed: int) -> None:
        self._home, self._rng, self._count = home, random.Random(seed), 0
        (home / "night").mkdir()
        night(home / "night")
        self._reference: dict[str, tuple[Trial, int]] = {}

    def fresh(self, case: Case) -> tuple[Path, dict[str, bytes]]:
        """A folder as it is before the case, and its files."""
        self._count += 1
        folder = self._home / f"{self._count:05d}"
        shutil.copytree(self._home / "night", folder)
        if case.name == "camera take":
            (folder / "frames").mkdir()
            shutil.copy(folder / "night.fits", folder / "frames")
        if case.run is _live:
            (folder / "watched").mkdir()
        for name in case.before:
            (path := folder / name).parent.mkdir(parents=True, exist_ok=True)
            if not path.exists():
                path.write_text("PLTSOLVD=F\n" if path.suffix == ".ini" and "window" not in name else OLD)
            if path.suffix == ".wcs":
                path.write_text("SIMPLE  =                    T\nNAXIS   =                    0\nPLTSOLVD=F\n")
        (folder / "state").mkdir()
        rows = (f"{self._rng.random()} solved\n" for _ in range(3000))
        (folder / "state" / "journal.log").write_text("".join(rows))
        if case.name == "profile save":
            (folder / case.before[0]).unlink()
            trial(kochab_case("profile", "save", "lens", "--exposure", "1"), folder)
        return folder, {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}

    def reference(self, case: Case) -> tuple[Trial, int]:
        """A run that is left in peace, and the longest file that is there after it."""
        if case.name not in self._reference:
            folder, before = self.fresh(case)
            done = trial(case, folder)
            assert done.code == 0, f"{case.name}: {done.code}: {done.told}"
            assert not faults(folder, before), f"{case.name}: {faults(folder, before)}"
            new = [
                p for p in folder.rglob("*") if p.is_file() and before.get(str(p.relative_to(folder))) != p.read_bytes()
            ]
            self._reference[case.name] = done, max(p.stat().st_size for p in new)
            shutil.rmtree(folder)
        return self._reference[case.name]

    def kill(self, case: Case, way: str) -> list[str]:
        """End one run in that way; what is then neither old nor new."""
        done, longest = self.reference(case)
        folder, before = self.fresh(case)
        if way == "moment":
            ended = trial(case, folder, kill_after_s=self._rng.uniform(0.0, 1.05 * done.seconds))
        elif way == "change":
            ended = trial(case, folder, kill_at=self._rng.randint(1, max(1, done.changes)))
        else:
            ended = trial(case, folder, outgrown(int(longest ** self._rng.uniform(0.2, 1.0)), kills=True))
        found = faults(folder, before)
        if ended.code == 0 or ended.code == 99:
            found += [] if ended.code == 0 else [f"a traceback: {ended.told[-600:]}"]
        shutil.rmtree(folder)
        return found

    def refuse(self, case: Case, full: bool) -> list[str]:
        """Run on a full disk, or where nothing may be written; what is lost, or not said."""
        _, longest = self.reference(case)
        folder, before = self.fresh(case)
        if full:
            ended = trial(case, folder, outgrown(longest // 2, kills=False))
        else:
            for path in (folder, *folder.rglob("*")):
                path.chmod(0o555 if path.is_dir() else 0o444)
            ended = trial(case, folder, without_rights)
        found = faults(folder, before)
        told = [line for line in ended.told.splitlines() if line.strip()]
        noted = any(b"\nWARNING=" in path.read_bytes() for path in folder.glob("*.ini"))  # where ASTAP's callers look
        if "Traceback" in ended.told or "A fault in Kochab" in ended.told or ended.code in (99, *range(-64, 0)):
            found.append(f"ended with {ended.code}: {ended.told[-700:]}")
        elif case.tells and not noted and not any(SAID.search(line) for line in told):
            found.append(f"no sentence, code {ended.code}: {ended.told[-300:]}")
        if not full and (changed := [n for n, old in before.items() if (folder / n).read_bytes() != old]):
            found.append(f"{changed} changed in a read-only folder")
        for path in (folder, *folder.rglob("*")):
            if path.is_dir():
                path.chmod(0o755)
        shutil.rmtree(folder)
        return found


def kochab_case(*words: str) -> Case:
    """A command to prepare with."""
    return Case("prepare", kochab(*words))


def main() -> int:
    """Kill, fill and refuse; print a line for each case; 1 when something was lost or not said."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.killed", description=__doc__)
    parser.add_argument("cases", nargs="*", metavar="CASE", help="begins of names (default: all)")
    parser.add_argument("--kills", type=int, default=200, metavar="N", help="over all cases (200)")
    parser.add_argument("--quick", action="store_true", help="without the cases that wait for frames")
    parser.add_argument("--seed", type=int, default=random.randrange(10**6), metavar="S", help="repeats a run")
    args = parser.parse_args()
    chosen = [
        c for c in CASES if (not args.cases or c.name.startswith(tuple(args.cases))) and not (args.quick and c.dear)
    ]
    print(f"{len(chosen)} cases, {args.kills} kills, seed {args.seed}")
    print(f"{'case':26}{'kills':>6}{'seconds':>9}  full disk, read-only")
    lost = 0
    with TemporaryDirectory(prefix="kochab-killed-") as home:
        killed = Killed(Path(home), args.seed)
        for number, case in enumerate(chosen):
            begun, share = time.monotonic(), range(number, args.kills, len(chosen))
            said = [f"killed ({way}): {told}" for k, way in ((k, WAYS[k // len(chosen) % 3]) for k in share)
                    for told in killed.kill(case, way)]  # fmt: skip
            refused = [killed.refuse(case, full) for full in (True, False)]
            said += [
                f"{name}: {told}"
                for name, found in zip(("full disk", "read-only"), refused, strict=True)
                for told in found
            ]
            marks = ", ".join("FAILED" if found else "told" if case.tells else "kept" for found in refused)
            print(f"{case.name:26}{len(share):>6}{time.monotonic() - begun:>9.1f}  {marks}", flush=True)
            print(*(f"    {told}" for told in said), sep="\n", end="\n" if said else "", flush=True)
            lost += len(said)
    return int(lost > 0)


if __name__ == "__main__":
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    sys.exit(main())
