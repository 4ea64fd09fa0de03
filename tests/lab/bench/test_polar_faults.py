"""The evenings of the bench: a sky that is erfa's, mounts that are geometry, and scores that cannot flatter."""

from dataclasses import replace

import erfa
import numpy as np
import pytest

from kochab.core.attitude import ARCSEC
from kochab.lab.bench import polar_faults as bench
from kochab.lab.bench import polar_sweeps as sky

PLACE = sky.Place(48.0, 11.0, 500.0, 950.0, 8.0)
WHEN = sky.dt.datetime(2025, 2, 3, 21, 0, tzinfo=sky.dt.UTC)


def test_what_is_observed_and_the_catalogue_are_each_others_way_back():
    rng = np.random.default_rng(1)
    enu = rng.normal(size=(50, 3))
    enu[:, 2] = np.abs(enu[:, 2]) + 0.5
    enu /= np.linalg.norm(enu, axis=1, keepdims=True)
    back = sky.observed_places(sky.catalogue_places(enu, WHEN, PLACE), WHEN, PLACE)
    assert np.abs(back - enu).max() < 0.05 * ARCSEC


def test_the_refracted_pole_is_erfas():
    """erfa.apio and atioq on the pole itself, against Bennett's formula."""
    context = erfa.apio(0, 0, 0, np.radians(48.0), 500.0, 0, 0, *erfa.refco(950.0, 8.0, 0.5, 0.55))
    _, zenith_distance, *_ = erfa.atioq(0.0, np.pi / 2, context)
    assert np.arcsin(sky.refracted_pole(PLACE)[2]) == pytest.approx(np.pi / 2 - zenith_distance, abs=2.0 * ARCSEC)


def test_a_mount_turns_about_its_axis_and_a_kick_moves_the_axis_alone():
    rng = np.random.default_rng(3)
    sweep = sky.random_sweep(rng, 6)
    seen = [shot.attitude.T @ shot.mount.axis for shot in sweep.exposures]
    assert np.ptp(seen, axis=0).max() < 1e-12
    kicked = sky.with_kick(sweep, rng, arcmin=20.0, first=3)
    seen = [shot.attitude.T @ shot.mount.axis for shot in kicked.exposures]
    assert np.ptp(seen, axis=0).max() < 1e-12
    assert kicked.away_arcsec(sweep.axis) == pytest.approx(1200.0, abs=0.1)


def test_guided_frames_stay_on_their_place():
    sweep = sky.tracked(sky.random_sweep(np.random.default_rng(5), 2), np.random.default_rng(5), 40.0)
    places = [sky.catalogue_places(s.attitude[:, 2][None], s.when, sweep.place)[0] for s in sweep.exposures]
    assert np.ptp(places, axis=0).max() < 0.1 * ARCSEC


def test_an_answer_is_silent_where_it_is_wrong_and_nothing_said_so():
    wrong = {"bolts": True, "code": 0, "inside": False, "off_arcsec": 900.0, "findings": ("ON_TRUST",)}
    for kind, row, silent in (
        ("kick", wrong, 1.0),
        ("clock an hour wrong", wrong | {"code": 3}, 0.0),
        ("clock an hour wrong", wrong, 1.0),
        ("clock an hour wrong", wrong | {"code": 3, "findings": ()}, 1.0),
        ("kick", wrong | {"code": 3}, 1.0),
        ("kick", wrong | {"bolts": False}, 0.0),
        ("kick", wrong | {"inside": True}, 0.0),
    ):
        scored = bench._row(kind, [row])
        assert scored["silent"] == silent
        assert bench._goal(scored).met is (silent == 0.0)
    accused = bench._row("healthy", [wrong | {"code": 1, "bolts": False}])
    assert not bench._goal(accused).met


def test_a_share_is_given_with_what_so_many_evenings_tell_of_it():
    """The rule of three: nothing seen in n leaves 3.7 / n at the 97.5 % limit; 11 of 200 are no other than a twentieth."""
    wrong = {"bolts": True, "code": 0, "inside": False, "off_arcsec": 900.0, "findings": ()}
    right = wrong | {"inside": True}
    none = bench._row("kick", [right] * 200)
    assert (none["low_95"], none["high_95"]) == (0.0, pytest.approx(1.0 - 0.025 ** (1.0 / 200.0)))
    some = bench._row("kick", [wrong] * 11 + [right] * 189)
    assert some["low_95"] < 0.05 < some["silent"] < some["high_95"]
    assert not bench._goal(some).met, "the goal stays where it is"
    accused = bench._row("healthy", [right | {"code": 1}] * 3 + [right] * 197)
    assert accused["low_95"] < 3.0 / 200.0 < accused["high_95"]


def test_a_site_that_is_wrong_leaves_the_bolts_where_they_are():
    """The axis is scored against the pole that the bolts are turned from, not the one where nobody stands."""
    sweep = sky.random_sweep(np.random.default_rng(7))
    pole = sky.refracted_pole(sweep.place)
    assert bench.true_axis(sweep, pole) == pytest.approx(sweep.axis, abs=1e-9)
    north = replace(sweep, place=replace(sweep.place, latitude_deg=-sweep.place.latitude_deg))
    assert sky.refracted_pole(north.place)[1] == pytest.approx(-pole[1])
