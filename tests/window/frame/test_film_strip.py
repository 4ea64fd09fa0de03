"""Many files at once: dropped, solved in turn, stepped through, filtered, tabled, blinked."""

import csv
import errno
import io
import os
import threading
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QLabel, QPushButton, QTableWidget

from kochab.core.progress import Progress
from kochab.core.solution import NoSolution, Solution
from kochab.window.frame.batch import FileState, images_in
from kochab.window.frame.film_strip import ORDERS, alike_at_first
from kochab.workflows.solution_text import CSV_TITLES, RESULT_TITLES
from tests.window.fakes import FakeEngine, FakeSolved, no_solution, star_field
from tests.window.test_night import assert_red


@dataclass
class ByName(FakeEngine):
    """Fails on files with "cloud" in their names; ``hold`` keeps it at work on those that have "slow"."""

    hold: threading.Event = field(default_factory=threading.Event)
    read_files: list = field(default_factory=list)

    def read(self, path):
        self.read_files.append(path.name)
        frame = yield from super().read(path)
        return replace(frame, path=str(path))

    def solve(self, frame, options, read_ms):
        while "slow" in frame.path and not self.hold.wait(0.005):
            yield Progress("identify", 0.5)
        solved = yield from super().solve(frame, options, read_ms)
        return FakeSolved(frame, solved.detections, no_solution()) if "cloud" in frame.path else solved


NAMES = ("a.fits", "b-cloud.fits", "c.fits", "d.fits")


@pytest.fixture
def files(tmp_path):
    made = [tmp_path / "night" / name for name in NAMES]
    made[0].parent.mkdir()
    for path in made:
        path.touch()
    (tmp_path / "night" / "notes.txt").touch()
    return made


def done(commands):
    return bool(commands.batch.files) and not commands.batch.waiting and not commands.session.busy


@pytest.fixture
def strip(qtbot, make_window, files):
    """Four files, all done: the second has no solution."""
    window, commands = make_window(ByName())
    window.files_dropped.emit(files)
    qtbot.waitUntil(lambda: done(commands))
    return window, commands, commands.films


def shown(films):
    return [films.list.item(at).text() for at in range(films.list.count())]


def test_files_that_are_dropped_together_are_all_solved_and_the_first_is_open(strip, files):
    window, commands, films = strip
    assert commands.session.known.path == files[0]
    assert [state.failed for state in commands.batch.files.values()] == [False, True, False, False]
    assert films.isVisible()
    assert films.count.text() == "4 files, 3 solved, 1 failed"
    assert films.list.currentItem().text() == "a.fits"
    spoken = [films.list.item(at).data(Qt.ItemDataRole.AccessibleTextRole) for at in range(4)]
    assert spoken[:2] == ["a.fits, solved", "b-cloud.fits, no solution: trailed"]
    assert films.bar.isHidden()
    assert films.solve.isHidden()
    assert window.workspace.card.ra.isVisible()


def test_names_on_the_strip_tell_the_files_of_a_night_apart(qtbot, make_window, tmp_path):
    """Each of them read "Light_…1.fit"."""
    named = [f"Light_M 42_300.0s_Bin1_ISO800_20240105-2201{k:02}_{k:04}.fits" for k in (7, 48)]
    for name in named:
        (tmp_path / name).touch()
    _, commands = make_window(ByName())
    commands.files.open_all([tmp_path / name for name in named])
    qtbot.waitUntil(lambda: done(commands))
    films = commands.films
    assert [text.replace("\n", "") for text in shown(films)] == ["…220107_0007.fits", "…220148_0048.fits"]
    metrics, item = films.list.fontMetrics(), films.list.visualItemRect(films.list.item(0))
    for line in "\n".join(shown(films)).split("\n"):
        assert metrics.horizontalAdvance(line) < item.width()
    assert item.height() >= 64 + 2 * metrics.lineSpacing()
    assert films.list.height() >= item.height()
    below = films.list.visualItemRect(films.list.item(1))  # which is not the chosen one
    below.adjust(4, 64 + 8, -4, -4)
    drawn = films.list.viewport().grab(below).toImage()
    ground = drawn.pixel(0, drawn.height() - 1)
    inked = [y for y in range(drawn.height()) if any(drawn.pixel(x, y) != ground for x in range(drawn.width()))]
    assert inked[-1] - inked[0] > 1.3 * metrics.lineSpacing(), "both lines are drawn"


@pytest.mark.parametrize(
    ("names", "alike"),
    [
        (["Light_M42_0001.fits", "Light_M42_0002.fits"], len("Light_M42_")),
        (["a.fits", "a.png"], 0),
        (["Light_M42_0001.fits"], 0),
        (["Horsehead.fits", "Horseshoe.fits"], 0),
        ([], 0),
    ],
)
def test_what_all_names_begin_with_is_left_out(names, alike):
    assert alike_at_first(names) == alike


def test_a_folder_stands_for_its_images(files):
    assert images_in([files[0].parent]) == files
    assert images_in([files[2], files[0].parent, files[2]]) == [files[2], files[0], files[1], files[3]]


def test_a_folder_that_cannot_be_read_is_told(monkeypatch, make_window, files):
    def refuse(folder):
        raise PermissionError(errno.EACCES, "Permission denied", str(folder))

    monkeypatch.setattr(Path, "iterdir", refuse)  # tests that run as root may read every folder
    window, commands = make_window(ByName())
    commands.files.open_all([files[0].parent])
    assert window.status.currentMessage() == "Can't open night: Permission denied."
    assert not commands.batch.files


def test_stepping_opens_the_next_file_and_never_shows_the_pointing_of_the_last(qtbot, strip, files):
    window, commands, films = strip
    card = window.workspace.card
    seen = []
    commands.session.opening.connect(lambda _: seen.append(card.ra.isVisible()))
    with qtbot.waitSignal(commands.session.idle):
        qtbot.keyClick(window, Qt.Key.Key_Right, Qt.KeyboardModifier.ControlModifier)
    assert seen == [False]
    assert commands.session.known.path == files[1]
    assert films.list.currentItem().text() == "b-cloud.fits"
    assert not card.ra.isVisible()
    assert card.title.text() == "No solution: trailed"
    with qtbot.waitSignal(commands.session.idle):
        commands.actions["previous"].trigger()
    assert commands.session.known.path == files[0]
    commands.actions["previous"].trigger()  # there is none before
    assert commands.session.known.path == files[0]


def test_filter_and_order(strip):
    _, _, films = strip
    films.failed.setChecked(True)
    assert shown(films) == ["b-cloud.fits"]
    films.failed.setChecked(False)
    films.order.setCurrentText("failed first")
    assert shown(films) == ["b-cloud.fits", "a.fits", "c.fits", "d.fits"]
    assert films.list.currentItem().text() == "a.fits"


def test_the_newest_comes_first_and_what_cannot_be_looked_at_last(files):
    os.utime(files[2], (4e9, 4e9))
    # A name too long for any disk: like a network drive that is off, it makes Path.exists raise.
    states = [FileState(path) for path in (files[0].with_name("x" * 300), files[0], files[2])]
    assert sorted(states, key=ORDERS["newest first"]) == states[::-1]


def test_a_broken_file_does_not_stop_the_others(qtbot, make_window, files):
    files[1].unlink()
    _, commands = make_window(ByName())
    commands.files.open_all(files)
    qtbot.waitUntil(lambda: done(commands))
    assert [state.words for state in commands.batch.files.values()][:2] == ["solved", "There is no file b-cloud.fits."]
    assert commands.films.count.text() == "4 files, 3 solved, 1 failed"


def test_cancel_stops_and_the_rest_is_solved_on_request(qtbot, make_window, tmp_path, files):
    slow = tmp_path / "slow.fits"
    slow.touch()
    engine = ByName()
    _, commands = make_window(engine)
    commands.files.open_all([files[0], slow, files[2]])
    qtbot.waitUntil(lambda: commands.batch.at == slow)
    assert commands.films.cancel.isVisible()
    commands.films.cancel.click()
    engine.hold.set()
    assert commands.batch.at is None
    assert commands.films.solve.isVisible()
    assert files[2].name not in engine.read_files
    commands.films.solve.click()
    qtbot.waitUntil(lambda: done(commands))
    assert all(isinstance(state.result, Solution) for state in commands.batch.files.values())


def test_another_solve_of_the_open_file_changes_its_state(qtbot, strip, files):
    _, commands, _ = strip
    commands.session.engine.result = no_solution()
    with qtbot.waitSignal(commands.session.idle):
        commands.presenter.solve()
    assert isinstance(commands.batch.files[files[0]].result, NoSolution)
    assert commands.films.count.text() == "4 files, 2 solved, 2 failed"


def test_another_file_ends_the_strip(qtbot, strip, a_file):
    _, commands, films = strip
    with qtbot.waitSignal(commands.session.idle):
        commands.files.open(a_file)
    assert not films.isVisible()
    assert not commands.actions["next"].isEnabled()


def test_results_of_no_images_say_how_they_come_and_cannot_be_saved(opened):
    window, commands = opened
    commands.files.show_results()
    (dialog,) = [d for d in window.findChildren(QDialog) if d.isVisible()]
    assert [b.isEnabled() for b in dialog.findChildren(QPushButton)] == [False, True]
    assert "Open several images" in dialog.findChild(QLabel).text()
    dialog.close()


def test_the_results_stand_in_a_table_and_in_csv(qtbot, strip, files, tmp_path, monkeypatch):
    window, commands, films = strip
    films.results_wanted.emit()
    (dialog,) = [d for d in window.findChildren(QDialog) if d.isVisible()]
    table = dialog.findChild(QTableWidget)
    row = [table.item(0, at).text() for at in range(len(RESULT_TITLES))]
    assert row[:4] == ["a.fits", "solved", "05h 36m 12.00s", "−01° 12′ 00.0″"]
    assert table.item(1, 1).text() == "no solution: trailed"
    assert table.item(1, 2) is None
    assert table.horizontalHeaderItem(4).text() == "Rotation"
    assert [b.isEnabled() for b in dialog.findChildren(QPushButton)] == [True, True]
    dialog.close()
    path = tmp_path / "results.csv"
    monkeypatch.setattr("kochab.window.frame.files.ask_save", lambda *_: path)
    commands.files.save_results()
    qtbot.waitUntil(path.exists)
    rows = list(csv.DictReader(io.StringIO(path.read_text("utf-8"))))
    assert list(rows[0]) == CSV_TITLES.split(",")
    assert [row["file"] for row in rows] == [str(path) for path in files]
    assert (float(rows[0]["ra_deg"]), float(rows[0]["dec_deg"])) == pytest.approx((84.05, -1.2), abs=1e-4)
    assert float(rows[0]["roll_deg"]) == pytest.approx(27.0, abs=1e-3)
    assert rows[1]["ra_deg"] == ""


def test_blinking_shows_both_images_and_marks_neither(qtbot, strip):
    window, commands, _ = strip
    view, card = window.workspace.view, window.workspace.card
    first = view.picture
    commands.session.engine.frame = star_field(seed=9)
    with qtbot.waitSignal(commands.session.idle):
        commands.actions["next"].trigger()
    second = view.picture
    commands.actions["blink"].trigger()
    assert view.quiet
    assert not card.isVisible()
    commands.blink._show_next()
    assert view.picture is first
    assert window.bar.name.text() == "a.fits"
    commands.blink._show_next()
    assert view.picture is second
    commands.blink._show_next()
    commands.actions["blink"].trigger()
    assert view.picture is second
    assert window.bar.name.text() == "b-cloud.fits"
    assert card.isVisible()
    assert not view.quiet


def test_the_strip_is_red_at_night(qtbot, strip):
    window, commands, films = strip
    commands.actions["night"].trigger()
    qtbot.waitUntil(lambda: commands.appearance.settled)
    assert_red(window)
    assert np.any([not films.list.item(at).icon().isNull() for at in range(4)])
    commands.appearance.use_theme("dark")


def test_everything_on_the_strip_has_a_name(strip):
    _, _, films = strip
    assert films.list.accessibleName()
    assert films.order.accessibleName()
    assert films.bar.accessibleName()
