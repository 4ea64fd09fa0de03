"""``kochab catalog``: build the star catalogue, say what it holds and how far it reaches."""

import argparse
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from kochab.cli.options import add_options, between, number, valued, whole
from kochab.cli.output import tell, tell_failure, with_progress
from kochab.core.errors import CatalogueError, KochabError
from kochab.folders import cache_folder
from kochab.sky import shipped_folder


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the ``catalog`` command and its actions to the main parser."""
    parser = subparsers.add_parser(
        "catalog", description="Exit code: 0 done, 1 a check failed, 2 unusable arguments or input."
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")

    build = actions.add_parser("build", help="make every catalogue file from registry packages (in a checkout)")
    build.add_argument("--sources", type=Path, metavar="DIR", help="already unpacked packages")
    build.add_argument("--cache", type=Path, metavar="DIR", help="where packages are kept")
    build.add_argument("--out", type=Path, metavar="DIR", help="default: the catalogs folder")

    info = actions.add_parser("info", help="counts, epochs, checks and sizes")
    info.add_argument("--catalog", metavar="NAME", help="an imported one, or its folder")

    reach = actions.add_parser("coverage", help="fewest and median number of stars in a field")
    side = "side of the square field, 0.05 to 90 degrees (default: %(default)g)"
    reach.add_argument("--fov", **valued("DEG", side, number, default=1.2))
    reach.add_argument("--mag-limit", type=number, metavar="V", help="count no fainter stars")
    tried = "places tried over the sky (default: one every half field, 200,000 at most)"
    reach.add_argument("--fields", **valued("N", tried, whole(1, 2_000_000)))
    reach.add_argument("--catalog", metavar="NAME", help="an imported one, or its folder")

    bring = actions.add_parser(
        "import",
        help="add a deeper catalogue that you already have",
        description="For catalog info and coverage; frames are still solved with the shipped one.",
    )
    bring.add_argument("path", type=Path, help="ASTAP or astrometry.net index files or their folder, or a Gaia CSV")
    bring.add_argument("--name", default="imported", help="name of the catalogue (default: %(default)s)")
    bring.add_argument(
        "--epoch", **valued("YEAR", "epoch of files that give none", between(1900.0, 2100.0, "as a year"))
    )
    bring.add_argument("--mag-limit", type=number, metavar="V", help="leave fainter stars out")

    use = actions.add_parser(
        "use",
        help="solve narrow fields with a star catalogue that you already have",
        description="ASTAP's databases, astrometry.net index files or a Gaia table, read where they are, beside the"
        " shipped stars. They solve fields down to 0.1 degrees whose place and scale are known.",
    )
    use.add_argument("what", metavar="NAME|PATH|none", help="D50, 5200, a folder or a file; none: shipped stars only")
    index = actions.add_parser(
        "index",
        help="index that catalogue: solve fields from 0.25 degrees blind",
        description="Takes minutes and up to 700 MB, once; interrupted, it continues. The window does so at its start.",
    )
    listed = actions.add_parser("list", help="star catalogues on this computer, and which one is used")

    add_options(build, "--overwrite")
    add_options(bring, "--overwrite")
    for action in (build, info, reach, bring, use, index, listed):
        add_options(action, "--json")
        action.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do what ``args`` ask for; the exit code: 0 done, 1 a check failed, 2 unusable input."""
    action = {"build": _build, "info": _info, "coverage": _coverage, "import": _import}
    action |= {"use": _use, "index": _index, "list": _list}
    try:
        return action[args.action](args)
    except KochabError as error:
        if not args.json:
            raise
        tell_failure(error, as_json=True)
        return 2


def _making() -> Any:
    """What makes the catalogue: it stands beside the data in a checkout, and nowhere else."""
    checkout = shipped_folder().parent
    if not (checkout / "catalogs" / "making").is_dir():
        raise CatalogueError("The catalogue is made in a checkout of Kochab: make catalogs.")
    sys.path.append(str(checkout))
    return import_module("catalogs.making.build")


def _build(args: argparse.Namespace) -> int:
    from kochab.frames.outputs import refuse_overwriting

    making = _making()
    if args.sources is not None and not args.sources.is_dir():
        raise CatalogueError(f"{args.sources} is not a folder.")
    # The shipped folder is renewed without asking; a folder of one's own is not.
    if args.out is not None:
        refuse_overwriting((args.out / name for name in making.FILES), overwrite=args.overwrite)
    cache = args.cache or cache_folder() / "catalogue-sources"
    sources = args.sources or with_progress("catalog", making.fetch(cache))
    manifest = with_progress("catalog", making.build(sources, args.out or shipped_folder()))
    if args.out is None:  # the patterns name stars by row, so they are made anew
        from kochab.identification.index_build import build_shipped

        with_progress("catalog", build_shipped())
    lines = [f"{facts['sha256']}  {name}  {facts['bytes']:,} bytes" for name, facts in manifest["files"].items()]
    lines += [*_facts(manifest["counts"]), *_facts(manifest["check_against_independent_list"])]
    tell(manifest, "\n".join(lines), args.json)
    return 0


def _info(args: argparse.Namespace) -> int:
    from kochab.identification.table_cache import cached_tables as tables
    from kochab.sky.inventory import inventory

    facts = with_progress("catalog", inventory(_folder(args.catalog))) | {"tables": tables()}
    tell(facts, "\n".join(_info_lines(facts)), args.json)
    return 0 if facts["ok"] else 1


def _info_lines(facts: dict[str, Any]) -> Iterator[str]:
    yield f"{facts['stars']:,} stars, {facts['frame']}, positions at {facts['epoch']}; {facts['path']}"
    yield "V magnitude      stars"
    for span, count in facts["counts"]["per_magnitude"].items():
        yield f"  {span:>9}  {count:>9,}"
    yield from _facts({k: v for k, v in facts["counts"].items() if k != "per_magnitude"})
    for title, key in (
        ("The bright list", "bright"),
        ("When it was built", "built"),
        ("Against the independent list, 2024.0", "independent_check"),
    ):
        if facts[key]:
            yield title
            yield from _facts(facts[key])
    yield "Files"
    for file in facts["files"]:
        state = "as built" if file["ok"] else "ALTERED"
        yield f"  {file['name']:14} {file['bytes']:>12,}  {file['sha256'][:16]}  {state}"
    yield f"  {'together':14} {facts['bytes']:>12,}"
    yield f"  {'patterns':14} {facts['pattern_bytes']:>12,}"
    if facts["tables"]:
        yield "Tables of the classic methods, kept on this computer"
        for name, size in facts["tables"].items():
            yield f"  {name:36} {size:>12,}"
    yield "Checks"
    for check, ok in facts["checks"].items():
        yield f"  {'yes' if ok else 'NO':3} {check}"


def _facts(facts: dict[str, Any]) -> list[str]:
    return [f"  {name.replace('_', ' ')}: {value:,}" for name, value in facts.items()]


def _coverage(args: argparse.Namespace) -> int:
    from kochab.sky import open_catalogue
    from kochab.sky.inventory import coverage

    catalogue = open_catalogue(_folder(args.catalog) / "deep.kcat")
    facts = with_progress("catalog", coverage(catalogue, args.fov, args.mag_limit, args.fields))
    text = (
        "A square field of {fov_deg:g} deg, at {fields:,} places over the whole sky, "
        "has {fewest:,} stars or more, {median:,} in the median and {most:,} at most.\n"
        "1 % of places have {percent_1:,} or fewer, 5 % have {percent_5:,} or fewer; "
        "{share:.2f} % have 10 or more.\n"
        "The poorest place: RA {poorest_ra_deg:.3f}, Dec {poorest_dec_deg:+.3f} deg."
    )
    tell(facts, text.format(**facts, share=100 * facts["share_with_10"]), args.json)
    return 0


def _folder(catalog: str | None) -> Path:
    """The folder of a catalogue: the shipped one, a path, or an imported one by its name."""
    from kochab.sky import shipped_folder
    from kochab.sky.catalogue_import import user_folder

    if catalog is None:
        return shipped_folder()
    if Path(catalog).is_dir():
        return Path(catalog)
    folder = user_folder(catalog)
    if not folder.is_dir():
        there = sorted(path.name for path in folder.parent.glob("*/"))
        raise CatalogueError(
            f"No catalogue was imported as {catalog!r}; "
            + (f"there are {', '.join(there)}." if there else "none was imported at all.")
        )
    return folder


def _import(args: argparse.Namespace) -> int:
    from kochab.sky.catalogue_import import combine, read_foreign, user_folder

    folder = user_folder(args.name)
    if folder.exists() and not args.overwrite:
        raise CatalogueError(f"{folder} exists already: choose another --name, or add --overwrite to replace it.")
    foreign = with_progress("catalog", read_foreign(args.path))
    manifest = with_progress("catalog", combine(foreign, folder, args.epoch, args.mag_limit))
    lines = [
        f"{manifest['imported_from']} at {manifest['imported_epoch']:g}, kept in {folder}",
        *_facts(manifest["counts"]),
        "catalog info and coverage read it; frames are still solved with the shipped catalogue.",
    ]
    tell({"folder": str(folder), **manifest}, "\n".join(lines), args.json)
    return 0


def _use(args: argparse.Namespace) -> int:
    from kochab.sky import user_catalogues

    if args.what.lower() == "none":
        user_catalogues.forget()
        tell({"in_use": None}, "Solving with the shipped stars only.", args.json)
        return 0
    catalogue = with_progress("catalog", user_catalogues.choose(args.what))
    facts = user_catalogues.facts_of(catalogue)
    tell({"in_use": facts}, f"Using {user_catalogues.described(facts)}", args.json)
    return 0


def _index(args: argparse.Namespace) -> int:
    from kochab.solver.own_index import SERVES_DEG, make_own

    volumes = with_progress("catalog", make_own())
    if not volumes:
        raise CatalogueError("No catalogue of yours is in use: see kochab catalog use.")
    stars, path = sum(int(volume.offsets[-1]) for volume in volumes), volumes[0].folder.parent
    tell({"stars": stars, "path": str(path), "fields_deg": [*SERVES_DEG]}, f"{stars:,} stars in {path}.", args.json)
    return 0


def _list(args: argparse.Namespace) -> int:
    from kochab.sky import user_catalogues

    rows = user_catalogues.listed()
    lines = [("* " if row["in_use"] else "  ") + user_catalogues.described(row) for row in rows]
    lines += [] if any(row["in_use"] for row in rows) else ["Only the shipped stars are used; see kochab catalog use."]
    tell({"catalogues": rows}, "\n".join(lines), args.json)
    return 0
