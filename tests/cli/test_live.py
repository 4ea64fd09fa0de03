"""``kochab live`` and ``kochab camera`` as a person runs them, in a process of their own."""

import json
import shutil
import signal
import subprocess
import sys
import time

import pytest

from kochab.cli.main import main
from kochab.frames import read_frame
from kochab.frames.fits_write import write_fits
from tests.workflows.live_sky import sky_frame


@pytest.fixture(scope="module")
def night(tmp_path_factory):
    """Four frames half a minute apart whose pointing drifts east by 20 arcsec a minute."""
    folder = tmp_path_factory.mktemp("night")
    for k in range(4):
        frame = sky_frame(ra_deg=84.0 + k * 10.0 / 3600, dec_deg=0.0, seconds=30.0 * k, seed=k)
        write_fits(frame, folder / f"light-{k}.fits")
    return sorted(folder.iterdir())


@pytest.fixture(scope="module")
def session(night, tmp_path_factory):
    """A stream from a folder we write into, recorded; its printed lines and how it ended."""
    folder = tmp_path_factory.mktemp("watched")
    recorded = tmp_path_factory.mktemp("recorded") / "session"
    run = started(
        "live",
        "--source",
        "folder",
        "--address",
        folder,
        "--json",
        "--fov",
        "12",
        "--frames",
        "4",
        "--record",
        recorded,
    )
    lines = []
    try:
        for frame in night:
            shutil.copy(frame, folder)
            lines.append(json.loads(run.stdout.readline()))
        rest, err = run.communicate(timeout=60)
    finally:
        run.kill()
    assert rest == ""
    assert run.returncode == 0, err
    assert "4 of 4 frames solved" in err
    return lines, recorded


def started(*arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "app", *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def kochab(*arguments, timeout=120):
    return subprocess.run(
        [sys.executable, "-m", "app", *map(str, arguments)], capture_output=True, text=True, timeout=timeout
    )


def test_a_line_for_every_frame_with_its_age(session) -> None:
    lines, _ = session
    for k, line in enumerate(lines):
        assert line["solved"]
        assert line["ra_deg"] == pytest.approx(84.0 + k * 10 / 3600, abs=0.003)
        assert line["age_s"] > 1e5  # the frames are of another night, and it says so
        assert line["latency_ms"] > 0
        assert line["last_good"]["frame"] == line["frame"] == k + 1
    drift = lines[-1]["drift_arcsec_min"]
    assert drift["ra"] == pytest.approx(20.0, abs=4.0)
    assert drift["dec"] == pytest.approx(0.0, abs=4.0)


def test_a_recording_is_replayed_with_the_same_answers(session) -> None:
    _, recorded = session
    about = json.loads((recorded / "session.json").read_text())
    assert (about["frames"], about["solved"], about["source"]) == (4, 4, "folder")
    done = kochab("live", "--replay", recorded, "--json")
    assert done.returncode == 0, done.stderr
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [line["agrees"] for line in lines] == [True] * 4
    assert all(line["intact"] and line["apart_arcsec"] < 1.0 for line in lines)


def test_a_frame_changed_after_recording_is_told(session, tmp_path, capsys) -> None:
    _, recorded = session
    copy = shutil.copytree(recorded, tmp_path / "copy")
    frame = read_frame(copy / "frame-000002.fits")
    frame.pixels[0, 0] += 1
    write_fits(frame, copy / "frame-000002.fits")
    assert main(["live", "--replay", str(copy)]) == 1
    said = capsys.readouterr().out.splitlines()
    assert ["CHANGED" in line for line in said] == [False, True, False, False]
    (copy / "frame-000003.fits").unlink()
    assert main(["live", "--replay", str(copy)]) == 2
    assert "frame-000003.fits of the session: missing" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no interrupt to a process without a console")
def test_ctrl_c_ends_it_at_once_and_cleanly(night, tmp_path) -> None:
    folder = tmp_path / "watched"
    folder.mkdir()
    write_fits(read_frame(night[0]), folder / "one.fits")
    run = started("live", "--address", folder, "--fov", "12")
    try:
        first = run.stdout.readline()
        run.send_signal(signal.SIGINT)
        _, err = run.communicate(timeout=60)
    finally:
        run.kill()
    assert "stars" in first
    assert run.returncode == 0
    assert "1 of 1 frames solved" in err
    assert "Traceback" not in err


def test_a_folder_taken_away_is_one_sentence(tmp_path) -> None:
    folder = tmp_path / "watched"
    folder.mkdir()
    run = started("live", "--address", folder, "--json")
    try:
        time.sleep(1.0)
        folder.rmdir()
        out, err = run.communicate(timeout=60)
    finally:
        run.kill()
    assert run.returncode == 1
    error = json.loads(out)["error"]
    assert str(folder) in error
    assert "Traceback" not in err


def test_one_sentence_for_what_cannot_be_used(tmp_path, capsys) -> None:
    assert main(["live", "--source", "folder", "--address", str(tmp_path / "no")]) == 1
    assert "does not exist" in capsys.readouterr().err
    assert main(["live", "--source", "nothing"]) == 2
    assert "There is no camera source 'nothing'" in capsys.readouterr().err
    assert main(["live", "--replay", str(tmp_path)]) == 2
    assert "is not a recorded session" in capsys.readouterr().err
    assert main(["live", "--frames", "0"]) == 2
    assert main(["live", "--exposure", "-1"]) == 2
    (tmp_path / "session.json").write_text("{}")
    assert main(["live", "--address", str(tmp_path), "--record", str(tmp_path)]) == 2
    assert "already has a session" in capsys.readouterr().err


def test_every_source_is_listed_with_what_it_needs(capsys) -> None:
    from kochab.gear.cameras import SOURCES

    assert main(["camera", "list", "--json"]) == 0
    told = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [t["source"] for t in told] == list(SOURCES)
    assert main(["live", "--list"]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in SOURCES)


def test_one_frame_is_taken(night, tmp_path, capsys) -> None:
    target = tmp_path / "taken.fits"
    folder = night[0].parent
    assert main(["camera", "take", "--source", "folder", "--address", str(folder), "-o", str(target), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["width"], told["height"]) == (800, 600)
    assert (read_frame(target).pixels == read_frame(night[3]).pixels).all()
    again = ["camera", "take", "--source", "folder", "--address", str(folder), "-o", str(target)]
    assert main(again) == 2
    assert "exists already" in capsys.readouterr().err
    assert main([*again, "--overwrite"]) == 0
    assert main(["camera", "take", "--source", "folder", "--address", str(tmp_path / "no"), "-o", str(target)]) == 1


def test_a_frame_that_came_while_the_computer_was_busy_is_taken(night, tmp_path, monkeypatch) -> None:
    clock, came = [0.0], [None, read_frame(night[3])]

    class Busy:
        def next_frame(self, timeout_s):
            clock[0] += 100.0  # far longer than asked for, and than --wait
            return came.pop(0)

        def close(self):
            pass

    monkeypatch.setattr("kochab.gear.cameras.open_camera", lambda *words: Busy())
    monkeypatch.setattr("kochab.cli.live.monotonic", lambda: clock[0])
    target = tmp_path / "taken.fits"
    assert main(["camera", "take", "--source", "folder", "-o", str(target)]) == 0
    assert target.exists()
    came[:] = [None, None]
    assert main(["camera", "take", "--source", "folder", "-o", str(target), "--overwrite"]) == 1


def test_no_frame_is_taken_over_the_one_it_comes_from(night, capsys) -> None:
    before = night[3].read_bytes()
    address = ("--address", str(night[0].parent))
    take = ["camera", "take", "--source", "folder", *address, "-o", str(night[3]), "--overwrite"]
    assert main(take) == 2
    assert "never overwritten" in capsys.readouterr().err
    assert night[3].read_bytes() == before


def test_the_watched_folder_is_not_recorded_into(night, capsys) -> None:
    folder = night[0].parent
    for record in (folder, folder / "session"):
        assert main(["live", "--address", str(folder), "--record", str(record)]) == 2
        assert "is inside the watched folder" in capsys.readouterr().err
    assert sorted(folder.iterdir()) == night


@pytest.mark.parametrize(
    ("target", "says"), [("shot.png", "written as FITS, name it .fits"), ("none/shot.fits", "there is no folder")]
)
def test_where_a_frame_cannot_go_is_told_before_the_exposure(target, says, tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.setattr("kochab.gear.cameras.open_camera", None)  # it is never opened
    asked = ["camera", "take", "--source", "simulated", "-o", str(tmp_path / target), "--json"]
    assert main(asked) == 2
    out, err = capsys.readouterr()
    assert says in (json.loads(out)["error"] if out else err)


def test_only_the_source_that_was_named_is_listed(capsys) -> None:
    assert main(["live", "--list", "--source", "folder", "--json"]) == 0
    assert [json.loads(line)["source"] for line in capsys.readouterr().out.splitlines()] == ["folder"]


def test_a_folder_is_asked_for(capsys) -> None:
    assert main(["live"]) == 2
    assert "--address DIR" in capsys.readouterr().err
    assert main(["live", "--address", "x", "--gain", "nan"]) == 2
    assert "nan is not a number" in capsys.readouterr().err
