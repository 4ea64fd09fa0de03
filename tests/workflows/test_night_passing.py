"""What crosses a night's frames and stands among their stars: named by elements, told when unknown, not invented."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from astropy.time import Time

from kochab.core.attitude import unit_vectors
from kochab.workflows.night.crossings import Crossing, CrossingKind, _fades, _flashes, not_repeated
from kochab.workflows.night.events import words_of
from kochab.workflows.night.strangers import Sight, Sights, StrangerKind, strangers_of

START = datetime(2026, 1, 1, 20, tzinfo=UTC)
SCALE = 2.0  # arcsec a pixel
NOTHING = Sights((), (), ())


def sight(x, y, mag=8.0, sigma=0.8, rng=None):
    """A detection at a place of the sensor, in a field about RA 30, Dec 40 that does not move."""
    if rng is not None:
        x, y = x + rng.normal(0, sigma / SCALE), y + rng.normal(0, sigma / SCALE)
    return Sight(x, y, 30.0 - x * SCALE / 3600 / np.cos(np.radians(40.0)), 40.0 - y * SCALE / 3600, sigma, mag, 0.1)


def night(frames, minutes=2.0):
    return [Sights((), (), tuple(one)) for one in frames], [START + timedelta(minutes=minutes * k) for k in range(len(frames))]  # fmt: skip


@pytest.mark.parametrize("seed", range(8))
def test_chance_detections_make_neither_a_star_nor_a_body(seed):
    """Cosmic rays: up to five a frame, anywhere."""
    rng = np.random.default_rng(seed)
    frames = [[sight(*rng.uniform(0, 2000, 2)) for _ in range(rng.integers(0, 6))] for _ in range(20)]
    assert strangers_of(*night(frames)) == ()


def test_a_new_star_and_a_body_are_told_with_place_rate_and_chance_among_cosmic_rays():
    rng = np.random.default_rng(3)
    frames = []
    for k in range(16):
        rays = [sight(*rng.uniform(0, 2000, 2)) for _ in range(3)]
        seen = [sight(700, 900, rng=rng), sight(200 + 9.0 * k, 1200 - 4.0 * k, 9.0, rng=rng)]
        frames.append(rays + (seen if k not in (4, 9) else seen[:1]))
    star, body = sorted(strangers_of(*night(frames)), key=lambda one: one.mag.value)
    assert (star.kind, body.kind) == (StrangerKind.NEW_STAR, StrangerKind.UNKNOWN_BODY)
    assert (len(star.frames), len(body.frames)) == (16, 14)
    assert star.log10_chance < -20
    # x is west: 9 px of 2 arcsec in two minutes
    for rate, true in zip(body.rate_arcsec_h, (-9.0 * SCALE * 30, 4.0 * SCALE * 30), strict=True):
        assert rate.value == pytest.approx(true, abs=4 * rate.sigma)
    assert max(rate.sigma for rate in body.rate_arcsec_h) < 5
    first = unit_vectors(star.sights[0].ra_deg, star.sights[0].dec_deg)
    true = sight(700, 900)
    off = np.degrees(np.linalg.norm(first - unit_vectors(true.ra_deg, true.dec_deg))) * 3600
    assert off < 4 * star.sigma_arcsec


def test_a_hot_pixel_under_a_drifting_field_is_no_body_and_three_sights_are_none():
    """The field drifts by 5 px a frame; the pixel stays, so that it moves among the stars."""
    frames = []
    for k in range(12):
        moved = sight(500 + 5.0 * k, 500.0)
        frames.append([replace(moved, x=500.0, y=500.0)])
    assert strangers_of(*night(frames)) == ()
    assert strangers_of(*night([[sight(300, 300)]] * 3 + [[]] * 9)) == ()


def test_a_body_is_told_with_how_far_it_is_from_its_elements_and_not_where_it_is_hardly_seen():
    rng = np.random.default_rng(5)
    frames = []
    for k in range(10):
        at = sight(400 + 3.0 * k, 300.0, rng=rng)
        seen = replace(at, name="4 Vesta", kind="asteroid", off_arcsec=(1.5 + rng.normal(0, 0.8), rng.normal(0, 0.8)))
        frames.append(Sights((seen,), ("4 Vesta",), ()))
    times = [START + timedelta(minutes=5 * k) for k in range(10)]
    (vesta,) = strangers_of(frames, times)
    assert vesta.name == "4 Vesta"
    assert vesta.off_arcsec.value == pytest.approx(1.5, abs=4 * vesta.off_arcsec.sigma)
    assert vesta.rate_arcsec_h[0].value == pytest.approx(-3.0 * SCALE * 12, abs=4 * vesta.rate_arcsec_h[0].sigma)
    hardly = [frames[0], *[Sights((), ("4 Vesta",), ())] * 9]
    assert strangers_of(hardly, times) == ()
    assert strangers_of([None, NOTHING], times[:2]) == ()


def streak(ends_px, ra=30.0, kind=CrossingKind.UNLISTED, name=""):
    ends = tuple((ra + x / 1000, 20.0 + y / 1000) for x, y in ends_px)
    return Crossing(kind, name, ends, ends_px, 1.0, 0.5, 30.0, True, 12.0, 0.01)


def test_what_returns_at_a_place_of_the_sensor_or_of_the_sky_is_no_crossing():
    wire = [streak(((0.0, 10.0), (900.0, 400.0)), ra=30.0 + k) for k in range(3)]
    galaxy = [streak(((100.0 + 40 * k, 50.0), (160.0 + 40 * k, 90.0)), ra=50.0 - 0.04 * k) for k in range(3)]
    satellite = streak(((0.0, 700.0), (1000.0, 30.0)), ra=80.0)
    kept = not_repeated([(wire[0], galaxy[0]), (wire[1], galaxy[1], satellite), (wire[2], galaxy[2])], 1000)
    assert kept == [(), (satellite,), ()]


def over_ground(hour_deg, dec_deg, minutes, width=4.0):
    """What stands at hour angles and declinations, (2,) each, cut where a tracked field of so many degrees ends.

    By astropy's sidereal time; the field follows RA 80, Dec 5.
    """
    time = START + timedelta(minutes=minutes)
    lst = Time(time).sidereal_time("apparent", longitude=0.0).deg
    part = np.linspace(0.0, 1.0, 2001)
    ra = lst - (hour_deg[0] + part * (hour_deg[1] - hour_deg[0]))
    dec = dec_deg[0] + part * (dec_deg[1] - dec_deg[0])
    x, y = 125.0 * width + 250.0 * np.stack([-((ra - 80.0 + 180.0) % 360.0 - 180.0), 5.0 - dec])
    seen = np.flatnonzero((np.abs(x - 500.0) < 500.0) & (np.abs(y - 500.0) < 500.0))
    if len(seen) < 20:
        return ()
    ends = [seen[0], seen[-1]]
    px = tuple((float(x[k]), float(y[k])) for k in ends)
    length = float(np.hypot(*np.subtract(*px))) / 250.0
    sky = tuple((float(ra[k] % 360.0), float(dec[k])) for k in ends)
    whole = bool(seen[0] == 0 and seen[-1] == 2000)
    return (Crossing(CrossingKind.UNLISTED, "", sky, px, length, 0.5, 30.0, whole),)


def test_a_mast_and_a_cable_that_the_field_turns_past_are_no_crossings_and_what_flies_is():
    lst = Time(START).sidereal_time("apparent", longitude=0.0).deg
    mast, cable = ((lst - 80.5, lst - 80.3), (1.0, 9.0)), ((lst - 90.0, lst - 70.0), (4.0, 5.2))
    minutes = [0.0, 2.0, 4.0, 6.0]
    times = [START + timedelta(minutes=m) for m in minutes]
    frames = [over_ground(*mast, m) + over_ground(*cable, m) for m in minutes]
    assert [len(one) for one in frames] == [2, 2, 2, 2]
    satellites = [streak(((0.0, 700.0 - 90.0 * k), (1000.0, 30.0 + 200.0 * k)), ra=79.5) for k in range(4)]
    both = [(*one, satellite) for one, satellite in zip(frames, satellites, strict=True)]
    assert not_repeated(both, 1000, times, [60.0] * 4) == [(one,) for one in satellites]
    assert not_repeated(frames, 1000) == frames, "without times nobody knows"


def test_what_stands_over_the_equator_and_what_is_named_stays():
    lst = Time(START).sidereal_time("apparent", longitude=0.0).deg
    minutes = [0.0, 2.0, 4.0]
    times = [START + timedelta(minutes=m) for m in minutes]
    fixed = [over_ground((lst - 80.0, lst - 79.75), (4.0, 4.0), m) for m in minutes]
    assert [one[0].whole for one in fixed] == [True] * 3
    assert not_repeated(fixed, 1000, times, [60.0] * 3) == fixed
    assert not_repeated(fixed, 1000, times, [2.0] * 3) == [()] * 3, "too long a trail for it"
    train = [(streak(((0.0, 10.0), (900.0, 400.0)), kind=CrossingKind.SATELLITE, name="STARLINK-1"),)] * 3
    assert not_repeated(train, 1000) == train


def test_strobes_come_evenly_and_stars_on_a_streak_do_not():
    even = np.full(90, 10.0)
    even[8::16] = 80.0
    assert _flashes(even)
    stars = np.full(90, 10.0)
    stars[[3, 9, 50, 57, 58, 81]] = 80.0
    assert not _flashes(stars)
    assert not _flashes(np.full(90, 10.0))
    share = (np.arange(80) + 0.5) / 80
    assert _fades(100 * share**2 * (1 - share) + 0.2)
    assert not _fades(np.full(80, 10.0))


def test_light_fades_alike_whichever_way_it_flew_and_though_a_star_lies_on_it():
    share = (np.arange(80) + 0.5) / 80
    faded, same = [], 0
    for sharpness in np.linspace(0.02, 1.5, 60):
        light = 100.0 * (share * (1.0 - share)) ** sharpness + 0.2
        light[30:] += 5.0 * share[30:] ** 2
        assert _fades(light) is _fades(light[::-1])
        star = light.copy()
        star[[1, 40, 78]] += 300.0
        same += _fades(star) is _fades(light)
        faded.append(_fades(light))
    assert faded == sorted(faded), "the sharper, the more it fades"
    assert set(faded) == {True, False}
    assert same >= 55  # of 60: near the limit a star decides


def test_each_kind_has_words():
    said = {kind: words_of(streak(((0.0, 0.0), (9.0, 9.0)), kind=kind, name="ISS")) for kind in CrossingKind}
    assert "ISS crossed, 12.0″" in said[CrossingKind.SATELLITE]
    assert "candidate" in said[CrossingKind.METEOR]
    assert len(set(said.values())) == 4
