"""One way in for text: bounded, decoded, and JSON without what no number and no stack can hold."""

import ast
import json
import os
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import kochab
from kochab.core.errors import UsageError
from kochab.parsing.text_input import DEEPEST, TextError, decoded, parse_json, read_bytes, read_json, read_text
from tests.house import parsed

plain = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inside: st.lists(inside, max_size=4) | st.dictionaries(st.text(max_size=5), inside, max_size=4),
    max_leaves=20,
)  # fmt: skip


@given(plain)
def test_what_json_can_say_comes_back_as_it_was(value) -> None:
    assert parse_json(json.dumps(value)) == value


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1, column 1"),
        ('{"a": 1,\n "b": }', "line 2, column 7"),
        ("[NaN]", "NaN is not a number"),
        ('{"a": [1, -Infinity]}', "-Infinity is not a number"),
        ("1e400", "1e400 is not a number"),
        ("[-1e999]", "-1e999 is not a number"),
        (str(2**63), "is not a number"),
        ("9" * 5000, "is not a number"),
        ("[" * (DEEPEST + 1) + "]" * (DEEPEST + 1), "nested more than 64"),
        ('{"a":' * 900 + "1" + "}" * 900, "nested more than 64"),
        ("[" * 100_000, "nested more than 64"),
        (b"\xff\xfe\xff", "text"),
    ],
)
def test_json_that_cannot_be_used_is_one_sentence(text, said) -> None:
    with pytest.raises(TextError, match=said) as caught:
        parse_json(text)
    assert len(str(caught.value)) < 100
    assert "\n" not in str(caught.value)


def test_as_deep_as_is_allowed_is_read() -> None:
    assert parse_json("[" * DEEPEST + "]" * DEEPEST)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_text_is_read_as_editors_and_powershell_write_it(tmp_path, encoding) -> None:
    (path := tmp_path / "a.json").write_bytes('{"name": "Höhe"}\r\n'.encode(encoding))
    assert read_json(path) == {"name": "Höhe"}


@pytest.mark.parametrize(
    ("data", "said"),
    [(b"caf\xe9", "is not a text file"), (b"a\0b", "is not a text file"), (b"\xff\xfea", "is not a text file")],
)
def test_bytes_that_are_no_text_are_one_sentence_that_names_the_file(tmp_path, data, said) -> None:
    (path := tmp_path / "a.txt").write_bytes(data)
    with pytest.raises(TextError, match=said) as caught:
        read_text(path)
    assert str(path) in str(caught.value)


def test_bytes_that_are_no_text_may_be_replaced(tmp_path) -> None:
    assert decoded(b"a\xffb", tmp_path, "replace") == "a\ufffdb"


def test_what_is_not_there_is_one_sentence_for_every_kind_of_caller(tmp_path) -> None:
    for kind in (UsageError, ValueError):
        with pytest.raises(kind, match=r"none\.txt cannot be read: No such file"):
            read_text(tmp_path / "none.txt")
    with pytest.raises(TextError, match="cannot be read"):
        read_text(tmp_path)
    with pytest.raises(TextError, match="cannot be read"):
        read_text("a\0b")


def test_a_damaged_file_is_told_with_the_place(tmp_path) -> None:
    (path := tmp_path / "a.json").write_text('{"a": 1,\n}')
    # From 3.13 on Python means the comma, not what comes after it.
    with pytest.raises(TextError, match=r"a\.json is damaged: No JSON in line (2, column 1|1, column 8)\.$"):
        read_json(path)


def test_a_file_beyond_the_largest_is_not_read(tmp_path) -> None:
    (path := tmp_path / "a.txt").write_bytes(b"12345")
    assert read_bytes(path, 5) == b"12345"
    with pytest.raises(TextError, match="too large"):
        read_bytes(path, 4)


@pytest.mark.skipif(sys.platform != "linux", reason="needs /dev/zero and pipes that have names")
def test_a_device_that_never_ends_and_a_pipe_are_bounded_too() -> None:
    with pytest.raises(TextError, match="too large: more than 1 MB"):
        read_bytes("/dev/zero", 1_000_000)
    read, write = os.pipe()
    os.write(write, b"1,2\n")
    os.close(write)
    assert read_text(f"/dev/fd/{read}") == "1,2\n"
    os.close(read)


# -- And no other ---------------------------------------------------------------------------------

OWN = {  # what the package itself brought, and what servers say (bounded by their links)
    "core/registry.py", "parsing/text_input.py", "sky/planet_moons.py", "sky/sky_tables.py", "sky/names.py",
    "sky/landmarks.py", "window/shell/help_book.py", "window/shell/welcome.py", "window/live/sky_points.py",
    "gear/journal.py", "gear/cameras/uvc.py", "gear/cameras/alpaca.py", "gear/servers/alpaca_link.py", "cli/live.py",
}  # fmt: skip


def test_nothing_else_reads_text() -> None:
    """Text of others has to be bounded, decoded and checked: ``parsing.text_input`` does. What we ship needs none of it."""
    top = Path(kochab.__file__).parent
    found = set()
    for path in top.rglob("*.py"):
        name, text = path.relative_to(top).as_posix(), path.read_text("utf-8")
        if name not in OWN and not name.startswith("lab/") and ("read_text" in text or "loads" in text):
            for node in ast.walk(parsed(text)):
                if isinstance(node, ast.Attribute) and node.attr in ("read_text", "loads"):
                    whose = ast.unparse(node.value)
                    if whose != "pickle" and "shipped_folder()" not in whose and "data_folder(" not in whose:
                        found.add(f"{name}: {whose}.{node.attr}")
    assert found == set()
