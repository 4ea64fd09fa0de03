"""The view at the bolts: digits a third of the screen high, arrows that hold, one red light."""

import numpy as np
import pytest
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QFontMetricsF, QImage, QPainter

from kochab.core.mount import Direction
from kochab.polar.error import Knob
from kochab.window.polar.bolts_painting import digit_font
from kochab.window.polar.bolts_view import KEYS, TURNING, BoltsView
from kochab.window.themes import draw_glyph
from kochab.workflows.polar.update import TurnInstruction
from kochab.workflows.session.alignment_state import AlignmentState
from tests.window.polar_cases import adjusting
from tests.window.test_night import assert_red, colours


@pytest.fixture
def bolts(qtbot):
    view = BoltsView()
    qtbot.addWidget(view)
    view.resize(1366, 768)
    view.show()
    return view


def shape(altitude_arcsec, azimuth_arcsec, side=200):
    """What the view draws beside the digits of the larger error."""
    view = BoltsView()
    view.show_state(adjusting(altitude_arcsec, azimuth_arcsec), 0.0)
    image = QImage(side, side, QImage.Format.Format_Grayscale8)
    image.fill(0)
    painter = QPainter(image)
    draw_glyph(painter, view.face.shape, "#ffffff", QRectF(0, 0, side, side))
    painter.end()
    bits = np.frombuffer(image.constBits(), np.uint8).reshape(side, image.bytesPerLine())
    return bits[:, :side].astype(float)


@pytest.mark.usefixtures("qapp")
def test_too_high_points_down_and_too_low_up():
    down, up = shape(900.0, 10.0), shape(-900.0, 10.0)
    wide = lambda image: (image > 128).sum(axis=1)  # noqa: E731
    # The head is the widest row: it is nearer to where the arrow points.
    assert wide(down).argmax() > 100 > wide(up).argmax()
    assert np.abs(down - up[::-1]).mean() < 3.0


@pytest.mark.usefixtures("qapp")
def test_the_turning_arrows_are_mirrors_with_their_heads_at_the_top():
    clockwise, anti = shape(10.0, -900.0), shape(10.0, 900.0)
    assert np.abs(clockwise - anti[:, ::-1]).mean() < 8.0
    assert np.abs(clockwise - anti).mean() > 10.0
    # Clockwise goes over the right, down and up again on the left: its head is at the upper left.
    quarter = slice(0, 70)
    assert clockwise[quarter, :100].sum() > 1.2 * clockwise[quarter, 100:].sum()


@pytest.mark.parametrize("size", [(1366, 768), (1920, 1080), (2560, 1440)])
def test_digits_are_a_third_of_the_screen_high(bolts, size):
    bolts.resize(*size)
    bolts.show_state(adjusting(-44.0, 10.0), 0.0)
    assert bolts.digits() == "44″"
    font = digit_font(bolts.font(), bolts.digits(), size[1], 0.6 * size[0])
    assert QFontMetricsF(font).capHeight() == pytest.approx(size[1] / 3.0, rel=0.05)
    rows = colours(bolts).max(axis=2).astype(int)
    ground = rows[2, 2]
    text = np.abs(rows - ground)[int(0.15 * size[1]) : int(0.61 * size[1]), int(0.5 * size[0]) :]
    seen = np.flatnonzero((text > 100).any(axis=1))
    assert len(seen) >= 0.3 * size[1]


def test_wide_numbers_shrink_rather_than_being_cut(bolts):
    bolts.resize(800, 768)
    bolts.show_state(adjusting(-5000.0, 10.0), 0.0)
    font = digit_font(bolts.font(), bolts.digits(), bolts.height(), 400.0)
    wide = QFontMetricsF(font).horizontalAdvance(bolts.digits())
    assert wide <= 401


def test_words_and_arrows_say_the_same(bolts):
    bolts.show_state(adjusting(-900.0, 10.0), 0.0)
    assert bolts.way() == "raise the axis"
    bolts.show_state(adjusting(10.0, 900.0), 0.0)
    assert bolts.way() == "anticlockwise, seen from above"
    assert "anticlockwise" in bolts.accessibleDescription()
    assert "azimuth bolt" in bolts.accessibleDescription()


def test_the_keyboard_does_everything(qtbot, bolts):
    bolts.show_state(adjusting(-900.0, 100.0), 0.0)
    with qtbot.waitSignal(bolts.done):
        qtbot.keyClick(bolts, Qt.Key.Key_Space)
    with qtbot.waitSignal(bolts.remeasure):
        qtbot.keyClick(bolts, Qt.Key.Key_M)
    with qtbot.waitSignal(bolts.sounds):
        qtbot.keyClick(bolts, Qt.Key.Key_S)
    assert bolts.knob is Knob.ALTITUDE
    qtbot.keyClick(bolts, Qt.Key.Key_Tab)
    assert bolts.knob is Knob.AZIMUTH
    bolts.show_state(adjusting(-500.0, 100.0), 0.0)  # a new instruction chooses its own axis
    assert bolts.knob is Knob.ALTITUDE
    for key in (Qt.Key.Key_Escape, Qt.Key.Key_F11):
        bolts.show()
        qtbot.keyClick(bolts, key)
        assert not bolts.isVisible()


def test_red_light_alone_at_night(use_theme, bolts):
    use_theme("night")
    for state in (AlignmentState(), adjusting(-900.0, 10.0), adjusting(10.0, 900.0), adjusting(3.0, 3.0)):
        bolts.show_state(state, 0.0)
        assert_red(bolts)
    bolts.show_state(adjusting(-900.0, 10.0, solved=False), 0.0)
    assert bolts.old
    assert_red(bolts)


def test_old_is_told_by_shape_and_word_not_by_colour(bolts):
    bolts.show_state(adjusting(-900.0, 10.0), 0.0)
    fresh = colours(bolts).astype(int)
    bolts.show_state(adjusting(-900.0, 10.0), 60.0)
    old = colours(bolts).astype(int)
    middle = (slice(120, 460), slice(500, 1300))
    lit = [(p[middle].max(axis=2) > 100).sum() for p in (fresh, old)]
    assert lit[1] < 0.5 * lit[0]  # hollow digits


def test_the_end_is_a_tick_and_the_whole_error(bolts):
    bolts.show_state(adjusting(3.0, 3.0), 0.0)
    assert bolts.digits() == "4″"
    assert bolts.way() == ""


def test_escape_is_said_to_stop_the_mount_while_that_turns(bolts):
    bolts.show_state(AlignmentState("turn", "The mount turns: 30 deg to the west."), 0.0)
    assert bolts.face.keys == TURNING
    asked = TurnInstruction("turn", 0.0, "Rotate RA.", Direction.WEST, 30.0)
    bolts.show_state(AlignmentState("turn", "Turn it.", turn_instruction=asked), 0.0)
    assert bolts.face.keys == KEYS
