"""Positions and motions that any astronomer can look up, against the shipped catalogue.

Places at J2000 are SIMBAD's; motions Hipparcos (van Leeuwen 2007) or Gaia DR3.
"""

import astropy.units as u
import numpy as np
import pytest
from astropy.coordinates import SkyCoord

ARCSEC_PER_RAD = np.degrees(1.0) * 3600.0

KNOWN = {
    # The brightest, and stars whose source gave them at 1991.65 rather than J2000.
    "Polaris": ("02 31 49.095 +89 15 50.79", 44.48, -11.85, 0.4),
    "Hamal": ("02 07 10.406 +23 27 44.70", 188.55, -148.08, 0.4),
    "Caph": ("00 09 10.685 +59 08 59.21", 523.50, -179.77, 0.4),
    "61 Cyg A": ("21 06 53.940 +38 44 57.90", 4155.10, 3258.90, 1.0),
    "61 Cyg B": ("21 06 55.264 +38 44 31.36", 4107.40, 3143.72, 1.5),
    "Arcturus": ("14 15 39.672 +19 10 56.67", -1093.39, -2000.06, 0.4),
    "Sirius": ("06 45 08.917 -16 42 58.02", -546.01, -1223.07, 0.4),
    "Vega": ("18 36 56.336 +38 47 01.28", 200.94, 286.23, 0.4),
    "HIP 57548": ("11 47 44.397 +00 48 16.40", 607.30, -1223.03, 0.6),  # Ross 128
    "Proxima": ("14 29 42.946 -62 40 46.16", -3781.74, 769.47, 0.8),
    "HIP 117473": ("23 49 12.526 +02 24 04.41", 993.9, -968.0, 0.8),
    # In Hipparcos and Tycho-2 alike.
    "Barnard's Star": ("17 57 48.498 +04 41 36.21", -801.55, 10362.39, 0.6),
    "HIP 54035": ("11 03 20.194 +35 58 11.57", -580.06, -4776.59, 0.8),
}


@pytest.mark.parametrize("name", KNOWN)
def test_a_star_is_where_it_was_at_j2000(catalogue, name):
    place, *_ = KNOWN[name]
    want = SkyCoord(place, unit=(u.hourangle, u.deg)).cartesian.xyz.value
    found = catalogue.vectors([catalogue.find(name)])[0]
    assert np.linalg.norm(found - want) * ARCSEC_PER_RAD < 0.5


@pytest.mark.parametrize("name", KNOWN)
def test_a_star_is_where_it_is_now(catalogue, name):
    place, pm_ra, pm_dec, within = KNOWN[name]
    start = SkyCoord(
        place,
        unit=(u.hourangle, u.deg),
        pm_ra_cosdec=pm_ra * u.mas / u.yr,
        pm_dec=pm_dec * u.mas / u.yr,
        obstime="J2000",
        distance=20 * u.pc,
    )
    now = start.apply_space_motion(dt=26.0 * u.yr).cartesian.xyz.value
    want = now / np.linalg.norm(now)
    found = catalogue.vectors([catalogue.find(name)], 2026.0)[0]
    assert np.linalg.norm(found - want) * ARCSEC_PER_RAD < within
    assert np.linalg.norm(found) == pytest.approx(1.0, abs=1e-12)


def test_every_star_of_the_naked_eye_is_there_once(catalogue):
    rows = catalogue.cone(np.array([0.0, 0.0, 1.0]), np.pi, mag_limit=3.0)
    assert 165 < len(rows) < 180
    brightest = [catalogue.label(row)[1] for row in rows[:8].tolist()]
    assert brightest[:4] == ["Sirius", "Canopus", "Arcturus", "Vega"]
    near = np.linalg.norm(catalogue.vectors(rows)[:, None] - catalogue.vectors(rows), axis=2)
    np.fill_diagonal(near, 1.0)
    assert near.min() * ARCSEC_PER_RAD > 1.5


def test_nothing_bright_is_without_a_name(catalogue):
    rows = catalogue.cone(np.array([0.0, 0.0, 1.0]), np.pi, mag_limit=7.0)
    nameless = [row for row in rows.tolist() if not catalogue.label(row)[0].startswith("HIP")]
    # Tycho-2 has a few that Hipparcos lacks; artefacts would be here by the hundred.
    assert len(nameless) < 0.01 * len(rows)


def test_close_components_are_one_star_with_both_fluxes(catalogue):
    row = catalogue.find("HIP 9640")  # Almach
    assert catalogue.mag([row])[0] == pytest.approx(2.1, abs=0.1)
