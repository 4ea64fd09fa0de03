"""Parts of a large array done in threads: the same outcome as one after another."""

import os
import threading

import numpy as np
import pytest
from astropy.io import fits

from kochab.core import threads
from kochab.core.errors import FrameError
from kochab.core.threads import in_threads, keep_to_one, thread_count
from kochab.detection.background import Halving, measure_mesh
from kochab.detection.peaks import LARGE_PX, find_peaks
from kochab.frames import fits as frames_fits
from kochab.frames import read_frame


@pytest.fixture
def several(monkeypatch):
    monkeypatch.setattr(threads, "thread_count", lambda: 3)


def test_outcomes_come_in_the_order_of_the_parts(several):
    order = threading.Barrier(2, timeout=10)

    def work(number, letter):
        if number < 2:
            order.wait()  # two at least run at the same time
        return f"{number}{letter}"

    assert in_threads(work, range(4), "abcd") == ["0a", "1b", "2c", "3d"]


def test_a_fault_in_a_thread_is_raised_where_the_work_was_asked_for(several):
    def fails(part):
        raise ValueError(part)

    with pytest.raises(ValueError, match="7"):
        in_threads(fails, [7])


def test_a_process_among_several_uses_no_threads(monkeypatch):
    monkeypatch.setattr(threads, "_most", threads.MOST)
    keep_to_one()
    assert thread_count() == 1
    assert in_threads(lambda _: threading.current_thread(), [0]) == [threading.current_thread()]


def test_a_large_frame_has_the_same_peaks_with_threads_and_without(monkeypatch):
    shape = 2000, LARGE_PX // 2000 + 100
    pixels = np.random.default_rng(5).normal(1000, 20, shape).astype(np.uint16)
    pixels[100::200, 50::100] += 900
    how = Halving()
    mesh = measure_mesh(pixels, how)
    found = []
    for count in (1, 3):
        monkeypatch.setattr(threads, "thread_count", lambda count=count: count)
        found.append(find_peaks(pixels, how, mesh, 5.0, 5000))
    assert len(found[0]) > 150
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize("places", [True, False])
@pytest.mark.parametrize("kind", [np.uint16, np.int16, np.float32])
def test_a_large_file_is_read_the_same_and_a_short_one_refused(tmp_path, several, monkeypatch, kind, places):
    monkeypatch.setattr(frames_fits, "thread_count", lambda: 3)
    if not places:  # as on Windows
        monkeypatch.delattr(os, "preadv", raising=False)
    pixels = np.random.default_rng(6).integers(0, 32768, (2100, 2100)).astype(kind)
    path = tmp_path / "large.fits"
    fits.PrimaryHDU(pixels).writeto(path)
    np.testing.assert_array_equal(read_frame(path).pixels, pixels)
    whole = path.read_bytes()
    for share in (10, 50, 90):
        path.write_bytes(whole[: 2880 + pixels.nbytes * share // 100 + 1])
        with pytest.raises(FrameError, match=f"cut short: {share} %"):
            read_frame(path)
