import json
import os
import shutil

import numpy as np
import pytest

from kochab.core.frame import Detections
from kochab.frames.fits_write import write_fits
from kochab.lab.bench import peers
from kochab.simulate.random_fields import FieldPlan, random_field, random_picture
from kochab.sky import open_catalogue

POINTS = Detections.from_list(np.array([[1.0, 2.0], [30.0, 40.0]]), 100, 80)


def case(ra_deg, tolerance_deg=0.1):
    return peers.Case("one", POINTS, ((ra_deg, 0.0), tolerance_deg))


def test_right_wrong_and_refused_are_told_apart() -> None:
    places = iter([(10.05, 0.0), (10.2, 0.0), None, (10.0, 0.0)])
    cases = [case(10.0), case(10.0), case(10.0), peers.Case("no field", POINTS, None)]
    row = peers.score(lambda _: next(places), cases)
    assert (row["n"], row["solved"], row["wrong"]) == (4, 1, 2)
    assert 0.0 <= row["median_s"] <= row["largest_s"]


def test_real_frames_come_with_their_places(monkeypatch, tmp_path) -> None:
    picture = random_picture(open_catalogue(), np.random.default_rng(3), FieldPlan(12.0, size_px=512))
    write_fits(picture.frame, tmp_path / "sky.fits")
    ra, dec = picture.attitude.ra_dec_deg
    told = {"ra_deg": ra, "dec_deg": dec, "fov_deg": [12.0, 12.0], "tol_deg": 0.01}
    (tmp_path / "truth.json").write_text(
        json.dumps({"frames": {"sky.fits": told, "daylight.png": {"solvable": False}}})
    )
    monkeypatch.setenv("KOCHAB_FRAMES", str(tmp_path))
    (frame,) = peers.real_frames(10)
    assert frame.truth == ((ra, dec), pytest.approx(0.24))
    assert len(frame.detections) > 10
    assert peers.score(peers.kochab, [frame])["solved"] == 1


def test_no_frames_is_no_case(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("KOCHAB_FRAMES", str(tmp_path))
    assert list(peers.real_frames(10)) == []


def test_hostile_lists_are_of_every_kind_and_the_same_each_time() -> None:
    lists = list(peers.hostile_lists(len(peers.SHAPES) + 1))
    assert {one.name for one in lists} == {*peers.SHAPES, "random points"}
    assert all(one.truth is None for one in lists)
    again = list(peers.hostile_lists(len(lists)))
    assert all(np.array_equal(a.detections.xy, b.detections.xy) for a, b in zip(lists, again, strict=True))


SOLVE_FIELD = """#!{python}
import sys, pathlib
from astropy.io import fits
told = dict(zip(sys.argv[1:], sys.argv[2:]))
stars = fits.getdata(sys.argv[-1])
assert (stars["X"][0], stars["Y"][0]) == (2.0, 3.0) and stars["FLUX"][0] > stars["FLUX"][1]
assert (told["--width"], told["--height"]) == ("100", "80")
header = fits.Header(dict(CTYPE1="RA---TAN", CTYPE2="DEC--TAN", CRPIX1=50.5, CRPIX2=40.5, CRVAL1=83.0, CRVAL2=-5.0,
                          CDELT1=0.01, CDELT2=0.01))
fits.PrimaryHDU(header=header).writeto(pathlib.Path(told["--dir"], "stars.wcs"))
"""


@pytest.mark.skipif(os.name == "nt", reason="a script of Python stands in for the program")
def test_astrometry_net_is_asked_for_the_same_stars(monkeypatch, tmp_path) -> None:
    import sys

    program = tmp_path / "solve-field"
    program.write_text(SOLVE_FIELD.format(python=sys.executable))
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert shutil.which("solve-field")
    assert peers.astrometry_net(POINTS) == pytest.approx((83.0, -5.0))
    assert peers.astrometry_net(POINTS.take(np.arange(0))) is None
    assert set(peers.installed(lambda _: None)) >= {"kochab", "astrometry.net"}


def test_cedar_solve_is_asked_both_ways_round() -> None:
    asked = []

    class Engine:
        def solve_from_centroids(self, yx, size, **_):
            asked.append(yx)
            return {"RA": 20.0, "Dec": 30.0} if len(asked) == 2 else {"RA": None}

    class Rival:
        engine = Engine()

    assert peers.CedarSolve.place(Rival(), POINTS) == (20.0, 30.0)
    assert asked[0][0] == pytest.approx([2.5, 1.5])
    assert asked[1][0] == pytest.approx([2.5, 98.5])


def test_a_fault_of_cedar_solve_is_no_solution() -> None:
    class Rival:
        class engine:  # noqa: N801
            @staticmethod
            def solve_from_centroids(*_, **__):
                raise IndexError

    assert peers.CedarSolve.place(Rival(), POINTS) is None


def test_nobody_may_solve_more_and_nothing_may_be_wrong() -> None:
    rows = [
        {"solver": "kochab", "what": "real frames", "solved": 40, "wrong": 0},
        {"solver": "kochab", "what": "lists without truth", "solved": 0, "wrong": 1},
        {"solver": "cedar-solve", "what": "real frames", "solved": 41, "wrong": 3},
    ]
    assert [goal.met for goal in peers.goals(rows)] == [False, False]


def test_kochab_s_own_place_is_the_frame_s_centre() -> None:
    field = random_field(open_catalogue(), np.random.default_rng(1), FieldPlan(20.0))
    assert peers.kochab(field.detections) == pytest.approx(field.attitude.ra_dec_deg, abs=0.05)
    assert peers.kochab(POINTS) is None
