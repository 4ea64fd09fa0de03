"""``kochab telescope`` from the outside: a practice mount and a folder of frames, offered to programs."""

import json
import shutil
import signal
import subprocess
import sys

import pytest

from kochab.cli.main import main
from kochab.core.attitude import apart_deg
from tests.server.telescope.conftest import Program, wait_for
from tests.server.telescope.test_offered import degrees_of


@pytest.fixture
def start(repository):
    """Starts commands, and leaves none behind."""
    started = []

    def begin(*arguments):
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        process = subprocess.Popen([sys.executable, "-m", "app", *arguments], text=True, cwd=repository, **pipes)
        started.append(process)
        return process, json.loads(process.stdout.readline() or "{}")

    yield begin
    for process in started:
        process.kill()
        process.communicate()


def test_a_goto_goes_through_the_guard_and_moves_a_practice_mount(start) -> None:
    _, night = start("practice", "--socket", "--json", "--lost", "0", "--rate", "1")  # where it is midnight
    site = ",".join(map(str, night["site"][:2]))
    offered, ready = start(
        "telescope",
        "--port",
        night["port"],
        "--driver",
        "lx200",
        "--site",
        site,
        "--offer",
        "lx200=0",
        "--json",
        "--yes",
    )
    assert ready["host"] == "127.0.0.1"
    meade = Program(ready["ports"]["lx200"])

    def here():
        return degrees_of(meade.ask(":GR#"), meade.ask(":GD#"))

    def goto(place):
        hours = place[0] % 360.0 / 15.0
        ra = f":Sr{int(hours):02d}:{int(hours * 60) % 60:02d}:00#"
        dec = f":Sd{'-' if place[1] < 0 else '+'}{int(abs(place[1])):02d}*00:00#"
        assert meade.ask(ra, 1) + meade.ask(dec, 1) == b"11"
        answer = meade.ask(":MS#", 1)
        return answer if answer == b"0" else answer + meade.hear()

    with meade.line:
        assert wait_for(lambda: here() != degrees_of(b"00:00:00#", b"+00*00:00#"))  # the mount's first answer
        before = here()
        refused = goto((before[0], -60.0))  # never rises at 40 degrees north
        assert refused.startswith(b"1")
        assert b"below" in refused or b"horizon" in refused
        assert apart_deg(here(), before) < 0.1  # nothing moved
        target = (before[0], before[1] - 4.0 if before[1] > 0 else before[1] + 4.0)
        assert goto(target) == b"0"
        assert b"\x7f" in meade.ask(":D#")
        assert wait_for(lambda: meade.ask(":D#") == b"#", 60.0)
        assert apart_deg(here(), (target[0], int(target[1]))) < 0.3  # minutes of time were cut off
        assert meade.ask(":CM#") == b"Coordinates matched.        #"
        said = []
        while "Synced. Undo takes it back." not in said:
            said.append(json.loads(offered.stdout.readline()).get("text", ""))
        meade.say(":Q#")
        while "LX200 (127.0.0.1) stopped the mount." not in said:
            said.append(json.loads(offered.stdout.readline()).get("text", ""))
    offered.send_signal(signal.SIGTERM)
    out, err = offered.communicate(timeout=120)
    said += [json.loads(line).get("text", "") for line in out.splitlines()]
    assert any("connected" in sentence for sentence in said)
    assert any("go to RA" in sentence for sentence in said)
    assert "Traceback" not in err


def test_frames_saved_to_a_folder_show_where_the_telescope_points(start, repository, tmp_path) -> None:
    offered, ready = start("telescope", "--folder", str(tmp_path), "--offer", "lx200=0", "--json", "--target", "M 42")
    shutil.copy(repository / "resources" / "samples" / "pleiades.fits", tmp_path)
    meade = Program(ready["ports"]["lx200"])
    with meade.line:
        assert wait_for(lambda: meade.ask(":GR#") != b"00:00:00#", 120.0)
        place = degrees_of(meade.ask(":GR#"), meade.ask(":GD#"))
    assert apart_deg(place, (56.75, 24.12)) < 3.0  # M 45 is in the sample
    assert offered.poll() is None
    events = iter(lambda: json.loads(offered.stdout.readline()), None)
    way = next(event for event in events if event["event"] == "push")
    assert way["distance_deg"] == pytest.approx(apart_deg((56.75, 24.12), (83.82, -5.39)), abs=3.0)
    assert way["text"].endswith(" south.")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((), "Give what points"),
        (("--folder", ".", "--offer", "nexstar"), "no protocol"),
        (("--folder", ".", "--offer", "lx200=99999"), "is not a port"),
        (("--folder", ".", "--source", "webcam"), "Give either"),
    ],
)
def test_what_cannot_be_is_one_sentence(capsys, arguments, sentence) -> None:
    assert main(["telescope", *arguments]) == 2
    told = capsys.readouterr().err
    assert sentence in told
    assert told.count("\n") == 1
