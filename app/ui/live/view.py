"""The Live view: a camera runs, and a person sees at any moment where it points now."""

import json
from collections.abc import Callable
from time import monotonic

from PySide6.QtCore import QTimer
from PySide6.QtGui import QShowEvent

from app.core.capture import CameraDevice, CameraSource, CaptureSettings
from app.core.progress import Progress, Task
from app.ui.job import Job
from app.ui.live import words
from app.ui.live.camera_panel import TITLES
from app.ui.live.panel import POINTING, READY, LivePanel
from app.ui.live.sky_points import sky_points
from app.ui.live.stage import Stage
from app.ui.live.stream import Stream, StreamWish
from app.ui.palette import Colours
from app.ui.services import Services
from app.workflows.live_solve import Engine

WRITE_EVERY_MS = 200


class LiveView(LivePanel):
    """Runs one camera at a time and writes what is known of it."""

    def __init__(self, services: Services) -> None:
        super().__init__(self.begin, self.end, services.wiring.to_record is not None)
        self._services = services
        self.stage = Stage(services, self)
        self.stream: Stream | None = None
        self.job: Job | None = None
        self._ending: Job | None = None
        self._own = False  # whether this view itself is changing what is open
        self._timer = QTimer(self)
        self._timer.setInterval(WRITE_EVERY_MS)
        self._timer.timeout.connect(self.write)
        self._listen()
        self._dress(services.looks.colours)
        self._restore()
        self._idle()
        self.look()
        chart = services.jobs.run(_points(services), "sky-chart")
        chart.succeeded.connect(self.pointing.chart.show_points)
        chart.failed.connect(services.say)

    def _listen(self) -> None:
        services, cameras = self._services, self._services.cameras
        self.camera.look_wanted.connect(self.look)
        self.camera.settings_wanted.connect(self._set_camera)
        self.camera.chosen.connect(cameras.choose)
        self.record.wanted.connect(self._set_recording)
        cameras.chosen.connect(self._adopt)
        cameras.gone.connect(self._has_gone)
        cameras.found.connect(self._has_found)
        cameras.missed.connect(self._has_missed)
        services.looks.changed.connect(self._dress)
        services.session.opening.connect(self._another_frame)
        services.jobs.closing.connect(self._keep)

    def showEvent(self, event: QShowEvent) -> None:
        if self.stream is None:
            self.look()  # a practice telescope may have been started meanwhile
        super().showEvent(event)

    # the person's wishes ----------------------------------------------------------------------
    def begin(self) -> None:
        """Open the chosen camera."""
        choice, cameras = self.camera.choice(), self._services.cameras

        def opened() -> CameraSource:
            return cameras.open(choice.source, choice.address, choice.settings)

        cameras.choose(choice.source, choice.address)
        name = " ".join((TITLES.get(choice.source, choice.source), choice.address)).strip()
        self._keep()
        self.run(StreamWish(opened, name, choice.profile, choice.again))

    def run(self, wish: StreamWish, make_engine: Callable[[], Engine] | None = None) -> None:
        """Run any camera, and any engine instead of the tracker."""
        if self.stream is not None or self._ending is not None:
            return
        display = self.stage.begin(wish.name)
        to_record = self._services.wiring.to_record
        self.stream = stream = Stream(wish, display.show, to_record, make_engine)
        if self.record.switch.isChecked():
            stream.recording.wish = self.record.folder
        self.pointing.clear()
        self.pointing.style_ = self._services.settings.angle_style
        self._services.panes.show_side(False)  # the frame needs the room
        self._say("")
        self.job = job = self._services.jobs.run(stream.task(), "live")
        job.failed.connect(lambda sentence: self._has_failed(job, sentence))
        job.finished.connect(lambda: self._has_finished(job, stream))
        self.show_running(True)
        self.tabs.setCurrentIndex(POINTING)
        self.show_headline(words.State("Opening the camera", wish.name, "heading"))
        self._timer.start()

    def end(self) -> None:
        """Stop at once; the camera is given back by its own thread."""
        self._end(keep=True)

    def look(self) -> None:
        """Look for cameras of the chosen kind."""
        self._services.cameras.look(self.camera.kind, self.camera.address)

    def _end(self, keep: bool) -> None:
        job, stream = self.job, self.stream
        self.job = self.stream = None
        self._timer.stop()
        if job is None or stream is None:
            return
        job.cancel()
        self._ending = job
        if keep:
            self._remember(stream)
        self._own = True
        self.stage.end(keep)
        self.pointing.leave()
        self._own = False
        self._services.panes.show_side(True)
        self.show_headline(words.State("Stopping", "The camera is being given back.", "heading"))
        self.show_running(False)
        self.start.setEnabled(False)

    def _set_camera(self, settings: CaptureSettings) -> None:
        if self.stream is not None:
            self.stream.capture.configure(settings)

    def _set_recording(self, folder: object) -> None:
        if self.stream is not None:
            self.stream.recording.wish = folder  # type: ignore[assignment]

    # news -------------------------------------------------------------------------------------
    def _adopt(self, source: str, address: str) -> None:
        """Another view has chosen a camera: it is this one's too, unless one runs."""
        if self.stream is None:
            self.camera.show_choice(source, address)

    def _has_gone(self, source: str, address: str) -> None:
        if self.stream is None and (source, address) == (self.camera.kind, self.camera.address):
            self.camera.show_choice(source, "")
            self.look()

    def _has_found(self, source: str, devices: list[CameraDevice]) -> None:
        if source == self.camera.kind:
            self.camera.show_found(devices)

    def _has_missed(self, source: str, sentence: str) -> None:
        if source == self.camera.kind:
            self.camera.say(sentence)

    def write(self) -> None:
        """Write what is known now; the age goes on though nothing comes."""
        stream = self.stream
        if stream is None:
            return
        while stream.said:
            self._say(stream.said.popleft())
        capture = stream.capture
        if capture.name:
            self.camera.show_limits(capture.limits, capture.in_force)
        if self.stage.shown is not None:
            self.camera.show_levels(self.stage.shown.levels)
        self.record.show_state(stream.recording.state)
        update = stream.latest
        if update is None:
            if self.stage.shown is not None:
                self.show_headline(words.State("Searching", "The whole sky, once.", "heading"))
            elif capture.name:
                self.show_headline(words.waiting())
            return
        self.show_headline(words.state_of(update, monotonic(), stream.seen_s))
        self.pointing.show_update(
            update, stream.lens, stream.wish.profile, self.stage.drawn_hz, self.stage.latency_ms
        )

    def _remember(self, stream: Stream) -> None:
        """The rest of the window's last good pointing is this one's."""
        good = None if stream.latest is None else stream.latest.last_good
        if good is not None:
            known = self._services.session.known
            known.last_good, known.last_good_from = good.solution, stream.wish.name

    def _has_failed(self, job: Job, sentence: str) -> None:
        """The camera ended it: one sentence, and the last pointing stays, marked old."""
        self._say(sentence, "wrong")
        if job is self.job:
            self.write()
            self._end(keep=True)

    def _has_finished(self, job: Job, stream: Stream) -> None:
        for sentence in stream.said:
            self._say(sentence, str(self.said.property("role") or ""))
        self.record.show_state(stream.recording.state)
        if job is self.job:
            self._end(keep=True)
        if job is self._ending:
            self._ending = None
            self._idle()

    def _another_frame(self, _: object) -> None:
        """A file was opened, or another tool shows a frame: this one makes way."""
        if not self._own and self.stream is not None:
            self._end(keep=False)
            self._say("Live has stopped because another frame was opened.")

    # looks and memory -------------------------------------------------------------------------
    def _idle(self) -> None:
        self.show_running(False)
        self.show_headline(words.State("Live", READY, "heading"))

    def _say(self, sentence: str, role: str = "") -> None:
        """One sentence that stays until the next; all of them are in the log."""
        if sentence:
            self._services.log.info("%s", sentence)
        self.show_said(sentence, role)

    def _dress(self, colours: Colours) -> None:
        self.wear(colours, self._services.looks.is_night)
        self.update()

    def _keep(self) -> None:
        kept = {**self.camera.state(), **self.record.state()}
        self._services.settings.keep("live", json.dumps(kept))

    def _restore(self) -> None:
        if kept := self._services.settings.table("live"):
            self.camera.restore(kept)
            self.record.restore(kept)
        if self._services.cameras.choice is not None:
            self._adopt(*self._services.cameras.choice)


def _points(services: Services) -> Task[object]:
    yield Progress("chart")
    return (yield from sky_points(services.catalogue()))
