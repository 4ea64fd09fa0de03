import numpy as np
import pytest
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QMainWindow

from kochab.sky import user_catalogues
from kochab.sky.user_catalogues import Where
from kochab.window.job import Jobs
from kochab.window.shell.own_stars import OwnStars
from kochab.window.shell.status import Status
from tests.sky import user_files


class Window(QMainWindow):
    closing = Signal()


@pytest.fixture
def usual(tmp_path, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "config"))
    folder = tmp_path / "usual"
    folder.mkdir()
    monkeypatch.setattr(user_catalogues, "usual_folders", lambda: [folder])
    return folder


@pytest.fixture
def asked(qtbot, usual):
    """The status bar of a shown window and the question in it, after the look at the folders."""
    made = []

    def ask():
        window = Window()
        qtbot.addWidget(window)
        window.setStatusBar(status := Status())
        own = OwnStars(status, Jobs(window, window.closing), 10)
        made.append((window, own))
        window.show()
        qtbot.wait(10)
        return own

    yield ask
    for window, own in made:
        window.closing.emit()
        own._jobs.join(60.0)


def deep(folder, name="d50"):
    rng = np.random.default_rng(1)
    stars = np.column_stack([rng.uniform(0, 10, 8000), rng.uniform(1, 4, 8000), rng.uniform(10, 17, 8000)])
    user_files.write_astap(folder, name, stars, every_area=False)


def test_a_deep_catalogue_is_asked_about_and_used(qtbot, usual, asked):
    deep(usual)
    own = asked()
    qtbot.waitUntil(own.line.isVisible)
    assert own.question.text() == "ASTAP D50 was found. Use its stars?"
    with qtbot.waitSignal(own.answered):
        own.use.click()
    assert user_catalogues.chosen() == Where("ASTAP", "D50", usual)
    assert not own.line.isVisible()
    again = asked()
    again.look()
    qtbot.wait(100)
    assert not again.line.isVisible()


def test_a_no_is_remembered(qtbot, usual, asked):
    deep(usual)
    own = asked()
    qtbot.waitUntil(own.line.isVisible)
    own.not_now.click()
    assert user_catalogues.chosen() is None
    assert user_catalogues.asked_before()
    assert not own.line.isVisible()


@pytest.mark.parametrize("what", ["nothing", "shallow", "damaged"])
def test_nothing_is_asked_where_nothing_helps(qtbot, usual, asked, what):
    if what == "shallow":
        user_files.write_wide(usual, "w08", [(k % 360, k % 90, 5.0) for k in range(500)])
    elif what == "damaged":
        (usual / "d50_0101.1476").write_bytes(b"damaged")
    own = asked()
    jobs = own._jobs
    qtbot.waitUntil(lambda: bool(jobs._jobs) and not any(job.waits for job in jobs._jobs))
    assert not own.line.isVisible()


def test_one_that_breaks_meanwhile_is_told(qtbot, usual, asked):
    deep(usual)
    own = asked()
    qtbot.waitUntil(own.line.isVisible)
    for path in usual.iterdir():
        path.unlink()
    with qtbot.waitSignal(own.answered):
        own.use.click()
    assert "no ASTAP database D50" in own._status.currentMessage()
    assert user_catalogues.chosen() is None
