"""The bench of lost mounts, a few runs of it, and the watch that holds orders against the log."""

from datetime import UTC, datetime

import pytest

from kochab.core.mount import Direction
from kochab.core.progress import run
from kochab.gear.journal import MotionLog
from kochab.gear.mounts import serial_line
from kochab.lab.bench import BENCHES, Only, checkout, mount, mount_rig, mount_stops
from kochab.lab.bench.mount import CentringRun
from kochab.lab.bench.mount_rig import ReceivedOrder, WatchedMount, unguarded
from kochab.simulate.responders import RESPONDERS
from kochab.simulate.serial_line import Fault
from tests.boards.evenings import KINDS
from tests.simulate.test_indi import FAMILIES
from tests.workflows.mount_nights import bench, good


@pytest.mark.parametrize("driver", ["onstep", "ioptron", "skywatcher"])
def test_a_run_on_a_good_line_is_centred(driver) -> None:
    one = mount._do(CentringRun(2, driver, False, False))
    assert one.good, one
    assert one.end == "centred"
    assert one.faults == 0
    assert one.strays == []
    assert one.still


@pytest.mark.parametrize("driver", ["nexstar", "synscan"])
def test_a_run_on_a_bad_line_is_survived(driver, monkeypatch) -> None:
    monkeypatch.setattr(mount_rig, "PATIENCE_S", 0.2)
    monkeypatch.setattr(mount_rig, "LATE_S", 0.3)
    monkeypatch.setattr(serial_line, "QUIET_S", 0.1)
    one = mount._do(CentringRun(3, driver, True, False))
    assert one.faults > 0
    assert one.strays == []
    assert one.still
    assert one.end == "centred" or one.trouble.endswith((".", ")")), one


def test_the_far_end_believes_to_be_three_degrees_from_where_it_points() -> None:
    for driver in ("lx200", "skywatcher"):
        with mount_rig.mount_rig(4, driver) as rig:
            said = rig.guard.position_icrs()
            true = rig.rig.truth().ra_dec_deg
            from kochab.core.attitude import apart_deg

            assert apart_deg(said, true) == pytest.approx(3.0, abs=0.05)
            assert rig.watched.orders == []


MEASURED = [
    {"driver": "healthy", "line": "detective", "right": 0.99, "wrong": 0.01},
    {"driver": "clock", "line": "detective", "right": 0.95, "wrong": 0.05},
    {"driver": "healthy", "line": "detective by TPOINT", "right": 0.99, "wrong": 0.01},
    {"driver": "clock", "line": "detective by TPOINT", "right": 0.95, "wrong": 0.05},
    {"driver": "am5", "line": "evenings", "violations": 0},
    {"driver": "am5", "line": "power cuts"} | dict.fromkeys(KINDS, 0),
    {"driver": "am5", "line": "home and park", "wrong": 0},
    {"driver": "am5", "line": "broken in a slew", "wrong": 0},
    {"driver": "am5", "line": "ends", "wrong": 0},
    *(
        {"driver": "all", "line": line, "failed": 0}
        for line in ("asked again after a silence", "cut between two programs")
    ),
    {"driver": "all", "line": "seen to stand", "failed": 0},
    {"driver": "am5", "line": "syncs by hand", "shift_deg": 20.0},
    {"driver": "none given", "line": "stop without a driver", "byte_s": 0.4},
    {"driver": "am5", "line": "conformance", "failed": 0},
    {"driver": "all", "line": "syncs and unknown motion", "failed": 0},
    {"driver": "all", "line": "states of Alpaca", "failed": 0},
    {"driver": "all", "line": "states of INDI", "failed": 0},
    {"driver": "am5", "line": "killed or asleep", "failed": 0},
]
SPOILT = [
    {"wrong": 0.02},
    {"right": 0.94},
    {"wrong": 0.02},
    {"right": 0.94},
    {"violations": 1},
    {"false": 1},
    {"wrong": 1},
    {"wrong": 1},
    {"wrong": 1},
    *({"failed": k} for k in (1, 1, 1)),
    {"shift_deg": 21.0},
    {"byte_s": 0.6},
    *({"failed": k} for k in (1, 1, 1, 1, 2)),
]


def test_what_is_measured_in_a_checkout_misses_its_goal_where_one_driver_does() -> None:
    stop = {"line": "stop", "byte_ms": 3.0, "stands": True, "mute_s": 4.0}
    assert [goal.met for goal in mount_stops.goals([stop])] == [True] * 3 + [None] * 21, "not measured is not met"
    assert all(goal.met for goal in mount_stops.goals([stop, *MEASURED]))
    for k, worse in enumerate(SPOILT):
        rows = [row | worse if j == k else row for j, row in enumerate(MEASURED)]
        assert sum(goal.met is False for goal in mount_stops.goals([stop, *rows])) == 1
    for kind in KINDS:
        assert any(
            goal.met is False
            for goal in mount_stops.goals([stop, {"line": "power cuts"} | {k: int(k == kind) for k in KINDS}])
        )


def test_what_a_checkout_measures_are_rows_of_json_and_without_one_its_command_is_told(monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(checkout, "CHECKOUT", tmp_path)
    (told,) = mount_stops.elsewhere(True, print)
    assert "python -m tests.gear.mounts.measured" in told["line"]
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "__init__.py").touch()
    (tmp_path / "tests" / "rows.py").write_text("import json, sys; print(json.dumps({'line': sys.argv[1]}))")
    monkeypatch.setattr(mount_stops, "ELSEWHERE", "tests.rows")
    assert mount_stops.elsewhere(True, print) == [{"line": "--quick"}]
    (tmp_path / "tests" / "rows.py").write_text("raise SystemExit(1)")
    assert "failed" in mount_stops.elsewhere(True, print)[0]["line"]


def test_the_goals_are_those_of_the_issue(monkeypatch) -> None:
    monkeypatch.setattr(mount, "QUICK_RUNS", 2)
    monkeypatch.setattr(mount, "_do", _as_if)
    row = {"driver": "lx200", "line": "stop", "byte_ms": 3.0, "still_s": 1.0, "stands": True, "mute_s": 4.0}
    monkeypatch.setattr(mount_stops, "rows", lambda names: [row | {"driver": name} for name in names])
    monkeypatch.setattr(mount_stops, "elsewhere", lambda quick, report, only: MEASURED)
    result = mount.run(True, lambda line: None)
    assert [goal.met for goal in result.goals] == [True] * 28
    assert "10 arcsec in at most 3 corrections" in result.goals[0].name
    assert BENCHES["mount"] == "kochab.lab.bench.mount:run"
    assert {row["line"] for row in result.as_json()["rows"]} == {"good", "faults", "stop"} | {
        row["line"] for row in MEASURED
    }


def test_rows_are_measured_one_by_one(monkeypatch) -> None:
    monkeypatch.setattr(mount, "_do", _as_if)
    asked = []
    monkeypatch.setattr(mount_stops, "rows_of", lambda module, arguments, report: asked.append(arguments) or [])
    said: list[str] = []
    result = mount.run(True, said.append, Only(("centring: onstep",)))
    assert {(row["driver"], row["line"]) for row in result.rows} == {("onstep", "good"), ("onstep", "faults")}
    assert all(goal.value is not None for goal in result.goals)
    assert "10 arcsec" in result.goals[0].name
    assert asked == [], "nothing of a checkout was wanted"
    mount.run(True, said.append, Only(("ends",)))
    assert asked == [["--quick", "--only", "ends"]]
    assert any(line.startswith('  {"driver": "onstep"') for line in said)


def _as_if(one):
    one.error_arcsec, one.corrections, one.faults = 4.0, 2, int(one.faulty)
    return one


def test_a_run_that_is_not_centred_misses_the_goal() -> None:
    assert not CentringRun(0, "lx200", False, False).good
    assert not CentringRun(0, "lx200", False, False, error_arcsec=11.0, corrections=2).good
    assert not CentringRun(0, "lx200", False, False, error_arcsec=1.0, corrections=4).good


def watched_bench():
    b = bench(good(lost_deg=0.0))
    real = b.rig.mount
    b.watched = WatchedMount(real.config, real.site, real.clock)
    return b


def test_an_order_that_the_guard_did_not_send_is_a_stray() -> None:
    b = watched_bench()
    ra, dec = b.rig.mount.believed_deg()
    b.watched.goto(ra - 5.0, dec)
    b.watched.pulse(Direction.NORTH, 500)
    b.watched.move(Direction.EAST, 0.1)
    b.watched.turn_axis(1, 0.5)
    b.watched.turn_axis_to(0, 20.0)
    b.watched.turn_axis(0, 0.0042)  # tracking
    b.watched.halt()
    assert len(unguarded(b.watched.orders, b.guard)) == 5


def test_an_order_that_the_guard_sent_is_accounted_for_once() -> None:
    b = watched_bench()
    ra, dec = b.rig.mount.believed_deg()
    run(b.guard.slew(ra - 5.0, dec))
    sent = b.guard.log.sent("goto")[0]
    when = datetime.fromisoformat(sent.time_utc).timestamp()
    order = ReceivedOrder("goto", when, ((ra - 5.0) % 360.0, dec))
    assert unguarded([order], b.guard) == []
    assert len(unguarded([order, order], b.guard)) == 1
    elsewhere = ReceivedOrder("goto", when, ((ra - 6.0) % 360.0, dec))
    assert len(unguarded([elsewhere], b.guard)) == 1
    early = ReceivedOrder("goto", when - 5.0, order.given)
    assert len(unguarded([early], b.guard)) == 1


def test_a_park_that_the_guard_sent_is_no_stray() -> None:
    b = watched_bench()
    b.watched.park()
    assert len(unguarded(b.watched.orders, b.guard)) == 1
    b.guard.log = MotionLog(clock=lambda: datetime.fromtimestamp(b.watched.orders[0].unix_s, UTC))
    b.guard.log.add("park", "sent")
    assert unguarded(b.watched.orders, b.guard) == []


def test_motors_may_turn_only_while_a_motion_is_under_way() -> None:
    b = watched_bench()
    moment = [1.8e9]
    b.guard.log = MotionLog(clock=lambda: datetime.fromtimestamp(moment[0], UTC))
    b.guard.log.add("goto", "sent")
    moment[0] += 10.0
    b.guard.log.add("stop", "sent")
    during, after = ReceivedOrder("turn", 1.8e9 + 5.0), ReceivedOrder("turn", 1.8e9 + 11.0)
    assert unguarded([during], b.guard) == []
    assert len(unguarded([after], b.guard)) == 1


def test_faults_are_switched_on_for_the_line() -> None:
    with mount_rig.mount_rig(4, "onstep") as rig:
        rig.spoil(refusal=True)
        rig.unplug_in = 1
        rig.wait(0.0)
        assert rig.faults.happens(Fault.UNPLUG)
        assert rig.faults.happens(Fault.REFUSAL)


def test_a_stopped_and_a_mute_mount_are_rows_that_say_by_whom_they_were_written() -> None:
    (stop,) = found = mount_stops.rows(["onstep"])
    assert "INDI's indi_lx200_OnStep" in stop["simulator"]
    assert (stop["stands"], stop["still_s"] > 0.0, stop["mute_s"] > 0.0) == (True, True, True)
    assert all(goal.met for goal in mount_stops.goals(found)[1:2])


def test_what_is_too_late_misses_its_goal() -> None:
    row = {"line": "stop", "byte_ms": 101.0, "stands": False, "mute_s": 5.1}
    assert [goal.met for goal in mount_stops.goals([row])] == [False] * 3 + [None] * 21


def test_indi_s_drivers_are_those_that_are_tried_at_the_simulators() -> None:
    assert {FAMILIES[program][1]: program for program in mount_stops.DRIVEN_BY.values()} == mount_stops.DRIVEN_BY
    assert mount_stops.DRIVEN_BY.keys() == RESPONDERS.keys()
