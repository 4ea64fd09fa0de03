"""Get the packages the catalogue is made of, from the registries' own clients, into a folder."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

from app.core.errors import CatalogueError
from app.core.progress import Progress, Task

DEBIAN = {"astrometry-data-tycho2-07-littleendian": "2-4", "stellarium-data": "0.22.2-1"}
PYPI = {
    "cedar-solve": ("0.5.1", "default_database.npz"),
    "pyongc": ("1.2.2", "ongc.db"),
}


def fetch(folder: Path) -> Task[Path]:
    """Download and unpack every source below ``folder``; what is there already is kept.

    Raises `CatalogueError` with one sentence when a client is absent or a package cannot be had.
    """
    folder.mkdir(parents=True, exist_ok=True)
    steps = len(DEBIAN) + len(PYPI)
    for step, (name, version) in enumerate(DEBIAN.items()):
        yield Progress("Fetching the sources", step / steps, f"{name} {version}")
        yield from _debian(folder, name, version)
    for step, (name, (version, wanted)) in enumerate(PYPI.items(), len(DEBIAN)):
        yield Progress("Fetching the sources", step / steps, f"{name} {version}")
        yield from _wheel(folder, name, version, wanted)
    return folder


def _debian(folder: Path, name: str, version: str) -> Task[None]:
    target = folder / f"{name}_{version}"
    if target.is_dir():
        return
    for tool in ("apt-get", "dpkg"):
        if shutil.which(tool) is None:
            raise CatalogueError(
                f"{name} comes as a Debian package and {tool} is not here: unpack it elsewhere "
                "and name the folder with --sources."
            )
    yield from _client(["apt-get", "download", f"{name}={version}"], folder, name)
    package = next(iter(sorted(folder.glob(f"{name}_*.deb"))), None)
    if package is None:
        raise CatalogueError(f"The package {name} {version} did not arrive.")
    part = folder / f"{name}.part"
    shutil.rmtree(part, ignore_errors=True)
    yield from _client(["dpkg", "-x", package.name, part.name], folder, name)
    part.rename(target)
    package.unlink()


def _wheel(folder: Path, name: str, version: str, wanted: str) -> Task[None]:
    target = folder / f"{name}_{version}"
    if target.is_dir():
        return
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps"]
    yield from _client([*command, "--dest", ".", f"{name}=={version}"], folder, name)
    stem = name.replace("-", "_")
    wheel = next(iter(sorted(folder.glob(f"{stem}-{version}-*.whl"))), None)
    if wheel is None:
        raise CatalogueError(f"The package {name} {version} did not arrive.")
    target.mkdir()
    with zipfile.ZipFile(wheel) as archive:
        inside = [n for n in archive.namelist() if n.endswith("/" + wanted)]
        if not inside:
            raise CatalogueError(f"The package {name} {version} lacks {wanted}.")
        (target / wanted).write_bytes(archive.read(inside[0]))
    wheel.unlink()


def _client(command: list[str], folder: Path, name: str) -> Task[None]:
    """Run a registry's client in ``folder``, yielding while it works; closing ends it."""
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            while True:
                try:
                    _, said = process.communicate(timeout=0.2)
                    break
                except subprocess.TimeoutExpired:
                    yield Progress("Fetching the sources", None, name)
        finally:
            if process.poll() is None:
                process.terminate()
    if process.returncode:
        last = next((line for line in reversed(said.splitlines()) if line.strip()), "no reason")
        raise CatalogueError(f"{command[0]} could not get {name}: {last.strip()}")
