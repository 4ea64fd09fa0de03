"""Simulated pictures: the same for the same seed, true to their stars, as noisy as was asked."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from kochab.detection import DETECTORS
from kochab.simulate.random_fields import FieldPlan, random_picture
from kochab.sky import open_catalogue

PLAN = FieldPlan(20.0, size_px=400, noise_px=0.1, missing=0.0, spurious=0.0, brightest=12)


@pytest.fixture(scope="module")
def make():
    catalogue = open_catalogue()
    return lambda plan, seed: random_picture(catalogue, np.random.default_rng(seed), plan)


def test_the_same_seed_makes_the_same_picture(make):
    one, again, other = make(PLAN, 1), make(PLAN, 1), make(PLAN, 2)
    assert np.array_equal(one.frame.pixels, again.frame.pixels)
    assert np.array_equal(one.places, again.places)
    assert not np.array_equal(one.frame.pixels, other.frame.pixels)


def test_stars_stand_where_the_catalogue_has_them(make):
    picture = make(PLAN, 3)
    catalogue = open_catalogue()
    rows = catalogue.brightest(picture.attitude.boresight, np.radians(15.0), 200)
    all_xy = picture.camera.project(catalogue.vectors(rows) @ picture.attitude.matrix.T)
    away, _ = cKDTree(all_xy[np.isfinite(all_xy).all(axis=1)]).query(picture.places)
    assert away.max() < 1e-6
    assert len(picture.places) == 12


def test_noise_moves_the_faintest_star_as_far_as_was_asked(make):
    errors = []
    for seed in range(40):
        picture = make(replace(PLAN, noise_px=0.15, magnitude_scatter=0.0), seed)
        found = DETECTORS.make().detect(picture.frame).xy
        faintest = picture.places[-1]
        nearest = found[np.argmin(np.hypot(*(found - faintest).T))]
        if np.hypot(*(nearest - faintest)) < 2.0:
            errors.append(nearest - faintest)
    assert len(errors) > 30
    assert 0.7 < np.sqrt(np.mean(np.square(errors))) / 0.15 < 1.5


def test_false_stars_are_hot_pixels_and_missing_ones_are_not_there(make):
    clean, hot = make(PLAN, 4), make(replace(PLAN, spurious=1.0), 4)
    assert np.array_equal(clean.places, hot.places)
    changed = np.sum(hot.frame.pixels.astype(int) - clean.frame.pixels > 300)
    assert 10 <= changed <= 12
    assert len(make(replace(PLAN, missing=0.9), 5).places) < 12


def test_without_noise_or_without_stars_there_is_a_picture_all_the_same(make):
    assert make(replace(PLAN, noise_px=0.0), 6).frame.pixels.shape == (400, 400)
    none = make(replace(PLAN, missing=1.0), 6)
    assert len(none.places) == 0
    assert none.frame.pixels.std() < 30
