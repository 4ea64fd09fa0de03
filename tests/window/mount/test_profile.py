"""An equipment profile chosen in the Mount view is what every view uses, and what is changed is kept in it."""

import pytest

from kochab.core.frame import Site
from kochab.gear.profiles import choose_profile, current_profile, keep_profile, load_profile, profile_path
from kochab.gear.session import CameraSelection, Meridian, MountSelection
from kochab.workflows.session.live_stream import Stream


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "config"))


@pytest.fixture
def view(make_window, engine):
    _, commands = make_window(engine)
    commands.views.show("mount")
    return commands.views.docks["mount"].view


def choose(view, name):
    view.connect_box.profile.setEditText(name)
    view.connect_box.profile.lineEdit().returnPressed.emit()


def test_a_new_name_keeps_what_is_used_now_and_another_brings_its_own(view, settings):
    keep_profile(settings, port="COM3", driver="onstep", meridian=Meridian.FLIPS)
    settings.keep_site(Site(48.0, 11.0))
    choose(view, "Newton")
    assert load_profile("Newton").mount == MountSelection("COM3", "onstep")
    assert load_profile("Newton").site == Site(48.0, 11.0)
    choose(view, "Refractor")
    keep_profile(settings, port="COM9", site=None, lowest_altitude_deg=25.0, source="folder", address="/frames")
    choose(view, "Newton")
    assert view.connect_box.chosen_port == "COM3"
    assert settings.site == Site(48.0, 11.0)
    assert view.control.kept.limits.allow_flip
    choose(view, "Refractor")
    assert (view.connect_box.chosen_port, settings.site) == ("COM9", None)
    assert view.control.kept.limits.lowest_altitude_deg == 25.0
    assert view.camera.box.selection == CameraSelection("folder", "/frames")


def test_focal_length_and_pixel_size_reach_live_and_polar_for_the_camera_of_the_profile(
    qtbot, make_window, engine, settings, tmp_path
):
    camera = {"source": "folder", "address": str(tmp_path)}
    keep_profile(settings, **camera)
    choose_profile(settings, "Newton")
    keep_profile(settings, **camera, focal_length_mm=1000.0, pixel_size_um=4.0)
    _, commands = make_window(engine)
    for name in ("live", "polar"):
        commands.views.show(name)
    live, polar = (commands.views.docks[name].view for name in ("live", "polar"))
    asked = []
    live.run = asked.append
    for view in (live.camera.box, polar.setup.frames.camera):
        view.show_selection(CameraSelection("folder", str(tmp_path)))
    live.begin()
    for hint in (asked[0].hint, polar.setup.request().hint):
        assert hint.scale_arcsec_px == pytest.approx((0.825 / 1.1, 0.825 * 1.1), rel=1e-3)
    assert Stream(asked[0], lambda *_: None).options.hint is asked[0].hint
    for view in (live.camera.box, polar.setup.frames.camera):
        view.address.setText("/another")
    live.begin()
    assert asked[1].hint is None
    assert polar.setup.request().hint is None


def test_a_damaged_profile_is_told_and_not_used(view, settings):
    choose(view, "Newton")
    choose(view, "")
    profile_path("Newton").write_text("{")
    view.message.setText("")
    choose(view, "Newton")
    assert "is damaged" in view.message.text()
    assert current_profile(settings).name == ""
