"""SER and AVI: each frame's pixels and time, whoever wrote it, and what is said of videos that hold less than they claim."""

import json
import struct
import sys
from datetime import UTC, datetime

import numpy as np
import pytest
from PIL import Image

from kochab.cli.main import main
from kochab.core.errors import FrameError
from kochab.frames import read_frame
from tests.frames.files import avi as written
from tests.frames.files import colours, ser, sky

FRAMES = [sky(seed=seed) for seed in (1, 2, 3)]
COLOURS = [colours(), colours()[::-1], colours()[:, ::-1]]


def refused(path, number=None):
    with pytest.raises(FrameError) as caught:
        read_frame(path, number=number)
    return str(caught.value)


@pytest.mark.parametrize("flag", [0, 1])
@pytest.mark.parametrize("order", ["<", ">"])
def test_16_bits_are_read_in_either_order_whatever_the_flag_says(tmp_path, flag, order):
    path = ser(tmp_path / "a.ser", FRAMES, flag=flag, order=order)
    for number in (1, 2, 3):
        np.testing.assert_array_equal(read_frame(path, number=number).pixels, FRAMES[number - 1])


def test_a_frame_has_its_own_time_in_the_trailer_else_that_of_the_header(tmp_path):
    timed = ser(tmp_path / "a.ser", FRAMES, seconds=(1.6e9, 1.6e9 + 1.5, 1.6e9 + 3.0))
    assert read_frame(timed, number=2).hint.time_utc == datetime.fromtimestamp(1.6e9 + 1.5, UTC)
    plain = read_frame(ser(tmp_path / "b.ser", FRAMES))
    assert plain.hint.time_utc == datetime.fromtimestamp(1.7e9, UTC)
    assert plain.hint.camera == "ZWO ASI290MM"
    assert any("3" in warning for warning in plain.warnings), "two frames are not read"


@pytest.mark.parametrize(("colour", "pattern"), [(0, None), (8, "RGGB"), (9, "GRBG"), (10, "GBRG"), (11, "BGGR")])
def test_a_mosaic_has_its_pattern(tmp_path, colour, pattern):
    assert read_frame(ser(tmp_path / "a.ser", FRAMES, colour=colour)).bayer == pattern


@pytest.mark.parametrize(("colour", "turned"), [(100, 1), (101, -1)])
def test_three_planes_are_red_green_and_blue(tmp_path, colour, turned):
    frame = read_frame(ser(tmp_path / "a.ser", [c[..., ::turned] for c in COLOURS], 8, colour))
    np.testing.assert_array_equal(frame.colour, COLOURS[0])


@pytest.mark.parametrize(("shift", "saturation"), [(0, 4095.0), (4, 65535.0)])
def test_12_bits_clip_where_they_are_stored(tmp_path, shift, saturation):
    frame = read_frame(ser(tmp_path / "a.ser", [(FRAMES[0] // 16) << shift], depth=12))
    assert frame.saturation == saturation


@pytest.mark.parametrize("missing", [1, 6143])
def test_a_recording_that_was_cut_off_has_the_frames_before(tmp_path, missing):
    path = ser(tmp_path / "a.ser", FRAMES)
    path.write_bytes(path.read_bytes()[:-missing])
    np.testing.assert_array_equal(read_frame(path, number=2).pixels, FRAMES[1])
    assert "has 2 frames, not a frame 3" in refused(path, 3)


@pytest.mark.parametrize(("at", "value"), [(18, 7), (26, -1), (26, 2**31 - 1), (30, 0), (34, 0), (34, 99), (38, -5)])
def test_a_header_that_no_camera_writes_is_one_sentence(tmp_path, at, value):
    path = ser(tmp_path / "a.ser", FRAMES)
    data = bytearray(path.read_bytes())
    struct.pack_into("<i", data, at, value)
    path.write_bytes(data)
    assert refused(path).startswith("a.ser ")


@pytest.mark.parametrize(
    ("stored", "frames", "error"),
    [
        ("gray", [(f >> 8).astype(np.uint8) for f in FRAMES], 0),
        ("yuyv422", [(f >> 8).astype(np.uint8) for f in FRAMES], 1),
        ("uyvy422", [(f >> 8).astype(np.uint8) for f in FRAMES], 1),
        ("yuv420p", [(f >> 8).astype(np.uint8) for f in FRAMES], 1),
    ],
)
@pytest.mark.parametrize("width", [64, 62])
def test_uncompressed_grey_as_ffmpeg_writes_it(tmp_path, stored, frames, error, width):
    frames = [np.ascontiguousarray(f[:, :width]) for f in frames]
    path = written(tmp_path / "a.avi", frames, stored=stored)
    for number, frame in enumerate(frames, 1):
        seen = read_frame(path, number=number)
        if error:  # video's brightness runs from 16 to 235
            assert seen.saturation == 235.0
            frame = 16.0 + frame * (219.0 / 255.0)
        np.testing.assert_allclose(seen.pixels, frame, atol=error)


@pytest.mark.parametrize("stored", ["bgr24", "bgra"])
@pytest.mark.parametrize("width", [64, 61])
def test_uncompressed_colour_stands_upright(tmp_path, stored, width):
    frames = [np.ascontiguousarray(c[:, :width]) for c in COLOURS]
    path = written(tmp_path / "a.avi", frames, stored=stored)
    for number in (1, 2, 3):
        np.testing.assert_array_equal(read_frame(path, number=number).colour, frames[number - 1])


def called(path, codec):
    """The same video under another name of its pixels' format."""
    data = bytearray(path.read_bytes())
    at = data.index(b"strf") + 24
    data[at : at + 4] = codec
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("codec", [b"Y16 ", b"Y1\0\x10"])
def test_16_bits_of_grey(tmp_path, codec):
    path = called(written(tmp_path / "a.avi", FRAMES, stored="gray16le"), codec)
    for number, frame in enumerate(FRAMES, 1):
        np.testing.assert_array_equal(read_frame(path, number=number).pixels, frame)


def test_8_bits_without_a_palette_are_grey_as_capture_programs_write_them(tmp_path):
    values = np.ascontiguousarray(FRAMES[0] >> 8).astype(np.uint8)
    path = called(written(tmp_path / "a.avi", [values], stored="gray"), b"\0\0\0\0")
    np.testing.assert_array_equal(read_frame(path).pixels, values[::-1])  # and their rows run upwards


def test_motion_jpeg(tmp_path):
    smooth = np.broadcast_to(np.arange(48, dtype=np.uint8)[:, None, None] * 4, (48, 64, 3))
    path = written(tmp_path / "a.avi", [np.ascontiguousarray(smooth)] * 2, "mjpeg", "yuvj420p")
    np.testing.assert_allclose(read_frame(path, number=2).pixels / 4.0, smooth[..., 0], atol=4)


def test_another_codec_is_ffmpeg_s_in_the_process_for_decoders(tmp_path):
    path = written(tmp_path / "a.avi", FRAMES, "ffv1", "gray16le")
    for number in (1, 3):
        np.testing.assert_array_equal(read_frame(path, number=number).pixels, FRAMES[number - 1])
    assert "has 3 frames, not a frame 4" in refused(path, 4)


def test_another_codec_without_pyav_says_what_to_do(tmp_path, monkeypatch):
    path = written(tmp_path / "a.avi", FRAMES, "ffv1", "gray16le")
    monkeypatch.setattr("kochab.frames.avi.leave_to_sandbox", lambda: None)
    monkeypatch.setitem(sys.modules, "av", None)
    said = refused(path)
    assert "FFV1" in said
    assert "SER" in said


def test_a_frame_that_is_not_there(tmp_path):
    path = written(tmp_path / "a.avi", COLOURS)
    assert "has 3 frames, not a frame 4" in refused(path, 4)
    Image.fromarray(colours()).save(tmp_path / "a.png")
    assert "is no video" in refused(tmp_path / "a.png", 1)


def test_the_command_line_picks_a_frame(tmp_path, capsys):
    stars = [sky() for _ in range(2)]
    stars[1][20:23, 30:33] = 60000
    path = ser(tmp_path / "a.ser", stars)
    found = []
    for more in ([], ["--frame", "2"]):
        assert main(["detect", str(path), "--json", *more]) == 0
        found.append(json.loads(capsys.readouterr().out)["detections"])
    assert found[0] != found[1]
    assert main(["solve", str(path), "--frame", "9"]) == 2
    assert "not a frame 9" in capsys.readouterr().err
