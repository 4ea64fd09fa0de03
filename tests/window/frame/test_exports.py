import json

import pytest
from astropy.io import fits
from PySide6.QtCore import QEventLoop, QSettings
from PySide6.QtWidgets import QMessageBox

from kochab.sky.layer import AMOUNTS
from kochab.window.application import build
from kochab.window.settings import WindowSettings
from kochab.window.themes import HUES
from kochab.workflows.annotated_image import INKS
from tests.window.fakes import FakeEngine, close_windows, no_solution


@pytest.fixture(scope="module")
def commands(qapp, tmp_path_factory):
    """One solved frame for all tests: an export changes nothing in the window, and each window takes 0.25 s to open."""
    folder = tmp_path_factory.mktemp("exports")
    path = folder / "orion.fits"
    path.write_bytes(b"not read by the fake engine")
    settings = WindowSettings(QSettings(str(folder / "window.ini"), QSettings.Format.IniFormat))
    _, commands = build(FakeEngine(), settings, [])
    loop = QEventLoop()
    commands.session.idle.connect(loop.quit)
    commands.files.open(path)
    loop.exec()
    assert commands.session.jobs.join(60.0)  # another window that closes meanwhile counts the threads of all
    yield commands
    close_windows(commands)


def write(qtbot, commands, name, path):
    exporter = commands.exporter
    with qtbot.waitSignal(exporter.wrote, timeout=20_000):
        exporter.write(exporter.kinds[name], path)
    return path


def sentence(qtbot, commands):
    """The box that is open."""
    boxes = commands.window.findChildren
    qtbot.waitUntil(lambda: any(box.isVisible() for box in boxes(QMessageBox)), timeout=5000)
    (box,) = (box for box in boxes(QMessageBox) if box.isVisible())
    return box


def test_stars_as_csv(qtbot, commands, tmp_path):
    lines = write(qtbot, commands, "csv", tmp_path / "a.csv").read_text("utf-8").splitlines()
    assert lines[0].startswith("x,y,id,name")
    assert len(lines) == 1 + 24
    assert any("Betelgeuse" in line for line in lines)


def test_json_is_that_of_the_command_line(qtbot, commands, tmp_path):
    told = json.loads(write(qtbot, commands, "json", tmp_path / "a.json").read_text("utf-8"))
    assert told["solved"] is True
    assert told["ra_deg"] == pytest.approx(84.05, abs=1e-6)
    assert len(told["stars"]) == 24


def test_ds9_and_wcs(qtbot, commands, tmp_path):
    assert "circle(" in write(qtbot, commands, "regions", tmp_path / "a.reg").read_text("utf-8")
    header = fits.Header.fromtextfile(write(qtbot, commands, "wcs", tmp_path / "a.wcs"))
    assert header["CRVAL1"] == pytest.approx(84.05, abs=0.01)


def test_a_script_for_stellarium_has_its_picture_beside_it_and_writes_over_no_other(qtbot, commands, tmp_path):
    script = write(qtbot, commands, "stellarium", tmp_path / "a.ssc").read_text("utf-8")
    assert 'core.loadSkyImage("a.png", "a.png", ' in script
    assert (tmp_path / "a.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    write(qtbot, commands, "stellarium", tmp_path / "a.ssc")  # the dialog has asked
    (tmp_path / "b.png").write_bytes(b"somebody's")
    commands.exporter.write(commands.exporter.kinds["stellarium"], tmp_path / "b.ssc")
    box = sentence(qtbot, commands)
    assert box.text() == "b.png already exists. Choose another name for the script."
    box.close()
    assert (tmp_path / "b.png").read_bytes() == b"somebody's"
    assert not (tmp_path / "b.ssc").exists()


def test_the_annotated_picture_is_a_png(qtbot, commands, tmp_path):
    path = write(qtbot, commands, "picture", tmp_path / "a.png")
    assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_the_annotated_picture_is_what_is_seen(qtbot, commands, tmp_path):
    for name, on in (("detected", True), ("grid", False)):
        if commands.actions[name].isChecked() != on:
            commands.actions[name].trigger()
    commands.looks.use_layers((AMOUNTS | {"figures": 1.0}, {"detected": HUES["Green"]}))
    drawn = write(qtbot, commands, "picture", tmp_path / "a.svg").read_text("utf-8")
    assert drawn.count(f'stroke="{HUES["Green"]}"') == 12 + 24  # those identified have no circle of their own here
    assert INKS["grid"] not in drawn
    assert f'stroke="{INKS["figure"]}" stroke-opacity="1.00"' in drawn
    commands.actions["identified"].trigger()
    drawn = write(qtbot, commands, "picture", tmp_path / "b.svg").read_text("utf-8")
    assert drawn.count(f'stroke="{HUES["Green"]}"') == 12
    commands.actions["identified"].trigger()


def test_a_place_that_cannot_be_written_is_one_sentence(qtbot, commands, tmp_path):
    commands.exporter.write(commands.exporter.kinds["csv"], tmp_path / "nowhere" / "a.csv")
    box = sentence(qtbot, commands)
    assert box.text() == "Can't write a.csv: No such file or directory."
    box.close()


def test_the_open_frame_is_never_written_over(qtbot, commands, tmp_path):
    source = commands.session.known.path
    before = source.read_bytes()
    commands.exporter.write(commands.exporter.kinds["picture"], source)
    box = sentence(qtbot, commands)
    assert "never overwritten" in box.text()
    assert source.read_bytes() == before
    box.close()


def test_the_menu_asks_for_a_name_beside_the_frame(qtbot, commands, tmp_path, monkeypatch):
    asked = []

    def ask(_parent, start, _kinds):
        asked.append(start)
        return tmp_path / "chosen.reg"

    monkeypatch.setattr("kochab.window.frame.exports.ask_save", ask)
    menu = {a.objectName(): a for a in commands.window.menus.export.actions()}
    with qtbot.waitSignal(commands.exporter.wrote, timeout=60_000):
        menu["export_regions"].trigger()
    assert asked == [commands.session.known.path.with_suffix(".reg")]
    assert (tmp_path / "chosen.reg").exists()


def test_nothing_is_exported_without_a_solution(qtbot, make_window, a_file, tmp_path):
    window, commands = make_window(FakeEngine(result=no_solution()))
    assert not window.menus.export.isEnabled()
    with qtbot.waitSignal(commands.session.idle, timeout=60_000):
        commands.files.open(a_file)
    assert not window.menus.export.isEnabled()
    commands.exporter.write(commands.exporter.kinds["csv"], tmp_path / "a.csv")
    assert not (tmp_path / "a.csv").exists()
