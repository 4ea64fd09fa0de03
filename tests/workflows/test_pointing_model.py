"""A pointing model in use: gotos are aimed by it within the limits, and it is forgotten when it no longer holds."""

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from kochab.core.attitude import apart_deg
from kochab.core.errors import DeviceError, RefusedError, UsageError
from kochab.core.mount import Epoch, PierSide
from kochab.core.progress import run
from kochab.gear.mounts.coordinates import from_mount_epoch
from kochab.gear.mounts.guard import Guard
from kochab.pointing.pointing_model import fit_model
from kochab.workflows.goto_target import Target, aimed, goto_target
from kochab.workflows.pointing_model import load_sightings, save_sightings, use_model
from tests.gear.mounts.bench import LIMITS, SITE, START, place
from tests.gear.mounts.imaginary import Imaginary
from tests.pointing.faulty_mounts import sightings
from tests.pointing.test_pointing_model import bad_mount


def night():
    return START


@pytest.fixture
def model():
    mount, rng = bad_mount(2)
    return replace(fit_model(sightings(mount, 8, rng, sides=True)), site=SITE, made_utc=START - timedelta(hours=1))


@pytest.fixture
def guard():
    def reopen():
        return Imaginary(*place(-20.0, 40.0, night), slew_deg_s=1e6)

    with Guard(reopen(), SITE, LIMITS, clock=night, wait=lambda s: None, reopen=reopen) as guard:
        yield guard


def target(hour_angle_deg, dec_deg):
    from kochab.core.mount import Pointing

    return Target("there", *from_mount_epoch(Pointing(*place(hour_angle_deg, dec_deg, night), Epoch.DATE), START))


def goto(guard, there):
    run(goto_target(guard, there, wait=lambda s: None))
    return [entry.detail for entry in guard.log.sent("goto")][-1]


def test_a_goto_is_sent_where_the_model_aims_and_after_a_sync_where_it_is(guard, model) -> None:
    there = target(-30.0, 50.0)
    plain = guard.to_mount(there.ra_deg, there.dec_deg)
    assert aimed(guard, there) == plain
    use_model(guard, model)
    sent = goto(guard, there)
    command = (sent["ra_deg"], sent["dec_deg"])
    assert command == pytest.approx(model.aim(plain, START))
    assert 0.2 < apart_deg(command, plain) < 5.0
    here = guard.position()
    guard.sync(here.ra_deg + 0.5, here.dec_deg, by_hand=True, confirmed=True)
    assert aimed(guard, there) == plain, "its offsets are those of before the sync"


def test_it_is_forgotten_when_the_line_is_opened_again_or_the_clock_is_set(guard, model) -> None:
    use_model(guard, model)
    guard.reconnect()
    assert guard.supervisor.aim is None
    use_model(guard, model)
    guard.mount.set_clock = lambda now: None
    guard.set_clock()
    assert guard.supervisor.aim is None


@pytest.mark.parametrize("shift_deg", [2.0, -2.0])
def test_neither_the_place_nor_where_the_model_sends_the_mount_may_be_below_the_limit(guard, model, shift_deg) -> None:
    """The limit is 5 deg of altitude, 34.5 deg of Dec on the other side of the equator in the meridian."""
    use_model(guard, replace(model, terms_deg=(0.0, shift_deg, 0.0, 0.0, 0.0)))
    low = -35.0 + 1.0 - shift_deg / 2.0  # one of the two is a degree too low
    with pytest.raises(RefusedError, match="the limit is 5°"):
        goto(guard, target(-1.0, low))
    assert not guard.log.sent("goto")


def test_an_old_model_another_epoch_and_one_that_does_not_help_are_refused(guard, model) -> None:
    for spoilt, reason in (
        (replace(model, made_utc=START - timedelta(hours=20)), "20 h old"),
        (replace(model, made_utc=START + timedelta(hours=2)), "make another"),
        (replace(model, epoch=Epoch.J2000), "coordinates J2000"),
        (replace(model, foretold_arcsec=model.before_arcsec), "does not help"),
    ):
        with pytest.raises(RefusedError, match=reason):
            use_model(guard, spoilt)
    assert guard.supervisor.aim is None


def test_sightings_come_back_from_their_file_as_they_were(tmp_path) -> None:
    mount, rng = bad_mount(4)
    seen = [replace(one, pier_side=PierSide.WEST) for one in sightings(mount, 5, rng, sides=True)]
    file = tmp_path / "night.json"
    assert load_sightings(file) == []
    save_sightings(file, seen)
    again = load_sightings(file)
    assert [(s.sky_deg, s.reported, s.time_utc, s.pier_side, s.site) for s in again] == [
        (s.sky_deg, s.reported, s.time_utc, s.pier_side, s.site) for s in seen
    ]
    assert np.allclose(fit_model(again).terms_deg, fit_model(seen).terms_deg)
    for spoilt in ("", "[]", '{"sightings": [{}]}', '{"sightings": 3}', "\x00"):
        file.write_text(spoilt)
        with pytest.raises(UsageError, match="holds no sightings"):
            load_sightings(file)
    assert issubclass(RefusedError, DeviceError)
