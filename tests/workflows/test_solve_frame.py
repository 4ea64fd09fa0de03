"""A file is read and solved, step by step, without a window."""

import numpy as np
import pytest

from kochab.core.errors import FrameError
from kochab.core.frame import Frame
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason
from kochab.workflows.solve_frame import solve_file, solve_open_frame


def test_a_file_that_cannot_be_read_is_one_sentence(tmp_path) -> None:
    path = tmp_path / "broken.fits"
    path.write_bytes(b"not a picture")
    with pytest.raises(FrameError) as caught:
        run(solve_file(path))
    assert "\n" not in str(caught.value)


def test_an_empty_sky_comes_back_with_its_frame_and_reason(tmp_path) -> None:
    from PIL import Image

    path = tmp_path / "dark.png"
    Image.fromarray(np.zeros((60, 80), np.uint8)).save(path)
    stages = []
    solved = run(solve_file(path), lambda p: stages.append(p.stage))
    assert solved.frame.pixels.shape == (60, 80)
    assert len(solved.detections) == 0
    assert isinstance(solved.result, NoSolution)
    assert solved.result.reason is Reason.CLOUDED_OR_DARK
    assert solved.result.elapsed_ms["read"] > 0
    assert stages[:2] == ["read", "detect"]


def test_each_step_can_be_the_last() -> None:
    frame = Frame(np.zeros((60, 80), np.uint8))
    steps = len(list(solve_open_frame(frame)))
    for stop in range(steps):
        task = solve_open_frame(frame)
        for _ in range(stop):
            next(task)
        task.close()
        with pytest.raises(StopIteration):
            next(task)
