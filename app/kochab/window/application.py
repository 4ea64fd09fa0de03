"""Starts Qt, makes one window, and runs it to its end."""

import gc
import signal
import sys
from collections.abc import Callable, Sequence
from math import ceil
from pathlib import Path
from time import monotonic

from PySide6.QtCore import QLibraryInfo, QLocale, QObject, QTimer, QTranslator
from PySide6.QtWidgets import QApplication

from kochab.core.progress import PREPARING, Progress
from kochab.detection import DETECTORS
from kochab.folders import data_folder
from kochab.identification import IDENTIFIERS
from kochab.text.duration_text import duration_text
from kochab.text.translation import speak, tr, tr_noop
from kochab.window.accessibility import keep_scroll_areas_steady
from kochab.window.devices.cameras import Cameras
from kochab.window.devices.equipment import Equipment
from kochab.window.devices.mount_control import MountControl
from kochab.window.devices.mount_status import MountStatus
from kochab.window.frame.exports import FrameExporter
from kochab.window.frame.field import SkyField
from kochab.window.frame.files import Files
from kochab.window.frame.looks import FrameLooks
from kochab.window.frame.picker import Picker
from kochab.window.frame.place_menu import FrameMenu
from kochab.window.frame.presenter import Presenter
from kochab.window.frame.session import Session, WorkflowEngine
from kochab.window.job import Job, Jobs
from kochab.window.services import Services
from kochab.window.settings import WindowSettings
from kochab.window.shell.appearance import Appearance
from kochab.window.shell.commands import Commands, Parts
from kochab.window.shell.frame_title import FrameTitle
from kochab.window.shell.help_book import Help
from kochab.window.shell.layout import Layout
from kochab.window.shell.main_window import MainWindow
from kochab.window.shell.own_stars import OwnStars
from kochab.window.shell.tools import Tools
from kochab.window.shell.views import VIEWS, Views
from kochab.window.shell.welcome import Sample, samples
from kochab.window.undo import Undo
from kochab.window.widgets import use_plain_numerals
from kochab.workflows.session.wiring import Wiring

INDEX_TIP = tr_noop(
    "The index for fields narrower than about 2° is built on this computer, once. Wider fields solve meanwhile."
)
LIBRARIES = (
    "scipy.spatial",
    "scipy.integrate",
    "kochab.simulate.camera_source",
    "serial.tools.list_ports",
    "kochab.window.shell.palette",
)
"""What views, solved frames and the search need a moment later."""
AFTER_MS = 1500  # the person's first frame goes first


class Background(QObject):
    """Runs the engine's preparation in a thread, with its progress in the status bar."""

    def __init__(self, window: MainWindow, engine: WorkflowEngine, after_ms: int = AFTER_MS) -> None:
        super().__init__(window)
        self._status = window.status
        self.job = Job(engine.prepare(), "background")
        self.job.progressed.connect(self._progressed)
        self.job.failed.connect(self._failed)
        self.job.finished.connect(lambda: self._status.background.setText(""))
        window.closing.connect(self._close)
        self._began: tuple[float, float] | None = None  # when, and at which share
        self._share = 0.0
        self._timer = QTimer(self, singleShot=True, interval=after_ms)
        self._timer.timeout.connect(self.job.start)
        self._timer.start()

    def _progressed(self, progress: Progress) -> None:
        if progress.stage != PREPARING:
            return
        text = tr("Building the small-field index")
        if (share := progress.fraction) is not None:
            if self._began is None or share - self._share > LEAP:  # it goes on where an earlier one stopped
                self._began = monotonic(), share
            self._share = share
            when, first = self._began
            text = tr("Building the small-field index: {share:.0f} %", share=100 * share)
            # The speed of a smaller part tells nothing of the rest.
            if share - first > 0.05:
                left = (monotonic() - when) * (1 - share) / (share - first)
                # In whole minutes, and tens of seconds in the last: finer, it wanders with what else the machine does.
                rounded = 60.0 * round(left / 60.0) if left > 90.0 else 10.0 * ceil(left / 10.0)
                text = tr(
                    "Building the small-field index: {share:.0f} %, about {left} left",
                    share=100 * share,
                    left=duration_text(rounded),
                )
        self._status.background.setText(text)
        self._status.background.setToolTip(tr(INDEX_TIP))

    def _failed(self, sentence: str) -> None:
        self._status.showMessage(sentence, 15_000)

    def _close(self) -> None:
        self._timer.stop()
        self.job.abandon()
        self.job.join(5.0)


LEAP = 0.1  # of the share from one step to the next
EVERY_MS = 1000
FULL_EVERY = 10  # ticks


class Garbage(QObject):
    """Collects Python's cyclic garbage in the window's thread, until :meth:`stop`.

    Left alone, Python collects in whatever thread allocates: in a worker that destroys Qt objects
    outside their thread, which crashes. A full collection walks a hundred thousand objects of
    imported modules, which holds up the window for a tenth of a second.
    """

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._modules = 0
        self._ticks = 0
        self._timer = QTimer(self)
        self._timer.timeout.connect(self.tick)
        self._timer.start(EVERY_MS)
        gc.disable()
        self.tick()

    def tick(self) -> None:
        """Freeze what imports made, which stays for good; collect the rest while it is young."""
        self._ticks += 1
        if len(sys.modules) != self._modules:
            self._modules = len(sys.modules)
            gc.freeze()
        else:
            gc.collect(2 if self._ticks % FULL_EVERY == 0 else 1)

    def stop(self) -> None:
        self._timer.stop()
        gc.unfreeze()
        gc.enable()


def whole_engine() -> WorkflowEngine:
    """The engine that loads, in a thread, the views and what they need: opening one holds up nobody."""
    return WorkflowEngine([*(mode.made_by.partition(":")[0] for mode in VIEWS.values()), *LIBRARIES])


def build(
    engine: WorkflowEngine,
    settings: WindowSettings,
    sample_frames: list[Sample] | None = None,
    wiring: Wiring | None = None,
) -> tuple[MainWindow, Parts]:
    """A window and its parts, wired; it is not shown yet.

    Parameters
    ----------
    engine : WorkflowEngine
        Solves frames.
    settings : WindowSettings
        What is kept between starts.
    sample_frames : list[Sample] or None
        Offered on the welcome page; None: the shipped ones.
    wiring : Wiring or None
        What the window may not import, such as practice nights; None: nothing.
    """
    offered = samples() if sample_frames is None else sample_frames
    wiring = Wiring() if wiring is None else wiring
    window = MainWindow(list(IDENTIFIERS), list(DETECTORS), offered)
    panes, actions = window.workspace, window.actions_by_name
    jobs = Jobs(window, window.closing)
    session = Session(engine, jobs)
    undo = Undo(actions["undo"], actions["redo"], window)
    field = SkyField(session, settings)
    presenter = Presenter(session, panes, field, settings)
    FrameTitle(window, session)
    picker = Picker(session, panes, field.overlay, settings)
    looks = FrameLooks(panes, field, settings, window.say)
    cameras = Cameras(jobs)
    mount = MountControl(settings, session, jobs, wiring, cameras)
    mount_status = MountStatus(mount, window.closing)
    mount_status.hide()
    window.about_to_close.connect(mount.hold_window)
    mount.window_released.connect(window.close_at_last)
    window.bar.add(mount_status)
    equipment = Equipment(window.bar.equipment, settings, actions["preferences"], undo)
    equipment.follow(mount)
    panes.hints.site_given.connect(mount.compare_site)
    services = Services(
        settings, session, panes, looks, mount, mount_status.stop, cameras, equipment, jobs, window.say, undo, wiring
    )
    appearance = Appearance(window, settings, looks)
    exporter = FrameExporter(window, window.menus.export, session, settings, field.overlay, window.say)
    actions.update({action.objectName(): action for action in window.menus.export.actions()})  # the search has them
    files = Files(session, panes, settings, undo)
    views = Views(window, services, appearance, mount_status)
    layout = Layout(window, views, session, settings)
    layout.restore()
    parts = Parts(
        window=window,
        settings=settings,
        session=session,
        services=services,
        field=field,
        presenter=presenter,
        picker=picker,
        files=files,
        exporter=exporter,
        menu=FrameMenu(window, session, settings, picker, lambda: mount.situation, views.aim),
        looks=looks,
        appearance=appearance,
        equipment=equipment,
        undo=undo,
        views=views,
        layout=layout,
        tools=Tools(window, services, appearance, picker, views),
        help=Help(window, views, settings, jobs),
    )
    Commands(parts)
    return window, parts


def use_language(app: QApplication, wanted: str = "", folder: Path | None = None) -> str:
    """Speak the language ``wanted``, as "de", or else the system's, if ``kochab_de.qm`` is in ``folder``; else English.

    Call it before the window is built. ``folder`` is ``resources/translations`` unless given. Returns the English name
    of the language that was wanted and has no file; empty when the right one is spoken.
    """
    country = QLocale(wanted) if wanted else QLocale.system()
    texts, of_qt = QTranslator(app), QTranslator(app)
    named = next(iter(country.uiLanguages()), "en").replace("-", "_")
    # Qt's own texts in another language than Kochab's would be a mixture.
    if not texts.load(f"kochab_{named}", str(folder or data_folder("resources") / "translations")):
        return _without_texts(country, wanted)
    if of_qt.load(country, "qtbase", "_", QLibraryInfo.path(QLibraryInfo.LibraryPath.TranslationsPath)):
        app.installTranslator(of_qt)
    app.installTranslator(texts)
    speak(lambda text, note, n: texts.translate("", text, note, n), country.decimalPoint(), country.groupSeparator())
    country.setNumberOptions(QLocale().numberOptions())
    QLocale.setDefault(country)
    return ""


def _without_texts(country: QLocale, wanted: str) -> str:
    if country.language() is QLocale.Language.C:  # no locale of the system, or a code that Qt does not know
        return "" if wanted in ("", "C") else wanted
    if country.language() is QLocale.Language.English:
        return ""
    return QLocale.languageToString(country.language())


def tell_of_language(say: Callable[[str], None], settings: WindowSettings, language: str) -> None:
    """Say once that there are no texts in ``language``: nobody should look for what is not there."""
    if language and settings.text("language_told", "") != language:
        say(tr("Kochab has no {language} texts yet. It stays in English.", language=language))
        settings.keep("language_told", language)


def run(paths: Sequence[str | Path] = (), wiring: Wiring | None = None, language: str = "") -> int:
    """Open the window with the files and folders ``paths``; the exit code."""
    app = QApplication.instance() or QApplication(sys.argv[:1])
    assert isinstance(app, QApplication)
    app.setApplicationName("Kochab")
    app.setDesktopFileName("kochab")
    # Before use_language, which takes over how numbers are read.
    use_plain_numerals()
    keep_scroll_areas_steady()
    settings = WindowSettings()
    without_texts = use_language(app, language or settings.text("language", ""))
    engine = whole_engine()
    window, parts = build(engine, settings, wiring=wiring)
    garbage = Garbage()  # it has no parent: this name keeps it
    background = Background(window, engine)
    OwnStars(window.status, parts.session.jobs, 2 * AFTER_MS)
    window.show()
    window.keep_within(window.screen().availableGeometry())  # at a larger scale a screen has fewer logical px
    tell_of_language(window.say, settings, without_texts)
    if paths:
        parts.files.open_all([Path(path) for path in paths])
    else:
        window.welcome.load_pictures(parts.session.jobs, lambda: parts.looks.is_night)
        if not settings.flag("toured", False):
            QTimer.singleShot(AFTER_MS, window, parts.help.show_tour)
    # A terminal that is closed must not leave a mount moving. One that is ignored, as nohup has it, stays so.
    for number in [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: window.end())  # handled when Python runs: at a tick of Garbage
    code = app.exec()
    garbage.stop()
    background.job.join(5.0)
    return code
