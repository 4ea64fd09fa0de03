"""A file's name that steers a terminal or feigns a line is shown with escapes, in every place that shows it."""

import logging
import sys

import pytest

from kochab.cli.main import main
from kochab.core.errors import FrameError, printable
from kochab.frames import read_frame
from kochab.gear.journal import open_journal

NAME = "a\x1b]0;owned\x07\nkochab: all solved\u202e.fits"
SHOWN = r"a\x1b]0;owned\x07\nkochab: all solved\u202e.fits"


def test_what_is_seen_stays():
    text = "Näht's θ¹ Ori − 12′ 🔭 C:\\night"
    assert printable(text) == text
    assert printable(NAME) == SHOWN
    assert printable("caf\udce9") == r"caf\udce9"


def clean(text):
    return not any(c in text for c in "\x1b\x07\u202e") and not any(
        line.startswith("kochab: all solved") for line in text.splitlines()
    )


# Windows has no file of such a name, and asks nobody to print one.
has_such_names = pytest.mark.skipif(sys.platform == "win32", reason="no file can have such a name there")


@has_such_names
@pytest.mark.parametrize(
    "arguments",
    [["solve"], ["solve", "--json"], ["detect"], ["polar", "--site", "48,11,0"], ["-f"], ["solve", "--timeout", "9"]],
)
def test_a_sentence_about_it(tmp_path, arguments, capsys):
    (path := tmp_path / NAME).write_text("no image")
    files = [str(path)] * (2 if "polar" in arguments else 1)
    assert main([*arguments, *files]) != 0
    told = capsys.readouterr()
    assert clean(told.out + told.err)
    assert "owned" in told.out + told.err


@has_such_names
def test_the_card_of_a_solved_frame(tmp_path, repository, capsys):
    (path := tmp_path / NAME.replace(".fits", ".png")).write_bytes(
        (repository / "resources" / "samples" / "orion.png").read_bytes()
    )
    assert main(["solve", str(path)]) == 0
    out = capsys.readouterr().out
    assert clean(out)
    assert out.startswith(str(tmp_path))


@has_such_names
def test_the_file_s_name_stands_once_in_a_sentence(tmp_path):
    (path := tmp_path / NAME).write_text("no image")
    with pytest.raises(FrameError) as caught:
        read_frame(path)
    assert str(caught.value).count("owned") == 1


def test_the_journal(tmp_path):
    root = logging.getLogger("kochab")
    before = list(root.handlers)
    file = open_journal(tmp_path)
    assert file is not None
    try:
        logging.getLogger("kochab.test").info("opened %s", NAME)
    finally:
        for handler in set(root.handlers) - set(before):
            root.removeHandler(handler)
            handler.close()
    text = file.read_text("utf-8")
    assert "\x1b" not in text
    assert "\u202e" not in text
