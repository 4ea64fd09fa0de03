"""Beside the Mount and Polar views an image that is not of now says so."""

import pytest

from kochab.window.application import build
from kochab.window.frame.picture_age import OLD_S, PictureAge, picture_words
from kochab.window.frame.session import WorkflowEngine
from kochab.workflows.session.wiring import Wiring
from tests.window.fakes import close_windows, star_field


@pytest.fixture
def commands(qtbot, settings):
    window, made = build(WorkflowEngine(), settings, [], Wiring())
    qtbot.addWidget(window)
    window.show()
    yield made
    close_windows(made)


def test_a_camera_frame_says_how_old_it_is_and_a_file_that_it_is_none(qtbot, commands, tmp_path):
    session = commands.session
    assert picture_words(session, 1e9) == ""  # no image, nothing to say
    session.show(star_field(), "Camera frame 1")
    shown = session.known.shown_at_s
    assert shown > 0.0
    assert picture_words(session, shown + OLD_S - 1.0) == ""
    assert picture_words(session, shown + 720.0) == "The image is OLD: taken 12 min ago."
    session.known.path = tmp_path / "M31.fits"
    assert picture_words(session, shown) == "The image is a file, M31.fits: not what the telescope sees now."


def test_a_stream_keeps_the_image_young_while_its_frames_come(commands):
    session = commands.session
    session.begin_stream("guide camera")
    assert picture_words(session, 1e9) == ""
    session.stream(star_field(), None, None)
    first = session.known.shown_at_s
    assert picture_words(session, first + OLD_S + 1.0).startswith("The image is OLD")


def test_the_mount_view_says_it_while_it_is_in_sight(qtbot, commands):
    commands.views.show("mount")
    view = commands.views.docks["mount"].view
    assert isinstance(view.picture, PictureAge)
    view.large.click()  # the frame in the chart's place
    commands.session.show(star_field(), "Camera frame 1")
    commands.session.known.shown_at_s -= 100.0
    view.picture.look()
    assert view.picture.words.text() == "The image is OLD: taken 2 min ago."
    assert view.picture._clock.isActive()
    assert view.picture.words.isVisible(), "in sight at once, and with no mount connected"
    assert view.picture.words.text().startswith("The image is OLD: taken ")
    commands.views.show("image")
    assert not view.picture._clock.isActive()
