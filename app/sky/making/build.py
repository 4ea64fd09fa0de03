"""Make every file of ``catalogs/`` from unpacked sources, the same bytes from the same input."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.core.progress import Progress, Task
from app.sky import layout
from app.sky.container import write_container
from app.sky.making.check import compare
from app.sky.making.fetch import DEBIAN, PYPI
from app.sky.making.merge import Merged, Stars, merge
from app.sky.making.sources import Sources, find_file, read_sources, source_files
from app.sky.making.tables import write_lines, write_objects


def build(sources: Path, out: Path) -> Task[dict[str, Any]]:
    """Build the catalogue from unpacked packages in ``sources`` into ``out``; its manifest."""
    yield Progress("Reading the sources", 0.0)
    src = read_sources(sources)
    merged = yield from merge(src)
    out.mkdir(parents=True, exist_ok=True)
    yield Progress("Writing the deep list", 0.8)
    write_deep(out / "deep.kcat", merged.deep, merged.link)
    yield Progress("Writing the bright list", 0.9)
    write_bright(out / "bright.kcat", merged, src)
    write_names(out / "names.tsv", src)
    counts = dict(merged.counts)
    counts["deep-sky objects"] = write_objects(find_file(sources, "ongc.db"), out / "objects.tsv")
    figures = find_file(sources, "western/constellationship.fab")
    counts["constellation segments"] = write_lines(figures, out / "lines.tsv")
    yield Progress("Checking against the independent list", 0.95)
    check = compare(out / "deep.kcat", src.listed)
    manifest = write_manifest(out, sources, counts, check)
    yield Progress("Done", 1.0)
    return manifest


def write_deep(path: Path, stars: Stars, link: NDArray[np.int64] | None = None) -> None:
    """Write a deep list; ``link`` (L, 2) pairs (row of ``stars``, row of the bright list)."""
    x, y, z = stars.vector.T
    columns, order = layout.deep_columns(
        np.arctan2(y, x), np.arctan2(z, np.hypot(x, y)), stars.pm, stars.mag, stars.bv, stars.flag
    )
    link = np.zeros((0, 2), dtype=np.int64) if link is None else link
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    deep = place[link[:, 0]]
    rank = np.argsort(deep, kind="stable")
    columns["link_deep"] = deep[rank].astype("<u4")
    columns["link_bright"] = link[rank, 1].astype("<u4")
    speed = np.hypot(columns["pm_ra"].astype(float), columns["pm_dec"].astype(float))
    facts = {
        "kind": "deep",
        "epoch": layout.EPOCH,
        "rows": len(stars),
        "tiers_mmag": layout.TIER_EDGES_MMAG,
        "max_pm_arcsec": round(float(speed.max(initial=0.0)) * 1e-3 + 1e-3, 3),
    }
    write_container(path, facts, columns)


def write_bright(path: Path, merged: Merged, src: Sources) -> None:
    """Write the bright list: 40 bytes a row in 13 columns."""
    stars, raw = merged.bright, src.stars
    x, y, z = stars.vector.T
    turn = layout.TURN / (2 * np.pi)
    cross = np.array([src.cross.get(h, (0, 0, 0)) for h in stars.hip.tolist()], dtype=np.int64)
    cross = cross.reshape(-1, 3)
    bv = np.where(np.isnan(stars.bv), np.iinfo(np.int16).min, np.rint(stars.bv * 1e3))
    columns = {
        "hip": stars.hip.astype("<u4"),
        "hd": cross[:, 1].astype("<u4"),
        "sao": cross[:, 0].astype("<u4"),
        "ra": (np.rint(np.arctan2(y, x) * turn).astype(np.int64) % 2**32).astype("<u4"),
        "dec": np.rint(np.arctan2(z, np.hypot(x, y)) * turn).astype("<i4"),
        "pm_ra": np.rint(stars.pm[:, 0] * 1e2).astype("<i4"),
        "pm_dec": np.rint(stars.pm[:, 1] * 1e2).astype("<i4"),
        "parallax": np.rint(raw.parallax[merged.source] * 1e2).astype("<i4"),
        "mag": np.rint(stars.mag * 1e3).astype("<i2"),
        "bv": bv.astype("<i2"),
        "hr": cross[:, 2].astype("<u2"),
        "component": raw.component[merged.source].astype("u1"),
        "flag": stars.flag.astype("u1"),
    }
    write_container(path, {"kind": "bright", "epoch": layout.EPOCH, "rows": len(stars)}, columns)


def write_names(path: Path, src: Sources) -> None:
    """Write star names and designations by HIP number, of stars in the list."""
    known = set(src.stars.hip.tolist())
    rows = [
        f"{hip}\t{name}\t{designation}\t{';'.join(also)}"
        for hip, (name, designation, also) in sorted(src.names.items())
        if hip in known
    ]
    text = "\n".join(["hip\tname\tdesignation\talso", *rows]) + "\n"
    path.write_text(text, "utf-8", newline="\n")


def write_manifest(
    out: Path, sources: Path, counts: dict[str, int], check: dict[str, float]
) -> dict[str, Any]:
    """Write ``manifest.json``: SHA-256 of what went in and came out, counts, the check."""
    read = {p.name: sha256(p) for p in source_files(sources)}
    files = {
        p.name: {"bytes": p.stat().st_size, "sha256": sha256(p)}
        for p in sorted([*out.glob("*.kcat"), *out.glob("*.tsv")])
    }
    manifest: dict[str, Any] = {
        "check_against_independent_list": check,
        "counts": counts,
        "files": files,
        "packages": {**DEBIAN, **{name: version for name, (version, _) in PYPI.items()}},
        "sources": read,
    }
    text = json.dumps(manifest, indent=1, sort_keys=True, ensure_ascii=False) + "\n"
    (out / "manifest.json").write_text(text, "utf-8", newline="\n")
    return manifest


def sha256(path: Path) -> str:
    """The SHA-256 of a file, as hex."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
