"""``kochab profile``: equipment kept by name, and what ``--profile NAME`` stands for."""

import argparse
from typing import TYPE_CHECKING, Any

from kochab.cli.options import CAMERA, MOUNT, add_options, number, number_above_zero
from kochab.cli.output import tell, tell_failure
from kochab.core.errors import KochabError, UsageError
from kochab.core.mount import Epoch

if TYPE_CHECKING:
    from kochab.gear.profiles import EquipmentProfile

MERIDIAN = ("stays", "flips", "crosses")
EDGES = {
    "lowest-altitude": "horizon limit, degrees (5)",
    "highest-altitude": "upper limit, degrees (90)",
    "past-meridian": "how far a German mount may track past the meridian, degrees (15)",
}


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``profile`` and its actions."""
    parser = subparsers.add_parser(
        "profile",
        description="An equipment profile keeps a camera, its optics, a mount, a site and limits under"
        " one name. solve, live, camera, mount and polar take it with --profile NAME; options"
        " override it. Exit code: 0 done, 1 no such profile, 2 usage.",
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    listing = actions.add_parser("list", help="all profiles")
    show = actions.add_parser("show", help="what a profile holds")
    save = actions.add_parser(
        "save",
        help="make a profile, or change one",
        description="Values that are not given stay as they are in the profile.",
    )
    remove = actions.add_parser("remove", help="delete a profile")
    for action in (show, save, remove):
        action.add_argument("name", metavar="NAME")
    add_options(save, *CAMERA)
    save.add_argument("--focal-length", type=number_above_zero, metavar="MM", dest="focal_length_mm")
    save.add_argument(
        "--pixel-size", type=number_above_zero, metavar="UM", dest="pixel_size_um", help="micrometres, before binning"
    )
    save.add_argument(
        "--camera-profile", metavar="NAME", help="camera calibration saved by live (default: the profile's name)"
    )
    add_options(save, *MOUNT)
    save.add_argument(
        "--meridian", choices=MERIDIAN, help="a German mount stays on its side or flips, a fork crosses the meridian"
    )
    for edge, text in EDGES.items():
        save.add_argument(f"--{edge}", type=number, metavar="DEG", dest=f"{edge.replace('-', '_')}_deg", help=text)
    save.add_argument("--hour-angles", metavar="EAST,WEST", help="limits, degrees, west of the meridian positive")
    save.add_argument("--horizon", metavar="FILE", help="lines of azimuth and altitude, degrees: trees and houses")
    for action, run in ((listing, _list), (show, _show), (save, _save), (remove, _remove)):
        add_options(action, "--json")
        action.set_defaults(run=run)


def use_profile(args: argparse.Namespace) -> None:
    """Fill in from ``--profile`` what the other options leave open.

    Raises KochabError when there is no such profile, or its file is damaged.
    """
    from kochab.gear.profiles import load_profile

    profile = load_profile(args.profile)
    if profile is not None:
        _fill_in(vars(args), profile)
    elif args.command != "live":  # which has always learned under any name
        raise UsageError(_unknown(args.profile))


def _fill_in(args: dict[str, Any], profile: "EquipmentProfile") -> None:
    # Frames named on the command line leave no room for the profile's camera: both together are refused.
    elsewhere = args.get("folder") is not None or isinstance(args.get("frames"), list)
    camera = {} if elsewhere else {"source": profile.source, "address": profile.address}
    if args.get("source") not in (None, profile.source):
        camera = {}
    fields = {
        **camera,
        "exposure": profile.exposure_s,
        "gain": profile.gain,
        "binning": profile.binning,
        "port": profile.port,
        "driver": profile.driver,
        "baud": profile.baud,
        "epoch": profile.epoch and {Epoch.J2000: "J2000", Epoch.DATE: "date"}[profile.epoch],
        "site": profile.site,
        "limits": profile.limits,
    }
    if args.get("fov") is None:
        # --fov takes precedence over --scale, so a profile's scale must not stand beside it.
        fields["scale"] = profile.scale_arcsec_px
    for name, value in fields.items():
        if name in args and args[name] in (None, ""):
            args[name] = value if value != "" else args[name]
    args["equipment"], args["profile"] = profile.name, profile.optics  # the latter names the camera's calibration


def _unknown(name: str) -> str:
    from kochab.gear.profiles import saved_profiles

    names = ", ".join(profile.name for profile in saved_profiles()[0])
    return f"There is no profile “{name}”; " + (f"there are: {names}." if names else "none is saved yet.")


def _list(args: argparse.Namespace) -> int:
    from kochab.gear.profiles import saved_profiles

    found, damaged = saved_profiles()
    for profile in found:
        tell(profile.as_json(), _line(profile), args.json)
    if not found and not damaged and not args.json:
        print("No profiles yet: kochab profile save NAME makes one.")
    for sentence in damaged:
        tell({"error": sentence}, sentence, args.json)
    return 1 if damaged else 0


def _line(profile: "EquipmentProfile") -> str:
    scale = profile.scale_arcsec_px
    parts = (
        profile.name,
        f"{profile.source} {profile.address}".strip(),
        f"{scale:.3g} arcsec/px" if scale else "",
        f"{profile.driver} {profile.port}".strip(),
    )
    return "  ".join(part for part in parts if part)


def _show(args: argparse.Namespace) -> int:
    from kochab.gear.profiles import load_profile

    profile = load_profile(args.name)
    if profile is None:
        return _missing(args)
    fields = profile.as_json()
    lines = []
    for name, value in fields.items():
        if value not in (None, ""):
            words = ", ".join(f"{part:g}" for part in value) if isinstance(value, list) else value
            words = f"{len(value)} points" if name == "horizon_deg" else words
            lines.append(f"{name.replace('_', ' '):21} {words}")
    tell(fields, "\n".join(lines), args.json)
    return 0


def _missing(args: argparse.Namespace) -> int:
    tell_failure(KochabError(_unknown(args.name)), args.json)
    return 1


def _save(args: argparse.Namespace) -> int:
    from dataclasses import fields, replace

    from kochab.gear.cameras import SOURCES
    from kochab.gear.mounts import DRIVERS
    from kochab.gear.profiles import (
        EquipmentProfile,
        hour_angles,
        load_profile,
        meridian_named,
        read_horizon,
        save_profile,
    )
    from kochab.gear.session import EPOCH_NAMES

    given = {**vars(args), "exposure_s": args.exposure}
    if args.source:
        SOURCES.check(args.source)
    if args.driver:
        DRIVERS.check(args.driver)
    given["hour_angle_deg"] = args.hour_angles and hour_angles(args.hour_angles.split(","))
    given["horizon_deg"] = args.horizon and read_horizon(args.horizon)
    given["epoch"] = args.epoch and EPOCH_NAMES[args.epoch]
    given["meridian"] = args.meridian and meridian_named(args.meridian)
    profile = load_profile(args.name) or EquipmentProfile(args.name)
    names = {field.name for field in fields(EquipmentProfile)} - {"name"}
    profile = replace(profile, **{k: v for k, v in given.items() if k in names and v not in (None, "")})
    path = save_profile(profile)
    tell(profile.as_json(), f"Saved: {path}", args.json)
    return 0


def _remove(args: argparse.Namespace) -> int:
    from kochab.gear.profiles import remove_profile

    if not remove_profile(args.name):
        return _missing(args)
    tell({"removed": args.name}, f"Removed: {args.name}", args.json)
    return 0
