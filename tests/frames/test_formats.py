"""Which reader a file gets, and the one sentence for what is no picture."""

import os

import numpy as np
import pytest
from PIL import Image

from kochab.cli.main import main
from kochab.cli.solve import frames_in
from kochab.core.errors import FrameError
from kochab.frames import FORMATS, file_pattern, format_names, frames_of, named_as_frame, read_frame, suffixes
from kochab.frames.readers import _plain, kind_of, named_as_fits
from kochab.window.frame.batch import images_in
from kochab.workflows.fresh_frame import image_files
from kochab.workflows.night import folder
from tests.frames.files import colours, faulty_reader, one_of_each, sky


def sentence(path):
    with pytest.raises(FrameError) as caught:
        read_frame(path)
    text = str(caught.value)
    assert "\n" not in text
    assert text.endswith(".")
    assert path.name in text
    return text


def test_every_format_opens_and_keeps_the_promises_of_a_frame(tmp_path):
    paths = one_of_each(tmp_path)
    assert {suffixes()[path.suffix] for path in paths} == set(suffixes().values()), "one of each"
    for path in paths:
        frame = read_frame(path)
        assert frame.pixels.shape == (48, 64), path
        assert frame.pixels.flags.c_contiguous, path
        assert frame.pixels.dtype.isnative, path
        assert frame.path == str(path)
        assert frame.saturation is not None
        assert frame.colour is None or frame.colour.shape == (48, 64, 3)
        assert np.isfinite(frame.pixels).all()


@pytest.mark.parametrize(
    ("reader", "cause"), [("faulty_reader", "KeyError: 'gain'"), ("careless_reader", "returned ndarray")]
)
def test_a_fault_of_another_package_s_reader_is_one_sentence(reader, cause, tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(FORMATS, "_others", {"odd": f"tests.frames.files:{reader}"})
    (path := tmp_path / "night.odd").write_bytes(b"ODD1")
    with caplog.at_level("DEBUG", "kochab"):
        assert cause in (text := sentence(path))
    assert f"tests.frames.files:{reader}" in text
    assert "Traceback" in caplog.text
    assert main(["solve", str(path)]) == 2


def test_a_fault_of_our_own_reader_stays_a_fault(tmp_path, monkeypatch):
    monkeypatch.setattr("kochab.frames.fits.read_fits", faulty_reader)
    (path := tmp_path / "night.fits").write_bytes(b"SIMPLE  =")
    with pytest.raises(KeyError):
        read_frame(path)


@pytest.mark.parametrize(
    ("name", "frame"),
    [
        ("m42.fits", True),
        ("M42.FIT", True),
        ("m42.fits.gz", True),
        ("m42.fits.BZ2", True),
        ("m42.fz", True),
        ("night.ser", True),
        ("stars.csv.gz", False),
        ("m42.gz", False),
        ("m42.fits.gz.gz", False),
        ("._m42.fits", False),
        ("m42", False),
        ("fits", False),
        ("m42.txt", False),
    ],
)
def test_a_file_is_a_frame_by_its_name(name, frame):
    """macOS leaves files that begin with a dot and two letters beside those that it copies."""
    assert named_as_frame(name) is frame
    assert named_as_frame(f"m31.fits/{name}") is frame


def test_everything_that_takes_a_folder_takes_the_same_frames(tmp_path):
    """Compressed frames used to count only in the window, a folder with such a name only on the command line."""
    for name in ("b.fits", "a.png", "c.fits.gz", "stars.csv.gz", "._a.png", "notes.txt"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "d.fits").mkdir()
    frames = [tmp_path / name for name in ("a.png", "b.fits", "c.fits.gz")]
    assert frames_of(tmp_path) == frames
    assert frames_in(str(tmp_path)) == [*map(str, frames)]
    assert folder.frames_in(tmp_path) == frames
    assert images_in([tmp_path]) == frames
    assert sorted(image_files([tmp_path])) == frames


def test_every_reader_can_be_imported():
    import importlib

    for target in FORMATS.values():
        module, name = target.split(":")
        assert callable(getattr(importlib.import_module(module), name))
    assert set(suffixes().values()) == set(FORMATS)


def test_another_package_s_format_is_offered_and_named_like_ours(monkeypatch):
    ours = format_names()
    monkeypatch.setattr(FORMATS, "_others", {"asdf": "tests.frames.files:quick_reader"})
    assert suffixes()[".asdf"] == "asdf"
    assert "*.asdf *.ASDF" in file_pattern()
    assert ours.startswith("FITS, XISF, TIFF, PNG, ")
    assert ours.endswith(" or camera RAW")
    assert format_names() == ours.replace(" or camera RAW", ", asdf or camera RAW")


def test_content_beats_suffix(tmp_path):
    path = tmp_path / "really_a_png.fits"
    Image.fromarray(colours()).save(path, format="PNG")
    assert read_frame(path).colour is not None


@pytest.mark.parametrize(
    ("head", "suffix", "kind"),
    [
        (b"SIMPLE  =  ", ".txt", "FITS"),
        (b"II*\x00\x10\x00\x00\x00CR\x02\x00", ".tif", "raw"),
        (b"II*\x00\x08\x00\x00\x00\x00\x00\x00\x00", ".nef", "raw"),
        (b"MM\x00*\x00\x00\x00\x08\x00\x00\x00\x00", ".TIF", "TIFF"),
        (b"\x00\x00\x00\x18ftypcrx \x00", ".cr3", "raw"),
        (b"\x00\x00\x00\x18ftypheic\x00", ".jpg", "HEIF"),
        (b"FUJIFILMCCD-RAW 0201", ".raf", "raw"),
        (b"IIU\x00\x18\x00", ".rw2", "raw"),
        (b"RIFF\x00\x00\x00\x00WEBPVP8 ", ".webp", "picture"),
        (b"RIFF\x00\x00\x00\x00WAVEfmt ", ".wav", None),
        (b"RIFF\x00\x00\x00\x00AVI LIST", ".wav", "AVI"),
        (b"LUCAM-RECORDER\x00\x00", ".bin", "SER"),
        (b"hello", ".fits", None),
    ],
)
def test_sniffing(head, suffix, kind):
    assert kind_of(head, suffix) == kind


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "empty"),
        (b"a list of things to buy\n" * 10, "not a supported image"),
        (b"\x00" * 5000, "not a supported image"),
        (b"SIMPLE  =", "cut short"),
        (b"BM", "damaged|cut short"),
        (b"\x1f\x8b\x08\x00junk", "unzip"),
        (b"\x89PNG\r\n\x1a\n", "damaged|cut short"),
        (b"II*\x00", "damaged|cut short"),
        (b"XISF0100", "damaged|cut short"),
        (b"LUCAM-RECORDER", "cut short"),
        (b"RIFF\x00\x00\x00\x00AVI LIST", "no image"),
    ],
)
def test_what_is_no_picture_is_said_in_one_sentence(tmp_path, content, said):
    import re

    path = tmp_path / "sky.fits"
    path.write_bytes(content)
    assert re.search(said, sentence(path))


def test_folders_and_absent_files(tmp_path):
    assert "folder" in sentence(tmp_path)
    assert "does not exist" in sentence(tmp_path / "absent.fits")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.fits")
    assert "pipe" in sentence(tmp_path / "a.fits")


def test_a_file_that_may_not_be_read(tmp_path, monkeypatch):
    path = tmp_path / "private.png"
    Image.fromarray(sky()).save(path)

    def refuse(self, *args, **kwargs):  # a test may run as a user who may read every file
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(type(path), "open", refuse)
    assert "permission" in sentence(path)


def test_a_path_that_is_no_path():
    with pytest.raises(FrameError):
        read_frame("bad\0name.fits")


@pytest.mark.parametrize(
    ("name", "fits", "unpacked"),
    [
        ("a.FITS", True, True),
        ("a.fts", True, True),
        ("a.fits.gz", True, False),
        ("a.fz", True, False),
        ("a.png", False, False),
    ],
)
def test_a_name_of_fits_may_be_that_of_a_packed_file(name, fits, unpacked):
    assert (named_as_fits(name), named_as_fits(name, packed=False)) == (fits, unpacked)


@pytest.mark.parametrize(
    ("raised", "said"), [(OSError(28, "No space left"), "No space left"), (KeyError(), "KeyError")]
)
def test_a_librarys_own_words_are_one_short_line(raised, said):
    assert _plain(raised) == said
    assert _plain(ValueError("page of\n\ttext. " * 100)) == ("page of text. " * 100)[:200].rstrip(".")
