"""``make audit``: what bandit remarks on in the code, and known vulnerabilities of the packages in use."""

import json
import subprocess
import sys
from collections.abc import Iterable, Mapping
from typing import Any

from tests.patterns import REPOSITORY

PROGRAMS = (
    "frames/sandbox.py",
    "lab/bench/live.py",
    "lab/bench/mount_stops.py",
    "lab/bench/peers.py",
    "window/polar/sound_cues.py",
)
ACCEPTED: dict[str, tuple[tuple[str, ...], str]] = {
    "B101": (("",), "an assert only tells the type checker what is so; no refusal rests on one"),
    "B301": (("frames/sandbox.py",), "between us and a process of our own; never of a file (see SECURITY.md)"),
    "B403": (("frames/sandbox.py",), "the same"),
    "B311": (("simulate/", "window/polar/alignment_run.py"), "the simulated sky, its faults and hands are no secrets"),
    "B404": (PROGRAMS, "Python itself, pip, apt-get, dpkg, solve-field and the system's player of sounds are started"),
    "B603": (PROGRAMS, "from lists of words, without a shell; no word is from a file or a server"),
}
"""Bandit's test -> the files in which it is accepted (begins of names; "" is everywhere), and why."""


def remarks(found: Iterable[Mapping[str, Any]]) -> list[str]:
    """What bandit found beyond :data:`ACCEPTED`, a line each."""
    rows = []
    for one in found:
        name = str(one["filename"]).replace("\\", "/").rpartition("kochab/app/kochab/")[2].rpartition("app/kochab/")[2]
        if not name.startswith(ACCEPTED.get(one["test_id"], ((), ""))[0]):
            rows.append(f"{name}:{one['line_number']} {one['test_id']} {one['issue_text']}")
    return rows


def packages(told: str) -> tuple[str, int]:
    """What pip-audit's JSON says in a sentence, and how many vulnerabilities it knows of."""
    try:
        found = json.loads(told)["dependencies"]
    except (ValueError, KeyError, TypeError):
        return "pip-audit could not ask: it needs the network.", 0
    asked = [one for one in found if "vulns" in one]
    if not asked:
        return f"pip-audit could not ask about any of {len(found)} packages: it needs the network and PyPI itself.", 0
    bad = [
        f"{one['name']} {one['version']}: {hole['id']}, mended in {', '.join(hole['fix_versions']) or 'no version yet'}"
        for one in asked
        for hole in one["vulns"]
    ]
    left = f", {len(found) - len(asked)} it does not know" if len(asked) < len(found) else ""
    return "\n".join([f"pip-audit: {len(bad)} known vulnerabilities in {len(asked)} packages{left}.", *bad]), len(bad)


def ran(*words: str) -> str:
    """The standard output of one of the two programs."""
    return subprocess.run(
        [sys.executable, "-m", *words], cwd=REPOSITORY, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ).stdout


def main() -> int:
    """Print both; 1 when something must be looked at."""
    report = json.loads(ran("bandit", "-q", "-f", "json", "-r", "app"))
    said = remarks(report["results"])
    for test, (files, why) in ACCEPTED.items():
        count = sum(one["test_id"] == test for one in report["results"])
        print(f"{test} {count:3} accepted: {why}" + (f" ({', '.join(files)})" if any(files) else ""))
    print(*[f"bandit: {len(said)} remarks beyond these.", *said], sep="\n")
    sentence, count = packages(ran("pip_audit", "--format", "json", "--progress-spinner", "off", "--skip-editable"))
    print(sentence)
    return int(bool(said) or count > 0)


if __name__ == "__main__":
    sys.exit(main())
