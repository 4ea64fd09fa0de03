"""What a mount does at the meridian is its owner's word: chosen in the Mount view, kept, obeyed."""

from kochab.core.mount import PierSide
from kochab.gear.profiles import KEYS, current_profile, keep_profile
from kochab.gear.session import Meridian, MountSelection, limits_at, port_opening
from tests.gear.mounts.bench import SITE, place, simulated
from tests.window.mount_bench import connected


def choose(view, meridian):
    view.meridian.setCurrentText(meridian)
    view.meridian.textActivated.emit(view.meridian.currentText())


def go_across(mount):
    """Ask for a goto across the meridian of a mount that is said to flip there."""
    mount.telescope.pier_side = PierSide.WEST
    choose(mount.view, Meridian.STAYS)
    target = place(30.0, 40.0, mount.bench.clock)
    mount.view.go.target.setText(f"{target[0]:.4f} {target[1]:.4f}")
    mount.view.go.goto.click()


def test_a_fork_that_tells_a_side_goes_across_once_it_is_said(qtbot, unpainted, settings):
    _, commands = unpainted
    with connected(qtbot, commands, "nexstar", at=None) as mount:
        go_across(mount)
        qtbot.waitUntil(lambda: any("flip" in s for s in mount.said), timeout=20_000)
        refusal = next(s for s in mount.said if "flip" in s)
        assert "Meridian" in refusal, "where to say otherwise"
        assert not mount.telescope.log
        choose(mount.view, Meridian.CROSSES)
        mount.view.go.goto.click()
        qtbot.waitUntil(lambda: any("reports that it reached" in s for s in mount.said), timeout=30_000)
        assert [e[0] for e in mount.telescope.log if e[0] == "goto"] == ["goto"]
        assert current_profile(settings).meridian is Meridian.CROSSES


def test_a_person_is_asked_before_a_flip_and_may_have_it_by_one_click(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands, "nexstar", at=None) as mount:
        go_across(mount)
        qtbot.waitUntil(lambda: mount.view.flip.isVisible(), timeout=20_000)
        assert "must flip" in mount.view.message.text()
        assert not mount.telescope.log
        qtbot.waitUntil(lambda: not mount.control.known.busy, timeout=20_000)
        mount.telescope.pier_side = PierSide.EAST  # the bench's telescope has no pier: where it will end
        mount.view.flip.click()
        qtbot.waitUntil(lambda: any("reports that it reached" in s for s in mount.said), timeout=30_000)
        assert [e[0] for e in mount.telescope.log if e[0] == "goto"] == ["goto"]
        assert not mount.view.flip.isVisible()


def test_what_was_chosen_is_in_force_from_the_first_motion_after_a_restart(qtbot, make_window, engine, settings):
    keep_profile(settings, meridian=Meridian.FLIPS)
    _, commands = make_window(engine)
    commands.views.show("mount")
    view = commands.views.docks["mount"].view
    assert view.meridian.currentText() == Meridian.FLIPS
    with simulated("nexstar") as bench:
        guard = port_opening(MountSelection(bench.port, "nexstar"), SITE, view.control.kept.limits)()
        with guard:
            assert guard.limits == limits_at(Meridian.FLIPS)
            assert guard.limits.allow_flip


def test_a_mount_is_a_german_one_until_it_is_said_otherwise(settings):
    settings.keep(KEYS["meridian"], "sideways")
    assert current_profile(settings).limits == limits_at(Meridian.STAYS)
    assert not limits_at(Meridian.STAYS).allow_flip
    assert not limits_at(Meridian.STAYS).crosses_meridian
    assert limits_at(Meridian.CROSSES).crosses_meridian
