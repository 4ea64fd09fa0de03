"""What looks at the sky for the mount: its camera, the frames it gives, and what they taught."""

from collections.abc import Callable

from app.core.errors import RefusedError
from app.core.solution import Solution
from app.mounts.guard import Guard
from app.solve.disagreement import Sighting
from app.ui.cameras import Cameras
from app.ui.mount.eye import CameraWish, Eye, looking
from app.ui.mount.words import Seen, Shown, Word
from app.ui.session import Session
from app.workflows.fresh_frame import SolveNow

MOST_SIGHTINGS = 6


class Lookout:
    """``tell`` hears what is seen; it is called in the thread of the mount's line."""

    def __init__(self, session: Session, cameras: Cameras) -> None:
        self.eye: Eye | None = None
        self.sightings: tuple[Sighting, ...] = ()
        self._session, self._cameras = session, cameras
        self._frames = 0

    @property
    def solution(self) -> Solution | None:
        """Of the open frame."""
        result = self._session.known.result
        return result if isinstance(result, Solution) else None

    def use(self, wish: CameraWish | None) -> Eye | None:
        """Look through this camera from now on; the one before, for its thread to close.

        Another exposure of the same camera was meant: it holds for whoever else uses it, too.
        """
        before = self.eye
        if wish is None:
            self.eye = None
            return before
        same = before is not None and before.wish.camera == wish.camera
        self.eye = Eye(wish, self._cameras.open, insists=same)
        return before

    def close(self) -> None:
        """Let the camera go until it is asked again; in the thread of the line."""
        if self.eye is not None:
            self.eye.close()

    def look(self, guard: Guard, tell: Callable[[Word], None]) -> SolveNow:
        """A solver for the thread of the line."""
        if self.eye is None:
            raise RefusedError("No camera is chosen.")
        return looking(self.eye, guard, tell)

    def hear(self, word: Word) -> None:
        """Show what the camera saw."""
        if isinstance(word, Shown):
            if self._session.streams:
                return  # the Live view shows what its camera sees, this frame too
            self._frames += 1
            self._session.show(word.frame, f"Camera frame {self._frames}")
        elif isinstance(word, Seen):
            self._session.answer(word.solved)

    def learn(self, sightings: tuple[Sighting, ...]) -> None:
        """What disagreements were seen, for the next question."""
        self.sightings = sightings[-MOST_SIGHTINGS:]

    def forget(self) -> None:
        """After a sync they say nothing."""
        self.sightings = ()
