"""The room of the Mount mode: the chart, what the mount adds to it, and what is done on it."""

import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter
from PySide6.QtWidgets import QApplication

from kochab.core.attitude import apart_deg, radec_deg, separation_deg, unit_vectors
from kochab.core.frame import Detections, Site
from kochab.core.mount import Pointing
from kochab.gear.mount_events import SolvedPosition
from kochab.gear.mounts.coordinates import from_mount_epoch
from kochab.gear.mounts.motion_plan import Limits
from kochab.window.atlas.chart import StarChart
from kochab.window.devices.mount_status import mount_status_text
from kochab.window.image.thumbnails import reduced
from kochab.window.mount.sky_overlay import LocalSky, MountMarks, flat, name_mark
from kochab.window.shell.side import HANDLE_PX
from kochab.window.themes import theme_colours
from kochab.workflows.solve_frame import SolvedFrame
from kochab.workflows.target_tonight import target_tonight, tonight_text
from tests.gear.mounts.bench import place
from tests.window.fakes import fake_solution, star_field
from tests.window.mount_bench import connected


def at_rest(mount):
    return not mount.control.known.busy and not mount.telescope.slewing


def far_away(mount):
    """A place of date two hours west of the meridian, in the mount's numbers."""
    return place(-60.0, 40.0, mount.bench.clock)


def begin_slew(qtbot, mount):
    target = far_away(mount)
    mount.view.go.target.setText(f"{target[0]:.4f} {target[1]:.4f}")
    mount.view.go.goto.click()
    qtbot.waitUntil(lambda: mount.control.known.left_s is not None, timeout=20_000)
    return target


def drawn(chart, at, colour, reach=3):
    """Whether a colour is seen near a place of the chart."""
    picture, ratio, wanted = chart.grab().toImage(), chart.devicePixelRatioF(), QColor(colour)
    for i in range(-reach, reach + 1):
        for j in range(-reach, reach + 1):
            seen = picture.pixelColor(int(at[0] * ratio) + i, int(at[1] * ratio) + j)
            if (
                abs(seen.red() - wanted.red()) + abs(seen.green() - wanted.green()) + abs(seen.blue() - wanted.blue())
                < 40
            ):
                return True
    return False


def test_the_chart_takes_the_frames_place_and_gives_it_back(qtbot, opened):
    window, commands = opened
    commands.views.show("mount")
    room = commands.views.docks["mount"].view.room
    assert room.isVisible()
    assert room.width() > 0.6 * window.width()
    commands.session.show(star_field(), "Camera frame 1")
    assert room.isVisible(), "a camera's frame does not hide it"
    commands.views.show("live")
    assert window.workspace.isVisible()
    commands.views.show("mount")
    assert room.isVisible()
    commands.views.show("image")
    assert window.workspace.isVisible()


def test_a_file_that_is_opened_is_seen_and_one_press_brings_the_chart_back(qtbot, opened, tmp_path):
    window, commands = opened
    commands.views.show("mount")
    view = commands.views.docks["mount"].view
    commands.session.open(tmp_path / "none.fits")
    assert window.workspace.isVisible()
    assert view.isVisible()
    assert view.large.text() == "Show the chart"
    commands.views.toggle("mount")
    assert view.room.isVisible()
    commands.views.toggle("mount")
    assert window.workspace.isVisible()
    assert not view.isVisible()


def test_before_any_frame_the_welcome_page_comes_back(qtbot, make_window, engine):
    window, commands = make_window(engine)
    commands.views.show("mount")
    assert not window.welcome.isVisible()
    commands.views.show("image")
    assert window.welcome.isVisible()


def test_a_slew_is_drawn_and_told_with_its_way_and_time(qtbot, opened):
    _, commands = opened
    with connected(qtbot, commands, slew_deg_s=0.5) as mount:
        room, control = mount.view.room, mount.control
        typed = begin_slew(qtbot, mount)
        assert apart_deg(control.known.report.target_deg, typed) < 0.01
        assert room.marks.slewing
        assert separation_deg(room.chart.centre, unit_vectors(*control.known.report.icrs_deg)) < 1.0, "it turns along"
        text = mount_status_text(control.known)
        assert f"{control.known.left_deg:.0f}° to go, " in text
        assert text.endswith(" s")
        # The bench's axes go at half a degree a second.
        qtbot.waitUntil(lambda: 1.4 < (control.known.left_s or 0.0) / control.known.left_deg < 3.0)
        start, end = room.marks.mount, room.marks.target
        way = flat(room.chart, np.array([start + 0.04 * k * (end - start) for k in (1, 2, 3, 4)]))
        assert sum(drawn(room.chart, at, theme_colours().way, 8) for at in way) >= 3
        before = control.known.left_deg
        qtbot.waitUntil(lambda: control.known.left_deg is not None and control.known.left_deg < before - 1.0)
        mount.view.stop.click()
        qtbot.waitUntil(lambda: at_rest(mount), timeout=15_000)
        qtbot.waitUntil(lambda: control.known.left_deg is None, timeout=5_000)


def test_it_is_stopping_until_the_mount_is_seen_to_stand(qtbot, opened):
    _, commands = opened
    with connected(qtbot, commands, slew_deg_s=2.0) as mount:
        begin_slew(qtbot, mount)
        texts = []
        mount.control.changed.connect(lambda: texts.append(mount_status_text(mount.control.known)))
        mount.view.stop.click()
        qtbot.waitUntil(lambda: "Mount: stopping…" in texts, timeout=10_000)
        qtbot.waitUntil(lambda: "Mount stopped." in mount.said, timeout=15_000)
        assert mount.said.index("Stopping…") < mount.said.index("Mount stopped.")
        qtbot.waitUntil(lambda: "stopping" not in mount_status_text(mount.control.known), timeout=5_000)


def test_a_mount_that_does_not_report_tracking_says_so_in_words(qtbot, opened, monkeypatch):
    """All there was of it was "Tracking: ?"."""
    _, commands = opened
    with connected(qtbot, commands) as mount:
        view, known = mount.view, mount.control.known
        for tracking in (True, None):
            state = replace(known.report.state, tracking=tracking)
            monkeypatch.setattr(mount.control, "known", replace(known, report=replace(known.report, state=state)))
            view._show()
            assert ("This mount does not report tracking." in view.cannot.text()) is (tracking is None)
        assert view.cannot.isVisible()
        monkeypatch.undo()


def double_click(qtbot, chart, vector):
    x, y = chart.sheet.pixels_of(vector[None])[0] + 0.5
    qtbot.mouseDClick(chart, Qt.MouseButton.LeftButton, pos=QPoint(round(x), round(y)))


def icrs(mount, of_date):
    return unit_vectors(*from_mount_epoch(Pointing(*of_date, mount.opening.guard.epoch), mount.bench.clock()))


def test_a_double_click_sends_the_mount_there_and_the_guard_refuses_in_its_words(qtbot, opened):
    _, commands = opened
    with connected(qtbot, commands) as mount:
        chart = mount.view.room.chart
        qtbot.waitUntil(lambda: chart.catalogue is not None)
        low = icrs(mount, place(0.0, -60.0, mount.bench.clock))
        chart.look(low, 60.0)
        double_click(qtbot, chart, low)
        qtbot.waitUntil(lambda: any("the limit is" in s or "horizon" in s for s in mount.said), timeout=20_000)
        assert not mount.telescope.log, "nothing moved"
        qtbot.waitUntil(lambda: at_rest(mount))
        there = icrs(mount, place(-30.0, 35.0, mount.bench.clock))
        chart.look(there, 30.0)
        double_click(qtbot, chart, there)
        qtbot.waitUntil(lambda: any("reports that it reached" in s for s in mount.said), timeout=30_000)
        assert [e[0] for e in mount.telescope.log] == ["goto"]
        qtbot.waitUntil(lambda: at_rest(mount))
        assert separation_deg(unit_vectors(*mount.control.known.report.icrs_deg), there) < 0.5


def test_a_drag_ends_the_following_and_a_press_brings_the_mount_back(qtbot, opened):
    _, commands = opened
    with connected(qtbot, commands) as mount:
        room = mount.view.room
        mount_at = unit_vectors(*mount.control.known.report.icrs_deg)
        assert separation_deg(room.chart.centre, mount_at) < 0.2
        room.chart.zoom(2.0)
        assert not room.follow.isVisible(), "a zoom goes on following"
        room.chart.drag(QPointF(300, 300), QPointF(420, 300))
        assert room.follow.isVisible()
        turned = room.chart.centre
        reports = []
        mount.control.changed.connect(lambda: reports.append(1))
        qtbot.waitUntil(lambda: len(reports) > 2)
        assert separation_deg(room.chart.centre, turned) < 1e-9, "it stays where it was dragged"
        qtbot.keyClick(room.chart, Qt.Key.Key_0)
        assert separation_deg(room.chart.centre, room.marks.mount) < 0.2
        assert not room.follow.isVisible()


def test_a_click_on_a_star_types_its_name_and_tells_when_it_is_up(qtbot, opened):
    _, commands = opened
    with connected(qtbot, commands) as mount:
        view, chart = mount.view, mount.view.room.chart
        qtbot.waitUntil(lambda: chart.catalogue is not None)
        vega = unit_vectors(279.2347, 38.7837)
        chart.look(vega, 30.0)
        chart.grab()
        qtbot.mouseClick(chart, Qt.MouseButton.LeftButton, pos=chart.rect().center())
        assert view.go.target.text() == "Vega"
        qtbot.waitUntil(lambda: view.room.marks.target is not None)
        assert "double-click" not in view.go.about.text(), "it is of the target"
        assert separation_deg(view.room.marks.target, vega) < 0.1
        assert not mount.telescope.log


def test_the_solved_place_is_a_dot_and_the_reported_one_a_ring(qtbot, opened):
    _, commands = opened
    with connected(qtbot, commands) as mount:
        room, known = mount.view.room, mount.control.known
        solution = fake_solution(600, 400)
        mount.control._hear(SolvedPosition(solution, known.report.icrs_deg, mount.bench.clock()))
        marks = room.marks
        assert np.allclose(marks.solved, solution.centre_vector)
        assert marks.offset_text.endswith("° off")
        room.chart.look(solution.centre_vector, 20.0)
        QApplication.processEvents()
        at = flat(room.chart, solution.centre_vector[None])[0]
        assert drawn(room.chart, at, theme_colours().solved)
        room.chart.look(marks.mount, 20.0)
        ring = flat(room.chart, marks.mount[None])[0] + (0.0, -13.0)
        assert drawn(room.chart, ring, theme_colours().mount)


# -- The horizon, the meridian, and when a target is up --------------------------------------------


def astropy_altaz(vector, site, when):
    """Geometric altitude and azimuth by astropy, degrees."""
    astropy = pytest.importorskip("astropy")
    from astropy import units as u
    from astropy.coordinates import AltAz, EarthLocation, SkyCoord
    from astropy.time import Time

    assert astropy
    ra, dec = radec_deg(vector)
    where = EarthLocation(lat=site.latitude_deg * u.deg, lon=site.longitude_deg * u.deg, height=site.height_m * u.m)
    seen = SkyCoord(ra * u.deg, dec * u.deg).transform_to(AltAz(obstime=Time(when), location=where))
    return seen.alt.deg, seen.az.deg


WHEN = datetime(2026, 1, 15, 22, 0, tzinfo=UTC)
PARIS = Site(48.85, 2.35, 60.0)


def test_the_hill_lies_at_the_limits_by_astropy_and_the_meridian_is_south_and_north():
    limits = Limits(lowest_altitude_deg=10.0, horizon_deg=((80.0, 10.0), (90.0, 30.0), (100.0, 10.0)))
    local = LocalSky.at(PARIS, WHEN, limits)
    for azimuth in (0, 45, 90, 180, 300):
        altitude, seen = astropy_altaz(local.floor[azimuth], PARIS, WHEN)
        assert altitude == pytest.approx(30.0 if azimuth == 90 else 10.0, abs=0.15), "refraction is 5 arcmin there"
        assert abs((seen - azimuth + 180.0) % 360.0 - 180.0) < 0.05
    for vector in local.meridian[::20]:
        altitude, seen = astropy_altaz(vector, PARIS, WHEN)
        if altitude > 85.0:
            continue  # at the zenith every azimuth is near
        assert min(abs(seen - 180.0), seen, 360.0 - seen) < 0.5
    assert astropy_altaz(local.nadir, PARIS, WHEN)[0] < -89.9


def test_what_is_below_the_limit_is_under_the_hill_wherever_the_chart_looks(qtbot):
    chart = StarChart()
    qtbot.addWidget(chart)
    chart.resize(500, 400)
    marks = MountMarks(local=LocalSky.at(PARIS, WHEN, Limits()))
    zenith = -marks.local.nadir
    south = MountMarks.south(PARIS, WHEN)
    chart.own = marks
    ground = QColor(theme_colours().ground)
    for centre, field in (
        (zenith, 60.0),
        (zenith, 175.0),
        (south, 100.0),
        (marks.local.floor[90], 60.0),
        (-zenith, 90),
    ):
        chart.look(centre, field)
        picture = chart.grab().toImage()
        for x in range(25, 500, 90):
            for y in range(25, 400, 75):
                vector = chart.sky_at(QPointF(x, y))
                if vector @ chart.centre < 0.05:
                    continue  # beyond the hemisphere
                altitude, _ = astropy_altaz(vector, PARIS, WHEN)
                seen = picture.pixelColor(x, y)
                if abs(altitude - 5.0) > 1.0 and seen.lightness() < 30:  # no star, line or letter
                    assert (seen.green() > seen.red() + ground.green() - ground.red() - 6) is bool(altitude < 5.0), (
                        altitude, x, y, seen.getRgb(),
                    )  # fmt: skip


def test_a_marks_name_stands_where_no_other_is(qtbot):
    """ "old sky: 2.8 arcsec off" lay over the name of M 44."""
    chart = StarChart()
    qtbot.addWidget(chart)
    chart.resize(500, 400)
    picture, mark = QImage(500, 400, QImage.Format.Format_RGB32), QPointF(250.0, 200.0)
    painter = QPainter(picture)
    brush, colour = chart.brush(painter), "#ffffff"
    upper = QRectF(255.0, 175.0, 100.0, 20.0)
    for taken, side in (([], (1, -1)), ([upper], (1, 1)), ([QRectF(255.0, 150.0, 200.0, 80.0)], (-1, -1))):
        before = list(taken)
        name_mark(brush, mark, "sky: 3 off", colour, taken)
        offset = taken[-1].center() - mark
        assert (np.sign(offset.x()), np.sign(offset.y() + 4.0)) == side
        assert not any(taken[-1].intersects(other) for other in before)
    painter.end()


@pytest.mark.parametrize("radec", [(83.82, -5.39), (279.23, 38.78), (10.68, 41.27), (201.3, -11.16)])
def test_a_target_comes_to_the_meridian_and_up_when_astropy_says(radec):
    vector, limits = unit_vectors(*radec), Limits()
    told = target_tonight(vector, PARIS, WHEN, limits)
    altitude, azimuth = astropy_altaz(vector, PARIS, WHEN)
    assert told.altitude_deg == pytest.approx(altitude, abs=0.7)
    assert told.rising == (azimuth < 180.0)
    _, then = astropy_altaz(vector, PARIS, WHEN + timedelta(hours=told.meridian_h))
    assert min(abs(then - 180.0), then, 360.0 - then) < 0.3
    if altitude > 5.0:
        assert told.rises_h == 0.0
    else:
        later, _ = astropy_altaz(vector, PARIS, WHEN + timedelta(hours=told.rises_h))
        assert later == pytest.approx(5.0, abs=0.3)


def test_a_target_is_told_in_a_line():
    def line(radec, **limits):
        given = Limits(**limits)
        return tonight_text(target_tonight(unit_vectors(*radec), PARIS, WHEN, given), WHEN, given)

    assert re.fullmatch(r"altitude \d+°, rising, flips in \d+ h \d+ min", line((130.0, 20.0)))
    assert re.fullmatch(r"altitude \d+°, rising, meridian in \d+ h \d+ min", line((130.0, 20.0), crosses_meridian=True))
    assert re.fullmatch(r"altitude -?\d+°: too low, rises at \d\d:\d\d UTC", line((201.3, -11.16)))
    assert line((24.4, -57.2)) == "never above your horizon limit here"  # Achernar
    assert line((10.0, 41.0)) == "altitude 37°, setting"


# -- The camera's last frame -----------------------------------------------------------------------


@pytest.fixture
def picture(qtbot, opened):
    """That of the Mount view, whose window has a file open."""
    _, commands = opened
    commands.views.show("mount")
    view = commands.views.docks["mount"].view
    return view.camera_picture, commands.session


def taken(qtbot, session, seed):
    frame = star_field(seed=seed)
    session.show(frame, f"Camera frame {seed}")
    return frame


def solved(session, frame):
    session.answer(SolvedFrame("", frame, Detections.from_list([(1.0, 1.0)], 600, 400), fake_solution(600, 400)))


def test_an_opened_file_is_never_taken_for_what_the_camera_sees(qtbot, picture, tmp_path):
    shown, session = picture
    assert session.known.path is not None
    assert shown.shown is None
    assert shown.caption.text() == "No frame of the camera yet."
    frame = taken(qtbot, session, 3)
    qtbot.waitUntil(lambda: shown.shown is not None)
    session.open(session.known.path or tmp_path / "M31.fits")
    assert shown.shown.frame is frame


def test_names_stay_until_the_next_frame_is_solved_and_end_with_a_motion(qtbot, picture):
    shown, session = picture
    first = taken(qtbot, session, 3)
    qtbot.waitUntil(lambda: shown.shown is not None)
    solved(session, first)
    assert shown.canvas.overlay.solution is not None
    second = taken(qtbot, session, 4)
    qtbot.waitUntil(lambda: shown._next is not None and shown._next.picture is not None)
    assert shown.shown.frame is first
    assert shown.canvas.overlay.solution is not None
    assert "solving the next frame" in shown.caption.text()
    solved(session, second)
    assert shown.shown.frame is second
    shown.show_motion(has_moved=True, slews=True)
    assert shown.canvas.overlay.solution is None, "they are of where the mount was"
    assert shown.caption.text().endswith("before this slew")
    shown.show_motion(has_moved=True, slews=False)
    assert shown.caption.text().endswith("before the mount moved"), "it stands, elsewhere than in the picture"
    assert shown.canvas.overlay.solution is None


def test_the_age_is_told_and_another_mount_begins_with_none(qtbot, picture):
    shown, session = picture
    taken(qtbot, session, 3)
    qtbot.waitUntil(lambda: shown.shown is not None)
    shown.shown.at_s -= 720.0
    shown.look()
    assert shown.caption.text() == "taken 12 min ago"
    shown.forget()
    assert shown.caption.text() == "No frame of the camera yet."


def test_the_small_picture_holds_the_whole_frame():
    frame = star_field(width=1210, height=803, seed=5)
    small = reduced(frame, 300)
    assert small.shape[:2] == (160, 242)
    assert small.dtype == np.uint8
    y, x = np.unravel_index(np.argmax(frame.pixels), frame.pixels.shape)
    assert small[y // 5, x // 5].max() == small.max()


def test_the_side_folds_away_on_a_small_window_and_comes_back(qtbot, opened):
    window, commands = opened
    with connected(qtbot, commands) as mount:
        window.resize(1024, 700)
        QApplication.processEvents()
        view, dock = mount.view, commands.views.docks["mount"]
        wide = view.room.width()
        dock.side.handle.click()
        qtbot.waitUntil(lambda: dock.width() <= HANDLE_PX and view.room.width() > wide + 150, timeout=5_000)
        assert view.stop.isVisible()
        assert view.pointing.isVisible()
        assert view.go.centre.isVisible()
        assert (window.width(), window.height()) == (1024, 700)
        dock.side.handle.click()
        qtbot.waitUntil(lambda: dock.width() > 200, timeout=5_000)
        assert view.pad.isVisible()
