"""What can be done with what is at a place of a chart, as a menu."""

from collections.abc import Callable
from functools import partial

from PySide6.QtCore import QPoint, QPointF
from PySide6.QtWidgets import QMenu

from kochab.core.attitude import radec_deg
from kochab.gear.actions import reasons_against
from kochab.text.translation import tr
from kochab.window.atlas.chart import StarChart
from kochab.window.frame.place_menu import links, place_menu
from kochab.window.image.object_card import vector_of
from kochab.window.services import Services


def offer_menu(
    chart: StarChart, services: Services, aim: Callable[[str, str], object], at: QPointF, where: QPoint
) -> QMenu | None:
    """Open the menu; None while the sky has not been read.

    Parameters
    ----------
    chart : StarChart
        Owns the menu, and can be turned to the place.
    services : Services
        Tell what the mount cannot do now, and how angles are written.
    aim : Callable
        Takes the name of an action of the mount and the coordinates of its target.
    at : QPointF
        The place, px of the chart.
    where : QPoint
        Where the menu opens, px of the screen.
    """
    tables = chart.overlay.tables
    if tables is None:
        return None
    mark = chart.mark_at(at)
    vector = chart.sky_at(at) if mark is None else vector_of(tables, mark, chart.sheet)
    against = reasons_against(services.mount.situation)
    pages = {} if mark is None else links(tables, mark, vector, 0.5)
    style, name = services.settings.angle_style, "" if mark is None else mark.text
    menu = place_menu(chart, name, radec_deg(vector), style, pages, against, aim)
    menu.addAction(tr("&Middle of the chart")).triggered.connect(partial(chart.look, vector))
    menu.aboutToHide.connect(menu.deleteLater)
    menu.popup(where)
    return menu
