"""A camera source in a thread of its own, which leaves its newest frame in a mailbox."""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from threading import Event, Lock, Thread
from time import monotonic

from app.core.capture import CameraSource, CaptureLimits, CaptureSettings
from app.core.errors import DeviceError, LineLostError, NoAnswerError, RefusedError
from app.core.frame import Frame
from app.workflows.mailbox import Mailbox

SLICE_S = 0.2
"""A source is asked in slices so short that stopping it is immediate."""
JOIN_S = 3.0
RETRY_S = 3.0
MOST_WARNINGS = 20
CLOCK_SLACK_S = 2.0
"""A frame from so far in the future was dated by another clock than this computer's."""


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """A frame with its moments on :func:`time.monotonic`: mid-exposure and arrival here."""

    number: int
    frame: Frame
    shutter_s: float
    received_s: float
    warnings: tuple[str, ...] = ()

    @property
    def time_utc(self) -> datetime:
        """Mid-exposure as the frame says, else by this computer's clock."""
        ago = timedelta(seconds=monotonic() - self.shutter_s)
        return self.frame.hint.time_utc or datetime.now(UTC) - ago


class Capture:
    """Opens a source in its own thread, which makes every call to it and closes it.

    ``source`` is called in that thread. Stopping takes no longer than one slice, or
    :data:`JOIN_S` when a driver does not return. With ``again`` a camera that was lost while in
    use is opened again every :data:`RETRY_S` until it is back; that it was lost is a warning then.
    """

    def __init__(self, source: Callable[[], CameraSource], again: bool = False) -> None:
        self.mailbox: Mailbox[Shot] = Mailbox()
        self.limits = CaptureLimits()
        self.in_force = CaptureSettings()
        self.name = ""
        self._source = source
        self._again = again
        self._number = 0
        self._fault: Exception | None = None
        self._wish: CaptureSettings | None = None
        self._lock = Lock()
        self._stop = Event()
        self._warnings: deque[str] = deque(maxlen=MOST_WARNINGS)
        self._thread = Thread(target=self._drive, name="kochab-capture", daemon=True)

    def start(self) -> None:
        """Begin; returns at once."""
        self._thread.start()

    def stop(self) -> None:
        """End it; the camera is given back."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(JOIN_S)

    def configure(self, settings: CaptureSettings) -> None:
        """Set the camera before its next frame; a refusal comes with that as a warning.

        May be called from any thread.
        """
        with self._lock:
            self._wish = settings

    def take_warnings(self) -> tuple[str, ...]:
        """What the camera told since the last frame; told once."""
        told: dict[str, None] = {}
        while self._warnings:
            told[self._warnings.popleft()] = None
        return tuple(told)

    @property
    def running(self) -> bool:
        """Whether the camera is still asked for frames."""
        return self._thread.is_alive()

    def raise_fault(self) -> None:
        """Raise what ended the capture, once its last frame was taken."""
        if self.mailbox.closed and not self._stop.is_set():
            raise self._fault or NoAnswerError("The camera stopped giving frames.")

    def _drive(self) -> None:
        try:
            self._once()
            while self._again and not self._stop.wait(RETRY_S):
                with suppress(DeviceError):  # not back yet
                    self._once()
        except Exception as fault:  # carried to the thread that solves, which raises it
            self._fault = fault
        finally:
            self.mailbox.close()

    def _once(self) -> None:
        """Open the camera and take frames until it is stopped, or lost and to be opened again."""
        source = self._source()
        try:
            self._run(source)
        except LineLostError as error:
            if not self._again:
                raise
            self._warnings.append(f"{error} It is opened again as soon as it is back.")
        finally:
            source.close()

    def _run(self, source: CameraSource) -> None:
        self.name, self.limits = source.name, source.limits
        self.in_force = source.configure(CaptureSettings())
        while not self._stop.is_set():
            self._configure(source)
            frame = source.next_frame(SLICE_S)
            self.in_force = getattr(source, "in_force", self.in_force)  # another may have set it
            self._warnings.extend(_complaints(source))
            if frame is not None:
                self._number += 1
                self.mailbox.put(self._shot(self._number, frame, _now(source)))

    def _configure(self, source: CameraSource) -> None:
        with self._lock:
            wish, self._wish = self._wish, None
        if wish is None:
            return
        try:
            self.in_force = source.configure(wish)
        except RefusedError as refusal:
            self._warnings.append(str(refusal))

    def _shot(self, number: int, frame: Frame, now_utc: datetime) -> Shot:
        received = monotonic()
        ago = (frame.hint.exposure_s or 0.0) / 2.0
        if frame.hint.time_utc is not None:
            told = (now_utc - frame.hint.time_utc).total_seconds()
            if told >= -CLOCK_SLACK_S:
                ago = max(0.0, told)
            else:
                self._warnings.append(
                    f"The frame is dated {-told:.0f} s in the future: the clock of the camera's"
                    " computer and of this one disagree."
                )
        return Shot(number, frame, received - ago, received, self.take_warnings())


def _complaints(source: CameraSource) -> tuple[str, ...]:
    """What a source tells besides frames; only some have anything to tell."""
    told = getattr(source, "complaints", None)
    return () if told is None else tuple(told())


def _now(source: CameraSource) -> datetime:
    """The source's own clock where it has one: simulated time need not be ours."""
    clock = getattr(source, "now_utc", None)
    return datetime.now(UTC) if clock is None else clock()
