"""The few ways Kochab says that something outside it is wrong."""


class KochabError(Exception):
    """Anything a person can act on; its text is one clear sentence, shown as it stands."""


class FrameError(KochabError):
    """A file that cannot be read as a picture of the sky."""


class CatalogueError(KochabError):
    """A star catalogue that is missing, damaged or cannot be built."""


class UsageError(KochabError):
    """Arguments or a star list that cannot be used."""


class DeviceError(KochabError):
    """Hardware that is absent, silent or refuses."""
