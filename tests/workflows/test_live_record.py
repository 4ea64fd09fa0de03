"""Recording: what is written, when it ends by itself, and what a damaged session says."""

import json
import shutil
import sys
from collections import namedtuple
from datetime import UTC, datetime

import pytest

from kochab.core.errors import UsageError
from kochab.core.frame import Hint, Site
from kochab.core.progress import Progress
from kochab.frames import read_frame
from kochab.solver import SolveOptions
from kochab.workflows.live.capture import Capture
from kochab.workflows.live.session import Recorder, options_from, options_json, read_session, recorded, session_folder
from kochab.workflows.live.solve import live_solve
from kochab.workflows.live.update import LiveUpdate

from .live_sources import Clockwork, Told, refusal, solution

Usage = namedtuple("Usage", "total used free")


def line(update):
    return {"solved": update.track.solution is not None, "frame": update.shot.number}


def stream(recorder, frames=3, engine=None):
    live = live_solve(Capture(lambda: Clockwork(every_s=0.001)), engine or Told(), frames)
    return list(recorded(live, recorder))


def test_every_frame_has_its_file_its_line_and_its_hash(tmp_path) -> None:
    import hashlib

    folder = tmp_path / "new" / "session"
    recorder = Recorder(folder, line, {"source": "clockwork"})
    answers = Told(lambda n: solution() if n % 2 else refusal())
    steps = stream(recorder, 4, answers)
    assert not recorder.recording
    about, lines = read_session(folder)
    assert about["source"] == "clockwork"
    assert about["frames"] == 4
    assert about["solved"] == sum(row["solved"] for row in lines)
    updates = [s for s in steps if isinstance(s, LiveUpdate)]
    assert len(lines) == len(updates) == 4
    for row, update in zip(lines, updates, strict=True):
        path = folder / row["frame_file"]
        assert hashlib.sha256(path.read_bytes()).hexdigest() == row["sha256"]
        assert (read_frame(path).pixels == update.shot.frame.pixels).all()
        assert row["time_utc"] == update.track.time_utc.isoformat()


def test_a_nearly_full_disk_ends_the_recording_and_not_the_stream(tmp_path, monkeypatch) -> None:
    recorder = Recorder(tmp_path / "s", line)
    left = iter([10**10, 10**10] + [10**6] * 10)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: Usage(0, 0, next(left)))
    steps = stream(recorder, 5)
    assert sum(isinstance(s, LiveUpdate) for s in steps) == 5
    said = [s.detail for s in steps if isinstance(s, Progress) and s.stage == "warning"]
    assert len(said) == 1
    assert "stopped after 2 frames" in said[0]
    assert "MB free" in said[0]
    assert read_session(tmp_path / "s")[0]["frames"] == 2
    with pytest.raises(UsageError, match=r"1 MB free \(500 MB is kept free\)"):
        Recorder(tmp_path / "t", line)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not delete a folder with open files")
def test_a_folder_that_goes_ends_the_recording_and_not_the_stream(tmp_path) -> None:
    recorder = Recorder(tmp_path / "s", line)
    shutil.rmtree(tmp_path / "s")
    steps = stream(recorder, 3)
    assert sum(isinstance(s, LiveUpdate) for s in steps) == 3
    said = [s.detail for s in steps if isinstance(s, Progress) and s.stage == "warning"]
    assert len(said) == 1
    assert "stopped after 0 frames" in said[0]


def test_stopping_the_stream_closes_the_session(tmp_path) -> None:
    recorder = Recorder(tmp_path / "s", line)
    live = recorded(live_solve(Capture(lambda: Clockwork(every_s=0.001)), Told()), recorder)
    next(s for s in live if isinstance(s, LiveUpdate))
    live.close()
    about, lines = read_session(tmp_path / "s")
    assert about["frames"] == len(lines) == 1


def test_a_second_session_is_not_written_over_the_first(tmp_path) -> None:
    Recorder(tmp_path, line).close()
    with pytest.raises(UsageError, match="already has a session"):
        Recorder(tmp_path, line)
    now = datetime(2026, 3, 1, 22, 0, 5, tzinfo=UTC)
    first = session_folder(tmp_path, now)
    assert first.name == "kochab-2026-03-01T22-00-05Z"
    first.mkdir()
    assert session_folder(tmp_path, now).name == "kochab-2026-03-01T22-00-05Z-2"


def test_a_folder_with_files_in_it_is_not_recorded_into(tmp_path) -> None:
    mine = tmp_path / "frame-000001.fits"
    mine.write_bytes(b"a night's work")
    with pytest.raises(UsageError, match="is not empty"):
        Recorder(tmp_path, line)
    assert [path.name for path in tmp_path.iterdir()] == [mine.name]
    assert mine.read_bytes() == b"a night's work"


def test_a_frame_of_another_program_ends_the_recording(tmp_path) -> None:
    recorder = Recorder(tmp_path, line)
    mine = tmp_path / "frame-000002.fits"
    mine.write_bytes(b"a night's work")
    steps = stream(recorder, 3)
    said = [s.detail for s in steps if isinstance(s, Progress) and s.stage == "warning"]
    assert len(said) == 1
    assert "stopped after 1 frames" in said[0]
    assert mine.read_bytes() == b"a night's work"


def test_a_line_cut_off_at_the_end_is_left_out_and_one_amid_is_told(tmp_path) -> None:
    stream(Recorder(tmp_path, line), 3)
    path = tmp_path / "solutions.jsonl"
    rows = path.read_text().splitlines()
    path.write_text("\n".join([*rows[:2], rows[2][:20]]))
    assert len(read_session(tmp_path)[1]) == 2
    path.write_text("\n".join([rows[0], "{", rows[2]]))
    with pytest.raises(UsageError, match=r"Line 2 of .* is damaged"):
        read_session(tmp_path)


def test_the_options_come_back_as_they_were() -> None:
    hint = Hint((1.0, 2.0), (10.0, 20.0, 3.0), datetime(2026, 1, 2, tzinfo=UTC), 1.5, Site(1.0, 2.0), "c")
    for options in (
        SolveOptions(),
        SolveOptions("triads", {"stars": 9}, hint=hint, fov_deg=3.0, timeout_s=None),
        SolveOptions(attitude="quest", timeout_s=3, worst_px=1.5),
    ):
        told = json.loads(json.dumps(options_json(options)))
        assert options_from({**told, "of a later version": 1}) == options


@pytest.mark.parametrize(
    "told",
    [
        [1],
        {"timeout_s": "soon"},
        {"method": None},
        {"distortion": 1},
        {"method_options": [1]},
        {"hint": {"site": {"x": 1}}},
        {"hint": {"time_utc": "tonight"}},
        {"hint": "north"},
        {"max_stars": True},
    ],
)
def test_damaged_settings_are_one_sentence(told) -> None:
    with pytest.raises(UsageError, match="settings are damaged"):
        options_from(told)
