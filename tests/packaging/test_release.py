"""The release command: what it refuses, and its bill of materials against what is installed."""

import json
from importlib.metadata import version

import pytest

import kochab


@pytest.fixture(scope="module")
def release(packaged):
    return packaged("release.py")


def test_two_builds_that_differ_are_no_release(release, monkeypatch):
    builds = iter([{"a.whl": b"1", "a.tar.gz": b"2"}, {"a.whl": b"1", "a.tar.gz": b"3"}])
    monkeypatch.setattr(release, "build", lambda umask, modified: next(builds))
    with pytest.raises(SystemExit, match=r"Two builds of a.tar.gz differ"):
        release.twice_the_same()


def test_a_version_without_a_date_is_refused_unless_as_a_draft(release, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(release, "changes_of", lambda version: ("- Something.\n", ""))
    monkeypatch.setattr(release, "git", lambda *words: b"" if words[0] == "status" else b"1700000000\n")
    monkeypatch.setattr(release, "build", lambda umask, modified: {"a.whl": b"1"})
    monkeypatch.setattr("sys.argv", ["release.py", str(tmp_path)])
    assert release.main() == 2
    assert "date in CHANGELOG.md" in capsys.readouterr().err
    monkeypatch.setattr("sys.argv", ["release.py", str(tmp_path), "--draft"])
    assert release.main() == 0
    assert {p.name for p in tmp_path.iterdir()} == {
        "a.whl",
        "CHANGES.md",
        "SHA256SUMS",
        f"kochab-{kochab.__version__}.cdx.json",
    }


def test_the_changes_of_this_version_are_found(release):
    changes, _ = release.changes_of(kochab.__version__)
    assert changes.startswith("**")
    assert "\n## " not in changes


def test_the_bill_of_materials_names_what_is_installed(release):
    bill = json.loads(json.dumps(release.bill_of_materials(1_700_000_000)))
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.5")
    found = {part["name"]: part["version"] for part in bill["components"]}
    for name in ("numpy", "scipy", "astropy", "pyside6-essentials", "shiboken6", "pyerfa", "av", "pysdl2"):
        assert found[name] == version(name)
    assert not {"pytest", "kochab-astro", "ruff"} & set(found)
    refs = {part["bom-ref"] for part in bill["components"]} | {bill["metadata"]["component"]["bom-ref"]}
    assert {ref for row in bill["dependencies"] for ref in (row["ref"], *row["dependsOn"])} == refs
    assert bill == release.bill_of_materials(1_700_000_000)
