"""What a person wants aligned, and with what; plain values that are remembered between starts."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from app.core.hint import Site
from app.polar.poles import Pole
from app.ui.mount.eye import CameraWish
from app.ui.mount.wishes import MountWish


class Source(StrEnum):
    """Where the frames come from; the texts are on the screen."""

    PRACTICE = "Practice telescope (simulated)"
    CAMERA = "Camera"
    FILES = "Files"


class Hand(StrEnum):
    """Who turns the RA axis between the frames."""

    PERSON = "I turn it by hand"
    MOUNT = "The mount turns it, within its guard"


@dataclass(frozen=True, slots=True)
class AlignWish:
    """Everything an alignment needs to begin.

    ``check`` are files of a second sweep, at another declination: it shows flexure. ``site`` None
    takes it from the frames. ``turn_deg`` None plans the turn. ``mount`` is asked only when
    ``hand`` is the mount and the frames come from a camera. With ``second_sweep`` nothing is called
    good before a sweep at another declination.
    """

    source: Source
    pole: Pole = Pole.REFRACTED
    site: Site | None = None
    files: tuple[Path, ...] = ()
    check: tuple[Path, ...] = ()
    camera: CameraWish | None = None
    hand: Hand = Hand.PERSON
    mount: MountWish | None = None
    goal_arcsec: float = 30.0
    turn_deg: float | None = None
    frames: int = 5
    fov_deg: float | None = None
    second_sweep: bool = False
