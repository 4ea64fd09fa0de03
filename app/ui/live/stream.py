"""One camera under way: solved, shown and recorded, in a thread that is not the window's."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic

from app.core.capture import CameraSource
from app.core.errors import KochabError
from app.core.frame import Frame
from app.core.progress import Progress, Task
from app.core.solution import Solution
from app.solve.options import SolveOptions
from app.solve.profiles import Profile
from app.ui.live.recording import Recording
from app.ui.live.tap import Tapped
from app.ui.wiring import ToRecord
from app.workflows.live_capture import Capture
from app.workflows.live_session import options_json
from app.workflows.live_solve import WARNING, Engine, live_solve
from app.workflows.live_update import LiveSummary, LiveUpdate

SOLVE_TIMEOUT_S = 10.0
AHEAD_S = 0.5  # a frame whose answer takes longer is shown before it has one
MOST_SAID = 50
DOUBT = "Your camera profile is off"

Show = Callable[[Frame, LiveUpdate | None], None]


@dataclass(frozen=True, slots=True)
class StreamWish:
    """What to open, and how.

    ``open`` is called in the camera's thread. What is learned of the optics is kept under
    ``profile``, and nothing is kept without a name. With ``again`` a lost camera is waited for.
    """

    open: Callable[[], CameraSource]
    name: str
    profile: str = ""
    again: bool = False


@dataclass(frozen=True, slots=True)
class Lens:
    """What is known of the camera and its lens, and the sentence of a frame that contradicts it."""

    profile: Profile | None = None
    doubt: str = ""


class Stream:
    """Run :meth:`task` in a job; everything else may be read and set from any thread.

    ``show`` is given every frame to be shown: with its answer, or alone while the solver is slow.
    ``latest`` is the newest answer, ``said`` sentences for the person that nobody has told yet, and
    ``seen_s`` when the newest frame came.
    """

    def __init__(
        self, wish: StreamWish, show: Show, to_record: ToRecord | None = None,
        make_engine: Callable[[], Engine] | None = None,
    ) -> None:  # fmt: skip
        self.wish = wish
        self.capture = Capture(self._opened, wish.again)
        self.options = SolveOptions(timeout_s=SOLVE_TIMEOUT_S)
        self.latest: LiveUpdate | None = None
        self.lens = Lens()
        self.said: deque[str] = deque(maxlen=MOST_SAID)
        self.seen_s = float("-inf")
        about = {"camera": wish.name, "solve": options_json(self.options)}
        self.recording = Recording(to_record, about)
        self._show = show
        self._make_engine = make_engine or self._engine
        self._held: tuple[Frame, float] | None = None  # waits for its answer, since when
        self._quick = False

    def task(self) -> Task[LiveSummary]:
        """Everything, until it is cancelled or the camera ends it with a DeviceError."""
        yield Progress("load")
        engine = self._make_engine()
        live = live_solve(self.capture, engine)
        try:
            while True:
                try:
                    step = next(live)
                except StopIteration as end:
                    return end.value  # type: ignore[no-any-return]
                if isinstance(step, LiveUpdate):
                    self._has(step, engine)
                    yield Progress("solved")
                else:
                    self._let_go()
                    if step.stage == WARNING:
                        self.said.append(step.detail)
                    yield step
        finally:
            live.close()
            self.said.extend(self.recording.close())
            self._keep(engine)

    def _opened(self) -> CameraSource:
        return Tapped(self.wish.open(), self._see)

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

    def _has(self, update: LiveUpdate, engine: Engine) -> None:
        if isinstance(update.result, Solution):
            update.result.attitude.quaternion  # noqa: B018  (its library loads slowly)
        self._held = None
        self._quick = update.mode == "tracking" and update.latency_ms < 1e3 * AHEAD_S
        self._show(update.shot.frame, update)
        self.latest = update
        self._learn(update, engine)
        self.said.extend(w for w in update.warnings if w not in self.said)
        self.said.extend(self.recording.take(update))

    def _learn(self, update: LiveUpdate, engine: Engine) -> None:
        """Remember a doubt until a later frame agrees with the profile."""
        profile: Profile | None = getattr(engine, "profile", None)
        doubts = [w for w in update.result.warnings if w.startswith(DOUBT)]
        before = self.lens.profile
        same = profile is not None and before is not None and profile.frames == before.frames
        doubt = doubts[-1] if doubts else self.lens.doubt if same else ""
        self.lens = Lens(profile, doubt)

    def _engine(self) -> Engine:
        """The tracker, with the profile of this camera where one has a name."""
        from app.solve.track import Tracker, TrackOptions
        from app.workflows.live_engine import ProfiledTracker

        track = TrackOptions(solve=self.options)
        if self.wish.profile:
            return ProfiledTracker(self.wish.profile, track)
        return Tracker(options=track)

    def _keep(self, engine: Engine) -> None:
        keep: Callable[[], object] | None = getattr(engine, "keep", None)
        if keep is None:
            return
        try:
            kept = keep()
        except KochabError as error:
            self.said.append(str(error))
        else:
            if kept is not None:
                self.said.append(f"The camera profile “{self.wish.profile}” was kept.")
