"""The Preferences dialog: every change is applied and kept at once."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TypeVar

from PySide6.QtCore import QLocale, QSignalBlocker, Qt, QUrl, Signal
from PySide6.QtGui import QAction, QColor, QDesktopServices, QIcon, QPixmap
from PySide6.QtWidgets import QCheckBox, QComboBox, QDialog, QDialogButtonBox, QLabel, QSlider, QWidget
from shiboken6 import isValid

from kochab.core.errors import UsageError
from kochab.core.progress import Progress, Task
from kochab.folders import cache_folder
from kochab.gear.journal import journal_folder
from kochab.gear.profiles import current_profile, saved_profiles
from kochab.gear.quick_stop import profile_folder
from kochab.parsing.angles import parse_positive, parse_site, site_text
from kochab.sky.layer import AMOUNTS, MARKS
from kochab.text.translation import number, tr, tr_noop
from kochab.window.devices.equipment import Equipment
from kochab.window.dialogs import ask_folder, without_icons
from kochab.window.panels.solution_panel import STYLES
from kochab.window.services import Services
from kochab.window.settings import WindowSettings, languages
from kochab.window.shell.appearance import Appearance
from kochab.window.shell.main_window import MainWindow
from kochab.window.themes import HUES, TEXT_SIZE_TITLES, THEME_TITLES
from kochab.window.widgets import (
    Part,
    button,
    choice_box,
    column,
    form,
    grid,
    label,
    named,
    narrow_box,
    row,
    scrolled,
    show_text,
    styled_frame,
    switch,
    tab_pages,
    text_field,
)

T = TypeVar("T")
WIDE, HIGH = 90, 26  # letters and lines
FOCAL_MM, PIXEL_UM = 1e5, 100.0  # the most there may be
OFFLINE = tr_noop(
    "Kochab downloads nothing. New star data comes with a new version; your own stars with kochab catalog import."
)
FOLDERS = {tr_noop("Equipment"): profile_folder, tr_noop("Indexes"): cache_folder, tr_noop("Log"): journal_folder}


class GeneralPage(QWidget):
    """Angles, theme, size of the letters, language."""

    def __init__(self, services: Services, appearance: Appearance) -> None:
        super().__init__()
        self._services, self._settings = services, services.settings
        solution = services.panes.solution
        # The titles are the menus', with their mnemonics.
        plain = {tr(title).replace("&", ""): name for name, title in THEME_TITLES.items()}
        sizes = {tr(title).replace("&", ""): name for name, title in TEXT_SIZE_TITLES.items()}
        self.angles = choice_box(tr("Angles"), {tr(title): style for style, title in STYLES.items()})
        _show(self.angles, self._settings.angle_style)
        solution.style_changed.connect(self._show_angles)
        self._undone(self.angles, tr("change the angles"), lambda: self._settings.angle_style, solution.set_style)
        self.theme = choice_box(tr("Theme"), plain)
        self.text = choice_box(tr("Text size"), sizes)
        self._undone(self.theme, tr("change the theme"), self._theme, appearance.use_theme)
        resize = partial(appearance.use_theme, None)
        self._undone(self.text, tr("change the text size"), self._size, resize)
        services.looks.changed.connect(self._show_looks)
        self._show_looks()
        rows: list[tuple[str, QWidget]]
        rows = [(tr("Angles"), self.angles), (tr("Theme"), self.theme), (tr("Text size"), self.text)]
        if there := languages():
            choices = {tr("As the system"): "", QLocale.languageToString(QLocale.Language.English): "en"}
            choices |= {QLocale(code).nativeLanguageName(): code for code in there}
            self.language = choice_box(tr("Language"), choices)
            _show(self.language, self._language())
            self._undone(self.language, tr("change the language"), self._language, self._speak)
            rows += [(tr("Language"), self.language), ("", label(tr("Takes effect at the next start."), "muted"))]
        _fill(self, form(*rows))

    def _undone(self, box: QComboBox, text: str, now: Callable[[], T], use: Callable[[T], object]) -> None:
        """Let ``use`` make what is chosen in ``box``, instead of what is ``now``, which can be had back."""

        def change() -> None:
            before, after = now(), box.currentData()
            use(after)
            self._services.undo.made(text, use, before, after)

        box.activated.connect(change)

    def _theme(self) -> str:
        return self._settings.text("theme", "dark")

    def _size(self) -> str:
        return self._settings.text("text_size", "normal")

    def _language(self) -> str:
        return self._settings.text("language", "")

    def _speak(self, code: str) -> None:
        self._settings.keep("language", code)
        if isValid(self):  # else it was closed, and this is undone from the menu
            _show(self.language, code)

    def _show_angles(self, style: object) -> None:
        _show(self.angles, style)

    def _show_looks(self) -> None:
        _show(self.theme, self._theme())
        _show(self.text, self._size())


class LayersPage(QWidget):
    """Which layers are drawn over the image, how much of each, and in which colour."""

    def __init__(self, services: Services, actions: Mapping[str, QAction]) -> None:
        super().__init__()
        self._undo, self._looks = services.undo, services.looks
        self.layers = {name: _switch_of(actions[name]) for name in (*MARKS, "stretch", "colour")}
        self.amounts = {name: self._amount(name) for name in AMOUNTS}
        self.colours = {name: self._colour(name) for name in MARKS}
        heads = label(""), label(tr("How much"), "muted"), label(tr("Colour"), "muted")
        rows = ([self.layers[name], self.amounts.get(name) or label(), self.colours[name]] for name in MARKS)
        self._looks.changed.connect(self._show_layers)
        self._show_layers()
        self.reset = button(tr("Reset"), self._reset, "small", tr("All amounts and colours as at first"))
        below = row(self.reset, None), styled_frame("rule"), self.layers["stretch"], self.layers["colour"]
        _fill(self, grid(heads, *rows, across=16, stretch=(0, 1)), *below)

    def _amount(self, layer: str) -> QSlider:
        made = named(
            QSlider(Qt.Orientation.Horizontal),
            tr("How much: {layer}", layer=self.layers[layer].text().replace("&", "")),
        )
        made.setRange(0, 100)
        made.setPageStep(10)
        made.valueChanged.connect(lambda value: self._looks.set_amount(layer, value / 100.0))
        return made

    def _colour(self, layer: str) -> QComboBox:
        hues = {tr("Default"): "", **{tr(name): hue for name, hue in HUES.items()}}
        made = narrow_box(tr("Colour: {layer}", layer=self.layers[layer].text().replace("&", "")), 9, hues)

        def choose() -> None:
            others = {name: hue for name, hue in self._looks.layers.colour.items() if name != layer}
            hue = made.currentData()
            self._use(tr("change a colour"), {}, {}, others | ({layer: hue} if hue else {}))

        made.activated.connect(choose)
        return made

    def _reset(self) -> None:
        self._use(tr("reset the layers"), dict(self._looks.layers.amount), AMOUNTS, {})

    def _use(self, text: str, had: dict[str, float], amounts: dict[str, float], colours: dict[str, str]) -> None:
        """Use these amounts and colours instead of those there are, which can be had back."""
        before, after = (had, dict(self._looks.layers.colour)), (amounts, colours)
        self._looks.use_layers(after)
        self._undo.made(text, self._looks.use_layers, before, after)

    def _show_layers(self) -> None:
        """Amounts and colours as they are; samples of colours would not be red light alone at night."""
        layers = self._looks.layers
        for name, slider in self.amounts.items():
            # Showing what there is must not count as a change by the person.
            with QSignalBlocker(slider):
                slider.setValue(round(100.0 * layers.amount[name]))
        for name, box in self.colours.items():
            _show(box, layers.colour.get(name, ""))
            # Item 0 is the default.
            for k, hue in enumerate(HUES.values(), 1):
                sample = QPixmap(12, 12)
                sample.fill(QColor(hue))
                box.setItemIcon(k, QIcon() if self._looks.is_night else QIcon(sample))


class EquipmentPage(QWidget):
    """The equipment profile in use, and where the person observes."""

    wrong = Signal(str)  # why a value can't be used; empty when all can

    def __init__(self, equipment: Equipment, settings: WindowSettings) -> None:
        super().__init__()
        self._equipment, self._settings = equipment, settings
        self.profile = choice_box(tr("Equipment profile"), ())
        self.profile.setEditable(True)
        self.profile.setInsertPolicy(QComboBox.InsertPolicy.NoInsert)
        typed = text_field(tr("Equipment profile"), tr("New equipment…"))
        self.profile.setLineEdit(typed)
        self.focal = text_field(tr("Focal length"), "mm")
        self.pixel = text_field(tr("Pixel size"), tr("µm, before binning"))
        self.site = text_field(tr("Your site"), tr("latitude, longitude, as {example}", example="48.14, 11.58"))
        self.scale, self.hardware = label("", "muted"), label("", "muted", wrap=True)
        for chosen in (self.profile.textActivated, typed.returnPressed):
            chosen.connect(lambda *_: equipment.choose(self.profile.currentText().strip()))
        for field in (self.focal, self.pixel, self.site):
            field.editingFinished.connect(self._keep)
        self.remove = button(tr("Remove"), equipment.remove, "small", tr("Delete this profile"))
        fields = form(
            (tr("Profile"), row((self.profile, 1), self.remove, spacing=8)),
            (tr("Focal length"), self.focal),
            (tr("Pixel size"), self.pixel),
            (tr("Pixel scale"), self.scale),
            (tr("Your site"), self.site),
            (tr("Camera, mount"), self.hardware),
        )
        _fill(self, fields)
        equipment.changed.connect(self.show_profile)
        equipment.refused.connect(self._refuse)
        self.show_profile()

    def _refuse(self, sentence: str) -> None:
        self.wrong.emit(sentence)
        # Else the refused name would stay in its field.
        self.show_profile()

    def show_profile(self) -> None:
        """Show the profile as it is."""
        profile = current_profile(self._settings)
        self.profile.clear()
        self.profile.addItems(["", *(one.name for one in saved_profiles()[0])])
        self.profile.setCurrentText(profile.name)
        self.remove.setEnabled(bool(profile.name))
        for field, value in ((self.focal, profile.focal_length_mm), (self.pixel, profile.pixel_size_um)):
            field.setText("" if value is None else number(value, "g"))
            # Without a name there is no profile that could keep it.
            field.setEnabled(bool(profile.name))
            field.setToolTip("" if profile.name else tr("Type a profile name first"))
        self.site.setText("" if profile.site is None else site_text(profile.site))
        scale = profile.scale_arcsec_px
        self.scale.setText(tr("not known") if scale is None else tr("{scale:.3g}″/px", scale=scale))
        driver, port = profile.mount.driver, profile.port
        mount = tr("{driver} on {port}", driver=driver, port=port) if port else tr("no mount")
        camera = profile.source or tr("no camera")
        self.hardware.setText(tr("{camera}, {mount}. Choose them in Live and Mount.", camera=camera, mount=mount))

    def _keep(self) -> None:
        try:
            focal, pixel, site = (field.text().strip() for field in (self.focal, self.pixel, self.site))
            values = {
                "focal_length_mm": parse_positive(focal, tr("The focal length"), FOCAL_MM) if focal else None,
                "pixel_size_um": parse_positive(pixel, tr("The pixel size"), PIXEL_UM) if pixel else None,
                "site": parse_site(site) if site else None,
            }
        except UsageError as error:
            self.wrong.emit(str(error))
            return
        self.wrong.emit("")
        self._equipment.keep(**values)


class FoldersPage(QWidget):
    """Where images are looked for, where Kochab keeps things, and which star data there is."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self._settings, self._undo = services.settings, services.undo
        self.fixed = switch(tr("Always begin in this folder"), tr("Otherwise in the folder used last"))
        self.folder = label("", "muted", wrap=True)
        self.fixed.setChecked(bool(self._settings.text("start_folder", "")))
        self.fixed.toggled.connect(self._fix_folder)
        self.choose = button(tr("Choose…"), self._choose_folder)
        rows = [(tr(title), _folder_row(tr(title), folder())) for title, folder in FOLDERS.items()]
        self.data = label("", wrap=True)
        job = services.jobs.run(data_text(), "data")
        job.succeeded.connect(self.data.setText)
        # The dialog may be closed before the stars have been counted.
        self.destroyed.connect(job.abandon)
        self._show_folder()
        images = row(self.choose, (self.folder, 1))
        data = label(tr("Star data"), "strong"), self.data
        _fill(self, label(tr("Open images"), "strong"), self.fixed, images, form(*rows), *data)

    def _show_folder(self) -> None:
        self.folder.setText(str(self._settings.image_folder))

    def _fix_folder(self, on: bool) -> None:
        self._begin_in(str(self._settings.image_folder) if on else "")

    def _begin_in(self, folder: str) -> None:
        before = self._settings.text("start_folder", "")
        self._keep_folder(folder)
        self._undo.made(tr("change the folder of images"), self._keep_folder, before, folder)

    def _keep_folder(self, folder: str) -> None:
        self._settings.keep("start_folder", folder)
        if isValid(self):
            with QSignalBlocker(self.fixed):
                self.fixed.setChecked(bool(folder))
            self._show_folder()

    def _choose_folder(self) -> None:
        if (path := ask_folder(self, str(self._settings.image_folder), tr("Open images from"))) is not None:
            self._begin_in(str(path))


class Preferences(QDialog):
    """The pages, and a sentence about what can't be used."""

    def __init__(self, window: MainWindow, services: Services, appearance: Appearance) -> None:
        super().__init__(window)
        self.setWindowTitle(tr("Preferences"))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.wrong = label("", "wrong", wrap=True)
        self.layers = LayersPage(services, window.actions_by_name)
        self.general = GeneralPage(services, appearance)
        self.equipment = EquipmentPage(services.equipment, services.settings)
        self.folders = FoldersPage(services)
        self.layers_page = scrolled(self.layers)
        pages = (
            (tr("General"), self.general),
            (tr("Layers"), self.layers_page),
            (tr("Equipment"), self.equipment),
            (tr("Folders and data"), scrolled(self.folders)),
        )
        self.tabs = tab_pages(tr("Preferences"), *pages)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        without_icons(buttons.buttons())
        buttons.rejected.connect(self.reject)
        column(self.tabs, self.wrong, buttons, on=self, spacing=10, margins=(14, 10, 14, 12))
        self.wrong.hide()
        self.equipment.wrong.connect(partial(show_text, self.wrong))
        appearance.redden_carets(self)
        # The window's shortcuts do not work in another window.
        self.addActions([window.actions_by_name[name] for name in ("undo", "redo")])
        letters = self.fontMetrics()
        self.resize(letters.averageCharWidth() * WIDE, letters.height() * HIGH)


def data_text() -> Task[str]:
    """Which star data there is, and that nothing is fetched."""
    yield Progress("data")
    from kochab.identification.index import fine
    from kochab.sky import open_catalogue

    stars = tr("{count:,} stars, J2000 with proper motions.", count=len(open_catalogue()))
    if index := fine():
        small = tr("Small-field index: ready, in {folder}.", folder=index.folder)
    else:
        small = tr("Small-field index: not built yet; Kochab builds it while it is open.")
    return f"{stars}\n{small}\n{tr(OFFLINE)}"


def _fill(page: QWidget, *parts: Part) -> None:
    """Put the parts of a page one below the other."""
    page.setObjectName("page")
    page.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)  # which Qt paints by itself for its own class alone
    column(*parts, None, on=page, spacing=8, margins=(10, 14, 10, 8))


def _show(box: QComboBox, data: object) -> None:
    box.setCurrentIndex(box.findData(data))


def _switch_of(action: QAction) -> QCheckBox:
    """A checkbox that follows ``action``, and ``action`` it."""
    made = switch(action.text(), action.toolTip())
    made.setChecked(action.isChecked())
    made.toggled.connect(action.setChecked)
    action.toggled.connect(made.setChecked)
    return made


def _folder_row(title: str, path: Path) -> QWidget:
    made, where = QWidget(), QLabel(str(path), textInteractionFlags=Qt.TextInteractionFlag.TextSelectableByMouse)
    where.setWordWrap(True)
    show = button(tr("Show"), lambda: QDesktopServices.openUrl(QUrl.fromLocalFile(str(path))), "small")
    show.setAccessibleName(tr("Show the folder: {title}", title=title))
    row((where, 1), show, on=made, margins=(0, 0, 0, 0))
    return made
