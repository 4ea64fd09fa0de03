"""What only POSIX has is imported where it is used: elsewhere everything still starts."""

import shutil
import subprocess
import sys

import pytest

PROBE = """
import builtins, importlib, os, pkgutil, sys

POSIX = {"fcntl", "termios", "pty", "tty", "pwd", "grp", "resource", "posix", "syslog", "readline"}
truly = builtins.__import__

def without(name, globals=None, locals=None, fromlist=(), level=0):
    who = (globals or {}).get("__name__", "")
    if level == 0 and name.split(".")[0] in POSIX and who.split(".")[0] == "kochab":
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    return truly(name, globals, locals, fromlist, level)

builtins.__import__ = without
for gone in ("fork", "getuid", "geteuid", "nice", "sched_getaffinity", "mkfifo", "openpty", "ttyname",
             "killpg", "setsid", "uname", "getloadavg", "statvfs"):
    if hasattr(os, gone) and gone != "uname":
        delattr(os, gone)
import kochab
for module in pkgutil.walk_packages(kochab.__path__, "kochab."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
from kochab.lab.bench.live import resident_mb
from kochab.lab.bench import machine
from kochab.cli.main import main
assert resident_mb() > 0.0
assert machine()["cpus"] > 0
sys.exit(main(sys.argv[1:]))
"""


def test_everything_is_imported_without_what_only_posix_has(repository, tmp_path) -> None:
    stars = tmp_path / "a.csv"
    stars.write_text("1,1\n2,2\n")
    size = ("--width", "9", "--height", "9")
    done = subprocess.run(
        [sys.executable, "-c", PROBE, "identify", str(stars), *size],
        cwd=repository,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.stderr == ""
    assert done.returncode == 1
    assert "too few stars" in done.stdout


def test_windows_has_one_folder_for_all_that_a_person_keeps(tmp_path, monkeypatch) -> None:
    """By platformdirs' own rules of Windows, which it carries on every system: %LOCALAPPDATA%\\kochab."""
    import platformdirs
    from platformdirs.windows import Windows

    from kochab import folders
    from kochab.folders import cache_folder, config_folder
    from kochab.gear.journal import journal_folder
    from kochab.sky.catalogue_import import user_folder

    monkeypatch.setattr(folders, "_user_cache", folders._user_cache.__wrapped__)
    monkeypatch.setattr(platformdirs, "PlatformDirs", Windows)
    monkeypatch.setattr("platformdirs.windows.get_win_folder", lambda name: str(tmp_path / name))
    monkeypatch.delenv("KOCHAB_CACHE", raising=False)
    monkeypatch.delenv("KOCHAB_CONFIG", raising=False)
    own = tmp_path / "CSIDL_LOCAL_APPDATA" / "kochab"
    assert (config_folder(), journal_folder(), user_folder("mine")) == (own, own, own / "catalogs" / "mine")
    assert cache_folder() == own / "Cache"


def test_names_of_files_differ_by_more_than_their_case(repository) -> None:
    if shutil.which("git") is None:
        pytest.skip("git is not installed, and the folder has more than the project's files")
    told = subprocess.run(["git", "ls-files"], cwd=repository, capture_output=True, text=True, check=False)
    names = told.stdout.splitlines()
    assert len({name.lower() for name in names}) == len(names)
    assert not [name for name in names if set(name) & set('<>:"|?*\\')]
    assert max(map(len, names), default=0) < 120  # Windows' paths end at 260 letters
