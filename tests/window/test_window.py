"""What a person does with the window, start to end."""

import logging
import re
import threading
import zipfile
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from astropy.coordinates import AltAz, EarthLocation, SkyCoord
from astropy.units import deg
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDropEvent, QGuiApplication
from PySide6.QtWidgets import QMessageBox

from kochab.core.frame import Hint, Site
from kochab.core.solution import NoSolution, Solution
from tests.window.fakes import FakeEngine, no_solution, star_field


def test_it_starts_on_the_welcome_page_and_offers_samples(make_window, engine):
    window, commands = make_window(engine)
    assert window.pages.currentWidget() is window.welcome
    assert [b.accessibleName() for b in window.welcome.samples] == ["A sample"]
    assert not commands.actions["solve"].isEnabled()
    assert not commands.actions["cancel"].isEnabled()


def test_a_key_of_a_sample_opens_it(qtbot, make_window, engine, tmp_path):
    (tmp_path / "sample.fits").touch()
    window, commands = make_window(engine)
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        qtbot.keyClick(window, Qt.Key.Key_1, Qt.KeyboardModifier.AltModifier)
    assert window.pages.currentWidget() is window.workspace
    qtbot.keyClick(window, Qt.Key.Key_2, Qt.KeyboardModifier.AltModifier)
    assert window.workspace.tabs.currentWidget() is window.workspace.stars


def test_the_first_click_on_a_sample_solves_it(qtbot, make_window, engine, tmp_path):
    (tmp_path / "sample.fits").touch()
    window, commands = make_window(engine)
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        qtbot.mouseClick(window.welcome.samples[0], Qt.MouseButton.LeftButton)
    assert isinstance(commands.session.known.result, Solution)
    assert window.pages.currentWidget() is window.workspace


def test_opening_shows_solves_and_marks(qtbot, opened):
    window, commands = opened
    panes = window.workspace
    assert panes.view.picture is not None
    qtbot.waitUntil(lambda: panes.card.title.text() == "Orion's Belt in Orion")
    assert panes.card.accessibleName() == "Orion's Belt in Orion"
    assert "1 in 10¹⁴" in panes.card.text.text()
    assert panes.card.ra.isVisible()
    assert panes.card.ra.text() == "05h 36m 12.00s"
    assert panes.card.dec.text() == "−01° 12′ 00.0″"
    assert (
        panes.card.facts.text().replace("\u00a0", " ")
        == "± 0.206″   Field 12.00° × 8.02°   Scale 72.26″/px   Rotation +27.0°"
    )
    assert not panes.card.old.isVisible()
    assert panes.stars.model.rowCount() == 24
    assert commands.presenter.overlay.solution is commands.session.known.result
    assert len(commands.presenter.overlay.detected) == 36
    assert (window.bar.name.text(), window.bar.doing.text()) == ("orion.fits", "Solved in 37 ms")
    assert "orion.fits" in window.windowTitle()


def test_the_card_says_how_high_a_dated_frame_stood(qtbot, make_window, settings, a_file):
    settings.keep_site(Site(48.14, 11.58))
    dated = Hint(time_utc=datetime(2026, 1, 15, 22, 0, tzinfo=UTC))
    window, commands = make_window(FakeEngine(frame=replace(star_field(), hint=dated)))
    facts = window.workspace.card.facts
    commands.files.open(a_file)
    qtbot.waitUntil(lambda: "Az" in facts.text())
    altitude, azimuth = map(float, re.search(r"Alt\s\+([\d.]+)°\s+Az\s([\d.]+)°", facts.text()).groups())
    place = SkyCoord(84.05 * deg, -1.2 * deg)  # the fake engine's answer
    seen = place.transform_to(AltAz(obstime="2026-01-15 22:00", location=EarthLocation(11.58 * deg, 48.14 * deg)))
    assert altitude == pytest.approx(seen.alt.deg, abs=0.05)  # refraction: 0.02
    assert azimuth == pytest.approx(seen.az.deg, abs=0.02)


def test_every_fact_of_the_solution_is_on_the_pane(opened):
    panel = opened[0].workspace.solution
    shown = {t: value.text().replace("\u00a0", " ") for t, value in panel.values.items()}
    assert shown["Rotation"] == "+27.000°"
    assert shown["Field of view"] == "12.00° × 8.02°"
    assert shown["Matches"] == "24 of 36 detected stars"
    assert shown["RMS"].startswith("0.21 px (")
    assert "″ × " in shown["Uncertainty"]
    assert shown["Chance match"] == "1 in 10¹⁴"
    assert shown["Method"] == "patterns"
    assert "detect 21 ms" in shown["Time"]
    assert "total 37 ms" in shown["Time"]
    assert [t.text().split(" ")[0] for t, _ in panel.forms] == ["Quaternion", "Matrix,", "RA,", "RA,"]
    quaternion = np.array(panel.forms[0][1].text().split(), dtype=float)
    assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-6)


def test_a_solve_that_fails_again_says_why_and_keeps_the_pointing_of_this_frame(qtbot, opened, engine):
    window, commands = opened
    engine.result = no_solution()
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.presenter.solve()
    card = window.workspace.card
    assert card.title.text() == "No solution: trailed"
    assert card.advice.text() == "Wait 5 s after the slew, then expose again."
    shown = [card._numbers.itemAt(i).widget().text() for i in range(card._numbers.count())]
    assert "12.3\u00a0px" in shown
    assert "37°" in shown
    assert card.ra.isVisible()
    assert card.old.isVisible()
    assert "orion.fits" in card.old.text()
    assert commands.presenter.overlay.solution is None
    assert window.workspace.stars.model.rowCount() == 0
    assert isinstance(commands.session.known.result, NoSolution)
    card.copy.click()
    assert "trail: 12.3 px" in QGuiApplication.clipboard().text()


@pytest.mark.parametrize("broken", [True, False])
def test_another_file_clears_the_pointing_of_the_one_before(qtbot, opened, engine, a_file, tmp_path, broken):
    window, commands = opened
    engine.result = no_solution()
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(tmp_path / "missing.fits" if broken else a_file)
    assert not window.workspace.card.ra.isVisible()
    assert not commands.actions["copy"].isEnabled()
    assert commands.session.known.last_good is None
    assert window.bar.doing.text() in ("Ready", "No solution in 410 ms")


def test_a_first_failure_has_no_old_pointing(qtbot, make_window, a_file):
    window, commands = make_window(FakeEngine(result=no_solution()))
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(a_file)
    assert not window.workspace.card.ra.isVisible()


def test_a_file_that_cannot_be_read_is_one_sentence(qtbot, make_window, engine, tmp_path):
    window, commands = make_window(engine)
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(tmp_path / "missing.fits")
    assert window.workspace.card.text.text() == "There is no file missing.fits."
    assert commands.settings.recent == []


def test_a_dropped_file_opens(qtbot, make_window, engine, a_file):
    window, commands = make_window(engine)
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(a_file))])
    drop = QDropEvent(
        QPointF(50, 50), Qt.DropAction.CopyAction, data, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    )
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        window.dropEvent(drop)
    assert commands.session.known.path == a_file


def test_dropped_text_is_left_alone(make_window, engine):
    window, commands = make_window(engine)
    data = QMimeData()
    data.setText("hello")
    window.dropEvent(
        QDropEvent(
            QPointF(5, 5), Qt.DropAction.CopyAction, data, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
        )
    )
    assert commands.session.known.path is None


def test_a_cancelled_solve_still_shows_the_frame(qtbot, make_window, a_file):
    engine = FakeEngine(frame=star_field(1500, 1100), gate=threading.Event())
    window, commands = make_window(engine)
    with qtbot.waitSignal(commands.session.solving, timeout=10_000):
        commands.files.open(a_file)
    assert commands.session.known.picture is None
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.session.cancel()
    assert window.workspace.view.picture is not None
    assert window.workspace.card.title.text() == "Cancelled"


def test_cancel_stops_a_solve(qtbot, make_window, a_file):
    engine = FakeEngine(gate=threading.Event())
    window, commands = make_window(engine)
    with qtbot.waitSignal(commands.session.solving, timeout=10_000):
        commands.files.open(a_file)
    qtbot.waitUntil(lambda: commands.session.known.picture is not None, timeout=10_000)
    assert window.bar.cancel.isVisible()
    assert commands.actions["cancel"].isEnabled()
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        qtbot.keyClick(window, Qt.Key.Key_Escape)
    assert engine.stopped.is_set()
    assert window.workspace.card.title.text() == "Cancelled"
    assert not window.bar.cancel.isVisible()


def test_closing_in_the_middle_of_a_solve_ends_its_thread(qtbot, make_window, a_file):
    engine = FakeEngine(gate=threading.Event())
    window, commands = make_window(engine)
    with qtbot.waitSignal(commands.session.solving, timeout=10_000):
        commands.files.open(a_file)
    window.close()
    assert engine.stopped.wait(60)
    assert not any(t.name.startswith("kochab-") for t in threading.enumerate())


def test_opening_another_frame_in_the_middle_drops_the_first(qtbot, make_window, a_file, tmp_path):
    engine = FakeEngine(gate=threading.Event())
    _, commands = make_window(engine)
    with qtbot.waitSignal(commands.session.solving, timeout=10_000):
        commands.files.open(a_file)
    other = tmp_path / "other.fits"
    other.touch()
    answers = []
    commands.session.solved.connect(answers.append)
    commands.files.open(other)
    engine.gate.set()
    qtbot.waitUntil(lambda: not commands.session.busy, timeout=10_000)
    assert commands.session.known.path == other
    assert len(answers) == 1


def test_hints_and_methods_go_to_the_engine(qtbot, opened, engine):
    window, commands = opened
    hints = window.workspace.hints
    hints.fov.setText("12")
    hints.ra.setText("5h36m")
    hints.dec.setText("-1.2")
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.presenter.solve()
    options = engine.asked[-1]
    low, high = options.hint.scale_arcsec_px
    true = commands.session.known.result.camera.scale_arcsec_px
    assert low < true < high
    assert options.hint.centre_deg == pytest.approx((84.0, -1.2, 10.0))
    assert (options.method, options.detector) == ("patterns", "auto")


def test_a_typed_field_is_understood_anew_for_each_frame(qtbot, opened, engine, a_file):
    window, commands = opened
    window.workspace.hints.fov.setText("12")
    engine.frame = star_field(1200, 300)
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(a_file)
    low, high = engine.asked[-1].hint.scale_arcsec_px
    assert low < 12 * 3600 / 1200 < high
    window.workspace.hints.fov.setText("nonsense")
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(a_file)
    assert engine.asked[-1].hint is None


def test_an_impossible_hint_is_said_on_the_pane_and_nothing_runs(opened, engine):
    window, commands = opened
    window.workspace.hints.fov.setText("wide")
    before = len(engine.asked)
    commands.presenter.solve()
    assert len(engine.asked) == before
    assert window.workspace.tabs.currentIndex() == 2
    assert "field of view" in window.workspace.hints.wrong.text().lower()
    window.workspace.hints.clear()
    assert not window.workspace.hints.wrong.isVisible()


def test_recent_files_and_settings_survive_a_restart(qtbot, make_window, engine, a_file):
    window, commands = make_window(engine)
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(a_file)
    commands.actions["grid"].trigger()
    commands.actions["stretch"].trigger()
    window.workspace.solution.style_box.setCurrentIndex(2)
    commands.appearance.use_theme("light", "large")
    window.close()
    again, new = make_window(engine)
    assert new.settings.recent == [a_file]
    assert any("orion.fits" in a.text() for a in again.menus.recent.actions())
    assert not new.actions["grid"].isChecked()
    assert not new.presenter.overlay.layers.on["grid"]
    assert not again.workspace.strip.auto.isChecked()
    assert again.workspace.solution.style_box.currentIndex() == 2
    assert new.settings.text("theme", "") == "light"
    assert new.settings.text("text_size", "") == "large"
    new.actions["clear_recent"].trigger()
    assert new.settings.recent == []
    assert not again.menus.recent.isEnabled()


def test_copying(opened):
    window, commands = opened
    commands.actions["copy"].trigger()
    assert QGuiApplication.clipboard().text() == "05:36:12.00 -01:12:00.0"
    commands.actions["copy_all"].trigger()
    text = QGuiApplication.clipboard().text()
    assert "Chance match: 1 in 10¹⁴" in text
    assert "Quaternion" in text
    window.workspace.solution.copy_attitude()
    assert "Matrix" in QGuiApplication.clipboard().text()


def test_the_log_shows_lines_and_details_on_request(opened):
    window, commands = opened
    logging.getLogger("kochab").warning("a line for the log")
    assert "a line for the log" in window.log.lines.toPlainText()
    assert "solved: RA 84.05" in window.log.text()
    assert window.log.text().startswith("Kochab ")
    commands.actions["log"].trigger()
    assert window.log.isVisible()
    window.log.copy_log()
    assert QGuiApplication.clipboard().text() == window.log.text()
    log = logging.getLogger("kochab.gear.link")
    level = logging.getLogger("kochab").level
    logging.getLogger("kochab").setLevel(logging.DEBUG)  # as the journal does
    try:
        log.debug("not these bytes")
        window.log.details.setChecked(True)
        log.debug("these bytes")
    finally:
        logging.getLogger("kochab").setLevel(level)
    assert "these bytes" in window.log.lines.toPlainText()
    assert "not these bytes" not in window.log.lines.toPlainText()


def test_a_fault_that_nothing_caught_is_shown_with_its_message(opened):
    window, _ = opened
    try:
        raise KeyError("the lost key")
    except KeyError:
        logging.getLogger("kochab").critical("fault", exc_info=True)  # as the journal's hooks do
    assert "the lost key" in window.status.currentMessage()
    assert "Traceback" in window.log.lines.toPlainText()


def test_a_report_is_saved_from_the_help_menu(qtbot, opened, tmp_path, monkeypatch):
    window, commands = opened
    journal, path = tmp_path / "state", tmp_path / "report.zip"
    journal.mkdir()
    (journal / "journal.log").write_text("a line of the journal\n", "utf-8")
    monkeypatch.setattr("kochab.gear.journal.journal_folder", lambda: journal)
    monkeypatch.setattr("kochab.window.shell.help_book.ask_save", lambda *_: path)
    commands.actions["report"].trigger()
    qtbot.waitUntil(lambda: window.status.currentMessage().startswith("Saved report.zip"), timeout=10_000)
    with zipfile.ZipFile(path) as report:
        assert "a line of the journal" in report.read("journal.log").decode()
        assert "theme" in report.read("settings.json").decode()
    monkeypatch.setattr("kochab.window.shell.help_book.ask_save", lambda *_: tmp_path / "nowhere" / "r.zip")
    commands.actions["report"].trigger()
    qtbot.waitUntil(lambda: window.findChildren(QMessageBox) != [], timeout=10_000)
    assert window.findChildren(QMessageBox)[0].text().startswith("Can't write r.zip")


def test_the_place_under_the_cursor(qtbot, opened):
    window, _ = opened
    view = window.workspace.view
    qtbot.mouseMove(view, QPoint(view.width() // 2, view.height() // 2))
    qtbot.waitUntil(lambda: "value" in window.status.place.text())
    text = window.status.place.text()
    assert "05h 36m" in text  # after the name of what is there, once the sky is loaded
    assert "x 299" in text or "x 300" in text
    view.hovered.emit(None)
    assert window.status.place.text() == ""
