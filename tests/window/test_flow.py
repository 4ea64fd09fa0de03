"""Buttons go on in the next line where there is no room, and none is ever cut."""

import pytest
from PySide6.QtWidgets import QLineEdit, QPushButton, QWidget

from kochab.window.flow import SPACING_PX, Flow

NAMES = ("Compare", "Draw curves", "Stop", "CSV…", "PNG…")


def laid_out(qtbot, flow, width):
    """Geometries of the widgets at a width, and the height that was asked for."""
    page = QWidget()
    qtbot.addWidget(page)
    page.setLayout(flow)
    page.resize(width, flow.heightForWidth(width))
    page.show()
    qtbot.waitExposed(page)
    return page, [flow.itemAt(k).widget() for k in range(flow.count())]


@pytest.mark.parametrize("width", [120, 200, 300, 500, 900])
def test_every_button_is_whole_at_any_width(qtbot, width):
    page, made = laid_out(qtbot, Flow(*map(QPushButton, NAMES)), width)
    places = [button.geometry() for button in made]
    for button, place in zip(made, places, strict=True):
        assert page.rect().contains(place)
        assert place.size() == button.sizeHint()
    for k, place in enumerate(places):
        assert not any(place.intersects(other) for other in places[k + 1 :])
    rows = len({place.top() for place in places})
    wide = sum(place.width() + SPACING_PX for place in places) - SPACING_PX
    assert (rows == 1) == (wide <= width)


def test_what_follows_none_stands_at_the_right(qtbot):
    _, made = laid_out(qtbot, Flow(QPushButton("Compare"), None, QPushButton("CSV…"), QPushButton("PNG…")), 900)
    assert made[0].geometry().left() == 0
    assert made[2].geometry().right() == 899
    assert made[2].geometry().left() - made[1].geometry().right() == SPACING_PX + 1


@pytest.mark.parametrize(("width", "rows"), [(700, 1), (260, 2)])
def test_a_field_fills_its_line_and_has_one_of_its_own_where_all_do_not_fit(qtbot, width, rows):
    field = QLineEdit()
    field.setMinimumWidth(150)
    _, made = laid_out(qtbot, Flow(field, *map(QPushButton, ("Centre", "Go to")), fill=field), width)
    assert len({button.geometry().center().y() for button in made}) == rows
    last = made[-1] if rows == 1 else field
    assert last.geometry().right() == width - 1
    assert field.width() >= 150


def test_a_hidden_button_takes_no_place(qtbot):
    first, second = QPushButton("Open"), QPushButton("Practice night")
    flow = Flow(first, second)
    page, _ = laid_out(qtbot, flow, 400)
    second.hide()
    assert flow.sizeHint() == first.sizeHint()
    assert flow.heightForWidth(10) == first.sizeHint().height()
    assert page.isVisible()
