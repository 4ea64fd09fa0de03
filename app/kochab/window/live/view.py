"""The Live view: a camera runs, its frames are solved, and its pointing is shown."""

import json
import logging
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

from PySide6.QtCore import QTimer, Signal
from PySide6.QtGui import QShowEvent

from kochab.core.capture import CaptureSettings
from kochab.gear.profiles import current_profile
from kochab.sky import open_catalogue
from kochab.text.translation import tr, tr_noop
from kochab.window.devices.cameras import TITLES
from kochab.window.dialogs import ask_folder, ask_text
from kochab.window.job import Job
from kochab.window.live import status_text
from kochab.window.live.camera_panel import CameraPanel
from kochab.window.live.frame_display import LiveDisplay
from kochab.window.live.pointing_panel import PointingPanel
from kochab.window.live.push_panel import PushPanel
from kochab.window.live.sky_points import sky_points
from kochab.window.live.status_text import StreamStatus, recorded_text
from kochab.window.phone import PhonePanel
from kochab.window.services import Services
from kochab.window.view import View
from kochab.window.widgets import Page, button, column, label, row, scrolled, show_text, switch, tab_pages
from kochab.workflows.live.solve import ProfiledTracker
from kochab.workflows.session.live_stream import Recording, Stream, StreamRequest
from kochab.workflows.telescope.push_to import PushTo

NO_RECORDER = tr_noop("Recording is not available in this window.")


class RecordPanel(Page):
    """The recording switch: frames and solutions are saved to a folder."""

    wanted = Signal(object)  # Path | None

    def __init__(self, can_record: bool) -> None:
        super().__init__()
        self.folder = Path.home() / "Kochab"
        self.switch = switch(tr("&Record frames and solutions"))
        self.switch.setEnabled(can_record)
        self.switch.toggled.connect(self._toggled)
        self.choose = button(tr("Fold&er…"), self._ask, tip=tr("Choose the folder for recordings"))
        self.status = label("", "muted", wrap=True)
        column(row((self.switch, 1), self.choose), self.status, on=self, margins=(0, 0, 0, 0))
        self.use_folder(self.folder)

    def show_state(self, recording: Recording) -> None:
        """Frames recorded so far; the switch goes off when the recording has ended by itself."""
        if recording.recorder is not None:
            self.status.setText(recorded_text(recording.recorder))
        if recording.folder is None:
            self.switch.setChecked(False)

    def use_folder(self, folder: Path) -> None:
        """Save the next recording there."""
        self.folder = folder
        self.status.setText(tr("Saves to {folder}", folder=folder) if self.switch.isEnabled() else tr(NO_RECORDER))

    def _toggled(self, on: bool) -> None:
        self.choose.setEnabled(not on)
        self.wanted.emit(self.folder if on else None)

    def _ask(self) -> None:
        if (path := ask_folder(self.window(), str(self.folder), tr("Folder for recordings"))) is not None:
            self.use_folder(path)


log = logging.getLogger("kochab")
WRITE_EVERY_MS = 200  # the panels, which people read; frames are drawn as they come
READY = tr_noop("Choose a camera, then press Start.")
POINTING = 1  # its tab


class LiveView(View):
    """Runs one camera at a time; the headline, Start and Stop are always in sight."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self._services = services
        self.display = LiveDisplay(services, self)
        self.stream: Stream | None = None
        self.job: Job | None = None
        self._ending: Job | None = None
        self._changing_frame = False  # by this view itself, not by another
        self._timer = QTimer(self, interval=WRITE_EVERY_MS)
        self._timer.timeout.connect(self.write)
        self._build()
        self._connect()
        self._restore()
        self._show_idle()
        self.camera.box.search()
        chart = services.jobs.run(sky_points(open_catalogue), "sky-chart")
        chart.succeeded.connect(self.pointing.chart.show_points)
        chart.failed.connect(services.say)

    def _build(self) -> None:
        self.camera = CameraPanel()
        self.pointing = PointingPanel()
        self.push, self.phone = PushPanel(self._services), PhonePanel(self._services)
        self.record = RecordPanel(self._services.wiring.to_record is not None)
        self.title = label("", "heading", wrap=True)
        self.text = label(tr(READY), "muted", wrap=True)
        self.message = label("", wrap=True)
        self.message.setVisible(False)
        self.start = button(tr("&Start"), self.begin, "main", tr("Open the camera and solve its frames"))
        self.stop = button(tr("Sto&p"), self.end, tip=tr("Close the camera; the last frame stays open"))
        camera, pointing = scrolled(self.camera), scrolled(self.pointing)
        more = (tr("Push-to"), scrolled(self.push)), (tr("Phone"), scrolled(self.phone))
        self.tabs = tab_pages(tr("Live"), (tr("Camera"), camera), (tr("Pointing"), pointing), *more)
        top = row((self.title, 1), self.start, self.stop)
        parts = (top, self.text, self.message, (self.tabs, 1), self.record)
        column(*parts, on=self, spacing=6, margins=(10, 8, 10, 8))
        self.setFocusProxy(self.start)

    def _connect(self) -> None:
        services, cameras = self._services, self._services.cameras
        self.camera.settings_wanted.connect(self._set_camera)
        self.camera.box.chosen.connect(lambda chosen: cameras.choose(chosen.source, chosen.address))
        self.record.wanted.connect(self._set_recording)
        cameras.gone.connect(self._show_gone)
        services.session.opening.connect(self._make_way)
        services.jobs.closing.connect(self._save)
        self.pointing.save_wanted.connect(self._ask_lens)
        self.push.way.connect(self._show_way)

    def showEvent(self, event: QShowEvent) -> None:
        if self.stream is None:
            self.camera.box.search()  # a practice telescope may have been started meanwhile
        super().showEvent(event)

    def begin(self) -> None:
        """Open the chosen camera."""
        panel, cameras = self.camera, self._services.cameras
        source, address = panel.box.kind, panel.box.address.text().strip()
        opened = partial(cameras.open, source, address, panel.fields.settings())
        cameras.choose(source, address)
        name = f"{tr(TITLES.get(source, source))} {address}".strip()
        self._save()
        hint = current_profile(self._services.settings).hint_of(source, address)
        self.run(StreamRequest(opened, name, panel.lens.text().strip(), panel.reconnect.isChecked(), hint))

    def run(self, request: StreamRequest, make_engine: Callable[[], ProfiledTracker] | None = None) -> None:
        """Run any camera, with another engine than the tracker if given."""
        # While the last camera is being closed it could not be opened again.
        if self.stream is not None or self._ending is not None:
            return
        queue = self.display.begin(request.name)
        to_record = self._services.wiring.to_record
        self.stream = stream = Stream(request, queue.show, to_record, make_engine)
        if self.record.switch.isChecked():
            stream.recording.folder = self.record.folder
        self.pointing.clear()
        self.pointing.angle_style = self._services.settings.angle_style
        self._show_message("")
        self.job = job = self._services.jobs.run(stream.task(), "live")
        job.failed.connect(lambda sentence: self._failed(job, sentence))
        job.finished.connect(lambda: self._finished(job, stream))
        self._show_running(True)
        self.tabs.setCurrentIndex(POINTING)
        self._show_status(StreamStatus(tr("Opening the camera"), request.name, "heading"))
        self._timer.start()

    def end(self, keep: bool = True) -> None:
        """Stop at once, and ``keep`` the last frame open; the camera is closed by its own thread."""
        job, stream = self.job, self.stream
        self.job = self.stream = None
        self._timer.stop()
        if job is None or stream is None:
            return
        job.cancel()
        self._ending = job
        # LiveDisplay.end opens the last frame like a file, which must not count as another view's.
        self._changing_frame = True
        self.display.end(keep)
        self.pointing.show_stopped()
        self._changing_frame = False
        if keep and self.display.shown is None:
            self._services.session.live.emit(tr("Live: stopped"))
        self._show_status(StreamStatus(tr("Stopping"), tr("Closing the camera…"), "heading"))
        self._show_running(False)
        # Until the camera is closed, see _finished.
        self.start.setEnabled(False)

    def _show_way(self, way: PushTo | None) -> None:
        if way is not None:
            self.phone.show_state(way)

    def _set_camera(self, settings: CaptureSettings) -> None:
        if self.stream is not None:
            self.stream.capture.configure(settings)

    def _ask_lens(self) -> None:
        ask_text(self, tr("Save lens as"), tr("Name of camera and lens"), self.name_lens)

    def name_lens(self, name: str) -> None:
        """Keep what this stream learns of its lens under a name, now and the next time."""
        if self.stream is not None and name:
            self.stream.name_lens(name)
            self.camera.lens.setText(name)
            self._show_message(tr("The lens is saved as “{profile}” when the camera stops.", profile=name))

    def _set_recording(self, folder: Path | None) -> None:
        if self.stream is not None:
            self.stream.recording.folder = folder

    def _show_gone(self, source: str, address: str) -> None:
        box = self.camera.box
        if self.stream is None and (source, address) == (box.kind, box.address.text().strip()):
            box.address.clear()
            box.search()

    def write(self) -> None:
        """Show what is known now; the age runs on without new frames."""
        stream, shown = self.stream, self.display.shown
        if stream is None:
            return
        while stream.messages:
            self._show_message(stream.messages.popleft())
        capture = stream.capture
        if capture.name:
            self.camera.fields.show_limits(capture.limits, capture.in_force)
        if shown is not None:
            self.camera.show_levels(shown.levels)
        self.record.show_state(stream.recording)
        update = stream.latest
        if update is not None:
            self.push.see(update)
            self._show_status(status_text.stream_status(update, monotonic(), stream.seen_s))
            self.pointing.show_update(
                update, stream.lens, stream.request.profile, self.display.drawn_hz, self.display.latency_ms
            )
        elif shown is not None:
            self._show_status(StreamStatus(tr("Searching"), tr("Solving the first frame blind."), "heading"))
        elif capture.name:
            self._show_status(StreamStatus(tr("Waiting for a frame"), "", "heading"))
        old, state = self.pointing.old.text(), self.title.text()
        status = tr("Live: {state}, OLD pointing", state=state) if old else tr("Live: {state}", state=state)
        self._services.session.live.emit(status)

    def _failed(self, job: Job, sentence: str) -> None:
        """The camera failed: show why, and keep the last pointing, marked as old."""
        self._show_message(sentence, "wrong")
        if job is self.job:
            # While there is still a stream, whose last sentences are shown here.
            self.write()
            self.end()
            if self.display.shown is None:
                self._services.session.failed.emit(sentence)

    def _finished(self, job: Job, stream: Stream) -> None:
        # What the end told: of the recording, and of the camera's profile.
        for sentence in stream.messages:
            self._show_message(sentence, str(self.message.property("role") or ""))
        self.record.show_state(stream.recording)
        if job is self.job:
            self.end()
        if job is self._ending:
            self._ending = None
            self._show_idle()

    def _make_way(self, _: object) -> None:
        """A file was opened, or another view shows a frame."""
        if not self._changing_frame and self.stream is not None:
            self.end(keep=False)
            self._show_message(tr("Live stopped because another frame was opened."))

    def _show_idle(self) -> None:
        self._show_running(False)
        self._show_status(StreamStatus(tr("Live"), tr(READY), "heading"))

    def _show_running(self, on: bool) -> None:
        self.start.setEnabled(not on)
        self.start.setVisible(not on)
        self.stop.setVisible(on)
        self.camera.set_running(on)
        if on:
            self.stop.setFocus()

    def _show_status(self, status: StreamStatus) -> None:
        show_text(self.title, status.title, status.role)
        show_text(self.text, status.text)

    def _show_message(self, sentence: str, role: str = "") -> None:
        """One sentence that stays until the next; all of them are in the log."""
        if sentence:
            log.info("%s", sentence)
        show_text(self.message, sentence, role)

    def _save(self) -> None:
        saved = {**self.camera.state(), "record": str(self.record.folder)}
        self._services.settings.keep("live", json.dumps(saved))

    def _restore(self) -> None:
        saved: dict[str, Any] = self._services.settings.table("live")
        self.camera.restore(saved)
        folder = saved.get("record")
        if isinstance(folder, str) and folder:
            self.record.use_folder(Path(folder))
        # After the saved choice, since the present choice of another view counts more.
        self.camera.box.follow(self._services.cameras, lambda: self.stream is None)
