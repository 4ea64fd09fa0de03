"""How soon a slewing mount is stopped, and a mute one told: the rows of ``kochab bench mount`` that need real time."""

from contextlib import suppress
from math import inf
from time import monotonic, sleep
from typing import Any

from kochab.core.errors import DeviceError
from kochab.core.mount import Pointing
from kochab.core.progress import Task
from kochab.gear.mounts.slew_supervisor import MUTE
from kochab.lab.bench import ALL_ROWS, Goal, Only, Report
from kochab.lab.bench.checkout import rows_of
from kochab.lab.bench.mount_rig import FarEnd, MountRig, mount_rig
from kochab.simulate.responders import open_responder
from kochab.simulate.serial_line import Fault

GOAL_BYTE_MS, GOAL_MUTE_S, PATIENCE_S = 100.0, 5.0, 30.0
TPOINT = "detective by TPOINT"
FULL_SPEED_S = 1.5  # the simulated mounts have got up to speed by then
SEED = 4
DRIVEN_BY = {
    "lx200": "indi_lx200basic",
    "onstep": "indi_lx200_OnStep",
    "nexstar": "indi_celestron_gps",
    "synscan": "indi_synscan_telescope",
    "ioptron": "indi_ioptronv3_telescope",
    "skywatcher": "indi_eqmod_telescope",
}
"""Our simulator of each kind is driven by this driver of INDI's, too (tests/simulate/test_indi.py)."""
ELSEWHERE = "tests.gear.mounts.measured"
"""What only a checkout can measure, because its simulators are not shipped; it prints rows of JSON."""


def rows(drivers: list[str]) -> list[dict[str, Any]]:
    """One a driver whose simulator is shipped."""
    return [row(name, f"ours, also driven by INDI's {DRIVEN_BY[name]}") for name in drivers]


def row(driver: str, simulator: str, far_end: FarEnd = open_responder) -> dict[str, Any]:
    """How soon one is stopped, and told to be mute."""
    row = {"driver": driver, "line": "stop", "simulator": simulator}
    return row | _stop(driver, far_end) | _mute(driver, far_end)


def elsewhere(quick: bool, report: Report, only: Only = ALL_ROWS) -> list[dict[str, Any]]:
    """The detective, random evenings, conformance, killed programs, and the makes whose simulators are not shipped."""
    if only.names and all(name.startswith("centring") for name in only.names):
        return []
    chosen = ["--only", *only.names] if only.names else []
    found = rows_of(ELSEWHERE, [*(["--quick"] if quick else []), *chosen], report)
    return [{"driver": "all others", "line": found}] if isinstance(found, str) else found


def goals(found: list[dict[str, Any]]) -> list[Goal]:
    """The slowest of all drivers, and the worst of what is measured elsewhere; None what was not."""

    def worst(line: str, key: str, most: bool = True, of: str = "") -> float | None:
        values = [one[key] for one in found if one["line"] == line and key in one and (not of or one["driver"] == of)]
        return (max(values) if most else min(values)) if values else None

    stopped = [one for one in found if one["line"] == "stop"]
    return [
        Goal.at_most("first byte of Stop, ms", worst("stop", "byte_ms"), GOAL_BYTE_MS),
        Goal.at_least("stopped mounts seen to stand still", _standing(stopped), len(stopped)),
        Goal.at_most("a mount mute in a slew is told after, s", worst("stop", "mute_s"), GOAL_MUTE_S),
        Goal.at_least("share of the mounts whose fault is named, any fault", worst("detective", "right", False), 0.95),
        Goal.at_most("share of healthy mounts accused", worst("detective", "wrong", of="healthy"), 0.01),
        Goal.at_least(
            "the same by TPOINT's terms, untold where it cannot be told", worst(TPOINT, "right", False), 0.95
        ),
        Goal.at_most("share of healthy mounts by TPOINT's terms accused", worst(TPOINT, "wrong", of="healthy"), 0.01),
        Goal.at_most("motions outside limits in random evenings, any driver", worst("evenings", "violations"), 0),
        Goal.at_most("slews from a false home after power cuts, any board", worst("power cuts", "false"), 0),
        Goal.at_most("motions that lost their power without a word of it", worst("power cuts", "word"), 0),
        Goal.at_most("all else that went wrong in evenings with power cuts", _all_else(found), 0),
        Goal.at_most("home or park called done by a mount that is not there", worst("home and park", "wrong"), 0),
        Goal.at_most("mounts that move on after their line broke", worst("broken in a slew", "wrong"), 0),
        Goal.at_most("motions that outlive a nudge or a session unseen", worst("ends", "wrong"), 0),
        Goal.at_most("questions not asked again after a silence", worst("asked again after a silence", "failed"), 0),
        Goal.at_most("power cuts between two programs judged wrongly", worst("cut between two programs", "failed"), 0),
        Goal.at_most("creeping and standing confused", worst("seen to stand", "failed"), 0),
        Goal.at_most("all that syncs by hand may shift a mount, deg", worst("syncs by hand", "shift_deg"), 20.1),
        Goal.at_most("first byte of a Stop without a driver, s", worst("stop without a driver", "byte_s"), 0.5),
        Goal.at_most("conformance not met, any driver", worst("conformance", "failed"), 0),
        Goal.at_most("syncs and unknown motion judged wrongly", worst("syncs and unknown motion", "failed"), 0),
        Goal.at_most("states of Alpaca misread", worst("states of Alpaca", "failed"), 0),
        Goal.at_most("states of INDI misread", worst("states of INDI", "failed"), 0),
        Goal.at_most("nudges that outlive their program, any driver", worst("killed or asleep", "failed"), 0),
    ]


def _standing(stopped: list[dict[str, Any]]) -> int | None:
    return sum(one["stands"] for one in stopped) if stopped else None


def _all_else(found: list[dict[str, Any]]) -> int | None:
    """What is counted of evenings with power cuts beside what has goals of its own."""
    rows = [one for one in found if one["line"] == "power cuts"]
    kinds = ("low", "sun", "done", "running", "hang", "fault")
    return sum(int(row[kind]) for row in rows for kind in kinds) if rows else None


def _slewing(rig: MountRig) -> Task[Pointing]:
    """A slew to the target that has begun; the mount is as patient as at a telescope."""
    rig.guard.emergency.wait, rig.rig.clock.most_s = sleep, inf
    mount: Any = rig.guard.mount
    mount.timeout_s = type(mount).timeout_s
    slew = rig.guard.slew(*rig.guard.to_mount(rig.target.ra_deg, rig.target.dec_deg))
    end = monotonic() + PATIENCE_S
    while not rig.rig.mount.slewing and monotonic() < end:
        next(slew)
    end = monotonic() + FULL_SPEED_S
    while monotonic() < end:
        next(slew)
    return slew


def _stop(driver: str, far_end: FarEnd) -> dict[str, Any]:
    with mount_rig(SEED, driver, far_end=far_end) as rig:
        slew = _slewing(rig)
        before, begun = len(rig.line.transcript), monotonic()
        rig.guard.stop()
        while not any(way == "<" for way, _ in list(rig.line.transcript)[before:]) and monotonic() - begun < PATIENCE_S:
            sleep(0.0005)
        heard = monotonic()
        while rig.rig.mount.slewing and monotonic() - begun < PATIENCE_S:
            sleep(0.005)
        still, stands = monotonic(), False
        with suppress(DeviceError):
            rig.guard.emergency.confirm()
            stands = True
        with suppress(DeviceError):
            slew.close()
        return {"byte_ms": 1000.0 * (heard - begun), "still_s": still - begun, "stands": stands}


def _mute(driver: str, far_end: FarEnd) -> dict[str, Any]:
    with mount_rig(SEED, driver, far_end=far_end) as rig:
        slew = _slewing(rig)
        rig.faults.chance(Fault.SILENCE, 1.0)
        begun = monotonic()
        with suppress(DeviceError):
            while next(slew).detail != MUTE and monotonic() - begun < PATIENCE_S:
                pass
        mute_s = monotonic() - begun
        rig.faults.none()
        with suppress(DeviceError):
            slew.close()
        return {"mute_s": mute_s}
