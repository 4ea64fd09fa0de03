"""Centring in closed loop on the practice rig: it converges, or says honestly why it does not."""

from dataclasses import replace

import pytest

from kochab.core.errors import LineLostError, NoAnswerError, RefusedError, StoppedError
from kochab.core.mount import Ability
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason, Solution
from kochab.simulate.mechanics.axis import GearErrors
from kochab.workflows.centre_target import CentringEnd, centre_target
from kochab.workflows.centring_corrections import Course
from tests.workflows.mount_nights import SOUTH, bench, good, target_of, worn
from tests.workflows.rig_mount import SILENT


def centred(b, target, **choices):
    return run(centre_target(b.guard, b.solve_now, target, wait=b.wait, **choices))


@pytest.mark.parametrize("seed", range(4))
def test_a_lost_and_worn_mount_is_centred_within_ten_arcsec_in_three_corrections(seed) -> None:
    south = seed % 2 == 1
    b = bench(worn(seed, 1.0 if seed < 2 else -1.0, SOUTH if south else worn(0).site))
    hour = 20.0 if seed < 2 else -50.0
    target = target_of(b, hour, -10.0 if south else 50.0)
    result = centred(b, target, tolerance_arcsec=9.0, tries=3)
    assert result.centred, result
    assert len(result.corrections) <= 3
    assert b.off_arcsec(target) < 11.0
    assert result.errors_arcsec[0] > 3600.0
    assert result.synced
    assert result.corrections[0] == "sync and goto"
    assert "centred" in result.sentence


def test_five_arcsec_are_reached() -> None:
    b = bench(worn(9))
    target = target_of(b, 25.0, 30.0)
    result = centred(b, target, tolerance_arcsec=5.0, tries=6)
    assert result.centred
    assert b.off_arcsec(target) < 7.0


@pytest.mark.parametrize("tries", [1, 2, 3])
def test_so_many_corrections_are_made_and_no_more(tries) -> None:
    """Nothing ever comes within a thousandth of an arcsec."""
    b = bench(worn(9))
    result = centred(b, target_of(b, 25.0, 30.0), tolerance_arcsec=1e-3, tries=tries)
    assert result.end is CentringEnd.NOT_CONVERGING
    assert len(result.corrections) == tries
    assert f"after {tries} corrections" in result.sentence


def test_five_corrections_are_made_unless_another_number_is_given(monkeypatch) -> None:
    monkeypatch.setattr(Course, "no_better", property(lambda self: False))  # the other end of what helps no more
    b = bench(worn(9))
    result = centred(b, target_of(b, 25.0, 30.0), tolerance_arcsec=1e-3)
    assert len(result.corrections) == 5
    assert "after 5 corrections" in result.sentence


def test_every_motion_is_in_the_guards_log() -> None:
    b = bench(worn(2))
    assert centred(b, target_of(b, 25.0, 40.0), tolerance_arcsec=10.0).centred
    orders = [did[0] for did in b.mount.did]
    assert orders == [entry.action for entry in b.guard.log.sent()]
    assert not [e for e in b.guard.log.entries if e.outcome in ("refused", "failed")]
    assert not b.rig.mount.slewing


def test_a_good_mount_that_is_right_needs_no_correction() -> None:
    b = bench(good(lost_deg=0.0))
    result = centred(b, target_of(b))
    assert result.centred
    assert result.corrections == ()
    assert [did[0] for did in b.mount.did].count("goto") == 1, "the first slew, and no other"
    assert not result.synced


def test_centred_again_nothing_is_thrown_away() -> None:
    """A second centring does not first go where the mount believes the target to be."""
    b = bench(worn(2))
    target = target_of(b, 25.0, 40.0)
    assert centred(b, target, tolerance_arcsec=10.0, may_sync=True).centred
    gotos = len([did for did in b.mount.did if did[0] == "goto"])
    again = centred(b, target, tolerance_arcsec=20.0)
    assert again.centred
    assert again.corrections == ()
    assert len([did for did in b.mount.did if did[0] == "goto"]) == gotos


def test_small_errors_are_guided_away() -> None:
    b = bench(good(lost_deg=0.008))  # half an arcminute
    target = target_of(b, -40.0, 30.0)
    result = centred(b, target, tolerance_arcsec=20.0)
    assert result.centred
    if result.corrections:
        assert "goto" not in result.corrections[-1] or result.corrections[0] != "sync and goto"
    assert b.off_arcsec(target) < 22.0


def test_guide_rates_other_than_usual_are_learned() -> None:
    config = good(lost_deg=0.0)
    config = replace(config, mount=replace(config.mount, guide_rate=0.9))
    b = bench(config)
    target = target_of(b, -40.0, 30.0)
    b.rig.mount.sync(*b.rig.truth().of_date_deg)
    assert centred(b, target, tolerance_arcsec=2.0, tries=9).centred
    b.rig.mount.turn_by_hand(50.0 / 3600.0)  # in right ascension alone, so pulses correct it
    result = centred(b, target, tolerance_arcsec=4.0, tries=5)
    assert result.centred
    assert set(result.corrections) == {"small moves"}


def test_without_a_sync_an_offset_goto_does_it() -> None:
    b = bench(good(lost_deg=2.0))
    b.mount.lacks = {Ability.SYNC: "It cannot be synced."}
    target = target_of(b)
    result = centred(b, target, tolerance_arcsec=15.0)
    assert result.centred
    assert not result.synced
    assert all("sync" not in way for way in result.corrections)
    assert b.off_arcsec(target) < 17.0


def test_a_sync_that_is_not_taken_falls_back_and_says_so() -> None:
    b = bench(good(lost_deg=2.0))
    b.mount.takes_syncs = False  # answers yes and does nothing, as SynScan does
    target = target_of(b)
    result = centred(b, target, tolerance_arcsec=15.0)
    assert result.centred
    assert not result.synced
    assert any("ignored the sync" in note for note in result.notes)
    assert result.corrections[0].startswith("offset goto")


def test_a_sync_across_the_meridian_is_not_made() -> None:
    b = bench(good(lost_deg=0.0, start=(-3.0, 40.0)))
    target = target_of(b, -2.0, 30.0)
    run(b.guard.slew(*b.guard.to_mount(target.ra_deg, target.dec_deg)))
    ra, dec = b.rig.mount.believed_deg()
    b.rig.mount.sync(ra - 3.0, dec)  # believes to be west of the meridian
    b.guard.limits = replace(b.guard.limits, allow_flip=True)
    result = centred(b, target_of(b, 1.0, 30.0), tolerance_arcsec=60.0)
    assert not result.synced
    assert any("across the meridian" in note for note in result.notes)


def test_a_large_sync_needs_a_yes_and_the_largest_is_refused() -> None:
    unasked = bench(good(lost_deg=8.0))
    result = centred(unasked, target_of(unasked))
    assert result.end is CentringEnd.REFUSED
    assert "confirm it" in result.sentence
    assert not [did for did in unasked.mount.did if did[0] == "sync"]
    asked = bench(good(lost_deg=8.0))
    assert centred(asked, target_of(asked), confirmed=True).centred
    lost = bench(good(lost_deg=25.0))
    result = centred(lost, target_of(lost), confirmed=True)
    assert result.end is CentringEnd.REFUSED
    assert "--arm" in result.sentence


def test_a_target_below_the_horizon_is_refused_before_anything_moves() -> None:
    b = bench()
    result = centred(b, target_of(b, -30.0, -60.0))
    assert result.end is CentringEnd.REFUSED
    assert "the limit is 5°" in result.sentence
    assert b.mount.did == []
    assert b.solves == 0


def test_no_solution_ends_it_with_the_doctors_advice() -> None:
    b = bench()
    tries = []

    def blind():
        tries.append(1)
        return NoSolution(Reason.CLOUDED_OR_DARK, "Wait for the clouds to pass.")
        yield

    result = run(centre_target(b.guard, blind, target_of(b), wait=b.wait))
    assert result.end is CentringEnd.NO_SOLUTION
    assert result.sentence == "Clouded or dark: Wait for the clouds to pass."
    assert len(tries) == 3


def test_nothing_is_moved_by_answers_that_fit_badly() -> None:
    """A fit that ran away says any place: what the guard would not sync on is not gone by."""
    b = bench()
    tries = []

    def astray():
        found = yield from b.solve_now()
        assert isinstance(found, Solution)
        tries.append(1)
        return replace(found, rms_px=9.0)

    result = run(centre_target(b.guard, astray, target_of(b), wait=b.wait))
    assert (result.end, len(tries)) == (CentringEnd.NO_SOLUTION, 3)
    assert "residual 9 px" in result.sentence
    assert result.corrections == ()
    assert [did[0] for did in b.mount.did].count("goto") == 1, "the first slew, and no other"


def test_one_clouded_frame_does_not_end_it() -> None:
    b = bench()
    clouds = [NoSolution(Reason.CLOUDED_OR_DARK, "Wait.")]

    def see():
        if clouds:
            return clouds.pop()
        return (yield from b.solve_now())

    assert run(centre_target(b.guard, see, target_of(b), wait=b.wait)).centred


def test_a_slipping_clutch_is_named() -> None:
    config = good(lost_deg=3.0)
    wear = GearErrors(slip=0.5)
    config = replace(config, mount=replace(config.mount, hour_gear=wear, dec_gear=wear))
    b = bench(config)
    result = centred(b, target_of(b, -65.0, 10.0), confirmed=True)
    assert result.end in (CentringEnd.SLIPPING, CentringEnd.NOT_CONVERGING, CentringEnd.REFUSED)
    assert not result.centred


def test_a_telescope_that_does_not_follow_is_slipping() -> None:
    """The motors turn, the sky stays: somebody has left the clutches open."""
    b = bench(good(lost_deg=3.0))
    stuck = run(b.solve_now())
    b.mount.lacks = {Ability.SYNC: "It cannot be synced."}

    def see():
        return stuck
        yield

    result = run(centre_target(b.guard, see, target_of(b, -38.0, 30.0), wait=b.wait))
    assert result.end is CentringEnd.SLIPPING
    assert "clutch" in result.sentence


def test_what_never_comes_nearer_is_not_converging() -> None:
    b = bench(good(lost_deg=0.0))
    count = []

    def see():
        solved = yield from b.solve_now()
        count.append(1)
        b.rig.mount.turn_by_hand(0.0, 0.05)  # somebody leans on the telescope each time
        return solved

    result = run(centre_target(b.guard, see, target_of(b), 5.0, 4, may_sync=False, wait=b.wait))
    assert result.end is CentringEnd.NOT_CONVERGING
    assert len(result.corrections) <= 4


def test_cancelling_at_any_yield_stops_the_mount() -> None:
    whole = bench(good(lost_deg=1.0))
    steps = sum(1 for _ in centre_target(whole.guard, whole.solve_now, target_of(whole), wait=whole.wait))
    assert steps > 30
    for stop_after in range(1, steps, 9):
        b = bench(good(lost_deg=1.0))
        task = centre_target(b.guard, b.solve_now, target_of(b), wait=b.wait)
        for _ in range(stop_after):
            next(task)
        task.close()
        assert b.mount.did[-1] == ("stop",)
        b.wait(3.0)
        assert not b.rig.mount.slewing


def test_a_persons_stop_ends_it_for_good() -> None:
    for stage in ("slewing", "settling", "solving", "correcting"):
        b = bench(good(lost_deg=1.0))
        task = centre_target(b.guard, b.solve_now, target_of(b), wait=b.wait)

        def until_stopped(b=b, task=task, stage=stage):
            for progress in task:
                if progress.stage == stage:
                    b.guard.stop()
                    b.mount.did.append(("here",))

        with pytest.raises(StoppedError):
            until_stopped()
        after = b.mount.did[b.mount.did.index(("here",)) :]
        assert not [did for did in after if did[0] in ("goto", "pulse", "move")], stage


def test_answers_that_are_missed_are_not_motions_repeated_blindly() -> None:
    b = bench(good(lost_deg=1.0))
    b.mount.fails = {"goto": [SILENT]}  # it began, its answer was lost
    target = target_of(b)
    result = centred(b, target, tolerance_arcsec=15.0)
    assert result.centred
    orders = [did[0] for did in b.mount.did]
    assert orders[:2] == ["goto", "stop"]
    assert any("does not answer" in note for note in result.notes)


def test_a_refusal_is_looked_at_once_more_and_then_believed() -> None:
    once = bench(good(lost_deg=1.0))
    once.mount.fails = {"goto": [RefusedError("The mount refuses.")]}
    assert centred(once, target_of(once)).centred
    always = bench(good(lost_deg=1.0))
    always.mount.fails = {"goto": [RefusedError("The mount refuses.")] * 9}
    result = centred(always, target_of(always))
    assert result.end is CentringEnd.REFUSED
    assert result.sentence == "The mount refuses."
    assert len([did for did in always.mount.did if did[0] == "goto"]) == 2


def test_a_mount_that_stays_silent_is_stopped_and_said() -> None:
    b = bench()
    b.mount.fails = {"goto": [SILENT] * 9}
    with pytest.raises(NoAnswerError):
        centred(b, target_of(b))
    assert b.mount.did[-1] == ("stop",)


def test_a_line_that_breaks_says_to_cut_the_power_when_stop_cannot_be_sent() -> None:
    b = bench()
    broken = LineLostError("The line broke.")
    b.mount.fails = {"goto": [broken], "stop": [broken] * 4}
    with pytest.raises(LineLostError, match="cut its power"):
        centred(b, target_of(b))
