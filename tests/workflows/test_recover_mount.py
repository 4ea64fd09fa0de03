"""A lost mount is told where it is: from files or a camera, with proof, within the guard."""

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from kochab.core.attitude import unit_vectors
from kochab.core.errors import RefusedError, UsageError
from kochab.core.mount import Ability
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason, Solution
from kochab.frames.fits_write import write_fits
from kochab.simulate.rig import PracticeRig, tonight
from kochab.workflows.fresh_frame import FileFrames, NoMoreFramesError, image_files
from kochab.workflows.recover_mount import recover_mount
from kochab.workflows.sync_mount import solves_apart_arcsec
from tests.workflows.mount_nights import bench, good


def belief_arcsec(b):
    one, two = unit_vectors(*b.rig.mount.believed_deg()), unit_vectors(*b.rig.truth().of_date_deg)
    return np.degrees(np.linalg.norm(one - two)) * 3600.0


def saved(b, folder, count=1):
    """Rendered frames of where the rig points now, as files."""
    paths = []
    for k in range(count):
        paths.append(folder / f"night-{k}.fits")
        write_fits(b.rig.frame(2.0), paths[-1])
    return paths


def exposed_when_asked(b, folder, count=1):
    """Files that a camera writes after the recovery has begun, and what solves them."""
    frames = FileFrames([folder / f"night-{k}.fits" for k in range(count)])

    def solve_now():
        if not frames.used:
            b.wait(3.0)
            saved(b, folder, count)
        return (yield from frames.solve_now())

    return frames, solve_now


def test_a_mount_that_is_lost_knows_where_it_is() -> None:
    b = bench(good(lost_deg=4.0))
    done = run(recover_mount(b.guard, b.solve_now, taken=b.taken))
    assert done.synced
    assert done.preview.offset_deg == pytest.approx(4.0, abs=0.02)
    assert belief_arcsec(b) < 5.0
    assert [did[0] for did in b.mount.did] == ["sync"]
    assert np.allclose(done.after_deg, done.sky_deg, atol=0.01)


def test_one_frame_is_proved_by_its_two_halves(tmp_path) -> None:
    b = bench(good(lost_deg=3.0))
    frames, solve_now = exposed_when_asked(b, tmp_path)
    done = run(recover_mount(b.guard, solve_now, taken=lambda: frames.time_utc))
    assert done.synced
    assert len(done.evidence.centres_deg) == 2
    assert done.evidence.centres_deg[0] != done.evidence.centres_deg[1]
    assert belief_arcsec(b) < 10.0
    assert len(frames.used) == 1
    with pytest.raises(NoMoreFramesError):
        run(frames.solve_now())


def test_two_frames_of_a_folder(tmp_path) -> None:
    b = bench(good(lost_deg=3.0))
    frames, solve_now = exposed_when_asked(b, tmp_path, 2)
    done = run(recover_mount(b.guard, solve_now, taken=lambda: frames.time_utc))
    assert done.synced
    assert len(frames.used) == 2


def test_a_frame_with_nothing_on_it_is_no_recovery(tmp_path) -> None:
    b = bench(good(lost_deg=3.0))
    from kochab.core.frame import Frame

    dark = tmp_path / "dark.fits"
    noise = np.random.default_rng(1).normal(500.0, 5.0, (200, 300)).astype(np.uint16)
    write_fits(Frame(noise), dark)
    frames = FileFrames([dark])
    with pytest.raises(RefusedError, match="No two frames agree"):
        run(recover_mount(b.guard, frames.solve_now, taken=lambda: frames.time_utc))
    assert b.mount.did == []


def test_an_empty_folder_is_unusable(tmp_path) -> None:
    with pytest.raises(UsageError, match="has no images"):
        image_files([tmp_path])


def test_larger_steps_need_more_of_a_yes() -> None:
    b = bench(good(lost_deg=8.0))
    with pytest.raises(RefusedError, match="confirm it"):
        run(recover_mount(b.guard, b.solve_now, taken=b.taken))
    assert run(recover_mount(b.guard, b.solve_now, taken=b.taken, confirmed=True)).synced
    far = bench(good(lost_deg=30.0))
    with pytest.raises(RefusedError, match="--arm"):
        run(recover_mount(far.guard, far.solve_now, taken=far.taken, confirmed=True))
    assert far.mount.did == []
    assert run(recover_mount(far.guard, far.solve_now, taken=far.taken, allow_large_sync=True)).synced
    assert belief_arcsec(far) < 5.0


def test_a_look_changes_nothing() -> None:
    b = bench(good(lost_deg=2.0))
    done = run(recover_mount(b.guard, b.solve_now, taken=b.taken, only_look=True))
    assert not done.synced
    assert b.mount.did == []
    assert done.preview.offset_deg == pytest.approx(2.0, abs=0.02)


def test_a_parked_or_unwilling_mount_says_so() -> None:
    parked = bench(good(lost_deg=2.0))
    parked.rig.mount.parked = True
    parked.rig.wait_until_still(1.0)
    with pytest.raises(RefusedError, match="parked"):
        run(recover_mount(parked.guard, parked.solve_now, taken=parked.taken))
    unable = bench(good(lost_deg=2.0))
    unable.mount.lacks = {Ability.SYNC: "Its hand control is too old for a sync."}
    with pytest.raises(RefusedError, match="too old"):
        run(recover_mount(unable.guard, unable.solve_now, taken=unable.taken))
    stubborn = bench(good(lost_deg=2.0))
    stubborn.mount.takes_syncs = False
    with pytest.raises(RefusedError, match="ignored the sync"):
        run(recover_mount(stubborn.guard, stubborn.solve_now, taken=stubborn.taken))


def test_clouds_are_waited_out() -> None:
    b = bench(good(lost_deg=2.0))
    clouds = [NoSolution(Reason.CLOUDED_OR_DARK, "Wait.")] * 3

    def see():
        if clouds:
            return clouds.pop()
        return (yield from b.solve_now())

    assert run(recover_mount(b.guard, see, taken=b.taken)).synced


def test_frames_that_show_different_places_are_no_proof() -> None:
    b = bench(good(lost_deg=1.0))

    def see():
        b.rig.mount.turn_by_hand(0.2)
        return (yield from b.solve_now())

    with pytest.raises(RefusedError, match="different places"):
        run(recover_mount(b.guard, see, taken=b.taken))
    assert b.mount.did == []


@pytest.mark.parametrize("now_unix", [1795574614, 1795662441, 1796023645])
def test_both_halves_of_a_frame_are_solved(now_unix, tmp_path) -> None:
    """Of every other star of these fields no pattern agreed: five of 1,208 such halves."""
    night = replace(tonight(4, now_unix=now_unix), lost_deg=1.5, start_deg=(-30.0, 35.0), rate=0.0)
    write_fits(PracticeRig(night).frame(1.0), tmp_path / "night.fits")
    frames = FileFrames([tmp_path])
    one, other = run(frames.solve_now()), run(frames.solve_now())
    assert isinstance(one, Solution)
    assert isinstance(other, Solution)
    assert not {star.id for star in one.stars} & {star.id for star in other.stars}
    assert solves_apart_arcsec(one, other) < 2.0


def test_a_frame_from_before_needs_a_yes(tmp_path) -> None:
    """Nobody is there who could know whether the telescope has moved since."""
    b = bench(good(lost_deg=1.0))
    frames = FileFrames(saved(b, tmp_path))
    b.wait(20.0)
    with pytest.raises(RefusedError, match=r"taken 2\d s before recover began"):
        run(recover_mount(b.guard, frames.solve_now, taken=lambda: frames.time_utc))
    assert b.mount.did == []
    looked = run(recover_mount(b.guard, b.solve_now, taken=lambda: frames.time_utc, only_look=True))
    assert any("before recover began" in warning for warning in looked.warnings)
    frames = FileFrames([tmp_path])
    done = run(recover_mount(b.guard, frames.solve_now, taken=lambda: frames.time_utc, confirmed=True))
    assert done.synced
    assert any("has not moved since" in warning for warning in done.warnings)


def test_a_frame_without_a_time_is_refused_even_with_a_yes(tmp_path) -> None:
    b = bench(good(lost_deg=1.0))
    frame = b.rig.frame(2.0)
    write_fits(replace(frame, hint=replace(frame.hint, time_utc=None)), tmp_path / "undated.fits")
    for allowed in ({}, {"confirmed": True}, {"allow_large_sync": True}):
        frames = FileFrames([tmp_path])
        with pytest.raises(RefusedError, match="has no time"):
            run(recover_mount(b.guard, frames.solve_now, taken=lambda f=frames: f.time_utc, **allowed))
    assert b.mount.did == []


def test_a_frame_of_the_future_has_a_wrong_clock() -> None:
    b = bench(good(lost_deg=1.0))
    zone = timedelta(hours=1)
    with pytest.raises(RefusedError, match=r"1\.0 h in the future"):
        run(recover_mount(b.guard, b.solve_now, taken=lambda: b.taken() + zone))
    assert b.mount.did == []


def test_a_mount_that_stands_is_told_where_the_sky_is_now() -> None:
    b = bench(replace(good(lost_deg=1.0), tracking=False))
    taken = []

    def see():
        solved = yield from b.solve_now()
        taken.append(b.guard.clock() - timedelta(seconds=1.0))
        b.wait(3.0)
        return solved

    done = run(recover_mount(b.guard, see, taken=lambda: taken[-1]))
    assert any("not tracking" in warning for warning in done.warnings)
    assert belief_arcsec(b) < 10.0  # uncorrected it would be a minute of arc
