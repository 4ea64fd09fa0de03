"""Sheets to print, read by Poppler: paper, text that stays text, and where things are."""

import re
import shutil
import subprocess

import numpy as np
import pytest
from PIL import Image

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.errors import KochabError, UsageError
from kochab.core.frame import Frame
from kochab.core.solution import Solution
from kochab.folders import data_folder
from kochab.frames.pdf import read_font
from kochab.sky.finder import finder
from kochab.workflows.annotated_image import CREDIT
from kochab.workflows.printed_sheet import annotated_sheet, field_for, finder_chart

PAPERS_MM = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}


pytestmark = pytest.mark.skipif(shutil.which("pdftotext") is None, reason="poppler-utils is not installed")


def read(data, tmp_path):
    """Pages, size in points and text, as Poppler reads them; it must have nothing to complain of."""
    (tmp_path / "sheet.pdf").write_bytes(data)
    told = [
        subprocess.run([tool, "sheet.pdf", *more], cwd=tmp_path, capture_output=True, text=True, check=True)
        for tool, *more in (("pdfinfo",), ("pdftotext", "-layout", "-"))
    ]
    assert [one.stderr for one in told] == ["", ""]
    pages, width, height = re.search(r"Pages: +(\d+).*Page size: +([\d.]+) x ([\d.]+)", told[0].stdout, re.S).groups()
    return int(pages), (float(width), float(height)), told[1].stdout


@pytest.mark.parametrize("paper", ["a4", "letter"])
def test_a_finder_chart_has_the_paper_the_card_the_scale_and_the_names_as_text(tmp_path, paper):
    pages, size, text = read(finder_chart(finder().still("M 31"), paper), tmp_path)
    assert pages == 1
    assert (size[0] * 25.4 / 72.0, size[1] * 25.4 / 72.0) == pytest.approx(PAPERS_MM[paper], abs=0.1)
    for word in (
        "M 31 (Andromeda Galaxy)",
        "00h 42m 44",
        "V 3.4",
        "M 110",
        "ν And",
        "ANDROMEDA",
        "2°",
        "Galaxy",
        "N",
        "E",
    ):
        assert word in text, word
    assert CREDIT in text


def test_the_object_is_in_the_middle_of_a_finder_chart_and_its_star_is_black_on_white(tmp_path):
    (tmp_path / "vega.pdf").write_bytes(finder_chart(finder().still("Vega"), "a4", 5.0))
    subprocess.run(["pdftoppm", "-r", "72", "-png", "-singlefile", "vega.pdf", "vega"], cwd=tmp_path, check=True)
    picture = np.asarray(Image.open(tmp_path / "vega.png").convert("L")).astype(int)
    height, width = picture.shape
    middle = (36.0 + 74.0 + height - 36.0 - 46.0) / 2.0, width / 2.0
    y, x = (round(side) for side in middle)
    black = np.argwhere(picture[y - 6 : y + 6, x - 6 : x + 6] < 100)
    assert len(black) > 20
    assert np.abs(black.mean(axis=0) - 5.5).max() < 1.5
    assert np.median(picture) == 255


def test_the_field_suits_the_object_and_is_bounded():
    assert field_for(finder().still("M 57")) == 5.0
    assert field_for(finder().still("M 31")) == pytest.approx(8.9, abs=0.1)
    with pytest.raises(UsageError, match="shows"):
        finder_chart(finder().still("M 57"), "a4", 170.0)


def test_an_annotated_sheet_has_the_frames_facts_and_lies_across(tmp_path):
    focal = 600.0 / np.tan(np.radians(5.0))
    solution = Solution(Camera.centred(1200, 800, float(focal)), attitude_from(84.0, -3.0, 0.0), (), 0.2, -30.0, "")
    frame = Frame(np.full((800, 1200), 30, np.uint8), path="/somewhere/orion <1>.fits")
    _, size, text = read(annotated_sheet(frame, solution, "letter"), tmp_path)
    assert size == pytest.approx((792.0, 612.0))
    for word in ("orion <1>.fits", "05h 36m 00", "10° × 6.6", "Alnitak", "ORION", CREDIT):
        assert word in text, word
    assert text.count("Alnitak") == 1  # its dark edge is no second text


def test_a_damaged_font_is_said(tmp_path):
    (tmp_path / "a.ttf").write_bytes((data_folder("resources") / "DejaVuSans.ttf").read_bytes()[:400])
    with pytest.raises(KochabError, match="no TrueType font"):
        read_font(tmp_path / "a.ttf")
