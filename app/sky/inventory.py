"""What a catalogue holds and whether its files are the ones that were shipped."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from app.core.errors import CatalogueError
from app.core.progress import Progress, Task
from app.sky import layout
from app.sky.catalogue import Catalogue
from app.sky.container import Container


def inventory(folder: Path) -> Task[dict[str, Any]]:
    """Counts, epochs, sizes and checks of the catalogue in ``folder``.

    ``ok`` is false when a file differs from the manifest or the index does not fit the stars.
    """
    yield Progress("Opening the catalogue", 0.0)
    catalogue = Catalogue(folder / "deep.kcat")
    manifest = read_manifest(folder)
    files = []
    for i, (name, want) in enumerate(manifest["files"].items()):
        yield Progress("Checking the files", 0.1 + 0.5 * i / len(manifest["files"]), name)
        files.append(_file(folder / name, want))
    yield Progress("Counting stars", 0.7)
    counts = _counts(catalogue)
    yield Progress("Checking the order of the stars", 0.9)
    checks = {"files are as built": all(f["ok"] for f in files), **_checks(catalogue)}
    marks = _pattern_marks(folder)
    if marks:
        deep = next((f["sha256"] for f in files if f["name"] == "deep.kcat"), "")
        checks["patterns belong to these stars"] = marks == {deep}
    return {
        "path": str(catalogue.container.path),
        "stars": len(catalogue),
        "epoch": catalogue.container.facts["epoch"],
        "frame": "ICRS",
        "fastest_arcsec_per_year": catalogue.max_pm_arcsec,
        "bright": _bright(folder / "bright.kcat") if (folder / "bright.kcat").exists() else None,
        "counts": counts,
        "files": files,
        "bytes": sum(f["bytes"] for f in files),
        "pattern_bytes": sum(p.stat().st_size for p in folder.glob("patterns/*/*.npy")),
        "built": manifest.get("counts", {}),
        "independent_check": manifest.get("check_against_independent_list", {}),
        "checks": checks,
        "ok": all(checks.values()),
    }


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest beside a catalogue: what was built, with sizes and SHA-256."""
    path = folder / "manifest.json"
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
        manifest["files"].items()
    except FileNotFoundError:
        raise CatalogueError(f"{path} is missing, so nothing can be checked.") from None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        raise CatalogueError(f"{path} is damaged.") from None
    return dict(manifest)


def _file(path: Path, want: dict[str, Any]) -> dict[str, Any]:
    from app.sky.making.build import sha256

    found = sha256(path) if path.is_file() else ""
    size = path.stat().st_size if path.is_file() else 0
    return {"name": path.name, "bytes": size, "sha256": found, "ok": found == want.get("sha256")}


def _pattern_marks(folder: Path) -> set[str]:
    """The catalogues that the patterns beside this one were made from: SHA-256 of deep lists."""
    marks = set()
    for index in folder.glob("patterns/*/index.json"):
        try:
            marks.add(str(json.loads(index.read_text(encoding="utf-8"))["mark"]))
        except (OSError, ValueError, KeyError, TypeError):
            marks.add("")
    return marks


def _counts(catalogue: Catalogue) -> dict[str, Any]:
    rows = np.arange(len(catalogue))
    mag, flag = catalogue.mag(rows), catalogue.flags(rows)
    edges = np.arange(int(np.floor(mag.min())), int(np.floor(mag.max())) + 2)
    per_mag = np.histogram(mag, bins=edges)[0]
    return {
        "per_magnitude": {
            f"{low} to {low + 1}": int(n)
            for low, n in zip(edges[:-1].tolist(), per_mag, strict=True)
        },
        "of_hipparcos": int(np.sum(flag & layout.HIPPARCOS > 0)),
        "with_proper_motion": int(np.sum(flag & layout.MOVING > 0)),
        "with_colour": int(np.sum(np.isfinite(catalogue.bv(rows)))),
        "photocentres": int(np.sum(flag & layout.MERGED > 0)),
        "taken_to_j2000": int(np.sum(flag & layout.REDATED > 0)),
        "v_from_vt": int(np.sum(flag & layout.V_FROM_VT > 0)),
    }


def _checks(catalogue: Catalogue) -> dict[str, bool]:
    column = catalogue.container.column
    dec = column("dec").astype(np.float64) * (2 * np.pi / layout.TURN)
    tier = np.searchsorted(layout.TIER_EDGES_MMAG, column("mag").astype(np.int64), side="right")
    cell = tier * layout.ZONES + layout.zone_of(dec)
    step = np.diff(cell)
    ra = column("ra").astype(np.int64)
    index = layout.zone_index(tier, layout.zone_of(dec))
    return {
        "stars are in order": bool(np.all((step > 0) | ((step == 0) & (np.diff(ra) >= 0)))),
        "the index fits": bool(np.array_equal(index, column("zones"))),
        "declinations are real": bool(np.all(np.abs(dec) <= np.pi / 2)),
    }


def _bright(path: Path) -> dict[str, Any]:
    bright = Container(path)
    return {
        "rows": int(bright.facts["rows"]),
        "hip": len(np.unique(bright.column("hip"))),
        **{k: int(np.sum(bright.column(k) > 0)) for k in ("hd", "hr", "sao")},
        "with_parallax": int(np.sum(bright.column("parallax") > 0)),
    }
