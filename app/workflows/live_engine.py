"""A tracker that knows its camera: the profile is recalled before a stream and kept after it."""

from dataclasses import replace
from datetime import datetime
from pathlib import Path

from app.core.frame import Frame
from app.core.progress import Task
from app.solve.profiles import Profile
from app.solve.profiles_kept import keep, recalled
from app.solve.track import Tracker, TrackOptions, TrackUpdate


class ProfiledTracker:
    """Tracks with the profile of one camera and lens, which ``name`` stands for.

    Which profile that is depends on the frames' size too, so it is recalled with the first frame.
    """

    def __init__(
        self, name: str, options: TrackOptions | None = None, folder: Path | None = None
    ) -> None:
        self.name = name
        self._options = options or TrackOptions()
        self._folder = folder
        self._tracker: Tracker | None = None
        self._size = (0, 0)

    @property
    def profile(self) -> Profile | None:
        """What is known of the camera by now; None before the first frame of a new one."""
        known = None if self._tracker is None else self._tracker.profile
        return None if known is None else replace(known, name=self.name)

    def update(self, frame: Frame, time_utc: datetime | None = None) -> Task[TrackUpdate]:
        """Take one frame in.

        Raises
        ------
        app.core.errors.KochabError
            The kept profile cannot be read, or the one before this size of frame not be kept.

        """
        size = (frame.width, frame.height)
        if self._tracker is None or size != self._size:
            self.keep()
            known = recalled(self.name, *size, self._folder)
            self._tracker, self._size = Tracker(options=self._options, profile=known), size
        return (yield from self._tracker.update(frame, time_utc))

    def keep(self) -> Path | None:
        """Write what was learned; None when nothing was.

        Raises
        ------
        app.core.errors.KochabError
            It cannot be written.

        """
        profile = self.profile
        if profile is None or not profile.frames:
            return None
        return keep(profile, self._folder)
