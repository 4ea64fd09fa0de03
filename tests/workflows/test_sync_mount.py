"""Safe sync: an offer in numbers, two solves, the guard, read-back, undo, and the way round it."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from kochab.core.attitude import unit_vectors
from kochab.core.errors import RefusedError
from kochab.core.mount import Ability
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason
from kochab.workflows.sync_mount import accept_sync, offer_of, offer_sync, shifted, sync_by_hand, undo_sync
from tests.workflows.mount_nights import bench, good


def belief_arcsec(b):
    """Between where the rig believes to point and where it does."""
    one, two = unit_vectors(*b.rig.mount.believed_deg()), unit_vectors(*b.rig.truth().of_date_deg)
    return np.degrees(np.linalg.norm(one - two)) * 3600.0


def test_an_offer_tells_the_offset_and_changes_nothing() -> None:
    b = bench(good(lost_deg=1.5))
    offer = run(offer_sync(b.guard, b.solve_now))
    assert offer.preview.offset_deg == pytest.approx(1.5, abs=0.01)
    assert offer.preview.allowed
    assert b.solves == 2
    assert len(offer.evidence.centres_deg) == 2
    assert b.mount.did == []
    assert "1.50°" in offer.in_words
    assert "east" in offer.in_words or "west" in offer.in_words


def test_accepted_it_is_synced_and_read_back() -> None:
    b = bench(good(lost_deg=1.5))
    offer = run(offer_sync(b.guard, b.solve_now))
    done = run(accept_sync(b.guard, offer, wait=b.wait))
    assert done.synced
    assert belief_arcsec(b) < 5.0
    assert [did[0] for did in b.mount.did] == ["sync"]
    assert b.guard.log.entries[-1].detail["read_back_arcsec"] < 1.0


def test_undo_gives_the_old_belief_back_wherever_the_mount_has_gone() -> None:
    b = bench(good(lost_deg=1.5))
    run(accept_sync(b.guard, run(offer_sync(b.guard, b.solve_now)), wait=b.wait))
    ra, dec = b.rig.mount.believed_deg()
    run(b.guard.slew(ra - 3.0, dec + 2.0))
    told = run(undo_sync(b.guard))
    assert "1.50°" in told or "1.49°" in told
    assert belief_arcsec(b) == pytest.approx(1.5 * 3600.0, rel=0.05)
    with pytest.raises(RefusedError, match="No sync"):
        run(undo_sync(b.guard))


def test_a_large_offset_asks_for_a_yes() -> None:
    b = bench(good(lost_deg=7.0))
    offer = run(offer_sync(b.guard, b.solve_now))
    assert offer.preview.confirmations
    with pytest.raises(RefusedError, match="confirm it"):
        run(accept_sync(b.guard, offer, wait=b.wait))
    assert b.mount.did == []
    assert run(accept_sync(b.guard, offer, confirmed=True, wait=b.wait)).synced


def test_a_sync_that_the_mount_does_not_take_is_said_in_words() -> None:
    b = bench(good(lost_deg=1.5))
    b.mount.takes_syncs = False
    offer = run(offer_sync(b.guard, b.solve_now))
    done = run(accept_sync(b.guard, offer, wait=b.wait))
    assert not done.synced
    assert not done.slewed
    assert "ignored the sync" in done.sentence
    assert "goto" not in [did[0] for did in b.mount.did]


@pytest.mark.parametrize("lacks", [False, True])
def test_an_offset_slew_does_what_the_sync_could_not(lacks) -> None:
    b = bench(good(lost_deg=1.5))
    if lacks:
        b.mount.lacks = {Ability.SYNC: "The classic of classics cannot be synced."}
    b.mount.takes_syncs = False
    wanted = b.rig.mount.believed_deg()
    offer = run(offer_sync(b.guard, b.solve_now))
    done = run(accept_sync(b.guard, offer, fall_back=True, wait=b.wait))
    assert (done.synced, done.slewed) == (False, True)
    assert "slewed by the offset instead" in done.sentence
    there = unit_vectors(*b.rig.truth().of_date_deg)
    away = np.degrees(np.linalg.norm(there - unit_vectors(*wanted))) * 3600.0
    assert away < 300.0  # a mount without fault but refraction, and the way is 1.5 deg


def test_an_offer_of_another_place_is_not_accepted() -> None:
    b = bench(good(lost_deg=1.5))
    offer = run(offer_sync(b.guard, b.solve_now))
    ra, dec = b.rig.mount.believed_deg()
    run(b.guard.slew(ra - 1.0, dec))
    with pytest.raises(RefusedError, match="has moved by"):
        run(accept_sync(b.guard, offer, wait=b.wait))


@pytest.mark.parametrize("moved_deg", [0.0, 1.0])
def test_a_single_frame_is_synced_on_only_where_it_was_offered(moved_deg) -> None:
    b = bench(good(lost_deg=1.5))
    offer = offer_of(b.guard, run(b.solve_now()))
    ra, dec = b.rig.mount.believed_deg()
    if not moved_deg:
        assert run(sync_by_hand(b.guard, offer)).synced
        return
    run(b.guard.slew(ra - moved_deg, dec))
    with pytest.raises(RefusedError, match="has moved by"):
        run(sync_by_hand(b.guard, offer))
    assert "sync" not in [did[0] for did in b.mount.did]


@pytest.mark.parametrize(("moved_arcsec", "holds"), [(-45.0, True), (75.0, False), (900.0, False)])
@pytest.mark.parametrize("accept", [accept_sync, sync_by_hand])
def test_an_offer_holds_within_a_minute_of_arc_of_where_it_was_made(accept, moved_arcsec, holds) -> None:
    b = bench(good(lost_deg=1.5))
    offer = run(offer_sync(b.guard, b.solve_now))
    here = offer.mount
    b.rig.mount.goto(here.ra_deg, here.dec_deg + moved_arcsec / 3600.0)  # by its hand control
    b.rig.clock.step(10.0)
    with nullcontext() if holds else pytest.raises(RefusedError, match="has moved by"):
        run(accept(b.guard, offer))
    assert ("sync" in [did[0] for did in b.mount.did]) is holds


def test_solves_that_differ_are_no_evidence() -> None:
    b = bench(good(lost_deg=1.0))

    def drifting():
        b.rig.mount.turn_by_hand(0.1)
        return (yield from b.solve_now())

    with pytest.raises(RefusedError, match="do not agree"):
        run(offer_sync(b.guard, drifting))


def test_no_solution_is_passed_on() -> None:
    b = bench()
    nothing = NoSolution(Reason.TOO_FEW_STARS, "Expose longer.")

    def blind():
        return nothing
        yield

    assert run(offer_sync(b.guard, blind)) is nothing


def test_a_poor_solve_is_refused_by_the_guard() -> None:
    b = bench(good(lost_deg=1.0))

    def poor():
        return replace((yield from b.solve_now()), rms_px=5.0)

    offer = run(offer_sync(b.guard, poor))
    assert not offer.preview.allowed
    with pytest.raises(RefusedError, match="residual"):
        run(accept_sync(b.guard, offer, wait=b.wait))
    assert b.mount.did == []


def test_over_the_pole_a_place_comes_down_on_the_other_side() -> None:
    assert shifted((10.0, 89.0), 5.0, 2.0) == pytest.approx((195.0, 89.0))
    assert shifted((350.0, -89.5), 20.0, -1.0) == pytest.approx((190.0, -89.5))
    assert shifted((350.0, 0.0), 20.0, 1.0) == pytest.approx((10.0, 1.0))
