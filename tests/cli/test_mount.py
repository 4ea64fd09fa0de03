"""``kochab mount``: a preview first, a failure in one sentence, and exit codes that tell."""

import json
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta

import pytest

from kochab.cli import mount as mount_cli
from kochab.cli.main import main
from kochab.core.attitude import apart_deg
from kochab.core.frame import Site
from kochab.core.mount import TrackingRate
from kochab.gear.mounts import DRIVERS, probe
from kochab.gear.mounts.drivers import lx200
from kochab.simulate.responders import open_responder
from kochab.sky.horizon import sidereal_deg
from tests.simulate.bench_telescope import BenchTelescope
from tests.simulate.lines import serve

SITE = Site(50.0, 8.0)


@pytest.fixture(autouse=True)
def _impatient(monkeypatch):
    monkeypatch.setattr(lx200, "PRODUCT_S", 0.5)
    monkeypatch.setattr(probe, "PATIENCE_S", 0.6)


@contextmanager
def simulated(driver):
    """A telescope that believes to point at the pole star's neighbourhood, on a line."""
    telescope = BenchTelescope(SITE.latitude_deg, SITE.longitude_deg, 60.0)
    telescope.sync((sidereal_deg(SITE, datetime.now(UTC)) + 90.0) % 360.0, 85.0)
    telescope.log.clear()
    with serve(open_responder(driver, telescope)) as port:
        yield telescope, port


def run(capsys, *arguments):
    code = main(["mount", *arguments, "--json"])
    out = capsys.readouterr().out
    return code, json.loads(out)


@pytest.mark.parametrize("driver", ["onstep", "ioptron"])
def test_park_unpark_home_and_track_are_previewed_then_done(capsys, driver) -> None:
    with simulated(driver) as (telescope, port):
        line = ("--port", port, "--driver", driver, "--site", "50,8")
        for action in ("park", "home"):
            code, told = run(capsys, action, *line)
            assert (code, told["done"], told["preview"]["allowed"], telescope.log) == (0, False, True, [])
        code, told = run(capsys, "park", *line, "--yes")
        assert (code, told["done"], told["state"]["parked"], telescope.parked) == (0, True, True, True)
        code, told = run(capsys, "home", *line, "--yes")
        assert (code, "unpark it" in told["error"]) == (1, True)
        code, told = run(capsys, "unpark", *line, "--yes")
        assert (code, told["state"]["parked"], telescope.parked) == (0, False, False)
        code, told = run(capsys, "home", *line, "--yes")
        assert (code, told["state"]["at_home"]) == (0, True)
        code, told = run(capsys, "track", "lunar", *line)
        assert (code, told["done"], telescope.tracking) == (0, False, False)
        code, told = run(capsys, "track", "lunar", *line, "--yes")
        assert (code, told["rate"], told["state"]["rate"]) == (0, "lunar", "lunar")
        assert telescope.tracking_deg_s == TrackingRate.LUNAR.deg_s


def test_syncs_by_hand_of_one_program_after_the_other_count_together(capsys) -> None:
    """Four of six degrees added up to 24, each measured against the last."""
    with simulated("onstep") as (telescope, port):
        telescope.sync((sidereal_deg(SITE, datetime.now(UTC)) + 60.0) % 360.0, 60.0)
        line = ("--port", port, "--driver", "onstep", "--site", "50,8", "--yes")

        def sync(dec_deg, *more):
            return run(
                capsys, "sync", "--ra-deg", str(telescope.believed_deg()[0]), "--dec-deg", str(dec_deg), *line, *more
            )

        assert [sync(dec)[0] for dec in (54.0, 48.0, 42.0)] == [0, 0, 0]
        code, told = sync(36.0)
        assert (code, "With this night's syncs by hand" in told["error"]) == (1, True)
        assert telescope.believed_deg()[1] == pytest.approx(42.0, abs=0.3)
        assert sync(36.0, "--arm")[0] == 0


def test_a_wrong_clock_is_told_refused_and_set(capsys) -> None:
    telescope = BenchTelescope(SITE.latitude_deg, SITE.longitude_deg, 60.0)
    telescope.sync((sidereal_deg(SITE, datetime.now(UTC)) + 90.0) % 360.0, 85.0)
    responder = open_responder("onstep", telescope)
    responder.settings.clock_error = timedelta(hours=2)
    with serve(responder) as port:
        line = ("--port", port, "--driver", "onstep", "--site", "50,8")
        there = ("--ra-deg", str((sidereal_deg(SITE, datetime.now(UTC)) + 60.0) % 360.0), "--dec-deg", "80")
        wrong = "its clock is 2.0 h fast (summer time or zone?)"
        code, told = run(capsys, "goto", *there, *line, "--yes")
        assert (code, wrong in told["error"], telescope.slewing) == (1, True, False)
        code, told = run(capsys, "goto", *there, *line, "--trust-mount")
        assert (code, told["preview"]["allowed"]) == (0, True)
        for yes in ((), ("--yes",)):
            code, told = run(capsys, "set-clock", *line, *yes)
            assert (code, told["done"], wrong in told["clock_doubt"]) == (0, bool(yes), not yes)
        code, told = run(capsys, "goto", *there, *line)
        assert (code, told["preview"]["allowed"]) == (0, True)


def test_what_the_mount_has_no_command_for_is_refused_in_one_sentence(capsys) -> None:
    with simulated("nexstar") as (telescope, port):
        for action in (("park",), ("home",), ("unpark",), ("track", "lunar")):
            code, told = run(capsys, *action, "--port", port, "--driver", "nexstar", "--yes")
            assert (code, list(told)) == (1, ["error"])
            assert told["error"].endswith("use its menu.")
        assert telescope.log == []
    assert main(["mount", "track", "fast"]) == 2


def test_position_is_icrs_and_the_mounts_own(capsys) -> None:
    with simulated("nexstar") as (telescope, port):
        code, told = run(capsys, "position", "--port", port, "--driver", "nexstar")
        assert code == 0
        assert told["epoch"] == "of date"
        believed = telescope.believed_deg()
        assert apart_deg((told["mount_ra_deg"], told["mount_dec_deg"]), believed) < 0.001
        assert 0.02 < apart_deg((told["ra_deg"], told["dec_deg"]), believed) < 0.5
        assert told["state"]["aligned"] is True
        assert {"park", "unpark", "go home", "lunar rate"} < set(told["lacks"])


def test_position_tells_when_the_mount_speaks_in_the_other_epoch(capsys) -> None:
    with simulated("ioptron") as (telescope, port):
        telescope.sync(sidereal_deg(SITE, datetime.now(UTC)), 0.0)  # 20 arcmin everywhere there
        line = ["--port", port, "--driver", "ioptron"]
        assert run(capsys, "position", *line)[1]["epoch_doubt"] == ""
        doubt = run(capsys, "position", *line, "--epoch", "J2000")[1]["epoch_doubt"]
        assert doubt.endswith("not J2000. Choose the epoch date (--epoch date).")
        assert main(["mount", "position", *line, "--epoch", "J2000"]) == 0
        assert doubt in capsys.readouterr().out


def test_position_for_people(capsys) -> None:
    with simulated("lx200") as (_, port):
        assert main(["mount", "position", "--port", port, "--driver", "lx200"]) == 0
        out = capsys.readouterr().out
        assert "Meade LX200 classic" in out
        assert "no guide pulse:" in out


def test_the_driver_is_found_when_it_is_left_out(capsys) -> None:
    with simulated("onstep") as (_, port):
        code, told = run(capsys, "position", "--port", port)
        assert (code, told["driver"]) == (0, "onstep")


def test_probe_names_the_mount(capsys) -> None:
    with simulated("ioptron") as (telescope, port):
        code, told = run(capsys, "probe", "--port", port)
        assert code == 0
        baud = 0 if port.startswith("socket:") else 115200  # a socket, where there are no pseudo-terminals, has none
        assert (told["ports"][0]["driver"], told["ports"][0]["baud"]) == ("ioptron", baud)
        assert not telescope.log
        assert main(["mount", "probe", "--port", port]) == 0
        assert f"--port {port} --driver ioptron{f' --baud {baud}' if baud else ''}" in capsys.readouterr().out


def test_probe_says_what_to_do(capsys) -> None:
    code, told = run(capsys, "probe", "--port", "/dev/ttyUSB55")
    assert code == 1
    assert "plug in the USB cable" in told["ports"][0]["advice"]


def test_list_names_ports_and_drivers(capsys) -> None:
    code, told = run(capsys, "list")
    assert code == 0
    assert set(told["drivers"]) >= {"lx200", "skywatcher"}
    assert isinstance(told["ports"], list)


@pytest.mark.parametrize("action", ["goto", "sync"])
def test_without_yes_nothing_is_sent(action, capsys) -> None:
    with simulated("onstep") as (telescope, port):
        code, told = run(capsys, action, "Polaris", "--port", port, "--driver", "onstep", "--site", "50,8")
        assert code == 0
        assert told["done"] is False
        assert 0.0 < told["preview"]["offset_deg"] < 6.0
        assert telescope.log == []
        assert main(["mount", action, "Polaris", "--port", port, "--driver", "onstep"]) == 0
        assert "No site set" in capsys.readouterr().out


def test_goto_with_yes_arrives(capsys) -> None:
    with simulated("onstep") as (telescope, port):
        arguments = ["--port", port, "--driver", "onstep", "--site", "50,8", "--allow-flip", "--yes"]
        code, told = run(capsys, "goto", "HIP", "11767", *arguments)
        assert (code, told["done"]) == (0, True), told
        assert apart_deg((told["ra_deg"], told["dec_deg"]), (37.95, 89.264)) < 0.02
        assert [entry[0] for entry in telescope.log if entry[0] == "goto"] == ["goto"]


def test_sync_with_yes_is_read_back(capsys) -> None:
    with simulated("nexstar") as (telescope, port):
        ra, dec = telescope.believed_deg()
        where = ["--ra-deg", str(ra), "--dec-deg", str(dec - 1.0)]
        line = ["--port", port, "--driver", "nexstar", "--site", "50,8", "--yes"]
        code, told = run(capsys, "sync", *where, *line)
        assert (code, told["done"]) == (0, True), told
        assert apart_deg((told["ra_deg"], told["dec_deg"]), (ra, dec - 1.0)) < 0.001


def test_a_refusal_is_an_error_and_exit_1(capsys) -> None:
    with simulated("nexstar") as (telescope, port):
        arguments = ["--ra-deg", "10", "--dec-deg", "-89", "--port", port, "--driver", "nexstar"]
        code, told = run(capsys, "goto", *arguments, "--site", "50,8", "--yes")
        assert code == 1
        assert set(told) == {"error"}
        assert telescope.log == []
        assert main(["mount", "goto", *arguments, "--site", "50,8", "--yes"]) == 1
        out, err = capsys.readouterr()
        assert out == ""
        assert err.startswith("kochab: ")
        assert err.count("\n") == 1


def test_a_stop_that_does_not_help_is_said_in_capitals(capsys) -> None:
    driver = "nexstar"
    with simulated(driver) as (telescope, port):
        telescope._slew_deg_s = 0.4
        telescope.turn_axis_to(1, 10.0)
        telescope.stop = lambda **_: None
        line = ["--port", port, "--driver", driver]
        code, told = run(capsys, "stop", *line)
        assert code == 1
        assert "THE MOUNT MAY STILL MOVE: CUT ITS POWER" in told["error"]
        assert telescope.slewing
        assert main(["mount", "stop", *line]) == 1
        assert "CUT ITS POWER" in capsys.readouterr().err


@pytest.mark.parametrize(("code", "stands"), [(0x00, True), (0xA5, True), (0x83, False)])
def test_stop_needs_no_word_of_a_motor_board(code, stands, capsys) -> None:
    """Neither its site nor its home; one that Kochab cannot turn is stopped, but not looked at."""
    telescope = BenchTelescope(SITE.latitude_deg, SITE.longitude_deg, 0.1)
    telescope.turn_axis_to(1, 20.0)
    board = open_responder("skywatcher", telescope)
    board.mount_code = code
    board.motors[1]._slewing_to = 20.0
    with serve(board) as port:
        ended, told = run(capsys, "stop", "--port", port, "--driver", "skywatcher")
    assert not telescope.slewing
    assert (ended, told) == (0, {"stopped": True}) if stands else "MAY STILL MOVE" in told["error"]


@pytest.mark.parametrize("driver", ["lx200", "nexstar", "ioptron"])
def test_stop_is_the_first_thing_sent(driver, capsys) -> None:
    with simulated(driver) as (telescope, port):
        telescope._slew_deg_s = 0.1
        telescope.turn_axis_to(1, 20.0)
        code, told = run(capsys, "stop", "--port", port, "--driver", driver, "--site", "50,8")
        assert (code, told) == (0, {"stopped": True})
        assert telescope.log[1] == ("stop",)
        assert not telescope.slewing
        assert DRIVERS.load(driver).blind_stop


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["goto"], "Give a target"),
        (["goto", "M42", "--ra-deg", "3"], "either a name"),
        (["goto", "--ra-deg", "3", "--dec-deg", "99"], "not a valid position"),
        (["goto", "no such star"], "no such star"),
        (["position", "--driver", "frob"], "no mount driver"),
        (["position", "--site", "95,8"], "not LAT,LON"),
        (["position", "--site", "x"], "not LAT,LON"),
        (["position", "--baud", "1"], "not a baud rate"),
        (["position", "--epoch", "B1950"], "invalid choice"),
        (["frob"], "invalid choice"),
        ([], "required"),
    ],
)
def test_unusable_arguments_are_one_sentence_and_exit_2(arguments, sentence, capsys) -> None:
    assert main(["mount", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert sentence in err
    assert err.count("\n") == 1


def test_an_absent_port_is_exit_1(capsys) -> None:
    code, told = run(capsys, "position", "--port", "socket://127.0.0.1:1", "--driver", "lx200")
    assert code == 1
    assert "No answer at" in told["error"]


def test_a_motor_board_asks_for_the_site(capsys) -> None:
    with simulated("skywatcher") as (_, port):
        code, told = run(capsys, "position", "--port", port, "--driver", "skywatcher")
        assert code == 1
        assert "--site LAT,LON" in told["error"]


def test_every_action_is_one_line_of_a_registry() -> None:
    assert set(mount_cli.COMMANDS) >= {"list", "probe", "position", "sync", "goto", "stop"}


def test_a_motor_board_goes_nowhere_before_its_home_is_confirmed(capsys) -> None:
    arguments = ["HIP", "11767", "--driver", "skywatcher", "--site", "50,8", "--allow-flip"]
    with simulated("skywatcher") as (telescope, port):
        code, told = run(capsys, "goto", *arguments, "--port", port, "--yes")
        assert code == 1
        assert "home is not confirmed" in told["error"]
        assert telescope.log == []
        line = ["--port", port, *arguments[2:6]]
        code, told = run(capsys, "position", *line)
        assert told["state"]["home_confirmed"] is False
        code, told = run(capsys, "position", *line, "--home", "now")
        assert (told["state"]["home_confirmed"], round(told["mount_dec_deg"])) == (True, 90)
