"""The parts of the Mount view that need no window: reasons, targets, offsets, wishes, the stars' way."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from PySide6.QtCore import Qt

from kochab.core.attitude import apart_deg
from kochab.core.errors import UsageError
from kochab.core.mount import Ability, Epoch, Home, MountState
from kochab.gear import actions as why
from kochab.gear.actions import MountSituation, Need, reasons_against
from kochab.gear.mounts import Diagnosis
from kochab.gear.profiles import current_profile, save_selection
from kochab.gear.session import MountSelection, search_text
from kochab.window.devices.mount_status import words_of
from kochab.window.mount.actions import SYNC_FIRST, outcome_text
from kochab.window.mount.connect_box import ConnectBox
from kochab.window.mount.controls import GoBox
from kochab.window.mount.pointing import Offset, ring_arcsec
from kochab.window.themes import theme_colours
from kochab.workflows.centre_target import Centring, CentringEnd
from kochab.workflows.goto_target import parse_target
from tests.window.fakes import no_solution

NOW = datetime(2026, 1, 15, 22, 0, tzinfo=UTC)
ON = MountSituation("on", {}, MountState(slewing=False), camera=True, solved=True, can_undo=True)


def test_everything_may_be_done_with_a_mount_that_can_and_a_camera():
    assert not any(reasons_against(ON).values())


@pytest.mark.parametrize(
    ("phase", "reason"), [("off", why.CONNECT), ("connecting", why.CONNECTING), ("lost", why.LOST)]
)
def test_without_a_line_everything_says_why(phase, reason):
    told = reasons_against(MountSituation(phase))
    stop = told.pop("stop")
    assert set(told.values()) == {reason}
    assert bool(stop) == (phase != "lost"), "a lost line must not take Stop away"


def test_what_the_mount_lacks_is_said_in_its_own_words():
    lacks = {Ability.TRACKING: "It cannot.", Ability.MOVE: "No moves.", Ability.PULSE: "No pulses."}
    told = reasons_against(MountSituation("on", lacks, MountState(), camera=True, solved=True, can_undo=True))
    assert told["track off"] == "It cannot."
    assert told["track lunar"] == ""
    assert told["nudge"] == "No moves."
    assert told["goto"] == ""
    assert reasons_against(MountSituation("on", {Ability.PULSE: "No."}, MountState()))["nudge"] == ""


def test_a_mount_that_takes_no_sync_can_still_be_corrected_by_a_slew():
    lacks = {Ability.SYNC: "It takes no sync."}
    told = reasons_against(MountSituation("on", lacks, MountState(), camera=True, solved=True, can_undo=True))
    assert told["sync"] == ""
    assert told["undo"] == "It takes no sync."
    by_hand = reasons_against(MountSituation("on", lacks, MountState(), solved=True))
    assert by_hand["sync"] == "It takes no sync.", "an open frame is no ground for a slew"
    both = lacks | {Ability.GOTO: "Nor gotos."}
    assert reasons_against(MountSituation("on", both, MountState(), camera=True))["sync"] == "It takes no sync."


def test_parked_busy_and_blind_have_their_own_reasons():
    parked = reasons_against(MountSituation("on", {}, MountState(parked=True), camera=True, solved=True))
    assert parked["goto"] == parked["nudge"] == parked["sync"] == why.PARKED
    assert parked["take_frame"] == ""
    busy = reasons_against(MountSituation("on", {}, MountState(), busy="centring", camera=True, solved=True))
    assert "centring" in busy["goto"]
    assert busy["stop"] == ""
    blind = reasons_against(MountSituation("on", {}, MountState()))
    assert blind["centre"] == blind["take_frame"] == Need.CAMERA.value
    assert blind["sync"] == Need.CAMERA_OR_SOLUTION.value
    assert blind["move_star"] == Need.SOLVED_FRAME.value
    assert blind["undo"] == Need.SYNC_TO_UNDO.value


def test_while_a_hand_turns_the_axis_only_that_axis_may_turn():
    told = reasons_against(replace(ON, by_hand=True))
    held = {name for name, reason in told.items() if reason == why.BY_HAND}
    assert held == {
        "goto",
        "centre",
        "move_star",
        "flip",
        "model",
        "sync",
        "nudge dec",
        "accept_sync",
        "park",
        "home",
        "spiral",
        why.POLAR,
    }
    assert not any(told[name] for name in ("nudge", "take_frame", "track off", "undo", "diagnose", "stop"))


@pytest.mark.parametrize(
    ("text", "ra", "dec"),
    [
        ("83.82 -5.39", 83.82, -5.39),
        ("83.82, 5.39", 83.82, 5.39),
        ("83,8 -5,4", 83.8, -5.4),
        ("5h35m17s -5d23m28s", 83.8208, -5.3911),
        ("5h35m17s, -5d23m28s", 83.8208, -5.3911),
        ("5:35:17 +5:23:28", 83.8208, 5.3911),
        ("5 35 17 −5 23 28", 83.8208, -5.3911),
        ("m42", 83.8187, -5.3897),
        ("  M  42 ", 83.8187, -5.3897),
        ("HIP 32349", 101.283, -16.725),
        ("61 Cyg", 316.76, 38.77),
        ("vega", 279.2367, 38.7858),
    ],
)
def test_targets_are_names_or_coordinates(text, ra, dec):
    target = parse_target(text, NOW)
    assert apart_deg((target.ra_deg, target.dec_deg), (ra, dec)) < 0.01


@pytest.mark.parametrize("text", ["", "  ", "no such star", "83.8", "400 10", "10 95", "1 2 3"])
def test_what_is_no_place_is_one_sentence(text):
    with pytest.raises(UsageError) as error:
        parse_target(text, NOW)
    assert str(error.value)


def test_an_offset_has_directions_and_a_ring():
    off = Offset.between((359.0, 60.0), (1.0, 61.0))
    assert off.east_deg == pytest.approx(2.0 * np.cos(np.radians(61.0)))
    assert off.north_deg == pytest.approx(1.0)
    assert off.total_deg == pytest.approx(np.hypot(off.east_deg, 1.0), rel=0.02)
    assert "east" in off.parts_text
    assert "north" in off.parts_text
    back = Offset.between((1.0, 61.0), (359.0, 60.0))
    assert "west" in back.parts_text
    assert "south" in back.parts_text
    for size in (0.0, 1e-4, 0.01, 0.2, 3.0, 170.0):
        assert ring_arcsec(size) * 1.001 >= size * 3600.0
    assert Offset(3.04, 3.0, -0.5).parts_text == "3.00° east, 30.0′ south"
    assert Offset(0.0, -0.001, 0.0).parts_text == "3.6″ west, 0.0″ north"


@pytest.mark.parametrize(
    ("end", "role"), [(CentringEnd.CENTRED, "good"), (CentringEnd.NO_SOLUTION, "wrong"), (CentringEnd.REFUSED, "wrong")]
)
def test_a_centring_is_told_and_a_large_sync_is_sent_to_its_preview(end, role):
    result = Centring(end, "The sync would shift the mount by 6.0 deg: confirm it.", to_confirm=True)
    sentence, given = outcome_text(result, None)
    assert given == role
    assert sentence.endswith(SYNC_FIRST)
    assert outcome_text(Centring(end, "So it is."), None)[0] == "So it is."


def test_results_that_need_no_words_have_none():
    assert outcome_text(None, None) == ("", "")
    assert outcome_text("Done.", None) == ("Done.", "")
    assert "trailed" in outcome_text(no_solution(), None)[0]


def test_a_wish_is_remembered(settings):
    assert current_profile(settings).mount.port == ""
    wish = MountSelection("/dev/ttyUSB3", "ioptron", 115200, Epoch.J2000)
    save_selection(settings, wish)
    assert current_profile(settings).mount == wish
    settings.keep("mount/driver", "no such")
    settings.keep("mount/baud", "often")
    assert current_profile(settings).mount == MountSelection("/dev/ttyUSB3", "lx200", None, Epoch.J2000)


@pytest.mark.parametrize(("port", "baud"), [("", "9600"), ("COM3", "fast"), ("COM3", "12")])
def test_a_wish_that_cannot_be_is_one_sentence(port, baud):
    with pytest.raises(UsageError):
        MountSelection.typed(port, "lx200", baud, "default")
    assert MountSelection.typed(" COM3 ", "lx200", "default", "default") == MountSelection("COM3")


def test_the_serial_doctor_s_words_name_the_mount_or_the_fix():
    found = Diagnosis("/dev/ttyUSB0", "nexstar", 9600, "NexStar hand control", "It is not aligned.")
    told = search_text([Diagnosis("/dev/ttyS0", advice="You may not open it."), found])
    assert told.splitlines()[0] == "You may not open it."
    assert told.splitlines()[1].startswith("NexStar hand control on /dev/ttyUSB0 at 9600 baud. It")
    assert "no serial port" in search_text([])


def test_home_is_asked_of_a_motor_board_only_and_anew_every_time(qtbot, settings):
    box = ConnectBox(None, can_practise=False)
    qtbot.addWidget(box)
    wishes = []
    box.connect_wanted.connect(wishes.append)
    box.show_selection(MountSelection("COM3", "lx200"))
    box.home.setChecked(True)
    box.connect_button.click()
    assert (box.home.isHidden(), box.home_picture.isHidden(), wishes[-1].home) == (True, True, None)
    box.show_selection(MountSelection("COM3", "skywatcher"))
    assert not box.home.isHidden()
    assert not box.home_picture.isHidden()
    image = box.home_picture.grab().toImage()
    colours = {image.pixelColor(x, y).name() for x in range(96) for y in range(96)}
    assert theme_colours().text in colours, "the mount at home is drawn"
    box.connect_button.click()
    assert wishes[-1].home is None
    box.home.setChecked(True)
    box.equatorial.setChecked(True)
    box.connect_button.click()
    assert (wishes[-1].home, wishes[-1].equatorial) == (Home.NOW, True)
    save_selection(settings, wishes[-1])
    assert current_profile(settings).mount == MountSelection("COM3", "skywatcher")
    box.connect_button.click()
    assert (wishes[-1].home, wishes[-1].equatorial) == (None, False)


def test_enter_on_a_suggestion_takes_the_name_and_only_the_next_one_slews(qtbot):
    ordered = []
    go = GoBox(ordered.append, lambda text, tolerance: None)
    go.lay_out()
    qtbot.addWidget(go)
    go.offer_names(["M 42", "M 45", "Vega"])
    go.show()
    go.activateWindow()
    go.target.setFocus()
    qtbot.waitUntil(go.target.hasFocus)
    popup = go.completer.popup()
    qtbot.keyClicks(go.target, "M 4")
    qtbot.waitUntil(popup.isVisible)
    qtbot.keyClick(popup, Qt.Key.Key_Down)
    qtbot.keyClick(popup, Qt.Key.Key_Return)
    assert (go.target.text(), popup.isVisible(), ordered) == ("M 42", False, [])
    qtbot.keyClick(go.target, Qt.Key.Key_Return)
    assert ordered == ["M 42"]
    go.target.clear()
    qtbot.keyClicks(go.target, "M 45")
    qtbot.waitUntil(popup.isVisible)
    qtbot.keyClick(popup, Qt.Key.Key_Return)  # nothing is chosen in the list: the name was typed whole
    assert ordered == ["M 42", "M 45"]


def test_what_slews_is_greyed_until_home_is_confirmed():
    now = MountSituation("on", {}, MountState(home_confirmed=False), camera=True, solved=True)
    why = reasons_against(now)
    for name in ("goto", "centre", "move_star"):
        assert "Home position not confirmed" in why[name]
    assert (why["sync"], why["nudge"], why["stop"]) == ("", "", "")
    assert "NOT CONFIRMED" in ", ".join(words_of(now.state))
