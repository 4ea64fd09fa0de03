"""The Polar room: one number that stays where it is, a card for each knob, one message, and the star to drag."""

import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from astropy.coordinates import CIRS, ICRS, AltAz, EarthLocation, SkyCoord
from astropy.time import Time
from astropy.units import deg
from PySide6.QtCore import QPoint, QRectF
from PySide6.QtGui import QImage

from kochab.core.attitude import angle_between as separation
from kochab.core.frame import Frame
from kochab.core.mount import Direction
from kochab.core.progress import run
from kochab.polar.error import Knob
from kochab.polar.measure import PolarFinding, PolarFindingKind
from kochab.polar.tutor import Instruction, TutorStep
from kochab.window.image.frame_image import prepare
from kochab.window.polar.error_display import AxisTarget
from kochab.window.polar.first_steps import STEPS
from kochab.window.polar.messages import Message, all_known, most_urgent
from kochab.window.polar.room import KnobCard, NumberCard, standing_of
from kochab.window.polar.setup import DRIFT_ADVICE
from kochab.workflows.polar.update import TurnInstruction
from kochab.workflows.session.alignment import AxisTurnedBy
from kochab.workflows.session.alignment_state import AlignmentState
from tests.window.polar_cases import adjusting, error

SLIPPED = PolarFinding(PolarFindingKind.SLIPPING, "RA moved by 29°. Lock it.")
SPOILT = PolarFinding(PolarFindingKind.DISAGREE, "Something slipped.", spoils=True)


def with_(*findings, **changed):
    return replace(adjusting(300.0, 900.0), findings=findings, **changed)


def test_one_message_the_most_urgent_and_all_of_it_in_tonight():
    """Five voices spoke at once at 16 arcsec."""
    stray = Instruction(TutorStep.TURN, "That moved azimuth. Turn.", Knob.ALTITUDE, 0.1, note="That moved azimuth.")
    lost = {"solved": False, "detail": "too few stars"}
    said = Message("Turned; taking a frame (4 s).")
    order = [
        (with_(SLIPPED, SPOILT, instruction=stray, **lost), Message("No mount.", "wrong"), "No mount."),
        (with_(SLIPPED, SPOILT, instruction=stray, **lost), said, "Something slipped."),
        (with_(SLIPPED, instruction=stray, **lost), said, "Turned; taking a frame (4 s)."),
        (with_(SLIPPED, instruction=stray, **lost), Message(), "That moved azimuth."),
        (with_(SLIPPED, **lost), Message(), "too few stars"),
        (with_(SLIPPED), Message(), "RA moved by 29°. Lock it."),
    ]
    assert [most_urgent(state, told).text for state, told, _ in order] == [words for _, _, words in order]
    assert "Both axes locked?" in most_urgent(with_(), Message()).text
    tested = replace(stray, note="", why="The number grew.")
    assert most_urgent(with_(instruction=tested), Message()).text == "The number grew."
    assert most_urgent(with_(SLIPPED, instruction=tested), Message()).text == "RA moved by 29°. Lock it."
    assert all(words in all_known(with_(SLIPPED, SPOILT)) for words in ("Something slipped.", "RA moved by 29°."))


def test_a_knob_is_now_next_or_done():
    state = adjusting(300.0, 900.0)
    turned = state.instruction.knob
    other = Knob.ALTITUDE if turned is Knob.AZIMUTH else Knob.AZIMUTH
    assert standing_of(state, turned, 30.0) == "now"
    assert standing_of(state, other, 30.0) == "next"
    small = replace(state, error=error(7.0, 900.0), instruction=replace(state.instruction, knob=Knob.AZIMUTH))
    assert standing_of(small, Knob.ALTITUDE, 30.0) == "done"
    assert standing_of(with_(SPOILT), turned, 30.0) == "", "no bolt is to be turned"
    assert standing_of(AlignmentState("done", error=error(3.0, 4.0)), Knob.ALTITUDE, 30.0) == "done"


def test_the_card_of_the_knob_says_the_turn_and_not_what_went_wrong_before(qtbot):
    told = Instruction(
        TutorStep.TURN,
        "That moved azimuth, not altitude. Altitude bolt: a quarter turn clockwise, then wait.",
        Knob.ALTITUDE,
        0.25,
        note="That moved azimuth, not altitude.",
    )
    card = KnobCard(Knob.ALTITUDE)
    qtbot.addWidget(card)
    card.show_state(with_(instruction=told), 30.0)
    assert card.way.text() == "Altitude bolt: a quarter turn clockwise, then wait."
    assert card.title.text() == "Altitude, now"
    assert card.value.text() == "▼ 5.0′"


def test_the_number_greys_when_it_is_old_and_says_for_how_long(qtbot):
    card = NumberCard()
    qtbot.addWidget(card)
    state = replace(adjusting(300.0, 20.0), error_at_s=100.0)
    card.show_state(state, 102.0)
    assert (card.total.property("role"), card.age.text()) == ("number", "live 2 s ago")
    card.show_state(state, 141.0)
    assert (card.total.property("role"), card.age.text()) == ("number_old", "OLD: 41 s ago")
    assert card.age.text() == state.age_words(141.0), "as the phone says it"


@pytest.mark.parametrize("size", [(1024, 700), (1366, 768), (1600, 1000)])
def test_the_number_never_moves_and_nothing_covers_anything(qtbot, polar, size):
    commands, view = polar()
    commands.window.resize(*size)
    view.alignment.state, places = adjusting(-900.0, 100.0), []
    long = PolarFinding(PolarFindingKind.SLIPPING, "RA moved by 29°. Lock its clutch; the result stands. " * 4)
    for state in (adjusting(-900.0, 100.0), with_(long), with_(SPOILT, solved=False), adjusting(-54000.0, 20.0)):
        view.alignment.state = state
        view._show()
        qtbot.wait(50)
        room = view.room
        assert room.isVisible()
        places.append(room.number.total.mapTo(room, room.number.total.rect().topLeft()))
        assert not room.cards.geometry().intersects(room.bar.geometry())
        assert room.rect().contains(room.bar.geometry())
        assert room.number.total.sizeHint().width() <= room.number.total.width(), "in one line, whole"
    assert len({(at.x(), at.y()) for at in places}) == 1


def test_four_buttons_and_a_menu(polar):
    _, view = polar()
    for state in (AlignmentState(), adjusting(-900.0, 100.0)):
        view.alignment.state = state
        view._enable(state.running)
        view._show()
        made = [b for b in (*vars(view.buttons).values(),) if hasattr(b, "click") and b.isVisible()]
        assert len(made) == 5, [b.text() for b in made]
    view._enable(False)


def test_the_ring_follows_the_error_from_half_a_degree_to_seconds(qtbot):
    target = AxisTarget()
    qtbot.addWidget(target)
    reach = []
    for total in (1800.0, 300.0, 60.0, 5.0):
        target.show_state(replace(adjusting(total, 0.0), live=True, measured=(error(1800.0, 0.0),)))
        reach.append(target.reach_arcsec / total)
    target.show_state(replace(adjusting(5.0, 0.0), live=False, trail=((0.0, 5.0),), measured=(error(1800.0, 0.0),)))
    assert target.reach_arcsec <= 45.0, "nor when it is measured again"
    assert np.all(np.array(reach[:3]) < 12.0)
    assert target.reach_arcsec <= 45.0


def test_measured_again_the_room_says_so_and_keeps_to_the_newest_error():
    """At 7 arcsec "Rotate RA" came without a why, a knob said "raise the axis" by 0 arcsec, the ring was 30 arcmin."""
    turn = TurnInstruction("turn", None, "Rotate RA.", Direction.WEST, 60.0)
    asked = AlignmentState(
        "turn", "Rotate RA.", turn_instruction=turn, error=error(5.0, 0.0), measured=(error(1800.0, 0.0),)
    )
    again = replace(asked, trail=((0.0, 5.0),))
    assert [most_urgent(state, Message()).text for state in (asked, again)] == [
        "Rotate RA.",
        "Measure again. Rotate RA.",
    ]
    assert [standing_of(state, Knob.ALTITUDE, 30.0) for state in (asked, again)] == ["", "done"]
    assert standing_of(replace(again, error=error(50.0, 0.0)), Knob.ALTITUDE, 30.0) == ""


def test_a_knobs_arrow_is_the_plots_own(qtbot):
    """An arrow that turned clockwise stood over "anticlockwise", which the bolt had to go."""
    card = KnobCard(Knob.AZIMUTH)
    qtbot.addWidget(card)
    for off, arrow in ((-600.0, "▶"), (600.0, "◀")):
        card.show_state(adjusting(3.0, off), 30.0)
        assert card.value.text().startswith(arrow)


def test_numbers_and_picture_of_a_telescope_that_is_gone_are_not_left(polar):
    _, view = polar()
    view.alignment.state = AlignmentState("done", "12″", error=error(10.0, 5.0))
    view.alignment._forget()
    view._show()
    assert view.room.number.total.text() == "–"
    assert view.room.frame.picture is None


@pytest.mark.parametrize("size", [(800, 560), (1024, 700), (1366, 768), (1600, 1000)])
def test_before_the_first_frame_the_room_says_how_it_goes_and_leads_to_the_set_up(qtbot, polar, size):
    commands, view = polar()
    commands.window.resize(*size)
    qtbot.wait(50)
    room, first = view.room, view.room.first
    qtbot.waitUntil(first.isVisible)
    assert [step.text() for step in first.steps] == list(STEPS)
    assert room.rect().contains(first.geometry())
    assert not first.geometry().intersects(room.bar.geometry())
    assert not first.geometry().intersects(room.strip.geometry().translated(room.cards.pos()))
    first.set_up.click()
    assert view.tabs.currentWidget().widget() is view.setup
    view.setup.axis.hand.setCurrentText(AxisTurnedBy.NOBODY)
    assert [step.text() for step in first.steps if step.isVisible()] == [DRIFT_ADVICE], "nobody turns a bolt"
    room.show_state(AlignmentState("done", "12″", error=error(10.0, 5.0)), 0.0, 30.0)
    assert not first.isVisible(), "who has been through it needs no introduction"
    room.show_state(AlignmentState(), 0.0, 30.0)
    assert first.isVisible()
    room.frame.show_picture(run(prepare(Frame(np.arange(48.0, dtype=np.float32).reshape(6, 8)))))
    room.show_state(AlignmentState(), 0.0, 30.0)
    assert not first.isVisible(), "the frame is the room"


@pytest.mark.parametrize("wide", [180, 250, 400])
def test_nothing_is_drawn_over_the_names_of_the_plots_directions(qtbot, wide):
    target = AxisTarget()
    qtbot.addWidget(target)
    target.resize(wide, 190)
    # An axis far to the left, and its way there: it once was drawn over "anticlockwise".
    target.show_state(replace(adjusting(10.0, -900.0), live=True, trail=((-900.0, 400.0), (-900.0, -400.0))))
    target._names = lambda *drawn: None
    drawn = target.grab().toImage()
    del target._names
    named = target.grab().toImage()
    ground = drawn.pixel(1, 1)
    changed = [
        (x, y) for x in range(named.width()) for y in range(named.height()) if named.pixel(x, y) != drawn.pixel(x, y)
    ]
    assert changed, "there are names"
    assert all(drawn.pixel(x, y) == ground for x, y in changed)


def at_the_pole(sky):
    """Degrees from the cross on the chart to the pole of date, and where the zenith is from it, degrees from the top."""
    date = Time(datetime.now(UTC))
    pole = CIRS(ra=0 * deg, dec=math.copysign(90.0, sky.site.latitude_deg) * deg, obstime=date).transform_to(ICRS())
    here = EarthLocation.from_geodetic(sky.site.longitude_deg * deg, sky.site.latitude_deg * deg)
    zenith = SkyCoord(alt=90 * deg, az=0 * deg, frame=AltAz(obstime=date, location=here)).icrs
    (x, y), (up_x, up_y) = sky.sheet.pixels_of(np.array([pole.cartesian.xyz.value, zenith.cartesian.xyz.value]))
    middle = sky.width() / 2.0, sky.height() / 2.0
    assert (x + 0.5, y + 0.5) == pytest.approx(middle, abs=2.0), "the pole"
    return math.degrees(separation(sky.pole, pole.cartesian.xyz.value)), math.degrees(math.atan2(up_x - x, y - up_y))


# An older astropy knows the Earth's rotation up to its own release.
@pytest.mark.filterwarnings("ignore:Tried to get polar motions", "ignore:.some. times are outside of range")
@pytest.mark.parametrize("latitude_deg", [52.0, -33.0])
def test_before_the_first_frame_the_sky_around_the_pole_is_shown_as_one_sees_it(polar, latitude_deg):
    """The room was bare; the pole and the zenith over it are Astropy's."""
    _, view = polar()
    view.setup.aim.site.setText(f"{latitude_deg}, 11.6")
    sky = view.room.sky
    assert sky.isVisible()
    assert sky.site.latitude_deg == latitude_deg
    off_deg, tilt_deg = at_the_pole(sky)
    assert off_deg < 0.05, "refracted, it is an arcminute higher"
    assert abs(tilt_deg) < 0.5
    free = sky.mapTo(view.room, sky.rect().center())
    assert not (view.room.cards.geometry() | view.room.first.geometry()).contains(free)


def test_no_name_of_the_pole_s_sky_is_cut_by_the_edge_of_the_room(polar, qtbot):
    """The chart is wider than the room, so that its middle is the pole: "CAMELOPARDALIS" ended in the panel beside it."""
    commands, view = polar()
    commands.window.resize(1366, 768)
    sky, cut, most = view.room.sky, [], 0
    qtbot.waitUntil(lambda: bool(sky.overlay.labels))
    for hour in range(0, 24, 2):
        sky.turn(datetime(2026, 11, 29, hour, tzinfo=UTC))
        sky.grab()
        most = max(most, len(sky.overlay.labels))
        for label in sky.overlay.labels:
            x, y, width, height = label.box
            box = QRectF(x, y, width, height).translated(sky.pos().toPointF())
            cut += [] if QRectF(view.room.rect()).contains(box) else [(hour, label.text)]
    assert sky.width() > view.room.width()
    assert most > 15, "at ten there are eight"
    assert cut == []


def pixels_of(image):
    """Bytes of a picture's pixels, rows by columns by 4."""
    image = image.convertToFormat(QImage.Format.Format_RGB32)
    return np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1, 4).copy()  # the picture goes


def test_the_pole_s_name_is_whole_or_not_there(polar, qtbot):
    """At 800 x 520 its lower half was behind the buttons."""
    commands, view = polar()
    commands.window.resize(1366, 768)
    sky, shown = view.room.sky, 0
    qtbot.waitUntil(lambda: bool(sky.overlay.labels))
    for high in range(580, 490, -10):
        commands.window.resize(800, high)
        qtbot.wait(50)
        marked = sky.grab().toImage()
        sky.paint_marks = lambda *_: None
        bare, ratio = sky.grab().toImage(), marked.devicePixelRatio()
        del sky.paint_marks
        covers = [over.geometry().translated(-sky.pos()) for over in (view.room.bar, view.room.first)]
        changed = np.any(pixels_of(marked) != pixels_of(bare), axis=2)
        drawn = [QPoint(int(x / ratio), int(y / ratio)) for y, x in np.argwhere(changed).tolist()]
        assert not [at for at in drawn if any(cover.contains(at) for cover in covers)], high
        shown += bool(drawn)
    assert shown >= 5


def test_a_frame_takes_the_place_of_the_pole_s_sky(polar, qtbot):
    _, view = polar()
    room = view.room
    room.frame.see(Frame(np.zeros((40, 60), np.float32)), None)
    qtbot.waitUntil(lambda: room.frame.picture is not None)
    assert not room.sky.isVisible()
    room.frame.begin()
    assert room.sky.isVisible()
