"""The first slew from home reaches whatever is up: at the pole hour angle and side of the pier are rounding noise."""

from time import monotonic

import numpy as np
import pytest

from kochab.core.attitude import apart_deg
from kochab.core.errors import RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Epoch, Home, MountState, PierSide, Pointing
from kochab.core.progress import run
from kochab.gear.mounts.drivers.motor_mount import natural_side
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits, unit_vectors
from kochab.gear.mounts.motion_policy import MotionPolicy
from kochab.gear.mounts.slew_supervisor import SupervisedMotion, allowed_region
from kochab.sky.horizon import altitude_deg, hour_angle_deg, sidereal_deg
from tests.gear.mounts.bench import SITE, place
from tests.gear.mounts.imaginary import NIGHT
from tests.gear.mounts.test_conformance import wait_for
from tests.gear.mounts.test_skywatcher_home import board

TICK_DEG = 360.0 / 9024000.0


def targets(site, limits):
    """Hour angle and declination of what is up, every 15 deg, and beside the meridian."""
    for hour in (*range(-165, 180, 15), -0.5, 0.5):
        for dec in range(-80, 90, 10):
            ra = sidereal_deg(site, NIGHT) - hour
            height = float(altitude_deg(np.atleast_2d(unit_vectors(ra, dec)), site, NIGHT)[0])
            if height > limits.lowest_altitude_deg + 0.5:
                yield float(hour), float(dec), ra % 360.0


@pytest.mark.parametrize("latitude", [66.0, 50.0, 25.0, -33.0])
@pytest.mark.parametrize(("side", "hour"), [(PierSide.WEST, -90.0), (PierSide.EAST, 90.0), (PierSide.WEST, 13.0)])
def test_every_target_that_is_up_is_allowed_from_home(latitude, side, hour) -> None:
    """As the board says it with a tick more or less, and as a mount that reports any hour angle at the pole."""
    site, limits = Site(latitude, 8.0), Limits()
    policy = MotionPolicy(site, limits, lambda: NIGHT)
    pole = np.copysign(90.0 - TICK_DEG, latitude)
    here = Pointing((sidereal_deg(site, NIGHT) - hour) % 360.0, float(pole), Epoch.DATE)
    state = MountState(slewing=False, tracking=False, pier_side=side, home_confirmed=True)
    counted = 0
    for _, dec, ra in targets(site, limits):
        _, preview = policy.goto(here, state, (ra, dec))
        assert preview.allowed, preview.refusals
        counted += 1
    assert counted > 150


@pytest.mark.parametrize("ticks", [(0, -1), (1, 1)])
@pytest.mark.parametrize("hour", [-60.0, 3.0, 60.0])
def test_it_goes_there_and_is_not_taken_for_a_flip_on_its_way(ticks, hour) -> None:
    """L90: Dec may read a tick less after power-up. The telescope is simulated; where it really is counts."""
    with board(slew_deg_s=18.0) as b:
        mount = b.connect(home=Home.NOW)
        mount.offset_deg = tuple(tick * TICK_DEG for tick in ticks)
        guard = Guard(mount, SITE, Limits(), clock=b.clock)
        target = place(hour, 20.0, b.clock)
        run(guard.slew(*target))
        assert apart_deg(b.telescope.believed_deg(), target) < 0.05
        assert mount.side() is natural_side(hour)


@pytest.mark.parametrize(("hour", "dec"), [(-60.0, 20.0), (60.0, 20.0), (-10.0, -33.0)])
def test_a_fork_at_the_pole_may_go_straight_from_the_hour_angle_that_it_reports(hour, dec) -> None:
    policy, sidereal = MotionPolicy(SITE, Limits(crosses_meridian=True), lambda: NIGHT), sidereal_deg(SITE, NIGHT)
    here = Pointing(sidereal, 89.9, Epoch.DATE)
    plan, preview = policy.goto(here, MountState(slewing=False), ((sidereal - hour) % 360.0, dec))
    assert preview.allowed, preview.refusals
    motion = SupervisedMotion(plan, allowed_region(plan))
    for share in np.linspace(0.0, 1.0, 41):
        there = Pointing((sidereal - share * hour) % 360.0, 89.9 + share * (dec - 89.9), Epoch.DATE)
        assert motion.finding(there, NIGHT, monotonic()) is None


@pytest.mark.parametrize(("hour", "polar_distance", "refused"), [(-15.0, 0.65, True), (-80.0, 0.65, False)])
def test_a_star_beside_the_pole_that_is_tracked_still_has_its_side(hour, polar_distance, refused) -> None:
    """Polaris with the counterweight out: to the other side is half a turn of the RA axis. At home it is none."""
    policy = MotionPolicy(SITE, Limits(), lambda: NIGHT)
    here = Pointing((sidereal_deg(SITE, NIGHT) - hour) % 360.0, 90.0 - polar_distance, Epoch.DATE)
    state = MountState(slewing=False, pier_side=PierSide.WEST)
    _, preview = policy.goto(here, state, ((sidereal_deg(SITE, NIGHT) - 20.0) % 360.0, 30.0))
    assert bool(preview.refusals) is refused
    assert "flip" in preview.refusals[0] if refused else True


def test_a_correction_just_past_the_meridian_does_not_flip_the_mount() -> None:
    """Half an hour after its transit an object is centred again: the telescope stays on its side."""
    with board() as b:
        mount = b.connect(home=Home.NOW)
        mount.goto(*place(-1.0, 30.0, b.clock))
        wait_for(lambda: mount.state().slewing is False)
        mount.offset_deg = (mount.offset_deg[0] + 8.0, mount.offset_deg[1])  # as if 32 minutes had passed
        assert hour_angle_deg(mount.position().ra_deg, SITE, b.clock()) == pytest.approx(7.0, abs=0.1)
        guard = Guard(mount, SITE, Limits(), clock=b.clock)
        run(guard.slew(*place(7.2, 30.1, b.clock)))
        assert mount.side() is PierSide.WEST
        far = place(40.0, 30.0, b.clock)
        with pytest.raises(RefusedError, match="a flip is due"):
            mount.goto(*far)
        assert mount.state().slewing is False
