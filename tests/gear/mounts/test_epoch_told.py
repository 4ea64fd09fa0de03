"""A mount's altitude and azimuth betray the epoch of its right ascension and declination."""

from dataclasses import replace

import pytest

from kochab.core.attitude import apart_deg
from kochab.core.errors import NoAnswerError
from kochab.core.frame import Site
from kochab.core.mount import Epoch, Pointing, SiteReport
from kochab.gear.mounts.coordinates import epoch_of, from_mount_epoch, reported_epoch, to_mount_epoch
from kochab.gear.mounts.drivers.nexstar import SynScan
from kochab.gear.mounts.protocols import ioptron, lx200
from kochab.gear.mounts.serial_line import ProtocolError
from kochab.simulate.responders import RESPONDERS
from kochab.sky.horizon import from_altaz
from tests.gear.mounts.bench import simulated
from tests.gear.mounts.imaginary import NIGHT, SITE, Imaginary, at

TELL = ["lx200", "onstep", "nexstar", "synscan", "ioptron"]


@pytest.mark.parametrize("driver", RESPONDERS)
def test_every_simulated_mount_tells_its_epoch_whatever_it_is_taken_for(driver) -> None:
    with simulated(driver) as bench:
        mount = bench.open()
        try:
            own = Epoch.J2000 if driver == SynScan.name else Epoch.DATE
            for taken in Epoch:
                mount.epoch = taken
                assert reported_epoch(mount) is (own if driver in TELL else None)
        finally:
            mount.close()


def level_of(ra_deg, dec_deg):
    """Altitude and azimuth at the site, by another way than the code's."""
    import erfa
    import numpy as np

    from kochab.sky.horizon import hour_angle_deg

    hour = np.radians(hour_angle_deg(ra_deg, SITE, NIGHT))
    azimuth, altitude = erfa.hd2ae(hour, np.radians(dec_deg), np.radians(SITE.latitude_deg))
    return float(np.degrees(altitude)), float(np.degrees(azimuth)) % 360.0


@pytest.mark.parametrize("place", [(-40.0, 40.0), (60.0, -10.0), (-150.0, 75.0)])
def test_altitude_and_azimuth_are_a_place_of_date(place) -> None:
    assert apart_deg(from_altaz(*level_of(*at(*place)), SITE, NIGHT), at(*place)) < 1e-9


@pytest.mark.parametrize("south", [0.0, 180.0])
def test_each_epoch_is_known_from_either_beginning_of_azimuth(south) -> None:
    date = at(-40.0, 40.0)
    altitude, azimuth = level_of(*date)
    j2000 = from_mount_epoch(Pointing(*date, Epoch.DATE), NIGHT)
    for said, epoch in ((date, Epoch.DATE), (j2000, Epoch.J2000)):
        level = (altitude, (azimuth + south) % 360.0)
        assert epoch_of(Pointing(*said, Epoch.DATE), level, SITE, NIGHT) is epoch


def test_what_fits_neither_is_not_guessed() -> None:
    said = Pointing(*at(-40.0, 40.0), Epoch.DATE)
    altitude, azimuth = level_of(*at(-40.0, 40.0))
    assert epoch_of(said, (altitude + 0.2, azimuth), SITE, NIGHT) is None
    assert epoch_of(said, (altitude, azimuth), Site(SITE.latitude_deg, 9.0), NIGHT) is None


def test_near_the_pole_of_the_ecliptic_both_are_alike() -> None:
    date = to_mount_epoch(270.0, 66.56, Epoch.DATE, NIGHT)
    assert epoch_of(Pointing(*date, Epoch.DATE), level_of(*date), SITE, NIGHT) is None


def test_a_mount_that_does_not_answer_or_does_not_know_its_place_tells_nothing() -> None:
    class Level(Imaginary):
        def altaz_deg(self):
            self._do("level")
            return level_of(*self.here)

        def site_report(self):
            return self.believed

    mount = Level(*at(-40.0, 40.0))
    mount.believed = SiteReport(SITE, NIGHT)
    assert reported_epoch(mount) is Epoch.DATE
    for lacking in (replace(mount.believed, site=None), replace(mount.believed, time_utc=None)):
        mount.believed = lacking
        assert reported_epoch(mount) is None
    mount.fails["level"] = NoAnswerError("The mount does not answer.")
    assert reported_epoch(mount) is None
    assert reported_epoch(Imaginary()) is None


def test_words() -> None:
    assert ioptron.parse_altaz(b"+16200000032400000#") == (45.0, 90.0)
    assert lx200.parse_azimuth(b"123*30#") == 123.5
    assert lx200.parse_azimuth(b"123\xdf30'36#") == pytest.approx(123.51)
    for parse, reply in (
        (ioptron.parse_altaz, b"+1620000003240000#"),
        (ioptron.parse_altaz, b"+32400001000000000#"),
        (lx200.parse_azimuth, b"-10*00#"),
        (lx200.parse_azimuth, b"361*00#"),
    ):
        with pytest.raises(ProtocolError):
            parse(reply)
