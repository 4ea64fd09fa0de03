"""What a mount does at the meridian, which only its owner knows; remembered between starts."""

from enum import StrEnum

from app.mounts.limits import Limits
from app.ui.settings import Settings

NAME = "mount/meridian"


class Meridian(StrEnum):
    """The texts are on the screen."""

    STAYS = "German mount: never flip it"
    FLIPS = "German mount: a goto may flip it"
    CROSSES = "Fork or wedge: goes on without a flip"


def limits_at(meridian: Meridian) -> Limits:
    """The guard's numbers for such a mount."""
    return Limits(
        allow_flip=meridian is Meridian.FLIPS, crosses_meridian=meridian is Meridian.CROSSES
    )


def kept_meridian(settings: Settings) -> Meridian:
    """The one of last time; a mount is held for a German one until somebody says otherwise."""
    names = {meridian.name.lower(): meridian for meridian in Meridian}
    return names.get(settings.text(NAME, ""), Meridian.STAYS)


def keep_meridian(settings: Settings, meridian: Meridian) -> None:
    """Remember it."""
    settings.keep(NAME, meridian.name.lower())
