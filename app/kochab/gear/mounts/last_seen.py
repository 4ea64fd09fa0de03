"""Where a mount was last seen, kept for the next program: between two of them it may have been without power."""

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from datetime import UTC, datetime
from math import isfinite
from pathlib import Path

from kochab.core.attitude import Degrees, apart_deg
from kochab.core.values import frozen
from kochab.gear.mounts.kept_by_line import kept_file
from kochab.parsing.text_input import read_json

OVER_S = 12 * 3600.0  # by then the mount has been put away, or somebody has aligned it
MOVED_DEG, UNDER_WAY_DEG, AGED_S = 1.0, 10.0, 600.0  # it is written anew only then, and when a session ends


@frozen
class Place:
    """Right ascension and declination of date, degrees, and when it was there.

    ``at_rest``: it said that it was at home or parked. ``sent_there``: Kochab had sent it to rest, and it had come.
    ``hour_angle_deg`` is by its own clock and site, where it tells both and stood beside the pole. ``in_silence``: it
    answered no more, or its line broke.
    """

    ra_deg: float
    dec_deg: float
    unix_s: float
    at_rest: bool
    sent_there: bool = False
    hour_angle_deg: float | None = None
    in_silence: bool = False

    @property
    def deg(self) -> Degrees:
        """Both coordinates."""
        return self.ra_deg, self.dec_deg

    @property
    def at(self) -> datetime:
        """When."""
        return datetime.fromtimestamp(self.unix_s, UTC)


class LastSeen:
    """The last place of the mount at a line, in a ``file``."""

    def __init__(self, clock: Callable[[], datetime], file: Path) -> None:
        self._clock, self._file = clock, file
        self._written: Place | None = None

    @classmethod
    def of_line(cls, clock: Callable[[], datetime], folder: Path, line: str) -> "LastSeen":
        """Of the mount at a port or an address, kept in ``folder``."""
        return cls(clock, kept_file(folder, line, "last-seen"))

    def read(self) -> Place | None:
        """What another program has kept; None when that is half a day ago or cannot be read."""
        with suppress(ValueError, TypeError, KeyError):
            place = Place(**read_json(self._file))
            numbers = (*place.deg, place.unix_s, place.hour_angle_deg or 0.0)
            if all(map(isfinite, numbers)) and abs(self._now_s - place.unix_s) < OVER_S:
                return place
        return None

    def keep(self, place: Place, last: bool = False, under_way: bool = False) -> None:
        """Save it when it tells something new, or is the ``last`` of a session; a full disk takes nothing."""
        moved_deg = UNDER_WAY_DEG if under_way else MOVED_DEG
        before = self._written
        aged = before is None or place.unix_s - before.unix_s > AGED_S or place.at_rest != before.at_rest
        if not (last or aged or (before is not None and apart_deg(place.deg, before.deg) > moved_deg)):
            return
        from kochab.frames.atomic_file import write_atomically  # not needed to stop a mount

        self._written = place
        with suppress(OSError):
            self._file.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(self._file, json.dumps(asdict(place)))

    @property
    def _now_s(self) -> float:
        return self._clock().timestamp()
