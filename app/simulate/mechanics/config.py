"""How a mount is built, how badly it stands and how it moves."""

from dataclasses import dataclass, field

from app.core.hint import Site
from app.simulate.mechanics.bolts import BoltWear
from app.simulate.mechanics.geometry import Build
from app.simulate.mechanics.wear import AxisWear


@dataclass(frozen=True, slots=True)
class MountConfig:
    """How a mount is built, how badly it stands and how it moves. Degrees unless named.

    ``misalignment_arcmin`` is the altitude and raw azimuth error of the axis against the
    refracted pole. ``past_meridian_deg`` is how far a German mount may follow beyond the meridian.
    ``approach_deg`` is how far a goto at least goes towards greater angles at its end, against
    the play of its gears, as many hand controllers do; 0 for not at all.
    ``computer_clock_s`` and ``computer_site`` are what its own computer has wrong.
    """

    misalignment_arcmin: tuple[float, float] = (0.0, 0.0)
    build: Build = field(default_factory=Build)
    hour_wear: AxisWear = field(default_factory=AxisWear)
    dec_wear: AxisWear = field(default_factory=AxisWear)
    bolts: BoltWear = field(default_factory=BoltWear)
    slew_deg_s: float = 4.0
    acceleration_deg_s2: float = 2.0
    approach_deg: float = 0.0
    guide_rate: float = 0.5  # of sidereal
    horizon_deg: float = 0.0
    german: bool = True
    past_meridian_deg: float = 15.0
    computer_clock_s: float = 0.0
    computer_site: Site | None = None
    aligned: bool = True
