"""A small screen: the window never outgrows it, and nothing on it is lost."""

from dataclasses import replace
from itertools import product

import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtWidgets import QAbstractButton, QDialog, QLabel

from kochab.window.devices.mount_status import MountStatus
from kochab.window.polar.setup import HANDS, SENTENCES
from kochab.window.shell.side import HANDLE_PX
from kochab.window.shell.views import VIEWS
from kochab.workflows.session.alignment_state import AlignmentState
from tests.window.polar_cases import error


def use_letters(qtbot, unpainted, size):
    """Letters of a size, with which a window would paint itself again."""
    window, commands = unpainted
    commands.appearance.use_theme(text_size=size)
    qtbot.waitUntil(lambda: commands.appearance.settled)
    window.setUpdatesEnabled(False)


def resize(qtbot, window, width, height=600):
    window.resize(width, height)
    qtbot.wait(30)


def beside(qtbot, unpainted, name, width, height):
    """The window in a mode, as small as that, and the dock of what stands beside the image."""
    window, commands = unpainted
    commands.views.show(name)
    for _ in range(2):
        resize(qtbot, window, width, height)
    return window, commands.views.docks[name]


def test_each_tool_beside_a_frame_fits_on_1024_by_600(qtbot, unpainted):
    window, commands = unpainted
    for name in VIEWS:
        resize(qtbot, window, 1024)
        commands.views.show(name)
        qtbot.wait(50)
        resize(qtbot, window, 1024)
        assert (window.width(), window.height()) == (1024, 600), name
        inside = commands.views.docks[name].side.area
        assert inside.widget().minimumSizeHint().width() <= inside.viewport().width(), f"{name} is cut at the right"


def whole(window, shown):
    """Whether every pixel of a widget is in the window, under nothing that cuts it off."""
    inside = window.rect().contains(QRect(shown.mapTo(window, QPoint()), shown.size()))
    return shown.isVisible() and inside and shown.visibleRegion().boundingRect() == shown.rect()


def test_a_screen_of_1024_by_700_suffices_at_a_scale_of_one_and_a_half(qtbot, unpainted):
    """Live needed 776 x 467 px, the Polar room 730 x 474, and the rail lost Night and Settings."""
    window, commands = unpainted
    for name in ("image", *VIEWS):
        commands.views.show(name)
        qtbot.wait(50)
        resize(qtbot, window, 683, 467)
        resize(qtbot, window, 683, 467)
        assert (window.width(), window.height()) == (683, 467), name
        for low in (467, 384):
            resize(qtbot, window, 683, low)
            assert window.height() == low, name
            for action in (commands.views.image, window.actions_by_name["preferences"]):
                assert whole(window, window.rail.widgetForAction(action)), (name, low, action.text())


SCREENS = ((512, 350), (683, 384), (1024, 700))
"""1024 x 700 at scales of two and one, and 1366 x 768 at two; what fits these fits both at one and a half, too."""


def no_larger_than(qtbot, window, screen):
    """Whether a window in any mode can be as small as a screen, and its bar shows all of each part."""
    for _ in range(2):
        resize(qtbot, window, *screen)
    least = window.minimumSizeHint()
    assert (window.width(), window.height()) == screen
    assert (least.width(), least.height()) <= screen
    assert least.height() <= screen[1]
    for made in window.bar.findChildren(QAbstractButton, options=Qt.FindChildOption.FindDirectChildrenOnly):
        assert made.isHidden() or (whole(window, made) and made.width() >= made.minimumSizeHint().width()), made.text()


@pytest.mark.parametrize("letters", ["normal", "huge"])
def test_no_mode_needs_more_than_a_small_screen_at_any_scale(qtbot, unpainted, letters):
    """At a scale of two 1024 x 700 is 512 x 350: details, Live, Mount, Polar and Lab needed 635 to 674 px."""
    window, commands = unpainted
    use_letters(qtbot, unpainted, letters)
    for screen in SCREENS:
        if letters == "huge" and screen[0] < 683:
            continue
        for name in ("image", "details", *VIEWS):
            resize(qtbot, window, *screen)
            commands.views.show("image")
            commands.views.show(name)
            no_larger_than(qtbot, window, screen)
    use_letters(qtbot, unpainted, "normal")


def test_what_has_no_room_beside_the_image_takes_its_place_and_gives_it_back(qtbot, unpainted):
    for name in ("details", *VIEWS):
        takes_its_place_and_gives_it_back(qtbot, unpainted, name)


def takes_its_place_and_gives_it_back(qtbot, unpainted, name):
    _, commands = unpainted
    window, dock = beside(qtbot, unpainted, name, 500, 350)
    if name == "last_night":  # as narrow as it is, both have room
        assert window.pages.isVisible()
        assert dock.side.area.isVisible()
        return
    seen = [dock.side.area.isVisible()]
    assert window.pages.isVisible() is not seen[0]
    dock.side.handle.click()
    seen.append(dock.side.area.isVisible())
    assert window.pages.isVisible() is not seen[1]
    assert seen == ([False, True] if name == "polar" else [True, False])
    if seen[1]:
        dock.side.handle.click()
    assert dock.width() == HANDLE_PX
    resize(qtbot, window, 1200, 800)
    assert window.pages.isVisible()
    assert dock.side.area.isVisible()
    for _ in range(2):
        resize(qtbot, window, 500, 350)
    commands.views.show("image")
    assert window.pages.isVisible()


def test_a_room_has_the_width_that_it_needs_beside_its_side(qtbot, unpainted):
    """The side kept the width of the view before: the Polar room was 312 px wide of 352."""
    window, commands = unpainted
    for _ in range(2):
        resize(qtbot, window, 683, 384)
    for name in ("live", "polar"):
        commands.views.show(name)
        qtbot.wait(50)
    assert window.pages.isVisible()
    qtbot.waitUntil(lambda: window.pages.width() >= window.pages.page_px)


def test_the_mount_s_frame_is_shown_from_a_side_in_its_place(qtbot, unpainted):
    """The side spoke of an image that nobody saw, and its button showed the chart in place of the frame."""
    window, dock = beside(qtbot, unpainted, "mount", 500, 350)
    view, side = dock.view, dock.side
    assert side.area.isVisible()
    assert not view.picture.isVisible()
    assert view.large.text() == "Show the frame"
    view.large.click()
    assert window.workspace.isVisible()
    side.handle.click()
    assert view.large.text() == "Show the chart"
    view.large.click()
    assert view.room.isVisible()


def test_the_set_up_is_one_line_on_1366_by_768_at_a_scale_of_one_and_a_half(qtbot, unpainted):
    _, dock = beside(qtbot, unpainted, "polar", 911, 512)
    view = dock.view
    text = view.room.strip.text
    for sentence in SENTENCES.values():
        for hand in HANDS.values():
            said = sentence.format(pole="refracted pole", goal="30″", hand=hand)
            assert text.fontMetrics().horizontalAdvance(said) <= text.width(), said


def test_the_room_s_menu_shows_a_side_that_is_folded_away(qtbot, unpainted):
    _, dock = beside(qtbot, unpainted, "polar", 500, 350)
    view, side = dock.view, dock.side
    assert not view.setup.isVisible()
    view.buttons.set_up.trigger()
    assert view.setup.isVisible()
    side.handle.click()
    assert view.room.isVisible()


def test_the_number_stays_whole_in_a_room_of_a_few_lines_and_the_cards_scroll(qtbot, unpainted):
    window, dock = beside(qtbot, unpainted, "polar", 512, 350)
    view = dock.view
    view.alignment.state = AlignmentState("done", "12″", error=error(10.0, 5.0))
    view._show()
    room = view.room
    qtbot.waitUntil(lambda: whole(window, room.number))
    assert not room.cards.geometry().intersects(room.bar.geometry())
    room.cards.ensureWidgetVisible(room.strip)
    qtbot.waitUntil(lambda: whole(window, room.strip) or not room.strip.isVisible())


def test_a_window_fits_a_screen_that_is_smaller_than_what_it_shows(qtbot, unpainted):
    window, commands = unpainted
    commands.views.show("mount")
    window.keep_within(QRect(0, 0, 512, 350))
    assert (window.frameGeometry().width(), window.frameGeometry().height()) <= (512, 350)
    assert window.height() <= 350


def test_the_rail_is_whole_on_1024_by_700_at_a_scale_of_two(qtbot, unpainted):
    """Settings was a strip of 12 px."""
    window, _ = unpainted
    window.resize(512, 350)
    qtbot.waitUntil(lambda: window.height() == 350)
    preferences = window.rail.widgetForAction(window.actions_by_name["preferences"])
    qtbot.waitUntil(lambda: whole(window, preferences))


def test_buttons_that_have_no_room_in_one_line_are_in_the_menu(qtbot, unpainted):
    """The menu's own button stood alone in a second line at 683 px."""
    window, commands = unpainted
    commands.views.show("polar")
    buttons = commands.views.docks["polar"].view.buttons
    shown = (buttons.start, buttons.at_bolts, buttons.sound, buttons.phone, buttons.more)
    for width, out in ((683, {buttons.phone}), (1366, set())):
        resize(qtbot, window, width, 600)
        qtbot.waitUntil(lambda out=out: {b for b in shown if b.isHidden()} == out)
        assert len({b.y() for b in shown if b.isVisible()}) == 1
        assert {made for made, row in buttons._rows.items() if row.isVisible()} == out
    resize(qtbot, window, 683, 600)
    window.resize(640, 600)  # as narrow as it can be
    row = buttons._rows[buttons.phone]
    row.trigger()
    buttons.menu.aboutToShow.emit()
    assert row.text() == buttons.phone.text()


def test_the_card_is_short_where_the_whole_of_it_would_hide_the_image(qtbot, unpainted):
    window, commands = unpainted
    card = window.workspace.card
    commands.views.show("live")
    resize(qtbot, window, 911, 512)
    resize(qtbot, window, 911, 512)
    assert [whole(window, shown) for shown in (card.title, card.ra, card.dec)] == [True] * 3
    assert [shown.isVisible() for shown in (card.facts, card.text)] == [False] * 2
    resize(qtbot, window, 1366, 768)
    resize(qtbot, window, 1366, 768)
    assert [whole(window, shown) for shown in (card.facts, card.text)] == [True] * 2


@pytest.mark.parametrize("letters", ["normal", "huge"])
def test_the_pointing_is_whole_in_every_mode_and_the_image_the_largest(qtbot, unpainted, letters):
    """At 1024 x 700 no RA and Dec could be seen after a solve; at 1600 the image was 390 px wide."""
    window, commands = unpainted
    panes, card = window.workspace, window.workspace.card
    use_letters(qtbot, unpainted, letters)
    sizes = (1024, 700), (1600, 1000), (3840, 2160)
    for size, name in product(sizes, ("image", "details", *VIEWS)):
        commands.views.show(name)
        resize(qtbot, window, *size)
        resize(qtbot, window, *size)
        assert (window.width(), window.height()) == size, name
        texts = (card.title, card.text, card.ra, card.dec, card.facts)
        if letters == "huge" and size[0] == 1024:  # where all of it would hide the image
            texts = tuple(text for text in texts if text.isVisible() or text in (card.title, card.ra, card.dec))
        over, room = (card, panes.buttons), window.pages.currentWidget()
        if name == "polar":
            made = commands.views.docks[name].view
            made.alignment.state = AlignmentState("done", "12″", error=error(10.0, 5.0))
            made._show()
            qtbot.waitUntil(lambda made=made: whole(window, made.room.number.total))
            texts, over = (made.room.number.total, made.buttons.start, made.buttons.more), (room.number, room.bar)
        elif name == "last_night":
            made = commands.views.docks[name].view
            texts, over = (made.folder, room), (made.start, made.save)
        elif window.in_room:  # the mount's, with a card of its own
            view = commands.views.docks[name].view
            texts, over = (view.pointing.state,), (room.card, room.strip)
            texts = (*texts, view.go.target, view.go.centre, view.go.goto, view.buttons.sync)
        for shown in (*over, *texts):
            assert whole(window, shown), (name, shown)
        for text in texts if not window.in_room else ():
            lines = text.heightForWidth(text.width()) if text.wordWrap() else text.sizeHint().height()
            assert text.height() >= lines, (name, text.text())
            assert text.wordWrap() or text.width() >= text.sizeHint().width(), (name, text.text())
        assert not over[0].geometry().intersects(over[1].geometry()), name
        beside = [commands.views.docks[n].width() for n in commands.views.docked]
        if letters == "normal" and name != "laboratory":
            assert window.pages.width() > max(beside, default=0), name
    use_letters(qtbot, unpainted, "normal")


@pytest.mark.parametrize("letters", ["normal", "huge"])
@pytest.mark.parametrize("name", [None, "mount"])
def test_stop_is_whole_however_much_the_bars_have_to_say(qtbot, unpainted, name, letters, monkeypatch):
    """At scale 2 the window grew to 1,673 x 700 on a screen of 1024 x 700, and Stop was outside."""
    window, commands = unpainted
    use_letters(qtbot, unpainted, letters)
    if name is not None:
        commands.views.show(name)
    status = window.findChild(MountStatus)
    status.show()  # as the first view with a mount does
    status.stop.setVisible(True)
    status.text.setText("Practice mount: centring the target")
    window.status.background.setText("Building the small-field index: 42 %, about 38 s left")
    window.status.place.setText(
        "05h 36m 12.00s  −01° 12′ 00.0″    alt +45.12°  az 123.12°    x 1234.5  y 234.6  value 12345"
    )
    resize(qtbot, window, 1024, 700)
    resize(qtbot, window, 1024, 700)
    assert (window.width(), window.height()) == (1024, 700)
    assert status.stop.width() >= status.stop.sizeHint().width()
    assert whole(window, status.stop)
    assert whole(window, window.workspace.card.ra if name is None else window.pages.currentWidget().card)
    control = commands.services.mount
    monkeypatch.setattr(control, "known", replace(control.known, phase="connected", alarm="It still moves."))
    status._show()
    resize(qtbot, window, 1024, 700)
    assert whole(window, status.stop)
    assert status.text.width() >= status.text.sizeHint().width()  # the alarm is never cut
    monkeypatch.undo()
    status._show()
    use_letters(qtbot, unpainted, "normal")


def test_a_page_that_is_not_seen_takes_no_room(unpainted):
    window, _ = unpainted
    wide = window.welcome.minimumSizeHint().width()
    window.welcome.setMinimumWidth(wide + 800)
    assert window.pages.minimumSizeHint() == window.workspace.minimumSizeHint()
    window.pages.setCurrentWidget(window.welcome)
    assert window.pages.minimumSizeHint() == window.welcome.minimumSizeHint()


def test_the_list_of_keys_is_whole_with_huge_letters(qtbot, unpainted):
    window, commands = unpainted
    use_letters(qtbot, unpainted, "huge")
    commands.actions["keys"].trigger()
    (dialog,) = [d for d in window.findChildren(QDialog) if d.isVisible()]
    qtbot.wait(50)
    for text in dialog.findChildren(QLabel):
        assert text.width() >= text.sizeHint().width(), text.text()
    dialog.close()
    widest = max(made.sizeHint().width() for made in window.welcome.samples)
    assert window.welcome._inside.maximumWidth() >= widest
    commands.appearance.use_theme(text_size="normal")
    qtbot.waitUntil(lambda: window.welcome._inside.maximumWidth() == 680)
