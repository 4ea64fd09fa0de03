"""What is left of a polar error does to frames: against turning sky and camera about their own axes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.core.errors import UsageError
from kochab.polar.error import Imaging, PolarError, good_enough
from tests.polar.mounts import ARCSEC, pointing

SIDEREAL = 2.0 * np.pi / 86164.0905
POLE = pointing(0.7, 0.0)


def error(arcsec):
    return PolarError(pointing(0.7 + arcsec * ARCSEC, 0.0), POLE, np.eye(2) * ARCSEC**2)


def turned(star, seconds, off):
    """Where a star goes that a camera follows about its own axis, and how far the sky about it turns, rad."""
    sky = Rotation.from_rotvec(-POLE * SIDEREAL * seconds)
    back = Rotation.from_rotvec(off.axis * SIDEREAL * seconds)
    moved = back.apply(sky.apply(star))
    return np.linalg.norm(moved - star)


def test_the_trail_is_the_worst_that_the_sky_does_to_a_camera_that_follows_another_axis():
    imaging, off = Imaging(600.0, 3.76, 300.0), error(90.0)
    stars = np.random.default_rng(1).normal(size=(4000, 3))
    stars /= np.linalg.norm(stars, axis=1, keepdims=True)
    worst = max(turned(star, 300.0, off) for star in stars) * 600.0 / 3.76e-3
    assert 90.0 * imaging.trail_px_arcsec == pytest.approx(worst, rel=0.01)


def test_the_corners_turn_as_the_guided_frame_does():
    """Guiding turns right ascension about the mount's axis and declination across: what is left is about the star."""
    imaging, off, worst = Imaging(600.0, 3.76, 300.0), error(90.0), 0.0
    for hour in np.linspace(0.0, 2.0 * np.pi, 73):
        start = Rotation.from_rotvec(POLE * hour)
        star = start.apply(Rotation.from_rotvec([np.radians(30.0), 0.0, 0.0]).apply(POLE))  # declination 60
        slope = (off.axis - POLE) * SIDEREAL  # the rotation a second that tracking leaves
        axes = np.stack([off.axis, np.cross(off.axis, star) / np.linalg.norm(np.cross(off.axis, star)), star], axis=1)
        worst = max(worst, abs(np.linalg.solve(axes, slope)[2]))
    assert 90.0 * imaging.rotation_px_arcsec == pytest.approx(worst * 300.0 * 14.0 / 3.76e-3 * np.cos(0), rel=0.02)


def test_when_to_stop():
    imaging = Imaging(600.0, 3.76, 300.0)
    assert good_enough(error(30.0), imaging) == "Good enough: stop."
    assert good_enough(error(90.0), imaging) == "Good enough if you guide. Unguided: 59″."
    assert good_enough(error(7200.0), imaging) == "Guided: 21′ is enough. Unguided: 59″."
    assert good_enough(error(7200.0), replace(imaging, exposure_s=1200.0)) == "Guided: 5.3′ is enough. Unguided: 15″."


@pytest.mark.parametrize("text", ["", "600", "600 mm, 3.76 µm", "0, 3.76, 300", "a, b, c", "1 2 3 4"])
def test_what_is_no_camera_is_refused(text):
    with pytest.raises(UsageError):
        Imaging.parse(text)
    assert Imaging.parse("600 mm, 3.76 µm, 300 s") == Imaging.parse("600,3.76,300") == Imaging(600.0, 3.76, 300.0)
