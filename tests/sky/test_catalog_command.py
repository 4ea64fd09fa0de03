import json
import re
from collections import Counter

import pytest

from catalogs.making.objects import CORRECTIONS
from kochab.cli.main import main
from kochab.core.errors import CatalogueError
from kochab.sky import shipped_folder
from kochab.sky.catalogue_file import read_manifest
from kochab.sky.small_bodies import shipped_small_bodies


def test_info_finds_the_shipped_catalogue_sound(capsys):
    assert main(["catalog", "info", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["ok"]
    assert told["stars"] == sum(told["counts"]["per_magnitude"].values()) > 1_870_000
    assert told["bright"]["hip"] == 118_215
    assert told["epoch"] == 2000.0
    assert told["bytes"] < 42e6
    assert told["independent_check"]["99 % arcsec"] < 0.5
    assert told["independent_check"]["found"] == 42_212


def test_info_for_people_says_the_same(capsys):
    assert main(["catalog", "info"]) == 0
    out = capsys.readouterr().out
    assert "ICRS, positions at 2000.0" in out
    assert "ALTERED" not in out
    assert re.search(r"5 to 6 +3,4\d\d", out)


def test_coverage_says_where_the_sky_is_poor(capsys):
    arguments = ["catalog", "coverage", "--fov", "5", "--mag-limit", "8", "--fields", "3000"]
    assert main([*arguments, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["fields"] == 3000
    assert 3 <= told["fewest"] < told["percent_5"] < told["median"] < told["most"]
    assert main(arguments) == 0
    assert f"{told['fewest']} stars or more" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments",
    [["coverage", "--fov", "0"], ["build", "--sources", "no-such-folder"], ["info", "--catalog", "no-such-folder"]],
)
def test_unusable_arguments_end_in_a_sentence(capsys, arguments):
    assert main(["catalog", *arguments]) == 2
    said = capsys.readouterr().err.strip()
    assert said.endswith(".")
    assert "\n" not in said
    assert main(["catalog", *arguments, "--json"]) == 2
    assert json.loads(capsys.readouterr().out)["error"].endswith(".")


def test_packages_are_kept_in_the_cache_that_was_asked_for(monkeypatch, tmp_path, capsys):
    asked = []

    def fetch(folder):
        asked.append(folder)
        raise CatalogueError("Enough.")

    monkeypatch.setenv("KOCHAB_CACHE", str(tmp_path))
    monkeypatch.setattr("catalogs.making.build.fetch", fetch)
    assert main(["catalog", "build", "--out", str(tmp_path / "out")]) == 2
    assert asked == [tmp_path / "catalogue-sources"]


def test_the_readme_states_the_hashes_of_the_shipped_files():
    text = (shipped_folder() / "README.md").read_text("utf-8")
    for name, facts in read_manifest(shipped_folder())["files"].items():
        assert re.search(rf"`{re.escape(name)}`.*{facts['bytes']:,}.*{facts['sha256']}", text), name


def test_the_readme_counts_what_the_files_hold():
    folder = shipped_folder()
    text = " ".join((folder / "README.md").read_text("utf-8").split())
    tables = {path.name: path.read_text("utf-8").splitlines()[1:] for path in folder.glob("*.tsv")}
    figures = {line.partition("\t")[0] for line in tables["lines.tsv"]}
    segments = sum(len(line.split("\t")[1].split()) - 1 for line in tables["lines.tsv"])
    bodies = shipped_small_bodies()
    comets = int(bodies.comet.sum())
    rows = CORRECTIONS.read_text("utf-8").splitlines()[1:]
    changed = Counter(row.split("\t")[1] for row in rows)
    taken_out = sum(row.split("\t")[1:3] == ["mag", ""] for row in rows)
    for fact in (
        f"| {len(tables['objects.tsv']):,} objects",
        f"| {len(tables['names.tsv']):,} stars with names",
        f"| {len(tables['variables.tsv']):,} variable stars",
        f"| {segments} segments in {len(figures)} figures",
        f"| {len(tables['outlines.tsv'])} shapes",
        f"| {len(tables['boundaries.tsv'])} boundaries",
        f"| {len(bodies.names) - comets:,} asteroids and {comets} comets",
        f"{changed['place']} places were moved",
        f"{changed['kind']} kinds and {changed['size']} sizes changed",
        f"{changed['mag']} magnitudes",
        f"{taken_out} of them taken out",
        f"with the reason: {changed['keep']}.",
    ):
        assert fact in text, fact


@pytest.mark.parametrize("arguments", [("--fields", "0"), ("--fields", "1000000000000"), ("--mag-limit", "nan")])
def test_coverage_refuses_what_cannot_be_counted(arguments, capsys):
    assert main(["catalog", "coverage", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1


def test_a_name_that_was_not_imported_is_told_with_those_that_were(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr("platformdirs.user_data_path", lambda *_, **__: tmp_path)
    assert main(["catalog", "info", "--catalog", "deep"]) == 2
    assert "'deep'; none was imported at all" in capsys.readouterr().err
    (tmp_path / "catalogs" / "gaia").mkdir(parents=True)
    assert main(["catalog", "coverage", "--catalog", "deep"]) == 2
    assert "'deep'; there are gaia." in capsys.readouterr().err
