"""The wheel of this tree: complete, and at work from a folder that knows nothing of the source.

Third-party packages are borrowed from the environment of these tests through a ``.pth`` line,
since installing Qt again proves nothing; ``app``, ``catalogs`` and ``resources`` must come from
the wheel, and a test says where they came from.
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

PACKAGES = ("app", "catalogs", "resources")
SAMPLES = Path("resources", "samples")


@pytest.fixture(scope="module")
def wheel(repository, tmp_path_factory):
    """The wheel, built from this tree."""
    folder = tmp_path_factory.mktemp("dist")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder]
    run(build, repository)
    (found,) = folder.glob("kochab-*.whl")
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
    install = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet"]
    run([*install, "--disable-pip-version-check", "--no-index", "--no-deps", wheel], elsewhere)
    asked = run([python, "-c", "import app; print(app.__file__)"], elsewhere)
    installed = Path(asked.strip()).parents[1]
    assert installed.is_relative_to(folder)
    borrowed = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (installed / "borrowed.pth").write_text("\n".join(sorted(borrowed)) + "\n")
    return programs


def run(command, cwd):
    """Run to the end without a trace of the source in the environment; what it printed."""
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL_ENV"))}
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd, env=clean, capture_output=True, text=True, timeout=110,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_everything_tracked_is_in_the_wheel_and_nothing_else(wheel, repository):
    inside = {n for n in zipfile.ZipFile(wheel).namelist() if not n.endswith("/")}
    tops = {name.split("/")[0] for name in inside}
    assert {top for top in tops if not top.endswith(".dist-info")} == set(PACKAGES)
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in inside)
    if not (repository / ".git").exists():
        pytest.skip("not a git checkout, so what is tracked cannot be asked")
    tracked = subprocess.run(
        ["git", "ls-files", *PACKAGES], cwd=repository, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    assert sorted(set(tracked) - inside) == []


def test_the_three_packages_come_from_the_wheel(scripts, elsewhere):
    code = f"import json, {', '.join(PACKAGES)}; print(json.dumps([{', '.join(f'{p}.__file__' for p in PACKAGES)}]))"
    for file in json.loads(run([scripts / "python", "-c", code], elsewhere)):
        assert Path(file).is_relative_to(scripts.parent), file


def test_both_ways_to_start_tell_the_version(scripts, elsewhere):
    from app import __version__

    assert run([scripts / "kochab", "--version"], elsewhere).strip() == f"kochab {__version__}"
    told = run([scripts / "python", "-m", "app", "--version"], elsewhere).strip()
    assert told == f"kochab {__version__}"


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
