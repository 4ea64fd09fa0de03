"""Encoders between two solves on the practice rig's push-to mount: its camera, a box on a pseudo-terminal, and hands."""

import random
import time
from datetime import UTC, datetime, timedelta

import pytest

from kochab.core.attitude import apart_deg
from kochab.core.capture import CaptureSettings
from kochab.core.frame import Site
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.gear.cameras import open_camera
from kochab.simulate.practice import practise
from kochab.solver import SolveOptions
from kochab.workflows.goto_target import target_at
from kochab.workflows.solve_frame import solve_open_frame
from kochab.workflows.telescope.encoder_aid import EncoderAid
from kochab.workflows.telescope.offered import OfferedTelescope
from kochab.workflows.telescope.push_to import push_to
from tests.gear.dsc_box import DscBox
from tests.server.telescope.conftest import wait_for

SITE = Site(48.0, 11.0)


class PushedRig:
    """The practice telescope with its drive off: hands push its axes, encoders on them are read, its camera solves."""

    def __init__(self, seed=3):
        self.night = practise(site=SITE, misalign_arcmin=40.0, rate=1.0, fov_deg=4.0, seed=seed)
        self.night.do("track off")
        self.rig, self.pushed, self.said = self.night.rig, [0.0, 0.0], []
        self.camera = open_camera("simulated", self.night.camera, CaptureSettings(exposure_s=0.3))
        self.telescope = OfferedTelescope(self.said.append, now=self.rig.clock.now_utc, site=SITE)

    def push(self, ra, dec):
        """Hands turn the axes; encoders turn with them."""
        self.night.do(f"ra {ra:.4f}")
        self.night.do(f"dec {dec:.4f}")
        self.pushed[0] += ra
        self.pushed[1] += dec

    def solve(self):
        """A frame that began after the hands were off, solved and shown."""
        time.sleep(1.5)  # still for as long as the aid asks for
        until, after = time.monotonic() + 120.0, self.rig.clock.now_utc() + timedelta(seconds=0.3)
        while time.monotonic() < until:
            frame = self.camera.next_frame(1.0)
            if frame is None or frame.hint.time_utc < after:
                continue
            result = run(solve_open_frame(frame, SolveOptions())).result
            if isinstance(result, Solution):
                ago = (self.rig.clock.now_utc() - frame.hint.time_utc).total_seconds()
                self.telescope.see_solution(result, time.monotonic() - ago)
                return
        raise AssertionError("no frame was solved")

    def off_deg(self):
        """How far the telescope is from where it is said to be by a look since the hands were off, and its sigma."""
        pushed_s, said = time.monotonic(), []

        def looked():
            seen = self.telescope.seen
            said[:] = [seen]
            return seen.sigma_deg > 0.0 and seen.at_s > pushed_s

        assert wait_for(looked)
        return apart_deg(said[0].icrs_deg, self.rig.truth().attitude.ra_dec_deg), said[0].sigma_deg

    def close(self):
        if self.telescope.aid is not None:
            self.telescope.aid.stop()
        self.camera.close()
        self.night.stop()


@pytest.fixture
def pushed():
    rig = PushedRig()
    with DscBox(lambda: tuple(rig.pushed), in_a_turn=(8192, 8192)) as box:
        rig.box = box
        rig.telescope.aid = EncoderAid(box.port, rig.said.append, rig.rig.clock.now_utc, SITE)
        yield rig
        rig.close()


def test_without_a_site_it_says_how_the_axes_are_taken() -> None:
    """A Dobsonian's encoders would be read as hour angle and declination, and be wrong between two solves."""
    for site in (None, SITE):
        said = []
        with DscBox(lambda: (0.0, 0.0), in_a_turn=(8192, 8192)) as box:
            aid = EncoderAid(box.port, said.append, lambda: datetime.now(UTC), site)
            assert wait_for(lambda: said)  # noqa: B023 (asked at once)
            aid.stop()
        assert any("For a Dobsonian, set your site" in sentence for sentence in said) == (site is None), said


def test_between_solves_the_encoders_lead_within_five_minutes_of_arc(pushed) -> None:
    """Nobody says what the encoders count, which way, that the mount is equatorial, or that its axis is 40' off."""
    assert wait_for(lambda: any("Encoders connected" in sentence for sentence in pushed.said))
    hands = random.Random(1)
    for ra, dec in ((0.0, 0.0), (9.0, 7.0), (-16.0, -4.0), (7.0, -9.0)):
        pushed.push(ra, dec)
        pushed.solve()
    offs = []
    for _ in range(5):
        pushed.push(hands.uniform(-12.0, 12.0), hands.uniform(-5.0, 5.0))
        off, sigma = pushed.off_deg()
        offs.append(off)
        assert off < 3.0 * sigma
        assert sigma < 8.0 / 60.0
    assert max(offs) < 5.0 / 60.0
    assert not any("slipped" in sentence for sentence in pushed.said)

    pushed.telescope.target = target_at(*pushed.rig.truth().attitude.ra_dec_deg)
    assert wait_for(lambda: push_to(pushed.telescope, time.monotonic()).there)
    assert wait_for(lambda: "±" in push_to(pushed.telescope, time.monotonic()).distance_text)

    pushed.box.offset[0] += 100  # 4.4 degrees
    pushed.solve()
    assert wait_for(lambda: any("slipped" in sentence for sentence in pushed.said))
    pushed.push(5.0, 3.0)
    assert pushed.off_deg()[0] < 5.0 / 60.0

    pushed.box.says = b"\x00garbage\r"
    assert wait_for(lambda: any("no two counts" in sentence for sentence in pushed.said))
    assert wait_for(lambda: pushed.telescope.seen.sigma_deg == 0.0)  # the last solve, and nothing that was counted
    pushed.box.says = None
    assert wait_for(lambda: "The encoders answer again." in pushed.said)
    pushed.box.pull()
    assert wait_for(lambda: any("Lost the encoders" in sentence for sentence in pushed.said))
    pushed.solve()
    assert pushed.telescope.seen.sigma_deg == 0.0
    assert len(pushed.said) == len(set(pushed.said))
