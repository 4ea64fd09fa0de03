"""``kochab detect`` on files."""

import json

import numpy as np
import pytest
from PIL import Image

from kochab.cli.main import main

from .fields import field


@pytest.fixture
def run(capsys):
    def call(*words):
        code = main(["detect", *map(str, words)])
        out = capsys.readouterr()
        return code, out.out, out.err

    return call


@pytest.fixture(scope="module")
def picture(tmp_path_factory):
    frame, xy, _ = field()
    path = tmp_path_factory.mktemp("detect") / "stars.png"
    Image.fromarray(np.clip((frame.pixels - 400.0) / 4, 0, 255).astype(np.uint8)).save(path)
    return path, xy


def test_json_lists_the_stars_brightest_first(run, picture):
    path, xy = picture
    code, out, _ = run(path, "--json")
    data = json.loads(out)
    assert code == 0
    assert (data["width"], data["height"]) == (640, 480)
    assert data["detections"] == len(data["stars"]) >= 0.9 * len(xy)
    assert set(data["stars"][0]) == {
        "x",
        "y",
        "flux",
        "snr",
        "fwhm_px",
        "elongation",
        "angle_deg",
        "saturated",
        "blended",
    }
    flux = [star["flux"] for star in data["stars"]]
    assert flux == sorted(flux, reverse=True)
    assert {"read", "detect"} <= set(data["elapsed_ms"])


def test_text_has_a_line_a_star(run, picture):
    path, _ = picture
    code, out, _ = run(path)
    lines = out.splitlines()
    assert code == 0
    assert lines[0].startswith(f"{len(lines) - 2} stars in 640 x 480")


@pytest.mark.parametrize("content", [b"", b"not a picture of the sky", None])
def test_what_cannot_be_read_is_one_sentence(run, tmp_path, content):
    path = tmp_path / "bad.png"
    if content is not None:
        path.write_bytes(content)
    code, out, err = run(path)
    assert code == 2
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    assert err.startswith("kochab: ")
    code, out, _ = run(path, "--json")
    assert code == 2
    assert json.loads(out)["error"]
