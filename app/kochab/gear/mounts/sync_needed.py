"""Why a mount must not slew before a sync, kept for the next program that drives it."""

import json
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from pathlib import Path

from kochab.gear.mounts.kept_by_line import kept_file
from kochab.parsing.text_input import read_json

OVER_S = 12 * 3600.0  # by then the mount has been put away, or somebody has aligned it


class SyncNeeded:
    """The sentence of a mount that was restarted, or got another clock or site; empty when nothing forbids a slew.

    One command of the command line may see a restart, and only the next one slews: a clock with a battery and the right
    site would then hide it.
    """

    def __init__(self, clock: Callable[[], datetime], file: Path) -> None:
        self._clock, self._file = clock, file

    @classmethod
    def of_line(cls, clock: Callable[[], datetime], folder: Path, line: str) -> "SyncNeeded":
        """Of the mount at a port or an address, kept in ``folder``."""
        return cls(clock, kept_file(folder, line, "needs-sync"))

    def read(self) -> str:
        """What was kept; empty when that is half a day ago or cannot be read."""
        with suppress(ValueError, TypeError, KeyError):
            fields = read_json(self._file)
            sentence, at = str(fields["sentence"]), float(fields["unix_s"])
            if abs(self._clock().timestamp() - at) < OVER_S:
                return sentence
        return ""

    def keep(self, sentence: str) -> None:
        """Save it, or forget what was kept where it is empty; where that cannot be, it holds for this program."""
        from kochab.frames.atomic_file import write_atomically  # only a doubt needs it

        with suppress(OSError):
            if not sentence:
                self._file.unlink(missing_ok=True)
                return
            self._file.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(self._file, json.dumps({"sentence": sentence, "unix_s": self._clock().timestamp()}))
