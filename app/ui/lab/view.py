"""The Laboratory: methods, detectors or estimators on the open frame or a simulated field."""

import json
from functools import partial

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import (
    QHBoxLayout,
    QSplitter,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)

from app.core.errors import UsageError
from app.core.progress import Progress, Task
from app.ui.job import Job
from app.ui.lab.export import Exporter
from app.ui.lab.methods import MethodsPanel
from app.ui.lab.plots import Plots
from app.ui.lab.setup import SetupPanel, Told
from app.ui.lab.table import TrialTable
from app.ui.palette import Colours
from app.ui.progress_bar import ProgressBar
from app.ui.services import Services
from app.ui.widgets import button, label, scrolled, set_role
from app.workflows.laboratory import Trial
from app.workflows.laboratory_curves import MakeScene, curves
from app.workflows.laboratory_kinds import Kind
from app.workflows.laboratory_scene import (
    Scene,
    comparison,
    scene_of_field,
    scene_of_frame,
    scene_of_picture,
)

READY = "Compare on the same stars, or draw how they fare as the stars get worse."


class _Relay(QObject):
    """Carries what a run finds from its thread to the window's."""

    trial = Signal(object)
    point = Signal(object)


class LaboratoryView(QWidget):
    """The parts of a solve side by side: set-up above, table and curves below."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self.setObjectName("page")
        self._services = services
        self.setup = SetupPanel(services.wiring.fields is not None)
        self.methods = MethodsPanel()
        self.table = TrialTable()
        self.plots = Plots(Kind.METHOD)
        self.tabs = QTabWidget()
        self.tabs.setDocumentMode(True)
        self.tabs.setAccessibleName("What the Laboratory found")
        self.tabs.addTab(self.table, "Table")
        self.tabs.addTab(self.plots, "Curves")
        self.said = label(READY, "muted", wrap=True)
        self.bar = ProgressBar("Progress of the Laboratory")
        self.compare = button("Compare", self.run_comparison, "main", "A line for each")
        self.draw = button("Draw curves", self.run_curves, tip="Simulated fields, getting worse")
        self.stop = button("Stop", self._stop, tip="Keep what there is so far")
        self.export = Exporter(self, services)
        self.job: Job | None = None
        self._relay = _Relay(self)
        self._lay_out()
        services.looks.changed.connect(self._dress)
        self._dress(services.looks.colours)
        self._restore()
        self.methods.kind_changed.connect(self._offer_curves)
        self._idle()

    def _lay_out(self) -> None:
        top = QTabWidget()
        top.setDocumentMode(True)
        top.setAccessibleName("What the Laboratory does")
        top.addTab(self.methods, "Methods")
        top.addTab(scrolled(self.setup), "Stars")
        buttons = QHBoxLayout()
        for b in (self.compare, self.draw, self.stop):
            buttons.addWidget(b)
        buttons.addStretch(1)
        for b in (self.export.csv, self.export.png):
            buttons.addWidget(b)
        below = QWidget()
        column = QVBoxLayout(below)
        column.setContentsMargins(0, 4, 0, 0)
        column.addLayout(buttons)
        column.addWidget(self.bar)
        column.addWidget(self.said)
        column.addWidget(self.tabs, 1)
        parts = QSplitter(Qt.Orientation.Vertical)
        parts.addWidget(top)
        parts.addWidget(below)
        parts.setStretchFactor(1, 1)
        parts.setSizes([260, 500])
        outer = QVBoxLayout(self)
        outer.setContentsMargins(8, 8, 8, 8)
        outer.addWidget(parts)
        self.setFocusProxy(self.compare)

    # runs -------------------------------------------------------------------------------------
    def run_comparison(self) -> None:
        """Run the ticked methods on the chosen stars."""
        told = Told(self.setup.told.currentText())
        try:
            choices = self.methods.choices()
        except UsageError as error:
            self._say(str(error), "wrong")
            return
        relay = self._begin()
        self.table.begin(self.methods.kind)
        relay.trial.connect(self._has_trial)
        task = comparison(
            self._scene(), self.methods.kind, choices, told is not Told.NOTHING, told is Told.PLACE,
            self.setup.limit.value(), relay.trial.emit,
        )  # fmt: skip
        self._start(task, 0)

    def run_curves(self) -> None:
        """Vary one thing after the other on simulated fields."""
        make = self._simulated()
        assert make is not None, "the button is off without it"
        try:
            choices = self.methods.choices()
        except UsageError as error:
            self._say(str(error), "wrong")
            return
        relay = self._begin()
        self._renew_plots()
        self.plots.begin([choice.name for choice in choices])
        relay.point.connect(self.plots.add)
        task = curves(
            make, self.setup.wish, self.methods.kind, choices, fields=self.setup.fields.value(),
            seed=self.setup.seed.value(), limit_s=self.setup.limit.value(),
            place_known=Told(self.setup.told.currentText()) is Told.PLACE, tell=relay.point.emit,
        )  # fmt: skip
        self._start(task, 1)

    def _simulated(self) -> MakeScene | None:
        """How simulated fields are made for what is compared; None where they cannot."""
        fields, pictures = self._services.wiring.fields, self._services.wiring.pictures
        if self.methods.kind is Kind.DETECTOR:
            return None if pictures is None else partial(scene_of_picture, pictures)
        return None if fields is None else partial(scene_of_field, fields)

    def _scene(self) -> Task[Scene] | None:
        make = self._simulated()
        if self.setup.from_field and make is not None:
            return make(self.setup.wish, (self.setup.seed.value(),))
        known = self._services.session.known
        if known.frame is None:
            return None
        return scene_of_frame(known.frame, known.detections, known.result, known.options.hint)

    def _renew_plots(self) -> None:
        """Other charts for another kind."""
        if self.plots.kind is self.methods.kind:
            return
        self.tabs.removeTab(1)
        self.plots.deleteLater()
        self.plots = Plots(self.methods.kind)
        self.plots.dress(self._services.looks.colours)
        self.tabs.addTab(self.plots, "Curves")

    def _begin(self) -> _Relay:
        """A relay of its own for each run: what an older one still says is not heard."""
        self._stop()
        self._relay.deleteLater()
        self._relay = _Relay(self)
        self._services.settings.keep(
            "laboratory", json.dumps({**self.setup.state(), **self.methods.state()})
        )
        return self._relay

    def _start(self, task: Task[object], tab: int) -> None:
        self.tabs.setCurrentIndex(tab)
        self.job = job = self._services.jobs.run(task, "laboratory")
        job.progressed.connect(self._progressed)
        job.succeeded.connect(lambda _: self._done(tab))
        job.failed.connect(lambda sentence: self._say(sentence, "wrong"))
        job.cancelled.connect(lambda: self._say("Stopped; this is what there was.", "muted"))
        job.finished.connect(lambda: self._idle() if self.job is job else None)
        for b, on in ((self.compare, False), (self.draw, False), (self.stop, True)):
            b.setEnabled(on)
        self.bar.setVisible(True)

    def _done(self, tab: int) -> None:
        wrong = self.plots.wrong_answers() if tab == 1 else {}
        told = ", ".join(f"{method} {count}" for method, count in wrong.items())
        if tab == 0:
            self._say("Done.", "muted")
        else:
            self._say(f"Done. Wrong answers: {told or 'none'}.", "muted")

    def _stop(self) -> None:
        if self.job is not None:
            self.job.cancel()

    # news -------------------------------------------------------------------------------------
    def _has_trial(self, trial: Trial) -> None:
        self.table.add(trial)

    def _progressed(self, progress: Progress) -> None:
        self.bar.show_share(progress.fraction)
        preparing = "Preparing patterns for small fields: " if progress.stage == "patterns" else ""
        self._say(f"{preparing}{progress.detail}", "muted")

    def _idle(self) -> None:
        self.bar.setVisible(False)
        self.compare.setEnabled(True)
        self.stop.setEnabled(False)
        self._offer_curves()
        self.export.enable()

    def _offer_curves(self) -> None:
        self.draw.setEnabled(not self.stop.isEnabled() and self._simulated() is not None)

    def _say(self, text: str, role: str) -> None:
        self.said.setText(text)
        if self.said.property("role") != role:
            set_role(self.said, role)

    # looks and memory -------------------------------------------------------------------------
    def _dress(self, colours: Colours) -> None:
        self.plots.dress(colours)

    def _restore(self) -> None:
        if kept := self._services.settings.table("laboratory"):
            self.setup.restore(kept)
            self.methods.restore(kept)
