"""``kochab practice`` from the outside: what it prints, what it obeys, how it ends."""

import json
import signal
import subprocess
import sys

import pytest

from kochab.cli.main import main


@pytest.fixture
def start(repository):
    """Starts practice telescopes, and leaves none behind."""
    started = []

    def begin(*arguments):
        started.append(
            subprocess.Popen(
                [sys.executable, "-m", "app", "practice", "--socket", *arguments],
                text=True,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                cwd=repository,
            )
        )
        return started[-1]

    yield begin
    for process in started:
        process.kill()
        process.communicate()


def test_json_tells_where_to_connect_and_the_score(start, tmp_path) -> None:
    process = start(
        "--json",
        "--seed",
        "2",
        "--misalign",
        "30",
        "--rate",
        "20",
        "--folder",
        str(tmp_path / "frames"),
        "--site",
        "-33,151",
    )
    ready = json.loads(process.stdout.readline())
    assert ready["event"] == "ready"
    assert ready["port"].startswith("socket://127.0.0.1:")
    assert ready["site"][:2] == [-33.0, 151.0]
    out, err = process.communicate("alt 3\nnonsense\nquit\n", timeout=60)
    told = [json.loads(line) for line in out.splitlines()]
    assert told[0] == {"event": "done", "text": "Altitude bolt turned."}
    assert "nonsense" in told[1]["error"]
    assert told[-1]["event"] == "score"
    assert told[-1]["pointing_arcsec"] > 3600.0
    assert 20 * 60 < told[-1]["axis_arcsec"] < 40 * 60
    assert err == ""
    assert process.returncode == 0


@pytest.mark.skipif(sys.platform == "win32", reason="a console interrupt cannot be sent to a pipe here")
def test_ctrl_c_ends_cleanly_with_the_score(start) -> None:
    process = start()
    lines = [process.stdout.readline() for _ in range(4)]
    assert "kochab mount goto M42" in lines[3]
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert out.splitlines()[-1].startswith("Score ")
    assert "Traceback" not in err
    assert process.returncode == 0


@pytest.mark.parametrize(
    "arguments",
    [
        ["--site", "95,3"],
        ["--site", "x"],
        ["--misalign", "-1"],
        ["--lost", "400"],
        ["--rate", "0"],
        ["--fov", "90"],
        ["--driver", "tractor"],
    ],
)
def test_bad_arguments_are_one_sentence(arguments, capsys) -> None:
    assert main(["practice", *arguments]) == 2
    told = capsys.readouterr().err.strip()
    assert "Traceback" not in told
    assert len(told.splitlines()) == 1


@pytest.mark.parametrize(
    ("option", "value", "says"),
    [
        ("--rate", "1e308", "1e308 is not between 0.1 and 1000 times"),
        ("--rate", "nan", "nan is not a number"),
        ("--exposure", "0", "0 is not between 0.001 and 600 s"),
        ("--seed", "-1", "-1 is not a whole number, 0 or more"),
        ("--lost", "91", "91 is not between 0 and 90 deg"),
    ],
)
def test_every_number_has_its_bounds(option, value, says, capsys) -> None:
    assert main(["practice", f"{option}={value}"]) == 2
    assert says in capsys.readouterr().err
