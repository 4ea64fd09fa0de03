"""INDI's own LX200 driver, written by other people, takes our TCP port for a telescope and steers it."""

import pytest

from kochab.core.attitude import apart_deg
from kochab.server.telescope.offer import Offer
from kochab.workflows.telescope.offered import OfferedTelescope
from tests.gear.mounts.indi_server import indi_server
from tests.server.telescope.conftest import NIGHT, Pushed, wait_for
from tests.server.telescope.test_offered import from_date

DRIVER = "LX200 Basic"
COORDINATES = f"{DRIVER}.EQUATORIAL_EOD_COORD"


def test_goto_sync_and_stop_by_indi_lx200basic(tmp_path) -> None:
    with indi_server(tmp_path, "indi_lx200basic") as server:
        mount = Pushed()
        telescope = OfferedTelescope(print, mount, may_move=True, now=lambda: NIGHT)
        telescope.see_mount(from_date(75.0, 20.0))
        offer = Offer(telescope, {"lx200": 0})
        try:
            server.set(
                f"{DRIVER}.CONNECTION_MODE.CONNECTION_TCP=On",
                f"{DRIVER}.DEVICE_ADDRESS.ADDRESS;PORT=127.0.0.1;{offer.ports['lx200']}",
                f"{DRIVER}.CONNECTION.CONNECT=On",
            )
            assert wait_for(lambda: server.get(f"{COORDINATES}.RA") not in ("", "0"))
            assert float(server.get(f"{COORDINATES}.RA")) == pytest.approx(5.0, abs=1 / 3600.0)
            assert float(server.get(f"{COORDINATES}.DEC")) == pytest.approx(20.0, abs=1 / 3600.0)
            server.set(f"{DRIVER}.ON_COORD_SET.TRACK=On", f"{COORDINATES}.RA;DEC=6.5;-12.25")
            assert wait_for(lambda: "goto" in mount.orders)
            asked = telescope.target.ra_deg, telescope.target.dec_deg
            assert apart_deg(asked, from_date(97.5, -12.25)) * 3600.0 < 0.1
            telescope.see_mount(asked)
            assert wait_for(lambda: server.get(f"{COORDINATES}._STATE") == "Ok")
            server.set(f"{DRIVER}.ON_COORD_SET.SYNC=On", f"{COORDINATES}.RA;DEC=6.4;-12")
            assert wait_for(lambda: "accept_sync" in mount.orders)
            server.set(f"{DRIVER}.TELESCOPE_ABORT_MOTION.ABORT=On")
            assert wait_for(lambda: "stop" in mount.orders)
        finally:
            offer.stop()
