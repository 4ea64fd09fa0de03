"""What a catalogue holds, whether its files are those shipped, and how many stars a field has."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg
from kochab.core.errors import UsageError
from kochab.core.progress import Progress, Task
from kochab.parsing.text_input import read_json
from kochab.sky import catalogue_file
from kochab.sky.catalogue import Catalogue
from kochab.sky.catalogue_file import Container, read_manifest, sha256


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


def _file(path: Path, want: dict[str, Any]) -> dict[str, Any]:
    found = sha256(path) if path.is_file() else ""
    size = path.stat().st_size if path.is_file() else 0
    return {"name": path.name, "bytes": size, "sha256": found, "ok": found == want.get("sha256")}


def _pattern_marks(folder: Path) -> set[str]:
    """The catalogues that the patterns beside this one were made from: SHA-256 of deep lists."""
    marks = set()
    for index in folder.glob("patterns/*/index.json"):
        try:
            marks.add(str(read_json(index)["mark"]))
        except (ValueError, KeyError, TypeError):
            marks.add("")
    return marks


def _counts(catalogue: Catalogue) -> dict[str, Any]:
    rows = np.arange(len(catalogue))
    mag, flag = catalogue.mag(rows), catalogue.flags(rows)

    def flagged(bit: int) -> int:
        return int(np.count_nonzero(flag & bit))

    edges = np.arange(int(np.floor(mag.min())), int(np.floor(mag.max())) + 2)
    per_mag = np.histogram(mag, bins=edges)[0]
    return {
        "per_magnitude": {f"{low} to {low + 1}": int(n) for low, n in zip(edges[:-1].tolist(), per_mag, strict=True)},
        "of_hipparcos": flagged(catalogue_file.HIPPARCOS),
        "with_proper_motion": flagged(catalogue_file.MOVING),
        "with_colour": int(np.sum(np.isfinite(catalogue.bv(rows)))),
        "photocentres": flagged(catalogue_file.MERGED),
        "taken_to_j2000": flagged(catalogue_file.REDATED),
        "v_from_vt": flagged(catalogue_file.V_FROM_VT),
    }


def _checks(catalogue: Catalogue) -> dict[str, bool]:
    column = catalogue.container.column
    dec = column("dec").astype(np.float64) * (2 * np.pi / catalogue_file.TURN)
    tier = np.searchsorted(catalogue_file.TIER_EDGES_MMAG, column("mag").astype(np.int64), side="right")
    zone = catalogue_file.zone_of(dec)
    step = np.diff(tier * catalogue_file.ZONES + zone)
    ra = column("ra").astype(np.int64)
    index = catalogue_file.zone_index(tier, zone)
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


WIDE = 0.6  # chord beyond which looking at every star is faster
PAIRS = 200_000  # of field and star, held in memory at a time
PERCENT = {"fewest": 0, "percent_1": 1, "percent_5": 5, "median": 50, "most": 100}


def even_points(n: int) -> Floats:
    """Unit vectors (n, 3) on a Fibonacci spiral: each stands for the same area."""
    z = 1.0 - (2.0 * np.arange(n) + 1.0) / n
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(n)  # the golden one
    flat = np.sqrt(1.0 - z * z)
    return np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=1)


def coverage(
    catalogue: Catalogue, fov_deg: float, mag_limit: float | None = None, fields: int | None = None
) -> Task[dict[str, Any]]:
    """Count the stars of square fields, sides along RA and Dec, at places spread evenly over the sky.

    Parameters
    ----------
    catalogue : Catalogue
        The star catalogue.
    fov_deg : float
        Side of a field, 0.05 to 90 degrees.
    mag_limit : float or None
        Faintest V counted; None for all.
    fields : int or None
        How many places are tried; None: one each half field, 200 to 200,000.
    """
    if not 0.05 <= fov_deg <= 90.0:
        raise UsageError("The field must be between 0.05 and 90 degrees wide.")
    if fields is None:
        fields = int(np.clip(41253.0 / (fov_deg / 2.0) ** 2, 200, 200_000))
    yield Progress("Reading the catalogue", 0.0)
    rows = np.arange(len(catalogue))
    if mag_limit is not None:
        rows = rows[catalogue.mag(rows) <= mag_limit]
    stars = catalogue.vectors(rows)
    yield Progress("Sorting the stars", 0.05)
    from scipy.spatial import cKDTree

    centres = even_points(fields)
    counts = np.zeros(fields, dtype=np.int64)
    # fields are squares on the tangent plane; the cone below reaches their corners
    half = np.tan(np.radians(fov_deg) / 2.0)
    chord = 2.0 * np.sin(np.arctan(np.sqrt(2.0) * half) / 2.0)
    tree = cKDTree(stars, balanced_tree=False, compact_nodes=False)
    # chord^2 / 4 is the cone's share of the sphere, so this is the mean number of pairs a field
    step = max(1, int(PAIRS / max(1.0, len(stars) * chord * chord / 4.0)))
    for first in range(0, fields, step):
        some = slice(first, first + step)
        counts[some] = _counted(centres[some], stars, tree, chord, half)
        yield Progress("Counting stars in fields", 0.1 + 0.9 * min(1.0, (first + step) / fields))
    ranks = np.percentile(counts, [*PERCENT.values()], method="lower").astype(int).tolist()
    ra, dec = radec_deg(centres[int(np.argmin(counts))])
    return {
        "fov_deg": fov_deg,
        "mag_limit": mag_limit,
        "fields": fields,
        **dict(zip(PERCENT, ranks, strict=True)),
        "share_with_10": float(np.mean(counts >= 10)),
        "poorest_ra_deg": round(ra, 4),
        "poorest_dec_deg": round(dec, 4),
    }


def _counted(centres: Floats, stars: Floats, tree: Any, chord: float, half: float) -> NDArray[np.int64]:
    """Stars in each square: through the tree while fields are small, else star by star."""
    from scipy.spatial import cKDTree

    if chord > WIDE:
        return np.array([_in_square(c[None], stars, half).sum() for c in centres])
    near = cKDTree(centres).sparse_distance_matrix(tree, chord, output_type="ndarray")
    inside = _in_square(centres[near["i"]], stars[near["j"]], half)
    return np.bincount(near["i"][inside], minlength=len(centres))


def _in_square(centre: Floats, star: Floats, half: float) -> NDArray[np.bool_]:
    """Whether each star (P, 3) projects within ``half`` (tangent) of its centre on both axes."""
    flat = np.hypot(centre[:, 0], centre[:, 1])
    depth = star @ centre[0] if len(centre) == 1 else np.einsum("ij,ij->i", centre, star)
    x = (centre[:, 0] * star[:, 1] - centre[:, 1] * star[:, 0]) / flat
    y = (star[:, 2] - depth * centre[:, 2]) / flat
    return np.asarray((np.abs(x) <= half * depth) & (np.abs(y) <= half * depth))
