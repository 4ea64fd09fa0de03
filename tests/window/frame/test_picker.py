"""What is under the cursor, and what a click picks."""

from PySide6.QtCore import QPoint, Qt


def test_a_click_opens_the_card_and_one_beside_it_closes_it(qtbot, opened):
    window, commands = opened
    presenter, view = commands.presenter, window.workspace.view
    qtbot.waitUntil(lambda: presenter.overlay.tables is not None, timeout=20_000)
    view.repaint()
    star = next(mark for mark in presenter.overlay.sky.marks if mark.short == "Alnilam")
    x, y = view.viewport.to_screen(star.xy)
    qtbot.mouseClick(view, Qt.MouseButton.LeftButton, pos=QPoint(round(x), round(y)))
    assert commands.picker.card.isVisible()
    assert commands.picker.card.title.text() == "Alnilam"
    assert "HIP 26311" in commands.picker.card.body.text()
    card = commands.picker.card
    assert card.height() >= card.title.height() + card.body.heightForWidth(card.body.width())  # nothing is cut off
    view.hovered.emit(tuple(star.xy))
    assert window.status.place.text().startswith("Alnilam")
    view.clicked.emit(-500.0, -500.0, 14.0)
    assert not commands.picker.card.isVisible()
