"""A line that breaks while a command's mount moves: said at once, opened again, and the mount is stopped."""

import json
from datetime import UTC, datetime

import pytest

from kochab.cli.main import build_parser
from kochab.cli.mount import guarded_mount
from kochab.core.errors import DeviceError, LineLostError
from kochab.gear.mounts.motion_plan import Limits
from tests.boards import SITE, served, virtual_time
from tests.boards.sky import sidereal_deg

KINDS = ("onstep", "am5", "ioptron", "nexstar")


@pytest.fixture(params=KINDS)
def board(request, monkeypatch, tmp_path):
    """Tracking, well up, on a night that begins now: the command takes the computer's clock."""
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    with virtual_time() as time, served(request.param, time=time, start=datetime.now(UTC), slew_deg_s=3.0) as one:
        one.align(-50.0, 60.0)
        yield one


def breaks_in_a_slew(board):
    """A command whose line breaks on the way."""
    given = ["goto", "--ra-deg=0", "--dec-deg=0", f"--port={board.port}", f"--driver={board.driver}"]
    site = f"--site={SITE.latitude_deg},{SITE.longitude_deg}"
    words = ["mount", *given, site, "--trust-mount"]
    args = build_parser(words).parse_args(words)
    args.limits = Limits(crosses_meridian=True, sun_up_deg=90.0)  # at whatever hour this runs
    with guarded_mount(args) as guard:
        ra = (sidereal_deg(board.clock.unix(), SITE.longitude_deg) + 10.0) % 360.0
        guard.goto(ra, 60.0)
        while not board.moving:
            guard.state()
        guard.mount.talk.link.close()
        guard.position()


def test_it_is_opened_again_and_the_mount_stopped_and_till_then_its_power_is_to_be_cut(board, capsys) -> None:
    with pytest.raises(LineLostError, match="The line is back, and Kochab has stopped the mount: it stands"):
        breaks_in_a_slew(board)
    assert not board.moving
    told = capsys.readouterr().err
    assert "CUT ITS POWER" in told
    assert "opens the line again to stop it" in told


def test_where_the_line_does_not_come_back_it_is_said_that_the_mount_may_still_move(board, monkeypatch) -> None:
    opens = board.timing.open_port

    def gone(url, **settings):
        if board.moving:
            raise OSError("No such device")
        return opens(url, **settings)

    monkeypatch.setattr("serial.serial_for_url", gone)
    monkeypatch.setattr("kochab.gear.mounts.guard.Guard.stop_on_new_line.__defaults__", (3.0,))
    with pytest.raises(DeviceError, match=r"(?i)cut its power"):
        breaks_in_a_slew(board)


def test_a_goto_whose_mount_loses_its_power_on_the_way_names_the_restart(board, capsys) -> None:
    """It was "stopped N deg from its target", and the next goto left from a false home."""

    def cut():
        while not board.moving:
            board.timing.sleep(0.05)
        board.timing.sleep(1.0)
        board.cut_power(0.5)

    def goto():
        ra = (sidereal_deg(board.clock.unix(), SITE.longitude_deg) + 10.0) % 360.0
        port = [f"--port={board.port}", f"--driver={board.driver}", "--json"]
        site = [f"--site={SITE.latitude_deg},{SITE.longitude_deg}"]
        words = ["mount", "goto", f"--ra-deg={ra}", "--dec-deg=60", "--yes", *port, *site]
        args = build_parser(words).parse_args(words)
        args.limits = Limits(crosses_meridian=True, sun_up_deg=90.0)  # at whatever hour this runs
        assert args.run(args) == 1
        return json.loads(capsys.readouterr().out)["error"]

    cutting = board.timing.start(cut)
    first = goto()
    board.timing.join(cutting)
    assert len(board.cuts) == 1
    second = goto()
    assert "switched off and on" in first
    assert "Sync first" in second or "contradicts this computer" in second
    assert not board.false_slews()
    assert not board.moving
