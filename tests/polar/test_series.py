"""Real series of frames: mounts turned about their axes, a tripod that stood still, and solutions of Ekos' users.

The truth is that of one camera fitted to all frames of a series, the celestial pole itself, or another program's.
"""

import json
import re
from datetime import UTC, datetime, timedelta
from itertools import pairwise

import numpy as np
import pytest

from kochab.cli.main import main
from kochab.core.attitude import ARCSEC, Attitude, attitude_from, rotation_vector
from kochab.core.frame import Site
from kochab.core.progress import run
from kochab.polar.measure import MeasureSettings, measure
from kochab.polar.pole import Pole
from kochab.polar.sighting import Sighting
from kochab.sky.horizon import Refraction
from kochab.solver import SolveOptions
from kochab.workflows.polar.sources import solve_polar_file


@pytest.mark.parametrize("frame", ["horiz", "0003", "0010"])
def test_a_dslr_at_the_north_pole(shared_series, capsys, frame):
    """The site is not known: the distance from the pole hardly asks for it."""
    folder = shared_series / "ppaN"
    truth = json.loads((folder / "truth.json").read_text())["measured"]
    total = truth["axis_to_pole_arcmin_one_camera"][f"vert+{frame}"]
    second = "horiz.JPG" if frame == "horiz" else f"IMG_{frame}.JPG"
    code = main(["polar", str(folder / "vert.JPG"), str(folder / second), "--site=40,-3", "--json", "--utc-offset=0"])
    out, err = capsys.readouterr()
    assert code == 3, err  # two frames
    assert json.loads(out)["total_arcsec"] / 60.0 == pytest.approx(total, abs=0.1)


def test_the_axis_of_a_tripod_that_stands_is_the_pole(shared_series):
    """10 to 20 s of the sky's own turning, on which the optical axes gave 4 and 6 deg."""
    names = [f"DSC_00{number}_NEF_embedded.jpg" for number in (58, 60, 59)]
    matrices = []
    for name in names:
        file = run(solve_polar_file(shared_series / "unh" / name, SolveOptions(timeout_s=60.0)))
        matrices.append(Sighting.of(file.result, file.time_utc).attitude.matrix)
    for first, second in pairwise(matrices):
        axis = rotation_vector(second.T @ first)
        axis /= np.linalg.norm(axis)
        assert np.degrees(np.arccos(abs(axis[2]))) < 1.0


def test_a_tripod_that_stands_is_told_as_one(shared_series, capsys):
    """The times are local (EDT) and the site is not stated: neither matters to a camera at rest."""
    names = [str(shared_series / "unh" / f"DSC_00{number}_NEF_embedded.jpg") for number in (58, 59, 60)]
    code = main(["polar", *names, "--site=43.1,-70.9", "--utc-offset=-4", "--timeout=60", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert (code, told["code"]) == (1, "fixed_tripod")
    assert "The camera stood still while the sky turned by 0.0" in told["error"]


def test_sharpcaps_times_and_total(shared_series, capsys):
    """SharpCap 3.2 said 3 deg 50 min 51 s, without refraction; the pictures have no time but in its side files."""
    folder = shared_series / "tk"
    names = [str(folder / f"_0000{k}.png") for k in (3, 4)]
    code = main(["polar", *names, "--site=50.1,14.4,250", "--fov=1.12", "--timeout=300", "--utc-offset=0", "--json"])
    told = json.loads(capsys.readouterr().out)
    truth = json.loads((folder / "truth.json").read_text())["measured"]
    assert code == 3  # two frames
    assert told["total_arcsec"] == pytest.approx(truth["polar_total_arcsec"], abs=15.0)
    assert told["total_arcsec"] == pytest.approx(truth["sharpcap_total_arcsec"], abs=15.0)
    assert told["turn_deg"] == pytest.approx(truth["turn_deg"], abs=0.01)


def three_points(folder):
    """Ekos' solutions: site, three attitudes with their times, what Ekos said, arcmin."""
    site, rows = None, []
    for line in (folder / "paa.txt").read_text().splitlines():
        if line.startswith("S "):
            site = Site(*map(float, line.split()[1:]))
        elif "|" in line:
            *points, note = line.split("|")
            rows.append((site, [point.split() for point in points], note.strip()))
    return rows


def test_ekos_users_axes(shared_series):
    """Its answers are the plane through three centres, without refraction, as hypot of altitude and azimuth."""
    rows = three_points(shared_series / "kstars")
    assert len(rows) >= 36
    off = []
    for site, points, note in rows:
        if "flipped" in note:  # mirrored pictures whose mirror the rows don't tell
            continue
        sightings = []
        for ra, dec, rotation, when in points:
            attitude = attitude_from(float(ra), float(dec), float(rotation))
            plain = Attitude(attitude.matrix, np.diag(np.square([1.0, 1.0, 60.0]) * ARCSEC**2))
            sightings.append(Sighting(plain, datetime.fromisoformat(f"{when}+00:00")))
        found = measure(sightings, MeasureSettings(site, Pole.TRUE, Refraction(0.0)))
        said = re.match(r"(\d+)'(?:(\d+)\")?", note)
        if said and said[2]:
            total = 60.0 * int(said[1]) + int(said[2])
            off.append(abs(np.hypot(found.error.altitude_arcsec, found.error.azimuth_arcsec) - total))
    assert len(off) >= 8
    assert np.median(off) < 10.0
    assert np.sort(off)[-2] < 45.0  # one, 23'50", is 4 arcmin from what its own three points give


def test_ekos_bolts_left_alone_between_two_declinations(shared_series):
    """38.4 deg of the sky apart, the same bolts: two answers from one axis."""
    rows = three_points(shared_series / "kstars")
    second = next(k for k, row in enumerate(rows) if row[2].startswith("same bolts as the line above"))
    axes = []
    for site, points, _ in rows[second - 1 : second + 1]:
        seen = [
            Sighting(
                Attitude(attitude_from(*map(float, p[:3])).matrix, np.diag(np.square([1.0, 1.0, 60.0]) * ARCSEC**2)),
                datetime.fromisoformat(f"{p[3]}+00:00"),
            )
            for p in points
        ]
        axes.append(measure(seen, MeasureSettings(site, Pole.TRUE, Refraction(0.0))).error.axis)
    assert np.linalg.norm(axes[0] - axes[1]) / ARCSEC < 60.0


def test_an_alt_azimuth_rig_has_one_vertical_axis(shared_series):
    """Four azimuths at two altitudes; frames about 38 s apart, so that its place on the sky is good to minutes."""
    places = []
    for altitude in (40, 60):
        seen = []
        for number, azimuth in enumerate((-135, -45, 45, 135)):
            name = f"2019-07-29T204726_Alt{altitude}_Azi{azimuth}_Try1.jpg"
            file = run(solve_polar_file(shared_series / "tetra" / name, SolveOptions(timeout_s=120.0)))
            when = datetime(2019, 7, 29, 20, 47, 26, tzinfo=UTC) + timedelta(seconds=38.0 * number)
            seen.append(Sighting.of(file.result, when, name))
        site = Site(52.0, 0.0)  # the pole of its sky; the axis is the zenith, so that it is far from it
        places.append(measure(seen, MeasureSettings(site, Pole.TRUE, Refraction(0.0))).error.axis)
    assert np.linalg.norm(places[0] - places[1]) / ARCSEC < 600.0
