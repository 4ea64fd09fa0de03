import json

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QImage

from kochab.folders import data_folder
from kochab.window.image.thumbnails import HEIGHT, WIDTH, as_pixmap, thumbnail
from kochab.window.shell.welcome import Sample, samples


def test_samples_come_in_the_order_they_are_told_in(tmp_path):
    for name in ("a.png", "b.fits", "c.jpg", "notes.txt"):
        (tmp_path / name).touch()
    told = {"c.jpg": {"title": "The Cross", "text": "Wide."}, "a.png": {"title": "An A"}}
    (tmp_path / "samples.json").write_text(json.dumps(told), encoding="utf-8")
    found = samples(tmp_path)
    assert [s.path.name for s in found] == ["c.jpg", "a.png", "b.fits"]
    assert found[0] == Sample(tmp_path / "c.jpg", "The Cross", "Wide.")
    assert found[2].title == "B"


@pytest.mark.parametrize("text", ["", "[1, 2]", "{not json"])
def test_a_damaged_list_of_samples_only_loses_their_titles(tmp_path, text):
    (tmp_path / "orion-belt.png").touch()
    (tmp_path / "samples.json").write_text(text, encoding="utf-8")
    assert [s.title for s in samples(tmp_path)] == ["Orion belt"]


def test_no_folder_is_no_samples(tmp_path):
    assert samples(tmp_path / "none") == []


def test_the_shipped_samples_have_titles_and_texts():
    shipped = samples()
    assert len(shipped) >= 3
    assert all(s.title and s.text for s in shipped)


def test_the_first_sample_is_a_small_real_photograph_with_its_credit_and_licence():
    first = samples()[0]
    assert "GranaSAT" in first.text
    assert "MIT" in first.text
    assert first.path.stat().st_size < 400_000
    provenance = (data_folder("resources") / "README.md").read_text("utf-8")
    assert f"samples/{first.path.name}" in provenance
    assert "copyright (c) 2020 Iris García" in provenance


def test_thumbnails_show_stars_on_a_dark_sky():
    for sample in samples():
        picture = thumbnail(sample.path)
        assert picture.shape == (2 * HEIGHT, 2 * WIDTH, 3)
        assert picture.max() > 150
        assert np.median(picture) < 110


def test_a_file_that_cannot_be_read_has_a_black_thumbnail(tmp_path):
    assert thumbnail(tmp_path / "missing.png").max() == 0


def test_a_thumbnail_in_red_light_is_red(qtbot):
    picture = np.full((2 * HEIGHT, 2 * WIDTH, 3), 200, dtype=np.uint8)
    image = as_pixmap(picture, red=True).toImage()
    image = image.convertToFormat(QImage.Format.Format_RGB32)
    colour = image.pixelColor(image.width() // 2, image.height() // 2)
    assert (colour.red() > 150, colour.green(), colour.blue()) == (True, 0, 0)


def test_pictures_arrive_on_their_buttons(qtbot, make_window, engine):
    shipped = samples()[:2]
    window, commands = make_window(engine, shipped)
    assert window.welcome.samples[0].icon().isNull()
    commands.window.welcome.load_pictures(commands.session.jobs, lambda: commands.looks.is_night)
    qtbot.waitUntil(lambda: not window.welcome.samples[1].icon().isNull(), timeout=10_000)


def test_a_recent_file_opens_from_the_page(qtbot, make_window, engine, a_file, settings):
    settings.add_recent(a_file)
    window, commands = make_window(engine)
    (link,) = [window.welcome._recent.itemAt(i).widget() for i in range(window.welcome._recent.count())]
    assert link.text() == "orion.fits"
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        qtbot.mouseClick(link, Qt.MouseButton.LeftButton)
    assert commands.session.known.path == a_file


def test_a_recent_file_that_cannot_be_looked_at_is_not_offered(make_window, engine, a_file, settings):
    settings.add_recent(a_file)
    # A name too long for any disk: like a network drive that is off, it makes Path.exists raise.
    settings.add_recent(a_file.with_name("x" * 300))
    window, _ = make_window(engine)
    assert window.welcome.recent == [a_file]
