"""The wheel of this tree: complete, and at work from a folder that knows nothing of the source.

Third-party packages are borrowed from the environment of these tests through a ``.pth`` line,
since installing Qt again proves nothing; ``kochab`` must come from the wheel, and a test says where
it came from.
"""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

import kochab

SOURCES = ("app/kochab", "catalogs", "resources")
SAMPLES = Path("resources", "samples")
UNPRESSED = """
import importlib, sys, tomllib, zlib
from pathlib import Path
pressed = zlib.compressobj
zlib.compressobj = lambda level, *more: pressed(0, *more)
backend = tomllib.loads(Path("pyproject.toml").read_text("utf-8"))["build-system"]["build-backend"]
importlib.import_module(backend).build_wheel(sys.argv[1])
"""
"""The wheel as its backend builds it, but not pressed: that takes 4.4 s of processor, and nothing here asks for it."""


@pytest.fixture(scope="module")
def wheel(repository, tmp_path_factory):
    """The wheel, built from this tree."""
    folder = tmp_path_factory.mktemp("dist")
    run([sys.executable, "-c", UNPRESSED, folder], repository)
    (found,) = folder.glob("kochab_astro-*.whl")
    return found


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory):
    """A folder that has nothing to do with the source."""
    return tmp_path_factory.mktemp("elsewhere")


@pytest.fixture(scope="module")
def scripts(wheel, elsewhere, tmp_path_factory):
    """The folder of programs of an empty environment into which the wheel was installed."""
    folder = tmp_path_factory.mktemp("empty") / "venv"
    venv.create(folder, with_pip=False, symlinks=os.name != "nt")
    programs = folder / ("Scripts" if os.name == "nt" else "bin")
    python = programs / "python"
    install = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-compile"]
    run([*install, "--disable-pip-version-check", "--no-index", "--no-deps", wheel], elsewhere)
    asked = run([python, "-c", "import kochab; print(kochab.__file__)"], elsewhere)
    installed = Path(asked.strip()).parents[1]
    assert installed.is_relative_to(folder)
    borrowed = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (installed / "borrowed.pth").write_text("\n".join(sorted(borrowed)) + "\n")
    return programs


def run(command, cwd, **environment):
    """Run to the end without a trace of the source in the environment; what it printed."""
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL_ENV"))} | environment
    done = subprocess.run(
        [str(part) for part in command], cwd=cwd, env=clean, capture_output=True, text=True, timeout=280
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_wheel_installs_kochab_alone_with_all_its_data(wheel, repository):
    inside = {n for n in zipfile.ZipFile(wheel).namelist() if not n.endswith("/")}
    package = {name for name in inside if name.startswith("kochab/")}
    metadata = inside - package
    assert {name.split("/")[0] for name in metadata} == {f"kochab_astro-{kochab.__version__}.dist-info"}
    assert any(name.endswith("/licenses/LICENSE") for name in metadata)
    if not (repository / ".git").exists():
        pytest.skip("not a git checkout, so what is tracked cannot be asked")
    tracked = subprocess.run(
        ["git", "ls-files", *SOURCES], cwd=repository, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    tracked = [name for name in tracked if not name.startswith("catalogs/making/")]
    wanted = {n.removeprefix("app/") if n.startswith("app/") else f"kochab/{n}" for n in tracked}
    assert package == wanted | {"kochab/resources/help/CHANGELOG.md"}


def test_no_file_and_nothing_beside_the_package_is_left_in_the_way(scripts, elsewhere):
    """The published methods are there by their entry points, and the data inside the package."""
    code = (
        "import kochab, kochab.folders, pathlib\n"
        "home = pathlib.Path(kochab.__file__).parent\n"
        "print(sorted(p.name for p in home.parent.iterdir() if p.suffix != '.dist-info'))\n"
        "print(all(kochab.folders.data_folder(n).parent == home for n in ('catalogs', 'resources')))\n"
    )
    assert run([scripts / "python", "-c", code], elsewhere).splitlines() == ["['borrowed.pth', 'kochab']", "True"]
    listed = run([scripts / "kochab", "solve", "--methods"], elsewhere)
    for entry in ("--method voting", "--method triads", "--detector contours", "--attitude triad"):
        assert entry in listed


def test_strangers_with_the_old_names_do_no_harm(scripts, elsewhere, repository, tmp_path):
    """``app.py`` and packages called ``resources`` and ``catalogs``, in front of everything else."""
    (tmp_path / "app.py").write_text("raise SystemExit('the wrong app')\n")
    for name in ("resources", "catalogs"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise SystemExit('the wrong data')\n")
    frame = repository / SAMPLES / "pleiades.fits"
    for path in ("", str(tmp_path)):
        command = [scripts / "python", "-m", "kochab", "solve", frame, "--json"]
        (line,) = run(command, tmp_path, PYTHONPATH=path).splitlines()
        assert json.loads(line)["solved"] is True


def test_a_checkout_runs_without_being_installed(repository, tmp_path):
    """From a copy that no installation knows, with what Kochab depends on and nothing else."""
    shutil.copytree(repository / "app", tmp_path / "app")
    for name in ("catalogs", "resources", "pyproject.toml"):
        (tmp_path / name).symlink_to(repository / name)
    frame = SAMPLES / "orion.png"  # by a published method: nothing has written its entry point down
    command = [sys.executable, "-m", "app", "solve", frame, "--method", "voting", "--fov", "15"]
    assert "centre" in run(command, tmp_path)
    code = (
        "import runpy, sys\n"
        "sys.argv = ['app', '--version']\n"
        "try:\n    runpy.run_module('app', run_name='__main__')\n"
        "except SystemExit:\n    print(sys.modules['kochab'].__file__)"
    )
    assert Path(run([sys.executable, "-c", code], tmp_path).splitlines()[-1]).is_relative_to(tmp_path)


def test_both_ways_to_start_tell_the_version(scripts, elsewhere):
    assert run([scripts / "kochab", "--version"], elsewhere).strip() == f"kochab {kochab.__version__}"
    told = run([scripts / "python", "-m", "kochab", "--version"], elsewhere).strip()
    assert told == f"kochab {kochab.__version__}"


def test_it_solves_a_frame_from_another_folder(scripts, elsewhere, repository):
    samples = repository / SAMPLES
    frame = min(
        (p for p in samples.iterdir() if p.suffix in {".fits", ".fz", ".jpg", ".png", ".tif"}),
        key=lambda p: p.stat().st_size,
    )
    shutil.copy(frame, elsewhere)
    (line,) = run([scripts / "kochab", "solve", frame.name, "--json"], elsewhere).splitlines()
    answer = json.loads(line)
    assert answer["solved"] is True
    assert answer["file"] == frame.name
    assert answer["matches"] >= 6
    assert answer["log10_false_alarm"] < -9
