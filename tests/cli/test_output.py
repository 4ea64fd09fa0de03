"""What is printed: valid JSON always, and a card that people can read."""

import json
import math
from datetime import UTC, datetime

import numpy as np
import pytest
from astropy.coordinates import Angle
from hypothesis import given
from hypothesis import strategies as st

from kochab.cli.main import main
from kochab.cli.output import body_lines, card, radec
from kochab.core.attitude import Attitude, apart_deg, attitude_from, unit_vectors
from kochab.core.camera import Camera
from kochab.core.solution import NamedStar, NoSolution, Reason, Solution
from kochab.folders import data_folder
from kochab.sky.ephemeris import shipped_ephemeris
from kochab.sky.frame_bodies import BodyInFrame, FrameBodies, UnknownSource
from kochab.sky.orbits import OBLIQUITY
from kochab.sky.solar_system import Body, BodyKind, observer_at
from kochab.workflows.solution_json import as_json, bodies_json, to_line
from tests.patterns import REPOSITORY

STAR = NamedStar(10.0, 20.0, "HIP 91262", "Vega", 0.03, 279.23, 38.78, 0.2)
SOLUTION = Solution(
    Camera(4000, 3000, 9000.0, 1999.5, 1499.5, k1=-0.05),
    attitude_from(279.0, 38.5, 12.0),
    (STAR,),
    0.31,
    -42.0,
    "patterns",
    detections=7,
    elapsed_ms={"read": 1.0, "detect": 2.0, "identify": 3.0, "attitude": 4.0, "total": 10.0},
)
SOLVED_KEYS = {
    *("file", "solved", "ra_deg", "dec_deg", "roll_deg", "mirrored", "fov_deg", "scale_arcsec_px"),
    *("camera", "matches", "rms_px", "rms_arcsec", "sigma_arcsec", "log10_false_alarm", "method"),
    *("quaternion", "dcm", "euler_deg", "stars", "elapsed_ms"),
}
UNSOLVED = NoSolution(Reason.TRAILED, "Wait.", "tried", 5, {"total": 3.0}, {"trail_px": 12.0})


def test_a_solution_has_the_keys_that_are_promised() -> None:
    out = json.loads(to_line(as_json("a.fits", SOLUTION)))
    assert set(out) >= SOLVED_KEYS
    assert set(out["camera"]) == {"projection", "focal_px", "cx", "cy", "k1", "k2", "p1", "p2", "aspect"}
    assert set(out["elapsed_ms"]) == {"read", "detect", "identify", "attitude", "total"}
    assert set(out["stars"][0]) == {"x", "y", "id", "name", "mag", "ra_deg", "dec_deg", "residual_px", "fitted"}
    assert out["solved"] is True
    assert out["matches"] == 1
    assert out["ra_deg"] == pytest.approx(279.0)
    assert out["roll_deg"] == pytest.approx(12.0)
    assert len(out["dcm"]) == 3
    assert len(out["quaternion"]) == 4
    assert out["sigma_arcsec"] == [None, None, None]  # no covariance is null, never NaN


def test_no_solution_has_the_keys_that_are_promised() -> None:
    out = json.loads(to_line(as_json("a.fits", UNSOLVED)))
    assert set(out) >= {"file", "solved", "reason", "advice", "detections", "elapsed_ms"}
    assert (out["solved"], out["reason"], out["detections"]) == (False, "trailed", 5)


numbers = st.floats(allow_nan=True, allow_infinity=True)


@given(
    st.recursive(
        numbers | st.text() | st.none() | st.booleans(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    )
)
def test_every_line_is_strict_json_on_one_line(value) -> None:
    line = to_line({"value": value})
    assert "\n" not in line

    def refuse(text: str) -> None:
        raise AssertionError(text)

    json.loads(line, parse_constant=refuse)


def test_the_cards() -> None:
    text = card(as_json("a.fits", SOLUTION))
    assert "18h36m00.00s +38d30'00.0\"" in text
    assert "Vega" in text
    assert "1 of 7 stars" in text
    assert "mirrored" not in text
    text = card(as_json("a.fits", UNSOLVED))
    assert "trailed" in text
    assert "Wait." in text
    assert "trail px 12" in text


@given(st.floats(-360, 720), st.floats(-90, 90))
def test_sexagesimal_is_what_astropy_reads(ra: float, dec: float) -> None:
    hms, dms = radec(ra, dec).split()
    error = (Angle(hms).deg - ra + 180) % 360 - 180
    assert abs(error) < 0.0051 * 15 / 3600
    assert abs(Angle(dms).deg - dec) < 0.051 / 3600
    assert Angle(hms).deg < 360


def test_an_attitude_without_covariance_prints() -> None:
    assert math.isnan(Attitude(SOLUTION.attitude.matrix).sigma_arcsec[0])
    assert "nan" in card(as_json("a", SOLUTION))


def test_a_dated_frames_bodies_are_listed_and_an_undated_ones_are_not(capsys):
    samples = data_folder("resources") / "samples"
    assert main(["solve", str(samples / "pleiades.fits"), str(samples / "big-dipper.jpg"), "--json"]) == 0
    dated, undated = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    assert dated["bodies"] == dated["not_in_catalogue"] == []  # 2025-01-12: Uranus was 7 degrees off
    assert "bodies" not in undated


def test_bodies_and_unknown_sources_stand_in_the_card():
    jupiter = Body("Jupiter", BodyKind.PLANET, 10.0, 20.0, 5.0, -2.04, 40.0, 1.0, 0.1)
    moon = Body("Moon", BodyKind.MOON, 10.0, 20.0, 0.003, -12.0, 1900.0, 0.5, 3400.0)
    unknown = UnknownSource(5.0, 6.0, 10.0, 20.0, 1.23, 4.5, 0.2)
    iss = Body(
        "ISS", BodyKind.SPACECRAFT, 10.0, 20.0, 3e-6, math.nan, 0.0, math.nan, 900.0, ((9.0, 20.0), (11.0, 20.0))
    )
    bodies = (
        BodyInFrame(moon, 1.0, 2.0, False),
        BodyInFrame(jupiter, 100.4, 200.0, True),
        BodyInFrame(iss, 7, 8, False),
    )
    told = FrameBodies(bodies, (unknown,))
    outcome = bodies_json(told)
    listed = json.loads(to_line(outcome))["bodies"]
    assert [(body["name"], body.get("trail")) for body in listed[1:]] == [
        ("Jupiter", None),
        ("ISS", [[9, 20], [11, 20]]),
    ]
    assert list(body_lines(outcome)) == [
        "body     Moon, magnitude -12.0, at 1, 2 px +-3400 arcsec, not detected",
        "body     Jupiter, magnitude -2.0, at 100, 200 px",
        "body     ISS, at 7, 8 px +-900 arcsec",
        "unknown  not in the catalogue: magnitude 4.5 +-0.2, 00h40m00.00s +20d00'00.0\" +-1.2 arcsec, at 5, 6 px",
    ]


def test_a_satellite_before_the_pleiades_is_listed_with_its_trail(capsys):
    """Skyfield has Iridium 33 at RA 56.82635, Dec 24.32165 at mid-exposure, 910 km from there, and half a degree a second."""
    sample = str(data_folder("resources") / "samples" / "pleiades.fits")
    command = ["solve", sample, "--elements", str(REPOSITORY / "tests" / "sky" / "iridium-2025-01-05.tle")]
    assert main([*command, "--json", "--site=13.60,-32.73"]) == 0
    outcome = json.loads(capsys.readouterr().out)
    (body,) = outcome["bodies"]
    assert (body["name"], body["kind"], body["magnitude"]) == ("IRIDIUM 33", "satellite", None)
    trail = unit_vectors(*np.array(body["trail"]).T)
    there = unit_vectors(56.82635, 24.32165)
    assert min(np.degrees(np.linalg.norm(trail - there, axis=1))) < 0.1
    assert abs(np.degrees(there @ np.cross(trail[0], trail[-1]) / np.linalg.norm(trail[0] - trail[-1]))) < 0.01
    assert body["distance_au"] * 149597870.7 == pytest.approx(910.0, rel=0.01)
    assert 1000.0 < body["sigma_arcsec"] < 4000.0
    assert not [text for text in outcome["warnings"] if "atellites" in text]
    assert main([*command, "--site=48.1,11.6"]) == 0
    assert "IRIDIUM" not in capsys.readouterr().out
    assert main(command) == 0
    assert "note     Satellites are left out: their places need your site." in capsys.readouterr().out


def test_the_users_own_elements_are_looked_for(capsys, tmp_path):
    """A body is put before the Pleiades by elements that end up there; a bad file is told before anything is solved."""
    sample = str(data_folder("resources") / "samples" / "pleiades.fits")
    fields = ["full_name", "epoch_mjd", "e", "q", "i", "om", "w", "tp", "H"]
    when = datetime(2025, 1, 12, 20, 14, 20, tzinfo=UTC)
    observer = observer_at(when, None)
    sun = shipped_ephemeris()("sun", observer.jd_tdb)
    ray, away = unit_vectors(56.6, 24.3), (observer.place - sun)[0]
    place = away + 2.0 * ray
    ecliptic = (
        np.array([[1, 0, 0], [0, np.cos(OBLIQUITY), np.sin(OBLIQUITY)], [0, -np.sin(OBLIQUITY), np.cos(OBLIQUITY)]])
        @ place
    )
    q = float(np.linalg.norm(place))
    incline = float(
        np.degrees(np.arcsin(ecliptic[2] / q))
    )  # its perihelion is there, at the highest point of its orbit
    node = float(np.degrees(np.arctan2(ecliptic[1], ecliptic[0]))) - 90.0
    row = ["Test (2025 XX)", observer.jd_tdb[0] - 2400000.5, 0.1, q, incline, node, 90.0, observer.jd_tdb[0], 5.0]
    (tmp_path / "mine.json").write_text(json.dumps({"fields": fields, "data": [row]}))
    assert main(["solve", sample, "--json", "--elements", str(tmp_path / "mine.json")]) == 0
    (body,) = json.loads(capsys.readouterr().out)["bodies"]
    assert body["name"] == "Test (2025 XX)"
    assert apart_deg((body["ra_deg"], body["dec_deg"]), (56.6, 24.3)) < 0.01
    assert not body["seen"]
    (tmp_path / "bad.txt").write_text("nothing")
    assert main(["solve", sample, "--elements", str(tmp_path / "bad.txt")]) == 2
    told = capsys.readouterr()
    assert "Can't read bad.txt: line 1 has no usable elements" in told.err
    assert told.out == ""
