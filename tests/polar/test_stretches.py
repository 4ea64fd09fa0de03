"""Light frames of a mount that flipped, was knocked or put elsewhere a little: under erfa's sky, solved from stars."""

from dataclasses import replace

import numpy as np
import pytest

from kochab.core.frame import Site
from kochab.lab.bench import polar_sweeps as sky
from kochab.lab.bench.polar_faults import judge, reported_axis, solved_files, true_axis
from kochab.polar.drift import Drift, Stretch, measure_drift, mountings_of, stretches_of, tracked
from kochab.polar.error import CHI2_95
from kochab.polar.measure import MeasureSettings, PolarFindingKind
from kochab.polar.pole import Pole
from kochab.sky.horizon import Refraction
from kochab.workflows.polar.sources import sightings_of
from tests.polar.mounts import Mount


def lights(seed, guided=False, frames=2):
    """Frames of one target over an hour and a quarter."""
    rng = np.random.default_rng([77, seed])
    while (sweep := sky.tracked(sky.random_sweep(rng, frames), rng, 75.0, guided)).lowest_deg() < 25.0:
        pass
    return sweep, rng


def parts(sweep, rng):
    files = solved_files(sweep, rng)
    sightings = sightings_of(files, [0] * len(files))
    assert tracked(sightings)
    place = sweep.place
    return stretches_of(sightings, MeasureSettings(Site(place.latitude_deg, place.longitude_deg, place.height_m)), None)


def kinds(told):
    return {finding.kind for finding in told.findings}


@pytest.mark.parametrize("guided", [False, True])
@pytest.mark.parametrize("change", [sky.with_flip, sky.with_camera_turned])
def test_a_flip_or_a_turned_camera_begins_a_new_stretch(change, guided):
    for seed in range(3):
        sweep, rng = lights(seed, guided)
        parted = parts(change(sweep, rng, first=3), rng)
        assert [len(part.attitudes) for part in parted] == [3, len(sweep.exposures) - 3]
        assert all(part.knock is None for part in parted), "nothing moved the axis"


@pytest.mark.parametrize("guided", [False, True])
def test_light_frames_with_a_flip_among_them_give_no_axis_far_away(guided):
    """39.44 deg with an uncertainty of 64 arcsec, raise the axis by 31.87 deg, it said."""
    for seed in range(4):
        sweep, rng = lights(seed, guided)
        flipped = sky.with_flip(sweep, rng, first=4, centred=guided)
        told = reported_axis(flipped, rng).result
        assert isinstance(told, Drift), "it is no sweep"
        assert told.error.with_systematics.distance2(true_axis(flipped, told.error.pole)) <= CHI2_95 or told.spoilt


@pytest.mark.parametrize(
    ("kind", "seeds"),
    [("healthy, guided", (2037, 2076, 2080, 2095, 2103)), ("flip, guided", (2031, 2079, 2093, 2098, 2141))],
)
def test_a_camera_askew_to_its_dec_axis_leaves_the_truth_inside_near_the_pole(kind, seeds):
    """Half a degree askew and 8 deg from the pole, a guider's way in Dec turns the field by a fifteenth of itself."""
    for seed in seeds:
        assert judge(kind, seed)["inside"], (kind, seed)


def test_a_flip_looks_askew_to_the_other_side_and_a_camera_taken_in_hand_sits_anew():
    assert mountings_of([np.eye(3)[0]] * 3) == [(0, 1.0)] * 3
    flipped, turned = -np.eye(3)[0], np.eye(3)[1]
    assert mountings_of([np.eye(3)[0], flipped, -flipped]) == [(0, 1.0), (0, -1.0), (0, 1.0)]
    assert mountings_of([np.eye(3)[0], turned, -turned]) == [(0, 1.0), (1, 1.0), (1, -1.0)]


@pytest.mark.parametrize(("off_deg", "far"), [(8.0, False), (13.0, True)])
def test_a_drift_that_lands_degrees_away_is_doubted_as_a_sweep_is(off_deg, far):
    mount = Mount(40.0, d_alt=off_deg * 3600.0, sigma=0.5, sigma_roll=2.0)
    seen = tuple(mount.see(-15.0 * np.linspace(0.0, 1.5, 40), np.random.default_rng(4), seconds=1.5 * 3590.17 / 39.0))
    told = measure_drift([Stretch(seen)], MeasureSettings(mount.site, Pole.TRUE, Refraction(0.0)))
    assert told.error.total_arcsec / 3600.0 == pytest.approx(off_deg, abs=0.3)
    assert told.spoilt is far
    assert (PolarFindingKind.FAR in kinds(told)) is far


@pytest.mark.parametrize("guided", [False, True])
def test_a_knocked_tripod_among_light_frames_spoils_them(guided):
    for seed in range(3):
        sweep, rng = lights(seed, guided)
        told = reported_axis(sky.with_kick(sweep, rng, arcmin=30.0, first=3), rng).result
        assert told.spoilt
        assert "the tripod, a bolt or the camera moved" in " ".join(finding.text for finding in told.findings)


def test_a_target_put_back_into_the_middle_is_no_knock():
    """Both motors move by minutes of arc, which near the pole rolls the field by more."""
    for seed in range(6):
        sweep, rng = lights(seed)
        by = np.radians(rng.uniform(-12.0, 12.0, 2) / 60.0)
        moved = tuple(
            replace(shot, ra_turn=shot.ra_turn + by[0], dec_turn=shot.dec_turn + by[1]) if k >= 3 else shot
            for k, shot in enumerate(sweep.exposures)
        )
        told = reported_axis(replace(sweep, exposures=moved), rng).result
        assert PolarFindingKind.MOUNT_MOVED not in kinds(told)
