"""Patterns of file names are filled in where the shell does not."""

import json

import pytest

from kochab.cli.main import main
from kochab.cli.options import named
from kochab.core.errors import UsageError


def test_patterns_are_filled_in_and_names_stay(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("b.fits", "a.fits", "c.jpg", "m[1].fits"):
        (tmp_path / name).touch()
    assert named(["*.fits", "c.jpg"]) == ["a.fits", "b.fits", "m[1].fits", "c.jpg"]
    assert named(["m[1].fits", "?.jpg", "x*.tif", "none"]) == [*("m[1].fits", "c.jpg", "x*.tif", "none")]
    with pytest.raises(UsageError):
        named([" "])


@pytest.mark.parametrize("command", ["solve", "identify", "polar"])
def test_commands_take_patterns(tmp_path, capsys, command) -> None:
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("nothing\n")
    size = ("--width", "9", "--height", "9") if command == "identify" else ()
    told = () if command == "polar" else ("--json",)
    assert main([command, str(tmp_path / "*.csv"), *size, *told]) == 2
    out, err = capsys.readouterr()
    if told:
        files = [json.loads(line)["file"] for line in out.splitlines()]
        assert files == [str(tmp_path / "a.csv"), str(tmp_path / "b.csv")]
    else:
        assert "a.csv" in err
