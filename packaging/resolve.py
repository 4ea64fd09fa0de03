"""Which systems and Pythons have every dependency as a wheel: ``make resolve`` writes ``packaging/RESOLVED.md``.

The resolver of uv is asked for each system instead of installing there: it evaluates markers for that system, which
pip does only for its own. A system with several ages (macOS's release, Linux's C library) is asked from the oldest on.
Where there is no answer, each package of the complete list (that of Linux x64) is asked for alone, to name those
without a wheel. Asks the package index, a minute or two; nothing is installed.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
EXTRAS = {"without extras": (), "with cameras and gamepad": ("cameras", "gamepad")}


@dataclass(frozen=True)
class System:
    """A system as the table names it, and how uv does: a platform and, for macOS, the release, oldest first."""

    name: str
    ages: tuple[tuple[str, str, str], ...]  # what the table says, uv's platform, macOS's release


def _macs(machine: str) -> tuple[tuple[str, str, str], ...]:
    return tuple((f"macOS {r}", f"{machine}-apple-darwin", f"{r}.0") for r in (11, 12, 13, 14, 15))


def _linux(machine: str) -> tuple[tuple[str, str, str], ...]:
    return tuple((f"glibc 2.{r}", f"{machine}-manylinux_2_{r}", "") for r in (28, 31, 34, 36, 39))


SYSTEMS = (
    System("Windows x64", (("", "x86_64-pc-windows-msvc", ""),)),
    System("Windows arm64", (("", "aarch64-pc-windows-msvc", ""),)),
    System("macOS, Intel", _macs("x86_64")),
    System("macOS, Apple silicon", _macs("aarch64")),
    System("Linux x64", _linux("x86_64")),
    System("Linux arm64", _linux("aarch64")),
)


def uv_program(scratch: Path) -> str:
    """The resolver: the system's uv, or one installed into ``scratch``."""
    if found := shutil.which("uv"):
        return found
    subprocess.run([sys.executable, "-m", "venv", str(scratch / "tools")], check=True)
    program = scratch / "tools" / "bin"
    subprocess.run([str(program / "python"), "-m", "pip", "install", "-q", "uv"], check=True)
    return str(program / "uv")


@dataclass(frozen=True)
class Resolver:
    """Asks which releases would be installed."""

    uv: str
    scratch: Path

    def pins(self, requirements: str, python: str, age: tuple[str, str, str], alone: bool = False) -> list[str] | None:
        """Resolve for another system, from wheels only.

        Parameters
        ----------
        requirements : str
            Lines as in a requirements file.
        python : str
            Version, as 3.11.
        age : tuple of str
            A row of a system's ages.
        alone : bool
            Leave out what the requirements themselves ask for.

        Returns
        -------
        list of str or None
            ``name==version`` each; None when there is no answer.
        """
        _, platform, macos = age
        command = [self.uv, "pip", "compile", "-q", "-", "--python-version", python, "--python-platform", platform]
        command += ["--python", sys.executable, "--no-python-downloads"]
        command += ["--only-binary", ":all:", "--no-annotate", "--no-header", *(["--no-deps"] if alone else [])]
        environment = {"MACOSX_DEPLOYMENT_TARGET": macos} if macos else {}
        done = subprocess.run(
            command, input=requirements, capture_output=True, text=True, cwd=self.scratch, env=_clean() | environment
        )
        if done.returncode and "No solution found" not in done.stderr:
            sys.exit(f"The package index can't be asked:\n{done.stderr}")
        return None if done.returncode else done.stdout.split("\n")[:-1]

    def oldest(self, requirements: str, python: str, system: System) -> tuple[str, list[str]] | None:
        """The oldest age of ``system`` with an answer, and the answer."""
        for age in system.ages:
            if (found := self.pins(requirements, python, age)) is not None:
                return age[0], found
        return None

    def without_wheel(self, names: list[str], python: str, system: System) -> list[str]:
        """Those of ``names`` (requirements, a line each) that have no wheel of their own on the newest age."""
        return [name for name in names if self.pins(name, python, system.ages[-1], alone=True) is None]


def _clean() -> dict[str, str]:
    return {key: value for key, value in os.environ.items() if not key.startswith(("UV_", "MACOSX_"))}


def asked(extras: tuple[str, ...]) -> list[str]:
    """The requirements of this checkout with extras, those that an extra has from another put in its place."""
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
    own = re.compile(rf"{re.escape(project['name'])}\[(.*)\]")
    wanted, rows = list(extras), list(project["dependencies"])
    while wanted:
        for row in project["optional-dependencies"][wanted.pop()]:
            if inner := own.match(row):
                wanted += inner[1].split(",")
            else:
                rows.append(row)
    return rows


def cell(resolver: Resolver, rows: list[str], complete: list[str], python: str, system: System) -> str:
    """What the table says of a system and a Python.

    Parameters
    ----------
    resolver : Resolver
    rows : list of str
        The requirements.
    complete : list of str
        Everything that they need in the end, ``name==version`` each.
    python : str
        Version, as 3.11.
    system : System

    Returns
    -------
    str
        Yes with the system's least age, or no with the packages that have no wheel.
    """
    if found := resolver.oldest("\n".join(rows), python, system):
        return f"yes{f', {found[0]}' if found[0] else ''}"
    # The versions that are asked for, and of what these need in turn any version.
    ours = {_name(row): row for row in rows}
    names = [ours.get(_name(pin), _name(pin)) for pin in complete]
    absent = [_name(row) for row in resolver.without_wheel(names, python, system)]
    return f"**no**: {', '.join(absent) or 'versions that exclude each other'}"


def _name(requirement: str) -> str:
    found = re.match(r"[\w.-]+", requirement)
    assert found is not None
    return re.sub(r"[-_.]+", "-", found[0]).lower()


def page() -> str:
    """Ask for everything; the page."""
    with tempfile.TemporaryDirectory() as scratch:
        resolver = Resolver(uv_program(Path(scratch)), Path(scratch))
        parts = [HEAD.format(day=time.strftime("%-d %B %Y", time.gmtime()))]
        linux = SYSTEMS[4]
        for title, extras in EXTRAS.items():
            rows = asked(extras)
            whole = resolver.oldest("\n".join(rows), PYTHONS[1], linux)
            if whole is None:
                sys.exit("Not even Linux x64 has every dependency.")
            cells = list(product(SYSTEMS, PYTHONS))
            with ThreadPoolExecutor(4) as pool:
                told = pool.map(lambda pair, r=rows, w=whole[1]: cell(resolver, r, w, pair[1], pair[0]), cells)
            said = dict(zip(((s.name, p) for s, p in cells), told, strict=True))
            parts += [f"\n## {title.capitalize()} ({len(whole[1])} packages)\n"]
            parts += ["| | " + " | ".join(PYTHONS) + " |", "| --- |" + " --- |" * len(PYTHONS)]
            parts += [f"| {s.name} | " + " | ".join(said[s.name, p] for p in PYTHONS) + " |" for s in SYSTEMS]
    return "\n".join(parts) + "\n"


HEAD = """\
# Where every dependency has a wheel

`make resolve` wrote this on {day}: whether all packages that Kochab needs can be had without a compiler, and
the oldest system for which they can. After **no** stand the packages without a wheel there in any version that Kochab
accepts. Nothing was installed."""

if __name__ == "__main__":
    text = page()
    (CHECKOUT / "packaging" / "RESOLVED.md").write_text(text)
    print(text)
