"""How the matches grow from star to star: which stars are asked for, how far and how near, with which weights."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kochab.attitude.fit import refine
from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera, FisheyeCamera
from kochab.core.frame import Detections
from kochab.core.solution import Identification, Matches
from kochab.solver import matches as growth
from kochab.solver.matches import catalogue_sigma_rad, centroid_sigma, extend

CAMERA = Camera.centred(1600, 1000, 7600.0)
ATTITUDE = attitude_from(84.0, -2.0, 25.0)
DIAGONAL_PX = np.hypot(1599.0, 999.0) / 2.0


class Places:
    """A catalogue whose stars are those of the given places (N, 2) px of a frame, brightest first."""

    def __init__(self, xy, camera=CAMERA, mag=6.0):
        self.places = camera.unproject(np.asarray(xy)) @ ATTITUDE.matrix
        self.mags = np.broadcast_to(np.asarray(mag, float), len(xy))
        self.asked = []

    def vectors(self, rows, _year):
        return self.places[rows]

    def mag(self, rows):
        return self.mags[rows]

    def brightest(self, vector, radius_rad, n, year):
        self.asked.append((vector, radius_rad, n, year))
        return np.arange(len(self.places))


def scattered(count, seed=3):
    """Places far enough from one another that no tolerance mixes them up."""
    rng = np.random.default_rng(seed)
    grid = np.array([(x, y) for y in range(40, 990, 45) for x in range(40, 1590, 45)], float)
    return rng.permutation(grid)[:count] + rng.uniform(-8.0, 8.0, (count, 2))


def known(xy, catalogue, chosen):
    """An identification of some stars, by their places in the list."""
    chosen = np.asarray(chosen)
    matches = Matches(chosen, chosen, np.asarray(xy)[chosen], catalogue.vectors(chosen, 2024.0))
    return Identification(matches, CAMERA, ATTITUDE, -12.0, "known")


def grown(xy, catalogue, chosen, year=2024.0, **detected):
    detections = replace(Detections.from_list(xy, 1600, 1000), **detected)
    return extend(detections, known(xy, catalogue, chosen), catalogue, year, distortion=False)


@pytest.fixture
def searches(monkeypatch):
    """How many detections each search could choose from, and its tolerance, px."""
    made = []

    def near(a, b, tolerance_px, pairs=growth.mutual_nearest):
        made.append((len(a), tolerance_px))
        return pairs(a, b, tolerance_px)

    monkeypatch.setattr(growth, "mutual_nearest", near)
    return made


@pytest.fixture
def fits(monkeypatch):
    """The matches, errors and options of every fit, with its outcome."""
    made = []

    def fit(matches, camera, attitude, sigma_px=None, **options):
        made.append((matches, sigma_px, options, refine(matches, camera, attitude, sigma_px, **options)))
        return made[-1][-1]

    monkeypatch.setattr(growth, "refine", fit)
    return made


# -- Which stars of the catalogue -----------------------------------------------------------------


def test_twice_the_detections_and_fifty_are_asked_for_in_the_circle_about_the_frame() -> None:
    """The circle through the corners is pi (w^2 + h^2) / 4 large, the frame w h; 8 % wider for a poor first fit."""
    xy = scattered(60)
    catalogue = Places(xy)
    grown(xy, catalogue, range(10))
    ((centre, radius, count, year),) = catalogue.asked
    np.testing.assert_allclose(centre, CAMERA.unproject(np.array([[799.5, 499.5]]))[0] @ ATTITUDE.matrix, atol=1e-8)
    assert radius == pytest.approx(1.08 * np.arctan(DIAGONAL_PX / 7600.0), rel=1e-6)
    assert count == int(170 * np.pi / 4.0 * (1600**2 + 1000**2) / (1600 * 1000))
    assert year == 2024.0


@pytest.mark.parametrize(
    ("fwhm_px", "apart_px", "seen"),
    [(np.nan, 1.9, 1), (np.nan, 2.1, 2), (1.0, 2.1, 2), (5.0, 4.9, 1), (5.0, 5.1, 2), (15.0, 9.9, 1), (15.0, 10.1, 2)],
)
def test_a_companion_within_the_width_of_a_star_has_no_image_of_its_own(fwhm_px, apart_px, seen) -> None:
    """The width counts from 2 to 10 px; without one it is 2 px."""
    xy = scattered(40)
    pair = np.concatenate([xy, np.add(xy[:1], [apart_px, 0.0])])
    catalogue = Places(pair, mag=np.append(np.full(40, 6.0), 8.0))
    matches, _ = grown(pair, catalogue, range(1, 20), fwhm_px=np.full(41, fwhm_px))
    assert np.isin([0, 40], matches.star).sum() == seen
    assert len(matches) == 39 + seen


def test_of_two_stars_in_one_image_the_brighter_counts_whatever_its_row() -> None:
    xy = scattered(40)
    catalogue = Places(np.concatenate([xy, np.add(xy[:1], [1.0, 0.0])]), mag=np.append(np.full(40, 6.0), 2.0))
    matches, _ = grown(np.concatenate([np.add(xy[:1], [1.0, 0.0]), xy[1:]]), catalogue, range(1, 20))
    assert 40 in matches.star
    assert 0 not in matches.star


# -- How far and how near ---------------------------------------------------------------------------


def test_each_search_reaches_two_fifths_farther_until_the_frame_is_held(searches) -> None:
    """From the farthest known star about their mean; it ends when all is within reach and hardly anything is new."""
    xy = scattered(300)
    near = np.flatnonzero(np.hypot(*(xy - [800.0, 500.0]).T) < 180.0)
    grown(xy, Places(xy), near)
    origin = xy[near].mean(axis=0)
    distance = np.hypot(*(xy - origin).T)
    start = distance[near].max()
    needed = int(np.ceil(np.log(distance.max() / start) / np.log(1.4)))
    inside = [int((distance <= start * 1.4**k).sum()) for k in range(1, needed + 1)]
    assert inside[-1] == 300
    last_grew = inside[-1] > 1.03 * inside[-2]
    assert [count for count, _ in searches] == inside + [300] * last_grew


@pytest.mark.parametrize(("noise_px", "count"), [(0.0, 300), (0.8, 60), (1.2, 60), (0.8, 300), (3.5, 12)])
def test_a_match_is_taken_from_four_times_the_residuals_and_a_fifth_of_the_spacing(
    searches, fits, noise_px, count
) -> None:
    """One pixel at least, eight at most."""
    xy = scattered(count)
    moved = xy + np.random.default_rng(5).normal(0.0, noise_px, xy.shape)
    grown(moved, Places(xy), range(count))
    spacing = np.sqrt(1600 * 1000 / count)
    rms = fits[0][-1].rms_px
    assert rms == pytest.approx(noise_px * np.sqrt(2.0), abs=0.35 * noise_px + 1e-6)
    assert searches[0][1] == pytest.approx(max(1.0, min(4.0 * rms, 8.0, 0.2 * spacing)))


@pytest.mark.parametrize(
    ("told", "found", "kept"), [(12, 6, True), (12, 5, False), (6, 4, True), (6, 3, False), (7, 3, False)]
)
def test_a_search_that_loses_half_of_what_was_known_does_not_count(monkeypatch, fits, told, found, kept) -> None:
    """Half of the known stars, and four, must be found again; else they stay as they are, equally certain."""

    def few(a, b, tolerance_px, pairs=growth.mutual_nearest):
        i, j = pairs(a, b, tolerance_px)
        return i[:found], j[:found]

    monkeypatch.setattr(growth, "mutual_nearest", few)
    xy = scattered(30)
    grown(xy, Places(xy), range(told))
    matches, sigma, *_ = fits[-1]
    assert len(matches) == (found if kept else told)
    assert (sigma is not None) is kept


# -- With which weights -------------------------------------------------------------------------------


@pytest.mark.parametrize(("stars", "some"), [(90, 90), (199, 199), (200, 100), (350, 117)])
def test_a_hundred_stars_place_the_others_and_all_of_them_count_in_the_end(fits, stars, some) -> None:
    """Bright and faint alike: of 350 stars every third."""
    xy = scattered(stars)
    grown(xy, Places(xy), range(stars))
    counts = [len(matches) for matches, *_ in fits]
    assert counts[-1] == stars
    assert set(counts[1:-1]) <= {some}
    assert [options.get("rounds") for _, _, options, _ in fits] == [1] * (len(fits) - 1) + [None]


def test_of_few_stars_all_place_the_others(fits) -> None:
    """Those known at first are the bright half."""
    xy = scattered(90)
    grown(xy, Places(xy), range(45))
    assert 90 in [len(matches) for matches, *_ in fits][1:-1]


def test_the_last_fit_knows_the_errors_of_centroids_and_catalogue(fits) -> None:
    """Faint Tycho-2 stars a century after their epoch are off by a quarter of an arcsecond."""
    xy = scattered(60)
    snr = np.linspace(5.0, 80.0, 60)
    catalogue = Places(xy, mag=np.linspace(6.0, 12.0, 60))
    grown(xy, catalogue, range(20), 2091.25, snr=snr, fwhm_px=np.full(60, 3.0))
    matches, sigma, options, _ = fits[-1]
    own = np.hypot(0.15, 1.5 / snr[matches.detection])
    catalogue_px = 7600.0 * catalogue_sigma_rad(catalogue.mags[matches.star], 2091.25)
    np.testing.assert_allclose(sigma, np.hypot(own, catalogue_px), rtol=1e-6)
    assert options["floor_px"] == pytest.approx(np.median(catalogue_px), rel=1e-6)


@pytest.mark.parametrize(
    ("mag", "place", "motion"),
    [
        (7.9, 0.001, 0.001),
        (8.1, 0.007, 0.0025),
        (9.0, 0.007, 0.0025),
        (10.5, np.sqrt(0.007 * 0.06), 0.0025),
        (12.0, 0.06, 0.0025),
        (14.0, 0.06, 0.0025),
    ],
)
def test_a_catalogue_is_as_good_as_its_places_and_its_motions(mag, place, motion) -> None:
    """Hipparcos to V 8; Tycho-2 7 mas to V 9 and, by equal ratios, 60 mas at V 12 and beyond, at 1991.25."""
    for years in (0.0, 20.0, -30.0):
        sigma = np.degrees(catalogue_sigma_rad(np.array([mag]), 1991.25 + years)[0]) * 3600.0
        assert sigma == pytest.approx(np.hypot(place, motion * years))


def test_the_errors_of_centroids_are_those_of_the_fit(fits) -> None:
    """Every fit on the way knows which stars are faint, except the first, of the identification's stars."""
    xy = scattered(50)
    snr = np.linspace(3.0, 60.0, 50)
    grown(xy, Places(xy), range(20), snr=snr, fwhm_px=np.full(50, 3.0))
    sigma = centroid_sigma(replace(Detections.from_list(xy, 1600, 1000), snr=snr, fwhm_px=np.full(50, 3.0)))
    (_, first, *_), *others, _ = fits
    assert first is None
    assert others
    for matches, given, *_ in others:
        np.testing.assert_array_equal(given, sigma[matches.detection])


def test_no_more_than_half_the_sky_is_asked_for() -> None:
    """A lens of a millimetre, and one whose axis is off the middle: corners are farther than a quarter turn."""
    xy = scattered(60)
    wide = Camera.centred(1600, 1000, 100.0)
    catalogue = Places(xy, camera=wide)
    chosen = np.arange(30)
    matches = Matches(chosen, chosen, xy[:30], catalogue.places[:30])
    extend(
        Detections.from_list(xy, 1600, 1000), Identification(matches, wide, ATTITUDE, -12.0, "known"), catalogue, 2024.0
    )
    assert catalogue.asked[0][1] == pytest.approx(np.pi / 2.0)


@pytest.mark.parametrize(
    ("stars", "rms_px", "fisheye"),
    [
        (100, 0.5, True),  # much closer, and as many
        (98, 0.5, True),
        (95, 0.5, False),  # closer, of fewer stars
        (100, 0.8, False),  # hardly closer
        (104, 0.9, True),  # more stars, a little closer
        (104, 1.02, True),  # and hardly worse
        (104, 1.05, False),
        (102, 0.9, False),  # hardly more
        (40, 0.1, False),  # a few stars that fit well by themselves
    ],
)
def test_a_wide_frame_is_a_fisheyes_where_that_holds_more_stars_or_holds_them_closer(
    monkeypatch, stars, rms_px, fisheye
) -> None:
    """Beside 100 stars at 1 px of a lens without distortion, on a frame of 120 deg."""
    plain = Camera.centred(1000, 1000, 500.0 / np.tan(np.radians(60.0)))
    empty = Matches(np.arange(8), np.arange(8), np.zeros((8, 2)), np.zeros((8, 3)))
    found = Identification(empty, plain, attitude_from(0.0, 0.0, 0.0), -30.0, "test")

    def grow(found):
        is_fisheye = isinstance(found.camera, FisheyeCamera)
        return range(stars if is_fisheye else 100), SimpleNamespace(
            camera=found.camera, rms_px=rms_px if is_fisheye else 1.0
        )

    monkeypatch.setattr(growth, "fitted_anew", lambda matches, camera: SimpleNamespace(camera=camera, attitude=None))
    matches, fit = growth.behind_its_lens(grow, found)
    assert isinstance(fit.camera, FisheyeCamera) is fisheye
    assert len(matches) == (stars if fisheye else 100)
