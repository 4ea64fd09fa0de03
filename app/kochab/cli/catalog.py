"""``kochab catalog``: build the star catalogue, say what it holds and how far it reaches."""

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from kochab.cli.options import add_overwrite, number
from kochab.cli.output import to_line, with_progress
from kochab.core.errors import CatalogueError, KochabError

MOST_FIELDS = 2_000_000


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the ``catalog`` command and its actions to the main parser."""
    parser = subparsers.add_parser(
        "catalog",
        help="build, inspect or import star catalogues",
        description="Exit code: 0 done, 1 a check failed, 2 unusable arguments or input.",
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")

    build = actions.add_parser("build", help="make every catalogue file from registry packages")
    build.add_argument("--sources", type=Path, metavar="DIR", help="already unpacked packages")
    build.add_argument("--cache", type=Path, metavar="DIR", help="where packages are kept")
    build.add_argument("--out", type=Path, metavar="DIR", help="default: the catalogs folder")

    info = actions.add_parser("info", help="counts, epochs, checks and sizes")
    info.add_argument("--catalog", metavar="NAME", help="an imported one, or its folder")

    reach = actions.add_parser("coverage", help="fewest and median number of stars in a field")
    reach.add_argument(
        "--fov",
        type=number,
        default=1.2,
        metavar="DEG",
        help="side of the square field, 0.05 to 90 degrees (default: %(default)g)",
    )
    reach.add_argument("--mag-limit", type=number, metavar="V", help="count no fainter stars")
    reach.add_argument(
        "--fields",
        type=int,
        metavar="N",
        help="places tried over the sky (default: one every half field, 200,000 at most)",
    )
    reach.add_argument("--catalog", metavar="NAME", help="an imported one, or its folder")

    bring = actions.add_parser(
        "import",
        help="add a deeper catalogue that you already have",
        description="For catalog info and coverage; frames are still solved with the shipped one.",
    )
    bring.add_argument("path", type=Path, help="ASTAP or astrometry.net index files or their folder, or a Gaia CSV")
    bring.add_argument("--name", default="imported", help="name of the catalogue (default: %(default)s)")
    bring.add_argument("--epoch", type=float, metavar="YEAR", help="epoch of files that give none")
    bring.add_argument("--mag-limit", type=number, metavar="V", help="leave fainter stars out")

    add_overwrite(build)
    add_overwrite(bring)
    for action in (build, info, reach, bring):
        action.add_argument("--json", action="store_true", help="one JSON object on standard output")
        action.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do what ``args`` ask for; the exit code: 0 done, 1 a check failed, 2 unusable input."""
    action = {"build": _build, "info": _info, "coverage": _coverage, "import": _import}
    try:
        return action[args.action](args)
    except KochabError as error:
        if not args.json:
            raise
        print(to_line({"error": str(error)}))
        return 2


def _build(args: argparse.Namespace) -> int:
    from kochab.frames.outputs import refuse_overwriting
    from kochab.sky import shipped_folder
    from kochab.sky.catalogue_build import FILES, build, fetch

    if args.sources is not None and not args.sources.is_dir():
        raise CatalogueError(f"{args.sources} is not a folder.")
    if args.out is not None:
        refuse_overwriting((args.out / name for name in FILES), overwrite=args.overwrite)
    sources = args.sources or with_progress("catalog", fetch(args.cache or _cache()))
    manifest = with_progress("catalog", build(sources, args.out or shipped_folder()))
    if args.out is None:  # the patterns name stars by row, so they are made anew
        from kochab.identification.index_build import build_shipped

        with_progress("catalog", build_shipped())
    if args.json:
        print(to_line(manifest))
        return 0
    for name, facts in manifest["files"].items():
        print(f"{facts['sha256']}  {name}  {facts['bytes']:,} bytes")
    for part in ("counts", "check_against_independent_list"):
        _print_facts(manifest[part])
    return 0


def _cache() -> Path:
    from platformdirs import user_cache_path

    return user_cache_path("kochab") / "catalogue-sources"


def _info(args: argparse.Namespace) -> int:
    from kochab.identification.table_cache import cached_tables as tables
    from kochab.sky.inventory import inventory

    told = with_progress("catalog", inventory(_folder(args.catalog))) | {"tables": tables()}
    if args.json:
        print(to_line(told))
    else:
        _print_info(told)
    return 0 if told["ok"] else 1


def _print_info(told: dict[str, Any]) -> None:
    print(f"{told['stars']:,} stars, {told['frame']}, positions at {told['epoch']}; {told['path']}")
    print("V magnitude      stars")
    for span, count in told["counts"]["per_magnitude"].items():
        print(f"  {span:>9}  {count:>9,}")
    _print_facts({k: v for k, v in told["counts"].items() if k != "per_magnitude"})
    for title, key in (
        ("The bright list", "bright"),
        ("When it was built", "built"),
        ("Against the independent list, 2024.0", "independent_check"),
    ):
        if told[key]:
            print(title)
            _print_facts(told[key])
    print("Files")
    for file in told["files"]:
        print(
            f"  {file['name']:14} {file['bytes']:>12,}  {file['sha256'][:16]}  "
            f"{'as built' if file['ok'] else 'ALTERED'}"
        )
    print(f"  {'together':14} {told['bytes']:>12,}")
    print(f"  {'patterns':14} {told['pattern_bytes']:>12,}")
    if told["tables"]:
        print("Tables of the classic methods, kept on this computer")
        for name, size in told["tables"].items():
            print(f"  {name:36} {size:>12,}")
    print("Checks")
    for check, ok in told["checks"].items():
        print(f"  {'yes' if ok else 'NO':3} {check}")


def _print_facts(facts: dict[str, Any]) -> None:
    for name, value in facts.items():
        print(f"  {name.replace('_', ' ')}: {value:,}")


def _coverage(args: argparse.Namespace) -> int:
    from kochab.sky import open_catalogue
    from kochab.sky.inventory import coverage

    if args.fields is not None and not 1 <= args.fields <= MOST_FIELDS:
        raise CatalogueError(f"--fields must be from 1 to {MOST_FIELDS:,}.")
    catalogue = open_catalogue(_folder(args.catalog) / "deep.kcat")
    told = with_progress("catalog", coverage(catalogue, args.fov, args.mag_limit, args.fields))
    if args.json:
        print(to_line(asdict(told)))
        return 0
    print(
        f"A square field of {told.fov_deg:g} deg, at {told.fields:,} places over the whole sky, "
        f"has {told.fewest:,} stars or more, {told.median:,} in the median and "
        f"{told.most:,} at most."
    )
    print(
        f"1 % of places have {told.percent_1:,} or fewer, 5 % have {told.percent_5:,} or fewer; "
        f"{100 * told.share_with_10:.2f} % have 10 or more."
    )
    print(f"The poorest place: RA {told.poorest_ra_deg:.3f}, Dec {told.poorest_dec_deg:+.3f} deg.")
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

    if args.epoch is not None and not 1900.0 <= args.epoch <= 2100.0:
        raise CatalogueError("--epoch must be a year between 1900 and 2100.")
    folder = user_folder(args.name)
    if folder.exists() and not args.overwrite:
        raise CatalogueError(f"{folder} exists already: choose another --name, or add --overwrite to replace it.")
    foreign = with_progress("catalog", read_foreign(args.path))
    manifest = with_progress("catalog", combine(foreign, folder, args.epoch, args.mag_limit))
    if args.json:
        print(to_line({"folder": str(folder), **manifest}))
        return 0
    print(f"{manifest['imported_from']} at {manifest['imported_epoch']:g}, kept in {folder}")
    _print_facts(manifest["counts"])
    print("catalog info and coverage read it; frames are still solved with the shipped catalogue.")
    return 0
