"""Real series of frames: a mount turned about its axis, and a tripod that stood still.

The truth is that of one camera fitted to all frames of a series, or the celestial pole itself.
"""

import json
from itertools import pairwise

import numpy as np
import pytest

from kochab.cli.main import main
from kochab.core.progress import run
from kochab.polar.rotations import rotation_vector
from kochab.polar.sighting import Sighting
from kochab.solver import SolveOptions
from kochab.workflows.polar.sources import solve_polar_file


@pytest.mark.parametrize("frame", ["horiz", "0003", "0010"])
def test_a_dslr_at_the_north_pole(shared_series, capsys, frame):
    """The site is not known: the distance from the pole hardly asks for it."""
    folder = shared_series / "ppaN"
    truth = json.loads((folder / "truth.json").read_text())["measured"]
    total = truth["axis_to_pole_arcmin_one_camera"][f"vert+{frame}"]
    second = "horiz.JPG" if frame == "horiz" else f"IMG_{frame}.JPG"
    code = main(["polar", str(folder / "vert.JPG"), str(folder / second), "--site=40,-3", "--json"])
    out, err = capsys.readouterr()
    assert code == 0, err
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
