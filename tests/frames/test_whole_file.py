"""Files are written whole, or stay as they were."""

import errno
import sys
from pathlib import Path

import pytest

from kochab.frames.atomic_file import atomic_file, write_atomically


def fills_the_disk(self, data):
    with open(self, "wb") as file:
        file.write(data[: len(data) // 2])
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("before", [None, "as it was"])
def test_a_full_disk_leaves_what_was_there(tmp_path, monkeypatch, before) -> None:
    path = tmp_path / "a.wcs"
    if before is not None:
        path.write_text(before)
    monkeypatch.setattr(Path, "write_bytes", fills_the_disk)
    with pytest.raises(OSError, match="No space"):
        write_atomically(path, "new and longer")
    assert [p.read_text() for p in tmp_path.iterdir()] == ([] if before is None else [before])


def test_what_goes_wrong_while_it_is_written_leaves_what_was_there(tmp_path) -> None:
    path = tmp_path / "a.png"
    path.write_text("as it was")

    def half_of_it() -> None:
        with atomic_file(path) as part:
            part.write_text("half")
            raise ValueError("the writer has had enough")

    with pytest.raises(ValueError, match="enough"):
        half_of_it()
    assert [p.read_text() for p in tmp_path.iterdir()] == ["as it was"]


@pytest.mark.skipif(sys.platform == "win32", reason="it has no /dev/null")
def test_what_is_no_file_is_written_into() -> None:
    with atomic_file("/dev/null") as part:
        assert part == Path("/dev/null")
    assert not Path("/dev/null").is_file()


@pytest.mark.parametrize(("content", "read"), [("α\n", "α\n".encode()), (b"\0\r\n", b"\0\r\n")])
def test_what_is_written_is_read(tmp_path, content, read) -> None:
    # As long as a name may be: nothing can be put to its end. Windows counts the folders too.
    path = tmp_path / ("a" * (250 if sys.platform != "win32" else 255 - len(str(tmp_path))))
    for _ in range(2):
        write_atomically(path, content)
    assert path.read_bytes() == read
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_a_link_stays_one(tmp_path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "there")
    write_atomically(tmp_path / "link", "x")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "there").read_text() == "x"


def test_an_absent_folder_is_an_os_error(tmp_path) -> None:
    with pytest.raises(FileNotFoundError):
        write_atomically(tmp_path / "none" / "a", "x")
