"""A release in one command: ``make release`` (``python packaging/release.py [FOLDER] [--draft]``; dist/release).

Refuses a checkout with changes, and a version whose heading in CHANGELOG.md has no date (``--draft`` does not). Then:
the wheel and the source distribution, built twice from copies that differ in folder, times and permissions, and equal
byte for byte; the changes of this version; a bill of materials (CycloneDX 1.5) of what is installed here; checksums.
"""

import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import time
import tomllib
import uuid
from collections.abc import Iterable, Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from io import BytesIO
from pathlib import Path

from packaging.requirements import Requirement

from kochab.core import __version__

CHECKOUT = Path(__file__).resolve().parents[1]
NAME = "kochab-astro"
EXTRAS = ("cameras", "gamepad")


def main() -> int:
    """Make the release; 2 with a sentence when this checkout is none."""
    parser = argparse.ArgumentParser(description="Make a release.")
    parser.add_argument("folder", nargs="?", type=Path, default=CHECKOUT / "dist" / "release")
    parser.add_argument("--draft", action="store_true", help="of a version that has no date yet, or with changes")
    args = parser.parse_args()
    changes, date = changes_of(__version__)
    changed = git("status", "--porcelain", "--untracked-files=no").decode()
    if not args.draft and (changed or not date):
        print("Commit everything and give the version its date in CHANGELOG.md first.", file=sys.stderr)
        return 2
    made = git("log", "-1", "--format=%ct").decode().strip()
    os.environ["SOURCE_DATE_EPOCH"] = made
    args.folder.mkdir(parents=True, exist_ok=True)
    for old in args.folder.iterdir():
        old.unlink()
    for name, data in twice_the_same().items():
        (args.folder / name).write_bytes(data)
    (args.folder / "CHANGES.md").write_text(changes)
    bill = json.dumps(bill_of_materials(int(made)), indent=1, sort_keys=True) + "\n"
    (args.folder / f"kochab-{__version__}.cdx.json").write_text(bill)
    checksums(args.folder)
    print((args.folder / "SHA256SUMS").read_text(), end="")
    return 0


def changes_of(version: str) -> tuple[str, str]:
    """What CHANGELOG.md says of a version, and its date, empty when it has none."""
    text = (CHECKOUT / "CHANGELOG.md").read_text()
    found = re.search(rf"^## {re.escape(version)} \((.*?)\)\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    if not found:
        sys.exit(f"CHANGELOG.md has no heading for {version}.")
    return found[2].strip() + "\n", found[1] if re.fullmatch(r"\d{4}-\d\d-\d\d", found[1]) else ""


def twice_the_same() -> dict[str, bytes]:
    """The wheel and the source distribution, by name; an error when a second build differs."""
    first, second = build(0o022, 1_000_000_000), build(0o077, 1_700_000_000)
    if different := [name for name in first if first[name] != second.get(name)]:
        sys.exit(f"Two builds of {', '.join(different)} differ.")
    return first


def build(umask: int, modified: int) -> dict[str, bytes]:
    """Build the last commit, unpacked with these permissions and times, in a folder of its own."""
    with tempfile.TemporaryDirectory() as scratch:
        source, out = Path(scratch, "source"), Path(scratch, "out")
        with tarfile.open(fileobj=BytesIO(git("archive", "HEAD"))) as packed:
            packed.extractall(source, filter="tar")
        for path in sorted(source.rglob("*"), reverse=True):
            path.chmod(path.stat().st_mode & ~umask)
            os.utime(path, (modified, modified))
        command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(source)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return {path.name: path.read_bytes() for path in sorted(out.iterdir())}


def bill_of_materials(made: int) -> dict[str, object]:
    """CycloneDX of Kochab and everything that it needs here, with versions and licences."""
    parts = dict(needed())
    refs = {name: f"pkg:pypi/{name}@{part.version}" for name, part in parts.items()}
    own = f"pkg:pypi/{NAME}@{__version__}"
    component = {"type": "application", "name": NAME, "version": __version__, "bom-ref": own, "purl": own}
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "serialNumber": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, own + str(sorted(refs.values())))}",
        "version": 1,
        "metadata": {
            "timestamp": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(made)),
            "component": component | {"licenses": [{"license": {"id": "GPL-3.0-or-later"}}]},
        },
        "components": [
            {"type": "library", "name": name, "version": part.version, "bom-ref": refs[name], "purl": refs[name]}
            | {"licenses": [{"license": {"name": licence_of(part)}}]}
            for name, part in sorted(parts.items())
        ],
        "dependencies": [
            {"ref": own, "dependsOn": sorted(refs[n] for n in own_requirements() if n in refs)},
            *(
                {"ref": refs[name], "dependsOn": sorted(refs[n] for n in requirements(part) if n in refs)}
                for name, part in sorted(parts.items())
            ),
        ],
    }


def needed() -> Iterator[tuple[str, Distribution]]:
    """Every installed package that Kochab needs with its extras, and what these need, without Kochab."""
    seen = {NAME}
    asked = own_requirements()
    while asked:
        name = asked.pop()
        if name in seen:
            continue
        seen.add(name)
        try:
            part = distribution(name)
        except PackageNotFoundError:  # an extra that is not installed here
            continue
        yield name, part
        asked += requirements(part)


def own_requirements() -> list[str]:
    """The names that Kochab asks for on this machine, with its extras."""
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    asked = [*project["dependencies"], *(text for name in EXTRAS for text in extras[name])]
    asked += [
        text for row in asked if row.startswith(NAME) for name in Requirement(row).extras for text in extras[name]
    ]
    return [name for name in names(asked) if name != NAME]


def requirements(part: Distribution) -> list[str]:
    """The names that a package asks for on this machine, without extras."""
    return names(part.requires or [])


def names(requirements: Iterable[str]) -> list[str]:
    """Names as the index writes them, of those whose markers hold here."""
    asked = [Requirement(text) for text in requirements]
    held = [one for one in asked if one.marker is None or one.marker.evaluate({"extra": ""})]
    return [re.sub(r"[-_.]+", "-", one.name).lower() for one in held]


def licence_of(part: Distribution) -> str:
    """The licence as the package's metadata gives it, in one line."""
    if expression := part.metadata.get("License-Expression"):
        return str(expression)
    listed = [c.rpartition(" :: ")[2] for c in part.metadata.get_all("Classifier") or [] if c.startswith("License ::")]
    return listed[0] if listed else (part.metadata.get("License") or "see its files").splitlines()[0]


def checksums(folder: Path) -> None:
    """SHA256SUMS of every file, as ``sha256sum -c`` reads it."""
    rows = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in sorted(folder.iterdir())]
    (folder / "SHA256SUMS").write_text("".join(rows))


def git(*words: str) -> bytes:
    """What git says of this checkout."""
    return subprocess.run(["git", *words], cwd=CHECKOUT, check=True, capture_output=True).stdout


if __name__ == "__main__":
    sys.exit(main())
