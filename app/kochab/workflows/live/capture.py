"""A camera in a thread of its own, which leaves its newest frame in a one-slot mailbox."""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from threading import Condition, Event, Lock, Thread
from time import monotonic
from typing import Generic, TypeVar

from kochab.core.capture import CameraSource, CaptureLimits, CaptureSettings
from kochab.core.errors import DeviceError, LineLostError, NoAnswerError, RefusedError
from kochab.core.frame import Frame
from kochab.core.values import frozen
from kochab.text.translation import tr

T = TypeVar("T")


class Mailbox(Generic[T]):
    """One slot between two threads: a new item replaces one that was not taken.

    ``put_count``, ``taken`` and ``dropped`` count; ``put_count == taken + dropped + (1 if full)``.
    """

    def __init__(self) -> None:
        self._changed = Condition()
        self._slot: list[T] = []
        self._closed = False
        self.put_count = 0
        self.taken = 0
        self.dropped = 0

    @property
    def closed(self) -> bool:
        """Whether nothing more will come once the slot is empty."""
        return self._closed

    def put(self, item: T) -> None:
        """Leave ``item``, in place of one not taken yet; after closing it is dropped."""
        with self._changed:
            self.put_count += 1
            if self._closed:
                self.dropped += 1
                return
            self.dropped += len(self._slot)
            self._slot[:] = [item]
            self._changed.notify()

    def take(self, timeout_s: float = 0.0) -> T | None:
        """The newest item, or None when none came in time or the box is closed and empty."""
        deadline = monotonic() + timeout_s
        with self._changed:
            while not self._slot and not self._closed:  # woken without an item, it waits for the rest
                left = deadline - monotonic()
                if left <= 0 or not self._changed.wait(left):
                    break
            if not self._slot:
                return None
            self.taken += 1
            return self._slot.pop()

    def close(self) -> None:
        """Let nothing more in and wake the waiting thread; what lies in the slot can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()


SLICE_S = 0.2  # frames are waited for in slices so short that stopping is immediate
JOIN_S = 3.0
RETRY_S = 3.0
MOST_WARNINGS = 20
CLOCK_SLACK_S = 2.0  # a frame dated further in the future than this had another clock than this computer's


@frozen(eq=False)
class Shot:
    """A frame with its moments on :func:`time.monotonic`: mid-exposure and arrival here."""

    number: int
    frame: Frame
    shutter_s: float
    received_s: float

    @property
    def time_utc(self) -> datetime:
        """Mid-exposure from the frame's header, else by this computer's clock."""
        return self.frame.hint.time_utc or datetime.now(UTC) - timedelta(seconds=monotonic() - self.shutter_s)


class Capture:
    """Opens a source in its own thread, which makes every call to it and closes it.

    ``source`` is called in that thread. Stopping takes no longer than one slice, or
    :data:`JOIN_S` when a driver does not return. With ``reconnect`` a camera that was lost while
    in use is opened again every :data:`RETRY_S` until it is back, and its loss is a warning.
    ``see`` is called with each frame in the camera's thread, on its way to the mailbox.
    """

    def __init__(
        self,
        source: Callable[[], CameraSource],
        reconnect: bool = False,
        see: Callable[[Frame], None] = lambda frame: None,
    ) -> None:
        self.mailbox: Mailbox[Shot] = Mailbox()
        self.limits = CaptureLimits()
        self.in_force = CaptureSettings()
        self.name = ""
        self._source, self._reconnect, self._see = source, reconnect, see
        self._number = 0
        self._fault: Exception | None = None
        self._requested: CaptureSettings | None = None
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
        """Set the camera before its next frame; a refusal comes as a warning, see :meth:`take_warnings`.

        May be called from any thread.
        """
        with self._lock:
            self._requested = settings

    def take_warnings(self) -> tuple[str, ...]:
        """The camera's warnings since the last call, each once."""
        new: dict[str, None] = {}  # a set in the order of arrival
        while self._warnings:
            new[self._warnings.popleft()] = None
        return tuple(new)

    @property
    def running(self) -> bool:
        """Whether the camera is still running."""
        return self._thread.is_alive()

    def raise_fault(self) -> None:
        """Raise what ended the capture, once its last frame was taken."""
        if self.mailbox.closed and not self._stop.is_set():
            raise self._fault or NoAnswerError("The camera stopped sending frames.")

    def _drive(self) -> None:
        try:
            self._once()
            # Only a camera that was open is waited for: the first opening raises.
            while self._reconnect and not self._stop.wait(RETRY_S):
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
            if not self._reconnect:
                raise
            self._warnings.append(tr("{error} Kochab reconnects as soon as it is back.", error=error))
        finally:
            source.close()

    def _run(self, source: CameraSource) -> None:
        self.name, self.limits = source.name, source.limits
        self.in_force = source.configure(CaptureSettings())
        while not self._stop.is_set():
            self._configure(source)
            frame = source.next_frame(SLICE_S)
            self.in_force = source.in_force or self.in_force  # another may have set it
            self._warnings.extend(source.complaints())
            if frame is not None:
                self._see(frame)
                self._number += 1
                self.mailbox.put(self._shot(self._number, frame, source.now_utc()))

    def _configure(self, source: CameraSource) -> None:
        with self._lock:
            requested, self._requested = self._requested, None
        if requested is None:
            return
        try:
            self.in_force = source.configure(requested)
        except RefusedError as refusal:
            self._warnings.append(str(refusal))

    def _shot(self, number: int, frame: Frame, now_utc: datetime) -> Shot:
        received = monotonic()
        ago = (frame.hint.exposure_s or 0.0) / 2.0
        if frame.hint.time_utc is not None:
            since_s = (now_utc - frame.hint.time_utc).total_seconds()
            if since_s >= -CLOCK_SLACK_S:
                ago = max(0.0, since_s)
            else:
                self._warnings.append(
                    tr(
                        "The frame's time is {since:.0f} s in the future. Set the clock of this computer and of "
                        "the camera's.",
                        since=-since_s,
                    )
                )
        return Shot(number, frame, received - ago, received)
