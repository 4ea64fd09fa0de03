"""The command line as a whole: help, versions, and every bad end."""

import errno
import logging
import os
import signal
import subprocess
import sys
import time

import pytest

from kochab import __version__
from kochab.cli import main as cli
from kochab.cli.main import COMMANDS, main


def test_help_names_every_command_and_imports_none(capsys, repository) -> None:
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    for name in COMMANDS:
        assert f"\n    {name} " in text
    probe = (
        "import sys; from kochab.cli.main import main; main(['--help']); "
        "print(sorted({'numpy', 'scipy', 'astropy', 'PySide6'} & set(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", probe], cwd=repository, capture_output=True, text=True, check=True)
    assert out.stdout.splitlines()[-1] == "[]"


def test_version(capsys) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"kochab {__version__}\n"


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_has_help(name, capsys) -> None:
    assert main([name, "--help"]) == 0
    assert f"kochab {name}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("typed", "place"),
    [("-10,40,5", (350.0, 40.0, 5.0)), ("-10.5,40,5", (349.5, 40.0, 5.0)), ("-.5,-40,5", (359.5, -40.0, 5.0))],
)
def test_a_list_that_begins_with_a_minus_is_the_value_of_its_option(typed, place) -> None:
    read = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("kochab.cli.solve.run", lambda args: read.append(args.near) or 0)
        assert main(["solve", "--near", typed, "a.fits"]) == 0
    assert read == [place]


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["dance"],
        ["solve"],
        ["solve", "--fov", "wide", "a.fits"],
        ["solve", "--fov", "0", "a.fits"],
        ["solve", "--fov", "nan", "a.fits"],
        ["solve", "--fov", "180", "a.fits"],
        ["solve", "--scale", "-1", "a.fits"],
        ["solve", "--near", "1,2", "a.fits"],
        ["solve", "--near", "1,95,3", "a.fits"],
        ["solve", "--near", "1,x,3", "a.fits"],
        ["solve", "--timeout", "0", "a.fits"],
        ["solve", "--workers", "0", "a.fits"],
        ["solve", "--workers", "many", "a.fits"],
        ["solve", "--nonsense", "a.fits"],
        ["identify", "a.csv"],
        ["identify", "a.csv", "--width", "0", "--height", "5"],
        ["identify", "a.csv", "--width", "-3", "--height", "5"],
    ],
)
def test_bad_arguments_are_one_sentence(arguments, capsys) -> None:
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("kochab")
    assert err.count("\n") == 1
    assert err.endswith(".\n")


def test_an_interrupt_is_quiet(monkeypatch, capsys) -> None:
    def interrupted(arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "build_parser", interrupted)
    assert main(["solve", "x"]) == 130
    assert capsys.readouterr() == ("", "")


def test_a_reader_that_leaves_is_no_error(repository, tmp_path) -> None:
    for n in range(40):
        (tmp_path / f"{n}.csv").write_text("# nothing\n")
    command = [sys.executable, "-m", "app", "identify", "--width", "9", "--height", "9", "--json"]
    process = subprocess.Popen(
        [*command, *sorted(str(p) for p in tmp_path.iterdir())],
        cwd=repository,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    process.stdout.readline()
    process.stdout.close()
    err = process.stderr.read()
    process.stderr.close()
    assert process.wait(timeout=60) in (2, 141)
    assert err == b""


@pytest.mark.parametrize(("system", "code"), [("win32", 141), ("linux", 2)])
def test_windows_calls_a_reader_that_left_an_invalid_argument(monkeypatch, capsys, system, code) -> None:
    def write(arguments):
        raise OSError(errno.EINVAL, "Invalid argument")

    monkeypatch.setattr("kochab.cli.main._command", write)
    monkeypatch.setattr("kochab.cli.process.give_up", lambda: None)
    monkeypatch.setattr(sys, "platform", system)
    assert main(["catalog", "info"]) == code
    assert (capsys.readouterr().err == "") == (code == 141)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows ends a process without asking")
def test_every_command_is_ended_politely(monkeypatch) -> None:
    def run(args) -> int:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(5.0)
        return 0

    monkeypatch.setattr("kochab.lab.bench.command.run", run)
    assert main(["bench", "detect"]) == 130


def test_a_file_after_the_options_is_told_where_to_stand(capsys) -> None:
    assert main(["solve", "a.fits", "--json", "b.fits"]) == 2
    err = capsys.readouterr().err
    assert "arguments: b.fits: name all files together" in err
    assert main(["solve", "a.fits", "--dance"]) == 2
    assert "together" not in capsys.readouterr().err


def test_files_without_a_command_are_told_which(tmp_path, capsys) -> None:
    path = tmp_path / "a.fits"
    path.touch()
    assert main([str(path), "--json"]) == 2
    assert "kochab solve FILE" in capsys.readouterr().err
    assert main([str(tmp_path / "none.fits"), "--json"]) == 2
    assert "invalid choice" in capsys.readouterr().err


def test_a_librarys_warning_is_not_for_the_person_who_solves(repository) -> None:
    code = (
        "import warnings\n"
        "from kochab import __main__ as program\n"
        "program._window = lambda *_: warnings.warn('deep inside') or 0\n"
        "raise SystemExit(program.main([]))\n"
    )
    told = {}
    for options in ((), ("-W", "default")):
        command = [sys.executable, *options, "-c", code]
        done = subprocess.run(command, cwd=repository, capture_output=True, text=True, check=True)
        told[options] = done.stderr
    assert told[()] == ""
    assert "deep inside" in told["-W", "default"]


def test_a_fault_is_one_sentence_and_its_traceback_is_in_the_journal(tmp_path, monkeypatch, capsys) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr("kochab.cli.main.build_parser", broken)
    assert main(["solve", "a.fits"]) == 2
    assert "--debug shows the details" in capsys.readouterr().err
    journal = logging.FileHandler(tmp_path / "journal.log")
    root = logging.getLogger("kochab")
    root.addHandler(journal)
    try:
        assert main(["solve", "a.fits"]) == 2
    finally:
        root.removeHandler(journal)
        journal.close()
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert str(tmp_path / "journal.log") in err
    assert "Traceback" in (tmp_path / "journal.log").read_text()


def test_debug_shows_the_journal_on_standard_error(monkeypatch, capsys) -> None:
    root = logging.getLogger("kochab")
    before, level = list(root.handlers), root.level
    monkeypatch.setattr("kochab.cli.solve.run_detect", lambda args: root.debug("opened COM3") or 0)
    try:
        assert main(["detect", "a.fits", "--debug"]) == 0
        assert "opened COM3" in capsys.readouterr().err
    finally:
        root.handlers[:] = before
        root.setLevel(level)
