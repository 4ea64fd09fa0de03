"""Output that is closed, full, or has no letter for a file's name."""

import io
import json
import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from kochab.cli import main as cli
from kochab.cli.main import main
from kochab.cli.process import spelt
from kochab.frames.wcs import write_wcs
from kochab.workflows.solution_json import to_line
from tests.house import SAMPLES
from tests.workflows.test_polar_solutions import BEGUN, picture, solution

IDENTIFY = ("identify", "--width", "9", "--height", "9", "--json")


def run(repository, *arguments, **streams) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "app", *arguments]
    environment = os.environ | {"PYTHONIOENCODING": "utf-8:strict"}
    environment |= streams.pop("env", {})
    return subprocess.run(command, cwd=repository, env=environment, timeout=120, **streams)


def test_json_is_ascii_and_keeps_every_letter() -> None:
    value = {"file": "café α\udce9.fits"}
    line = to_line(value)
    assert line.isascii()
    assert json.loads(line) == value


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="names are Unicode there")
@pytest.mark.parametrize("flags", [["--json"], []])
def test_a_name_that_is_no_text_is_told(repository, tmp_path, flags) -> None:
    name = os.fsencode(tmp_path) + b"/caf\xe9.csv"
    Path(os.fsdecode(name)).write_text("# nothing\n")
    done = run(repository, *IDENTIFY[:-1], *flags, name, capture_output=True)
    assert done.returncode in (1, 2)
    assert b"caf\\udce9.csv" in done.stdout + done.stderr
    assert b"Traceback" not in done.stderr


@pytest.mark.skipif(sys.platform == "win32" or not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_a_full_disk_is_one_sentence(repository, tmp_path) -> None:
    stars = tmp_path / "a.csv"
    stars.write_text("1,1\n")
    with open("/dev/full", "wb") as full:
        done = run(repository, *IDENTIFY, stars, stdout=full, stderr=subprocess.PIPE)
        assert done.returncode == 2
        assert done.stderr.decode() == ("kochab: The output cannot be used: No space left on device.\n")
        done = run(repository, "identify", "x", stdout=subprocess.PIPE, stderr=full)
        assert done.returncode == 2


@pytest.mark.parametrize(("name", "code"), [("a.csv", 1), ("none.csv", 2)])
def test_closed_streams_change_no_exit_code(monkeypatch, tmp_path, name, code) -> None:
    (tmp_path / "a.csv").write_text("1,1\n2,2\n")
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    assert main([*IDENTIFY, str(tmp_path / name)]) == code
    sys.stdout.close()
    sys.stderr.close()


def test_what_the_system_refuses_names_the_file(monkeypatch, capsys) -> None:
    def refused(arguments):
        raise PermissionError(13, "Permission denied", "/closed")

    monkeypatch.setattr(cli, "build_parser", refused)
    assert main(["solve", "x"]) == 2
    assert capsys.readouterr().err == "kochab: /closed cannot be used: Permission denied.\n"


# -- Encodings that have few letters ---------------------------------------------------------------

ENCODINGS = ("ascii", "cp437", "cp1252", "cp932")
HANDLERS = ("strict", "surrogateescape")
"""What Python chooses: the second for Windows' pipes, and for LC_ALL=C."""


@contextmanager
def encoded(monkeypatch, encoding, errors):
    """Standard output and error that take this encoding; yields what was written, in order, as text."""
    raw, told = io.BytesIO(), []
    with monkeypatch.context() as patched:
        for name in ("stdout", "stderr"):
            patched.setattr(sys, name, io.TextIOWrapper(raw, encoding, errors, write_through=True))
        yield told
        for name in ("stdout", "stderr"):
            getattr(sys, name).detach()
    told.append(raw.getvalue().decode(encoding))


def below(parser, words):
    """The words of every command and of the commands below it."""
    yield words
    for action in parser._actions:
        if isinstance(choices := action.choices, dict):
            for name, inner in choices.items():
                yield from below(inner, (*words, name))


def every_command():
    for name in cli.COMMANDS:
        (action,) = (a for a in cli.build_parser([name])._actions if isinstance(a.choices, dict))
        yield from below(action.choices[name], (name,))


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_the_help_of_every_command_is_told_in_any_encoding(monkeypatch, encoding) -> None:
    commands = [(), *every_command()]
    assert len(commands) > 30
    for words in commands:
        with encoded(monkeypatch, encoding, "surrogateescape") as told:
            assert main([*words, "--help"]) == 0
        assert "usage: kochab" in told[0]
        assert "A fault in Kochab" not in told[0]


def sighted(folder) -> list[str]:
    for k in range(3):
        write_wcs(solution(25.0 * k), folder / f"{k}.wcs")
        picture(folder / f"{k}.fits", BEGUN)
    return [str(folder / f"{k}.wcs") for k in range(3)]


@pytest.mark.parametrize(("encoding", "errors"), list(zip(ENCODINGS, HANDLERS * 2, strict=True)))
def test_the_main_commands_are_told_in_any_encoding(monkeypatch, tmp_path, encoding, errors) -> None:
    """The stars of Orion have Greek names, an axis has degrees and arcseconds."""
    orion = str(SAMPLES / "orion.png")
    for command, said in [
        (["solve", orion], "orion.png"),
        (["detect", orion], "stars"),
        (["polar", *sighted(tmp_path), "--site", "47,8,450"], "axis"),
        (["catalog", "info"], "stars"),
        (["solve", str(tmp_path / "η ± 5°.png")], "does not exist"),
    ]:
        with encoded(monkeypatch, encoding, errors) as told:
            main(command)
        assert said in told[0]
        assert "A fault in Kochab" not in told[0]
        assert "Traceback" not in told[0]


def test_json_is_the_same_in_any_encoding(monkeypatch) -> None:
    told = []
    for encoding in ("utf-8", "ascii"):
        with encoded(monkeypatch, encoding, "surrogateescape") as lines:
            assert main(["solve", str(SAMPLES / "orion.png"), "--json"]) == 0
        told.append([star["name"] for star in json.loads(lines[0])["stars"]])
    assert told[0] == told[1]
    assert not "".join(told[0]).isascii()


@pytest.mark.parametrize(
    ("text", "ascii_text"),
    [
        ("η Ori", "eta Ori"),
        ("θ¹ Ori", "theta1 Ori"),
        ("λ", "lambda"),
        ("47.5° ± 3″", '47.5deg +/- 3"'),
        ("Höhe", "Hohe"),
        ("caf\udce9", "caf\\udce9"),
        ("\u4e2d", "\\u4e2d"),
    ],
)
def test_what_an_encoding_lacks_is_spelt(text, ascii_text) -> None:
    assert "".join(c if c.isascii() else spelt(c) for c in text) == ascii_text


@pytest.mark.skipif(sys.platform == "win32", reason="has no locale C")
@pytest.mark.parametrize(
    "environment",
    [
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": ""},
        {"PYTHONIOENCODING": "cp1252:surrogateescape"},  # as Windows has its pipes
        {"PYTHONIOENCODING": "cp437"},
    ],
)
def test_the_program_itself_is_told_in_any_locale(repository, environment) -> None:
    done = run(repository, "solve", SAMPLES / "orion.png", env=environment, capture_output=True)
    assert done.returncode == 0
    assert b"eta Ori" in done.stdout or "η Ori".encode("cp437", "ignore") in done.stdout
    # a slow machine is told how far it is
    assert all(line.endswith(b" ...") for line in done.stderr.splitlines())
