"""A lost mount is told where it is: from files or a camera, with proof, within the guard."""

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from app.core.attitude import unit_vectors
from app.core.errors import RefusedError, UsageError
from app.core.mount import Ability
from app.core.progress import run
from app.core.solution import NoSolution, Reason
from app.frames.fits_write import write_fits
from app.workflows.recover_frames import FileFrames, NoMoreFramesError, picture_files
from app.workflows.recover_mount import recover_mount
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


def test_a_mount_that_is_lost_knows_where_it_is() -> None:
    b = bench(good(lost_deg=4.0))
    done = run(recover_mount(b.guard, b.solve_now))
    assert done.synced
    assert done.preview.offset_deg == pytest.approx(4.0, abs=0.02)
    assert belief_arcsec(b) < 5.0
    assert [did[0] for did in b.mount.did] == ["sync"]
    assert np.allclose(done.after_deg, done.sky_deg, atol=0.01)


def test_one_frame_is_proved_by_its_two_halves(tmp_path) -> None:
    b = bench(good(lost_deg=3.0))
    frames = FileFrames(saved(b, tmp_path))
    done = run(recover_mount(b.guard, frames.solve_now, taken=lambda: frames.time_utc))
    assert done.synced
    assert len(done.evidence.centres_deg) == 2
    assert done.evidence.centres_deg[0] != done.evidence.centres_deg[1]
    assert belief_arcsec(b) < 10.0
    assert len(frames.used) == 1
    with pytest.raises(NoMoreFramesError):
        run(frames.solve_now())


def test_two_frames_of_a_folder(tmp_path) -> None:
    b = bench(good(lost_deg=3.0))
    saved(b, tmp_path, 2)
    frames = FileFrames([tmp_path])
    done = run(recover_mount(b.guard, frames.solve_now, taken=lambda: frames.time_utc))
    assert done.synced
    assert len(frames.used) == 2


def test_a_frame_with_nothing_on_it_is_no_recovery(tmp_path) -> None:
    b = bench(good(lost_deg=3.0))
    from app.core.frame import Frame

    dark = tmp_path / "dark.fits"
    noise = np.random.default_rng(1).normal(500.0, 5.0, (200, 300)).astype(np.uint16)
    write_fits(Frame(noise), dark)
    frames = FileFrames([dark])
    with pytest.raises(RefusedError, match="No two frames agree"):
        run(recover_mount(b.guard, frames.solve_now, taken=lambda: frames.time_utc))
    assert b.mount.did == []


def test_an_empty_folder_is_unusable(tmp_path) -> None:
    with pytest.raises(UsageError, match="holds no pictures"):
        picture_files([tmp_path])


def test_larger_steps_need_more_of_a_yes() -> None:
    b = bench(good(lost_deg=8.0))
    with pytest.raises(RefusedError, match="confirm it"):
        run(recover_mount(b.guard, b.solve_now))
    assert run(recover_mount(b.guard, b.solve_now, confirmed=True)).synced
    far = bench(good(lost_deg=30.0))
    with pytest.raises(RefusedError, match="arm it"):
        run(recover_mount(far.guard, far.solve_now, confirmed=True))
    assert far.mount.did == []
    assert run(recover_mount(far.guard, far.solve_now, armed=True)).synced
    assert belief_arcsec(far) < 5.0


def test_a_look_changes_nothing() -> None:
    b = bench(good(lost_deg=2.0))
    done = run(recover_mount(b.guard, b.solve_now, only_look=True))
    assert not done.synced
    assert b.mount.did == []
    assert done.preview.offset_deg == pytest.approx(2.0, abs=0.02)


def test_a_parked_or_unwilling_mount_says_so() -> None:
    parked = bench(good(lost_deg=2.0))
    parked.rig.mount.parked = True
    parked.rig.wait_until_still(1.0)
    with pytest.raises(RefusedError, match="parked"):
        run(recover_mount(parked.guard, parked.solve_now))
    unable = bench(good(lost_deg=2.0))
    unable.mount.lacks = {Ability.SYNC: "Its hand control is too old for a sync."}
    with pytest.raises(RefusedError, match="too old"):
        run(recover_mount(unable.guard, unable.solve_now))
    stubborn = bench(good(lost_deg=2.0))
    stubborn.mount.takes_syncs = False
    with pytest.raises(RefusedError, match="did not take the sync"):
        run(recover_mount(stubborn.guard, stubborn.solve_now))


def test_clouds_are_waited_out() -> None:
    b = bench(good(lost_deg=2.0))
    clouds = [NoSolution(Reason.CLOUDED_OR_DARK, "Wait.")] * 3

    def see():
        if clouds:
            return clouds.pop()
        return (yield from b.solve_now())

    assert run(recover_mount(b.guard, see)).synced


def test_frames_that_show_different_places_are_no_proof() -> None:
    b = bench(good(lost_deg=1.0))

    def see():
        b.rig.mount.turn_by_hand(0.2)
        return (yield from b.solve_now())

    with pytest.raises(RefusedError, match="different places"):
        run(recover_mount(b.guard, see))
    assert b.mount.did == []


def test_a_frame_of_an_hour_ago_needs_a_yes() -> None:
    b = bench(good(lost_deg=1.0))
    then = b.guard.clock() - timedelta(hours=1)
    with pytest.raises(RefusedError, match=r"1\.0 h ago"):
        run(recover_mount(b.guard, b.solve_now, taken=lambda: then))
    done = run(recover_mount(b.guard, b.solve_now, confirmed=True, taken=lambda: then))
    assert any("1.0 h ago" in warning for warning in done.warnings)


def test_a_mount_that_stands_is_told_where_the_sky_is_now() -> None:
    b = bench(replace(good(lost_deg=1.0), tracking=False))
    taken = []

    def see():
        solved = yield from b.solve_now()
        taken.append(b.guard.clock() - timedelta(seconds=1.0))
        b.wait(3.0)
        return solved

    done = run(recover_mount(b.guard, see, taken=lambda: taken[-1]))
    assert any("does not track" in warning for warning in done.warnings)
    assert belief_arcsec(b) < 10.0  # uncorrected it would be a minute of arc
