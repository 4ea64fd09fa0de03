"""What ``kochab`` does with its arguments."""

import sys

import pytest

import kochab.__main__ as entry
from kochab.window import display_check


@pytest.fixture
def heard(monkeypatch):
    """What was started: the window with its files, or the command line with its arguments."""
    said = []
    for name in ("WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setattr(display_check, "_load_screen_plugin", lambda: None)
    monkeypatch.setattr(display_check, "_answers", lambda: True)
    monkeypatch.setattr("kochab.window.application.run", lambda paths, *_: said.append(("window", paths)) or 0)
    monkeypatch.setattr("kochab.cli.main.main", lambda argv: said.append(("command", argv)) or 1)
    return said


def test_no_argument_opens_the_window(heard):
    assert entry.main([]) == 0
    assert heard == [("window", [])]


def test_a_file_opens_in_the_window(heard, tmp_path):
    path = tmp_path / "m31.fits"
    path.touch()
    assert entry.main([str(path)]) == 0
    assert heard == [("window", [str(path)])]


def test_a_command_goes_to_the_command_line(heard):
    assert entry.main(["solve", "m31.fits", "--json"]) == 1
    assert entry.main(["--version"]) == 1
    assert [h[0] for h in heard] == ["command", "command"]


def test_a_command_wins_over_a_file_of_its_name(heard, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bench").touch()
    entry.main(["bench"])
    assert heard == [("command", ["bench"])]


def test_a_word_that_is_no_file_goes_to_the_command_line(heard):
    entry.main(["slove"])
    assert heard == [("command", ["slove"])]


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError("libEGL.so.1: cannot open shared object file: No such file"), ["libEGL.so.1", "apt install"]),
        (OSError("libxcb-cursor.so.0: cannot open shared object file"), ["libxcb-cursor.so.0", "libxcb-cursor0"]),
    ],
)
def test_a_missing_system_library_is_named_in_one_sentence(heard, monkeypatch, capsys, error, words):
    def missing():
        raise error

    monkeypatch.setattr(display_check, "_load_screen_plugin", missing)
    assert entry.main([]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert all(word in said for word in words)


def test_a_start_without_display_is_one_sentence(heard, monkeypatch, capsys):
    monkeypatch.delenv("DISPLAY")
    assert entry.main([]) == 2
    assert "No display" in capsys.readouterr().err
    assert heard == []


def test_a_library_missing_from_qt_itself_is_named(heard, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "kochab.window.application", None)  # importing it fails
    assert entry.main([]) == 2
    said = capsys.readouterr().err
    assert said.startswith("kochab: The window cannot start")
    assert said.count("\n") == 1
    assert "libEGL.so.1" in display_check.missing(ImportError("libEGL.so.1: cannot open"))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="displays are named on Linux")
def test_a_display_that_does_not_answer_is_one_sentence(monkeypatch, capsys):
    monkeypatch.setattr("kochab.window.application.run", lambda *_, **__: 99)
    monkeypatch.setenv("DISPLAY", ":9731")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("QT_QPA_PLATFORM", raising=False)
    assert entry.main([]) == 2
    assert capsys.readouterr().err == (
        "kochab: Display :9731 does not answer. Run Kochab in a desktop session, or use “kochab solve FILE”.\n"
    )
