"""What ``make audit`` makes of the two programs' answers."""

import json

from tests.audit import ACCEPTED, packages, remarks
from tests.house import SOURCE


def found(test, name):
    return {"test_id": test, "filename": f"app/kochab/{name}", "line_number": 7, "issue_text": "a remark"}


def test_only_what_is_accepted_there_passes_without_a_word() -> None:
    assert remarks([found("B101", "core/frame.py"), found("B301", "frames/sandbox.py")]) == []
    assert remarks([found("B301", "frames/fits.py")]) == ["frames/fits.py:7 B301 a remark"]
    assert remarks([found("B602", "frames/sandbox.py")]) == ["frames/sandbox.py:7 B602 a remark"]


def test_what_is_accepted_names_what_is_there_and_why() -> None:
    for files, why in ACCEPTED.values():
        assert why
        assert all((SOURCE / name).exists() for name in files)


def test_vulnerable_packages_are_named_and_no_network_is_said() -> None:
    hole = {"name": "pillow", "version": "10.0", "vulns": [{"id": "CVE-1", "fix_versions": ["10.3"]}]}
    unknown = {"name": "kochab", "skip_reason": "not found"}
    sentence, count = packages(json.dumps({"dependencies": [hole, {**hole, "name": "numpy", "vulns": []}, unknown]}))
    assert count == 1
    assert "pillow 10.0: CVE-1, mended in 10.3" in sentence
    assert "1 known vulnerabilities in 2 packages, 1 it does not know" in sentence
    for told in ("", json.dumps({"dependencies": [unknown]})):
        assert packages(told)[1] == 0
        assert "needs the network" in packages(told)[0]
