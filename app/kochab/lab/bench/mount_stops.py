"""How soon a slewing mount is stopped, and a mute one told: the rows of ``kochab bench mount`` that need real time."""

from contextlib import suppress
from time import monotonic, sleep
from typing import Any

from kochab.core.errors import DeviceError
from kochab.core.mount import Pointing
from kochab.core.progress import Task
from kochab.gear.mounts.slew_supervisor import MUTE
from kochab.lab.bench import Goal
from kochab.lab.bench.mount_rig import MountRig, mount_rig
from kochab.simulate.serial_line import Fault

GOAL_BYTE_MS, GOAL_MUTE_S, PATIENCE_S = 100.0, 5.0, 30.0
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
ELSEWHERE = {
    "the detective": "python -m tests.solver.faulty_mounts 200",
    "random evenings, every driver": "python -m tests.gear.mounts.sequences 2000",
    "the same at INDI's simulator and EQMod": "python -m tests.gear.mounts.indi_sequences 60",
    "conformance, kill -9, power cycles": "python -m pytest tests/gear/mounts",
}
"""What only a checkout can measure, because its simulators are not shipped -> the command."""


def rows(drivers: list[str]) -> list[dict[str, Any]]:
    """One a driver, and one for everything that is measured elsewhere."""
    found = [
        {"driver": name, "line": "stop", "simulator": _origin(name)} | _stop(name) | _mute(name) for name in drivers
    ]
    return found + [{"driver": what, "line": f"not measured here: {command}"} for what, command in ELSEWHERE.items()]


def goals(found: list[dict[str, Any]]) -> list[Goal]:
    """The slowest of all drivers."""
    stopped = [row for row in found if row["line"] == "stop"]
    return [
        Goal.at_most("first byte of Stop, ms", max(row["byte_ms"] for row in stopped), GOAL_BYTE_MS),
        Goal.at_least("stopped mounts seen to stand still", sum(row["stands"] for row in stopped), len(stopped)),
        Goal.at_most("a mount mute in a slew is told after, s", max(row["mute_s"] for row in stopped), GOAL_MUTE_S),
    ]


def _origin(driver: str) -> str:
    return f"ours, also driven by INDI's {DRIVEN_BY[driver]}"


def _slewing(rig: MountRig) -> Task[Pointing]:
    """A slew to the target that has begun; the mount is as patient as at a telescope."""
    rig.guard.emergency.wait = sleep
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


def _stop(driver: str) -> dict[str, Any]:
    with mount_rig(SEED, driver) as rig:
        slew = _slewing(rig)
        before, begun = len(rig.line.transcript), monotonic()
        rig.guard.stop()
        while not any(way == "<" for way, _ in list(rig.line.transcript)[before:]) and monotonic() - begun < PATIENCE_S:
            sleep(0.0005)
        heard = monotonic()
        while rig.rig.mount.slewing and monotonic() - begun < PATIENCE_S:
            sleep(0.005)
        still, stands = monotonic(), True
        try:
            rig.guard.emergency.confirm()
        except DeviceError:
            stands = False
        with suppress(DeviceError):
            slew.close()
        return {"byte_ms": 1000.0 * (heard - begun), "still_s": still - begun, "stands": stands}


def _mute(driver: str) -> dict[str, Any]:
    with mount_rig(SEED, driver) as rig:
        slew = _slewing(rig)
        rig.faults.chance(Fault.SILENCE, 1.0)
        begun = monotonic()
        with suppress(DeviceError):
            while next(slew).detail != MUTE and monotonic() - begun < PATIENCE_S:
                pass
        told = monotonic() - begun
        rig.faults.none()
        with suppress(DeviceError):
            slew.close()
        return {"mute_s": told}
