"""The Laboratory: methods, detectors or estimators on the open frame or a simulated field."""

import json
import math
import time
from pathlib import Path

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QSplitter, QWidget

from kochab.core.errors import UsageError
from kochab.core.progress import PREPARING, Progress, Task
from kochab.lab.laboratory.comparison import Choice, ComparedPart, field_plan, in_words
from kochab.lab.laboratory.curves import curves, points_csv, trials_csv
from kochab.lab.laboratory.scene import Scene, comparison, scene_of_frame, simulated_scene
from kochab.text.translation import tr, tr_noop
from kochab.window.charts.chart import image_of, write_image, write_text
from kochab.window.dialogs import ask_save, tell
from kochab.window.flow import Flow
from kochab.window.job import Job
from kochab.window.laboratory.results import Plots, TrialTable
from kochab.window.laboratory.setup import Hints, LaboratorySetupPanel, MethodsPanel
from kochab.window.services import Services
from kochab.window.view import View
from kochab.window.widgets import ProgressBar, button, column, label, scrolled, show_text, tab_pages

READY = tr_noop("Compare methods on the same stars, or plot how they cope with worse data.")


STEADY_S, STEADY_SHARE, STEP_S = 2.0, 0.03, 5.0
"""How long, and up to which share, nothing is said of the time that is left; then it is said in steps."""


class TimeLeft:
    """How long a run will take from here, at the pace it has had since its stage began."""

    def __init__(self) -> None:
        self._stage, self._begun_s, self._begun_share = "", 0.0, 0.0

    def words(self, progress: Progress, now_s: float) -> str:
        """The time left, with the present time in seconds on any clock; empty before it can be said."""
        share = progress.fraction or 0.0
        if progress.stage != self._stage or share < self._begun_share:
            self._stage, self._begun_s, self._begun_share = progress.stage, now_s, share
        took_s, done = now_s - self._begun_s, share - self._begun_share
        if took_s < STEADY_S or done < STEADY_SHARE:
            return ""
        left_s = took_s * (1.0 - share) / done
        if left_s >= 100.0:
            return tr("about {minutes} min left", minutes=math.ceil(left_s / 60.0))
        return tr("about {seconds:.0f} s left", seconds=STEP_S * max(1, math.ceil(left_s / STEP_S)))


class _Relay(QObject):
    """Carries results from a run's thread to the window's."""

    trial = Signal(object)
    point = Signal(object)


class LaboratoryView(View):
    """Set-up above, table and curves below."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self._services = services
        self.setup = LaboratorySetupPanel()
        self.methods = MethodsPanel()
        self.table = TrialTable()
        self.plots = Plots(ComparedPart.METHOD)
        self.tabs = tab_pages(tr("Laboratory results"), (tr("Table"), self.table), (tr("Curves"), self.plots))
        self.status = label(tr(READY), "muted", wrap=True)
        self.bar = ProgressBar(tr("Progress of the Laboratory"))
        self.compare = button(tr("Compare"), self.run_comparison, "main", tr("One row for each method"))
        self.draw = button(tr("Draw curves"), self.run_curves, tip=tr("Simulated fields with more and more noise"))
        self.stop = button(tr("Stop"), self._stop, tip=tr("Stop and keep the results so far"))
        self.csv = button(tr("CSV…"), lambda: self._ask("csv"), tip=tr("The numbers, for a spreadsheet"))
        self.png = button(tr("PNG…"), lambda: self._ask("png"), tip=tr("The image, at twice the size"))
        self.csv.setAccessibleName(tr("Export as CSV"))
        self.png.setAccessibleName(tr("Export as PNG"))
        self.tabs.currentChanged.connect(self._enable_export)
        self.job: Job | None = None
        self._left = TimeLeft()
        self._relay = _Relay(self)
        self._lay_out()
        if kept := services.settings.table("laboratory"):
            self.setup.restore(kept)
            self.methods.restore(kept)
        self._idle()

    def _lay_out(self) -> None:
        top = tab_pages(tr("Laboratory set-up"), (tr("Methods"), self.methods), (tr("Stars"), scrolled(self.setup)))
        buttons = Flow(self.compare, self.draw, self.stop, None, self.csv, self.png)
        below = QWidget()
        column(buttons, self.bar, self.status, (self.tabs, 1), on=below, margins=(0, 4, 0, 0))
        parts = QSplitter(Qt.Orientation.Vertical)
        parts.addWidget(top)
        parts.addWidget(below)
        parts.setStretchFactor(1, 1)
        parts.setSizes([260, 500])
        column(parts, on=self, margins=(8, 8, 8, 8))
        self.setFocusProxy(self.compare)

    def run_comparison(self) -> None:
        if (choices := self._choices()) is None:
            return
        hints, relay = Hints(self.setup.hints.currentData()), self._begin()
        known = hints is not Hints.NOTHING, hints is Hints.POSITION  # the scale, and the place
        limit_s = self.setup.number("limit_s")
        self.table.begin(self.methods.kind)
        relay.trial.connect(self.table.add)
        self._start(comparison(self._scene(), self.methods.kind, choices, *known, limit_s, relay.trial.emit), 0)

    def run_curves(self) -> None:
        if (choices := self._choices()) is None:
            return
        relay = self._begin()
        self._renew_plots()
        self.plots.begin([choice.name for choice in choices])
        relay.point.connect(self.plots.add)
        fields, seed, limit_s = (self.setup.number(name) for name in ("fields", "seed", "limit_s"))
        place_known = Hints(self.setup.hints.currentData()) is Hints.POSITION
        stars, kind, sweeps = field_plan(*self.setup.field), self.methods.kind, None  # all of them
        task = curves(stars, kind, choices, sweeps, fields, seed, place_known, limit_s, relay.point.emit)
        self._start(task, 1)

    def _choices(self) -> list[Choice] | None:
        """What is ticked; None with the fault shown."""
        try:
            return self.methods.choices()
        except UsageError as error:
            self._say(str(error), "wrong")
            return None

    def _scene(self) -> Task[Scene] | None:
        if self.setup.from_field:
            return simulated_scene(self.methods.kind, field_plan(*self.setup.field), (self.setup.number("seed"),))
        known = self._services.session.known
        if known.frame is None:
            return None
        return scene_of_frame(known.frame, known.detections, known.result, known.options.hint)

    def _renew_plots(self) -> None:
        if self.plots.kind is self.methods.kind:
            return
        # This does not delete the page.
        self.tabs.removeTab(1)
        self.plots.deleteLater()
        self.plots = Plots(self.methods.kind)
        self.tabs.addTab(self.plots, tr("Curves"))

    def _begin(self) -> _Relay:
        """A new relay for each run, so that results of an older one are dropped."""
        self._stop()
        self._relay.deleteLater()
        self._relay = _Relay(self)
        self._services.settings.keep("laboratory", json.dumps({**self.setup.state(), **self.methods.state()}))
        return self._relay

    def _start(self, task: Task[object], tab: int) -> None:
        self.tabs.setCurrentIndex(tab)
        self._left = TimeLeft()
        self.job = job = self._services.jobs.run(task, "laboratory")
        job.progressed.connect(self._progressed)
        job.succeeded.connect(lambda _: self._done(tab))
        job.failed.connect(lambda sentence: self._say(sentence, "wrong"))
        job.cancelled.connect(lambda: self._say(tr("Stopped. Results so far are kept."), "muted"))
        job.finished.connect(lambda: self._idle() if self.job is job else None)
        self._show_running(True)

    def _done(self, tab: int) -> None:
        counts = ", ".join(f"{in_words(method)} {count}" for method, count in self.plots.wrong_answers().items())
        self._say(tr("Done. Wrong answers: {counts}.", counts=counts or tr("none")) if tab else tr("Done."), "muted")

    def _stop(self) -> None:
        if self.job is not None:
            self.job.cancel()

    def _progressed(self, progress: Progress) -> None:
        self.bar.show_share(progress.fraction)
        doing = progress.detail
        if progress.stage == PREPARING:
            doing = tr("Building the small-field index: {doing}", doing=doing)
        self._say(", ".join(filter(None, (doing, self._left.words(progress, time.monotonic())))), "muted")

    def _idle(self) -> None:
        self._show_running(False)
        self._enable_export()

    def _show_running(self, on: bool) -> None:
        for made, possible in ((self.compare, not on), (self.draw, not on), (self.stop, on)):
            made.setEnabled(possible)
        self.bar.setVisible(on)

    def _say(self, text: str, role: str) -> None:
        show_text(self.status, text, role)

    @property
    def curves_shown(self) -> bool:
        """Whether the curves are in front, not the table."""
        return self.tabs.currentIndex() == 1

    def _enable_export(self) -> None:
        some = bool(self.plots.points if self.curves_shown else self.table.trials)
        self.csv.setEnabled(some)
        self.png.setEnabled(some)

    def _ask(self, ending: str) -> None:
        folder = Path(self._services.settings.text("folder", str(Path.home())))
        name = "laboratory-curves" if self.curves_shown else "laboratory-table"
        path = ask_save(self.window(), folder / f"{name}.{ending}", f"{ending.upper()} (*.{ending})")
        if path is not None:
            self.write(ending, path)

    def write(self, ending: str, path: Path) -> None:
        """Write the tab in front in a thread: its numbers as csv, or its image as png."""
        if ending == "csv":
            points = list(self.plots.points.values())
            task = write_text(points_csv(points) if self.curves_shown else trials_csv(self.table.trials), path)
        else:
            task = write_image(image_of(self.tabs.currentWidget()), path)
        job = self._services.jobs.run(task, "export")
        job.succeeded.connect(lambda p: self._services.say(tr("Saved {name}", name=p.name)))
        job.failed.connect(lambda sentence: tell(self.window(), tr("Export"), sentence))
