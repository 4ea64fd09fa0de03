"""Nights for the workflows that move a mount: one good mount, one as amateurs own them."""

from dataclasses import replace

from kochab.core.frame import Site
from kochab.simulate.rig import RigConfig, misaligned, practice_night, tonight
from kochab.workflows.goto_target import target_at
from tests.workflows.rig_mount import Bench

SITE = Site(47.0, 8.0, 450.0)
SOUTH = Site(-33.0, 151.0, 60.0)


def good(lost_deg=1.0, start=(-40.0, 30.0), **config):
    """A perfect mount that stands right but for where it believes to point."""
    return RigConfig(seed=3, site=SITE, date_unix=1.8e9, start_deg=start, lost_deg=lost_deg, **config)


def worn(seed, side=1.0, site=SITE):
    """A worn and misaligned mount that points 3 deg wrong."""
    night = practice_night(misaligned(tonight(seed, site, 1.8e9), None, 3.0), faults=False)
    dec = 20.0 if site is SITE else -20.0
    return replace(night, rate=0.0, start_deg=(35.0 * side, dec))


def bench(config=None, **limits):
    return Bench(config or good(), **limits)


def target_of(bench, hour_deg=-30.0, dec_deg=40.0):
    """A target at an hour angle and declination."""
    return target_at(*bench.place(hour_deg, dec_deg))
