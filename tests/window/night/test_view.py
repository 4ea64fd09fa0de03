"""Last night in the window: a planted night measured, stopped half-way, shown in every theme and saved."""

import json

import numpy as np
import pytest
from PySide6.QtCore import QUrl
from PySide6.QtGui import QImage

from kochab.core.progress import PREPARING, Progress
from kochab.solver import SolveOptions
from kochab.workflows.night.folder import _as_one, measure_folder
from kochab.workflows.night.page import night_page
from kochab.workflows.night.table import night_csv
from tests.cli.test_night import planted
from tests.window.test_night import assert_all_red, assert_red

FRAMES = 4


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("night") / "crab"
    made.mkdir()
    planted(made, frames=FRAMES)
    (made / "spoilt.fits").write_bytes((made / "light_00.fits").read_bytes()[:4000])
    (made / "notes.txt").write_text("not a frame")
    return made


@pytest.fixture
def view(qtbot, opened):
    commands = opened[1]
    commands.views.show("last_night")
    return commands.views.docks["last_night"].view


def measure(qtbot, view, folder):
    view.folder.setText(str(folder))
    view.start.click()
    qtbot.waitUntil(lambda: view._job is None, timeout=120_000)


def test_a_night_is_measured_shown_and_saved(qtbot, opened, view, folder, tmp_path):
    assert opened[0].pages.currentWidget() is view.room
    assert not view.save.isEnabled()
    measure(qtbot, view, folder)
    text = view.room.toPlainText()
    assert "Night of 2026-01-12" in text
    assert f"crab · {FRAMES} of {FRAMES + 1} frames solved" in text
    assert "Stopped early" not in text
    lines = text.splitlines()
    assert "FWHM" in lines, "a tile has a line for its name, and one for its number"
    assert "±" in lines[lines.index("FWHM") + 1]
    night, earlier = view.night, view._earlier
    for ending, wanted in (("html", night_page(night, "crab", earlier)), ("csv", night_csv(night))):
        view.write(tmp_path / f"x.{ending}")
        qtbot.waitUntil((tmp_path / f"x.{ending}").exists)
        assert (tmp_path / f"x.{ending}").read_bytes().decode() == wanted
    view.write(tmp_path / "x.json")
    qtbot.waitUntil((tmp_path / "x.json").exists)
    assert len(json.loads((tmp_path / "x.json").read_text(encoding="utf-8"))["frames"]) == FRAMES + 1


def test_its_drawings_are_in_the_colours_of_the_theme_and_red_at_night(qtbot, opened, view, folder):
    measure(qtbot, view, folder)
    browser, appearance = view.room, opened[1].appearance

    def drawn():
        qtbot.waitUntil(lambda: appearance.settled and not browser._again.isActive())
        image = browser.loadResource(2, QUrl("drawing0"))
        assert isinstance(image, QImage)
        return image

    dark = drawn()
    appearance.use_theme("light")
    assert drawn().pixelColor(2, 2) != dark.pixelColor(2, 2)
    assert browser.toPlainText().count("Night of 2026-01-12") == 1
    appearance.use_theme("night")
    image = drawn()
    assert_all_red(np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1, 4)[..., :3])
    assert_red(browser)
    appearance.use_theme("dark")


def test_a_night_that_is_stopped_is_shown_as_far_as_it_came(qtbot, view, folder):
    view.folder.setText(str(folder))
    view.start.click()
    qtbot.waitUntil(lambda: len(view._frames) >= 2, timeout=60_000)
    view.stop.click()
    qtbot.waitUntil(lambda: view._job is None, timeout=60_000)
    done = len(view._frames)
    assert 2 <= done <= FRAMES
    assert f"Stopped early: {done} of {FRAMES + 1} frames measured." in view.room.toPlainText()
    assert view.save.isEnabled()


@pytest.mark.parametrize(("name", "words"), [("empty", "is a folder without frames."), ("nowhere", "cannot be read")])
def test_a_folder_without_frames_is_one_sentence(qtbot, view, tmp_path, name, words):
    (tmp_path / "empty").mkdir()
    measure(qtbot, view, tmp_path / name)
    assert words in view.status.text()
    assert view.night is None
    assert view.start.isEnabled()


def test_half_a_minute_for_an_index_is_told_and_a_frame_keeps_its_place():
    def one_frame():
        yield Progress("detect", None, "stars")
        yield Progress(PREPARING, 0.4, "quads")
        return "measured"

    steps = list(_as_one(one_frame(), Progress("night", 0.5, "Frame 2 of 4")))
    assert [step.fraction for step in steps] == [0.5, 0.5]
    assert [step.detail for step in steps] == ["Frame 2 of 4", "Building the small-field index: 40 %"]


def test_a_frame_that_cannot_be_read_ends_no_night(folder):
    frames = []
    shares = [step.fraction for step in measure_folder(folder, SolveOptions(), None, frames)]
    assert len(frames) == FRAMES + 1
    assert [frame.file for frame in frames if frame.error] == [str(folder / "spoilt.fits")]
    assert shares == sorted(shares)
    assert set(shares) == {k / (FRAMES + 1) for k in range(FRAMES + 1)}
