"""Tracking rate and drift of a mount nobody here wrote: INDI's telescope simulator, tracking and not tracking."""

import time
from datetime import UTC, datetime

import pytest

from kochab.workflows.night.tracking import SIDEREAL_ARCSEC_S, Place, tracking_of
from tests.gear.mounts.indi_server import indi_server

pytest.importorskip("indipyclient")
MOUNT = "Telescope Simulator"
RATES = {"TRACK_ON": SIDEREAL_ARCSEC_S, "TRACK_OFF": 0.0}
"""Arcsec a second of the RA axis; INDI's own steps make other rates as they are not named."""
READINGS, EVERY_S = 25, 1.0


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    with indi_server(tmp_path_factory.mktemp("indi"), "indi_simulator_telescope") as server:
        for asked in ("CONNECTION.CONNECT=On", "TELESCOPE_PARK.UNPARK=On"):
            server.set(f"{MOUNT}.{asked}")
        yield server


@pytest.mark.parametrize("rate", RATES)
def test_the_rate_at_which_indis_simulator_tracks_is_found(server, rate) -> None:
    server.set(f"{MOUNT}.TELESCOPE_TRACK_STATE.{rate}=On")
    time.sleep(3.0)
    places = []
    for _ in range(READINGS):
        time.sleep(EVERY_S)
        ra, dec = (float(server.get(f"{MOUNT}.EQUATORIAL_EOD_COORD.{member}")) for member in ("RA", "DEC"))
        places.append((datetime.now(UTC), 15.0 * ra, dec))
    first = places[0][1]
    (found,) = tracking_of([Place(at, ra, dec, 2.0, axis_arcsec=3600.0 * (ra - first)) for at, ra, dec in places], 0.0)
    assert found.rate_arcsec_s.value == pytest.approx(RATES[rate], abs=3.0 * found.rate_arcsec_s.sigma + 1e-6)
    assert found.rate_arcsec_s.sigma < 0.1
    assert found.untracked == (rate == "TRACK_OFF")
    assert abs(found.dec_arcsec_h.value) <= 3.0 * found.dec_arcsec_h.sigma + 1e-6
