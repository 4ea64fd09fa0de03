"""The practice rig as a polar alignment sees it, and the person who points it and turns its bolts.

Nothing of ``kochab.polar`` computes what is true here: where the camera looks, where its axis is and
what the bolts do is the rig's, which has its own geometry and its own way through ERFA. A solve is
replaced by the truth with errors of a given size about the camera's own axes; the rig's truth
weighs all directions of the field alike under the air's squeeze, as a square frame does. The air
moves each frame as a whole by 0.7 arcsec besides, which no solve can know of.
"""

from dataclasses import field
from typing import Any

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, Attitude, small_rotation
from kochab.core.frame import Site
from kochab.core.mount import Direction
from kochab.core.progress import Progress, Task
from kochab.core.progress import run as run_task
from kochab.core.solution import NoSolution
from kochab.core.values import mutable
from kochab.polar.error import Knob, PolarError
from kochab.polar.measure import MeasureSettings
from kochab.polar.plan import Optics, sweep_path
from kochab.polar.pole import Pole
from kochab.polar.sighting import Sighting, to_local
from kochab.polar.tutor import BoltTutor, Instruction
from kochab.simulate.mechanics.geometry import BoltErrors, Build, MountConfig
from kochab.simulate.night_sky import AIR
from kochab.simulate.rig import PracticeRig, RigConfig, random_place
from kochab.sky.horizon import Refraction
from kochab.workflows.polar.align import Alignment, AlignOptions, align
from kochab.workflows.polar.measure import Sweep, foreseen_arcsec
from kochab.workflows.polar.update import PolarButton, PolarControls, PolarUpdate

DOWN = np.array([0.0, 0.0, -1.0])
EXPOSURE_S, OVERHEAD_S = 1.0, 1.0
ANY_HOUR_DEG, LOWEST_DEG = (-180.0, 180.0), 25.0
RATE_DEG_S = 2.0


@mutable(eq=False)
class RigSky:
    """A rig with the three things an alignment needs; ``optics`` are the errors of its solves.

    ``arcmin_a_turn`` are the pitch and sense of the bolts' threads, which nobody knows.
    ``rest_arcsec`` (3, 3) turns the camera about its own axes by so much times gravity's pull.
    """

    rig: PracticeRig
    arcmin_a_turn: dict[Knob, float]
    optics: Optics
    rng: np.random.Generator
    by_hand: bool = False
    sights: int = 0
    pointing_deg: tuple[float, float] = (0.0, 0.0)
    field_deg: tuple[float, float] = (1.2, 1.2)
    seeing_arcsec: float = 0.7
    rest_arcsec: Floats = field(default_factory=lambda: np.zeros((3, 3)))

    @property
    def settings(self) -> MeasureSettings:
        """The site, and the air of this night."""
        return MeasureSettings(
            self.rig.config.site,
            Pole.REFRACTED,
            Refraction(AIR.pressure_hpa, AIR.temperature_c, AIR.humidity, AIR.wavelength_um),
        )

    def look(self) -> Sighting:
        """Expose and solve: the truth at mid-exposure with the errors of a solve."""
        start = self.rig.clock.now_unix()
        self.rig.clock.sleep(EXPOSURE_S + OVERHEAD_S)
        truth = self.rig.truth(start + EXPOSURE_S / 2.0)
        error = self.rng.normal(size=3) * np.sqrt(np.diag(self.optics.covariance))
        error[:2] += self.rng.normal(size=2) * self.seeing_arcsec * ARCSEC
        error += self.rest_arcsec @ truth.enu_to_camera @ DOWN * ARCSEC
        matrix = small_rotation(error) @ truth.attitude.matrix
        self.sights += 1
        return Sighting(
            Attitude(matrix, self.optics.covariance), truth.time_utc, self.field_deg, f"frame {self.sights}"
        )

    def sight(self) -> Task[Sighting | NoSolution | None]:
        """As a source."""
        yield Progress("expose")
        return self.look()

    def turn(self, direction: Direction, degrees: float) -> Task[float | None]:
        """As a turner: the mount moves at its rate, then settles."""
        yield Progress("turn")
        self.rig.mount.move(direction, RATE_DEG_S)
        self.rig.clock.sleep(degrees / RATE_DEG_S)
        self.rig.mount.halt()
        self.rig.wait_until_still(2.0)
        return degrees

    def turn_bolt(self, instruction: Instruction) -> None:
        """A person follows an instruction, with an error of 5 % and a degree of the bolt's turn."""
        if instruction.knob is None:
            return
        turns = instruction.turns * (1.0 + 0.05 * self.rng.normal()) + self.rng.normal() / 360.0
        arcmin = turns * self.arcmin_a_turn[instruction.knob]
        self.rig.mount.turn_bolts(*((arcmin, 0.0) if instruction.knob is Knob.ALTITUDE else (0.0, arcmin)))

    def point_elsewhere(self) -> None:
        """As a person does when another part of the sky is better."""
        self.point(*random_place(self.rng, self.rig.config.site.latitude_deg, ANY_HOUR_DEG, LOWEST_DEG))

    def point(self, hour_deg: float, dec_deg: float) -> None:
        """Stand at this hour angle and declination of the mount's own axis."""
        self.rig.mount.place(hour_deg, dec_deg)
        self.pointing_deg = (hour_deg, dec_deg)

    def truth(self) -> Floats:
        """The axis (3,) in E, N, U as it really is."""
        return self.rig.mount.wedge.axis_enu()

    def true_total_arcsec(self) -> float:
        """How far it really is from the pole."""
        return self.rig.truth().axis_error().total_arcsec

    @property
    def hidden_total_arcmin(self) -> float:
        """How far from the pole it stood at first, on the sky."""
        altitude, azimuth = self.rig.config.mount.misalignment_arcmin
        return float(np.hypot(altitude, azimuth * np.cos(np.radians(self.rig.config.site.latitude_deg))))

    def missed_arcsec(self, error: PolarError) -> float:
        """How far the measured axis is from the true one."""
        return float(np.linalg.norm(error.axis - self.truth())) / ARCSEC


def make_rig(rng: np.random.Generator, latitude_deg: float | None = None) -> RigSky:
    """A rig with everything drawn by chance: site, sky, misalignment, bolts, tracking."""
    latitude = float(rng.uniform(-60.0, 70.0)) if latitude_deg is None else latitude_deg
    site = Site(latitude, float(rng.uniform(-180, 180)), float(rng.uniform(0, 2000)))
    off_arcmin = float(np.exp(rng.uniform(np.log(1.0), np.log(300.0))))
    angle = float(rng.uniform(0.0, 2.0 * np.pi))
    hour, dec = random_place(rng, latitude, ANY_HOUR_DEG, LOWEST_DEG)
    # A knob turns about the vertical: on the sky the pole moves by cos(latitude) of it.
    azimuth = off_arcmin * np.cos(angle) / np.cos(np.radians(latitude))
    threads = {knob: float(rng.uniform(15.0, 70.0) * rng.choice([-1.0, 1.0])) for knob in Knob}
    mount = MountConfig(
        misalignment_arcmin=(off_arcmin * np.sin(angle), azimuth),
        build=Build(cone_deg=float(rng.normal() * 0.2), camera_roll_deg=float(rng.uniform(0, 360))),
        bolts=BoltErrors(tuple(rng.uniform(0.0, 3.0, 2)), tuple(rng.normal(0.0, 0.01, 2))),
        german=False,
    )
    config = RigConfig(
        seed=int(rng.integers(1 << 30)),
        site=site,
        mount=mount,
        start_deg=(hour, dec),
        tracking=bool(rng.integers(2)),
        date_unix=1.8e9 + float(rng.uniform(0, 3e7)),
    )
    sky = RigSky(PracticeRig(config), threads, Optics(2.0, 20.0), rng)
    sky.pointing_deg = (hour, dec)
    return sky


# -- The person of the polar bench: points the telescope and follows the tutor ------------------

ALIGN = AlignOptions(30.0, sweep=Sweep(frames=7, most_frames=25, goal_arcsec=4.0, least_deg=60.0))
PLACING = Sweep(turn_deg=90.0, frames=15, most_frames=15)
PLACES = 40
MOST_MOVES = 15
MOST_PLACES = 2000


def follow(sky: RigSky, options: AlignOptions = ALIGN) -> Alignment:
    """Align while a person follows the tutor, who gives up after too many moves."""
    controls, followed = PolarControls(), None

    def person(update: Any) -> None:
        nonlocal followed
        new = update.instruction if isinstance(update, PolarUpdate) else None
        if new is None or new is followed:
            return
        followed = new
        if update.moves > MOST_MOVES:
            controls.press(PolarButton.ENOUGH)
        if new.knob is not None:
            sky.turn_bolt(new)
            controls.press(PolarButton.TURNED)

    task = align(sky, sky, sky.settings, options, controls, BoltTutor())
    return run_task(task, person)


def point_for_sweep(sky: RigSky) -> RigSky:
    """Point anew until a sweep of 60 deg stays above 15 deg one way."""
    for _ in range(MOST_PLACES):
        there = to_local(sky.look(), sky.settings.site, sky.settings.refraction)
        ways = (sweep_path(there.boresight, sky.settings, d, 60.0) for d in (Direction.WEST, Direction.EAST))
        if any(w.good for w in ways):
            return sky
        sky.point_elsewhere()
    raise RuntimeError("no part of the sky allows a sweep of 60 deg")


def point_where_best(sky: RigSky) -> None:
    """Of some places anywhere, the one the planner likes best; it tells before anything turns."""
    best, least = sky.pointing_deg, float("inf")
    for _ in range(PLACES):
        first = to_local(sky.look(), sky.settings.site, sky.settings.refraction)
        foreseen = foreseen_arcsec(first, sky.settings, PLACING)
        if foreseen < least:
            best, least = sky.pointing_deg, foreseen
        sky.point_elsewhere()
    sky.point(*best)
