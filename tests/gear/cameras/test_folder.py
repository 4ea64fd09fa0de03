"""A folder as a camera: another process writes into it, slowly, badly, and takes it away."""

import os
import shutil
import subprocess
import sys
import time
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from kochab.core.errors import DeviceError, LineLostError, PortError
from kochab.gear.cameras import list_devices, open_camera

WRITER = """
import sys, time
source, target, pieces, pause = sys.argv[1], sys.argv[2], int(sys.argv[3]), float(sys.argv[4])
data = open(source, "rb").read()
step = len(data) // pieces + 1
with open(target, "wb") as out:
    for k in range(0, len(data), step):
        out.write(data[k:k + step])
        out.flush()
        time.sleep(pause)
"""


def write_fits(path, value, header=()):
    from astropy.io import fits

    hdu = fits.PrimaryHDU(np.full((40, 60), value, np.uint16))
    hdu.header.update(dict(header))
    hdu.writeto(path, overwrite=True)
    return path


@pytest.fixture
def folder(tmp_path):
    path = tmp_path / "pictures"
    path.mkdir()
    return path


def slowly(source, target, pieces, pause):
    return subprocess.Popen([sys.executable, "-c", WRITER, source, target, str(pieces), str(pause)])


# Pauses longer than a file is waited for to settle: only its content tells it is not finished.
@pytest.mark.parametrize(("pieces", "pause"), [(12, 0.06), (3, 0.6)])
@pytest.mark.parametrize("suffix", [".fits", ".png"])
def test_a_file_that_another_process_writes_slowly(tmp_path, folder, pieces, pause, suffix) -> None:
    from PIL import Image

    pixels = np.random.default_rng(1).integers(0, 60000, (200, 300)).astype(np.uint16)
    source = tmp_path / f"source{suffix}"
    if suffix == ".png":
        Image.fromarray(pixels).save(source)
    else:
        from astropy.io import fits

        fits.PrimaryHDU(pixels).writeto(source)
    camera = open_camera("folder", str(folder))
    assert camera.next_frame(0.0) is None
    writer = slowly(source, folder / f"slow{suffix}", pieces, pause)
    try:
        frame = None
        deadline = time.monotonic() + 90.0
        while frame is None and time.monotonic() < deadline:
            frame = camera.next_frame(0.2)
    finally:
        writer.wait(30)
    assert frame is not None
    assert np.array_equal(frame.pixels, pixels)
    assert camera.complaints() == ()
    assert camera.next_frame(0.5) is None


def test_the_newest_of_many_wins(folder) -> None:
    for k in range(5):
        os.utime(write_fits(folder / f"{k}.fits", 100 + k), (1000 + k, 1000 + k))
    camera = open_camera("folder", str(folder))
    assert camera.next_frame(5.0).pixels[0, 0] == 104
    assert camera.next_frame(0.5) is None
    (folder / "night").mkdir()
    write_fits(folder / "night" / "light.fits", 7)
    assert camera.next_frame(5.0).pixels[0, 0] == 7


def test_one_picture_written_over_and_over(folder) -> None:
    camera = open_camera("folder", str(folder))
    for k in range(3):
        write_fits(folder / "latest.fits", k)
        assert camera.next_frame(5.0).pixels[0, 0] == k


def test_other_files_and_hidden_ones_are_no_pictures(folder) -> None:
    (folder / "notes.txt").write_text("clouds at two")
    write_fits(folder / ".hidden.fits", 1)
    write_fits(folder / "half.fits", 1).rename(folder / "half.fits.part")
    assert open_camera("folder", str(folder)).next_frame(0.6) is None


def test_a_broken_file_is_a_sentence_and_the_next_one_comes(folder, monkeypatch) -> None:
    monkeypatch.setattr("kochab.gear.cameras.folder.PATIENCE_S", 0.8)
    camera = open_camera("folder", str(folder))
    (folder / "broken.fits").write_bytes(b"SIMPLE  =" + b" " * 100)
    said, deadline = (), time.monotonic() + 90.0
    while not said and time.monotonic() < deadline:
        assert camera.next_frame(0.2) is None
        said = camera.complaints()
    assert len(said) == 1
    assert "broken.fits" in said[0]
    assert camera.complaints() == ()
    write_fits(folder / "good.fits", 3)
    assert camera.next_frame(5.0).pixels[0, 0] == 3


def test_a_file_without_a_date_was_taken_when_it_was_written(folder) -> None:
    write_fits(folder / "old.fits", 1)
    camera = open_camera("folder", str(folder))
    assert camera.next_frame(5.0).hint.time_utc is None  # it lay there already: nobody knows
    before = datetime.now(UTC)
    write_fits(folder / "new.fits", 2, {"EXPTIME": 4.0})
    shutter = camera.next_frame(5.0).hint.time_utc
    assert before - timedelta(seconds=3) <= shutter <= datetime.now(UTC) - timedelta(seconds=2)
    write_fits(folder / "dated.fits", 2, {"DATE-OBS": "2024-01-02T03:04:05", "EXPTIME": 4.0})
    dated = camera.next_frame(5.0).hint.time_utc
    assert dated == datetime(2024, 1, 2, 3, 4, 7, tzinfo=UTC)


def test_a_folder_that_goes_is_a_lost_line(folder) -> None:
    camera = open_camera("folder", str(folder))
    assert camera.next_frame(0.0) is None
    shutil.rmtree(folder)
    with pytest.raises(LineLostError, match=r"Lost the folder .*drive or network share"):
        camera.next_frame(5.0)
    camera.close()


def test_another_folder_in_its_place_is_a_lost_line(folder) -> None:
    camera = open_camera("folder", str(folder))
    folder.rename(folder.with_name("away"))
    folder.mkdir()
    with pytest.raises(LineLostError, match="was replaced"):
        camera.next_frame(5.0)


def test_what_cannot_be_watched_is_said(tmp_path) -> None:
    file = tmp_path / "a.fits"
    file.touch()
    for address, said in (("", "Choose the folder"), (tmp_path / "no", "does not exist"), (file, "is a file")):
        with pytest.raises(PortError, match=said) as caught:
            open_camera("folder", str(address))
        assert "\n" not in str(caught.value)
    assert isinstance(caught.value, DeviceError)
    assert list_devices("folder", str(tmp_path / "no")) == []
    assert [d.address for d in list_devices("folder", str(tmp_path))] == [str(tmp_path)]
