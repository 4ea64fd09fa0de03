"""A phone's gyroscope between two solves on the practice rig's push-to mount: its camera, a simulated phone, and hands.

The phone (:mod:`tests.gear.phyphox_phone`) was written from phyphox's own sources without reading what is tested here.
"""

import math
import random
import time
from datetime import UTC, datetime

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.workflows.telescope.encoder_aid import EncoderAid
from kochab.workflows.telescope.gyro_aid import GyroAid, pointing_aid
from tests.gear.dsc_box import DscBox
from tests.gear.phyphox_phone import PhyphoxPhone
from tests.server.telescope.conftest import wait_for
from tests.workflows.test_encoder_aid import SITE, PushedRig

IN_ITS_CLAMP = Rotation.from_euler("xyz", (70.0, -25.0, 130.0), degrees=True).as_matrix()
PUSHED_IN_S, STEP_S = 2.0, 0.02


class Phone(PhyphoxPhone):
    """Clamped to the rig's tube. Hands turn it as smoothly as they do; what it sees is what the rig's camera sees."""

    def __init__(self, rig: PushedRig, **values) -> None:
        self.clamp = IN_ITS_CLAMP
        self._now = rig.rig.truth().attitude.matrix
        super().__init__(lambda: self.clamp @ self._now, rate_hz=50.0, **values)

    def turn_to(self, end: np.ndarray) -> None:
        """From where it was, in two seconds, beginning and ending at rest."""
        start, began = self._now, time.monotonic()
        way = Rotation.from_matrix(end @ start.T).as_rotvec()
        while (share := (time.monotonic() - began) / PUSHED_IN_S) < 1.0:
            eased = 0.5 - 0.5 * math.cos(math.pi * share)
            self._now = Rotation.from_rotvec(eased * way).as_matrix() @ start
            time.sleep(STEP_S)
        self._now = end


class PhoneOnRig(PushedRig):
    phone: Phone

    def push(self, ra, dec):
        super().push(ra, dec)
        self.phone.turn_to(self.rig.truth().attitude.matrix)


@pytest.fixture
def pushed():
    rig = PhoneOnRig()
    with Phone(rig, scale=(1.008, 0.994, 1.011)) as phone:
        rig.phone = phone
        rig.telescope.aid = pointing_aid(f"http://{phone.address}/", rig.said.append, rig.rig.clock.now_utc, SITE)
        yield rig
        rig.close()


def test_between_solves_the_phone_leads_within_ten_minutes_of_arc(pushed) -> None:
    """Nobody says how the phone sits on the tube, what it shows at rest, or how its axes are scaled."""
    assert wait_for(lambda: any("gyroscope is connected" in sentence for sentence in pushed.said))
    hands = random.Random(1)
    for ra, dec in ((0.0, 0.0), (9.0, 7.0), (-16.0, -4.0), (7.0, -9.0), (-8.0, 8.0)):
        pushed.push(ra, dec)
        pushed.solve()
    offs = []
    for _ in range(4):
        pushed.push(hands.uniform(-12.0, 12.0), hands.uniform(-5.0, 5.0))
        off, sigma = pushed.off_deg()
        offs.append(off)
        assert off < 3.0 * sigma
        assert sigma < 15.0 / 60.0
        pushed.solve()
    assert max(offs) < 10.0 / 60.0
    assert not any("slid" in sentence for sentence in pushed.said)

    pushed.phone.clamp = Rotation.from_euler("z", 20.0, degrees=True).as_matrix() @ IN_ITS_CLAMP  # it slides
    pushed.push(8.0, -6.0)
    pushed.solve()
    assert wait_for(lambda: any("the phone slid" in sentence for sentence in pushed.said))

    pushed.phone.says = b"\x00garbage"
    assert wait_for(lambda: any("shows no gyroscope" in sentence for sentence in pushed.said))
    assert wait_for(lambda: pushed.telescope.seen.sigma_deg == 0.0)  # the last solve, and nothing that was felt
    pushed.phone.says = None
    assert wait_for(lambda: "The phone answers again." in pushed.said)
    pushed.phone.pull()
    assert wait_for(lambda: any("Lost the phone" in sentence for sentence in pushed.said))
    assert len(pushed.said) == len(set(pushed.said))


def test_an_address_with_http_is_a_phone_and_any_other_a_box() -> None:
    with DscBox(lambda: (0.0, 0.0), in_a_turn=(8192, 8192)) as box, PhyphoxPhone(lambda: np.eye(3)) as phone:
        for address, kind in ((box.port, EncoderAid), (f"http://{phone.address}", GyroAid)):
            aid = pointing_aid(address, lambda _: None, lambda: datetime.now(UTC))
            aid.stop()
            assert type(aid) is kind
