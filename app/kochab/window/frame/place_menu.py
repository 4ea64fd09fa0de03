"""What can be done with a place of the sky: go there, copy it, look it up."""

from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from functools import partial
from urllib.parse import urlencode

from PySide6.QtCore import QObject, QPoint, QUrl
from PySide6.QtGui import QAction, QDesktopServices
from PySide6.QtWidgets import QMenu, QWidget

from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg
from kochab.gear.actions import MountSituation, reasons_against
from kochab.sky.layer import Mark
from kochab.sky.sky_tables import SkyTables
from kochab.text.angle_text import AngleStyle, radec_plain, radec_text
from kochab.text.translation import tr, tr_noop
from kochab.window.frame.picker import Picker
from kochab.window.frame.session import Session
from kochab.window.image.object_card import vector_of
from kochab.window.settings import WindowSettings
from kochab.window.widgets import copy_text

SIMBAD, ALADIN = "https://simbad.cds.unistra.fr/simbad/", "https://aladin.cds.unistra.fr/AladinLite/"


KNOWN = ("HIP ", "M ", "NGC ", "IC ")  # as Simbad spells them


def links(tables: SkyTables, mark: Mark, vector: Floats, width_deg: float) -> dict[str, str]:
    """Addresses of pages about a mark, by their titles.

    Parameters
    ----------
    tables : SkyTables
        Objects and named stars of the sky.
    mark : Mark
        What it is.
    vector : Floats
        Its direction, ICRS unit vector (3,).
    width_deg : float
        Width of an image of it.
    """
    ra, dec = radec_deg(vector)
    found = {"Aladin Lite": f"{ALADIN}?{urlencode({'target': f'{ra:.5f} {dec:+.5f}', 'fov': f'{width_deg:.2f}'})}"}
    if mark.body is not None:
        return found  # Simbad knows no Solar System
    name = f"HIP {tables.stars.hip[mark.row]}" if mark.kind == "star" else mark.short
    if not name.startswith(KNOWN):
        around = {"Coord": f"{ra:.5f} {dec:+.5f}", "Radius": 5, "Radius.unit": "arcmin"}
        return {"Simbad": f"{SIMBAD}sim-coo?{urlencode(around)}", **found}
    return {"Simbad": f"{SIMBAD}sim-id?{urlencode({'Ident': name})}", **found}


AIMS = {"goto": tr_noop("&Go to"), "centre": tr_noop("C&entre")}  # of a mount, at a place of an image


def place_menu(
    parent: QWidget,
    name: str,
    radec: tuple[float, float],
    style: AngleStyle,
    pages: Mapping[str, str],
    against: Mapping[str, str],
    go: Callable[[str, str], object],
) -> QMenu:
    """What can be done with something in the sky.

    The network is used for a page that is chosen alone.

    Parameters
    ----------
    parent : QWidget
        The widget that the menu belongs to.
    name : str
        What it is; empty for a place.
    radec : tuple[float, float]
        Where it is, ICRS degrees.
    style : AngleStyle
        How coordinates are written.
    pages : Mapping[str, str]
        Addresses about it, by title.
    against : Mapping[str, str]
        Why the mount cannot do each of `AIMS`; empty where it can.
    go : Callable[[str, str], object]
        Takes an action's name and coordinates.
    """
    menu = QMenu(parent)
    menu.addAction(name.replace("&", "&&") or radec_text(*radec, style)).setEnabled(False)
    menu.addSeparator()
    target = radec_plain(*radec, AngleStyle.DECIMAL)
    for action, text in AIMS.items():
        _add(menu, tr(text), partial(go, action, target)).setEnabled(not against[action])
    for reason in dict.fromkeys(filter(None, map(against.__getitem__, AIMS))):
        menu.addAction(reason).setEnabled(False)
    menu.addSeparator()
    _add(menu, tr("Copy &coordinates"), partial(copy_text, radec_plain(*radec, style)))
    if name:
        _add(menu, tr("Copy &name"), partial(copy_text, name))
    online = menu.addMenu(tr("&Search online"))
    for title, page in pages.items():
        _add(online, tr("Open {page} in the browser", page=title), partial(QDesktopServices.openUrl, QUrl(page)))
    for title, page in pages.items():
        _add(online, tr("Copy the link to {page}", page=title), partial(copy_text, page))
    return menu


def _add(menu: QMenu, text: str, do: Callable[[], object]) -> QAction:
    made = menu.addAction(text)
    made.triggered.connect(lambda _=False: do())
    return made


STILL_THERE = timedelta(minutes=10)  # the Moon, the fastest, moves by 5 arcmin


class FrameMenu(QObject):
    """The menu of a place of the open frame; ``situation`` is the mount's, and ``aim`` sends it there."""

    def __init__(
        self,
        parent: QWidget,
        session: Session,
        settings: WindowSettings,
        picker: Picker,
        situation: Callable[[], MountSituation],
        aim: Callable[[str, str], object],
    ) -> None:
        super().__init__(parent)
        self._parent, self._session, self._settings = parent, session, settings
        self._picker, self._situation, self._aim = picker, situation, aim
        picker.card.menu_wanted.connect(lambda where: self.show(None, where))

    def show(self, at: tuple[float, float, float] | None, where: QPoint) -> QMenu | None:
        """Offer what can be done with what is at a place of the frame, px, or with what is picked."""
        frame, mark = self._session.known.frame, self._picker.mark_at(at)
        solution, tables = self._picker.overlay.solution, self._picker.overlay.tables
        if mark is None or solution is None or tables is None or frame is None:
            return None
        vector = vector_of(tables, mark, solution)
        against, taken = reasons_against(self._situation()), frame.hint.time_utc
        old = taken is None or abs(datetime.now(UTC) - taken) > STILL_THERE
        # A trail is a satellite's, which is elsewhere by now.
        if mark.body is not None and (old or mark.body.trail):
            against |= dict.fromkeys(AIMS, tr("{name} has moved since the frame was taken.", name=mark.text))
        width_deg = max(0.25, mark.radius * solution.camera.scale_arcsec_px / 900.0)  # four radii
        pages, style = links(tables, mark, vector, width_deg), self._settings.angle_style
        menu = place_menu(self._parent, mark.text, radec_deg(vector), style, pages, against, self._aim)
        menu.aboutToHide.connect(menu.deleteLater)
        menu.popup(where)
        return menu
