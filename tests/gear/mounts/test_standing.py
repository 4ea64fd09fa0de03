"""A tube that follows the sky or stands is told from one that creeps, by what its readout can show."""

from datetime import UTC, datetime, timedelta
from math import floor

import pytest

from kochab.core.mount import SIDEREAL_DEG_S, Epoch, Pointing
from kochab.gear.mounts import standing
from kochab.gear.mounts.standing import Reading, seen_to_stand

NIGHT = datetime(2026, 1, 15, 22, 0, tzinfo=UTC)
FINE, SECONDS, MINUTES, SIXTEEN_BITS = (0.0, 0.0), (15.0, 1.0), (90.0, 60.0), (19.77539, 19.77539)  # arcsec
READOUTS = pytest.mark.parametrize("steps", [FINE, SECONDS, MINUTES, SIXTEEN_BITS])


class Tube:
    """On a clock of its own; its axes go at ``rates`` beside the stars, in multiples of the sidereal rate."""

    def __init__(self, rates, dec_deg=40.0, steps=FINE, tells_every_s=0.0, epoch=Epoch.DATE):
        self.rates, self.start_deg, self.steps, self.epoch = rates, (123.4567, dec_deg + 0.0123), steps, epoch
        self.tells_every_s = tells_every_s
        self.now_s = 0.13

    def wait(self, seconds):
        self.now_s += seconds

    def read(self):
        asked_s = self.now_s
        self.now_s += 0.05
        then_s = self.tells_every_s * floor(self.now_s / self.tells_every_s) if self.tells_every_s else self.now_s
        places = (a + rate * SIDEREAL_DEG_S * then_s for a, rate in zip(self.start_deg, self.rates, strict=True))
        told = (
            step / 3600.0 * floor(a / (step / 3600.0)) if step else a
            for a, step in zip(places, self.steps, strict=True)
        )
        return Reading(Pointing(*told, self.epoch), asked_s, NIGHT + timedelta(seconds=asked_s), False, self.now_s)

    def stands(self, **how):
        return seen_to_stand(self.read, self.wait, 4, **how)[1]


@READOUTS
@pytest.mark.parametrize("rates", [(0.0, 0.0), (1.0, 0.0), (0.037, 0.0), (0.0, 0.1)])
@pytest.mark.parametrize("dec_deg", [0.0, 70.0, 89.0])
def test_a_tube_that_follows_the_sky_or_stands_below_it_stands(rates, steps, dec_deg) -> None:
    """Also one that follows the Moon, and one whose polar axis stands five degrees off."""
    assert Tube(rates, dec_deg, steps).stands()
    assert Tube(rates, dec_deg, steps, tells_every_s=1.0).stands(lag_s=1.0)


@pytest.mark.parametrize("steps", [FINE, SECONDS])
@pytest.mark.parametrize("rates", [(-0.5, 0.0), (0.0, 0.5), (0.0, -0.5), (-8.0, 0.0), (8.0, 0.0), (2.6, 0.0)])
@pytest.mark.parametrize("dec_deg", [0.0, 70.0])
def test_one_that_creeps_at_the_guide_rate_does_not(rates, steps, dec_deg) -> None:
    assert not Tube(rates, dec_deg, steps).stands()


@READOUTS
@pytest.mark.parametrize("rates", [(-2.0, 0.0), (0.0, 2.0), (8.0, 0.0), (-8.0, 0.0)])
def test_what_whole_minutes_hide_is_slower_than_twice_the_sky(rates, steps) -> None:
    assert not Tube(rates, steps=steps).stands()


@pytest.mark.parametrize("rates", [(8.0, 0.0), (-8.0, 0.0), (0.0, 8.0)])
def test_beside_the_pole_the_axes_tell(rates) -> None:
    """0.02 deg of RA from look to look were less than what a readout in minutes may jump by."""
    assert not Tube(rates, 85.0).stands()


@pytest.mark.parametrize("every_s", [0.5, 1.0, 2.0])
def test_a_place_that_a_server_repeats_shows_nothing(every_s) -> None:
    assert not Tube((8.0, 0.0), tells_every_s=every_s).stands(lag_s=every_s)
    assert not Tube((0.0, -0.8), tells_every_s=every_s).stands(lag_s=every_s)


def test_fine_and_fast_is_told_by_two_looks_and_coarse_and_slow_by_as_many_as_it_takes() -> None:
    def looks(**how):
        tube = Tube((0.0, 0.0), steps=how.pop("steps", FINE))
        return len(seen_to_stand(tube.read, tube.wait, 4, **how)[0])

    assert looks(slowest_deg_s=0.05) == looks(slowest_deg_s=0.05, steps=SECONDS) == 2
    assert looks() == 4
    assert looks(steps=SECONDS) == 7  # 16 arcsec at 0.3 of 15 arcsec a second, in 0.7 s each
    assert looks(steps=MINUTES) == 9
    assert looks(slowest_deg_s=0.05, lag_s=2.5) == 5


def test_a_fast_motion_is_told_after_the_looks_in_which_it_might_run_out() -> None:
    tube = Tube((0.0, 4000.0))
    assert len(seen_to_stand(tube.read, tube.wait, 4)[0]) == 4


def test_what_was_brought_to_another_epoch_counts_in_nothing() -> None:
    """Seconds of RA may be behind it, which a tube that stands between two of them may tell in turn."""
    tube = Tube((0.0, 0.0), epoch=Epoch.J2000)
    read, jumps = tube.read, iter([0.0, 0.0, 15.0, 0.0, 15.0, 0.0, 0.0, 15.0, 0.0])

    def flickers():
        seen = read()
        here = Pointing(seen.here.ra_deg + next(jumps) / 3600.0, seen.here.dec_deg, Epoch.J2000)
        return Reading(here, seen.asked_s, seen.asked, False, seen.answered_s)

    assert seen_to_stand(flickers, tube.wait, 4)[1]


def test_a_late_answer_of_a_tube_that_stands_below_the_sky_is_no_motion() -> None:
    tube = Tube((1.0, 0.0))
    read, late = tube.read, iter([0.0, 0.0, 0.0, 6.0, 0.0, 0.0, 0.0, 0.0])

    def slow():
        asked_s = tube.now_s
        tube.now_s += next(late)
        seen = read()
        return Reading(seen.here, asked_s, NIGHT + timedelta(seconds=asked_s), False, seen.answered_s)

    assert seen_to_stand(slow, tube.wait, 4)[1]


def test_what_a_simulated_clock_says_counts_where_it_runs_faster() -> None:
    def seen(at_s, ra_deg):
        return Reading(Pointing(ra_deg, 40.0, Epoch.DATE), 0.0, NIGHT + timedelta(seconds=at_s))

    later = 100.0 * SIDEREAL_DEG_S
    assert seen(100.0, 10.0 + later).agrees(seen(0.0, 10.0))
    assert not seen(10.0, 10.0 + later).agrees(seen(0.0, 10.0))
    assert standing.LONGEST_S * SIDEREAL_DEG_S > standing.STILL_DEG
