"""The parts of one window, and what is connected between them: what the commands do, and which can be used now."""

from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QObject

from kochab.core.solution import Solution
from kochab.frames import suffixes
from kochab.sky.layer import MARKS
from kochab.text.translation import tr
from kochab.window.devices.equipment import Equipment
from kochab.window.frame.batch import Batch
from kochab.window.frame.exports import FrameExporter
from kochab.window.frame.field import SkyField
from kochab.window.frame.files import Files
from kochab.window.frame.film_strip import Blink, FilmStrip
from kochab.window.frame.looks import FrameLooks
from kochab.window.frame.picker import Picker
from kochab.window.frame.place_menu import FrameMenu
from kochab.window.frame.presenter import Presenter
from kochab.window.frame.session import Session
from kochab.window.image.frame_view import FrameView
from kochab.window.image.stretch_strip import StretchStrip
from kochab.window.panels.solution_panel import SolutionPanel
from kochab.window.services import Services
from kochab.window.settings import WindowSettings
from kochab.window.shell.actions import COMMANDS, Actions, Command, connect_actions
from kochab.window.shell.appearance import Appearance
from kochab.window.shell.dropped_pair import DroppedPair
from kochab.window.shell.help_book import Help
from kochab.window.shell.layout import Layout
from kochab.window.shell.lost_field import LostField
from kochab.window.shell.main_window import MainWindow
from kochab.window.shell.tools import Tools
from kochab.window.shell.views import Views
from kochab.window.undo import Undo


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """The parts of one window, by the names that the slots of :data:`kochab.window.shell.actions.COMMANDS` use."""

    window: MainWindow
    settings: WindowSettings
    session: Session
    services: Services
    field: SkyField
    presenter: Presenter
    picker: Picker
    files: Files
    exporter: FrameExporter
    menu: FrameMenu
    looks: FrameLooks
    appearance: Appearance
    equipment: Equipment
    undo: Undo
    views: Views
    layout: Layout
    tools: Tools
    help: Help

    @property
    def actions(self) -> Actions:
        """The action of each command and each mode."""
        return self.window.actions_by_name

    @property
    def view(self) -> FrameView:
        """The image of the open frame."""
        return self.window.workspace.view

    @property
    def strip(self) -> StretchStrip:
        """The histogram and the sliders over it."""
        return self.window.workspace.strip

    @property
    def solution(self) -> SolutionPanel:
        """The solution among the details."""
        return self.window.workspace.solution

    @property
    def batch(self) -> Batch:
        """The files of the film strip."""
        return self.files.batch

    @property
    def films(self) -> FilmStrip:
        """The film strip."""
        return self.files.films

    @property
    def blink(self) -> Blink:
        """The open image and the one before in turn."""
        return self.files.blink


class Commands(QObject):
    """Connects the commands and the parts, and says which commands can be used now."""

    def __init__(self, parts: Parts) -> None:
        super().__init__(parts.window)
        self._parts = parts
        self._show_state()
        self._said_before = ""
        for command in COMMANDS:
            if command.letter:
                parts.actions[command.name].toggled.connect(self._note_message)  # before what it switches says more
        connect_actions(parts.actions, parts)
        for command in COMMANDS:
            if command.letter:
                parts.actions[command.name].triggered.connect(lambda on, c=command: self._say_switched(c, on))
        self._lost_field = LostField(parts.window, parts.window.say)
        self._connect_frame()
        self._connect_window()
        self._show_recent()
        self._enable()

    def _note_message(self) -> None:
        self._said_before = self._parts.window.status.currentMessage()

    def _say_switched(self, command: Command, on: bool) -> None:
        """What a letter did, which may have been meant for a field, and how to take it back."""
        window = self._parts.window
        if window.status.currentMessage() == self._said_before:  # and nobody has said why it shows nothing
            what = tr(command.text).replace("&", "")
            text = (
                tr("{what}: on. {key} switches it off again.") if on else tr("{what}: off. {key} switches it on again.")
            )
            window.say(text.format(what=what, key=command.letter))

    def _show_state(self) -> None:
        """Switches as they were left, before they do anything."""
        actions, looks = self._parts.actions, self._parts.looks
        for name in MARKS:
            actions[name].setChecked(looks.layers.on[name])
        actions["stretch"].setChecked(self._parts.strip.auto.isChecked())
        actions["colour"].setChecked(looks.colour)

    def _connect_frame(self) -> None:
        """What the open frame tells the rest of the window."""
        parts, actions, bar = self._parts, self._parts.actions, self._parts.window.bar
        files, session, panes = parts.files, parts.session, parts.window.workspace
        for signal in (session.opening, session.solving, session.solved, session.idle, session.opened):
            signal.connect(self._enable)
        session.streaming.connect(self._enable)
        for begun in (files.opening, session.streaming):
            begun.connect(lambda _: actions["blink"].setChecked(False))
        files.notice.connect(parts.window.say)
        files.recent_changed.connect(self._show_recent)
        files.elements_kept.connect(parts.field.look_for_bodies)
        files.blink.named.connect(bar.show_name)
        parts.looks.changed.connect(files.films.redraw)
        parts.presenter.hints_wanted.connect(actions["tab_hints"].trigger)
        panes.card.open_wanted.connect(actions["open"].trigger)
        parts.picker.hovered.connect(parts.window.status.place.setText)
        panes.view.menu_wanted.connect(parts.menu.show)
        panes.strip.changed.connect(lambda _: actions["stretch"].setChecked(panes.strip.auto.isChecked()))
        panes.hints.clear_wanted.connect(self._clear_hints)
        parts.equipment.changed.connect(self._show_site)

    def _connect_window(self) -> None:
        """What its pages, menus and bars ask for."""
        parts, window, actions = self._parts, self._parts.window, self._parts.actions
        # A tab in front of the log makes it invisible as well, but not hidden.
        window.log.visibilityChanged.connect(lambda _: actions["log"].setChecked(not window.log.isHidden()))
        window.log.fault.connect(window.say)
        window.files_dropped.connect(parts.files.open_all)
        window.files_dropped.connect(DroppedPair(parts.files.batch, parts.views.measure).take)
        window.welcome.open_wanted.connect(parts.files.choose)
        window.welcome.file_wanted.connect(parts.files.open)
        able = parts.services.wiring.practice is not None
        for start in (window.menus.practice, window.welcome.practice):
            start.setVisible(able)
        window.menus.practice.triggered.connect(lambda _=False: parts.views.practise())
        window.welcome.practice_wanted.connect(parts.views.practise)
        parts.equipment.refused.connect(window.say)
        actions["full"].toggled.connect(self._enable)
        samples = [(sample.title, sample.path) for sample in window.welcome.offered]
        window.menus.show_files(window.menus.samples, samples, parts.files.open)

    def _clear_hints(self) -> None:
        hints = self._parts.window.workspace.hints
        before = hints.typed()
        hints.clear()
        self._parts.undo.made(tr("clear the hints"), hints.show_typed, before, hints.typed())

    def _show_site(self) -> None:
        self._parts.window.workspace.hints.show_site(self._parts.settings.site)
        self._parts.field.say_place()

    def _show_recent(self) -> None:
        recent, menus = self._parts.settings.recent, self._parts.window.menus
        menus.show_files(menus.recent, [(p.name, p) for p in recent], self._parts.files.open)
        self._parts.window.welcome.show_recent(recent)

    def _enable(self, _: object = None) -> None:
        parts, actions, window = self._parts, self._parts.actions, self._parts.window
        known, session = parts.session.known, parts.session
        actions["cancel"].setEnabled(session.busy or actions["full"].isChecked())
        actions["solve"].setEnabled(known.frame is not None)
        for name in ("copy", "copy_all"):
            actions[name].setEnabled(known.last_good is not None)
        for name in ("details", "tab_solution", "tab_stars", "tab_hints"):  # else their keys are the samples' keys too
            actions[name].setEnabled(window.pages.currentWidget() is window.workspace)
        several = len(parts.batch.files) > 1
        for name in ("next", "previous", "blink"):
            actions[name].setEnabled(several)
        for name in ("fit", "one", "in", "out"):
            actions[name].setEnabled(known.frame is not None or session.streams)
        solved = isinstance(known.result, Solution)
        window.menus.export.setEnabled(solved)
        for action in window.menus.export.actions():
            action.setEnabled(solved and (action.objectName() != "export_fits" or _is_fits(known.path)))
        actions["colour"].setEnabled(known.frame is None or known.frame.colour is not None or bool(known.frame.bayer))


def _is_fits(path: Path | None) -> bool:
    """Whether a file may be FITS; only FITS can be copied with a WCS in its header."""
    return path is not None and suffixes().get(path.suffix.lower(), "FITS") == "FITS"
