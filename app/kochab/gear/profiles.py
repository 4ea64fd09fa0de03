"""Equipment profiles: camera, optics, mount, site and limits under one name, kept from night to night.

What solved frames teach of a camera and its lens is kept apart, by
:mod:`kochab.solver.camera_profile`; :attr:`EquipmentProfile.optics` is its name there.
"""

import json
import logging
import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, astuple, fields, replace
from pathlib import Path
from typing import Any, Protocol

from kochab.core.attitude import ARCSEC
from kochab.core.errors import KochabError, UsageError
from kochab.core.frame import Hint, Site
from kochab.core.mount import Epoch
from kochab.core.values import frozen
from kochab.frames.atomic_file import write_atomically
from kochab.gear.mounts import DRIVERS
from kochab.gear.mounts.motion_plan import Horizon, Limits
from kochab.gear.quick_stop import profile_folder, profile_path
from kochab.gear.session import BAUDS, EXPOSURE_S, CameraSelection, Meridian, MountSelection, limits_at
from kochab.parsing.angles import parse_site, site_text
from kochab.parsing.text_input import parse_json, read_text
from kochab.text.translation import tr_noop

FORMAT = 1
BOUNDS: dict[str, tuple[float, float, str]] = {
    "exposure_s": (1e-6, 86400.0, tr_noop("The exposure must be between {low:g} and {high:g} s.")),
    "gain": (-1e6, 1e6, tr_noop("The gain must be between {low:g} and {high:g}.")),
    "binning": (1, 256, tr_noop("The binning must be between {low:g} and {high:g} pixels a side.")),
    "focal_length_mm": (0.1, 1e6, tr_noop("The focal length must be between {low:g} and {high:g} mm.")),
    "pixel_size_um": (0.1, 1000.0, tr_noop("The pixel size must be between {low:g} and {high:g} µm.")),
    "baud": (*BAUDS, tr_noop("The baud rate must be between {low:g} and {high:g}.")),
    "lowest_altitude_deg": (-5.0, 89.0, tr_noop("The lowest altitude must be between {low:g}° and {high:g}°.")),
    "highest_altitude_deg": (1.0, 90.0, tr_noop("The highest altitude must be between {low:g}° and {high:g}°.")),
    "past_meridian_deg": (0.0, 90.0, tr_noop("The meridian limit must be between {low:g}° and {high:g}° past it.")),
}
"""The least and the most of each number, and what to say of one beyond."""
LIMITS = ("lowest_altitude_deg", "highest_altitude_deg", "past_meridian_deg", "hour_angle_deg", "horizon_deg")


@frozen
class EquipmentProfile:
    """One telescope as it is set up; what is empty or None is left to the default or to be found.

    ``source`` is a name of :data:`kochab.gear.cameras.SOURCES`, ``driver`` one of
    :data:`kochab.gear.mounts.DRIVERS`. ``pixel_size_um`` is of one pixel before binning.

    Raises `UsageError` when a value is out of its :data:`BOUNDS`.
    """

    name: str
    source: str = ""
    address: str = ""
    exposure_s: float | None = None
    gain: float | None = None
    binning: int | None = None
    focal_length_mm: float | None = None
    pixel_size_um: float | None = None
    camera_profile: str = ""
    port: str = ""
    driver: str = ""
    baud: int | None = None
    epoch: Epoch | None = None
    site: Site | None = None
    meridian: Meridian | None = None
    lowest_altitude_deg: float | None = None
    highest_altitude_deg: float | None = None
    past_meridian_deg: float | None = None
    hour_angle_deg: tuple[float, float] | None = None
    horizon_deg: Horizon | None = None

    def __post_init__(self) -> None:
        for name, (low, high, refusal) in BOUNDS.items():
            # NaN fails the comparison below, too.
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise UsageError(refusal, low=low, high=high)

    @property
    def optics(self) -> str:
        """The name under which solved frames teach of this camera and lens."""
        return self.camera_profile or self.name

    @property
    def scale_arcsec_px(self) -> float | None:
        """The pixel scale, binning counted; None without focal length and pixel size."""
        if self.focal_length_mm is None or self.pixel_size_um is None:
            return None
        return 1e-3 * self.pixel_size_um * (self.binning or 1) / self.focal_length_mm / ARCSEC

    def hint_of(self, source: str, address: str) -> Hint | None:
        """The pixel scale, good to a tenth, for frames of this camera; None for another, or when it is not known."""
        scale = self.scale_arcsec_px
        if scale is None or (source, address) != self.camera.camera:
            return None
        return Hint(scale_arcsec_px=(scale / 1.1, scale * 1.1), source="profile")

    @property
    def mount(self) -> MountSelection:
        """The mount to open."""
        driver = self.driver if self.driver in DRIVERS else "lx200"
        return MountSelection(self.port, driver, self.baud, self.epoch)

    @property
    def camera(self) -> CameraSelection:
        """The camera to open; its source is empty when there is none."""
        return CameraSelection(self.source, self.address, self.exposure_s or EXPOSURE_S)

    @property
    def limits(self) -> Limits:
        """What the guard of its mount goes by; a mount is a German one until somebody says otherwise."""
        own = {name: getattr(self, name) for name in LIMITS if getattr(self, name) is not None}
        return replace(limits_at(self.meridian or Meridian.STAYS), **own)

    def as_json(self) -> dict[str, Any]:
        """The stable JSON form, which :func:`from_json` reads."""
        return {
            **asdict(self),
            "epoch": self.epoch and str(self.epoch),
            "site": self.site and list(astuple(self.site)),
            "meridian": self.meridian and self.meridian.name.lower(),
        }


def from_json(fields_json: dict[str, Any]) -> EquipmentProfile:
    """The profile of :meth:`EquipmentProfile.as_json`; when damaged UsageError, Value-, Type- or ArithmeticError."""
    values = {f.name: fields_json[f.name] for f in fields(EquipmentProfile) if fields_json.get(f.name) is not None}
    return EquipmentProfile(**{name: READERS[name](value) for name, value in values.items()})


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(value)
    return value


def hour_angles(pair: Any) -> tuple[float, float]:
    """The hour angles allowed, degrees west positive; UsageError when they are none."""
    try:
        east, west = (float(angle) for angle in pair)
    except ValueError:
        east = west = math.nan
    if not -180.0 <= east < west <= 180.0:
        raise UsageError("Hour angles are two from -180 to 180 degrees, the eastern one first.")
    return east, west


def horizon(points: Any) -> Horizon:
    """Pairs of azimuth and altitude, degrees, or their JSON, by azimuth; UsageError when they are no horizon."""
    pairs = parse_json(points) if isinstance(points, str) else points
    found = sorted((float(azimuth) % 360.0, float(altitude)) for azimuth, altitude in pairs)
    if not found or not all(azimuth < math.inf and -90.0 <= altitude <= 90.0 for azimuth, altitude in found):
        raise UsageError("A horizon needs lines of azimuth (from north over east) and altitude, in degrees.")
    return tuple(found)


def read_horizon(path: str) -> Horizon:
    """A horizon from a text file: two numbers a line, ``#`` begins a comment."""
    try:
        lines = [line.partition("#")[0].replace(",", " ").split() for line in read_text(path).splitlines()]
        return horizon(line[:2] for line in lines if line)
    except ValueError as error:
        raise UsageError(
            "{path} is not a horizon: it needs lines of azimuth and altitude, in degrees.", path=path
        ) from error


def _site(value: Any) -> Site:
    return parse_site(value if isinstance(value, str) else ", ".join(str(float(part)) for part in value))


READERS: dict[str, Callable[[Any], Any]] = {
    **{field.name: _text for field in fields(EquipmentProfile)},
    **dict.fromkeys(BOUNDS, float),
    "binning": int,
    "baud": int,
    "epoch": Epoch,
    "site": _site,
    "hour_angle_deg": hour_angles,
    "horizon_deg": horizon,
    "meridian": lambda name: meridian_named(name),
}


def meridian_named(name: str) -> Meridian:
    """``stays``, ``flips`` or ``crosses``; ValueError for anything else."""
    for meridian in Meridian:
        if meridian.name.lower() == name:
            return meridian
    raise ValueError(name)


# -- On disk: one file a profile, written whole or not at all ----------------------------------


def save_profile(profile: EquipmentProfile) -> Path:
    """Write a profile; KochabError when it cannot be written."""
    path = profile_path(profile.name)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, json.dumps({"format": FORMAT, **profile.as_json()}, indent=1))
    except OSError as error:
        raise KochabError("{path} cannot be written: {strerror}.", path=path, strerror=error.strerror) from error
    return path


def load_profile(name: str) -> EquipmentProfile | None:
    """The profile of that name, None when there is none; KochabError when its file is damaged."""
    path = profile_path(name)
    return _read(path) if path.exists() else None


def remove_profile(name: str) -> bool:
    """Forget a profile; whether there was one. KochabError when its file cannot be deleted."""
    path = profile_path(name)
    try:
        path.unlink()
    except FileNotFoundError:
        return False
    except OSError as error:
        raise KochabError("{path} cannot be deleted: {strerror}.", path=path, strerror=error.strerror) from error
    return True


def saved_profiles() -> tuple[list[EquipmentProfile], list[str]]:
    """All profiles by name, and a sentence for every damaged file."""
    found, damaged = [], []
    for path in sorted(profile_folder().glob("*.json")):
        try:
            found.append(_read(path))
        except KochabError as error:
            damaged.append(str(error))
    return sorted(found, key=lambda profile: profile.name.lower()), damaged


def _read(path: Path) -> EquipmentProfile:
    text = read_text(path)
    try:
        return from_json(parse_json(text))
    except (ValueError, TypeError, AttributeError, ArithmeticError, UsageError) as error:
        raise KochabError("{path} is damaged: delete it, or save this profile again.", path=path) from error


# -- What the window uses: the profile that was chosen, or the values of last time -------------

CHOSEN = "equipment"
KEYS = {
    "source": "mount/camera",
    "address": "mount/camera_address",
    "exposure_s": "mount/exposure",
    "port": "mount/port",
    "driver": "mount/driver",
    "baud": "mount/baud",
    "epoch": "mount/epoch",
    "meridian": "mount/meridian",
    "site": "site",
    "lowest_altitude_deg": "mount/lowest_altitude",
    "past_meridian_deg": "mount/past_meridian",
    "horizon_deg": "mount/horizon",
}


class Remembered(Protocol):
    """Named values that outlast the program."""

    def text(self, name: str, default: str) -> str:
        """A word."""

    def keep(self, name: str, value: Any) -> None:
        """Remember a value."""


def current_profile(settings: Remembered) -> EquipmentProfile:
    """The profile chosen in the window; without one, or when it is damaged, what was used last."""
    chosen = settings.text(CHOSEN, "")
    try:
        profile = load_profile(chosen) if chosen else None
    except KochabError:
        profile = None
    if profile is not None:
        return profile
    profile = EquipmentProfile("")
    for name, key in KEYS.items():
        text = settings.text(key, "")
        with suppress(ValueError, UsageError):  # one damaged value costs no other
            profile = replace(profile, **({name: READERS[name](text)} if text else {}))
    return profile


def choose_profile(settings: Remembered, name: str) -> None:
    """Use this profile from now on; a new name begins with what is used now, "" with no profile.

    Raises `KochabError` when its file is damaged, or a new one cannot be written.
    """
    if name and load_profile(name) is None:
        save_profile(replace(current_profile(settings), name=name))
    settings.keep(CHOSEN, name)


def keep_profile(settings: Remembered, **changes: Any) -> None:
    """Remember what is used now, in the chosen profile too where that can be written."""
    profile = replace(current_profile(settings), **changes)
    values = profile.as_json() | {"site": profile.site and site_text(profile.site)}
    values["horizon_deg"] = profile.horizon_deg and json.dumps(profile.horizon_deg)
    for name, key in KEYS.items():
        settings.keep(key, "" if values[name] is None else str(values[name]))
    if profile.name:
        try:
            save_profile(profile)
        except KochabError as error:  # no reason not to connect a mount
            logging.getLogger(__name__).warning("%s", error)


def save_selection(settings: Remembered, selection: MountSelection | CameraSelection) -> None:
    """Remember what was chosen, but for a person's word of this moment."""
    keep_profile(settings, **{name: value for name, value in asdict(selection).items() if name in KEYS})
