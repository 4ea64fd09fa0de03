"""People at the bolts of a mount whose axis is known: what the tutor's instructions lead to.

``python -m tests.nights.hands --count 80 --seed 1`` runs 80 hands of each kind and prints, a kind a line: worst and median
final error, instructions used, how many ended worse than they began, how many below 60 arcsec within 30 instructions,
how often clock or zone was accused, and the most turns asked of a bolt that nobody had ever turned.

Mount, bolts and hands are angles and scipy's rotations, nothing of :mod:`kochab.polar`; a hand sees only what the
tutor says, the product sees only attitudes as solved frames give them, with their noise.
"""

import argparse
import json
import math
import re
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

import numpy as np
from scipy.spatial.transform import Rotation

from kochab.core.frame import Site
from kochab.lab.bench import Only
from kochab.polar.camera_axis import with_axis_seen_before
from kochab.polar.error import Knob
from kochab.polar.measure import Measurement, MeasureSettings, combine_measurements, measure_local
from kochab.polar.sighting import LocalAttitude
from kochab.polar.tutor import BoltTutor, Instruction, TutorStep
from kochab.workflows.polar.align import MOST_ROUNDS, AdjustmentGuide, AlignOptions, found_enough, good
from tests.nights.guide_logs import Evening, evening, refracted_pole

ARCSEC = math.pi / 648000.0
SIDEREAL_RAD_S = 2 * math.pi * 1.00273781191135448 / 86400.0
INSTRUCTIONS = 30
GOAL_ARCSEC = 60.0
SIGMA_ARCSEC = np.array([2.0, 2.0, 20.0])
START = datetime(2026, 3, 14, 20, 0, tzinfo=UTC)
ACCUSED = re.compile(r"\bclock'?s?\b|time zone|\bzone\b", re.IGNORECASE)


@dataclass(frozen=True)
class Kind:
    """What is wrong with a hand or its bolts; chances are of one turn."""

    name: str
    backlash_turns: float = 0.0  # at most
    coupling: float = 0.0  # share of a bolt's movement that the other axis takes, at most
    slips: float = 0.0
    wrong_way: float = 0.0
    wrong_bolt: float = 0.0
    coarse: float = 0.08  # one sigma of the share by which a hand misses what it was asked for
    overshoots: float = 0.0
    other_in_test: float = 0.0  # chance that a test turns the other bolt
    clock_h: float = 0.0


KINDS = (
    Kind("steady"),
    Kind("backlash", backlash_turns=0.4),
    Kind("coupling", coupling=0.3),
    Kind("slips", slips=0.2),
    Kind("wrong way", wrong_way=0.2),
    Kind("wrong bolt", wrong_bolt=0.2),
    Kind("coarse", coarse=0.35),
    Kind("backlash, coupling, slips", backlash_turns=0.3, coupling=0.2, slips=0.15),
    Kind("all of these", 0.3, 0.15, 0.1, 0.1, 0.1, 0.15),
    Kind("overshoots 5 arcmin", overshoots=0.4),
    Kind("other axis in the test", other_in_test=0.5),
    Kind("clock 6 h wrong", clock_h=6.0),
)


@dataclass
class Bolt:
    """An adjuster: true arcsec a turn with its sign, play, and the share that the other axis takes."""

    arcsec_a_turn: float
    backlash_turns: float
    coupling: float
    engaged: float = 0.0  # where in its play the thread is, turns
    touched: bool = False

    def turn(self, turns: float) -> float:
        """What its own axis moves by, arcsec; play is crossed first."""
        self.touched = True
        free = self.engaged + turns
        self.engaged = min(max(free, 0.0), self.backlash_turns)
        return (free - self.engaged) * self.arcsec_a_turn


class Mount:
    """A rigid mount on the ground: its axis' true error, two bolts, an RA drive that tracks, a camera."""

    def __init__(self, kind: Kind, seed: int) -> None:
        self.random = np.random.default_rng([seed, [one.name for one in KINDS].index(kind.name)])
        self.kind, self.seconds = kind, 0.0
        self.site_of: Evening = replace(evening("plain", seed), height_m=300.0)
        total, direction = math.radians(self.random.uniform(6 / 60, 2.0)), self.random.uniform(0, 2 * math.pi)
        self.pole_azimuth, self.pole_altitude = refracted_pole(self.site_of)
        self.altitude = total * math.cos(direction)  # error, rad
        self.azimuth = total * math.sin(direction) / math.cos(self.pole_altitude)
        self.bolts = {knob: self._bolt() for knob in (Knob.ALTITUDE, Knob.AZIMUTH)}
        self.step = 0.0
        self.camera = self._aimed()

    def _bolt(self) -> Bolt:
        random = self.random
        pitch = random.choice([-1, 1]) * random.uniform(1500, 6500)
        play = random.uniform(0.3, 1.0) * self.kind.backlash_turns
        return Bolt(pitch, play, random.uniform(-1, 1) * self.kind.coupling, random.uniform(0, 1) * play)

    def _aimed(self) -> Rotation:
        """The camera on a mount whose axis is along z, rolled at will; no frame low, whatever the clock says."""
        random, self.turned = self.random, 0.0
        while True:
            self.step = math.radians(random.uniform(15, 30)) * random.choice([-1, 1])
            angles = [random.uniform(0, 360), random.uniform(20, 100), random.uniform(0, 360)]
            self.camera = Rotation.from_euler("ZXZ", angles, degrees=True)
            heights = [
                clock * self._matrix(turn)
                for turn in (0, self.step, 2 * self.step)
                for clock in (Rotation.identity(), self._clock())
            ]
            if min(math.asin(matrix.as_matrix()[2, 2]) for matrix in heights) > math.radians(25):
                return self.camera

    @property
    def axis(self) -> np.ndarray:
        return _enu(self.pole_azimuth + self.azimuth, self.pole_altitude + self.altitude)

    @property
    def total_arcsec(self) -> float:
        pole = _enu(self.pole_azimuth, self.pole_altitude)
        return float(np.linalg.norm(np.cross(self.axis, pole))) / ARCSEC

    def attitude(self) -> LocalAttitude:
        """The next solved frame, as a clock that is perhaps wrong makes it look among the things on the ground."""
        matrix = self._matrix(self.turned)
        noise = Rotation.from_rotvec(self.random.normal(0.0, SIGMA_ARCSEC * ARCSEC))
        seen = (self._clock() * matrix * noise).as_matrix()
        return LocalAttitude(seen, np.diag((SIGMA_ARCSEC * ARCSEC) ** 2), START + timedelta(seconds=self.seconds))

    def _matrix(self, turned: float) -> Rotation:
        """Camera to E, N, U: up tilted towards north by the axis' colatitude, then turned to its azimuth."""
        south = self.site_of.latitude_deg < 0
        turn = turned + SIDEREAL_RAD_S * self.seconds * (1 if south else -1)
        base = Rotation.from_euler(
            "ZX", [-(self.pole_azimuth + self.azimuth), self.pole_altitude + self.altitude - math.pi / 2]
        )
        return base * Rotation.from_euler("z", turn) * self.camera

    def _clock(self) -> Rotation:
        """What a wrong clock does to everything: the sky is put where it will be later."""
        celestial = _enu(0.0, math.radians(self.site_of.latitude_deg))
        return Rotation.from_rotvec(-celestial * SIDEREAL_RAD_S * 3600 * self.kind.clock_h)

    def sweep(self) -> list[LocalAttitude]:
        """Three frames with RA turned between, from where the first was taken; the drive tracks on from the last."""
        frames = []
        self.turned = SIDEREAL_RAD_S * self.seconds * (-1 if self.site_of.latitude_deg < 0 else 1)
        for number in range(3):
            frames.append(self.attitude())
            self.seconds += 20.0
            self.turned += self.step if number < 2 else 0.0
        return frames

    def turn(self, knob: Knob, turns: float) -> None:
        """A bolt is turned."""
        bolt = self.bolts[knob]
        moved = bolt.turn(turns)
        if self.kind.slips and self.random.random() < self.kind.slips:
            moved *= self.random.uniform(0.0, 0.7)  # springs back when it is locked
        self._move(knob, moved)
        self._move(_other(knob), moved * bolt.coupling)

    def _move(self, knob: Knob, arcsec: float) -> None:
        if knob is Knob.ALTITUDE:
            self.altitude += arcsec * ARCSEC
        else:
            self.azimuth += arcsec * ARCSEC


class Hand:
    """Somebody who does what the tutor says, as well as the kind allows."""

    def __init__(self, kind: Kind, mount: Mount) -> None:
        self.kind, self.mount, self.random = kind, mount, mount.random

    def follow(self, told: Instruction) -> None:
        kind, random = self.kind, self.random
        knob, turns = told.knob, told.turns * (1 + random.normal(0, kind.coarse))
        assert knob is not None
        if told.step is TutorStep.TEST:
            knob = _other(knob) if random.random() < kind.other_in_test else knob
        elif random.random() < kind.wrong_bolt:
            knob = _other(knob)
        if random.random() < kind.wrong_way:
            turns = -turns
        if random.random() < kind.overshoots:
            on_sky = 1.0 if knob is Knob.ALTITUDE else math.cos(self.mount.pole_altitude)
            turns += math.copysign(300.0 / abs(self.mount.bolts[knob].arcsec_a_turn) / on_sky, turns)
        self.mount.turn(knob, turns)


class Counted(BoltTutor):
    """The product's tutor; counts what it has been asked."""

    advised = 0

    def advise(self, *args, **kwargs) -> Instruction:
        self.advised += 1
        return super().advise(*args, **kwargs)


@dataclass(frozen=True)
class Run:
    """How one hand ended."""

    kind: str
    seed: int
    began_arcsec: float
    ended_arcsec: float
    instructions: int
    stopped: bool
    accused: bool
    blind_turns: float  # the most that was asked of a bolt which nobody had ever turned
    told: tuple[str, ...]


def run(kind: Kind, seed: int) -> Run:
    """One hand from its first measurement to Stop, measured again as often as that leaves something to do."""
    mount = Mount(kind, seed)
    hand, tutor, told = Hand(kind, mount), Counted(), []
    began, used, stopped, blind = mount.total_arcsec, 0, False, 0.0
    in_camera, quiet, quiets = None, None, 0
    for _ in range(MOST_ROUNDS):
        measurement = _measured(mount)
        if quiet is not None:
            measurement = combine_measurements(quiet, measurement)
        else:
            measurement = with_axis_seen_before(measurement, in_camera)
        if good(measurement, AlignOptions(), tutor.rough):
            break
        told += [finding.text for finding in measurement.findings if finding.spoils]
        if measurement.spoilt:
            break
        guide, here = AdjustmentGuide(measurement, tutor), 0
        for _ in range(3):  # frames run before anybody is at a bolt
            _watch(mount, guide)
        while used < INSTRUCTIONS and guide.instruction.step is not TutorStep.STOP:
            told.append(guide.instruction.words)
            if not mount.bolts[guide.instruction.knob].touched:
                blind = max(blind, abs(guide.instruction.turns))
            hand.follow(guide.instruction)
            used, here = used + 1, here + 1
            _settle(mount, guide, tutor)
        told.append(guide.instruction.words)
        in_camera = guide.live.camera_axis
        stopped = guide.instruction.step is TutorStep.STOP
        quiets = 0 if here else quiets + 1
        if not stopped or (tutor.rough and found_enough(measurement, AlignOptions(), quiets)):
            break
        quiet = None if here else measurement
    accused = any(ACCUSED.search(words) for words in told)
    return Run(kind.name, seed, began, mount.total_arcsec, used, stopped, accused, blind, tuple(told))


def _measured(mount: Mount) -> Measurement:
    night = mount.site_of
    settings = MeasureSettings(Site(night.latitude_deg, night.longitude_deg, night.height_m))
    measured = measure_local(mount.sweep(), settings)
    assert isinstance(measured, Measurement), measured
    return measured


def _settle(mount: Mount, guide: AdjustmentGuide, tutor: Counted) -> None:
    """Frames until the tutor has looked at the turn; the person who sees nothing happen says that the bolt was turned."""
    before = tutor.advised
    for number in range(60):
        _watch(mount, guide, turned=number in (10, 35))
        if tutor.advised != before:
            return


def _watch(mount: Mount, guide: AdjustmentGuide, turned: bool = False) -> None:
    mount.seconds += 5.0
    guide.see(guide.live.update(mount.attitude()), turned=turned)


def _other(knob: Knob) -> Knob:
    return Knob.AZIMUTH if knob is Knob.ALTITUDE else Knob.ALTITUDE


def _enu(azimuth: float, altitude: float) -> np.ndarray:
    return np.array(
        [math.sin(azimuth) * math.cos(altitude), math.cos(azimuth) * math.cos(altitude), math.sin(altitude)]
    )


def report(runs: list[Run]) -> str:
    """A line a kind, and one of all."""
    names = [*dict.fromkeys(one.kind for one in runs), "all"]
    head = f"{'':26}{'hands':>6}{'median':>8}{'worst':>8}{'used':>6}{'most':>6}{'worse':>7}{'<60':>6}{'accused':>9}{'blind':>7}"
    return "\n".join([head, *(_line(name, [one for one in runs if name in (one.kind, "all")]) for name in names)])


def _line(name: str, runs: list[Run]) -> str:
    ended = np.array([one.ended_arcsec for one in runs])
    used = np.array([one.instructions for one in runs])
    worse = sum(one.ended_arcsec > one.began_arcsec for one in runs)
    near = int((ended < GOAL_ARCSEC).sum())
    accused = sum(one.accused for one in runs)
    return f"{name:26}{len(runs):6}{np.median(ended):8.0f}{ended.max():8.0f}{np.median(used):6.0f}{used.max():6}{worse:7}{near:6}{accused:9}{max(one.blind_turns for one in runs):7.2f}"


def row(name: str, runs: list[Run]) -> dict[str, str | float]:
    """The same as a row of ``kochab bench polar``."""
    ended = np.array([one.ended_arcsec for one in runs])
    return {
        "kind": f"hands: {name}",
        "runs": len(runs),
        "median_arcsec": float(np.median(ended)),
        "worst_arcsec": float(ended.max()),
        "instructions": float(np.median([one.instructions for one in runs])),
        "worse": sum(one.ended_arcsec > one.began_arcsec for one in runs),
        "below_60": int((ended < GOAL_ARCSEC).sum()),
        "accused": sum(one.accused for one in runs),
        "blind_turns": max(one.blind_turns for one in runs),
    }


def main() -> None:
    """Run hands of every kind."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=80, help="hands a kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=[kind.name for kind in KINDS])
    parser.add_argument("--only", nargs="+", help="rows of kochab bench polar, by how they begin")
    parser.add_argument("--json", action="store_true", help="a row a kind, as kochab bench polar prints it")
    parser.add_argument("--worst", type=int, default=3, help="tell so many of the worst, word by word")
    asked = parser.parse_args()
    only = Only(tuple(asked.only or ()))
    kinds = [kind for kind in KINDS if asked.kind in (None, kind.name) and only(f"hands: {kind.name}")]
    runs = []
    for kind in kinds:
        runs += (own := [run(kind, 1000 * asked.seed + number) for number in range(asked.count)])
        if asked.json:
            print(json.dumps(row(kind.name, own)), flush=True)
    if asked.json:
        return
    print(report(runs))
    for one in sorted(runs, key=lambda one: -one.ended_arcsec)[: asked.worst]:
        print(f"\n{one.kind}, seed {one.seed}: {one.began_arcsec:.0f} to {one.ended_arcsec:.0f} arcsec")
        print("\n".join(f"  {words}" for words in one.told))


if __name__ == "__main__":
    main()
