import csv
import io
import json
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from kochab.cli.main import main
from kochab.core.attitude import radec_deg
from kochab.core.frame import Frame, Hint
from kochab.workflows.frame_objects import deep_sky_of, objects_csv, objects_json, objects_of, sky_regions
from tests.workflows.test_annotated_image import solution

BARE = Frame(np.zeros((960, 1280), np.uint8))


def test_the_table_lists_what_is_in_the_frame():
    answer = solution()
    rows = {row["name"]: row for row in csv.DictReader(io.StringIO(objects_csv(objects_of(BARE, answer))))}
    flame = rows["NGC 2024"]
    assert "Flame Nebula" in flame["names"]
    place = answer.sky_at(np.array([[float(flame["x"]), float(flame["y"])]]))[0]
    assert radec_deg(place) == pytest.approx((float(flame["ra_deg"]), float(flame["dec_deg"])), abs=1e-3)
    assert (rows["M 42"]["major_arcmin"], rows["M 42"]["type"]) == ("90", "Cl+N")
    frame = replace(BARE, hint=Hint(time_utc=datetime(2023, 11, 3, 22, 0, tzinfo=UTC)))
    first = next(csv.DictReader(io.StringIO(objects_csv(objects_of(frame, solution(39.9, 14.0))))))
    assert (first["name"], first["type"]) == ("Jupiter", "planet")
    assert (float(first["ra_deg"]), float(first["dec_deg"])) == pytest.approx((38.125, 13.496), abs=0.01)  # PyEphem's
    assert float(first["major_arcmin"]) == pytest.approx(0.82, abs=0.02)
    assert first["minor_arcmin"] == first["pa_deg"] == ""


def test_regions_have_the_galaxy_as_it_lies_and_the_planets_of_the_night():
    """M 31 of OpenNGC: 178 x 70 arcmin at position angle 35."""
    lines = sky_regions(solution(10.7, 41.3), objects_of(BARE, solution(10.7, 41.3))).splitlines()
    line = next(line for line in lines if "{M 31}" in line)
    ra, dec, major, minor, angle = (float(x) for x in line[8 : line.index(")")].replace('"', "").split(","))
    assert (ra, dec) == pytest.approx((10.685, 41.269), abs=0.01)
    assert (major, minor) == pytest.approx((5335.0, 2100.0), rel=0.1)
    assert angle == 125.0  # counted from west
    frame = Frame(np.zeros((960, 1280), np.uint8), hint=Hint(time_utc=datetime(2023, 11, 3, 22, 0, tzinfo=UTC)))
    text = sky_regions(solution(39.9, 14.0), objects_of(frame, solution(39.9, 14.0)))
    assert "{Jupiter}" in text
    assert text.isascii()


def test_an_object_that_holds_the_whole_frame_is_told_as_larger():
    """A degree of the Large Magellanic Cloud (645 arcmin, OpenNGC), and of nothing in the Lynx."""
    inside = {one["name"]: one for one in objects_json(objects_of(BARE, solution(80.9, -69.7, fov_deg=1.0)))}
    cloud = next(one for one in inside.values() if one["where"] == "larger" and one["size_arcmin"][0] > 500.0)
    assert cloud["kind"] == "G"
    assert "LMC" in inside or "Large Magellanic Cloud" in [cloud["name"], *cloud["names"]]
    assert {one["where"] for one in inside.values()} == {"inside", "larger"}
    assert not [one for one in objects_of(BARE, solution(120.0, 45.0, fov_deg=1.0)) if one.larger]


@pytest.mark.parametrize("ending", [".csv", ".reg", ".ssc"])
def test_the_command_line_lists_the_objects_of_a_frame(repository, tmp_path, capsys, ending):
    picture, out = repository / "resources" / "samples" / "orion.png", tmp_path / f"orion{ending}"
    assert main(["solve", str(picture), "--json", "--objects", str(out)]) == 0
    told = json.loads(capsys.readouterr().out)
    names = {name: one for one in told["objects"] for name in [one["name"], *one["names"]]}
    assert names["M 42"]["where"] == "inside"
    assert names["Horsehead Nebula"]["position_angle_deg"] is None or names["Horsehead Nebula"]["size_arcmin"]
    assert ("loadSkyImage" if ending == ".ssc" else "M 42") in out.read_text()
    assert main(["solve", str(picture), "--objects", str(picture.with_suffix(".txt"))]) == 2
    assert ".csv, .reg or .ssc" in capsys.readouterr().err


def test_a_solution_on_the_command_line_always_lists_its_objects(repository, capsys):
    """M 42's magnitude is OpenNGC's; the best known 200 are listed, and --objects without a file lists more."""
    picture = str(repository / "resources" / "samples" / "orion.png")
    assert main(["solve", picture, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    orion = next(one for one in told["objects"] if one["name"] == "M 42")
    assert (orion["magnitude"], orion["magnitude_source"]) == (4.0, "OpenNGC")
    assert "Orion Nebula" in orion["names"]
    assert "bodies" not in told  # the sample says no date
    assert isinstance(told["not_in_catalogue"], list)
    assert main(["solve", picture, "--json", "--objects"]) == 0
    more = json.loads(capsys.readouterr().out)
    assert len(more["objects"]) == len(told["objects"]) + told["objects_left_out"]


def test_the_list_says_how_many_it_leaves_out():
    wide = solution(187.0, 12.0, fov_deg=40.0)
    few, left_out = deep_sky_of(wide, 50)
    every, none = deep_sky_of(wide, 5000)
    assert len([one for one in few if not one.larger]) == 50
    assert (left_out, none) == (len([one for one in every if not one.larger]) - 50, 0)
    assert [one.name for one in few][:50] == [one.name for one in every][:50]


def test_an_object_about_as_large_as_the_frame_is_in_the_list():
    """M 31, 178 by 70 arcmin, does not hold a frame of two degrees, and reaches out of it."""
    names = [one.name for one in objects_of(BARE, solution(10.7, 41.3, fov_deg=2.0))]
    assert "M 31" in names
