"""One running camera: its frames solved, shown and recorded in a thread of their own."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from time import monotonic

from kochab.core.capture import CameraSource
from kochab.core.errors import KochabError, UsageError
from kochab.core.frame import Frame, Hint
from kochab.core.progress import Progress, Task
from kochab.core.values import frozen
from kochab.solver import SolveOptions
from kochab.solver.camera_profile import Profile
from kochab.text.translation import tr
from kochab.workflows.live.capture import Capture
from kochab.workflows.live.session import Recorder, options_json, session_folder
from kochab.workflows.live.solve import WARNING, ProfiledTracker, live_solve
from kochab.workflows.live.update import LiveUpdate
from kochab.workflows.session.wiring import ToRecord

# Switches recording on and off while a stream runs; everything happens in the stream's thread.


class Recording:
    """Follows :attr:`folder`, the folder to make a session in, or None: so it is, too, once a session ended by itself.

    ``recorder`` is that of the last session, None before the first and after one that could not begin.
    """

    def __init__(self, to_record: ToRecord | None, facts: Mapping[str, object]) -> None:
        self.folder: Path | None = None
        self.recorder: Recorder | None = None
        self._to_record, self._about = to_record, facts
        self._followed: Path | None = None

    def take(self, update: LiveUpdate) -> list[str]:
        """Record one frame if that is asked for; sentences for the person."""
        messages = self._follow()
        sentence = None if self.recorder is None else self.recorder.record(update)
        if sentence is not None:
            self._followed = self.folder = None
            messages.append(sentence)
        return messages

    def close(self) -> list[str]:
        """End the session, if there is one; what is to be said of it."""
        self._followed = self.folder = None
        return self._end()

    def _follow(self) -> list[str]:
        folder = self.folder
        if folder == self._followed:
            return []
        self._followed, messages = folder, self._end()
        if folder is not None and self._to_record is not None:
            try:
                self.recorder = Recorder(session_folder(folder), self._to_record, self._about)
            except UsageError as error:
                self.recorder = self._followed = self.folder = None  # or the next frame would try again
                messages.append(str(error))
        return messages

    def _end(self) -> list[str]:
        recorder = self.recorder
        if recorder is None or not recorder.recording:
            return []
        recorder.close()
        return [tr("{frames} frames were recorded into {folder}.", frames=recorder.frames, folder=recorder.folder)]


SOLVE_TIMEOUT_S = 10.0
AHEAD_S = 0.5  # a frame whose answer takes longer is shown before it has one
MOST_MESSAGES = 50

Show = Callable[[Frame, LiveUpdate | None], None]


@frozen
class StreamRequest:
    """What to open, and how.

    ``open`` is called in the camera's thread. What is learned of the optics is kept under
    ``profile``, and nothing is kept without a name. With ``again`` a lost camera is waited for.
    ``hint`` is what is known of its frames.
    """

    open: Callable[[], CameraSource]
    name: str
    profile: str = ""
    again: bool = False
    hint: Hint | None = None


@frozen
class Lens:
    """What is known of the camera and its lens, and the sentence of a frame that contradicts it."""

    profile: Profile | None = None
    doubt: str = ""


class Stream:
    """Run :meth:`task` in a job; everything else may be read and set from any thread.

    ``show`` is given every frame to be shown: with its answer, or alone while the solver is slow.
    ``latest`` is the newest answer, ``messages`` sentences for the person that nobody has told yet, and
    ``seen_s`` when the newest frame came.
    """

    def __init__(
        self,
        request: StreamRequest,
        show: Show,
        to_record: ToRecord | None = None,
        make_engine: Callable[[], ProfiledTracker] | None = None,
    ) -> None:
        self.request = request
        self.capture = Capture(request.open, request.again, self._see)
        self.options = SolveOptions(timeout_s=SOLVE_TIMEOUT_S, hint=request.hint)
        self.latest: LiveUpdate | None = None
        self.lens = Lens()
        self.messages: deque[str] = deque(maxlen=MOST_MESSAGES)
        self.seen_s = float("-inf")
        self.recording = Recording(to_record, {"camera": request.name, "solve": options_json(self.options)})
        self._show = show
        self._make_engine = make_engine or self._engine
        self._used: ProfiledTracker | None = None
        self._held: tuple[Frame, float] | None = None  # waits for its answer, since when
        self._quick = False

    def task(self) -> Task[None]:
        """Everything, until it is cancelled or the camera ends it with a DeviceError."""
        yield Progress("load")
        self._used = engine = self._make_engine()
        live = live_solve(self.capture, engine)
        try:
            for step in live:
                if isinstance(step, LiveUpdate):
                    self._has(step, engine)
                    yield Progress("solved")
                else:
                    self._let_go()
                    if step.stage == WARNING:
                        self.messages.append(step.detail)
                    yield step
        finally:
            live.close()
            self.messages.extend(self.recording.close())
            try:
                if engine.keep() is not None:
                    self.messages.append(tr("The camera profile “{profile}” was kept.", profile=self.request.profile))
            except KochabError as error:
                self.messages.append(str(error))

    def name_lens(self, name: str) -> None:
        """Keep what is learned of the optics under a name after all; it is written at the end."""
        self.request = replace(self.request, profile=name)
        if self._used is not None:
            self._used.name = name

    def _see(self, frame: Frame) -> None:
        """A frame has come: shown at once unless its answer will be there in a moment."""
        self.seen_s = monotonic()
        if self._quick:
            held = self._held
            self._held = (frame, monotonic() if held is None else held[1])
        else:
            self._show(frame, None)

    def _let_go(self) -> None:
        """The answer takes longer than was thought."""
        held = self._held
        if held is not None and monotonic() - held[1] > AHEAD_S:
            self._held, self._quick = None, False
            self._show(held[0], None)

    def _has(self, update: LiveUpdate, engine: ProfiledTracker) -> None:
        self._held = None
        self._quick = update.mode == "tracking" and update.latency_ms < 1e3 * AHEAD_S
        self._show(update.shot.frame, update)
        self.latest = update
        self._learn(update, engine)
        self.messages.extend(w for w in update.warnings if w not in self.messages)
        self.messages.extend(self.recording.take(update))

    def _learn(self, update: LiveUpdate, engine: ProfiledTracker) -> None:
        """Remember a doubt until a later frame agrees with the profile."""
        profile, before = engine.profile, self.lens.profile
        learned = profile is None or before is None or profile.frames != before.frames
        self.lens = Lens(profile, update.track.doubt or ("" if learned else self.lens.doubt))

    def _engine(self) -> ProfiledTracker:
        return ProfiledTracker(self.request.profile, self.options)
