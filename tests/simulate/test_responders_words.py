"""How simulated controllers write and read angles and times, and what they precess."""

from datetime import timedelta

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.attitude import apart_deg
from kochab.simulate.responders import LocalSettings, horizontal_deg
from kochab.simulate.responders.lx200 import degrees, hours, parse
from kochab.simulate.responders.nexstar import SynScanResponder, read_pair, written_pair
from kochab.simulate.responders.skywatcher import low_first, number
from tests.simulate.bench_telescope import BenchTelescope

RA = st.floats(0.0, 360.0, exclude_max=True)
DEC = st.floats(-90.0, 90.0)


def turned(degrees_apart):
    return abs((degrees_apart + 180.0) % 360.0 - 180.0)


@given(RA, st.sampled_from([(False, 0, 360.0), (True, 0, 15.0), (True, 4, 0.0015)]))
def test_hours_are_read_back_to_half_their_last_digit(ra, form):
    precise, decimals, unit_arcsec = form
    text = hours(ra, precise, decimals)
    assert len(text) == (7 if not precise else 8 + (decimals and decimals + 1))
    read = parse(text, 24.0)
    unit_arcsec = 90.0 if not precise else unit_arcsec  # a tenth of a minute of time
    assert turned(read * 15.0 - ra) * 3600.0 <= unit_arcsec / 2.0 + 1e-6


@given(DEC, st.sampled_from([(False, 0, 60.0), (True, 0, 1.0), (True, 3, 0.001)]))
def test_degrees_are_read_back_to_half_their_last_digit(dec, form):
    precise, decimals, unit_arcsec = form
    read = parse(degrees(dec, precise, b"\xdf", decimals=decimals), 90.0)
    assert abs(read - dec) * 3600.0 <= unit_arcsec / 2.0 + 1e-6


@pytest.mark.parametrize(
    ("written", "text"),
    [
        (hours(359.9999, True), b"00:00:00"),
        (hours(359.99, False), b"00:00.0"),
        (degrees(-0.5 / 3600.0 / 2, True), b"+00*00:00"),
        (degrees(-0.25, False), b"-00*15"),
        (degrees(29.99999, True), b"+30*00:00"),
        (degrees(8.25, False, width=3, signed=False), b"008*15"),
    ],
)
def test_seconds_carry_and_nought_has_no_minus(written, text):
    assert written == text


@given(RA, DEC)
def test_a_nexstar_angle_of_24_bits_is_within_a_twentieth_of_an_arcsecond(ra, dec):
    read = read_pair(written_pair(ra, dec, 8)[:-1], 8)
    assert read is not None
    assert turned(read[0] - ra) * 3600.0 < 0.04
    assert abs(read[1] - dec) * 3600.0 < 0.04


@pytest.mark.parametrize("text", [b"", b"3AAAAAAA", b"3AAAAAAA;F749F49F", b"3AAAAAAG,F749F49F"])
def test_what_is_no_pair_is_refused(text):
    with pytest.raises(ValueError, match="no pair"):
        read_pair(text, 8)


@given(st.integers(0, 0xFFFFFF))
def test_24_bits_low_byte_first(value):
    assert number(low_first(value)) == value
    assert low_first(0x123456) == b"563412"


@pytest.mark.parametrize("year", [1995.0, 2026.9, 2050.0])
def test_a_synscan_precesses_as_astropy_does(year):
    from astropy.coordinates import FK5, SkyCoord
    from astropy.time import Time

    synscan = SynScanResponder(BenchTelescope(now=lambda: 946728000.0 + (year - 2000.0) * 31557600.0))
    rng = np.random.default_rng(3)
    for ra, dec in zip(rng.uniform(0, 360, 20), rng.uniform(-89, 89, 20), strict=True):
        there = SkyCoord(ra, dec, unit="deg", frame=FK5(equinox="J2000"))
        dated = there.transform_to(FK5(equinox=Time(year, format="jyear")))
        ours = synscan.to_date(ra, dec)
        assert apart_deg(ours, (dated.ra.deg, dated.dec.deg)) * 3600.0 < 0.2
        assert apart_deg(synscan.from_date(*ours), (ra, dec)) * 3600.0 < 1e-6


def test_azimuth_runs_from_north_over_east():
    telescope = BenchTelescope(latitude_deg=50.0, now=lambda: 0.0)
    meridian = telescope.sidereal_deg()
    for hour, dec, altitude, azimuth in ((0.0, 20.0, 60.0, 180.0), (0.0, 80.0, 60.0, 0.0), (-90.0, 0.0, 0.0, 90.0)):
        telescope.sync((meridian - hour) % 360.0, dec)
        told = horizontal_deg(telescope, 50.0)
        assert told[0] == pytest.approx(altitude, abs=1e-6)
        assert turned(told[1] - azimuth) < 1e-6


def test_a_time_told_moves_the_controllers_clock_and_nothing_else():
    telescope = BenchTelescope(now=lambda: 1_767_268_800.0)
    settings = LocalSettings(telescope)
    sidereal = telescope.sidereal_deg()
    settings.utc_offset_h = 1.0
    settings.set_local(hour=14)
    assert settings.clock_error == timedelta(hours=1)
    with pytest.raises(ValueError, match="day"):
        settings.set_local(month=2, day=30)
    assert settings.clock_error == timedelta(hours=1)
    assert telescope.sidereal_deg() == sidereal
