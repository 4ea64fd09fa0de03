import json
from importlib import invalidate_caches

import numpy as np

from kochab.lab.bench import load_bench, sources
from tests.patterns import REPOSITORY

TRUTH = json.loads((REPOSITORY / "tests" / "sky" / "asteroids.json").read_text(encoding="utf-8"))["rows"]


def test_the_bench_of_the_sky_measures_planets_asteroids_and_time(monkeypatch, tmp_path):
    """With Stellarium's list among the packages that a build of the catalogue keeps."""
    monkeypatch.setenv("KOCHAB_CACHE", str(tmp_path))
    monkeypatch.setattr(sources, "DEBIAN", ())
    monkeypatch.setattr(sources, "find_spec", lambda name: None)
    _, epoch, q, e, i, node, peri, tp = next(row for row in TRUTH if row[0] == "1 Ceres")
    axis = q / (1 - e)
    anomaly = (epoch - tp) * np.degrees(0.01720209895) / axis**1.5
    keys = {"Epoch": epoch, "Eccentricity": e, "SemiMajorAxis": axis, "MeanAnomaly": anomaly}
    keys |= {"Inclination": i, "AscendingNode": node, "ArgOfPericenter": peri}
    lines = [
        "[ceres]",
        "name=Ceres",
        "minor_planet_number=1",
        *(f"orbit_{key} = {value}" for key, value in keys.items()),
    ]
    folder = tmp_path / "catalogue-sources" / "stellarium-data"
    folder.mkdir(parents=True)
    (folder / "ssystem_minor.ini").write_text("\n".join([*lines, "[nameless]", "type=comet", ""]))
    result = load_bench("sky")(True, lambda line: None)
    rows = {row["body"]: row for row in result.rows}
    assert rows["jupiter"]["arcsec"] < 150.0
    assert rows["1 Ceres"]["arcsec"] < 1.0
    goals = {goal.name: goal for goal in result.goals}
    assert goals["asteroids of other years, median arcsec"].met
    assert rows["all of a field in 2026"]["n"] >= 1
    assert goals["stars and objects out of place"].met
    assert goals["frames of 60 with names that overlap"].met
    assert not goals["names elsewhere in the second source"].met  # its table is not among the packages
    assert rows["frames of the sky layer"]["names"] > 100
    missing = " ".join(body for body in rows if "not here" in body)
    for package in ("stellarium-data", "fchart3", "skyfield"):
        assert package in missing
    assert "0.22" not in missing  # the asteroids are here


def test_skyfield_counts_as_here_when_it_lies_where_the_bench_says(monkeypatch, tmp_path):
    monkeypatch.setenv("KOCHAB_CACHE", str(tmp_path))
    monkeypatch.setattr("sys.path", [])
    assert not sources.skyfield_is_here()
    for name in ("skyfield", "skyfield_data", "jplephem"):
        (tmp_path / "second-sources" / name).mkdir(parents=True)
        (tmp_path / "second-sources" / name / "__init__.py").touch()
    invalidate_caches()
    assert sources.skyfield_is_here()
