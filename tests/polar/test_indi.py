"""An independent truth: INDI's telescope simulator with a misaligned axis, written by other people.

Its mount model is that of pointing analysis: MA is the axis' error in azimuth times the cosine of
the latitude, positive to the west; ME its error in altitude, positive below the pole. Its positions
while it turns west give the axis through a plane fit. (Its camera's roll does not follow its axis,
so attitudes cannot be tested with it.)
"""

import json
import os
import shutil
import subprocess
import sys
import time

import numpy as np
import pytest

from kochab.core.frame import Site
from kochab.polar.error import PolarError
from kochab.polar.pole import Pole, pole_direction
from kochab.sky.apparent import JD_UNIX, TT_MINUS_UTC_S
from tests.polar.plane import axis_of_plane

LATITUDE, LONGITUDE = 40.0, 10.0
MODELS = [(0.5, -0.3), (-0.2, 0.4)]  # MA, ME
NAMESPACE = ["unshare", "--net", "--pid", "--fork", "--kill-child"]


@pytest.fixture(scope="module", autouse=True)
def own_network():
    if sys.platform != "linux":
        pytest.skip("INDI is run in a network namespace, which only Linux has")
    for program, package in (
        ("indiserver", "indi-bin"),
        ("indi_simulator_telescope", "indi-bin"),
        ("unshare", "util-linux"),
        ("ip", "iproute2"),
    ):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not there: apt-get install {package}")
    if subprocess.run([*NAMESPACE, "true"], capture_output=True).returncode:
        pytest.skip("no network of its own may be made here: run as root")


def sidereal_deg(unix_s):
    """Local apparent sidereal time (ERFA ``gst06a``)."""
    import erfa

    ut = JD_UNIX + unix_s / 86400.0
    return float(np.degrees(erfa.gst06a(ut, 0.0, ut, TT_MINUS_UTC_S / 86400.0))) + LONGITUDE


def east_north_up(unix_s, ra_deg, dec_deg, latitude_deg):
    hour, dec, lat = np.radians([sidereal_deg(unix_s) - ra_deg, dec_deg, latitude_deg])
    return np.array(
        [
            -np.cos(dec) * np.sin(hour),
            np.sin(dec) * np.cos(lat) - np.cos(dec) * np.sin(lat) * np.cos(hour),
            np.sin(dec) * np.sin(lat) + np.cos(dec) * np.cos(lat) * np.cos(hour),
        ]
    )


@pytest.fixture(scope="module")
def turned_west(repository, tmp_path_factory):
    """What INDI's simulator says while it turns: (ma, me) -> [[unix seconds, RA, Dec], ...]."""
    started = {model: start(repository, tmp_path_factory.mktemp("indi"), *model) for model in MODELS}
    try:
        told = {model: process.communicate(timeout=120) for model, process in started.items()}
    finally:
        for process in started.values():
            process.kill()
    for model, (_, complaint) in told.items():
        assert started[model].returncode == 0, complaint
    return {model: json.loads(output) for model, (output, _) in told.items()}


def start(repository, home, ma, me):
    """A simulator in a network of its own, that begins to turn at once."""
    plan = {
        "latitude": LATITUDE,
        "longitude": LONGITUDE,
        "ma": ma,
        "me": me,
        "start": [(sidereal_deg(time.time()) + 40.0) % 360.0, 70.0],
        "patience_s": 60.0,
    }
    process = subprocess.Popen(
        [*NAMESPACE, sys.executable, str(repository / "tests/polar/indi_mount_model.py")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=repository,
        env={
            **os.environ,
            "HOME": str(home),
            "PYTHONPATH": os.pathsep.join([str(repository), os.environ.get("PYTHONPATH", "")]),
        },
    )
    process.stdin.write(json.dumps(plan) + "\n")
    process.stdin.close()
    process.stdin = None  # nothing more is to be told
    return process


@pytest.mark.parametrize("model", MODELS)
def test_the_axis_of_indis_mount_model_is_recovered(turned_west, model):
    ma, me = model
    seen = turned_west[model]
    assert len(seen) >= 8
    boresights = np.stack([east_north_up(*row, LATITUDE) for row in seen])
    axis = axis_of_plane(boresights)
    pole = pole_direction(Site(LATITUDE, LONGITUDE), Pole.TRUE)
    axis = axis if axis @ pole > 0 else -axis
    error = PolarError(axis, pole, np.eye(2) * 1e-10)
    # +MA: axis west of the pole, which is anticlockwise from above in the north; +ME: too low
    assert error.azimuth_on_sky_arcsec / 3600.0 == pytest.approx(-ma, abs=0.01)
    assert error.altitude_arcsec / 3600.0 == pytest.approx(-me, abs=0.01)
