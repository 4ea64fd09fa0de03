"""Recipes for other systems' package managers, and the resolver's list, against what the project asks for."""

import re
from importlib.metadata import requires

import pytest
import yaml
from packaging.requirements import Requirement

import kochab

NOT_ON_CONDA_FORGE = {"xisf"}
OTHER_NAMES = {"pyside6-essentials": "pyside6", "astropy": "astropy-base"}


@pytest.fixture(scope="module")
def recipes(repository):
    return repository / "packaging" / "recipes"


def test_every_recipe_says_that_nobody_tried_it_and_is_of_this_version(recipes):
    files = [path for path in recipes.iterdir() if path.is_file()]
    assert len(files) == 5
    for path in files:
        text = path.read_text(encoding="utf-8")
        assert "Untried." in text.split("\n\n")[0], path
        if path.suffix != ".rb":
            assert isinstance(yaml.safe_load(text), dict)
        assert kochab.__version__ in text or "org.kochab_astro" in path.name, path


def test_conda_asks_for_what_the_project_asks_for_with_the_same_bounds(recipes):
    run = yaml.safe_load((recipes / "conda.yaml").read_text())["requirements"]["run"]
    found = {row.split()[0]: "".join(row.split()[1:]) for row in run if row not in ("pip", "python >=3.11")}
    asked = [Requirement(row) for row in requires("kochab-astro") if "extra ==" not in row]
    names = {one: OTHER_NAMES.get(one.name.lower(), one.name.lower()) for one in asked}
    wanted = {name: one.specifier for one, name in names.items() if name not in NOT_ON_CONDA_FORGE}
    assert found.keys() == wanted.keys()
    for name, bounds in wanted.items():
        assert set(found[name].split(",")) == {str(bound) for bound in bounds}, name


def test_flatpak_and_the_desktop_files_have_one_identity(recipes, repository):
    manifest = yaml.safe_load((recipes / "org.kochab_astro.Kochab.yaml").read_text())
    metainfo = (repository / "packaging" / "linux" / "kochab.metainfo.xml").read_text()
    assert f"<id>{manifest['app-id']}</id>" in metainfo
    for source in manifest["modules"][0]["sources"]:
        if source["type"] == "file":
            assert (recipes / source["path"]).is_file(), source


def test_the_resolver_asks_for_everything_with_extras_inside_extras(packaged):
    asked = {re.match(r"[\w.-]+", row)[0].lower() for row in packaged("resolve.py").asked(("cameras", "gamepad"))}
    wanted = {
        Requirement(row).name.lower()
        for row in requires("kochab-astro")
        if not re.search(r"extra ==", row) or re.search(r"extra == .(indi|webcam|gamepad).", row)
    }
    assert asked == wanted
    assert {"av", "pysdl2", "indipyclient"} <= asked
