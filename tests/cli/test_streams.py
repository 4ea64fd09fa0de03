"""Output that is closed, full, or has no letter for a file's name."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from kochab.cli import main as cli
from kochab.cli.main import main
from kochab.cli.output import to_line

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


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
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
