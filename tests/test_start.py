"""What the installed commands do first: files to the window, and a stranger of the same name found out."""

import os
import shutil
import subprocess
import sys

import pytest

from kochab import __main__ as program


@pytest.fixture
def opened(monkeypatch):
    """What was opened in the window, or None where the command line was called."""
    calls = []
    monkeypatch.setattr(program, "_window", lambda paths, language="": calls.append(paths) or 0)
    monkeypatch.setattr("kochab.cli.main.main", lambda arguments: calls.append(None) or 0)
    monkeypatch.setattr("kochab.gear.journal.open_journal", lambda **_: None)
    return calls


def test_files_and_folders_open_in_the_window(opened, tmp_path):
    names = [str(tmp_path / name) for name in ("a.fits", "b b.jpg", "night")]
    for name in names[:2]:
        open(name, "wb").close()
    (tmp_path / "night").mkdir()
    for arguments in (names[:1], names[:2], names[2:], names, [names[0], str(tmp_path / "gone.fits")]):
        program.main(arguments)
        assert opened.pop() == arguments


def test_commands_and_options_go_to_the_command_line(opened, tmp_path):
    (tmp_path / "a.fits").touch()
    file = str(tmp_path / "a.fits")
    for arguments in (["solve", file], ["slove", file], [file, "--json"], [file, "nonsense"], ["--version"]):
        program.main(arguments)
        assert opened.pop() is None, arguments


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the system counts threads")
def test_a_command_starts_no_threads_for_its_small_matrices(repository):
    sample = repository / "resources" / "samples" / "pleiades.fits"
    code = (
        "import os, sys; from kochab.__main__ import main; code = main();"
        "print(code, len(os.listdir('/proc/self/task')), file=sys.stderr)"
    )
    env = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    command = [sys.executable, "-c", code, "solve", "--no-worker", str(sample)]
    done = subprocess.run(command, capture_output=True, text=True, env=env)
    assert done.stderr.split() == ["0", "1"]


def test_another_package_in_its_place_is_said_in_one_sentence(repository, tmp_path):
    """The stranger's two files that have namesakes here: its face, and what ``python -m kochab`` runs."""
    home = tmp_path / "kochab"
    shutil.copytree(repository / "app" / "kochab", home, ignore=shutil.ignore_patterns("__pycache__"))
    command = [sys.executable, "-c", "import sys; from kochab.start import main; sys.exit(main())", "--version"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (home / "__init__.py").write_text('"""Loops of agents."""\n__version__ = "0.1.0"\n')
    (home / "__main__.py").write_text("raise SystemExit('the wrong program')\n")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "pip install kochab-astro" in done.stderr
