"""The Laboratory as a person uses it: compare, draw, stop, export; by keyboard, also at night."""

import csv
import io
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractButton, QAbstractSpinBox, QComboBox, QLineEdit, QListWidget

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.progress import Progress
from kochab.core.solution import Identification, Matches, NoSolution, Reason
from kochab.lab.laboratory import comparison, scene
from kochab.lab.laboratory.comparison import REGISTRIES, ComparedPart
from kochab.window.application import build
from kochab.window.frame.session import WorkflowEngine
from kochab.window.laboratory.setup import Hints, StarSource
from kochab.window.laboratory.view import TimeLeft
from kochab.window.shell.welcome import samples
from tests.window.fakes import close_windows
from tests.window.test_night import assert_red

LIMIT_MS = 30_000


@pytest.fixture
def lab(qtbot, settings):
    """A window with its Laboratory open, and room to make another."""
    made = []

    def make():
        window, commands = build(WorkflowEngine(), settings, [])
        qtbot.addWidget(window)
        window.resize(1360, 860)
        window.show()
        commands.views.show("laboratory")
        made.append(commands)
        return commands, commands.views.docks["laboratory"].view

    yield make
    for commands in made:
        commands.appearance.use_theme("dark", "normal")
    close_windows(*made)


def wait_for(qtbot, view):
    qtbot.waitUntil(lambda: view.compare.isEnabled() and view.plots.drawn, timeout=LIMIT_MS)


def texts(table, row):
    return [table.item(row, column).text() for column in range(table.columnCount())]


def titles(table):
    return [table.horizontalHeaderItem(k).text() for k in range(table.columnCount())]


def column(table, title):
    return [table.item(row, titles(table).index(title)) for row in range(table.rowCount())]


def field_setup(view, *methods):
    view.setup.source.setCurrentText(StarSource.FIELD)
    view.setup.numbers["false"].setValue(0)
    view.setup.numbers["missing"].setValue(0)
    view.methods.tick(list(methods))


def show(view, name):
    """Make ``name`` the row whose options are shown."""
    (item,) = view.methods.list.findItems(name, Qt.MatchFlag.MatchExactly)
    view.methods.list.setCurrentItem(item)


def test_methods_on_a_simulated_field(qtbot, lab):
    _, view = lab()
    field_setup(view, "patterns", "neighbours")
    view.compare.click()
    assert not view.compare.isEnabled()
    assert view.stop.isEnabled()
    wait_for(qtbot, view)
    assert view.table.rowCount() == 2
    first = texts(view.table, 0)
    assert first[0] == "patterns"
    assert first[1].startswith("right, ")
    assert int(first[2]) >= 5
    assert first[3] == "0"
    assert first[4].endswith("ms")
    assert first[5].endswith("″")
    assert first[7] == "Kochab's own"
    assert texts(view.table, 1)[0] == "neighbours"
    assert "Liebe" in texts(view.table, 1)[7]
    assert view.status.text() == "Done."


def test_methods_on_the_open_frame_with_its_solution_for_the_truth(qtbot, lab):
    commands, view = lab()
    path = next(s.path for s in samples() if "orion" in s.path.name)
    with qtbot.waitSignal(commands.session.idle, timeout=LIMIT_MS):
        commands.files.open(path)
    view.methods.tick(["patterns", "voting"])
    view.setup.hints.setCurrentText(Hints.NOTHING)
    view.run_comparison()
    wait_for(qtbot, view)
    assert [t.right for t in view.table.trials] == [True, False]
    assert texts(view.table, 1)[1] == "none"
    assert texts(view.table, 1)[6] == "no pattern agreed"
    assert "scale is unknown" in view.table.item(1, 6).toolTip()
    view.setup.hints.setCurrentText(Hints.SCALE)
    view.run_comparison()
    wait_for(qtbot, view)
    assert [t.right for t in view.table.trials] == [True, True]
    assert view.table.trials[1].wrong == 0


def test_detectors_on_a_simulated_picture(qtbot, lab):
    _, view = lab()
    view.methods.choose(ComparedPart.DETECTOR)
    field_setup(view, "auto", "contours")
    view.setup.numbers["size_px"].setValue(700)
    view.setup.numbers["noise_px"].setValue(0.05)
    view.compare.click()
    wait_for(qtbot, view)
    assert titles(view.table)[:4] == ["Detector", "Answer", "Found", "True"]
    first = dict(zip(titles(view.table), texts(view.table, 0), strict=True))
    assert first["Detector"] == "auto"
    assert first["Answer"].startswith("right, ")
    assert first["True"].endswith(" of 20")
    assert first["RMS"].endswith(" px")
    assert first["Time"].endswith("s")
    assert "stars found" in view.table.item(0, 3).toolTip()
    assert texts(view.table, 1)[0] == "contours"
    assert "2018" in texts(view.table, 1)[-1]


def test_detectors_and_estimators_on_the_open_frame(qtbot, lab):
    commands, view = lab()
    path = next(s.path for s in samples() if "pleiades" in s.path.name)
    with qtbot.waitSignal(commands.session.idle, timeout=LIMIT_MS):
        commands.files.open(path)
    for kind, first, extra in (
        (ComparedPart.DETECTOR, "auto", "Found"),
        (ComparedPart.ATTITUDE, "fit", "From the fit"),
    ):
        view.methods.choose(kind)
        view.compare.click()
        wait_for(qtbot, view)
        assert [t.name for t in view.table.trials] == list(REGISTRIES[kind])
        assert texts(view.table, 0)[0] == first
        assert extra in titles(view.table)
        assert all(t.right for t in view.table.trials)
        assert all(t.wrong == 0 for t in view.table.trials)
    away = [cell.text() for cell in column(view.table, "From the fit")]
    assert away[0] == "–"
    assert all(text.endswith("″") for text in away[1:])


def test_a_comparison_stops_between_two_and_keeps_what_there_was(qtbot, lab, monkeypatch):
    _, view = lab()
    view.methods.choose(ComparedPart.DETECTOR)
    field_setup(view, "auto", "contours")
    view.setup.numbers["size_px"].setValue(400)
    begun, asked = threading.Event(), threading.Event()
    monkeypatch.setattr(view.table, "add", lambda trial: (begun.wait(30), view._stop(), asked.set()))
    gate = comparison.DETECTORS.make
    waits = iter((False, True))

    def slow(name):
        if next(waits):
            begun.set()
            assert asked.wait(60.0)
        return gate(name)

    monkeypatch.setattr(comparison, "DETECTORS", SimpleNamespace(make=slow))
    view.compare.click()
    wait_for(qtbot, view)
    assert view.status.text().startswith("Stopped")
    assert next(waits, None) is None


def test_a_name_is_written_in_words_and_chosen_as_registered(lab):
    _, view = lab()
    show(view, "spherical triangles")
    view.methods.tick(["spherical_triangles"])
    assert [c.name for c in view.methods.choices()] == ["spherical_triangles"]


def test_each_kind_keeps_its_own_choice(lab):
    _, view = lab()
    view.methods.tick(["voting"])
    view.methods.choose(ComparedPart.DETECTOR)
    assert [c.name for c in view.methods.choices()] == list(REGISTRIES[ComparedPart.DETECTOR])
    view.methods.tick(["gaussian"])
    show(view, "gaussian")
    view.methods.options.fields["fwhm_px"].setText("4")
    view.methods.choose(ComparedPart.ATTITUDE)
    view.methods.tick([])
    view.compare.click()
    assert view.status.text() == "Tick at least one attitude."
    view.methods.choose(ComparedPart.DETECTOR)
    (choice,) = view.methods.choices()
    assert (choice.name, choice.options) == ("gaussian", {"fwhm_px": 4.0})
    show(view, "gaussian")
    assert view.methods.options.fields["fwhm_px"].text() == "4"
    view.methods.options.fields["fwhm_px"].setText("400")
    view.compare.click()
    assert view.status.text().startswith("Detector gaussian: fwhm_px cannot be 400")
    assert view.job is None
    view.methods.choose(ComparedPart.METHOD)
    assert [c.name for c in view.methods.choices()] == ["voting"]


def test_the_table_may_be_sorted_and_filled_again_with_another_kind(qtbot, lab):
    _, view = lab()
    view.methods.choose(ComparedPart.ATTITUDE)
    field_setup(view, "fit", "quest", "triad")
    view.compare.click()
    wait_for(qtbot, view)
    across = titles(view.table).index("From the fit")
    view.table.sortItems(across, Qt.SortOrder.DescendingOrder)
    assert column(view.table, "Attitude")[0].text() == "triad"
    view.methods.choose(ComparedPart.METHOD)
    view.methods.tick(["patterns"])
    view.compare.click()
    wait_for(qtbot, view)
    assert titles(view.table)[0] == "Method"
    assert view.table.rowCount() == 1
    assert texts(view.table, 0)[0] == "patterns"


def test_without_a_frame_it_says_so(qtbot, lab):
    _, view = lab()
    view.run_comparison()
    wait_for(qtbot, view)
    assert view.status.text() == "Open a frame first, or choose a simulated field."
    assert view.table.rowCount() == 0


def test_no_method_or_a_wrong_option_is_said_and_nothing_runs(qtbot, lab):
    _, view = lab()
    view.methods.tick([])
    view.compare.click()
    assert view.status.text() == "Tick at least one method."
    assert view.job is None
    view.methods.tick(["voting"])
    show(view, "voting")
    view.methods.options.fields["stars"].setText("1000")
    view.draw.click()
    assert "stars cannot be 1000" in view.status.text()
    assert view.job is None
    view.methods.options.fields["stars"].setText("12")
    assert view.methods.choices()[0].options == {"stars": 12}


def test_options_reach_the_method_and_survive_looking_at_another(lab):
    _, view = lab()
    show(view, "voting")
    view.methods.options.fields["margin_px"].setText("1.5")
    show(view, "triads")
    assert "margin_px" not in view.methods.options.fields
    show(view, "voting")
    assert view.methods.options.fields["margin_px"].text() == "1.5"
    chosen = {c.name: c.options for c in view.methods.choices()}
    assert chosen["voting"] == {"margin_px": 1.5}


def test_curves_are_drawn_round_by_round_and_can_be_stopped(qtbot, lab):
    _, view = lab()
    field_setup(view, "patterns")
    view.setup.numbers["fields"].setValue(500)
    view.draw.click()
    qtbot.waitUntil(lambda: len(view.plots.charts["noise_px"].series) == 1, timeout=LIMIT_MS)
    qtbot.waitUntil(lambda: len(view.plots.charts["noise_px"].series[0].x) == 6, timeout=LIMIT_MS)
    view.stop.click()
    wait_for(qtbot, view)
    assert view.status.text().startswith("Stopped")
    for name in ("noise_px", "false", "missing", "stars"):
        (line,) = view.plots.charts[name].series
        assert line.name == "patterns"
        assert all(0 <= y <= 100 for y in line.y)
    assert view.plots.charts["noise_px"].series[0].y[0] == 100.0
    assert view.plots.charts["margin_px"].series == ()  # patterns has no such option
    assert all(y > 0 for y in view.plots.time.series[0].y)


@pytest.mark.parametrize(
    ("kind", "name", "axis"),
    [(ComparedPart.DETECTOR, "contours", "stars found, %"), (ComparedPart.ATTITUDE, "quest", "error, arcsec")],
)
def test_curves_of_another_kind_have_another_measure(qtbot, lab, kind, name, axis):
    _, view = lab()
    view.methods.choose(kind)
    field_setup(view, name)
    view.setup.numbers["size_px"].setValue(300)
    view.setup.numbers["fields"].setValue(1)
    view.draw.click()
    wait_for(qtbot, view)
    assert view.tabs.currentWidget() is view.plots
    assert view.tabs.tabText(1) == "Curves"
    assert "margin_px" not in view.plots.charts
    assert {chart.up.label for chart in view.plots.charts.values()} == {axis}
    for chart in (*view.plots.charts.values(), view.plots.time):
        (line,) = chart.series
        assert line.name == name
        assert len(line.x) >= 2
        assert np.isfinite(line.y).all()
    assert all(y > 0 for y in view.plots.time.series[0].y)
    assert view.csv.isEnabled()
    view.methods.choose(ComparedPart.METHOD)
    view.methods.tick(["patterns"])
    view.draw.click()
    wait_for(qtbot, view)
    assert view.plots.charts["margin_px"].series == ()
    assert [line.name for line in view.plots.charts["noise_px"].series] == ["patterns"]


class Liar:
    """A method that is sure of the wrong place."""

    def identify(self, detections, hint=None, year=2016.0):
        yield Progress("identify")
        rows = np.arange(len(detections.xy[:6]))
        camera = Camera.centred(detections.width, detections.height, 3000.0)
        attitude = attitude_from(10.0, 20.0, 30.0)
        vectors = camera.unproject(detections.xy[:6]) @ attitude.matrix
        matches = Matches(rows, rows, detections.xy[:6], vectors)
        return Identification(matches, camera, attitude, -20.0, "liar")


def test_wrong_answers_are_told(qtbot, lab, monkeypatch):
    monkeypatch.setattr(scene, "IDENTIFIERS", SimpleNamespace(make=lambda name, **_: Liar()))
    _, view = lab()
    field_setup(view, "patterns")
    view.run_comparison()
    wait_for(qtbot, view)
    assert texts(view.table, 0)[1].startswith("WRONG, ")
    assert texts(view.table, 0)[3] == "6"
    view.setup.numbers["fields"].setValue(1)
    view.run_curves()
    wait_for(qtbot, view)
    points = view.plots.points.values()
    assert view.status.text() == f"Done. Wrong answers: patterns {len(points)}."
    assert {p.success for p in points} == {0.0}


class Endless:
    """A method that never answers."""

    def identify(self, detections, hint=None, year=2016.0):
        while True:
            time.sleep(0.01)
            yield Progress("identify", 0.5)


def test_stop_ends_a_method_that_does_not(qtbot, lab, monkeypatch):
    monkeypatch.setattr(scene, "IDENTIFIERS", SimpleNamespace(make=lambda name, **_: Endless()))
    _, view = lab()
    field_setup(view, "patterns")
    view.setup.numbers["limit_s"].setValue(600)
    view.run_comparison()
    qtbot.waitUntil(lambda: view.status.text() == "patterns", timeout=LIMIT_MS)
    view.stop.click()
    wait_for(qtbot, view)
    assert view.status.text().startswith("Stopped")


def test_closing_the_window_ends_a_run(qtbot, lab, monkeypatch):
    monkeypatch.setattr(scene, "IDENTIFIERS", SimpleNamespace(make=lambda name, **_: Endless()))
    commands, view = lab()
    field_setup(view, "patterns")
    view.run_comparison()
    job = view.job
    qtbot.waitUntil(lambda: job.running, timeout=LIMIT_MS)
    commands.window.close()
    assert not job.running


def test_export_of_both_tabs(qtbot, lab, tmp_path):
    _, view = lab()
    assert not view.csv.isEnabled()
    field_setup(view, "patterns")
    view.run_comparison()
    wait_for(qtbot, view)
    assert view.csv.isEnabled()
    table, picture, broken = tmp_path / "t.csv", tmp_path / "t.png", tmp_path / "no" / "t.csv"
    view.write("csv", table)
    size = (2 * view.table.width(), 2 * view.table.height())
    view.write("png", picture)
    qtbot.waitUntil(lambda: table.exists() and picture.exists(), timeout=LIMIT_MS)
    qtbot.waitUntil(lambda: not view._services.jobs._jobs[-1].running, timeout=LIMIT_MS)
    (row,) = csv.DictReader(io.StringIO(table.read_text("utf-8")))
    assert row["name"] == "patterns"
    assert row["right"] == "yes"
    with Image.open(picture) as image:
        assert image.size == size
        assert len(np.unique(np.asarray(image.convert("L")))) > 10
    told = []
    job_before = view._services.jobs._jobs[-1]
    view.write("csv", broken)
    job = view._services.jobs._jobs[-1]
    assert job is not job_before
    job.failed.connect(told.append)
    qtbot.waitUntil(lambda: told != [], timeout=LIMIT_MS)
    assert told[0].startswith("Can't write t.csv")
    assert "\n" not in told[0]


def test_what_was_chosen_comes_back(qtbot, lab):
    commands, view = lab()
    field_setup(view, "patterns")
    view.setup.numbers["width_deg"].setValue(25.0)
    view.setup.hints.setCurrentText(Hints.POSITION)
    show(view, "voting")
    view.methods.options.fields["stars"].setText("10")
    view.methods.choose(ComparedPart.DETECTOR)
    view.methods.tick(["auto", "peaks"])
    view.methods.choose(ComparedPart.METHOD)
    view.run_comparison()
    wait_for(qtbot, view)
    view.methods.choose(ComparedPart.DETECTOR)
    view.run_comparison()
    wait_for(qtbot, view)
    commands.window.close()
    _, again = lab()
    assert again.setup.field[0] == 25.0
    assert again.setup.from_field
    assert again.setup.hints.currentText() == Hints.POSITION
    assert again.methods.kind is ComparedPart.DETECTOR
    assert [c.name for c in again.methods.choices()] == ["auto", "peaks"]
    again.methods.choose(ComparedPart.METHOD)
    assert [c.name for c in again.methods.choices()] == ["patterns"]
    again.methods.tick(["voting"])
    assert again.methods.choices()[0].options == {"stars": 10}


def test_what_was_kept_and_makes_no_sense_is_forgotten(settings, lab):
    settings.keep(
        "laboratory",
        '{"width_deg": "wide", "compared": "colour", "detector": 4,'
        ' "method": {"ticked": 3, "options": {"voting": {"stars": 900}, "gone": {}}}}',
    )
    _, view = lab()
    assert view.setup.field[0] == 20.0
    assert len(view.methods.choices()) > 3
    settings.keep("laboratory", "not json")
    _, view = lab()
    assert view.setup.field[0] == 20.0


def test_it_is_red_at_night_also_when_it_came_after(qtbot, lab):
    commands, view = lab()
    field_setup(view, "patterns", "voting")
    view.run_comparison()
    wait_for(qtbot, view)
    commands.actions["night"].trigger()
    qtbot.waitUntil(lambda: commands.appearance.settled)
    tops = view.findChildren(type(view.tabs))
    for top in tops:
        for index in range(top.count()):
            top.setCurrentIndex(index)
            qtbot.wait(20)
            assert_red(commands.window)
    show(view, "voting")
    view.methods.list.setFocus()
    view.methods.options.fields["stars"].setText("7777")
    view.methods.options.fields["stars"].setFocus()
    qtbot.wait(20)
    assert_red(commands.window)


def test_everything_in_it_has_a_name_and_is_reached_by_tab(qtbot, lab):
    _, view = lab()
    kinds = (QAbstractButton, QComboBox, QAbstractSpinBox, QLineEdit, QListWidget)
    for top in view.findChildren(type(view.tabs)):
        for index in range(top.count()):
            top.setCurrentIndex(index)
            view.methods.choose(list(ComparedPart)[index % 3])
            for widget in view.findChildren(kinds[0]) + [w for k in kinds[1:] for w in view.findChildren(k)]:
                inner = widget.objectName().startswith("qt_") or widget.inherits("QTableCornerButton")
                if inner or not widget.isVisible() or not widget.isEnabled():
                    continue
                assert widget.accessibleName() or getattr(widget, "text", str)(), widget
                assert widget.focusPolicy() & Qt.FocusPolicy.TabFocus, widget


def test_a_tool_may_fill_the_window(qtbot, lab):
    commands, _ = lab()
    commands.actions["fill"].trigger()
    assert not commands.window.pages.isVisible()
    commands.views.toggle("laboratory")
    assert commands.window.pages.isVisible()
    assert not commands.actions["fill"].isChecked()
    commands.actions["fill"].trigger()  # nothing is open
    assert commands.window.pages.isVisible()


def test_a_frame_that_nobody_solved_has_no_truth(qtbot, lab):
    from kochab.core.progress import run
    from kochab.lab.laboratory.scene import scene_of_frame
    from tests.window.fakes import star_field

    failure = NoSolution(Reason.TIMED_OUT, "Wait.")
    scene = run(scene_of_frame(star_field(), None, failure, None))
    assert scene.truth is None
    assert not scene.hint(True, True).helps
    assert scene.hint(False, False) is None


def test_the_time_left_is_said_once_the_pace_is_known():
    left = TimeLeft()

    def at(now_s, share, stage="laboratory"):
        return left.words(Progress(stage, share), now_s)

    assert at(100.0, 0.0) == at(101.0, 0.3) == "", "a second says little"
    assert at(110.0, 0.10) == "about 90 s left"
    assert at(160.0, 0.60) == "about 40 s left"
    assert at(199.9, 0.999) == "about 5 s left"
    assert at(200.0, None, "preparing") == at(230.0, 0.01, "preparing") == "", "another stage has a pace of its own"
    assert at(260.0, 0.10, "preparing") == "about 9 min left", "a tenth in a minute"
    assert at(400.0, 0.02, "preparing") == "", "it began anew"


def test_a_run_says_how_long_it_will_take(lab, monkeypatch):
    ticks = iter(range(0, 10_000, 10))
    monkeypatch.setattr("kochab.window.laboratory.view.time.monotonic", lambda: next(ticks))
    _, view = lab()
    view._progressed(Progress("laboratory", 0.0, "patterns"))
    view._progressed(Progress("laboratory", 0.1, "patterns"))
    assert view.status.text() == "patterns, about 90 s left"
