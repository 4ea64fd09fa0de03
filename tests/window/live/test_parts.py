"""The parts of the Live view that need no window: stream, display, recording, chart."""

import json
import time
from dataclasses import replace

import numpy as np
import pytest

from kochab.core.attitude import radec_deg, unit_vectors
from kochab.core.errors import LineLostError
from kochab.core.frame import Frame
from kochab.core.progress import Progress, run
from kochab.sky import open_catalogue
from kochab.solver.camera_profile import new_profile
from kochab.window.image.frame_image import ScreenStretch, prepare
from kochab.window.live.frame_display import RenderQueue
from kochab.window.live.rendering import DisplaySettings, LiveRenderer, binned, full_scale
from kochab.window.live.sky_plot import hammer, pieces
from kochab.window.live.sky_points import MOST, Trail, sky_points
from kochab.workflows.session.live_stream import Recording, Stream, StreamRequest
from tests.window.fakes import brightness
from tests.workflows.live_sources import CAMERA, Clockwork, Told, refusal


def frame(value=1000, size=(400, 600), kind=np.uint16):
    return Frame(np.full(size, value, kind))


# what is shown ------------------------------------------------------------------------------------
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_binning_takes_means_and_drops_the_last_odd_line(kind):
    grey = np.arange(401 * 603, dtype=np.uint64).reshape(401, 603) % 251
    small = binned(grey.astype(kind), 0.5)
    assert small.shape == (200, 301)
    assert small.dtype == kind
    assert small[3, 5] == grey[6:8, 10:12].sum() // 4


def test_binning_stops_at_the_screen_and_a_mosaic_becomes_grey():
    assert binned(np.zeros((960, 1280), np.uint16), 0.8).shape == (960, 1280)
    assert binned(np.zeros((2000, 3000), np.uint16), 0.2).shape == (500, 750)
    mosaic = np.tile(np.array([[100, 200], [200, 700]], np.uint16), (200, 300))
    assert (binned(mosaic, 1.0, mosaic=True) == 300).all()


def test_red_light_has_no_green_and_no_blue():
    noise = np.random.default_rng(1).normal(1000, 50, (400, 600)).astype(np.uint16)
    picture = LiveRenderer().picture(Frame(noise), DisplaySettings(red=True))
    assert not (picture.memory & 0xFFFF).any()
    assert (picture.memory >> 24 == 255).all()
    day = LiveRenderer().picture(Frame(noise), DisplaySettings())
    assert ((day.memory & 0xFF) == (day.memory >> 16 & 0xFF)).all()
    assert (day.width, day.height) == (600, 400)


def test_a_live_frame_looks_as_an_opened_one_does():
    noise = np.random.default_rng(1).normal(1000, 50, (400, 600)).astype(np.uint16)
    opened, made = run(prepare(Frame(noise))), LiveRenderer()
    for stretch in (ScreenStretch(0.0, 0.5), ScreenStretch(0.1, 0.01)):
        shown = made.picture(Frame(noise), DisplaySettings(stretch)).memory & 0xFF
        assert np.abs(shown.astype(int) - brightness(opened, stretch)[noise]).max() <= 8
    automatic = made.picture(Frame(noise), DisplaySettings())
    assert automatic.auto.black == pytest.approx(opened.auto.black, abs=0.05)
    assert automatic.histogram.sum() > 10_000


@pytest.mark.parametrize("kind", [np.float32, np.int32])
def test_any_type_of_pixel_can_be_shown(kind):
    ramp = np.tile(np.linspace(0, 5000, 600), (400, 1)).astype(kind)
    shown = LiveRenderer().picture(Frame(ramp), DisplaySettings()).memory & 0xFF
    assert shown[0, -1] > shown[0, 0]


def test_full_is_what_the_frame_says_else_its_type():
    assert full_scale(replace(frame(), saturation=4095.0)) == 4095.0
    assert full_scale(frame(kind=np.uint8, value=3)) == 255.0
    assert full_scale(Frame(np.array([[0.2, 0.9]]))) == 1.0


def test_the_display_shows_the_newest_and_drops_the_rest():
    told = []
    display = RenderQueue(lambda: told.append(1))
    for value in (1, 2, 3):
        display.show(frame(value), None)
    task = display.task()
    next(task)
    ready = display.take()
    assert ready.frame.pixels[0, 0] == 3
    assert display.take() is None
    assert told == [1]
    display.close()
    with pytest.raises(StopIteration):
        next(task)


# the stream ---------------------------------------------------------------------------------------
def stream(source, engine, shown=None, **more):
    def show(frame, update):
        if shown is not None:
            shown.append((int(frame.pixels[0, 0]), update))

    wish = StreamRequest(lambda: source, "a camera", **more)
    return Stream(wish, show, None, lambda: engine)


def steps(task, until, limit_s=20.0):
    """Step a task until something is so; what it yielded."""
    end, found = time.monotonic() + limit_s, []
    while not until() and time.monotonic() < end:
        found.append(next(task))
    assert until()
    return found


def test_frames_are_shown_with_their_answer_while_the_solver_is_quick():
    shown, source = [], Clockwork(0.02)
    one = stream(source, Told(), shown)
    task = one.task()
    steps(task, lambda: len(shown) > 12)
    task.close()
    assert source.closed == 1
    late = shown[6:]
    assert sum(update is not None for _, update in late) >= len(late) - 1
    numbers = [number for number, _ in shown]
    assert numbers == sorted(numbers)


def test_frames_are_shown_without_one_while_the_solver_is_slow():
    shown = []
    one = stream(Clockwork(0.02), Told(lambda _: refusal(), slow_s=0.3), shown)
    task = one.task()
    steps(task, lambda: one.latest is not None)
    task.close()
    assert sum(update is None for _, update in shown) > 5


def test_a_frame_whose_answer_takes_longer_than_thought_is_shown_alone():
    shown, engine = [], Told()
    one = stream(Clockwork(0.05), engine, shown)
    task = one.task()
    steps(task, lambda: len(shown) > 6)
    engine.update = _ponder
    before = len(shown)
    steps(task, lambda: any(update is None for _, update in shown[before:]))
    task.close()


def _ponder(frame, time_utc=None):
    while True:
        time.sleep(0.01)
        yield Progress("identify", 0.5)


def test_an_unplugged_camera_ends_it_with_one_sentence():
    one = stream(Clockwork(0.01, frames=3), Told())
    with pytest.raises(LineLostError, match=r"^The camera was unplugged\.$"):
        run(one.task())
    assert one.latest is not None


class Doubting(Told):
    """Answers every frame, with the doubt that ``doubt(number)`` says of the camera's profile."""

    def __init__(self, doubt):
        super().__init__()
        self.doubt = doubt

    def update(self, frame, time_utc=None):
        track = yield from super().update(frame, time_utc)
        return replace(track, doubt=self.doubt(self.seen[-1]))


def test_a_doubt_about_the_lens_stays_until_a_frame_agrees():
    sentence = "This frame says something else."
    engine = Doubting(lambda n: sentence if n == 2 else "")
    engine.profile = replace(new_profile("lens", CAMERA), frames=5)
    one = stream(Clockwork(0.03), engine)
    task = one.task()
    steps(task, lambda: one.latest is not None and one.latest.shot.number >= 4)
    assert one.lens.doubt == sentence
    engine.profile = replace(engine.profile, frames=6)
    steps(task, lambda: one.latest.shot.number >= 6)
    assert one.lens.doubt == ""
    assert one.lens.profile.frames == 6
    task.close()


def test_what_was_learned_of_the_lens_is_kept_at_the_end():
    class Profiled(Told):
        def keep(self):
            super().keep()
            return "path"

    engine = Profiled()
    one = stream(Clockwork(0.01), engine, profile="guide scope")
    task = one.task()
    steps(task, lambda: one.latest is not None)
    task.close()
    assert engine.kept == 1
    assert any("guide scope" in sentence for sentence in one.messages)


# recording ----------------------------------------------------------------------------------------
def updates():
    shown = []
    task = stream(Clockwork(0.01, size=(4, 6)), Told(), shown).task()
    steps(task, lambda: len([u for _, u in shown if u]) > 4)
    task.close()
    return [update for _, update in shown if update is not None]


def test_recording_follows_the_switch_in_the_middle_of_a_stream(tmp_path):
    some = updates()
    recording = Recording(lambda u: {"solved": True}, {"camera": "a camera"})
    assert recording.take(some[0]) == []
    recording.folder = tmp_path
    recording.take(some[1])
    recording.take(some[2])
    assert recording.recorder.recording
    assert recording.recorder.free_bytes > 0
    recording.folder = None
    (said,) = recording.take(some[3])
    assert "2 frames" in said
    (folder,) = tmp_path.iterdir()
    assert json.loads((folder / "session.json").read_text())["camera"] == "a camera"
    assert len(list(folder.glob("*.fits"))) == 2
    assert len((folder / "solutions.jsonl").read_text().splitlines()) == 2
    assert recording.close() == []


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path):
    (tmp_path / "file").write_text("in the way")
    recording = Recording(lambda u: {}, {})
    recording.folder = tmp_path / "file"
    (said,) = recording.take(updates()[0])
    assert "Can't record to" in said
    assert recording.recorder is recording.folder is None


def test_a_disk_that_fills_ends_the_recording_and_not_the_stream(tmp_path, monkeypatch):
    recording = Recording(lambda u: {}, {})
    recording.folder = tmp_path
    some = updates()
    recording.take(some[0])
    monkeypatch.setattr("kochab.workflows.live.session.KEEP_FREE_BYTES", 10**18)
    recording.recorder._keep_free_bytes = 10**18
    (said,) = recording.take(some[1])
    assert "stopped after 1 frames" in said
    assert recording.take(some[2]) == []
    assert recording.folder is None
    assert not recording.recorder.recording


# the chart ----------------------------------------------------------------------------------------
def test_the_map_is_an_ellipse_with_east_to_the_left():
    middle, east, west, pole = hammer(
        unit_vectors(np.array([40.0, 70.0, 10.0, 0.0]), np.array([0.0, 0.0, 0.0, 90.0])), 40.0
    )
    assert middle == pytest.approx([0, 0], abs=1e-12)
    assert east[0] < 0 < west[0]
    assert pole == pytest.approx([0, 1], abs=1e-6)
    rng = np.random.default_rng(3)
    x, y = hammer(rng.normal(size=(500, 3)), 123.0).T
    assert ((x / 2) ** 2 + y**2 <= 1 + 1e-9).all()


def test_the_map_keeps_areas():
    n = 20_000
    rng = np.random.default_rng(4)
    v = rng.normal(size=(n, 3))
    x, y = hammer(v / np.linalg.norm(v, axis=1, keepdims=True), 0.0).T
    inner = ((x / 2) ** 2 + y**2 < 0.25).mean()
    assert inner == pytest.approx(0.25, abs=0.015)


def test_a_line_over_the_edge_of_the_map_is_cut():
    across = unit_vectors(np.linspace(170.0, 190.0, 21), np.full(21, 10.0))
    assert len(pieces(hammer(across, 0.0))) == 2
    assert len(pieces(hammer(across, 180.0))) == 1


def test_a_trail_stays_small_and_keeps_its_ends():
    trail = Trail()
    for ra in np.linspace(0.0, 359.0, 3 * MOST):
        trail.add(unit_vectors(ra, 20.0))
    assert len(trail.points) <= MOST
    assert radec_deg(trail.points[0])[0] == pytest.approx(0.0, abs=1e-9)
    assert radec_deg(trail.points[-1])[0] == pytest.approx(359.0, abs=0.2)
    trail.add(trail.here)
    trail.clear()
    assert len(trail.points) == 0


def test_the_chart_knows_bright_stars_and_figures():
    points = run(sky_points(open_catalogue))
    assert 300 < len(points.stars) < 1500
    assert len(points.strokes) > 500
    dubhe_merak = unit_vectors(np.array([165.93, 165.46]), np.array([61.75, 56.38]))
    near = points.strokes @ dubhe_merak.T > np.cos(np.radians(0.1))  # (M, ends, stars)
    assert near.any(axis=1).all(axis=1).any(), "the pointers are a line of the Great Bear"
