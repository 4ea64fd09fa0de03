"""One camera for everybody in a program who wants its frames: opened once, closed by the last.

Whoever waits for a frame fetches it from the device, and the others who wait are given the same
one, so that calls of the device never overlap and no thread is added between it and them.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from datetime import datetime
from functools import partial
from threading import Condition, Lock
from time import monotonic

from kochab.core.capture import CameraSource, CaptureLimits, CaptureSettings
from kochab.core.errors import LineLostError
from kochab.core.frame import Frame
from kochab.gear import cameras

SLICE_S = 0.2  # the device is asked in slices so short that others are not kept waiting

Open = Callable[[str, str, CaptureSettings | None], CameraSource]


class SharedCameras:
    """Opens cameras as :func:`kochab.gear.cameras.open_camera` does, each of them once."""

    def __init__(self, open_device: Open | None = None) -> None:
        self._open_device = open_device
        self._lock = Lock()
        self._cameras: dict[tuple[str, str], _Device] = {}

    def open(self, source: str, address: str, settings: CaptureSettings | None = None) -> "Share":
        """A share of the camera at ``address``; DeviceError when it cannot be opened.

        The settings in force are those of whoever opened it first, until somebody sets others. When
        that one leaves it, those of the next are set.
        """
        key, wanted = (source, address.strip()), settings or CaptureSettings()
        while True:
            with self._lock:
                device = self._cameras.get(key)
                if device is None or device.over:
                    device = self._cameras[key] = _Device()
            make = self._open_device or cameras.open_camera
            share = device.join(partial(make, source, address, wanted), wanted)
            if share is not None:
                return share


class Share(CameraSource):
    """A camera that may have others beside it."""

    def __init__(self, device: "_Device", source: CameraSource, wanted: CaptureSettings) -> None:
        self._device, self._source = device, source
        self._open = True
        self.name = source.name
        self.wanted = wanted
        self.slot: Frame | None = None  # came while somebody else asked

    @property
    def limits(self) -> CaptureLimits:
        """Of the camera."""
        return self._source.limits

    @property
    def in_force(self) -> CaptureSettings:
        """The settings now, whoever set them."""
        return self._device.in_force

    @property
    def alone(self) -> bool:
        """Whether nobody else has it."""
        return self._device.count < 2

    def configure(self, settings: CaptureSettings) -> CaptureSettings:
        """Set the camera for all, until this share is closed or somebody sets it otherwise."""
        return self._device.configure(self, settings)

    def next_frame(self, timeout_s: float) -> Frame | None:
        """The newest frame that this share was not given yet."""
        return self._device.fetch(self, timeout_s)

    def close(self) -> None:
        """Leave it; the last one gives the camera back."""
        if self._open:
            self._open = False
            self._device.leave(self)

    def complaints(self) -> tuple[str, ...]:
        """The camera's."""
        return self._source.complaints()

    def now_utc(self) -> datetime:
        """By the camera's clock."""
        return self._source.now_utc()


class _Device:
    """An opened camera and its shares, the oldest first."""

    def __init__(self) -> None:
        self.over = False
        self.in_force = CaptureSettings()
        self._source: CameraSource | None = None
        self._shares: list[Share] = []
        self._set_for: Share | None = None
        self._fault: LineLostError | None = None
        self._news = Condition()
        self._busy = False
        self._asking = 0  # who want the device for something else than a frame

    @property
    def count(self) -> int:
        """How many have it."""
        return len(self._shares)

    def join(self, open_source: Callable[[], CameraSource], wanted: CaptureSettings) -> Share | None:
        """Another share, None when the device was just given back."""
        with self._alone():
            if self.over:
                return None
            if self._source is None:
                # Over only once it has failed: whoever comes meanwhile would open the camera a second time.
                with ExitStack() as failing:
                    failing.callback(setattr, self, "over", True)
                    source = open_source()
                    failing.callback(source.close)
                    self.in_force = source.configure(CaptureSettings())
                    failing.pop_all()
                self._source = source
            share = Share(self, self._source, wanted)
            self._shares.append(share)
            self._set_for = self._set_for or share
            return share

    def configure(self, share: Share, settings: CaptureSettings) -> CaptureSettings:
        """Set the device."""
        with self._alone():
            if settings != CaptureSettings():
                self._set(share, settings)
            return self.in_force

    def fetch(self, share: Share, timeout_s: float) -> Frame | None:
        """The newest frame for one share, from the device or from who asks it now."""
        deadline, asked = monotonic() + timeout_s, False
        while True:
            with self._news:
                while share.slot is None and self._fault is None and (self._busy or self._asking):
                    left = deadline - monotonic()
                    if left <= 0:
                        return None
                    self._news.wait(left)
                if share.slot is not None:
                    frame, share.slot = share.slot, None
                    return frame
                left = max(0.0, deadline - monotonic())
                if self._fault is not None:
                    # A new one each time: one exception object raised in several threads would mix their tracebacks.
                    raise LineLostError(str(self._fault))
                if asked and left <= 0:
                    return None
                self._busy = asked = True
            self._ask(min(left, SLICE_S))

    def leave(self, share: Share) -> None:
        """One share less."""
        with self._news:
            self._shares.remove(share)
            if self._shares:
                return
        with self._alone():
            if not self._shares and self._source is not None:
                source, self._source = self._source, None
                source.close()
                self.over = True  # not before: the next one would open a camera that is still ours

    def _ask(self, timeout_s: float) -> None:
        """Ask the device, which is ours now, and give everybody what comes."""
        frame = None
        assert self._source is not None
        try:
            self._follow_eldest()
            frame = self._source.next_frame(timeout_s)
        except LineLostError as fault:
            self._fault, self.over = fault, True
        finally:
            with self._news:
                self._busy = False
                if frame is not None:
                    for each in self._shares:
                        each.slot = frame
                self._news.notify_all()

    def _follow_eldest(self) -> None:
        """Settings of the one who stays longest, once it is the eldest."""
        if self._shares and self._set_for not in self._shares:
            eldest = self._shares[0]
            self._set_for = eldest
            if eldest.wanted != CaptureSettings():
                self._set(eldest, eldest.wanted)

    def _set(self, share: Share, settings: CaptureSettings) -> None:
        assert self._source is not None
        self.in_force = self._source.configure(settings)
        given = {name: value for name, value in asdict(settings).items() if value is not None}
        share.wanted, self._set_for = replace(share.wanted, **given), share

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Have the device to oneself, before anybody who only waits for a frame."""
        with self._news:
            self._asking += 1
            # Counted in _asking meanwhile, so that fetchers let this one through first.
            self._news.wait_for(lambda: not self._busy)
            self._asking -= 1
            self._busy = True
        try:
            yield
        finally:
            with self._news:
                self._busy = False
                self._news.notify_all()
