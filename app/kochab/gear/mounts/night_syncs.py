"""By how much syncs by hand have shifted a mount this night, all together and across programs."""

import json
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from math import isfinite
from pathlib import Path

from kochab.core.attitude import Degrees, wrapped
from kochab.gear.mounts.kept_by_line import kept_file
from kochab.parsing.text_input import read_json

OVER_S = 12 * 3600.0  # after its last sync by hand a night is over


class NightSyncs:
    """The shift of right ascension and declination, degrees, that is on a person's word alone.

    Each sync is measured against the mount's position, which the one before has moved: small ones add up to any
    angle. ``file`` keeps the sum for other programs that sync the same mount; without one it is kept in memory.
    """

    def __init__(self, clock: Callable[[], datetime], file: Path | None = None) -> None:
        self._clock, self._file = clock, file
        self._sum: tuple[Degrees, float] = ((0.0, 0.0), 0.0)

    @classmethod
    def of_line(cls, clock: Callable[[], datetime], folder: Path, line: str) -> "NightSyncs":
        """Of the mount at a port or an address, kept in ``folder``."""
        return cls(clock, kept_file(folder, line, "syncs"))

    @property
    def shift_deg(self) -> Degrees:
        """The sum of this night."""
        shift, at_unix = self._read()
        return shift if abs(self._clock().timestamp() - at_unix) < OVER_S else (0.0, 0.0)

    def add(self, ra_deg: float, dec_deg: float) -> None:
        """A sync by hand has shifted the mount by so much."""
        ra, dec = self.shift_deg
        self.keep((wrapped(ra + ra_deg), dec + dec_deg))

    def settle(self) -> None:
        """Solved frames show where it points, or a person has armed the sync: the sum begins anew."""
        if self.shift_deg != (0.0, 0.0):
            self.keep((0.0, 0.0))

    def keep(self, shift_deg: Degrees) -> None:
        """Save the sum; where that cannot be, it holds for this program."""
        from kochab.frames.atomic_file import write_atomically  # only a sync needs it

        self._sum = shift_deg, self._clock().timestamp()
        if self._file is None:
            return
        fields = {"ra_deg": shift_deg[0], "dec_deg": shift_deg[1], "unix_s": self._sum[1]}
        with suppress(OSError):
            self._file.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(self._file, json.dumps(fields))

    def _read(self) -> tuple[Degrees, float]:
        if self._file is None:
            return self._sum
        with suppress(ValueError, TypeError, KeyError):
            fields = read_json(self._file)
            ra, dec, at = (float(fields[name]) for name in ("ra_deg", "dec_deg", "unix_s"))
            if all(map(isfinite, (ra, dec, at))):
                return (ra, dec), at
        return self._sum
