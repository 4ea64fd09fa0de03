"""The few ways Kochab says that something outside it is wrong."""

import re
from pathlib import Path

from kochab.text.translation import tr, tr_noop

# Controls, line ends, turns of the writing's direction, and bytes of a name that are no letters.
_UNSEEN = re.compile("[\x00-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def printable(text: str) -> str:
    """``text`` with escapes for what is not seen: no file's name steers a terminal or feigns a line of its own."""
    return _UNSEEN.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


class KochabError(Exception):
    """Anything a person can act on; its text is one clear sentence, shown in their language.

    Translators read ``text`` as it stands in the call; ``values`` come into its places, as in
    :func:`kochab.text.translation.tr`.
    """

    def __init__(self, text: str = "", /, **values: object) -> None:
        super().__init__(tr(text, **values))

    def __str__(self) -> str:
        return printable(super().__str__())


class FrameError(KochabError):
    """A file that cannot be read as a picture of the sky."""


class CatalogueError(KochabError):
    """A star catalogue that is missing, damaged or cannot be built."""


class DamagedPatternsError(CatalogueError):
    """A pattern volume holds what nobody wrote there; ``folder`` is where it lies."""

    def __init__(self, folder: Path) -> None:
        super().__init__(
            tr_noop("The patterns in {folder} are missing or damaged and cannot be used: install Kochab again."),
            folder=folder,
        )
        self.folder = folder


class UsageError(KochabError):
    """Arguments or a star list that cannot be used."""


class DeviceError(KochabError):
    """Hardware that is absent, silent or refuses."""


class PortError(DeviceError):
    """The port cannot be opened: absent, in use, or not permitted."""


class NoAnswerError(DeviceError):
    """The device is silent, or its answer came too late or makes no sense."""


class RefusedError(DeviceError):
    """The device understood and said no, or our own guard did."""


class NotSentError(RefusedError):
    """A driver would not send it: by this order nothing moves."""


class StoppedError(RefusedError):
    """A person said Stop: what was under way is not gone on with."""


class StrayedError(StoppedError):
    """The mount went where it was not sent, and the guard stopped it."""


class NotStoppedError(DeviceError):
    """Stop was sent, and the device was not seen to stand still."""


class LineLostError(DeviceError):
    """The line broke while in use: a cable pulled, a server gone."""
