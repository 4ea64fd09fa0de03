"""The axis of what the files hold: solved frames, a live session, a guide log; by turn, by drift, or of no mount."""

import json
import logging
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PySide6.QtCore import QMimeData, QPointF, Qt, QUrl
from PySide6.QtGui import QDropEvent

from kochab.cli.main import main
from kochab.core.frame import Site
from kochab.core.mount import Direction, MountState
from kochab.frames.wcs import write_wcs
from kochab.gear.mount_events import PositionReport
from kochab.gear.session import CameraSelection
from kochab.polar.error import Knob, PolarError
from kochab.polar.measure import MeasureSettings, PolarFindingKind, measure
from kochab.polar.pole import Pole, pole_direction
from kochab.polar.sighting import Sighting
from kochab.polar.tutor import TutorStep
from kochab.server.phone_page import state_json
from kochab.simulate.camera_source import SimulatedCamera
from kochab.simulate.rig import PracticeRig, RigConfig, through
from kochab.workflows.polar.sources import last_night, remember_night
from kochab.workflows.polar.update import PolarButton, PolarControls, PolarUpdate, TurnInstruction
from kochab.workflows.session.alignment import (
    AlignmentRequest,
    AlignmentTools,
    FrameSource,
    _remember,
    _tutor,
    alignment_task,
)
from kochab.workflows.session.alignment_state import AlignmentState
from tests.cli.test_polar import stream
from tests.polar.test_drift import falling, log_text
from tests.polar.test_tutor import error_at
from tests.window.polar.test_view import SITE as RIG_SITE
from tests.window.polar.test_view import choose_files, drive
from tests.workflows.test_polar_solutions import BEGUN, SITE, picture, solution

HERE = "47, 8, 450"


@pytest.fixture(autouse=True)
def nights(tmp_path, monkeypatch):
    """What is remembered of other nights: nothing yet."""
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "config"))
    return tmp_path / "config" / "polar-nights.json"


def solved_frames(folder, turns=(0.0, 25.0, 50.0), image=picture, minutes=1.0):
    paths = []
    for k, turn in enumerate(turns):
        write_wcs(solution(turn), folder / f"{k}.wcs")
        image(folder / f"{k}.fits", BEGUN + timedelta(minutes=minutes * k))
        paths.append(folder / f"{k}.wcs")
    return paths


def snapshot(path, moment):
    """As a camera without a time zone dates it."""
    exif = Image.Exif()
    exif[271], exif[36867] = "Canon", moment.strftime("%Y:%m:%d %H:%M:%S")
    Image.new("L", (8, 8)).save(path.with_suffix(".jpg"), exif=exif)


def measured(view, paths, site=HERE):
    choose_files(view, paths)
    view.setup.aim.site.setText(site)
    view.begin()
    drive(view)
    return view.alignment.state


def drop(view, paths):
    mime = QMimeData()
    mime.setUrls([QUrl.fromLocalFile(str(path)) for path in paths])
    keys = Qt.KeyboardModifier.NoModifier
    event = QDropEvent(QPointF(5, 5), Qt.DropAction.CopyAction, mime, Qt.MouseButton.LeftButton, keys)
    view.dropEvent(event)


def test_a_guide_log_that_is_dropped_tells_one_bolt_and_how_long_more(polar, tmp_path):
    _, view = polar()
    log = tmp_path / "PHD2_GuideLog_2026-03-14.txt"
    log.write_text(log_text(falling(2.0), hour=-0.1, dec=10.0))
    drop(view.room, [log])
    assert view.setup.frames.chosen is FrameSource.FILES
    assert view.setup.frames.files.paths(0) == (log,)
    view.setup.aim.site.setText(HERE)
    view.begin()
    drive(view)
    assert view.alignment.state.stage == "done", view.message.text()
    assert view.alignment.state.words.startswith("Polar alignment error: at least 7.")
    assert view.alignment.state.words.endswith("from 10 minutes of drift.")
    assert view.room.number.total.text() == "–"
    assert view.room.number.age.text().startswith("Total error: at least 7.")
    altitude, azimuth = view.room.knobs[Knob.ALTITUDE], view.room.knobs[Knob.AZIMUTH]
    assert altitude.value.text().startswith("not known yet (± ")
    assert not altitude.way.text()
    assert azimuth.value.text().endswith(("′", "″"))
    assert azimuth.way.text() == "anticlockwise, seen from above"
    assert "can't tell altitude yet" in view.history.notes.text()
    assert "min more on this place" in view.history.notes.text()
    assert "not known yet" in view.page.target.accessibleDescription()
    view.bolts.show_state(view.alignment.state, 0.0)
    assert view.bolts.digits() == "–"
    assert view.alignment.state.bolt_error is None
    assert "total_arcsec" not in json.dumps(state_json(view.alignment.state, 0.0)), "nor on the phone"
    # Half an axis is no report, and nothing for another night.
    assert view.history.history is None
    assert "report" not in view.message.text()


def test_a_live_session_that_nobody_turned_gives_what_the_command_line_says_and_a_report(polar, tmp_path, capsys):
    options = ["--site=40,10,300", "--utc-offset=0", "--guided=no", "--pole=true", "--json"]
    assert main(["polar", stream(tmp_path), *options]) == 3  # nothing bears out the site and the clock that were given
    told = json.loads(capsys.readouterr().out)
    _, view = polar()
    view.setup.aim.pole.setCurrentIndex(1)
    view.setup.frames.guided.setCurrentIndex(2)
    view.setup.frames.zone.setCurrentIndex(view.setup.frames.zone.findText("UTC"))
    state = measured(view, [tmp_path / stream(tmp_path)], "40, 10, 300")
    assert state.stage == "done", view.message.text()
    assert state.error.altitude_arcsec == pytest.approx(told["altitude_error_arcsec"])
    assert state.error.azimuth_arcsec == pytest.approx(told["azimuth_error_arcsec"])
    assert [f.kind.name.lower() for f in state.findings] == [f["code"] for f in told["findings"]]
    assert view.history.history.entries[0].total_arcsec == pytest.approx(state.error.total_arcsec)
    assert "report" in view.message.text()
    assert last_night(Site(40.0, 10.0)) is not None
    guided = view.setup.frames.guided
    guided.setCurrentIndex(guided.findData(True))
    view.begin()
    drive(view)
    assert PolarFindingKind.GUIDED in [f.kind for f in view.alignment.state.findings]
    assert view.alignment.state.error is None or not view.alignment.state.drift.known


def test_all_that_is_known_stands_in_tonight(polar, tmp_path):
    _, view = polar()
    measured(view, solved_frames(tmp_path))
    assert "⚠ " in view.history.notes.text()
    assert view.alignment.state.detail == "3 frames: Solved by another program: an error of 0.2 px is assumed."


def test_a_fixed_tripod_is_told_as_one(polar, tmp_path):
    _, view = polar()
    state = measured(view, [tmp_path / stream(tmp_path, rate_deg_min=0.0)], "40, 10, 300")
    assert view.alignment.state.words == "Fixed tripod: there is no axis to align."
    assert [f.kind for f in state.findings] == [PolarFindingKind.FIXED_TRIPOD]
    assert "The camera stood still" in view.history.notes.text()
    assert view.room.number.total.text() == "–"
    assert view.history.history is None


def test_a_clock_without_a_zone_is_asked_for_and_the_files_are_measured_again(polar, tmp_path):
    _, view = polar()
    state = measured(view, solved_frames(tmp_path, image=snapshot))
    assert next(f for f in state.findings if f.kind is PolarFindingKind.CLOCK).spoils
    assert "no time zone" in view.alignment.state.words
    assert not view.room.knobs[Knob.ALTITUDE].way.text(), "no bolt by a clock that nobody knows"
    assert not (tmp_path / "config").exists()
    zone = view.page.zone
    assert zone.isVisible()
    zone.setCurrentIndex(zone.findText("UTC+2"))
    zone.activated.emit(zone.currentIndex())
    drive(view)
    assert not view.page.asks_zone.isVisible()
    assert not state.tells(Knob.ALTITUDE) or view.alignment.state.bolt_error is not None
    two = axis(tmp_path, -2.0)
    assert view.alignment.state.error.altitude_arcsec == pytest.approx(two.altitude_arcsec, abs=1.0)
    assert abs(view.alignment.state.error.altitude_arcsec - state.error.altitude_arcsec) > 60.0
    view.setup.frames.zone.setCurrentIndex(0)  # another time they are asked about again
    view.begin()
    drive(view)
    assert view.page.asks_zone.isVisible()


def axis(folder, hours):
    """The error of the same solutions at another hour, without files."""
    sightings = [
        Sighting.of(solution(25.0 * k), BEGUN + timedelta(minutes=k, hours=hours), f"{k}.wcs") for k in range(3)
    ]
    return measure(sightings, MeasureSettings(SITE)).error


def test_zones_are_those_of_the_world(polar):
    _, view = polar()
    box = view.setup.frames.zone
    assert [box.itemData(i) for i in range(3)] == [None, -12.0, -11.0]
    told = {box.itemText(i): box.itemData(i) for i in range(box.count())}
    assert (told["UTC"], told["UTC+5:45"], told["UTC−9:30"], told["UTC+14"]) == (0.0, 5.75, -9.5, 14.0)
    assert not view.page.asks_zone.isVisible()


def test_a_tripod_on_the_same_marks_begins_with_what_is_remembered(polar):
    _, view = polar()
    view.setup.frames.source.setCurrentText(FrameSource.CAMERA)
    view.setup.aim.site.setText(HERE)
    assert not view.setup.last_night.text()
    pole = pole_direction(SITE, Pole.TRUE)
    for ago, shown in ((timedelta(days=3), True), (timedelta(hours=1), False)):  # tonight's own is no guess
        night = datetime.now(UTC) - ago
        remember_night(SITE, "", night, PolarError(pole, pole, np.eye(2) * 1e-12))
        view.setup.refresh()
        told = view.setup.last_night.text()
        assert (f"Last measured here, {night:%Y-%m-%d}: 0″ too low, " in told) is shown
        assert ("stands on the same marks" in told) is shown
        view.page.show_pole(view.setup.request(), view.setup.guess)
        assert ("Last measured here" in view.page.pole.text()) is shown


def test_what_is_measured_is_remembered_and_told_another_night(polar, tmp_path, nights, caplog):
    _, view = polar()
    view.setup.frames.zone.setCurrentIndex(view.setup.frames.zone.findText("UTC"))
    state = measured(view, solved_frames(tmp_path))
    assert last_night(SITE).altitude_arcsec == pytest.approx(state.error.altitude_arcsec)
    later = json.loads(nights.read_text())
    later[0]["time_utc"] = (BEGUN - timedelta(days=3)).isoformat()
    nights.write_text(json.dumps(later))
    measured(view, [])
    assert "Last measured here" not in view.alignment.state.detail, (
        "the set-up tells it, for a site that is given there"
    )
    nights.unlink()
    nights.mkdir()  # can't be written
    with caplog.at_level(logging.WARNING):
        measured(view, [])
    assert view.alignment.state.stage == "done"
    assert "can't be kept for another night" in caplog.text


def test_practice_is_not_remembered():
    """A simulated tripod stands on no marks."""
    found = measure(
        [Sighting.of(solution(25.0 * k), BEGUN + timedelta(minutes=k), f"{k}.wcs") for k in range(3)],
        MeasureSettings(SITE),
    )
    for source in (FrameSource.PRACTICE, FrameSource.CAMERA):
        _remember(found, AlignmentRequest(source))
        assert (last_night(SITE) is not None) == (source is FrameSource.CAMERA)


def test_the_bolts_are_known_another_night(nights):
    """What stands in for a bolt in practice, and motors, are others every time."""
    off, camera = error_at(300.0, -2800.0), AlignmentRequest(FrameSource.CAMERA)
    assert _tutor(camera, SITE).advise(off).step is TutorStep.TEST
    remember_night(SITE, "", BEGUN, off, (1800.0, -2400.0))
    remember_night(SITE, "", BEGUN + timedelta(days=1), off)  # from files: no bolt was turned
    assert _tutor(camera, SITE).advise(off).step is TutorStep.TURN
    for other in (AlignmentRequest(FrameSource.PRACTICE), replace(camera, adjusters="/dev/ttyUSB0")):
        assert _tutor(other, SITE).advise(off).step is TutorStep.TEST
    kept = nights.read_text()
    for spoilt in ("[NaN, 1.0]", '["a", 1.0]', "[1.0]", "7"):
        nights.write_text(kept.replace("[1800.0, -2400.0]", spoilt))
        assert _tutor(camera, SITE).advise(off).step is TutorStep.TEST


# -- With a camera: clocks that disagree, and a frame back at the start ----------------------------


def test_the_mounts_doubts_are_found_first_while_it_is_measured(polar):
    _, view = polar()
    known = view._services.mount.known
    known.report = PositionReport((10.0, 20.0), MountState(), clock_conflict="The mount contradicts this computer.")
    view.setup.frames.source.setCurrentText(FrameSource.CAMERA)
    assert view.setup.request().mount_doubt == ""
    known.phase = "on"
    wish = replace(view.setup.request(), site=RIG_SITE, camera=CameraSelection("folder", "x", 1.0), turn_deg=40.0)
    known.phase, known.report = "off", None
    assert wish.mount_doubt == "The mount contradicts this computer."
    rig = PracticeRig(through(RigConfig(seed=5, site=RIG_SITE, start_deg=(-40.0, 45.0)), 4.0))
    camera = SimulatedCamera(rig)
    tools = AlignmentTools(PolarControls(), lambda step: None, lambda history: None, open_camera=lambda *_: camera)
    task = alignment_task(wish, tools)
    for step in task:
        if isinstance(step, TurnInstruction):
            way = 1.0 if step.direction is Direction.WEST else -1.0
            rig.mount.turn_by_hand(way * step.degrees)
        if isinstance(step, PolarUpdate) and step.measurement is not None:
            break
    task.close()
    assert step.findings[0].kind is PolarFindingKind.CLOCK
    assert step.findings[0].text == "The mount contradicts this computer."


def test_back_to_the_start_is_offered_where_creep_may_hide(polar):
    _, view = polar()
    view._enable(True)
    view.alignment.state = AlignmentState("measure", "Measuring.")
    view._show()
    assert not view.buttons.back.isVisible()
    view.alignment.state = AlignmentState("measure", "Measuring.", creep_arcsec=23.0)
    view._show()
    assert view.buttons.back.isVisible()
    assert view.history.notes.text().endswith("Optional: turn RA back to the start; checks for slip (±23″ assumed).")
    view.buttons.back.trigger()
    assert view.alignment.controls.pressed(PolarButton.BACK)
    assert "one more frame" in view.message.text()
    view._show()
    assert not view.buttons.back.isVisible()
    view._enable(False)


def test_frames_that_turned_one_way_ask_for_one_back_at_the_start(polar, tmp_path):
    _, view = polar()
    paths = solved_frames(tmp_path, turns=(0.0, 25.0, 50.0, -0.75))
    one_way = measured(view, paths[:3])
    assert one_way.creep_arcsec > 10.0
    assert f"±{one_way.creep_arcsec:.0f}″ assumed" in view.history.notes.text()
    back = measured(view, paths[3:])
    assert back.creep_arcsec == 0.0
    assert "slip" not in view.history.notes.text()


def test_a_cloudy_frame_is_left_out_and_one_of_two_is_not(polar, tmp_path):
    rows = Path(stream(tmp_path)).read_text().splitlines()
    assert sum('"solved": false' in row for row in rows) == 1
    (tmp_path / "night.json").write_text("\n".join(rows))
    few = [next(row for row in rows if f'"solved": {solved}' in row) for solved in ("false", "true")]
    (tmp_path / "few.json").write_text("\n".join(few))
    _, view = polar()
    assert measured(view, [tmp_path / "night.json"], "40, 10, 300").drift is not None
    assert view.alignment.state.detail == "1 frame: No solution, left out."
    view.setup.frames.files.clear()
    assert measured(view, [tmp_path / "few.json"], "40, 10, 300").stage == "ended"
    assert view.message.text().startswith("frame x has no solution, cloud")
    view.setup.frames.files.clear()
    assert measured(view, [tmp_path / "night.json"], "").stage == "ended"
    assert view.message.text() == "The frames have no site: fill in “Your site”."


def test_a_guide_log_is_followed_while_it_grows(qtbot, polar, tmp_path):
    _, view = polar()
    log = tmp_path / "PHD2_GuideLog_2026-03-14.txt"
    log.write_text(log_text(falling(2.0, minutes=0.5), hour=-0.1, dec=10.0))
    choose_files(view, [log])
    view.setup.aim.site.setText(HERE)
    view.setup.frames.grows.setChecked(True)
    view.begin()
    qtbot.waitUntil(lambda: "no minute of guiding" in view.alignment.state.detail)
    for least, minutes in ((2.0, 3.0), (9.0, 10.0)):
        log.write_text(log_text(falling(2.0, minutes=minutes), hour=-0.1, dec=10.0))
        qtbot.waitUntil(
            lambda least=least: view.alignment.state.drift is not None and view.alignment.state.drift.minutes > least
        )
        assert view.alignment.state.running
        assert "of drift" in view.alignment.state.detail
    assert view.buttons.done.isHidden()
    view.buttons.use_frames.trigger()
    drive(view)
    assert view.alignment.state.stage == "done"
    assert view.alignment.state.words.endswith("from 10 minutes of drift.")


def test_a_log_without_parity_shows_both_answers_until_somebody_says_which(polar, tmp_path):
    _, view = polar()
    log = tmp_path / "PHD2_GuideLog_2026-03-14.txt"
    log.write_text(log_text(falling(2.0), hour=-0.1, dec=10.0, parity="?/?"))
    view.setup.frames.source.setCurrentText(FrameSource.FILES)
    assert not view.setup.form.isRowVisible(view.setup.frames.dec_sign)
    unknown = measured(view, [log])
    assert view.setup.form.isRowVisible(view.setup.frames.dec_sign)
    assert unknown.drift.spoilt
    assert "too far east" in view.alignment.state.words
    assert "too far west" in view.alignment.state.words
    shown = " ".join(card.way.text() for card in view.room.knobs.values())
    assert "clockwise" not in shown
    view.setup.frames.dec_sign.setCurrentIndex(view.setup.frames.dec_sign.findData(-1))
    said = measured(view, [log])
    assert not said.drift.spoilt
    assert said.error.azimuth_arcsec == pytest.approx(unknown.drift.otherwise.azimuth_arcsec)
    view.setup.frames.files.clear()
    assert not view.setup.form.isRowVisible(view.setup.frames.dec_sign)
