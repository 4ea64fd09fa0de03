"""Where the frames of an alignment come from: the fields, and the list of files to measure."""

from pathlib import Path

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QComboBox, QFormLayout, QListWidget, QListWidgetItem, QWidget

from kochab.frames import file_pattern
from kochab.gear.cameras import SOURCES
from kochab.gear.session import CameraSelection
from kochab.text.translation import tr, tr_noop
from kochab.window.devices.cameras import CameraBox
from kochab.window.dialogs import ask_frames
from kochab.window.services import Services
from kochab.window.widgets import button, grid, narrow_box, number_field, switch
from kochab.workflows.polar.guide_logs import is_guide_log
from kochab.workflows.session.alignment import FrameSource

SWEEP = Qt.ItemDataRole.UserRole
LINES = 6
PRACTICE_EXPOSURE_S = 1.0


class FrameList(QListWidget):
    """The frames to measure, each once; those of a second sweep measure flexure."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setAccessibleName(tr("Frames to measure"))
        self.setFixedHeight(LINES * self.fontMetrics().height())

    def add(self, paths: list[Path], sweep: int = 0) -> None:
        """Add frames of the first sweep (0) or the second (1)."""
        # The tip of an item is its whole path.
        there = {self.item(i).toolTip() for i in range(self.count())}
        for path in paths:
            if str(path) not in there:
                there.add(str(path))
                item = QListWidgetItem(tr("{name}, second sweep", name=path.name) if sweep else path.name)
                item.setToolTip(str(path))
                item.setData(SWEEP, sweep)
                self.addItem(item)
        self.changed.emit()

    def clear(self) -> None:
        """Take all out."""
        super().clear()
        self.changed.emit()

    def fill(self, sweeps: tuple[tuple[Path, ...], ...]) -> None:
        """The files of each sweep, in place of all there are."""
        self.clear()
        for sweep, paths in enumerate(sweeps):
            self.add(list(paths), sweep)

    def paths(self, sweep: int) -> tuple[Path, ...]:
        """The files of one sweep."""
        items = [self.item(i) for i in range(self.count())]
        return tuple(Path(i.toolTip()) for i in items if i.data(SWEEP) == sweep)


SOLVED_OR_GUIDED = "*.wcs *.json *.jsonl *GuideLog*.txt"
GUIDED = {tr_noop("as the drift shows"): None, tr_noop("guided"): True, tr_noop("not guided"): False}
GUIDED_TIP = tr_noop("A guider holds the stars: then only the rotation of the field counts")
DEC_SIGNS = {tr_noop("as the log says"): 0, tr_noop("north is north"): 1, tr_noop("north is south"): -1}
DEC_SIGN_TIP = tr_noop(
    "Which way the north pulses of a guide log move the mount, where the log doesn't say it, as ASIAIR's"
)
GROWS_TIP = tr_noop("For a guide log or a live session still being recorded, until the axis is known to 30″")
ZONE_TIP = tr_noop("How far the clock of the files is ahead of UTC")
# The zones that are no whole hours ahead of UTC.
HALF_ZONES_H = (-9.5, -3.5, 3.5, 4.5, 5.5, 5.75, 6.5, 8.75, 9.5, 10.5, 12.75)
EXPOSURE_TIP = tr_noop("Applies to every view of this camera during the alignment")
SECOND = tr_noop("Frames of a second sweep at another declination, to measure flexure")


class FrameFields(QObject):
    """A camera, files with what is needed to understand them, or the practice telescope."""

    changed = Signal()
    message = Signal(str, str)  # a sentence and its role

    def __init__(self, services: Services) -> None:
        super().__init__()
        self._services = services
        self.source = narrow_box(tr("Source of the frames"), 8, {tr(source): source for source in FrameSource})
        if services.wiring.practice is None:
            # Practice is the first of FrameSource.
            self.source.removeItem(0)
        self.files = FrameList()
        self.add = button(tr("&Add frames…"), lambda: self._ask_files(0))
        self.add_check = button(tr("Second s&weep…"), lambda: self._ask_files(1), tip=tr(SECOND))
        self.add_open = button(tr("Use &open frame"), self._add_open_frame)
        self.clear = button(tr("Clea&r"), self._clear_files)
        self.row = QWidget()
        buttons = grid((self.add, self.add_check), (self.add_open, self.clear), across=6, down=6, on=self.row)
        buttons.setContentsMargins(0, 0, 0, 0)
        self.camera = CameraBox(n for n in SOURCES if n != "simulated")  # that one has its own mount
        self.exposure = number_field(tr("Exposure"), 0.05, 60.0, 2.0, 2, tr(" s"), tr(EXPOSURE_TIP))
        self.zone = zone_box()
        self.guided = narrow_box(tr("Guided"), 8, {tr(text): guided for text, guided in GUIDED.items()})
        self.guided.setToolTip(tr(GUIDED_TIP))
        self.dec_sign = narrow_box(tr("Dec pulses"), 8, {tr(text): sign for text, sign in DEC_SIGNS.items()})
        self.dec_sign.setToolTip(tr(DEC_SIGN_TIP))
        self.grows = switch(tr("measure again as they grow"), tr(GROWS_TIP))
        self.grows.setAccessibleName(tr("Follow files that grow"))
        self.source.currentIndexChanged.connect(self.changed)
        self.files.changed.connect(self.changed)

    @property
    def chosen(self) -> FrameSource:
        """Where the frames come from."""
        return FrameSource(self.source.currentData())

    @property
    def selection(self) -> CameraSelection:
        """The camera and its exposure; that of a practice telescope exposes as long as its stars need."""
        exposure_s = PRACTICE_EXPOSURE_S if self.chosen is FrameSource.PRACTICE else self.exposure.value()
        return CameraSelection(self.camera.kind, self.camera.address.text().strip(), exposure_s)

    def rows(self) -> list[tuple[str, QWidget]]:
        """Titles and fields, in the order of the form."""
        return [
            (tr("Frames from"), self.source),
            ("", self.files),
            ("", self.row),
            (tr("Clock"), self.zone),
            (tr("Guided"), self.guided),
            (tr("Dec pulses"), self.dec_sign),
            (tr("Follow"), self.grows),
            (tr("Exposure"), self.exposure),
        ]

    def show_in(self, form: QFormLayout, drifts: bool) -> None:
        """Show the fields that the source needs; ``drifts`` when nobody turns the axis of a running camera."""
        files = self.chosen is FrameSource.FILES
        for widget in (self.files, self.row, self.zone, self.grows):
            form.setRowVisible(widget, files)
        form.setRowVisible(self.guided, files or drifts)
        form.setRowVisible(self.camera, self.chosen is FrameSource.CAMERA)
        form.setRowVisible(self.exposure, self.chosen is FrameSource.CAMERA)
        form.setRowVisible(self.dec_sign, files and any(is_guide_log(path) for path in self.files.paths(0)))

    def take_files(self, paths: list[Path]) -> None:
        """Measure from these files, with those that are there already."""
        self.source.setCurrentIndex(self.source.findData(FrameSource.FILES))
        self.files.add(paths)

    def use_files(self, paths: list[Path]) -> None:
        """Measure from these files alone; those that were there can be had back."""
        before, after = (self.files.paths(0), self.files.paths(1)), (tuple(paths), ())
        self.source.setCurrentIndex(self.source.findData(FrameSource.FILES))
        self.files.fill(after)
        if before[0] or before[1]:
            self._services.undo.made(tr("change the frames to measure"), self.files.fill, before, after)

    def _clear_files(self) -> None:
        before = self.files.paths(0), self.files.paths(1)
        self.files.clear()
        self._services.undo.made(tr("clear the frames to measure"), self.files.fill, before, ((), ()))

    def _ask_files(self, sweep: int) -> None:
        start = self._services.settings.text("folder", str(Path.home()))
        kinds = tr("Frames ({endings});;All files (*)", endings=f"{file_pattern()} {SOLVED_OR_GUIDED}")
        paths = ask_frames(self.row.window(), start, tr("Frames to measure"), kinds)
        self.files.add(paths, sweep)

    def _add_open_frame(self) -> None:
        path = self._services.session.known.path
        if path is None:
            self.message.emit(tr("Open a frame first."), "muted")
        else:
            self.files.add([path])


def zone_box() -> QComboBox:
    """To say how far the clock of files is ahead of UTC: hours, or None as they say it themselves."""
    hours = sorted((*range(-12, 15), *HALF_ZONES_H))
    zones = {tr("UTC{hours}", hours=hours_text(h)) if h else tr("UTC"): float(h) for h in hours}
    made = narrow_box(tr("Clock of the files"), 14, {tr("as the files say"): None, **zones})
    made.setToolTip(tr(ZONE_TIP))
    return made


def hours_text(hours: float) -> str:
    """``+5:30`` for 5.5."""
    whole, minutes = divmod(round(abs(hours) * 60.0), 60)
    return f"{'+' if hours > 0 else '−'}{whole}{f':{minutes:02d}' if minutes else ''}"
