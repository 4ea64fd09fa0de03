"""The practice rig as a polar alignment sees it: solved frames, a turning mount, a person's hands.

Nothing of ``app.polar`` computes what is true here: where the camera looks, where its axis is and
what the bolts do is the rig's, which has its own geometry and its own way through ERFA. A solve is
replaced by the truth with errors of a given size about the camera's own axes; the rig's truth
weighs all directions of the field alike under the air's squeeze, as a square frame does. The air
moves each frame as a whole by 0.7 arcsec besides, which no solve can know of.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from app.core.attitude import Attitude
from app.core.hint import Site
from app.core.mount import Direction
from app.core.progress import Progress, Task
from app.core.solution import NoSolution
from app.polar.bolts import Knob
from app.polar.error import PolarError
from app.polar.horizon import Air
from app.polar.measure import Settings
from app.polar.plan import Optics
from app.polar.poles import Pole
from app.polar.sighting import Sighting
from app.polar.tutor import Instruction
from app.simulate.mechanics.bolts import BoltWear
from app.simulate.mechanics.geometry import Build
from app.simulate.mechanics.mount import MountConfig
from app.simulate.rig import PracticeRig, RigConfig
from app.sky.catalogue import Catalogue

Floats = NDArray[np.float64]

ARCSEC = np.pi / 648000.0
DOWN = np.array([0.0, 0.0, -1.0])
EXPOSURE_S, OVERHEAD_S = 1.0, 1.0
LOWEST_DEG = 20.0
RATE_DEG_S = 2.0


@dataclass(frozen=True, slots=True)
class Hidden:
    """What a run does not know: the misalignment, the bolts and the hands that turn them."""

    altitude_arcmin: float
    azimuth_arcmin: float
    arcmin_a_turn: dict[Knob, float]
    hour_deg: float
    dec_deg: float


@dataclass(slots=True, eq=False)
class RigSky:
    """A rig with the three things an alignment needs; ``optics`` are the errors of its solves.

    ``rest_arcsec`` (3, 3) turns the camera about its own axes by so much times gravity's pull.
    """

    rig: PracticeRig
    hidden: Hidden
    optics: Optics
    rng: np.random.Generator
    by_hand: bool = False
    told_deg: float | None = None
    sights: int = 0
    stands_deg: tuple[float, float] = (0.0, 0.0)
    field_deg: tuple[float, float] = (1.2, 1.2)
    seeing_arcsec: float = 0.7
    rest_arcsec: Floats = field(default_factory=lambda: np.zeros((3, 3)))

    @property
    def settings(self) -> Settings:
        """The site, and the air of this night."""
        air = self.rig.config.air
        return Settings(
            self.rig.config.site, Pole.REFRACTED,
            Air(air.pressure_hpa, air.temperature_c, air.humidity, air.wavelength_um),
        )  # fmt: skip

    def look(self) -> Sighting:
        """Expose and solve: the truth at mid-exposure with the errors of a solve."""
        start = self.rig.clock.now_unix()
        self.rig.clock.sleep(EXPOSURE_S + OVERHEAD_S)
        truth = self.rig.truth(start + EXPOSURE_S / 2.0)
        error = self.rng.normal(size=3) * np.sqrt(np.diag(self.optics.covariance))
        error[:2] += self.rng.normal(size=2) * self.seeing_arcsec * ARCSEC
        error += self.rest_arcsec @ truth.enu_to_camera @ DOWN * ARCSEC
        matrix = Rotation.from_rotvec(error).as_matrix() @ truth.attitude.matrix
        self.sights += 1
        return Sighting(
            Attitude(matrix, self.optics.covariance), truth.time_utc, self.field_deg,
            f"frame {self.sights}",
        )  # fmt: skip

    def sight(self) -> Task[Sighting | NoSolution | None]:
        """As a source."""
        yield Progress("expose")
        return self.look()

    def turn(self, direction: Direction, degrees: float) -> Task[None]:
        """As a turner: the mount moves at its rate, then settles."""
        yield Progress("turn")
        self.rig.mount.move(direction, RATE_DEG_S)
        self.rig.clock.sleep(degrees / RATE_DEG_S)
        self.rig.mount.halt()
        self.rig.wait_until_still(2.0)
        self.told_deg = degrees

    def turn_declination(self, direction: Direction, degrees: float) -> Task[None]:
        """The same with the other axis."""
        yield from self.turn(direction, degrees)

    def hand(self, told: Instruction) -> None:
        """A person follows an instruction: 5 % and a degree of the bolt's turn are not told."""
        if told.knob is None:
            return
        turns = told.turns * (1.0 + 0.05 * self.rng.normal()) + self.rng.normal() / 360.0
        arcmin = turns * self.hidden.arcmin_a_turn[told.knob]
        if told.knob is Knob.ALTITUDE:
            self.rig.mount.turn_bolts(arcmin, 0.0)
        else:
            self.rig.mount.turn_bolts(0.0, arcmin)

    def point_elsewhere(self) -> None:
        """As a person does who is told that another part of the sky is better."""
        self.point(*somewhere(self.rng, self.rig.config.site.latitude_deg))

    def point(self, hour_deg: float, dec_deg: float) -> None:
        """Stand at this hour angle and declination of the mount's own axis."""
        self.rig.mount.place(hour_deg, dec_deg)
        self.stands_deg = (hour_deg, dec_deg)

    def truth(self) -> Floats:
        """The axis (3,) in E, N, U as it really is."""
        return self.rig.mount.wedge.axis_enu()

    def true_total_arcsec(self) -> float:
        """How far it really is from the pole."""
        return self.rig.truth().axis_error().total_arcsec

    @property
    def hidden_total_arcmin(self) -> float:
        """How far from the pole it stood at first, on the sky."""
        azimuth = self.hidden.azimuth_arcmin * np.cos(np.radians(self.rig.config.site.latitude_deg))
        return float(np.hypot(self.hidden.altitude_arcmin, azimuth))

    def missed_arcsec(self, error: PolarError) -> float:
        """How far the measured axis is from the true one."""
        return float(np.linalg.norm(error.axis - self.truth())) / ARCSEC


def make_rig(
    rng: np.random.Generator, catalogue: Catalogue, latitude_deg: float | None = None
) -> RigSky:
    """A rig with everything drawn by chance: site, sky, misalignment, bolts, tracking."""
    latitude = float(rng.uniform(-60.0, 70.0)) if latitude_deg is None else latitude_deg
    site = Site(latitude, float(rng.uniform(-180, 180)), float(rng.uniform(0, 2000)))
    off_arcmin = float(np.exp(rng.uniform(np.log(1.0), np.log(300.0))))
    angle = float(rng.uniform(0.0, 2.0 * np.pi))
    hour, dec = somewhere(rng, latitude)
    hidden = Hidden(
        off_arcmin * np.sin(angle),
        off_arcmin * np.cos(angle) / np.cos(np.radians(latitude)),
        {knob: float(rng.uniform(15.0, 70.0) * rng.choice([-1.0, 1.0])) for knob in Knob},
        hour, dec,
    )  # fmt: skip
    mount = MountConfig(
        misalignment_arcmin=(hidden.altitude_arcmin, hidden.azimuth_arcmin),
        build=Build(cone_deg=float(rng.normal() * 0.2), camera_roll_deg=float(rng.uniform(0, 360))),
        bolts=BoltWear(tuple(rng.uniform(0.0, 3.0, 2)), tuple(rng.normal(0.0, 0.01, 2))),
        german=False,
    )
    config = RigConfig(
        seed=int(rng.integers(1 << 30)), site=site, mount=mount, start_deg=(hour, dec),
        tracking=bool(rng.integers(2)), date_unix=1.8e9 + float(rng.uniform(0, 3e7)),
    )  # fmt: skip
    sky = RigSky(PracticeRig(config, catalogue), hidden, Optics(2.0, 20.0), rng)
    sky.stands_deg = (hour, dec)
    return sky


def somewhere(rng: np.random.Generator, latitude_deg: float) -> tuple[float, float]:
    """Hour angle and declination, degrees, of a place evenly on the sky above 25 degrees."""
    p = np.radians(latitude_deg)
    while True:
        hour, sine = float(rng.uniform(-180.0, 180.0)), float(rng.uniform(-1.0, 1.0))
        dec = float(np.arcsin(sine))
        high = np.sin(p) * sine + np.cos(p) * np.cos(dec) * np.cos(np.radians(hour))
        if high > np.sin(np.radians(25.0)):
            return hour, float(np.degrees(dec))
