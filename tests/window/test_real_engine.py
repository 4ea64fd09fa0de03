"""The window over the real engine: what a newcomer meets."""

import numpy as np
import pytest
from PIL import Image

from kochab.core.solution import NoSolution, Solution
from kochab.window.frame.session import WorkflowEngine
from kochab.window.shell.welcome import samples

LIMIT_MS = 60_000
SHOWS = {
    "milky-way": "Aquila",
    "orion": "Orion's Belt in Orion",
    "pleiades": "M 45 in Taurus",
    "southern-cross": "Crux",
    "big-dipper": "Big Dipper in Ursa Major",
    "kochab-and-polaris": "Ursa Minor",
}


@pytest.fixture
def real(make_window):
    return make_window(WorkflowEngine(), samples())


def open_and_wait(qtbot, commands, path):
    with qtbot.waitSignal(commands.session.idle, timeout=LIMIT_MS):
        commands.files.open(path)
    return commands.session.known.result


def test_every_sample_solves_and_is_shown(qtbot, real):
    window, commands = real
    for sample in samples():
        result = open_and_wait(qtbot, commands, sample.path)
        assert isinstance(result, Solution), (sample.path.name, result)
        title = window.workspace.card.title
        qtbot.waitUntil(lambda title=title: title.text() != "Solved")
        assert title.text() == SHOWS[sample.path.stem]
        assert window.workspace.stars.model.rowCount() == len(result.named) >= 10
        assert any(star.name for star in result.stars)
        assert not window.workspace.view.grab().toImage().isNull()


def test_noise_without_stars_is_refused_with_reason_and_advice(qtbot, real, tmp_path):
    window, commands = real
    noise = np.random.default_rng(7).normal(90, 6, (480, 640)).clip(0, 255).astype(np.uint8)
    path = tmp_path / "noise.png"
    Image.fromarray(noise).save(path)
    result = open_and_wait(qtbot, commands, path)
    assert isinstance(result, NoSolution)
    assert str(result.reason) == "clouded or dark"
    assert window.workspace.card.title.text() == "No solution: no stars visible"
    assert window.workspace.card.advice.text() == result.advice != ""


@pytest.mark.parametrize("content", [b"", b"SIMPLE  =", b"this is a letter to my aunt", b"\x89PNG\r\n\x1a\n"])
def test_what_is_no_picture_is_one_sentence(qtbot, real, tmp_path, content):
    window, commands = real
    path = tmp_path / "broken.fits"
    path.write_bytes(content)
    with qtbot.waitSignal(commands.session.failed, timeout=LIMIT_MS) as told:
        commands.files.open(path)
    qtbot.waitUntil(lambda: not commands.session.busy, timeout=LIMIT_MS)
    assert window.workspace.card.text.text() == told.args[0]
    assert "\n" not in told.args[0]
    assert "fault inside" not in told.args[0]


@pytest.mark.parametrize("name", ["cedar__orion2.jpg", "gran__pleyades_05sec.jpg", "cedar__pleiades.jpg"])
def test_real_photographs(qtbot, real, shared_frames, name):
    window, commands = real
    path = shared_frames / name
    if not path.exists():
        pytest.skip(f"{name} is not among the real frames here")
    result = open_and_wait(qtbot, commands, path)
    shown = window.workspace.card.title.text()
    place = shown == "Solved" or shown.endswith((" in Orion", " in Taurus"))
    assert place if isinstance(result, Solution) else shown == f"No solution: {result.reason}"
    assert window.workspace.view.picture is not None


def test_methods_and_detectors_are_those_of_the_registries(real):
    from kochab.detection import DETECTORS
    from kochab.identification import IDENTIFIERS

    hints = real[0].workspace.hints
    for box, registry in ((hints.method, IDENTIFIERS), (hints.detector, DETECTORS)):
        assert [box.itemText(i) for i in range(box.count())] == list(registry)


def test_closing_in_the_middle_of_a_real_solve(qtbot, real, tmp_path):
    window, commands = real
    rng = np.random.default_rng(1)
    frame = rng.normal(1000, 20, (900, 1200))
    for x, y in rng.integers(10, 890, (150, 2)):
        frame[y - 1 : y + 2, x - 1 : x + 2] += 4000
    path = tmp_path / "stars.png"
    Image.fromarray(frame.clip(0, 65535).astype(np.uint16)).save(path)
    with qtbot.waitSignal(commands.session.solving, timeout=LIMIT_MS):
        commands.files.open(path)
    window.close()
    assert commands.session.jobs.join(20.0)
