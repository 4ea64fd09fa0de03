"""What can be done with a place of the sky: go there, copy it, look it up."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING
from urllib.parse import urlencode

from PySide6.QtCore import QUrl
from PySide6.QtGui import QAction, QDesktopServices
from PySide6.QtWidgets import QMenu, QWidget

from kochab.core import tr, tr_noop
from kochab.core.angle_text import AngleStyle, radec_plain, radec_text
from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg
from kochab.sky.layer import Mark
from kochab.sky.sky_tables import SkyTables
from kochab.window.widgets import copy_text

if TYPE_CHECKING:
    pass


SIMBAD, ALADIN = "https://simbad.cds.unistra.fr/simbad/", "https://aladin.cds.unistra.fr/AladinLite/"


KNOWN = ("HIP ", "M ", "NGC ", "IC ")  # as Simbad spells them


def links(tables: SkyTables, mark: Mark, vector: Floats, width_deg: float) -> dict[str, str]:
    """Addresses of pages about a mark at a direction (3,), by their titles; ``width_deg`` is that of an image."""
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
    """What can be done with something at ``radec``, ICRS degrees; ``go`` takes an action's name and coordinates.

    ``against`` says why the mount cannot do each of `AIMS`. The network is used for a page that is chosen alone.
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
