"""What boards tell of power cuts, home, park, lines that break and syncs by hand: rows of ``kochab bench mount``."""

import os
import select
import subprocess
import sys
import tempfile
from collections import Counter
from contextlib import contextmanager, suppress
from functools import partial
from itertools import product
from time import monotonic

from kochab.core.errors import DeviceError
from kochab.core.mount import SIDEREAL_DEG_S, Ability, Direction
from kochab.core.progress import run
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.lab.bench import ALL_ROWS
from kochab.workflows.nudge import nudge

from . import BEHIND_INDI, BOARDS, served, virtual_time
from .evenings import INDI_ORDERS, KINDS, spend
from .sky import apart_deg, sidereal_deg

MOMENTS_S = (0.3, 0.6, 1.0, 2.0, 4.0, 8.0)  # after a rest was ordered its power fails
OFF_S = (0.1, 2.0, 8.0)
REACHES_DEG, AWAY_DEG = 5.0, 5.0
STEP_DEG, STEPS = 4.0, 12  # of syncs by hand, each below what has to be confirmed
FORGETS = [kind for kind in BOARDS if kind not in ("nexstar", "skywatcher")]  # its home is nowhere, or a person's word
UNKNOWN_S = 60.0
RATES = 0.5, 1.0, 2.0, 8.0, 60.0  # in sidereal


def power_cuts(count, only=ALL_ROWS):
    """Random evenings in which the supply fails while the port stays open; a column for each kind of violation."""
    for kind in BOARDS:
        if not only(f"power cuts: {kind}"):
            continue
        row = Counter()
        for seed in range(1, count + 1):
            evening = spend(kind, seed)
            row["cuts"] += evening.cuts
            row.update(what for what, _ in evening.violations)
        yield {"driver": kind, "line": "power cuts", "runs": count, "cuts": row["cuts"]} | {k: row[k] for k in KINDS}


def rests():
    """Home and park with a power cut on the way: how often "done" was said of a tube that is not there."""
    for kind in FORGETS:
        runs = wrong = 0
        for action, after_s, off_s in ((a, m, o) for a in ("home", "park") for m in MOMENTS_S for o in OFF_S):
            with _guarded(kind) as (board, guard):
                if Ability("go home" if action == "home" else action) in guard.lacks:
                    continue
                board.timing.Timer(after_s, partial(board.cut_power, off_s)).start()
                runs += 1
                with suppress(DeviceError):
                    run(guard.rest(action))
                    wrong += bool(board.false_by_deg() > AWAY_DEG or board.radec_deg()[1] < 90.0 - REACHES_DEG)
        yield {"driver": kind, "line": "home and park", "runs": runs, "wrong": wrong}


def broken_lines():
    """A line that breaks during a slew is opened again and the mount is stopped."""
    for kind in FORGETS:
        with _guarded(kind) as (board, guard):
            guard.goto(*_place(board, -10.0, 40.0))
            while not board.moving:
                guard.state()
            guard.mount.talk.link.close()
            guard.stop_on_new_line()
            yield {"driver": kind, "line": "broken in a slew", "runs": 1, "wrong": int(board.moving)}


def ends():
    """Nudges and sessions whose Stop is lost, at rates from the guide rate on: how many moved on unnoticed."""
    for kind in FORGETS:
        runs = wrong = 0
        for multiple, direction, dec in product(RATES, (Direction.WEST, Direction.NORTH), (40.0, 75.0)):
            rate = multiple * SIDEREAL_DEG_S
            for end in (_nudged, _left_moving, _left_in_a_slew):
                with _guarded(kind) as (board, guard):
                    board.align(-20.0, dec)
                    with suppress(DeviceError):  # it is told
                        end(board, guard, direction, rate)
                        runs += 1
                        wrong += board.moving
        yield {"driver": kind, "line": "ends", "runs": runs, "wrong": wrong}


def _nudged(board, guard, direction, rate):
    board.lose_stops(1)
    run(nudge(guard, direction, 3600.0 * rate * 1.5, rate_deg_s=rate))


def _left_moving(board, guard, direction, rate):
    guard.move(direction, rate, 1.0)
    board.timing.sleep(6.0)
    board.move(int(direction is Direction.NORTH), rate)  # its own end did nothing
    guard.see_stopped()


def _left_in_a_slew(board, guard, direction, rate):
    guard.goto(*_place(board, -10.0 - 10.0 * rate, 45.0))
    board.timing.sleep(1.0)
    board.lose_stops(1)
    guard.see_stopped()


def behind_indi(count, only=ALL_ROWS):
    """The families that INDI's drivers alone drive, in real time, minutes an evening; none where INDI lacks them."""
    kinds = [kind for kind in BEHIND_INDI if only(f"power cuts: {kind} by INDI")]
    for kind, seed in product(kinds, range(1, count + 1)):
        evening = spend(kind, seed, INDI_ORDERS, "through INDI")
        if not evening.skipped:
            row = Counter(what for what, _ in evening.violations)
            cuts = {"driver": f"{kind} by INDI", "line": "power cuts", "runs": 1, "cuts": evening.cuts}
            yield cuts | {k: row[k] for k in KINDS}


def syncs_by_hand():
    """How far many small ones shift a mount, each of which alone is allowed without a question."""
    for kind in (*FORGETS, "nexstar"):
        with _guarded(kind) as (board, guard):
            before = board.believed_deg()
            taken = 0
            with suppress(DeviceError):
                for _ in range(STEPS):
                    here = guard.position()
                    guard.sync(here.ra_deg, here.dec_deg - STEP_DEG, by_hand=True, confirmed=True)
                    taken += 1
            shift_deg = apart_deg(board.believed_deg(), before)
            yield {"driver": kind, "line": "syncs by hand", "runs": taken, "shift_deg": shift_deg}


def stops_without_a_driver():
    """``kochab mount stop --port``, a program of its own: until its first byte is on the line."""
    import pty
    import tty

    master, slave = pty.openpty()
    tty.setraw(slave)
    with tempfile.TemporaryDirectory() as config:
        line = [sys.executable, "-m", "kochab", "mount", "stop", "--port", os.ttyname(slave)]
        begun = monotonic()
        child = subprocess.Popen(
            line, env={**os.environ, "KOCHAB_CONFIG": config}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        heard = select.select([master], [], [], UNKNOWN_S)[0]
        byte_s = monotonic() - begun if heard else None
        child.kill()
        child.wait()
    for end in (master, slave):
        os.close(end)
    return {"driver": "none given", "line": "stop without a driver", "byte_s": byte_s}


@contextmanager
def _guarded(kind):
    """A board on the east side, well up, in a virtual time, and its guard."""
    with virtual_time() as time, served(kind, time=time, slew_deg_s=4.0, keeps_clock=True) as board:
        board.align(-50.0, 60.0)
        again = partial(open_mount, board.driver, board.port, site=board.site, clock=board.clock)
        limits = Limits(crosses_meridian=True)
        guard = Guard(again(), board.site, limits, clock=board.clock, reopen=partial(again, stop_first=True))
        try:
            yield board, guard
        finally:
            guard.close()


def _place(board, hour_angle_deg, dec_deg):
    return (sidereal_deg(board.clock.unix(), board.site.longitude_deg) - hour_angle_deg) % 360.0, dec_deg


def rows(quick, only=ALL_ROWS):
    """All of them, or those whose line is wanted; power cuts of the wanted drivers alone."""
    yield from power_cuts(8 if quick else 100, only)
    for line, measured in (
        ("home and park", rests),
        ("broken in a slew", broken_lines),
        ("ends", ends),
        ("power cuts", partial(behind_indi, 1 if quick else 6, only)),
        ("syncs by hand", syncs_by_hand),
    ):
        if only.some(f"{line}: "):
            yield from measured()
    if only.some("stop without a driver: "):
        yield stops_without_a_driver()
